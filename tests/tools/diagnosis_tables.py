"""Print what `rig diagnose` finds: healthy logs, faults put in, conventions, vibration, ends of range, delays.

python tests/tools/diagnosis_tables.py [--recorded FOLDER...]

Logs are made up (tests/sensor_flights.py), in two to four instances, at several rates, of seeds 11 to 14.  A recorded
FOLDER holds flights of four inertial units, as path_*/IMU_1..4.csv.
'one of' counts verdicts that name no channel; 'wrong' counts healthy channels that are named.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from sensor_flights import Array, Flight, Kind, flown

from rig.bench.diagnose.findings import Instance
from rig.bench.diagnose.one_quantity import QuantityDiagnosis, diagnose_group
from rig.bench.diagnose.sensor_groups import Group, Samples, read_groups
from rig.log.recordings.vote_config import config_of

SEEDS: Final = (11, 12, 13, 14)
RATES: Final = (10.0, 25.0, 100.0)
ONSET: Final = 0.4
UNITS: Final = {"gyro": ("rad/s", 0.05, 57.29578), "accel": ("m/s^2", 0.5, 1 / 9.80665)}
Change = Callable[[Array, Array], Array]  # of time (n,) and values (3, n)


def settings() -> dict[str, dict[str, object]]:
    """The settings of the signals, as of the presets."""
    own = {"persistence_s": 1.0, "split_persistence_s": 1.0, "tie_break": ["ilm"]}
    return {
        f"{name}_{axis}": {"unit": unit, "threshold": threshold, **own}
        for name, (unit, threshold, _) in UNITS.items()
        for axis in "xyz"
    }


def group_of(flight: Flight, name: str) -> Group:
    """The instances of one quantity on the times of the first."""
    config = config_of({"signal": settings()}, Path("c"))
    chosen = {key: own for key, own in config.signals([*config.signal], "c").items() if key.startswith(name)}
    values, times = getattr(flight, name), flight.time_s
    own = [[Samples(t, v[:, a].copy()) for t, v in zip(times, values, strict=True)] for a in range(3)]
    x = np.array([[np.interp(times[0], samples.time_s, samples.values) for samples in axis] for axis in own])
    instances = tuple(Instance(c, f"imu{c - 1}") for c in range(1, len(values) + 1))
    return Group(name, chosen, instances, times[0], x, own)


def changed(group: Group, c: int, change: Change) -> Group:
    """A copy in which instance c, from 0, measures something else."""
    x, own = group.x.copy(), [list(axis) for axis in group.own]
    x[:, c] = change(group.time_s, x[:, c].copy())
    recorded = change(own[0][c].time_s, np.array([axis[c].values for axis in own]))
    for axis, values in zip(own, recorded, strict=True):
        axis[c] = Samples(axis[c].time_s, values)
    return Group(group.name, group.settings, group.instances, group.time_s, x, own)


def since(time_s: Array) -> Array:
    """Seconds since the onset; negative before."""
    return time_s - time_s[0] - ONSET * (time_s[-1] - time_s[0])


def step(axis: int, size: float) -> Change:
    """A step."""
    return lambda t, v: v + size * np.outer(np.arange(3) == axis, since(t) >= 0)


def drift(axis: int, rate: float) -> Change:
    """A ramp of ``rate`` a second."""
    return lambda t, v: v + rate * np.outer(np.arange(3) == axis, np.maximum(since(t), 0.0))


def freeze(*axes: int) -> Change:
    """The value at the onset, for ever."""

    def change(t: Array, v: Array) -> Array:
        k = int(np.argmax(since(t) >= 0))
        v = v.copy()
        v[list(axes), k:] = v[list(axes), k : k + 1]
        return v

    return change


def turned(*rows: tuple[float, float, float]) -> Change:
    """Other axes."""
    return lambda _, v: np.array(rows) @ v


def scaled(factor: float) -> Change:
    """Another unit."""
    return lambda _, v: factor * v


def late(seconds: float) -> Change:
    """A delay."""
    return lambda t, v: np.array([np.interp(t - seconds, t, axis) for axis in v])


class Told(NamedTuple):
    """The outcome of a diagnosis, and the seconds by which the fault is dated late."""

    outcome: str  # right, one of, missed, wrong
    late_s: float = 0.0


def told(found: QuantityDiagnosis, channel: int | None, onset_s: float) -> Told:
    """How a diagnosis ends; ``channel`` is the faulty one, from 1, None: there is none."""
    verdicts = [one for one in found.signals.values() if one.since_s is not None]
    named = [one for one in verdicts if one.verdict == "channel"]
    if any(one.channel != channel for one in named):
        return Told("wrong")
    if not verdicts:
        return Told("missed" if channel is not None else "none")
    first = min(one.since_s or 0.0 for one in (named or verdicts))
    return Told("right" if named else "one of", first - onset_s)


def diagnosed(group: Group) -> QuantityDiagnosis:
    """The diagnosis without the vote in flight."""
    return diagnose_group(group, "test", flown=False)


def made_up(name: str, count: int, **more: object) -> Iterator[Group]:
    """The groups of all seeds and rates."""
    for seed in SEEDS:
        for rate_hz in RATES:
            kind = Kind(seed=seed, rate_hz=rate_hz, count=count)
            yield group_of(flown(Kind(**{**vars(kind), **more})), name)  # pyright: ignore[reportArgumentType]


def recorded(folder: Path) -> Iterator[Group]:
    """The groups of flights of four units."""
    fields = {"gyro": "Gyr", "accel": "Acc"}
    mapping = {
        f"{name}_{axis}.{c}": f"IMU_{c}.csv:{field}_{axis.upper()}"
        for name, field in fields.items()
        for axis in "xyz"
        for c in range(1, 5)
    }
    triads = {name: [f"{name}_{axis}" for axis in "xyz"] for name in fields}
    signal = settings()
    for axis in "xyz":
        signal[f"gyro_{axis}"] |= {"unit": "deg/s", "threshold": 2.865}
    tables = {"mapping": mapping, "triads": triads, "signal": signal, "time_column": "time"}
    for flight in sorted(folder.glob("path_*")):
        yield from read_groups(flight, tables, None).groups


def some(group: Group, channels: tuple[int, ...]) -> Group:
    """Some of the instances."""
    instances = tuple(Instance(i, group.instances[c].name) for i, c in enumerate(channels, 1))
    own = [[axis[c] for c in channels] for axis in group.own]
    return Group(group.name, group.settings, instances, group.time_s, group.x[:, channels].copy(), own)


FAULTS: Final = {
    "gyro": {
        "step of 0.15 rad/s": step(0, 0.15),
        "step of 0.5 rad/s": step(1, 0.5),
        "step of 1.5 rad/s": step(2, 1.5),
        "drift of 0.02 rad/s a second": drift(0, 0.02),
        "frozen": freeze(0, 1, 2),
        "one axis frozen": freeze(1),
    },
    "accel": {
        "step of 1 m/s^2": step(0, 1.0),
        "step of 5 m/s^2": step(2, 5.0),
        "drift of 0.2 m/s^2 a second": drift(1, 0.2),
        "frozen": freeze(0, 1, 2),
        "one axis frozen": freeze(0),
    },
}
AXES: Final = {
    "flipped y": turned((1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "swapped x and y": turned((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "mounted by 90 deg": turned((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "mounted by 180 deg": turned((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}


def faulty(groups: Iterator[Group], change: Change) -> Counter[str]:
    """The outcomes of a fault in one instance after the other."""
    outcomes: Counter[str] = Counter()
    for i, group in enumerate(groups):
        c = i % len(group.instances)
        onset_s = ONSET * float(group.time_s[-1] - group.time_s[0])
        outcomes[told(diagnosed(changed(group, c, change)), c + 1, onset_s).outcome] += 1
    return outcomes


def other(groups: Iterator[Group], change: Change, size: float | None) -> tuple[Counter[str], Counter[str]]:
    """The outcomes with another convention in one instance; size : of a step in the next one. And what was told."""
    outcomes, conventions = Counter[str](), Counter[str]()
    for i, group in enumerate(groups):
        count = len(group.instances)
        c, next_one = i % count, (i + 1) % count
        made = changed(group, c, change)
        onset_s = ONSET * float(group.time_s[-1] - group.time_s[0])
        made = made if size is None else changed(made, next_one, step(0, size))
        found = diagnosed(made)
        outcomes[told(found, None if size is None else next_one + 1, onset_s).outcome] += 1
        large = [one for one in found.conventions if one.corrected and one.kind in ("unit", "axes", "mounting")]
        if not large:
            conventions["not told"] += 1
        for one in large:
            conventions["told" if one.instance.channel == c + 1 or not one.named else "of another"] += 1
    return outcomes, conventions


def clipped(group: Group, channels: tuple[int, ...], limit: float) -> Group:
    """Instances at the end of their range in manoeuvres."""
    for c in channels:
        group = changed(group, c, lambda _, v: np.clip(v, -limit, limit))
    return group


def line(what: str, outcomes: Counter[str], more: str = "") -> None:
    """Print one row."""
    print(f"  {what:34s} {', '.join(f'{count} {name}' for name, count in sorted(outcomes.items()))}{more}")


def healthy() -> None:
    """Print the table of healthy logs and of what all instances share."""
    print("healthy logs")
    for count in (2, 3, 4):
        for what, more in {
            "as flown": {},
            "calm, then manoeuvres of 3 rad/s": {"motion": 0.05, "burst": 3.0},
            "vibration of 1 rad/s, 10 m/s^2": {"vibration": 1.0},
            "one 60 ms late": {"delays_s": (0.0, 0.06)},
            "one 150 ms late": {"delays_s": (0.0, 0.15)},
        }.items():
            groups = [group for name in UNITS for group in made_up(name, count, **more)]
            line(f"{count} instances, {what}", Counter(told(diagnosed(group), None, 0.0).outcome for group in groups))
    print("two at the end of their range in manoeuvres of 6 rad/s")
    for count in (2, 3, 4):
        groups = (clipped(group, (0, 1), 2.0) for group in made_up("gyro", count, burst=6.0))
        line(f"{count} instances", Counter(told(diagnosed(group), None, 0.0).outcome for group in groups))


def injected() -> None:
    """Print the tables of faults and conventions."""
    for count in (2, 3, 4):
        print(f"faults in one of {count}")
        for name, faults in FAULTS.items():
            for what, change in faults.items():
                line(f"{name}, {what}", faulty(made_up(name, count), change))
    for count in (2, 3, 4):
        for size in (False, True):
            print(f"another convention in one of {count}{', and a step in the next' if size else ''}")
            for name, (_, threshold, factor) in UNITS.items():
                for what, change in {**AXES, "another unit": scaled(factor)}.items():
                    outcomes, conventions = other(made_up(name, count), change, 14 * threshold if size else None)
                    line(f"{name}, {what}", outcomes, f"; {dict(conventions)}")


def main() -> None:
    """Print all tables."""
    healthy()
    injected()
    for folder in sys.argv[2:]:
        print(folder)
        groups = list(recorded(Path(folder)))
        for channels in ((0, 1, 2, 3), (0, 1, 2), (0, 1)):
            outcomes = Counter(told(diagnosed(some(group, channels)), None, 0.0).outcome for group in groups)
            line(f"healthy, {len(channels)} instances", outcomes)
            for name, faults in FAULTS.items():
                for what, change in faults.items():
                    mine = (some(group, channels) for group in groups if group.name == name)
                    line(f"{len(channels)} instances, {name}, {what}", faulty(mine, change))


if __name__ == "__main__":
    main()
