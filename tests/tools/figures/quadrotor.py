"""Healthy channels that are failed in recordings of four IMUs on one quadrotor, and offsets found in them.

The folder is ``quad_imu_horizontal``: no channel is faulty, so every failure is a false isolation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from figures import table
from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.vote_rows import Result, vote
from rig.log.recordings.align import align
from rig.log.recordings.alignment import AlignOptions, run_alignment
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording
from rig.log.recordings.vote_config import VoteConfig

THRESHOLDS: Final = (2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0)  # deg/s
PERSISTENCES: Final = (8, 12, 24)
OFFSETS: Final = (10.0, 20.0, 30.0, 60.0, 100.0)  # deg/s
AXES: Final = {"gyro_x": "Gyr_X", "gyro_y": "Gyr_Y", "gyro_z": "Gyr_Z"}
TRIADS: Final = {"gyro": list(AXES)}
MAPPING: Final = {f"{name}.{c}": f"IMU_{c}.csv:{field}" for name, field in AXES.items() for c in range(1, 5)}
UNIT_RULE: Final = {"threshold": 10.0, "manager": "selection", "selection_deviation": 7.0, "selection_integral_s": 15.0}
SELECTION: Final = VoteConfig(default=UNIT_RULE, mapping=MAPPING, time_column="time", triads=TRIADS)


def config(threshold: float, persistence: int) -> VoteConfig:
    """Return the CONFIG of ``rig vote``."""
    default = {"threshold": threshold, "persistence": persistence}
    return VoteConfig(default=default, mapping=MAPPING, time_column="time")


def flights(folder: str) -> list[Path]:
    """Return the recordings of the folder."""
    return sorted(Path(folder).glob("path_*"))


def variants(flight: Path) -> dict[str, Recording]:
    """Return the recording as it is, aligned by all of it and by its first 6 s, each without and with a matrix."""
    chosen = config(1.0, 8)
    raw = read(flight, chosen, repair=True)
    settings = chosen.signals(raw.signals, "")
    first, last = float(raw.time_s[0]), float(raw.time_s[-1])
    recordings = {"raw": raw}
    for name, end in (("aligned", last), ("aligned by 6 s", 6.0)):
        for matrix in (False, True):
            options = AlignOptions(first, end, matrix)
            recordings[name + ", matrix" * matrix] = run_alignment(raw, settings, options, TRIADS)[0]
    return recordings


def failed(recording: Recording, threshold: float, persistence: int) -> int:
    """Return how many channels of the three signals were failed."""
    voted = vote(recording, config(threshold, persistence).signals(recording.signals, ""), [])
    return sum(len({failure.channel for failure in signal.failures}) for signal in voted.values())


def quad_isolations(folder: str) -> None:
    """Print channels failed / flights hit, by variant, persistence and threshold [deg/s]."""
    recordings = [variants(path) for path in flights(folder)]
    print(f"{len(recordings)} flights, {4 * len(AXES) * len(recordings)} channels, none faulty\n")

    def rows() -> Iterator[list[str]]:
        for variant in recordings[0]:
            for persistence in PERSISTENCES:
                counts = [
                    [failed(flight[variant], limit, persistence) for flight in recordings] for limit in THRESHOLDS
                ]
                yield [f"{variant}, {persistence}", *(f"{sum(c)}/{sum(n > 0 for n in c)}" for c in counts)]

    table(("variant, frames", *(f"{limit:g} deg/s" for limit in THRESHOLDS)), rows())


def distrusted(recording: Recording) -> int:
    """Return how many channels of the unit were distrusted at some time."""
    settings = SELECTION.signals(recording.signals, "")
    first = next(iter(vote(recording, settings, [], triads=TRIADS).values()))
    return len({failure.channel for failure in first.failures})


def outcome(raw: Recording, aligned: bool, axis: str, channel: int, offset: float) -> tuple[str, float | None]:
    """Return what became of an offset from 40 % of the flight on, and its delay in s."""
    settings = SELECTION.signals(raw.signals, "")
    start_s = float(raw.time_s[int(0.4 * len(raw.time_s))])
    fault = {"kind": "offset", "signal": axis, "channels": [channel], "start_s": start_s, "offset": offset}
    injection = inject(raw, [fault], settings)
    recording, corrections = injection.recording, None
    if aligned:
        recording, corrections = align(recording, settings, end_s=6.0)
    voted = Result(vote(recording, settings, [], triads=TRIADS))
    result = score(injection, recording, voted, corrections)[0]
    return result.outcome, result.delay_s


def quad_selection(folder: str) -> None:
    """Print what the manager ``selection`` finds at 7 deg/s and 15 deg: correct/wrong/missed/prior, median delay."""
    recordings = [read(path, SELECTION, repair=True) for path in flights(folder)]
    settings = SELECTION.signals(recordings[0].signals, "")
    by_6_s = [align(flight, settings, end_s=6.0)[0] for flight in recordings]

    def cell(aligned: bool, offset: float) -> str:
        runs: list[tuple[str, Any]] = [
            outcome(flight, aligned, axis, 1 + (i + j) % 4, offset)
            for i, flight in enumerate(recordings)
            for j, axis in enumerate(AXES)
        ]
        counts = [sum(result == name for result, _ in runs) for name in ("correct", "wrong", "missed", "prior")]
        delays = [delay for result, delay in runs if result == "correct" and delay is not None]
        return f"{'/'.join(map(str, counts))}, {np.median(delays):.2f} s" if delays else "/".join(map(str, counts))

    rows = [
        [name, str(sum(map(distrusted, healthy))), *(cell(name != "raw", offset) for offset in OFFSETS)]
        for name, healthy in (("raw", recordings), ("aligned by 6 s", by_6_s))
    ]
    table(("selection", "healthy trips", *(f"{offset:g} deg/s" for offset in OFFSETS)), rows)
