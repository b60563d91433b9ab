"""The residuals that the manager's sums add up, of whole flights, and what its slow-fault tests learn meanwhile.

No channel is isolated, so a series is the same for every threshold, limit and allowance.  With slow-fault tests a
residual is taken without the learned bias; without them it is a sample less the middle of all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.slow_faults import summed_from
from rig.computer.redundancy.slow_tests import isolate_slow
from rig.computer.redundancy.slow_tests_config import OFF
from rig.computer.redundancy.state import new_state
from rig.core.frame import CHANNELS, Ilm
from rig.core.kernels import long_kernel
from rig.core.threads import heed
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.pieces import four, parameters

Floats = NDArray[np.float64]
Flight = tuple[Floats, Floats | None]  # the channels (C, n) and the reference (n,)
_WIDE: Final = {  # no channel is isolated, and all are compared
    **OFF,
    **dict.fromkeys(("threshold", "threshold_triplex", "threshold_duplex"), np.inf),
    **dict.fromkeys(("persistence", "split_persistence"), 1 << 62),  # nor for samples that are not comparable
    "slow_limit": 0.0,
}
VALID: Final = np.ones(CHANNELS, np.uint8)
ILM: Final = np.full(CHANNELS, Ilm.ABSENT, np.uint8)


class Residuals(NamedTuple):
    """The residuals of a signal: the largest mean of a channel by flight (F,), and the spread about the means."""

    means: Floats
    spread: float

    @property
    def noisy(self) -> bool:
        """Return True if noise exceeds the channels' mean differences over a flight."""
        return bool(0.0 < self.means.max() < self.spread)


def residuals(flights: Iterable[Flight], settings: RecordedSignal, rate_hz: float) -> Residuals:
    """Return the mean and the spread of the residuals of all flights."""
    means, squares, count = [], 0.0, 0
    for flight in flights:
        row = series(flight, settings, rate_hz)
        good = np.isfinite(row)
        mean = np.where(good, row, 0.0).sum(axis=0) / np.maximum(good.sum(axis=0), 1)
        means.append(float(np.abs(mean).max()))
        squares, count = squares + float(np.nansum((row - mean) ** 2)), count + int(good.sum())
    return Residuals(np.array(means), float(np.sqrt(squares / max(count, 1))))


def series(flight: Flight, settings: RecordedSignal, rate_hz: float) -> Floats:
    """Return the residuals (n, CHANNELS), NaN where a sample is not compared."""
    return _run(flight, settings, rate_hz)[0]


def learned(before: Sequence[Floats], settings: RecordedSignal, count: int, rate_hz: float) -> NDArray[Any]:
    """Return (R,) the manager's states of ``count`` channels after learning from each ``before`` (C, n)."""
    state = np.repeat(new_state(parameters(settings, count, rate_hz)), len(before))
    if settings.slow_tests is not None:
        for of_piece, samples in zip(state, before, strict=True):
            of_piece["tests"] = _run((samples, None), settings, rate_hz)[1]["tests"][0]
    return state


def wide(params: Any) -> NDArray[Any]:
    """Return (1,) the PARAMS record of a signal with which no channel is isolated, without tests."""
    bare = np.array([params], params.dtype)
    for name, value in _WIDE.items():
        bare[name] = value
    return bare


def _run(flight: Flight, settings: RecordedSignal, rate_hz: float) -> tuple[Floats, NDArray[Any]]:
    """Return the residuals of a flight, and the manager's state (1,) behind its last frame."""
    heed()
    samples, given = flight
    params = parameters(settings, len(samples), rate_hz)
    rows, bare = four(np.ascontiguousarray(samples.T)), wide(params[0])
    reference = np.full(len(rows), np.nan) if given is None else np.ascontiguousarray(given)
    state, out = new_state(bare), np.full_like(rows, np.nan)
    _subtract(rows, reference, (VALID, ILM), (bare, params), state, out)
    return out, state


@long_kernel
def _subtract(samples, reference, given, params, state, out):
    """Write the residuals; params : PARAMS (1,) each, the first without tests and limits."""
    p, q, st = params[0][0], params[1][0], state[0]
    valid, ilm = given
    for k in range(len(samples)):
        manage_signal(samples[k], valid, ilm, reference[k], np.nan, p, st)
        n = st["last_n"]
        if n < 2:
            continue
        m = summed_from(n, np.nan, q, st)
        for i in range(n):
            c = st["order"][i]
            out[k, c] = st["x"][c] - st["tests"]["bias"][c] - m
        if n == st["level"]:
            isolate_slow(reference[k], n, q, st)
