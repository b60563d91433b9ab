"""The records that the outcome kernel adds up: faults, failures, stretches without a majority, spans, the flight."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, DecidedBy, Pattern, sig

COMPARISON: Final = 0  # who failed a channel: this, or a DecidedBy
PATTERNS: Final = len(Pattern)
TIE_BREAKS: Final = len(DecidedBy)
ROOM: Final = 4 * CHANNELS  # a signal, of the arrays that are emptied
EXTREMES: Final = (sig.N_Z, sig.Q, sig.THETA, sig.PHI, sig.ALPHA)  # of the truth
FAULT: Final = np.dtype(
    [
        # A fault at one place.
        ("number", "i8"),  # in the scenario, from 0
        ("signal", "i8"),  # or discrete; -1: on no channel
        ("channel", "i8"),  # from 0; -1: on none
        ("discrete", "u1"),
        ("changes", "u1"),  # whether the sample is what it changes
        ("surface", "i8"),  # -1: none
        ("inertial", "i8"),  # quantity of the inertial unit; -1: none
        ("reference", "i8"),  # signal whose reference it sits on; -1: none
        ("references", "i8"),  # signals whose reference it can change, from wherever it sits, bits
        ("columns", "i8"),  # channels of all signals that it takes away, bits
        ("threshold", "f8"),  # of its error on a channel
        # Its outcome; frames from 0, or NEVER.
        ("onset", "i8"),
        ("executed", "u1"),
        ("exceeded_at", "i8"),
        ("failed_at", "i8"),
        ("decided_by", "i8"),
        ("acted_at", "i8"),  # last frame
        ("beyond_at", "i8"),  # last frame in which its error was above the threshold
        ("run", "i8"),  # of such frames, up to that
        ("longest_run", "i8"),
        ("peak", "f8"),  # of its error, at its own place; NaN: none
        ("span", "i8"),  # that begins with it
        ("sample", "f8"),  # when it was failed, else at the onset; of one on no channel the last under it
        ("load_factor", "f8"),  # before the onset
        ("load_factor_change", "f8"),  # NaN: none
        ("pattern", "u1"),  # before it was failed,
        ("in_split", "u1"),  # the first without a majority since the onset; 0: none,
        ("worst", "u1"),  # the worst
    ],
    align=True,
)
FAILURE: Final = np.dtype(
    [
        *(
            ("frame", "i8"),
            ("signal", "i8"),
            ("channel", "i8"),
            ("discrete", "u1"),
            ("decided_by", "i8"),
            ("cause", "u1"),
        ),
        ("erring", "u1"),  # channels whose samples were wrong in its frame or the linger before, bits
    ],
    align=True,
)
SPAN: Final = np.dtype(
    [
        ("signal", "i8"),
        ("begin", "i8"),
        ("good", "i8"),  # channels before it that were not failed, without a fault
        ("latent", "i8"),  # and with one
        ("above", "i8"),  # frames
        ("lost", "i8"),
        ("above_lost", "i8"),  # of the frames above, those up to the first lost one
        ("error_max", "f8"),
        ("off", "u1"),  # in its last frame
    ],
    align=True,
)
EPISODE: Final = np.dtype(
    [
        ("signal", "i8"),
        ("first", "i8"),
        ("last", "i8"),
        ("tie_break", "i8"),  # those that were reported in any of its frames, bits
        ("channels", "f8", (CHANNELS,)),  # of its last frame, as the rest
        ("reference", "f8"),
        ("pattern", "u1"),
        ("decided_by", "u1"),
        ("valid", "u1", (CHANNELS,)),
        ("failed", "u1"),  # in the frame before
        ("ilm", "u1", (CHANNELS,)),
        ("trend_high", "u1"),
        ("trend_low", "u1"),
        ("reference_usable", "u1"),
    ],
    align=True,
)
FLIGHT: Final = np.dtype(
    [
        ("frames", "i8"),
        ("failures", "i8"),  # listed
        ("episodes", "i8"),
        ("spans", "i8"),
        ("unexplained", "i8"),  # signal * 4 + channel of a sample that no fault can have changed; NEVER
        ("window", "i8"),  # frames for which the load factor is looked at after an onset
        ("low", "f8", (len(EXTREMES),)),
        ("high", "f8", (len(EXTREMES),)),
        ("load_factor", "f8"),  # in the row before
        ("acted_from", "i8"),  # first frame in which any fault acted, or NEVER
        ("onsets", "u1"),  # whether any has begun
        ("corrupted", "u1"),  # whether a sample was wrong in the row before
        ("unit", "u1"),  # whether a unit under test flew
        ("end", "u1"),
    ],
    align=True,
)


class Outcomes(NamedTuple):
    """Settings and what is added up; see the types."""

    params: NDArray[Any]  # (S,) config.PARAMS; S: those of the flight or recording
    flight: NDArray[Any]  # (1,) FLIGHT
    faults: NDArray[Any]  # (F,) FAULT
    signals: NDArray[Any]  # (S,) SIGNAL
    discretes: NDArray[Any]  # (D,) SIGNAL
    votes: NDArray[Any]  # (S, 2) VOTE, from the truth and from the vote of healthy channels
    spans: NDArray[Any]  # (S + 2 F,) SPAN; the first S begin with the flight
    failures: NDArray[Any]  # (ROOM * (S + D),) FAILURE
    episodes: NDArray[Any]  # (ROOM * (S + D),) EPISODE
    going_on: NDArray[Any]  # (S,) EPISODE
    patterns: NDArray[Any]  # (S, 7, 7) frames, by pattern before and now
    levels: NDArray[Any]  # (S, 5, 5) the same of levels
