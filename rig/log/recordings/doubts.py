"""Samples out of range: reported by signal, channel, share, range and unit, or refused if the range is a default.

A range in CONFIG defines valid samples: the user wants all others to be invalid.  A range that CONFIG does not
give, that of flight or of one turn, is refuted when every channel is often outside: then the file is in another unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.units.conversion import USUAL
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal

SHARE: Final = 0.2  # of a channel's samples


def out_of_range(source: str, recording: Recording, settings: Mapping[str, RecordedSignal]) -> list[str]:
    """Return a line for each channel of which more than SHARE is out of range or no number; one if all of a signal are.

    BadInput: every channel of a signal is out of a range that CONFIG does not give.
    """
    warnings: list[str] = []
    for name, chosen in settings.items():
        shares = _shares(recording.signals[name], chosen)
        if chosen.range_is_assumed and min(outside for outside, _ in shares) > SHARE:
            way_out = _whole_turn(recording.signals[name], chosen)
            raise BadInput(f"{source}: {_line(name, 'every channel', shares, 0, chosen)}{way_out}")
        warnings += [f"{source}: {line}" for kind in (0, 1) for line in _lines(name, shares, kind, chosen)]
    return warnings


def _shares(samples: Samples, settings: RecordedSignal) -> list[tuple[float, float]]:
    """Return of each channel the shares of samples that are numbers out of range, and that are no numbers."""
    low, high = settings.limits
    shares: list[tuple[float, float]] = []
    for column in samples.channels:
        finite = np.isfinite(column)
        shares.append((float((finite & ~((column >= low) & (column <= high))).mean()), float((~finite).mean())))
    return shares


def _lines(name: str, shares: list[tuple[float, float]], kind: int, settings: RecordedSignal) -> list[str]:
    bad = [c for c, share in enumerate(shares, 1) if share[kind] > SHARE]
    if len(bad) == len(shares):
        return [_line(name, "every channel", shares, kind, settings)]
    return [_line(f"{name}.{c}", "", [shares[c - 1]], kind, settings) for c in bad]


def _line(name: str, of: str, shares: list[tuple[float, float]], kind: int, settings: RecordedSignal) -> str:
    least, most = (100.0 * end(share[kind] for share in shares) for end in (min, max))
    share = f"{least:.3g} %" if f"{least:.3g}" == f"{most:.3g}" else f"{least:.3g} to {most:.3g} %"
    samples = f"{name}: {share} of the samples{f' of {of}' if of else ''} are"
    if kind:
        return f"{samples} not numbers: check the recorder, or leave the channel out"
    low, high = (f"{settings.shown(limit):.4g}" for limit in settings.limits)
    usual = next(iter(USUAL.get(settings.si, ())), "")  # the unit in which the file may be
    likely = f'if the file is in {usual}, set unit = "{usual}"; otherwise ' if usual and settings.scale == 1.0 else ""
    out = f"{samples} out of range [{low}, {high}] {settings.unit or ''}".rstrip()
    return f"{out}: {likely}give its range in CONFIG"


def _whole_turn(samples: Samples, settings: RecordedSignal) -> str:
    """Return the range of an angle that is counted from zero, as a heading is; "" of other samples."""
    turn = 2.0 * np.pi
    joined = np.concatenate(samples.channels)
    if not settings.wraps or not (np.nanmin(joined) >= 0.0 and np.nanmax(joined) <= turn):
        return ""
    return f": range = [0, {settings.shown(turn):.6g}]"
