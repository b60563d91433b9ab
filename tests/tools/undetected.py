"""How far the aircraft moves when a fault stays just below the thresholds: against the same flight without it.

    python tests/tools/undetected.py

Two channels of four off alike by 0.9 of the threshold of two against two, and one of the last two; each signal up and
down, level and in a pitch manoeuvre, F-16, B747, B737.  Limits: 0.5 g and 10 deg/s.  Printed: the worst of each signal.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from typing import Any, Final

import numpy as np
from evidence import AIRCRAFT, SIGNAL_NAMES, Table, flight, manoeuvre, offset, toml

from rig import scenario
from rig.campaign.flying import fly
from rig.frame import INDEX

SHARE: Final = 0.9
ONSET_S: Final = 4.0
LIMIT_G: Final = 0.5
LIMIT_DEG_S: Final = 10.0
CONDITIONS: Final = {
    "level": (),
    "manoeuvre": (
        "pilot.autopilot_engaged=false",
        "pilot.manoeuvres=" + toml([manoeuvre("3-2-1-1", "stick_pitch", 3.0, 0.3, duration_s=3.5)]),
    ),
}
GONE: Final = [{"kind": "hardover", "channels": [c], "start_s": 0.5 + 0.4 * i} for i, c in enumerate((3, 4))]
RATES: Final = ("roll_rate", "pitch_rate", "yaw_rate")


def rows(aircraft: str, condition: str, faults: list[Table]) -> Any:
    """The frames of a flight of ten seconds."""
    one = flight("undetected", "", aircraft, 10.0, faults, *CONDITIONS[condition], "seed=3")
    return fly(scenario.load(None, one.sets)).rows


def moved(one: tuple[str, str, str, str]) -> tuple[str, str, float, float, int]:
    """Signal, design, largest change of normal load factor [g] and of a body rate [deg/s], found after all."""
    aircraft, condition, name, design = one
    earlier = [] if design == "two alike" else [{**table, "signal": name} for table in GONE]
    channels = [1, 2] if design == "two alike" else [1]
    usual = rows(aircraft, condition, earlier)["truth"]
    worst, failed = [0.0, 0.0], 0
    for sign in (1, -1):
        flown = rows(aircraft, condition, [offset(name, channels, sign * SHARE, ONSET_S), *earlier])
        n = min(len(flown), len(usual))
        apart = np.abs(flown["truth"][:n] - usual[:n])
        worst[0] = max(worst[0], float(apart[:, INDEX["normal_load_factor"]].max()))
        worst[1] = max(worst[1], float(np.degrees(apart[:, [INDEX[rate] for rate in RATES]].max())))
        failed += int(flown["level"][-1, INDEX[name]] < usual_level(design))
    return name, design, worst[0], worst[1], failed


def usual_level(design: str) -> int:
    """Channels that go on when nobody finds the fault."""
    return 4 if design == "two alike" else 2


def main() -> int:
    """Fly all, print the worst of each signal."""
    wanted = list(product(AIRCRAFT, CONDITIONS, SIGNAL_NAMES, ("two alike", "one of two")))
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        found = list(pool.map(moved, wanted, chunksize=8))
    print(f"{2 * len(found)} flights, offsets of {SHARE:g} thresholds; limits {LIMIT_G:g} g, {LIMIT_DEG_S:g} deg/s\n")
    print("| signal | two alike: g | deg/s | one of two: g | deg/s | nearer to its limit | found after all |")
    print("|---|---|---|---|---|---|---|")
    over = 0
    for name in SIGNAL_NAMES:
        by_design = [[one for one in found if one[:2] == (name, design)] for design in ("two alike", "one of two")]
        worst = [max(moves) for mine in by_design for moves in ([one[2] for one in mine], [one[3] for one in mine])]
        g, rate = max(worst[::2]), max(worst[1::2])
        over += g > LIMIT_G or rate > LIMIT_DEG_S
        binds = "load factor" if g / LIMIT_G > rate / LIMIT_DEG_S else "rate"
        after = sum(one[4] for mine in by_design for one in mine)
        print(f"| {name} | " + " | ".join(f"{x:.3g}" for x in worst) + f" | {binds} | {after} |")
    print(f"\n{over} of {len(SIGNAL_NAMES)} signals over a limit")
    return 0


if __name__ == "__main__":
    sys.exit(main())
