"""Numbers that the kernels of the redundancy manager read of a signal's settings: one record a signal."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple, get_args

import numpy as np

TieBreak = Literal["ilm", "lane", "reference", "trend", "extremes", "middle"]
TIE_BREAKS: Final = len(get_args(TieBreak))


class Param(NamedTuple):
    """One number that the kernels read of a signal's settings, and what a unit under test reads of it."""

    name: str
    base: str  # of its numpy type
    meaning: str  # as a unit's header has it
    part: Literal["signal", "slow_faults", "slow_tests", "rules", ""] = "signal"  # record of a unit that holds it
    shape: tuple[int, ...] = ()
    reserved: bool = False  # 0 in that record: a setting of an earlier version of the rig


_RESERVED: Final = "zero: a setting of an earlier version"
PARAM_FIELDS: Final = (
    Param("threshold", "f8", "unit of the signal: two of four samples agree within it"),
    Param("threshold_triplex", "f8", "unit of the signal: two of three samples"),
    Param("threshold_duplex", "f8", "unit of the signal: two samples"),
    Param("reserved_0", "f8", _RESERVED, reserved=True),
    Param("reserved_1", "f8", _RESERVED, reserved=True),
    Param("filter_gain", "f8", "1: share of a new sample in the low-pass before the comparison; 0: no filter"),
    Param("reserved_2", "f8", _RESERVED, "slow_faults", reserved=True),
    Param("reserved_3", "f8", _RESERVED, "slow_faults", reserved=True),
    Param("slow_allowance", "f8", "unit of the signal: what a residual may be for ever", "slow_faults"),
    Param(
        "slow_limit",
        "f8",
        "unit of the signal times frames: sum of what exceeds it that fails a channel; 0: no sums",
        "slow_faults",
    ),
    Param(
        "stale_frames",
        "i8",
        "frames in which a sample repeats while others move until it is not compared; 0: any may",
        "slow_faults",
    ),
    Param("slow_means", "f8", "1: factor on the limits of the two means; 0: no slow-fault tests", "slow_tests"),
    Param("slow_squares", "f8", "1: factor on the limit of the mean square", "slow_tests"),
    Param("slow_halves", "f8", "1: factor on the limits of halves of the channels", "slow_tests"),
    Param("slow_bias", "f8", "unit of the signal: largest bias that is learned at zero", "slow_tests"),
    Param("slow_scale", "f8", "1: tolerance of the scale of a channel", "slow_tests"),
    Param("slow_noise", "f8", "unit of the signal: least noise that residuals are measured by", "slow_tests"),
    Param("slow_skew", "f8", "frames: by which channels are sampled earlier than others", "slow_tests"),
    Param("slow_reference", "f8", "unit of the signal: healthy error of a reference; 0: not asked", "slow_tests"),
    Param("slow_reference_frames", "f8", "frames: what that is more by, in changes of a frame", "slow_tests"),
    Param("reference_threshold", "f8", "unit of the signal: a sample and the reference agree within it"),
    Param(
        "reference_airspeed_m_s",
        "f8",
        "m/s: error of a reference that is a dynamic pressure, as an airspeed; 0: of none",
    ),
    Param("second_threshold", "f8", "unit of the signal: as reference_threshold, of the second reference"),
    Param(
        "common_persistence", "i8", "frames in a row of two references against all channels until it is a common mode"
    ),
    Param("common_fails", "u1", "1: a common mode fails all channels; 0: it is reported"),
    Param(
        "low", "f8", "unit of the signal: least sample of the sensor; of an angle that wraps where its circle begins"
    ),
    Param("high", "f8", "unit of the signal: largest sample of the sensor"),
    Param("persistence", "i8", "miscomparing frames in a row until a channel is isolated"),
    Param("split_persistence", "i8", "frames until a split is settled"),
    Param("trend_frames", "i8", "bits of a trend byte, 1 to 8"),
    Param("readmit_frames", "i8", "frames in a row of agreement before a reset readmits a failed channel"),
    Param("fade_frames", "i8", "frames in which the vote fades after a change of level; 0: none"),
    Param("deviation", "f8", "unit of the signal: tolerated deviation from the mean; manager selection alone"),
    Param(
        "deviation_frames",
        "f8",
        "unit of the signal times frames: integral of what exceeds it; manager selection alone",
    ),
    Param("fitted", "i8", "channels that there are, the first ones"),
    Param("tie_break", "i8", "in their order, of DecidedBy; 0 behind the last", shape=(TIE_BREAKS,)),
    Param("wraps", "u1", "1: an angle in rad on the circle, differences go the short way"),
    Param("weighted", "u1", "1: means of the middle samples and of a good pair are weighted by their trend"),
    Param(
        "count_down", "f8", "frames that an agreeing one takes off the count of miscompares; 0: all of them", "rules"
    ),
    Param(
        "unresolved_frames",
        "i8",
        "frames in a row without a tie-break until all channels are isolated; 0: never",
        "rules",
    ),
    Param(
        "trend_small",
        "f8",
        "unit of the signal: changes of at most that are a trend after one frame; -1: none are",
        "rules",
    ),
    Param(
        "trend_tumbles",
        "u1",
        "1: trend bytes begin again every trend_frames frames, and the result of whole ones stands",
        "rules",
    ),
    Param("trend_beside_reference", "u1", "1: the trend is asked of a signal with a reference, too", "rules"),
    Param("referred", "u1", "1: a reference is configured", "rules"),
    Param(
        "tells",
        "i8",
        "the signal's own bit, 1 shifted by its index, if the references of others read it; 0: they do not",
        "rules",
    ),
    Param("sources", "i8", "bits of signals that its references read, of those that have their bit in tells", "rules"),
    Param("box", "i8", "box of the signal, 1 to 16; 0: in none", "rules"),
)
PARAMS: Final = np.dtype([(each.name, each.base, each.shape) for each in PARAM_FIELDS if not each.reserved], align=True)


def told(part: str) -> tuple[str, ...]:
    """Return the fields of PARAMS that a record of a unit holds."""
    return tuple(each.name for each in PARAM_FIELDS if each.part == part and not each.reserved)
