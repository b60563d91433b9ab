"""What became of each fault: when it began, when its error left the threshold, when its channel was failed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.frame import CHANNELS, SIGNALS, Block, S, State
from rig.score.isolations import Failures
from rig.score.places import Place, channels_of, on_channels
from rig.score.record import FaultScore, Outcome

Bools = NDArray[np.bool_]


def acts(rows: Block, faults: int) -> Bools:
    """(n, faults) whether each fault of the scenario acted in each frame."""
    return np.unpackbits(rows["acting"], axis=1, bitorder="little")[:, :faults].astype(bool)


def spoiling(acting: Bools, faults: Sequence[Any]) -> Bools:
    """(n, S, 4) whether a fault that changes samples acted on each channel."""
    out = np.zeros((len(acting), S, CHANNELS), bool)
    for place in on_channels(faults):
        if place.spoils:
            out[:, place.signal, place.channel] |= acting[:, place.index]
    return out


def outcomes(
    faults: Sequence[Any],
    rows: Block,
    acting: Bools,
    error: NDArray[np.float64],
    params: NDArray[np.void],
    failures: Failures,
) -> list[FaultScore]:
    """One entry for each fault and channel, then those that sit on no channel, in the order of the scenario."""
    scored = [
        _on_channel(place, rows, acting[:, place.index], error, params, failures) for place in on_channels(faults)
    ]
    elsewhere = [_elsewhere(i, fault, acting[:, i]) for i, fault in enumerate(faults) if not channels_of(fault)]
    return sorted([*scored, *elsewhere], key=lambda entry: entry.index)


def _on_channel(
    place: Place,
    rows: Block,
    acted: Bools,
    error: NDArray[np.float64],
    params: NDArray[np.void],
    failures: Failures,
) -> FaultScore:
    s, c = place.signal, place.channel
    frames = np.flatnonzero(acted)
    before = rows["state"][np.maximum(frames - 1, 0), s, c]
    in_use = frames[(before != State.FAILED) | (frames == 0)]
    if not len(in_use):
        return _entry(place.index, place.fault, SIGNALS[s].name, c + 1, _first(frames), None, None, "not executed")
    onset = int(in_use[0])
    lasted = frames[frames >= onset]
    errors = np.abs(error[lasted, s, c]) if place.spoils else np.zeros(len(lasted))
    above = lasted[~(errors <= params[s]["threshold"])]
    failed, resolver = failures.of(s, c, lasted) if place.spoils else (None, None)
    outcome: Outcome = "undetectable" if not len(above) else "missed"
    if failed is not None:
        outcome = "detected"
    run = longest_run(above)
    finite = errors[np.isfinite(errors)]
    return _entry(
        place.index,
        place.fault,
        SIGNALS[s].name,
        c + 1,
        onset,
        _first(above),
        failed,
        outcome,
        resolver,
        float(finite.max()) if len(finite) else None,
        run,
        outcome == "missed" and run < params[s]["persistence"],
    )


def _elsewhere(index: int, fault: Any, acted: Bools) -> FaultScore:
    """A fault on the inertial unit, a reference, a surface: no channel monitor can see it."""
    onset = _first(np.flatnonzero(acted))
    outcome: Outcome = "not executed" if onset is None else "undetectable"
    return _entry(index, fault, fault.signal, None, onset, None, None, outcome)


def _entry(
    index: int,
    fault: Any,
    signal: str,
    channel: int | None,
    onset: int | None,
    exceeded: int | None,
    failed: int | None,
    outcome: Outcome,
    resolver: str | None = None,
    peak_error: float | None = None,
    run: int = 0,
    tolerated: bool = False,
) -> FaultScore:
    return FaultScore(
        id=fault.label,
        signal=signal,
        channel=channel,
        kind=fault.kind,
        onset_frame=onset,
        exceeded_frame=exceeded,
        failed_frame=failed,
        outcome=outcome,
        delay_from_onset_frames=None if failed is None or onset is None else failed - onset,
        delay_from_exceeded_frames=None if failed is None or exceeded is None else failed - exceeded,
        resolver=resolver,
        peak_error=peak_error,
        exceeded_run_frames=run,
        tolerated=bool(tolerated),
        index=index,
    )


def _first(frames: NDArray[np.intp]) -> int | None:
    return int(frames[0]) if len(frames) else None


def longest_run(frames: NDArray[np.intp]) -> int:
    """The most consecutive numbers in a row in ``frames``, which rise."""
    if not len(frames):
        return 0
    breaks = np.flatnonzero(np.diff(frames) != 1)
    edges = np.concatenate([[-1], breaks, [len(frames) - 1]])
    return int(np.diff(edges).max())
