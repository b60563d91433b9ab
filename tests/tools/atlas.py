"""The atlas of worst cases: docs/results/measured/worst.md, docs/pictures/worst.svg, and a list for faults/worst/.

    python tests/tools/atlas.py search OUT.json [--flights 96] [--workers 2]     # every cell, resumed where it stopped
    python tests/tools/atlas.py scenarios OUT.json [--workers 2]                 # faults/worst/*.toml, by flights
    python tests/tools/atlas.py page OUT.json                                    # its page and picture

A cell is a manager, an aircraft, a signal and a number of faults (search_here.space). It is searched open loop; the
candidate of the least robustness is then flown on five new seeds.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from multiprocessing import Pool
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from atlas_page import name_of, write
from search_here import REQUIREMENT, plan_of, search_here, space

from rig.core.frame import INDEX, Block, State
from rig.core.settings import build
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario
from rig.studies.campaign.flying import fly
from rig.studies.search import confirm_worst as confirm
from rig.studies.search.confirm_worst import new_seeds
from rig.studies.search.objective import Measured
from rig.studies.search.search_result import write_scenario
from rig.studies.search.shrink import SEEDS as FEW
from rig.studies.search.shrink import UNDO_SEEDS, shrink, simplest
from rig.verdict.requirements.measure import check_rows

MANAGERS: Final = ("cross-channel", "median", "mean")
AIRCRAFT: Final = ("f16", "b747", "b737")
SIGNALS: Final = ("pitch_rate", "normal_load_factor", "static_pressure", "angle_of_attack")
FAULTS: Final = (1, 2, 3)
SEEDS: Final = 5
CELLS: Final = [(m, a, s, n) for m in MANAGERS for a in AIRCRAFT for s in SIGNALS for n in FAULTS]
WRITTEN: Final = (  # cells whose scenario is made simple and kept
    ("cross-channel", "f16", "pitch_rate", 3),
    ("cross-channel", "f16", "normal_load_factor", 3),
    ("cross-channel", "f16", "static_pressure", 3),
    ("cross-channel", "b737", "angle_of_attack", 3),
    ("cross-channel", "b747", "angle_of_attack", 2),
    ("median", "f16", "pitch_rate", 2),
    ("mean", "f16", "pitch_rate", 1),
)
ROOT: Final = Path(__file__).parents[2]
Cell = tuple[str, str, str, int]


def search(job: tuple[Cell, int]) -> dict[str, Any]:
    """Return what the search of one cell found."""
    (manager, plane, signal, faults), flights = job
    plan = plan_of(space(manager, plane, signal, faults), flights)
    found = search_here(plan)
    best = min(range(len(found)), key=lambda i: found[i].value)
    violated = [i for i, each in enumerate(found) if each.violated]
    table = plan.data(best)
    flown = [_flown(table, seed, plan.requirements) for seed in new_seeds(plan.campaign, flights, SEEDS)]
    robustness = [found for found, _, _ in flown]
    worst = flown[int(np.argmin(robustness))]
    return {
        "manager": manager,
        "aircraft": plane,
        "signal": signal,
        "faults": faults,
        "trials": len(found),
        "trials_to_first": violated[0] + 1 if violated else None,
        "robustness": min(each.robustness for each in found),
        "flown_robustness": float(median(robustness)),
        "flown_violated": sum(violates for _, violates, _ in flown),
        "scenario": _brief(table["faults"]),
        "why": worst[2],
        "table": table,
    }


def simplify(found: dict[str, Any]) -> str:
    """Make a cell's scenario simple by flights, and write it; return its name and on how many seeds it violates."""
    cell = tuple(found[key] for key in ("manager", "aircraft", "signal", "faults"))
    plan = plan_of(space(*cell), found["trials"])
    first = found["trials"] + SEEDS
    few, others = new_seeds(plan.campaign, first, FEW), new_seeds(plan.campaign, first + FEW, UNDO_SEEDS)
    many = new_seeds(plan.campaign, first + FEW + UNDO_SEEDS, confirm.SEEDS)

    def flights(tables: Sequence[dict[str, Any]]) -> list[Measured]:
        flown = [_flown(table, table["seed"], plan.requirements) for table in tables]
        return [Measured(found, 0.0, violates) for found, violates, _ in flown]

    small = simplest(shrink(found["table"], few, flights), others, confirm.counting(flights))
    simple = confirm.confirm([small], many, flights)[0]
    path = ROOT / "faults" / "worst" / f"{name_of(found)}.toml"
    path.parent.mkdir(exist_ok=True)
    write_scenario(path, plan, simple)
    return f"{path.name}: {simple.violations} of {len(many)}"


def _flown(table: dict[str, Any], seed: int, requirements: Any) -> tuple[float, bool, str]:
    """Return least robustness of the vote, whether it is violated, and why, of a flight."""
    data = aircraft.merge(aircraft.tables(table["aircraft"]), {**table, "seed": seed})
    scenario = build(Scenario, data, "atlas")
    flight = fly(scenario)
    verdict = next(each for each in check_rows(flight.rows, scenario, requirements) if each.requirement == REQUIREMENT)
    return verdict.robustness, verdict.status == "violated", why(scenario, flight.rows, verdict.instant_s)


def why(scenario: Scenario, rows: Block, instant_s: float) -> str:
    """Return one line: the channels in use at the worst instant, and the isolated ones."""
    signal = scenario.faults[0].signal
    faulty = {point.channel for fault in scenario.faults for point in fault.points}
    frame = min(round(instant_s * scenario.rate_hz), len(rows) - 1)
    failed = [c + 1 for c in range(4) if rows["state"][frame, INDEX[signal], c] == State.FAILED]
    healthy = [c for c in failed if c not in faulty]
    off = abs(float(rows["voted"][frame, INDEX[signal]] - rows["truth"][frame, INDEX[signal]]))
    times = off / getattr(scenario.redundancy.signals, signal).threshold
    begin = f"at {instant_s:.1f} s the vote is off by {times:.2g} thresholds"
    lost = ", the aircraft is lost" if len(rows) < scenario.frames else ""
    if healthy:
        return f"{begin}: healthy {_listed(healthy)} failed, as the faulty ones agree{lost}"
    if failed:
        return f"{begin}: {_listed(failed)} failed, {len(faulty) - len(failed)} faulty in the vote{lost}"
    return f"{begin}: no channel failed{lost}"


def _listed(channels: list[int]) -> str:
    return f"channel{'s' if len(channels) > 1 else ''} {' and '.join(map(str, channels))}"


def _brief(faults: list[dict[str, Any]]) -> str:
    """Return the faults as one line."""
    texts = []
    for fault in faults:
        size = next(value for key, value in fault.items() if "thresholds" in key)
        unit = "/s" if fault["kind"] == "drift" else ""
        texts.append(f"{size:.2g}{unit} at {fault['start_s']:.2f} s")
    return f"{faults[0]['kind']} {', '.join(texts)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("search", "scenarios", "page"))
    parser.add_argument("results", type=Path)
    parser.add_argument("--flights", type=int, default=96)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    done = json.loads(given.results.read_text()) if given.results.exists() else {}
    if given.what == "page":
        write([{**each, "seeds": SEEDS} for each in done.values()], ROOT, SEEDS)
        return
    if given.what == "scenarios":
        with Pool(given.workers) as pool:
            for line in pool.imap_unordered(simplify, [done[" ".join(map(str, cell))] for cell in WRITTEN]):
                print(line, flush=True)
        return
    jobs = [(cell, given.flights) for cell in CELLS if " ".join(map(str, cell)) not in done]
    with Pool(given.workers) as pool:
        for found in pool.imap(search, jobs):
            name = " ".join(str(found[key]) for key in ("manager", "aircraft", "signal", "faults"))
            done[name] = found
            given.results.write_text(json.dumps(done, indent=1))
            print(
                f"{len(done)}/{len(CELLS)} {name}: {found['robustness']:.2f} {found['flown_violated']} of {SEEDS}",
                flush=True,
            )


if __name__ == "__main__":
    main()
