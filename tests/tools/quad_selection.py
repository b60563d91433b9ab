"""The manager ``selection`` on the recordings of four IMUs, with the axes of each as one unit; run it by hand:

    python tests/tools/quad_selection.py ../shared/data/quad_imu_horizontal

7 deg/s and 15 deg.  Healthy: flights in which a channel is distrusted, raw and aligned by the first 6 s.  Then an
offset on one axis of one channel from 40 % of each flight on: found, another one distrusted first, not found.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from quad_isolations import AXES, MAPPING, TRIADS

from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.vote import Result, vote
from rig.recordings.align import align
from rig.recordings.read import read
from rig.recordings.recording import Recording
from rig.recordings.settings import VoteConfig

CONFIG = VoteConfig(
    default={
        "threshold": 10.0,
        "manager": "selection",
        "selection_deviation": 7.0,
        "selection_integral_s": 15.0,
    },
    mapping=MAPPING,
    time_column="time",
    triads=TRIADS,
)
OFFSETS = (10.0, 20.0, 30.0, 60.0, 100.0)  # deg/s


def trips(recording: Recording) -> int:
    """Channels of the unit that were distrusted at some time."""
    settings = CONFIG.signals(recording.signals, "")
    first = next(iter(vote(recording, settings, [], triads=TRIADS).values()))
    return len({failure.channel for failure in first.failures})


def found(raw: Recording, aligned: bool, axis: str, channel: int, offset: float) -> tuple[str, float | None]:
    """The outcome of one offset, and its delay in s."""
    settings = CONFIG.signals(raw.signals, "")
    start = float(raw.time_s[int(0.4 * len(raw.time_s))])
    fault = {"kind": "offset", "signal": axis, "channels": [channel], "start_s": start, "offset": offset}
    injection = inject(raw, [fault], settings)
    recording, corrections = injection.recording, None
    if aligned:
        recording, corrections = align(recording, settings, end_s=6.0)
    voted = Result(vote(recording, settings, [], triads=TRIADS))
    one = score(injection.injected, recording, voted, corrections)[0]
    return one.outcome, one.delay_s


def main() -> None:
    """Print healthy trips, then found, wrong, missed and prior with the median delay of each offset."""
    flights = [read(path, CONFIG, repair=True) for path in sorted(Path(sys.argv[1]).glob("path_*"))]
    settings = CONFIG.signals(flights[0].signals, "")
    for label, variant in (
        ("raw", flights),
        ("aligned by 6 s", [align(flight, settings, end_s=6.0)[0] for flight in flights]),
    ):
        count = [trips(flight) for flight in variant]
        print(f"{label}: healthy trips {sum(count)} in {sum(c > 0 for c in count)} of {len(count)} flights", flush=True)
    for aligned in (False, True):
        for offset in OFFSETS:
            runs = [
                found(flight, aligned, axis, 1 + (i + j) % 4, offset)
                for i, flight in enumerate(flights)
                for j, axis in enumerate(AXES)
            ]
            counts = [sum(outcome == name for outcome, _ in runs) for name in ("right", "wrong", "missed", "prior")]
            delays = [delay for outcome, delay in runs if outcome == "right" and delay is not None]
            median = f"{np.median(delays):.2f} s" if delays else "-"
            label = "aligned by 6 s" if aligned else "raw"
            print(f"{label}, offset {offset:g} deg/s: right/wrong/missed/prior {counts}, median {median}", flush=True)


if __name__ == "__main__":
    main()
