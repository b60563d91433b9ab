"""Small single faults in flights: the built-in manager without and with slow-fault tests.

    python tests/tools/small_faults_flown.py [--every 1]

Offsets and drifts of 0.5 to 1.6 times SMALLEST, on three aircraft, half of them in a climb and turn: 72 flights of
34 s, twice.  Right: the channel with the fault is isolated, and no other of any signal.  Half a minute.
"""

from __future__ import annotations

import argparse
import random
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import rig
from rig.core.frame import SIGNALS

# Offsets that the comparison without the tests always isolates are larger; SI.
SMALLEST: Final = {"pitch_rate": 0.0084, "static_pressure": 85.0, "angle_of_attack": 0.0108}
OFF: Final = {"signals": {signal.name: {"slow_tests": False} for signal in SIGNALS}}
STEPS: Final = [
    {"kind": "step", "axis": "altitude", "start_s": 6.0, "amplitude": 60.0},
    {"kind": "step", "axis": "heading", "start_s": 6.0, "amplitude": 0.5},
]


class Flown(NamedTuple):
    """One flight's scenario, and which channel of which signal has its fault."""

    scenario: dict[str, Any]
    signal: str
    channel: int


def flights() -> list[Flown]:
    """All of them, drawn from one seed."""
    drawn, made = random.Random(2611), list[Flown]()
    for aircraft in ("f16", "b747", "b737"):
        for signal, smallest in SMALLEST.items():
            for times in (0.5, 0.8, 1.2, 1.6):
                for kind in ("offset", "drift"):
                    channel, start_s, sign = drawn.randint(1, 4), drawn.uniform(12.0, 16.0), drawn.choice((1, -1))
                    size = sign * times * smallest
                    fault = {"kind": kind, "signal": signal, "channels": [channel], "start_s": start_s}
                    fault |= {"offset": size} if kind == "offset" else {"rate_per_s": size / 5.0}
                    scenario = {"title": "A small fault", "aircraft": aircraft, "duration_s": 34.0, "faults": [fault]}
                    scenario["seed"] = drawn.randrange(1, 9999)
                    scenario["pilot"] = {"manoeuvres": STEPS if drawn.random() < 0.5 else []}
                    scenario["turbulence"] = drawn.choice(("light", "moderate"))
                    made.append(Flown(scenario, signal, channel))
    return made


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description="Small faults in flights, without and with slow-fault tests.")
    parser.add_argument("--every", type=int, default=1, help="fly every n-th")
    flown = flights()[:: parser.parse_args().every]
    for who, redundancy in (("without", {"redundancy": OFF}), ("with", {})):
        right = wrong = 0
        for scenario, signal, channel in flown:
            with TemporaryDirectory() as folder:
                failed = rig.fly(scenario | redundancy, out=f"{folder}/flight").failed
            told = {(name, c) for name, channels in failed.items() for c in channels}
            right += told == {(signal, channel)}
            wrong += bool(told - {(signal, channel)})
        print(f"{who:8} right {right} of {len(flown)}, a healthy channel isolated in {wrong}", flush=True)


if __name__ == "__main__":
    main()
