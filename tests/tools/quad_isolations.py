"""Healthy channels that the monitor fails in the recordings of four IMUs; not a test, run it by hand:

    python tests/tools/quad_isolations.py ../shared/data/quad_imu_horizontal [persistence ...]

Nobody is faulty in these flights (docs/vote.md), so every failure is a false isolation.  Rates about x, y and z of four
recorders, each threshold as ``rig vote --repair-time`` would fly it: raw, aligned by the whole flight and by its first
6 s (``--align``), each without and with ``--align-matrix``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rig.bench.vote import vote
from rig.recordings.alignment import AlignOptions, run_alignment
from rig.recordings.read import read
from rig.recordings.recording import Recording
from rig.recordings.settings import VoteConfig

THRESHOLDS = (2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0)  # deg/s
AXES = {"gyro_x": "Gyr_X", "gyro_y": "Gyr_Y", "gyro_z": "Gyr_Z"}
TRIADS = {"gyro": list(AXES)}
MAPPING = {f"{name}.{c}": f"IMU_{c}.csv:{field}" for name, field in AXES.items() for c in range(1, 5)}


def config(threshold: float, persistence: int) -> VoteConfig:
    """CONFIG of ``rig vote``."""
    default = {"threshold": threshold, "persistence": persistence}
    return VoteConfig(default=default, mapping=MAPPING, time_column="time")


def variants(flight: Path) -> dict[str, Recording]:
    """The recording as it is and aligned."""
    chosen = config(1.0, 8)
    raw = read(flight, chosen, repair=True)
    settings = chosen.signals(raw.signals, "")
    first, last = float(raw.time_s[0]), float(raw.time_s[-1])
    found = {"raw": raw}
    for name, end in (("aligned", last), ("aligned by 6 s", 6.0)):
        for matrix in (False, True):
            options = AlignOptions(first, end, matrix)
            found[name + ", matrix" * matrix] = run_alignment(raw, settings, options, TRIADS)[0]
    return found


def failed(recording: Recording, threshold: float, persistence: int) -> int:
    """Channels of the three signals that were failed."""
    voted = vote(recording, config(threshold, persistence).signals(recording.signals, ""), [])
    return sum(len({failure.channel for failure in signal.failures}) for signal in voted.values())


def main() -> None:
    """Print channels failed / flights hit, by variant, persistence and threshold."""
    folder, counts = Path(sys.argv[1]), [int(count) for count in sys.argv[2:]] or [8, 12, 24]
    flights = [variants(path) for path in sorted(folder.glob("path_*"))]
    print(f"{len(flights)} flights, {4 * len(AXES) * len(flights)} channels; thresholds {THRESHOLDS} deg/s")
    for variant in flights[0]:
        for persistence in counts:
            row: list[str] = []
            for threshold in THRESHOLDS:
                found = [failed(flight[variant], threshold, persistence) for flight in flights]
                row.append(f"{sum(found)}/{sum(count > 0 for count in found)}")
            print(f"{variant}, {persistence} frames:", "  ".join(row), flush=True)


if __name__ == "__main__":
    main()
