"""Small faults found, by place and state of the reference: the built-in manager without and with slow-fault tests.

    python tests/tools/slow_tests_table.py [--trials 20] [--aircraft f16 b737 b747]

Trials of each combination of 16 signals and six forms of fault, in every place, of small faults and of those of
docs/examples/benchmark.toml; no aircraft flies but for the frames that the trials share.  Sizes are in thresholds.
Two minutes an aircraft.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.random import SFC64, Generator

from rig.computer.redundancy.managers import Manager
from rig.computer.redundancy.slow_tests_config import OFF
from rig.core.frame import SIGNALS
from rig.core.settings import read_toml
from rig.scenario.scenario import find
from rig.studies.benchmark.benchmark_trials import _whole, became, shared_out, streams_of, with_reference
from rig.studies.campaign.campaign_file import Campaign, from_what
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.cell_trials import Recordings, fly_trials
from rig.studies.reliability.drawn import Cell, cell, draw, refill

STATES: Final = ("as flown", "off", "absent")
AIRCRAFT: Final = {
    "f16": {},
    "b737": {"aircraft": "b737", "flight_point": "20000ft_m06"},
    "b747": {"aircraft": "b747", "flight_point": "20000ft_m06"},
}
TESTED: Final = {"id": "tested", "channels": [2]}
ANOTHER: Final = {"kind": "hardover", "direction": "either", "channels": [4], "start_s": 0.5}
LATER: Final[dict[str, Any]] = {"faults.0.start_s": {"low": 14.0, "high": 19.0}}
PLACES: Final[dict[str, tuple[list[dict[str, Any]], dict[str, Any]]]] = {
    "alone": ([TESTED], LATER),
    "after another": ([TESTED, ANOTHER], LATER),
    "from the first frame": ([TESTED | {"start_s": 0.0}], {}),
    "two alike": ([TESTED | {"channels": [2, 3]}], LATER),
    "third": ([TESTED, ANOTHER, ANOTHER | {"channels": [3], "start_s": 4.0}], LATER),
    "beside a slow drift": (
        [TESTED, {"kind": "drift", "rate_thresholds_per_s": 0.02, "channels": [3], "start_s": 0.0}],
        LATER,
    ),
}
# Sizes of small faults; those of the benchmark are up to 6.7 times as large.
FORMS: Final[dict[str, tuple[str, dict[str, tuple[float, float]]]]] = {
    "offset up": ("offset", {"offset_thresholds": (0.015, 0.45)}),
    "offset down": ("offset", {"offset_thresholds": (-0.45, -0.015)}),
    "drift": ("drift", {"rate_thresholds_per_s": (0.0075, 0.45)}),
    "oscillation": ("oscillation", {"amplitude_thresholds": (0.03, 0.75)}),
    "noise": ("noise", {"std_thresholds": (0.015, 0.45)}),
    "stuck": ("stuck", {}),
}
FREQUENCY: Final = {"faults.0.frequency_hz": {"low": 0.5, "high": 10.0, "log": True}}
SIZES: Final = {"0.015 to 0.45": 1.0, "0.1 to 3": 20 / 3}
# Error of a reference that is off: about its largest in healthy flights, in the unit of the signal.
WORST: Final = {
    "pitch_rate": 0.0527645,
    "roll_rate": 0.02398,
    "yaw_rate": 0.0434995,
    "normal_load_factor": 0.360551,
    "lateral_load_factor": 0.101655,
    "longitudinal_load_factor": 0.0354488,
    "angle_of_attack": 0.0661568,
    "angle_of_sideslip": 0.044805,
    "static_pressure": 15.0886,
    "dynamic_pressure": 4904.55,
    "pitch_angle": 0.0212805,
    "roll_angle": 0.0254776,
    "heading": 0.00355716,
}


def sizes_of(form: str, factor: float) -> dict[str, dict[str, Any]]:
    """What varies in a form of fault."""
    kind, sizes = FORMS[form]
    what = {
        f"faults.0.{key}": {"low": factor * low, "high": factor * high, "log": True}
        for key, (low, high) in sizes.items()
    }
    return what | (FREQUENCY if kind == "oscillation" else {})


def campaign(aircraft: str, factor: float) -> Campaign:
    """Every form of fault on every signal in every place, from 14 to 19 s: biases are learned by then."""
    quiet = {
        f"sensors.{name}.monitor.false_alarm_per_hour": 0.0 for name in ("stick_pitch", "stick_roll", "pedal")
    }  # of these no trial could tell an alarm from a fault
    flight = {"duration_s": 30.0, "pilot.manoeuvres.0.start_s": 13.0, **quiet, **AIRCRAFT[aircraft]}
    forms = [
        {
            "name": f"{signal.name}, {form}",
            "set": {"faults.*.signal": signal.name, "faults.0.kind": FORMS[form][0]},
            "vary": sizes_of(form, factor),
        }
        for signal in SIGNALS
        for form in FORMS
    ]
    designs = [{"name": name, "set": {"faults": faults}, "vary": vary} for name, (faults, vary) in PLACES.items()]
    table = {
        "title": "Small faults on sixteen signals",
        "base": read_toml(find("f16_pitch_rate_offset_in_manoeuvre")),
        "sampling": "stratified",
        "runs": len(forms) * len(designs),
        "seed": 35,
        "set": flight,
        "cases": {"design": designs, "form": forms},
    }
    return from_what(table, "small faults")


def managers(made: Cell) -> dict[str, Manager]:
    """The rows of the table."""
    bare = made.one.manager.params.copy()
    for key in OFF:
        bare[key] = 0.0
    return {"without": Manager("cross-channel", bare), "with": made.one.manager}


def trials(aircraft: str, count: int, sizes: str) -> Iterator[dict[str, Any]]:
    """A record of each trial, manager and state of the reference."""
    plan = Plan(campaign(aircraft, SIZES[sizes]), "small faults")
    recordings = Recordings(plan)
    for unit in shared_out(plan, count, 0):
        made, choice = cell(plan, unit.number, named=False), plan.choices[unit.number]
        name, streams = made.scenario.faults[made.tested].signal, streams_of(unit)
        stuck = made.scenario.faults[made.tested].kind == "stuck"
        drawn = _whole(draw(made, unit.trials, recordings(unit, made, ""), Generator(SFC64(streams[0]))))
        differs = not stuck or bool(np.ptp(drawn.truth) > 0.0)  # a stick that stands still may be stuck
        for state in STATES:
            seen = with_reference(made, drawn, state, WORST.get(name, 0.0))
            for who, manager in managers(made).items():
                told = made._replace(one=made.one._replace(manager=manager))
                again = partial(refill, seen, *(Generator(SFC64(child)) for child in streams[1:]))
                outcomes = became(made, drawn.onset, fly_trials(told, seen, again)[0])["outcome"]
                place = {"place": choice["design"], "signal": name, "state": state, "sizes": sizes, "manager": who}
                yield from ({**place, "differs": differs, "outcome": str(outcome)} for outcome in outcomes)


def share(part: pl.DataFrame) -> str:
    """Isolated, and healthy channels failed, in percent."""
    words = part["outcome"].to_list()
    isolated, missed = (words.count(word) for word in ("isolated", "missed"))
    return f"{100 * isolated / len(words):5.1f} ({100 * (len(words) - isolated - missed) / len(words):4.1f})"


def show(table: pl.DataFrame) -> None:
    """Print shares by place, state and sizes, those of all places, and those of each signal."""
    print("isolated, % (healthy channel failed)")
    for (place, state), part in table.group_by("place", "state", maintain_order=True):
        show_row(f"{place:22} {state:10}", part)
    flown = table.filter(pl.col("state") == STATES[0])
    show_row(f"{'all places':22} {STATES[0]:10}", flown)
    referred, between = pl.col("signal").is_in(list(WORST)), pl.col("place").is_in(["two alike", "third"])
    show_row("all places, signals with a reference", flown.filter(referred))
    show_row("all places, signals without", flown.filter(~referred))
    show_row("all places, without stuck sticks that stand still", flown.filter("differs"))
    show_row(
        "and without two alike and thirds that no reference tells apart", flown.filter("differs", referred | ~between)
    )
    for (signal,), part in flown.group_by("signal", maintain_order=True):
        show_row(f"{signal:22} {STATES[0]:10}", part)


def show_row(name: str, table: pl.DataFrame) -> None:
    """Print the shares of each range of sizes, and those of all of them."""
    parts = {sizes: table.filter(pl.col("sizes") == sizes) for sizes in SIZES} | {"all": table}
    print(name)
    for sizes, part in parts.items():
        rows = part.group_by("manager", maintain_order=True)
        print(f"    {sizes:14}", *(f"{who}: {share(of)}" for (who,), of in rows), sep="  ")


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description="Small faults, without and with slow-fault tests.")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--aircraft", nargs="+", choices=AIRCRAFT, default=list(AIRCRAFT))
    asked = parser.parse_args()
    tables = []
    for aircraft in asked.aircraft:
        tables.append(pl.DataFrame([row for sizes in SIZES for row in trials(aircraft, asked.trials, sizes)]))
        print(aircraft, end=": ")
        show(tables[-1])
    if len(tables) > 1:
        print("all", end=": ")
        show(pl.concat(tables))


if __name__ == "__main__":
    main()
