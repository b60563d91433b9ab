"""Healthy channels where slow-fault tests are most easily wrong: stops, turns, gaps, two left, a third that is still.

    python tests/tools/healthy_beside.py [--every 1]

Flights of 28 s with stick and pedal moved by hand, on three aircraft: full deflections in light turbulence, the others
in severe; two left: channels 3 and 4 of all 16 signals, or of one, fail in the first second.  In still air steady turns
of up to 100 s at 45 or 60 deg of bank, and turns with a channel that is invalid in every other frame.  Prints by row in
how many flights a healthy channel was isolated, and in how many a test did it.  Two minutes.
"""

from __future__ import annotations

import argparse
import random
from collections.abc import Iterator
from typing import Any, Final

from rig.core.frame import INDEX, SIGNALS, Table
from rig.flight.loop import fly_rows
from rig.flight.stages import redundancy
from rig.scenario.scenario import load
from rig.verdict.scoring import score

AIRCRAFT: Final = ("f16", "b747", "b737")
TESTS: Final = ("slow_means", "slow_squares", "slow_halves")
SEED: Final = 4711


def moved(amplitude: float) -> list[dict[str, Any]]:
    """A doublet of each lever."""
    times = {"stick_roll": (11.0, 3.0), "stick_pitch": (15.0, 4.0), "pedal": (20.0, 4.0)}
    return [
        {"kind": "doublet", "axis": axis, "start_s": start_s, "amplitude": amplitude, "duration_s": duration_s}
        for axis, (start_s, duration_s) in times.items()
    ]


def two_gone(signal: str) -> list[dict[str, Any]]:
    """Hardovers of channels 4 and 3."""
    fault = {"kind": "hardover", "signal": signal}
    return [
        fault | {"channels": [4], "direction": "high", "start_s": 0.5},
        fault | {"channels": [3], "direction": "low", "start_s": 1.0},
    ]


def noise_of(signal: str) -> float:
    """Standard deviation of a sample, unit of the signal, as the tests have it."""
    params = redundancy(load("f16_altitude_step_turbulence")).manager.data.params
    return 2.0 * float(params["slow_noise"][INDEX[signal]])


def thirds(signal: str) -> dict[str, list[dict[str, Any]]]:
    """Faults of channel 2 at 9 s that leave it smoother than the healthy one."""
    fault = {"signal": signal, "channels": [2], "start_s": 9.0}
    return {
        "frozen behind a noisy converter": [
            fault | {"kind": "stuck"},
            fault | {"kind": "noise", "std": noise_of(signal)},
        ],
        "gain of 0.5": [fault | {"kind": "scale", "factor": 0.5}],
        "gain of 0": [fault | {"kind": "scale", "factor": 0.0}],
    }


def flights() -> Iterator[tuple[str, dict[str, Any]]]:
    """The row and the scenario of every flight."""
    drawn = random.Random(SEED)
    for aircraft in AIRCRAFT:
        common: dict[str, Any] = {"title": "Healthy beside", "aircraft": aircraft, "duration_s": 28.0}
        common |= {"flight_point": "20000ft_m06", "turbulence": "severe"}

        def flight(faults: list[dict[str, Any]], amplitude: float, common: dict[str, Any] = common) -> dict[str, Any]:
            pilot = {"autopilot_engaged": False, "manoeuvres": moved(amplitude)}
            return common | {"seed": drawn.randrange(1, 10**6), "pilot": pilot, "faults": faults}

        for _ in range(30):
            yield "full deflections", flight([], 1.0) | {"turbulence": "light"}
        for _ in range(30):
            yield "two left", flight([fault for each in SIGNALS for fault in two_gone(each.name)], 0.4)
        for each in SIGNALS:
            for name, faults in thirds(each.name).items():
                for _ in range(2):
                    yield f"two left, then {name}", flight([*two_gone(each.name), *faults], 0.4)


def turns() -> Iterator[tuple[str, dict[str, Any]]]:
    """The row and the scenario of every flight that turns."""
    drawn = random.Random(-SEED)
    for aircraft, bank_rad, hold_s in (
        ("f16", 1.05, 40.0),
        ("f16", 1.05, 100.0),
        ("b737", 0.785, 60.0),
        ("b747", 0.785, 60.0),
    ):
        hold = {"kind": "hold", "axis": "roll_angle", "start_s": 20.0, "duration_s": hold_s, "amplitude": bank_rad}
        common = {"title": "Turn", "aircraft": aircraft, "duration_s": hold_s + 50.0, "pilot": {"manoeuvres": [hold]}}
        common |= {"control": {"lateral": "roll", "max_bank_rad": bank_rad}}
        for _ in range(12):
            yield "steady turns", common | {"seed": drawn.randrange(1, 10**6)}
    step = {"kind": "step", "axis": "heading", "start_s": 30.0, "amplitude": 0.5236}
    for aircraft in AIRCRAFT:
        common = {"title": "Turn", "aircraft": aircraft, "duration_s": 60.0, "pilot": {"manoeuvres": [step]}}
        for name in ("roll_angle", "roll_rate", "heading", "pitch_angle"):
            fault = {"kind": "intermittent", "signal": name, "channels": [4], "start_s": 20.0, "in_gaps": "invalid"}
            for _ in range(3):
                flight = common | {
                    "seed": drawn.randrange(1, 10**6),
                    "faults": [fault | {"gap_s": 0.01, "contact_s": 0.01}],
                }
                yield "a channel invalid in every other frame", flight


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description="Healthy channels where slow-fault tests are most easily wrong.")
    parser.add_argument("--every", type=int, default=1, help="fly every n-th")
    rows: dict[str, list[int]] = {}
    for row, scenario in [*flights(), *turns()][:: parser.parse_args().every]:
        loaded = load(scenario)
        flown = score(loaded, Table(fly_rows(loaded)))
        healthy = [*flown.false_alarms, *flown.wrong_isolations]
        counts = rows.setdefault(row, [0, 0, 0])
        for i, counted in enumerate((True, bool(healthy), any(each.decided_by in TESTS for each in healthy))):
            counts[i] += counted
    for row, (flown_of, isolated, by_tests) in rows.items():
        print(f"{row:45} {flown_of:4} flights, a healthy channel isolated in {isolated}, by a test in {by_tests}")


if __name__ == "__main__":
    main()
