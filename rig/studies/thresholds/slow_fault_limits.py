"""Design the limits of the slow-fault rules from healthy flights (docs/explanation/decisions.md).

bias    ``equalise_bound`` is the largest mean over a flight of a channel's residual, one value a flight.  With ten
        clusters or more it is the tail's upper value for the rate (tail.py); otherwise the largest value measured
slow    the series of the CUSUM is, in each frame, the largest allowance with which it isolates a channel; its tail
        gives ``slow_allowance``, for a limit in spreads of the residuals times frames
stale   the longest run of repeats times 3: if runs have a geometric law, data of N frames have to be N^2 times longer
        for one run of that length; the rule is off if a healthy channel stands still
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.compare import rank
from rig.computer.redundancy.slow_faults import (
    NO_CHANNEL,
    begin_sums,
    has_learned,
    learn_bias,
    middle,
    take_bias_off,
    watch_sums,
)
from rig.computer.redundancy.state import new_state
from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel, long_kernel
from rig.core.runs import runs
from rig.core.threads import heed
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.distances import near_first
from rig.studies.thresholds.pieces import four, parameters
from rig.studies.thresholds.tail import LEAST, draws, peaks, point, upper

Floats = NDArray[np.float64]
Rule = Literal["bias", "slow", "stale"]
RULES: Final[tuple[Rule, ...]] = ("bias", "slow", "stale")
OFF: Final[dict[Rule, dict[str, float | None]]] = {
    "bias": {"equalise_bound": 0.0},
    "slow": {"slow_allowance": None, "slow_limit": None},
    "stale": {"stale_frames": 0},
}
LIMITS: Final = (24.0, 60.0, 120.0)  # of the sums: spreads times frames
ALLOWANCES: Final = 2.0 ** np.linspace(-6.0, 2.0, 25)  # spreads
MARGIN: Final = 3
LEAST_FRAMES: Final = 10  # of ``stale_frames``
STILL_S: Final = 1.0  # repeats of a healthy channel from which there are none
_VALID: Final = np.ones(CHANNELS, np.uint8)


class Residuals(NamedTuple):
    """The residuals of a signal: the largest mean of a channel by flight (F,), and the spread about the means."""

    means: Floats
    spread: float

    @property
    def noisy(self) -> bool:
        """Return True if noise exceeds the channels' mean differences over a flight."""
        return bool(0.0 < self.means.max() < self.spread)


def residuals(flights: Sequence[Floats], wraps: bool) -> Residuals:
    """Return the differences of the channels (C, n) of each flight from their middle."""
    rows = [_residuals_of(samples, wraps) for samples in flights]
    means = [np.nan_to_num(_mean(each)) for each in rows]
    squares = sum(np.nansum((each - mean[:, None]) ** 2) for each, mean in zip(rows, means, strict=True))
    count = sum(np.count_nonzero(~np.isnan(each)) for each in rows)
    return Residuals(np.array([np.abs(mean).max() for mean in means]), float(np.sqrt(squares / max(count, 1))))


def _mean(residual: Floats) -> Floats:
    good = ~np.isnan(residual)
    return np.where(good, residual, 0.0).sum(axis=1) / np.maximum(good.sum(axis=1), 1)


def _residuals_of(samples: Floats, wraps: bool) -> Floats:
    rows, params = _rows(samples, wraps), _params(RecordedSignal(threshold=1.0), samples, 1.0)
    residual = np.full_like(rows, np.nan)
    _subtract_middle(rows, _VALID, params, new_state(params), residual)
    return residual.T[: len(samples)]


def equalise_bound(means: Floats, hours: Sequence[float], budget_per_h: float, rng: np.random.Generator) -> float:
    """Return the bound for the largest means of flights (F,) that last ``hours`` each."""
    tail = peaks([means[i : i + 1] for i in range(len(means))], [1.0 / (3600.0 * h) for h in hours], budget_per_h)
    if tail.clusters < LEAST:
        return float(means.max())
    return max(float(means.max()), point(tail, budget_per_h)[0], upper(draws(tail, budget_per_h, rng)))


def unbiased(samples: Floats, seen: Floats, settings: RecordedSignal, rate_hz: float) -> Floats:
    """Return (C, m) the compared values from the frame on in which the manager has learned the biases.

    samples, seen : (C, n) the channels, and the channels behind the filter of the comparison
    Every frame is learned from: the threshold, which is sought, cannot yet exclude suspect channels.
    """
    rows, params = _rows(samples, settings.wraps), _params(settings, samples, rate_hz)
    residual = np.full_like(rows, np.nan)
    beside = rows if seen is samples else _rows(seen, settings.wraps)
    begin = int(_take_learned_off(rows, beside, _VALID, params, new_state(params), residual))
    return np.ascontiguousarray(residual[begin:, : len(samples)].T)


def begun(before: Sequence[Floats], settings: RecordedSignal, count: int, rate_hz: float) -> NDArray[Any]:
    """Return (R,) the manager's states of ``count`` channels after learning from each ``before`` (C, n)."""
    params = _params(settings, np.empty((count, 0)), rate_hz)
    state = np.repeat(new_state(params), len(before))
    if settings.equalise_bound > 0.0:
        for of_piece, samples in zip(state, before, strict=True):
            fresh, rows = new_state(params), _rows(samples, settings.wraps)
            _take_learned_off(rows, rows, _VALID, params, fresh, np.empty_like(rows))
            of_piece["bias"], of_piece["learned"] = fresh[0]["bias"], fresh[0]["learned"]
    return state


def alarms(samples: Floats, settings: RecordedSignal, rate_hz: float, allowances: Floats) -> Floats:
    """Return (n,) the largest of ``allowances`` with which the CUSUM isolates a channel in a frame, or 0.

    The CUSUM starts again after each isolation."""
    heed()
    params = np.repeat(_params(settings, samples, rate_hz), len(allowances))
    params["slow_allowance"] = allowances
    alarm = np.zeros(samples.shape[1])
    _sum_up(_rows(samples, settings.wraps), _VALID, params, new_state(params), alarm)
    return alarm


def stale_frames(flights: Sequence[Floats], rate_hz: float) -> int:
    """Return the count of repeats for healthy flights (C, n); 0 if a channel repeats for STILL_S."""
    spans = [runs(column) for samples in flights for column in samples]
    longest = max((int((each[:, 1] - each[:, 0]).max()) - 1 for each in spans if len(each)), default=0)
    count = max(LEAST_FRAMES, MARGIN * longest)
    return count if longest < STILL_S * rate_hz else 0


def _rows(samples: Floats, wraps: bool) -> Floats:
    return four(np.ascontiguousarray((near_first(samples) if wraps else samples).T))


def _params(settings: RecordedSignal, samples: Floats, rate_hz: float) -> NDArray[Any]:
    """Return the parameters for unwrapped angles, which are never out of range."""
    plain = settings.model_copy(update={"wraps": False, "range": None})
    return parameters(plain, len(samples), rate_hz)


@kernel
def _ranked(samples, valid, p, st):
    """Rank a row as if its pattern were normal: the pattern depends on the threshold, which is sought."""
    st["pattern"] = Pattern.NORMAL
    return rank(samples, valid, 0.0, p, st)


@long_kernel
def _subtract_middle(rows, valid, params, state, out):
    p, st = params[0], state[0]
    for k in range(len(rows)):
        n = _ranked(rows[k], valid, p, st)
        if n < 2:
            continue
        m = middle(n, np.nan, st)
        for i in range(n):
            c = st["order"][i]
            out[k, c] = st["x"][c] - m


@long_kernel
def _take_learned_off(rows, seen, valid, params, state, out):
    """Write the compared values of ``seen``; return the first frame with all biases learned, or the number of rows."""
    p, st, begin = params[0], state[0], -1
    for k in range(len(rows)):
        n = _ranked(rows[k], valid, p, st)
        if begin < 0 and n == p["fitted"] and has_learned(n, p, st):
            begin = k
        take_bias_off(seen[k], st["order"], n, st)
        for i in range(n):
            c = st["order"][i]
            out[k, c] = st["compared"][c]
        learn_bias(middle(n, np.nan, st), n, p, st)
    return begin if begin >= 0 else len(rows)


@long_kernel
def _sum_up(rows, valid, params, state, out):
    for j in range(len(params)):
        p, st = params[j], state[j]
        for k in range(len(rows)):
            n = _ranked(rows[k], valid, p, st)
            if watch_sums(middle(n, np.nan, st), n, p, st) != NO_CHANNEL:
                out[k] = max(out[k], p["slow_allowance"])
                begin_sums(st)
            learn_bias(middle(n, np.nan, st), n, p, st)
