"""What tests/tools/evidence.py flies: one function for each row of its counts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from rig.core.frame import SIGNALS
from rig.scenario.aircraft import tables

AIRCRAFT: Final = ("f16", "b747", "b737")
ALL: Final = (*AIRCRAFT, "b707")
SIGNAL_NAMES: Final = tuple(signal.name for signal in SIGNALS)
STICKS: Final = ("stick_pitch", "stick_roll", "pedal")
REFERRED: Final = tuple(name for name in SIGNAL_NAMES if name not in STICKS)
UNITS: Final = {  # boxes of a channel, by the groups of their signals
    "air-data": ("air data",),
    "inertial": ("rates", "load factors", "attitude"),
    "sticks": ("stick and pedals",),
}
UNIT_OF: Final = {signal.name: unit for signal in SIGNALS for unit, groups in UNITS.items() if signal.group in groups}
FAULTY: Final = {  # of which a whole box, or most of it, is faulty
    "air-data": tuple(name for name, unit in UNIT_OF.items() if unit == "air-data"),
    "inertial": tuple(name for name, unit in UNIT_OF.items() if unit == "inertial"),
    "six-inertial": (
        *("pitch_rate", "yaw_rate", "lateral_load_factor", "longitudinal_load_factor"),
        *("pitch_angle", "heading"),
    ),
    "channel": SIGNAL_NAMES,
}
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


def fault(kind: str, name: str, channels: list[int], start_s: float, **more: Any) -> Table:
    """A fault of channels of a signal."""
    return {"kind": kind, "signal": name, "channels": channels, "start_s": start_s, **more}


def offset(name: str, channels: list[int], thresholds: float, start_s: float) -> Table:
    """An offset in the monitor's thresholds."""
    return fault("offset", name, channels, start_s, offset_thresholds=float(thresholds))


def flight(row: str, about: str, aircraft: str, duration_s: float, faults: list[Table], *more: str) -> Try:
    """A flight of an aircraft at its first flight point."""
    where = (f"aircraft={aircraft}", f"flight_point={first_point(aircraft)}", f"duration_s={duration_s}")
    return Try(row, f"{aircraft} {about}", (*where, f"faults={toml(faults)}", *more))


@cache
def first_point(aircraft: str) -> str:
    """The name of its first flight point."""
    return tables(aircraft)["airframe"]["flight_points"][0]["name"]


def toml(value: Any) -> str:
    """A value as TOML writes it in a line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
    return "[" + ", ".join(map(toml, value)) + "]" if isinstance(value, list) else json.dumps(value)


def last() -> Iterator[Try]:
    """Three channels drop out, the last runs away and its own monitor says so."""
    for aircraft in ALL:
        for name in REFERRED:
            gone = [fault("dropout", name, [c], 4.0 + c) for c in (1, 2, 3)]
            away = fault("hardover", name, [4], 10.0, seen_by_ilm=True)
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
        "dropout": lambda name: fault("dropout", name, [3, 4], 7.0),
        "+4": lambda name: offset(name, [3, 4], 4, 7.0),
        "-4": lambda name: offset(name, [3, 4], -4, 7.0),
        "stuck at 0": lambda name: fault("stuck", name, [3, 4], 7.0, value=0.0),
        "hardover": lambda name: fault("hardover", name, [3, 4], 7.0),
    }
    for aircraft in AIRCRAFT:
        for about, of in kinds.items():
            yield flight("box", about, aircraft, 37.0, [of(name) for name in SIGNAL_NAMES], TURN)


def common() -> Iterator[Try]:
    """All channels of a signal to the stop together."""
    for aircraft in ALL:
        for name in SIGNAL_NAMES:
            yield flight("common", name, aircraft, 40.0, [fault("hardover", name, [1, 2, 3, 4], 5.0)])


def healthy() -> Iterator[Try]:
    """Ten hours at each of the levels 1, 2 and 3: what is left is healthy; manoeuvres, up to moderate turbulence."""
    for level in (1, 2, 3):
        for name in REFERRED:
            for aircraft in AIRCRAFT:
                for i in range(5):
                    gone = list(range(1, 5 - level))
                    faults = [fault("dropout", name, gone, 2.0)]
                    turbulence, manual = ("none", "light", "moderate")[i % 3], i % 2 == 1
                    more = (f"turbulence={turbulence}", MANUAL if manual else STEPS)
                    engaged = f"pilot.autopilot_engaged={json.dumps(not manual)}"
                    hands_off_s, held_s = 60.0, 280.0  # the flight ends after the manoeuvres on the sticks
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
ROLLS: Final = (  # by hand from 55 to 67 s
    *("pilot.disengage_s=55.0", "pilot.engage_s=67.0"),
    "pilot.manoeuvres="
    + toml(
        [
            manoeuvre("step", "altitude", 5.0, 60.0),
            manoeuvre("step", "heading", 10.0, 0.5),
            manoeuvre("step", "altitude", 30.0, -60.0),
            manoeuvre("step", "heading", 35.0, -0.5),
            manoeuvre("doublet", "stick_roll", 56.0, 0.4, duration_s=2.0),
            manoeuvre("doublet", "stick_pitch", 60.0, 0.2, duration_s=2.0),
            manoeuvre("doublet", "stick_roll", 64.0, -0.4, duration_s=2.0),
        ]
    ),
)


def drifting(row: str, rates: Sequence[float], *more: str) -> Iterator[Try]:
    """A third channel that drifts after two hardovers, and two alike of four; until 3 thresholds and 15 s more."""
    for aircraft in AIRCRAFT:
        for name in REFERRED:
            for kind, gone, away in (("third", (1, 2), [3]), ("alike", (), [3, 4])):
                for rate in rates:
                    for sign in (1, -1):
                        before = [fault("hardover", name, [c], 2.0 + 2.0 * c) for c in gone]
                        drift = fault("drift", name, away, 10.0, rate_thresholds_per_s=sign * rate)
                        duration_s = max(30.0, 25.0 + 3.0 / rate)
                        about = f"{name} {kind} {sign * rate:+g}"
                        yield flight(row, about, aircraft, duration_s, [*before, drift], *more)


def slow() -> Iterator[Try]:
    """Drifts in level flight and light turbulence."""
    yield from drifting("slow", (0.05, 0.1, 0.5, 2.0), "turbulence=light")


def slow_weather() -> Iterator[Try]:
    """Drifts in a climbing turn and severe turbulence, of one sign each, both as often at every rate and kind."""
    for i, one in enumerate(drifting("slow-weather", (0.1, 0.5), "turbulence=severe", TURN)):
        if i % 2 == (i // 2).bit_count() % 2:
            yield one


def trend() -> Iterator[Try]:
    """A third fault, and two alike, of a signal without a reference in a climbing turn: windows of the trend's byte."""
    windows = {
        "sliding": (),
        "tumbling": ("trend_window=tumbling", "trend_frames=4"),
        "by-change": ("trend_small={small}",),
        "none": ('tie_break=["ilm"]',),
    }
    for aircraft in AIRCRAFT:
        for name in REFERRED:
            threshold = tables(aircraft)["redundancy"]["signals"][name]["threshold"]
            for kind, gone, away in (("third", (1, 2), [3]), ("alike", (), [3, 4])):
                for sign in (1, -1):
                    before = [fault("hardover", name, [c], 2.0 + 2.0 * c) for c in gone]
                    for window, own in windows.items():
                        sets = [f"redundancy.signals.{name}.{one.format(small=threshold / 50)}" for one in own]
                        faults = [*before, offset(name, away, 4.0 * sign, 10.0)]
                        more = (TURN, f"redundancy.references.{name}=none", *sets)
                        yield flight("trend", f"{name} {kind} {window} {sign:+d}", aircraft, 25.0, faults, *more)


def references_healthy() -> Iterator[Try]:
    """Climb, turn and rolls on the stick in severe turbulence."""
    for aircraft in AIRCRAFT:
        for i in range(6):
            yield flight("references-healthy", f"{i}", aircraft, 90.0, [], "turbulence=severe", *ROLLS)


def whole_boxes() -> Iterator[Try]:
    """Channel 1 of a unit's signals, then channel 2, then 3."""
    kinds: dict[str, Callable[[str, int], Table]] = {
        "dropout": lambda name, c: fault("dropout", name, [c], 4.0 + 3.0 * c),
        "offset": lambda name, c: offset(name, [c], 3, 4.0 + 3.0 * c),
        "hardover": lambda name, c: fault("hardover", name, [c], 4.0 + 3.0 * c),
    }
    for aircraft in AIRCRAFT:
        for unit, names in FAULTY.items():
            for most in (1, 2, 3):
                for about, of in kinds.items():
                    faults = [of(name, c) for c in range(1, most + 1) for name in names]
                    yield flight("whole-boxes", f"{unit} {most} {about}", aircraft, 30.0, faults, TURN)


def bursts() -> Iterator[Try]:
    """Twelve bursts of one channel, 2 s apart, each shorter than the persistence: no channel is to be failed."""
    for name in SIGNAL_NAMES:
        for filter_s in (0.0, 0.1):
            own = [f"redundancy.signals.{name}.{key}" for key in (f"filter_s={filter_s}", "persistence=8")]
            for frames in (1, 3, 7):
                for size in (10, 50, 200):
                    for sign in (1, -1):
                        times = {"times_s": [2.0 * i for i in range(12)], "width_s": frames / 100.0}
                        spikes = fault("spikes", name, [2], 4.0, amplitude_thresholds=float(sign * size), **times)
                        about = f"{name} {filter_s:g} {frames} {sign * size:+d}"
                        yield flight("bursts", about, "f16", 29.0, [spikes], "turbulence=light", *own)


COUNTED: Final[dict[str, Callable[[], Iterator[Try]]]] = {
    **{"last": last, "third": third, "2:2": split, "sticks": sticks, "apart": apart},
    **{"box": box, "common": common, "healthy": healthy},
}
BY_FRAMES: Final[dict[str, Callable[[], Iterator[Try]]]] = {  # what became of them is read from the frames
    **{"slow": slow, "slow-weather": slow_weather, "references-healthy": references_healthy},
    **{"whole-boxes": whole_boxes, "bursts": bursts, "trend": trend},
}
