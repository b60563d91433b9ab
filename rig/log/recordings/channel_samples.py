"""Recorded channels brought to the convention of their signal: sign, scale, unit, offset, counting, known rotation.

Everything here is in SI units: the samples have been converted by the unit of their signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.text import choices, quoted
from rig.core.units.angles import into_range
from rig.core.units.constants import TWO_PI
from rig.core.units.conversion import conversion
from rig.log.recordings.channel_config import Channel, Rotation
from rig.log.recordings.recorded_signal import RecordedSignal
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import VoteConfig

REFERENCE: Final = "ref"
_SLACK: Final = 1e-9  # of a turn, for an angle at the end of its convention


def calibrated(
    recording: Recording, settings: Mapping[str, RecordedSignal], config: VoteConfig, source: str
) -> Recording:
    """Return the recording with ``[channel]`` and ``[rotation]`` applied, and a remark on each.

    BadInput names ``source``: a channel, triad or unit that there is not, a convention of what is no angle, axes of a
    triad without the channel.
    """
    if not config.channel and not config.rotation:
        return recording
    signals, remarks = dict(recording.signals), list(recording.remarks)
    for name, own in config.channel.items():
        where = f"{source}: channel.{quoted(name)}"
        signal, number = _place(where, name, signals, settings)
        columns = _columns(signals[signal])
        columns[number] = _one(where, columns[number], own, settings[signal], recording.in_si)
        signals[signal] = _with(signals[signal], columns)
        given = own.model_dump(exclude_unset=True)
        remarks.append(f"{name}: {', '.join(f'{key} {value}' for key, value in given.items())}, by CONFIG")
    for triad, recorders in config.rotation.items():
        where = f"{source}: rotation.{triad}"
        if triad not in config.triads:
            raise BadInput(f"{where}: no such triad; {choices(triad, config.triads)}")
        for number, rotation in recorders.items():
            _rotate(f"{where}.{number}", signals, config.triads[triad], number, rotation)
            remarks.append(f"{triad}, recorded channel {number}: turned, by CONFIG")
    return replace(recording, signals=signals, remarks=tuple(remarks))


def _place(
    where: str, name: str, signals: Mapping[str, Samples], settings: Mapping[str, RecordedSignal]
) -> tuple[str, str]:
    """Return the signal and the number of a channel.  BadInput: there is none."""
    signal, _, number = name.rpartition(".")
    if signal not in settings or number not in _columns(signals[signal]):
        known = [f"{one}.{c}" for one in settings for c in _columns(signals[one])]
        raise BadInput(f"{where}: no such channel of a signal that is voted; {choices(name, known)}")
    return signal, number


def _columns(samples: Samples) -> dict[str, Floats]:
    """Return all channels by recorded number, and the reference."""
    columns = {str(samples.number(c)): column for c, column in enumerate(samples.channels)}
    columns |= {str(number): column for number, column in samples.others.items()}
    return columns if samples.reference is None else {**columns, REFERENCE: samples.reference}


def _with(samples: Samples, columns: Mapping[str, Floats]) -> Samples:
    return replace(
        samples,
        channels=[columns[str(samples.number(c))] for c in range(len(samples.channels))],
        others={number: columns[str(number)] for number in samples.others},
        reference=columns.get(REFERENCE),
    )


def _one(where: str, column: Floats, own: Channel, settings: RecordedSignal, in_si: bool) -> Floats:
    """Return one channel in the convention of its signal."""
    factor = settings.scale
    if own.unit is not None:
        if not settings.si:
            raise BadInput(f"{where}: unit: the signal has none; give it a unit in [signal]")
        try:
            factor = conversion(own.unit, settings.si).factor
        except ValueError as error:
            raise BadInput(f"{where}: unit: {error}") from None
        column = column if in_si else column * (factor / settings.scale)
    low, high = settings.limits
    if own.convention is not None:
        if not settings.wraps:
            raise BadInput(f"{where}: convention: the signal is no angle that wraps; wraps = true in [signal]")
        low, high = (0.0, TWO_PI) if own.is_full_turn else (-0.5 * TWO_PI, 0.5 * TWO_PI)
    made = own.sign * own.scale * column + own.offset * factor
    if not settings.wraps:
        return made
    slack = _SLACK * TWO_PI
    valid = (column >= low - slack) & (column <= high + slack)
    return np.where(valid, into_range(made, *settings.limits, True), np.nan)


def _rotate(where: str, signals: dict[str, Samples], axes: list[str], number: str, rotation: Rotation) -> None:
    """Turn one recorder of a triad, in place of ``signals``; an axis is NaN if one that it is made of is."""
    of = [_columns(signals[axis]) for axis in axes]
    for axis, columns in zip(axes, of, strict=True):
        if number not in columns or number == REFERENCE:
            raise BadInput(f"{where}: {axis} has no channel {quoted(number)}; {choices(number, columns)}")
    vector = [columns[number] for columns in of]
    for axis, columns, row in zip(axes, of, rotation.as_matrix(), strict=True):
        turned = sum(share * column for share, column in zip(row, vector, strict=True) if share)
        signals[axis] = _with(signals[axis], {**columns, number: np.asarray(turned)})
