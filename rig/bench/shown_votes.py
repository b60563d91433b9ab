"""Votes on a recording as the pictures show them: in the unit of each signal, with its threshold in every row."""

from __future__ import annotations

import numpy as np

from rig.bench.vote_rows import Result, Voted
from rig.core.frame import CHANNELS
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedSignal
from rig.show.votes.shown_signal import ShownSignal, around, since_first


def shown_votes(recording: Recording, voted: Result) -> list[ShownSignal]:
    """Return all signals, then all discretes of a vote."""
    time_s = since_first(recording.time_s)
    signals = [_signal(name, time_s, recording, each) for name, each in voted.signals.items()]
    discretes = [
        ShownSignal(
            name,
            "",
            time_s,
            recording.discretes[name].channels,
            each.voted.astype(np.float64),
            each.state,
            each.level,
            discrete=True,
        )
        for name, each in voted.discretes.items()
    ]
    return signals + discretes


def _signal(name: str, time_s: Floats, recording: Recording, of: Voted) -> ShownSignal:
    own = of.settings
    value, channels = around(of.voted, recording.signals[name].channels, own.wraps)
    return ShownSignal(
        name,
        own.unit or own.si,
        time_s,
        [own.shown(channel) for channel in channels],
        own.shown(value),
        of.state,
        of.level,
        of.pattern,
        of.decided_by,
        own.shown(thresholds(own)[np.minimum(of.level, CHANNELS)]),
    )


def thresholds(own: RecordedSignal) -> Floats:
    """Return (5,) the difference, SI, within which two channels agree, by the number of channels in use."""
    three, two = own.threshold_triplex or own.threshold, own.threshold_duplex or own.threshold
    return np.array([two, two, two, three, own.threshold])
