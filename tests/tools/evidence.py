"""What the monitor gets wrong: last channels, third faults, splits, boxes, common faults, healthy channels, counted.

    python tests/tools/evidence.py [--workers 2] [--rows last,third,...] [--set KEY=VALUE] [--json FILE]

Every row flies each signal, sign and aircraft that its function names; the same code prints the same counts.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from rig import scenario
from rig.aircraft import tables
from rig.assess import score
from rig.campaign.flying import CampaignFlight, fly
from rig.frame import SIGNALS, State

AIRCRAFT: Final = ("f16", "b747", "b737")
ALL: Final = (*AIRCRAFT, "b707")
SIGNAL_NAMES: Final = tuple(signal.name for signal in SIGNALS)
STICKS: Final = ("stick_pitch", "stick_roll", "pedal")
REFERRED: Final = tuple(name for name in SIGNAL_NAMES if name not in STICKS)
TURN: Final = """pilot.manoeuvres=[{kind="step", axis="altitude", start_s=4.0, amplitude=60.0},
                                   {kind="step", axis="heading", start_s=4.0, amplitude=0.35}]"""
Table = dict[str, Any]


@dataclass(frozen=True)
class Try:
    """One flight: the row that it counts in, what it is, its settings."""

    row: str
    about: str
    sets: tuple[str, ...]

    def seeded(self, seed: int, more: Sequence[str] = ()) -> Try:
        """The same flight with noise, calibration and coverage of its own, and ``more`` settings over all."""
        return Try(self.row, self.about, (*self.sets, f"seed={seed}", *more))


def offset(name: str, channels: list[int], thresholds: float, start_s: float) -> Table:
    """An offset in the monitor's thresholds."""
    fault = {"kind": "offset", "signal": name, "channels": channels, "start_s": start_s}
    return {**fault, "offset_thresholds": float(thresholds)}


def flight(row: str, about: str, aircraft: str, duration_s: float, faults: list[Table], *more: str) -> Try:
    """A flight of an aircraft at its first flight point."""
    point = tables(aircraft)["airframe"]["flight_points"][0]["name"]
    where = (f"aircraft={aircraft}", f"flight_point={point}", f"duration_s={duration_s}")
    return Try(row, f"{aircraft} {about}", (*where, f"faults={toml(faults)}", *more))


def toml(value: Any) -> str:
    """A value as TOML writes it in a line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
    return "[" + ", ".join(map(toml, value)) + "]" if isinstance(value, list) else json.dumps(value)


def last() -> Iterator[Try]:
    """Three channels drop out, the last runs away and its own monitor says so."""
    for aircraft in ALL:
        for name in REFERRED:
            gone = [{"kind": "dropout", "signal": name, "channels": [c], "start_s": 4.0 + c} for c in (1, 2, 3)]
            away = {"kind": "hardover", "signal": name, "channels": [4], "start_s": 10.0, "seen_by_ilm": True}
            yield flight("last", name, aircraft, 40.0, [*gone, away], TURN)


def third(names: tuple[str, ...] = REFERRED, row: str = "third") -> Iterator[Try]:
    """Offsets of 4, 8 and 4 thresholds on channels 1, 2 and 3, one after the other."""
    for aircraft in AIRCRAFT:
        for name in names:
            for sign in (1, -1):
                faults = [offset(name, [c], sign * size, at) for c, size, at in ((1, 4, 6), (2, 8, 9), (3, 4, 12))]
                yield flight(row, f"{name} {sign:+d}", aircraft, 25.0, faults, TURN)


def split(names: tuple[str, ...] = REFERRED, row: str = "2:2") -> Iterator[Try]:
    """Channels 3 and 4 off together, by 2 and by 5 thresholds."""
    for aircraft in AIRCRAFT:
        for name in names:
            for size in (2, -2, 5, -5):
                yield flight(row, f"{name} {size:+d}", aircraft, 20.0, [offset(name, [3, 4], size, 7.0)], TURN)


def sticks() -> Iterator[Try]:
    """Third faults and splits of sticks and pedal."""
    for one in (*third(STICKS, "sticks"), *split(STICKS, "sticks")):
        yield Try(one.row, one.about, (*one.sets[:4], "pilot.autopilot_engaged=false"))


def apart() -> Iterator[Try]:
    """1:1:1:1 and 1:1:1, the good channel an extreme."""
    for aircraft in AIRCRAFT:
        for name in SIGNAL_NAMES:
            for sign in (1, -1):
                faults = [offset(name, [c], sign * 3 * (c - 1), 7.0) for c in (2, 3, 4)]
                manual = ("pilot.autopilot_engaged=false",) if name in STICKS else (TURN,)
                yield flight("1:1:1:1", f"{name} {sign:+d}", aircraft, 20.0, faults, *manual)
                three = [offset(name, [c], sign * 3 * (c - 1), 7.0) for c in (2, 3)]
                more = (*manual, f"sensors.{name}.channels=3")
                yield flight("1:1:1", f"{name} {sign:+d}", aircraft, 20.0, three, *more)


def box() -> Iterator[Try]:
    """Channels 3 and 4 of all sixteen signals at once."""
    kinds: dict[str, Callable[[str], Table]] = {
        "dropout": lambda name: {"kind": "dropout", "signal": name, "channels": [3, 4], "start_s": 7.0},
        "+4": lambda name: offset(name, [3, 4], 4, 7.0),
        "-4": lambda name: offset(name, [3, 4], -4, 7.0),
        "stuck at 0": lambda name: {"kind": "stuck", "signal": name, "channels": [3, 4], "start_s": 7.0, "value": 0.0},
        "hardover": lambda name: {"kind": "hardover", "signal": name, "channels": [3, 4], "start_s": 7.0},
    }
    for aircraft in AIRCRAFT:
        for about, of in kinds.items():
            yield flight("box", about, aircraft, 37.0, [of(name) for name in SIGNAL_NAMES], TURN)


def common() -> Iterator[Try]:
    """All channels of a signal to the stop together."""
    for aircraft in ALL:
        for name in SIGNAL_NAMES:
            away = {"kind": "hardover", "signal": name, "channels": [1, 2, 3, 4], "start_s": 5.0}
            yield flight("common", name, aircraft, 40.0, [away])


def healthy() -> Iterator[Try]:
    """Ten hours at each of the levels 1, 2 and 3: what is left is healthy; manoeuvres, up to moderate turbulence."""
    for level in (1, 2, 3):
        for name in REFERRED:
            for aircraft in AIRCRAFT:
                for i in range(5):
                    gone = list(range(1, 5 - level))
                    faults = [{"kind": "dropout", "signal": name, "channels": gone, "start_s": 2.0}]
                    turbulence, manual = ("none", "light", "moderate")[i % 3], i % 2 == 1
                    more = (f"turbulence={turbulence}", MANUAL if manual else STEPS)
                    engaged = f"pilot.autopilot_engaged={json.dumps(not manual)}"
                    hands_off_s, held_s = 60.0, 280.0  # nobody flies on after the manoeuvres on the sticks
                    duration_s = hands_off_s if manual else held_s
                    yield flight(f"level {level}", f"{name} {i}", aircraft, duration_s, faults, *more, engaged)


def manoeuvre(kind: str, axis: str, start_s: float, amplitude: float, **more: float) -> Table:
    """A manoeuvre of the pilot."""
    return {"kind": kind, "axis": axis, "start_s": start_s, "amplitude": amplitude, **more}


STEPS: Final = "pilot.manoeuvres=" + toml(
    [
        manoeuvre("step", "altitude", 10.0, 60.0),
        manoeuvre("step", "heading", 50.0, 0.35),
        manoeuvre("step", "altitude", 100.0, -60.0),
        manoeuvre("step", "heading", 140.0, -0.35),
    ]
)
MANUAL: Final = "pilot.manoeuvres=" + toml(
    [
        manoeuvre("3-2-1-1", "stick_pitch", 5.0, 0.3, duration_s=3.5),
        manoeuvre("doublet", "stick_roll", 20.0, 0.4, duration_s=2.0),
        manoeuvre("doublet", "pedal", 40.0, 0.5, duration_s=3.0),
    ]
)
ROWS: Final[dict[str, Callable[[], Iterator[Try]]]] = {
    **{"last": last, "third": third, "2:2": split, "sticks": sticks, "apart": apart},
    **{"box": box, "common": common, "healthy": healthy},
}


def outcome_of(one: Try) -> Table:
    """Fly it: whether it survived, which healthy channels were failed, which faulty ones were not."""
    flown = fly(scenario.load(None, one.sets))
    found = score(flown.scenario, flown.rows, clean=flown.clean)
    wrong = [f"{i.signal}.{i.channel}" for i in (*found.wrong_isolations, *found.false_alarms)]
    missed = [f"{f.signal}.{f.channel}" for f in found.faults if f.outcome == "missed"]
    hours = flown.verdict.frames / flown.scenario.rate_hz / 3600.0
    kept = not wrong and not missed
    return {
        **{"row": one.row, "about": one.about, "survived": flown.verdict.survived, "hours": hours},
        **{"right": kept, "wrong": wrong, "missed": missed, "left": left(flown)},
    }


def left(flown: CampaignFlight) -> int:
    """Channels in use at the end, of all signals."""
    states = flown.rows["state"][-1]
    return int(np.count_nonzero((states != State.FAILED) & (states != State.ABSENT)))


def counts(found: list[Table]) -> str:
    """The counts, a line each row."""
    lines = [
        "| row | flights | hours | survive | right | flights that fail a healthy channel | and leave a faulty one |"
    ]
    lines.append("|---|---|---|---|---|---|---|")
    for row in dict.fromkeys(one["row"] for one in found):
        mine = [one for one in found if one["row"] == row]
        sums = [sum(bool(one[key]) for one in mine) for key in ("survived", "right", "wrong", "missed")]
        hours = sum(one["hours"] for one in mine)
        lines.append(f"| {row} | {len(mine)} | {hours:.1f} | " + " | ".join(map(str, sums)) + " |")
    return "\n".join(lines)


def not_right(found: list[Table]) -> str:
    """Return a line for each row: its flights that are not right, aircraft that are wrong alike together."""
    rows: dict[str, dict[str, list[str]]] = {}
    for flown in found:
        if flown["wrong"] or flown["missed"] or not flown["survived"]:
            name, _, about = flown["about"].partition(" ")
            wrong = f" fails {', '.join(flown['wrong'])}" if flown["wrong"] else ""
            missed = f" leaves {len(flown['missed'])}" if flown["missed"] else ""
            lost = "" if flown["survived"] else " loses the aircraft"
            rows.setdefault(flown["row"], {}).setdefault(f"{about}:{wrong}{missed}{lost}", []).append(name)
    return "\n".join(
        f"- {row}: " + "; ".join(f"{', '.join(names)} {about}" for about, names in flights.items())
        for row, flights in rows.items()
    )


def main() -> int:
    """Fly the rows that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", default=",".join(ROWS))
    parser.add_argument("--set", action="append", default=[], help="laid over the settings of every flight")
    parser.add_argument("--json", default="")
    asked = parser.parse_args()
    tries = [one.seeded(i, asked.set) for row in asked.rows.split(",") for i, one in enumerate(ROWS[row](), 1)]
    began = perf_counter()
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("forkserver")) as pool:
        found = list(pool.map(outcome_of, tries, chunksize=4))
    print(counts(found), not_right(found), sep="\n\n")
    print(f"\n{len(found)} flights in {perf_counter() - began:.0f} s")
    if asked.json:
        Path(asked.json).write_text(json.dumps(found, indent=0), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
