"""Single faults of computers, links and buses, flown: `python tests/tools/lanes_shows.py [--onsets N]`.

A line for each fault and aircraft: survived, the largest difference from the same flight without the fault in the two
seconds after its onset, who was failed, for what and after how long.  1 when a flight is lost or beyond LIMITS.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.frame import COMPUTERS, INDEX, Health, LaneTest
from rig.loop import Rig, frames
from rig.scenario import load

AIRCRAFT: Final = ("f16", "b747", "b737")
LIMITS: Final = (0.5, 10.0)  # g, deg/s
DURATION_S, AFTER_S = 12.0, 2.0
COMMANDS: Final = "signal='computer.{lane}', surface='{surface}', does='hardover'"
FAULTS: Final = {
    "stop": "kind='computer_stop', signal='computer.{lane}'",
    "clock": "kind='clock_drift', signal='computer.{lane}', drift_ppm=100000.0",
    **{f"command {name}": f"kind='wrong_command', {COMMANDS}" for name in ("elevator", "aileron", "rudder")},
    **{f"dac {name}": f"kind='dac', {COMMANDS}" for name in ("elevator", "aileron", "rudder")},
    "checksum": "kind='checksum', signal='computer.{lane}', factor=0.9",
    "adc zero": "kind='adc', signal='computer.{lane}', says='zero'",
    "adc last": "kind='adc', signal='computer.{lane}', says='last'",
    "adc scale": "kind='adc', signal='computer.{lane}', says='scale', factor=0.8",
    "adc offset": "kind='adc', signal='computer.{lane}', says='offset', offset=0.05",
    **{
        f"{kind} {where}": f"kind='{kind}', signal='ccdl.{place}'{more}"
        for kind, more in (
            *((name, "") for name in ("link_loss", "link_frozen", "link_corrupt")),
            ("link_lie", ", offset_thresholds=5.0"),
        )
        for where, place in (("way", "{lane}-{next}"), ("node", "{lane}"))
    },
    "bus 1": "kind='power_loss', signal='bus.1'",
    "bus 2": "kind='power_loss', signal='bus.2'",
}


class Flight(NamedTuple):
    """What a flight leaves."""

    truth: NDArray[np.float64]  # (n, S)
    lanes: NDArray[Any]  # (n, 4) COMPUTER
    whole: bool


def flown(aircraft: str, seed: int, faults: str) -> Flight:
    """Fly four lanes with servos in light turbulence; whether a test sees a fault is drawn by the seed."""
    sets = [
        f"aircraft={aircraft}",
        f"duration_s={DURATION_S}",
        f"seed={seed}",
        "computers.commands=[]",
        f"faults=[{faults}]",
    ]
    rig, rows, lanes = Rig(load("f16_computer_stop", sets)), [], []
    for block, _ in frames(rig, rig.scenario):
        rows.append(block["truth"].copy())
        lanes += [part["computer"].copy() for part in rig.lanes(len(block))]
    truth = np.concatenate(rows)
    return Flight(truth, np.concatenate(lanes), len(truth) == rig.scenario.frames)


def difference(one: Flight, other: Flight, first: int, count: int) -> tuple[float, float]:
    """Return the largest differences of load factors, g, and rates, deg/s, in ``count`` frames."""
    names = ("normal_load_factor", "lateral_load_factor", "pitch_rate", "roll_rate", "yaw_rate")
    at, part = [INDEX[name] for name in names], slice(first, first + count)
    a, b = one.truth[part][:, at], other.truth[part][:, at]
    off = np.abs(a - b[: len(a)]).max(axis=0)
    return float(off[:2].max()), float(np.degrees(off[2:].max()))


def found(flight: Flight, first: int) -> str:
    """Return who was failed, for what, how many frames after the onset."""
    out = ~np.isin(flight.lanes["health"], (Health.ENGAGED, Health.SUSPECT))
    told = []
    for i in np.flatnonzero(out.any(axis=0)):
        at = int(out[:, i].argmax())
        told.append(f"{COMPUTERS[i]} {LaneTest(flight.lanes['failed_for'][at, i]).name.lower()} +{at - first}")
    return ", ".join(told) or "nobody"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--onsets", type=int, default=1)
    onsets, rng, missed = parser.parse_args().onsets, np.random.default_rng(34), 0
    for aircraft in AIRCRAFT:
        clean = [flown(aircraft, seed, "") for seed in range(onsets)]
        for name, fault in FAULTS.items():
            for seed in range(onsets):
                first, lane = int(rng.integers(300, 900)), int(rng.integers(len(COMPUTERS)))
                names = {"lane": COMPUTERS[lane], "next": COMPUTERS[(lane + 1) % 4], "surface": name.split()[-1]}
                flight = flown(aircraft, seed, f"{{{fault.format(**names)}, start_s={first / 100}}}")
                g, rate = difference(flight, clean[seed], first, round(100 * AFTER_S))
                beyond = not flight.whole or g > LIMITS[0] or rate > LIMITS[1]
                missed += beyond
                kept = "flies" if flight.whole else "LOST"
                mark = "  BEYOND" if beyond else ""
                moved = f"{g:7.4f} g {rate:8.4f} deg/s"
                print(f"{aircraft:5} {name:18} {COMPUTERS[lane]} {kept} {moved}  {found(flight, first)}{mark}")
    print(f"{missed} beyond {LIMITS[0]} g or {LIMITS[1]} deg/s, or lost")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
