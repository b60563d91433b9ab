"""State of the redundancy manager for each signal from frame to frame, and all its data besides the row."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.opinions import NO_ANSWER
from rig.computer.redundancy.slow_tests import TESTS
from rig.core.frame import CHANNELS

STATE: Final = np.dtype(
    [
        ("vote", "f8"),  # last vote before the fade
        ("rise_vote", "f8"),  # its last change
        ("output", "f8"),  # last vote after the fade
        ("fade", "f8"),  # output minus vote when the level last changed
        ("last_high", "f8"),
        ("last_low", "f8"),
        ("rise_high", "f8"),
        ("rise_low", "f8"),
        ("threshold", "f8"),  # of this frame, as the next
        ("reference_threshold", "f8"),
        ("x", "f8", (CHANNELS,)),
        ("order", "i8", (CHANNELS,)),
        # With a filter before the comparison alone; NaN where it begins with the next value.
        ("smooth", "f8", (CHANNELS,)),
        ("smooth_order", "i8", (CHANNELS,)),
        ("smooth_reference", "f8"),
        ("smooth_vote", "f8"),
        # Slow faults (slow_faults.py), each where it is on.
        ("above", "f8", (CHANNELS,)),  # sums of residuals, unit times frames
        ("below", "f8", (CHANNELS,)),
        ("last_sample", "f8", (CHANNELS,)),
        ("last_reference", "f8"),
        ("repeats", "i8", (CHANNELS,)),
        ("tests", TESTS),  # slow_tests.py
        ("stale", "i8"),  # a bit for each channel whose sample has repeated for too long
        ("before", "f8", (CHANNELS,)),  # comparable samples of the last frame, NaN where none; for weighted means
        ("now", "f8", (CHANNELS,)),  # and of this one
        ("count", "f8", (CHANNELS,)),  # miscomparing frames in a row; with ``count_down`` less what it took off
        ("excess", "f8", (CHANNELS,)),  # integrated deviation, for the manager "selection"
        ("agreed", "i8", (CHANNELS,)),  # frames in a row that a failed channel agreed with the vote
        ("trend_high", "i8"),
        ("trend_low", "i8"),
        ("trend_seen", "i8"),
        ("trend_says", "i8"),  # the last whole window of those that tumble
        ("still_high", "i8"),  # frames in a row in which the rank did not change
        ("still_low", "i8"),
        ("last_n", "i8"),
        ("pattern", "i8"),
        ("pattern_frames", "i8"),  # frames that the present pattern has lasted
        ("split_run", "i8"),  # frames in a row of any split
        ("answer", "i8"),  # the rule that answers the pattern,
        ("answer_blames", "i8"),  # a bit for each channel that it would fail,
        ("answer_frames", "i8"),  # and for how many frames in a row
        ("unresolved_frames", "i8"),  # that no rule has answered, since an answer has stood or all had a majority
        ("silent_frames", "i8"),  # in a row without an answer
        ("hold_of", "i8"),  # a bit for each channel compared when the shares below were found; 0: none are kept
        ("hold_low", "i8"),  # channels, and the share of the second in a vote that no rule decides
        ("hold_high", "i8"),
        ("hold_share", "f8"),
        ("hold_gap", "f8"),  # between the two when last used
        ("whole", "u1"),  # all channels in use are compared
        ("standing", "u1"),  # the samples of all channels in use repeat
        ("basis", "u1"),  # the last vote is of all channels in use, or held
        ("after_extremes", "u1"),  # the two channels left are those that extremes have kept
        ("cut_frames", "i8"),  # frames in a row in which the reference is off both
        ("lanes", "i8"),  # a bit for each channel whose computer is failed
        ("in_dispute", "u1"),  # one of the signals that its references read
        ("together", "u1"),  # behind a filter: the samples of a split agree again
        ("accused", "i8"),  # a bit for each channel that this frame's evidence speaks against
        ("freeze", "i8"),  # frames for which the counts stand still after it
        ("reference_run", "i8"),  # frames in a row that speak against the reference's present standing
        ("fade_left", "i8"),
        ("level", "i8"),
        ("selected", "i8"),  # channel, for the manager "selection"
        ("reference_usable", "u1"),
        ("second_run", "i8"),  # frames in a row in which the second reference is off the vote
        ("common_run", "i8"),  # frames in a row in which two references contradicted all channels
        ("common_mode", "u1"),
        ("started", "u1"),
        ("failed", "u1", (CHANNELS,)),
        ("miscomparing", "u1", (CHANNELS,)),
        ("blamed", "u1", (CHANNELS,)),  # by the provisional answer
    ],
    align=True,
)


class ManagerData(NamedTuple):
    """Data of a manager besides the row: one record a signal unless stated otherwise."""

    choice: int  # place in managers.KINDS
    params: NDArray[Any]  # (S,) config.PARAMS
    state: NDArray[Any]  # (S,) STATE, in place
    boxes: NDArray[Any]  # (1,) box.BOXES, in place
    lanes: NDArray[Any]  # (4,) 1 where the computer of a channel is failed
    baseline: Any = None  # managers.Chosen; None: no baseline manager


def new_state(params: NDArray[np.void]) -> NDArray[np.void]:
    """State records at the first frame: every fitted channel in use, every reference trusted."""
    state = np.zeros(len(params), STATE)
    state["reference_usable"] = 1
    state["level"] = params["fitted"]
    state["trend_says"] = NO_ANSWER
    for name in ("smooth", "smooth_reference", "smooth_vote", "last_sample", "last_reference", "before", "now"):
        state[name] = np.nan
    return state
