"""Faults in pieces of healthy data, and what a manager makes of them: to choose settings, and to test on recordings.

The faults are those of the trade-off of ``rig thresholds``; their sizes follow the motion of the signal.  There is no
reference.  A piece begins BEFORE_S before the fault, so that a manager that learns has learned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS
from rig.studies.benchmark.calibration_data import Flight
from rig.studies.benchmark.entrants import Entrant, OfSignal, manager
from rig.studies.benchmark.own_class import voted
from rig.studies.thresholds.data_check import envelope
from rig.studies.thresholds.design import DataBlock
from rig.studies.thresholds.pieces import four, outcomes_of
from rig.studies.thresholds.tradeoff import GAIN, NOISE, SHARES, SMALL, Kind, Pieces, circle_of, faulty, pieces
from rig.verdict.signal_kernels import first_failed, trial_words

BEFORE_S: Final = 10.0
CHOOSING: Final = 16  # pieces by which settings are chosen


def flights_of(blocks: Sequence[DataBlock]) -> list[Flight]:
    """Return recordings as flights without a reference."""
    return [
        Flight(block.name, np.ascontiguousarray(block.samples.T), np.full((block.samples.shape[1], 2), np.nan))
        for block in blocks
    ]


def blocks_of(flights: Sequence[Flight], rate_hz: float) -> list[DataBlock]:
    """Return the samples of flights as ``rig thresholds`` has them."""
    return [
        DataBlock(each.name, np.ascontiguousarray(each.samples.T), rate_hz, each.references[:, 0]) for each in flights
    ]


def with_faults(
    cut: Pieces, blocks: Sequence[DataBlock], signal: OfSignal
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the name of each fault and the pieces (R, n, C) that have it."""
    motion = envelope(blocks, signal.given.wraps)
    for name, kind, size in _faults(max(motion.value, motion.noise)):
        samples = cut.samples.copy()
        samples[np.arange(len(samples)), :, cut.channel] = faulty(cut, kind, size, circle_of(signal.given))
        yield name, samples


def _faults(motion: float) -> Sequence[tuple[str, Kind, float]]:
    small: list[tuple[str, Kind, float]] = [(f"small offset {x:g}", "small", x * motion) for x in SMALL]
    offsets: list[tuple[str, Kind, float]] = [(f"offset {x:g}", "offset", x * motion) for x in SHARES]
    return [
        *small,
        *offsets,
        ("ramp", "ramp", SHARES[0] * motion),
        ("noise", "noise", NOISE),
        ("gain", "gain", GAIN),
        ("stuck", "stuck", 0.0),
    ]


def became(
    entrant: Entrant, signal: OfSignal, values: dict[str, Any], cut: Pieces, samples: NDArray[np.float64]
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return the outcome (R,) and the delay (R,), s, of ``samples`` (R, n, C), the pieces with a fault."""
    if entrant.is_own:
        failed_at = first_failed(voted(entrant.manager, values, signal.params, {"channels": four(samples)})[0])
    else:
        failed_at = outcomes_of(samples, cut.channel, cut.onset, manager(entrant, signal, values))["failed_at"]
    tested = np.arange(CHANNELS) == cut.channel[:, None]
    outcome, frames = trial_words(failed_at, np.full(len(samples), cut.onset), tested, ~tested)
    return outcome, frames / cut.rate_hz


def isolated(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock], settings: Sequence[dict[str, Any]]
) -> list[int] | None:
    """Return how many injected faults each of the ``settings`` isolates; None if all blocks are too short."""
    cut = pieces(blocks, CHOOSING, BEFORE_S)
    if cut is None:
        return None
    faults = [samples for _, samples in with_faults(cut, blocks, signal)]
    return [
        sum(int((became(entrant, signal, values, cut, samples)[0] == "isolated").sum()) for samples in faults)
        for values in settings
    ]
