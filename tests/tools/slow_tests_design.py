"""Factors of the slow-fault tests and errors of the references, of healthy flights: what a settings file needs.

    python tests/tools/slow_tests_design.py fly CAMPAIGN FLIGHTS FOLDER     fly some of a campaign's healthy flights
    python tests/tools/slow_tests_design.py read FOLDER [MARGIN] [TABLES]   print the largest shares; write tables

The tests run with factors of 1, and no channel is isolated: each share is that of the bare limit.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.slow_tests import isolate_slow
from rig.computer.redundancy.slow_tests_config import SlowTests, tests_params
from rig.computer.redundancy.state import new_state
from rig.core.frame import SIGNALS, S
from rig.core.kernels import kernel
from rig.flight import loop
from rig.scenario import aircraft
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.verdict.monitored_places import monitor
from rig.world import sensors
from rig.world.sensors.data_sheet import DataSheet

MOST_ERROR = 0.4  # thresholds: a reference in error by more decides nothing
BINS, FIELDS = 40, ("channels", "valid", "ilm", "reference", "second_reference")
NAMES = [signal.name for signal in SIGNALS]


def fly(campaign: Path, flights: int, folder: Path) -> None:
    """Keep what the manager reads of ``flights`` of a campaign, spread over it, and the settings of its signals."""
    plan = Plan(read(campaign, {}), str(campaign))
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(flights):
        run = plan[i * len(plan) // flights if flights < 120 else i]
        scenario = run.scenario(aircraft.tables(run.aircraft))
        rows = loop.fly_rows(scenario)
        kept = {name: np.ascontiguousarray(rows[name]) for name in FIELDS}
        sheets = np.array(sensors.data_sheets(scenario.sensors, scenario.rate_hz))
        kept |= {"params": monitor(scenario), "sheets": sheets}
        np.savez(folder / f"{i:03d}.npz", allow_pickle=False, **kept)
        print(i, scenario.aircraft, len(rows), flush=True)


@kernel
def shares(channels, valid, ilm, reference, second, bare, on, state, out, error, frames):
    """Run the tests over the rows of a flight; out (S, 3) : largest shares; error (S, BINS) : references'."""
    for k in range(len(channels)):
        for s in range(channels.shape[1]):
            p, q, st = bare[s], on[s], state[s]
            manage_signal(channels[k, s], valid[k, s], ilm[k, s], reference[k, s], second[k, s], p, st)
            if st["last_n"] == st["level"]:
                isolate_slow(reference[k, s], st["last_n"], q, st)
            t = st["tests"]
            if st["last_n"] < 2 or t["learned"] < 200:
                continue
            sigma2 = max(t["noise"], t["shaken"], q["slow_noise"] ** 2)
            for c in range(4):
                means = max(abs(t["fast"][c]) / t["fast_limit"], abs(t["slow"][c]) / t["slow_limit"])
                out[s, 0] = max(out[s, 0], means)
                if t["learned"] >= 500:
                    out[s, 1] = max(out[s, 1], (t["square"][c] / sigma2 - 1.0) / t["square_limit"])
            out[s, 2] = max(out[s, 2], t["halves_share"])
            if t["reference_learned"] > 500 and np.isfinite(t["reference_off"]):
                frames[s] += 0.04 * (t["reference_off"] - frames[s])
                b = min(int(t["motion"] / (0.01 * p["threshold"])), error.shape[1] - 1)
                error[s, b] = max(error[s, b], abs(frames[s]))


def measured(file: Path, factors: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Shares (S, 3), errors of the references (S, BINS) in thresholds, params of a kept flight."""
    with np.load(file) as kept:
        bare = kept["params"]
        for name in bare.dtype.names:
            if name.startswith("slow_") and name not in ("slow_limit", "slow_allowance"):
                bare[name] = 0.0
        on = bare.copy()
        for i, name in enumerate(NAMES):
            for key, value in tests_params(factors.get(name, SlowTests()), DataSheet(*kept["sheets"][i])).items():
                on[i][key] = value
        out, error = np.zeros((S, 3)), np.zeros((S, BINS))
        channels, valid, ilm, reference, second = (kept[name] for name in FIELDS)
        shares(channels, valid, ilm, reference, second, bare, on, new_state(bare), out, error, np.zeros(S))
        return out, error / bare["threshold"][:, None], bare


def settings(largest: Any, errors: Any, threshold: float, margin: float) -> dict[str, float]:
    """The keys of slow_tests: ``margin`` times the largest shares (3,), 1.2 times the largest errors (BINS,)."""
    means, squares, halves = (margin * float(x) for x in largest)
    told = {"factor": max(1.2, means), "squares_factor": max(1.3, squares), "halves_factor": max(1.0, halves)}
    level = max(1.2 * errors[0], 0.02)
    if errors.any() and level < MOST_ERROR:
        rises = [(1.2 * e - level) / (0.01 * b) for b, e in enumerate(errors) if b > 0 and e > 0.0]
        told |= {"reference_error": level * threshold, "reference_frames": max(0.0, *rises)}
    return {key: float(f"{value:.3g}") for key, value in told.items()}


def design(folder: Path, margin: float, tables: Path | None) -> None:
    """Print the largest shares and the settings of each signal, and write them."""
    found = [measured(file, {}) for file in sorted(folder.glob("*.npz"))]
    largest, errors = np.max([of[0] for of in found], axis=0), np.max([of[1] for of in found], axis=0)
    lines = list[str]()
    for i, name in enumerate(NAMES):
        told = settings(largest[i], errors[i], float(found[0][2]["threshold"][i]), margin)
        print(f"{name:26}", *(f"{x:8.2f}" for x in largest[i]), f"{errors[i, 0]:8.3f}", told)
        lines += [f"[{name}]", *(f"{key} = {value}" for key, value in told.items())]
    if tables is not None:
        tables.write_text("\n".join(lines) + "\n")


def main() -> None:
    """See above."""
    if sys.argv[1] == "fly":
        fly(Path(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
    else:
        margin, tables = [*sys.argv[3:], "1.3"][0], Path(sys.argv[4]) if len(sys.argv) > 4 else None
        design(Path(sys.argv[2]), float(margin), tables)


if __name__ == "__main__":
    main()
