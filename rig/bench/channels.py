"""The channels of a recording: usable samples, suspect rows, isolations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.flight.failures import COMPARISON, became_failed, decider
from rig.flight.suspects import doubted
from rig.log.recordings.recording import Bytes, Recording, Samples

INVALID: Final = "invalid"  # a sample that is no number, flagged, or out of range
FROM_START: Final = "bad_from_start"  # by CONFIG


class ChannelFailure(NamedTuple):
    """Isolation of a channel: its row, counted from 1, and its rule."""

    channel: int
    frame: int
    time_s: float
    why: str  # comparison, a rule, INVALID or FROM_START


class ChannelRecords(NamedTuple):
    """Results of the channels of one signal or discrete."""

    invalid: list[int]  # samples of each that were no number (empty, of a discrete), flagged, or out of range
    suspect: list[int]  # rows of each, by its state, or in use without a usable sample
    failures: list[ChannelFailure]  # in order of time


def usable_samples(samples: Samples, limits: tuple[float, float]) -> list[NDArray[np.bool_]]:
    """Return (n,) for each channel True for a sample that is a number in range and not flagged."""
    usable = [(column >= limits[0]) & (column <= limits[1]) for column in samples.channels]
    flags = samples.valid or [np.ones(1, np.uint8)] * len(usable)
    return [within & (flag != 0) for within, flag in zip(usable, flags, strict=True)]


def channel_records(
    recording: Recording,
    samples: Samples,
    limits: tuple[float, float],
    states: Sequence[Bytes],
    tie_break: Bytes | None = None,
    bad_from_start: Collection[int] = (),
) -> ChannelRecords:
    """Return the results of the channels by their ``states``, (n,) each.

    tie_break : (n,) deciding rule of each row; bad_from_start : channels, from 1, that begin isolated
    """
    usable = [good[: len(recording.time_s)] for good in usable_samples(samples, limits)]  # of the rows voted
    return ChannelRecords(
        invalid=[int((~good).sum()) for good in usable],
        suspect=[int(doubted(state, good).sum()) for state, good in zip(states, usable, strict=True)],
        failures=_failures(recording, states, usable, tie_break, bad_from_start),
    )


def _failures(
    recording: Recording,
    states: Sequence[Bytes],
    usable: Sequence[NDArray[np.bool_]],
    tie_break: Bytes | None,
    bad_from_start: Collection[int],
) -> list[ChannelFailure]:
    """Return every change to failed, in order of time: by an invalid sample, the rule of its row, or comparison."""
    failures: list[ChannelFailure] = []
    for k, _, c in became_failed(np.column_stack(states)[:, None]).tolist():
        why = COMPARISON if tie_break is None else decider(int(tie_break[k]), True)
        why = why if usable[c][k] else INVALID
        why = FROM_START if k == 0 and c + 1 in bad_from_start else why
        failures.append(ChannelFailure(c + 1, recording.row(k), float(recording.time_s[k]), why))
    return failures


def begin_isolated(state: np.void, params: np.void, channels: Sequence[int], name: str) -> None:
    """Let a signal begin with ``channels``, from 1, isolated.  BadInput: it has fewer channels, or none is left."""
    fitted = int(params["fitted"])
    if beyond := [c for c in channels if c > fitted]:
        raise BadInput(f"signal.{name}.bad_from_start: no channel {beyond[0]}; the signal has {fitted}")
    if channels and len(channels) == fitted:
        raise BadInput(f"signal.{name}.bad_from_start: all {fitted} channels; at least one must be good")
    for c in channels:
        state["failed"][c - 1] = 1
    state["level"] -= len(channels)
