"""What followed each fault on a channel of a signal: from its onset to the next one on the same signal, or to the end.

The vote is *kept* when it is within its threshold at the end of the window, and was not for at most as long as a
monitor may take: persistence, singular persistence and MARGIN.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.monitored import Monitored
from rig.assess.record import FaultScore, Window
from rig.assess.votes import difference
from rig.frame import INDEX, SIGNALS, Block, State

MARGIN: Final = 10  # frames: counts that wait after a pattern without a majority, lags of the sensors


def with_windows(
    faults: Sequence[FaultScore], rows: Block, signals: Monitored, params: NDArray[np.void], rate_hz: float
) -> list[FaultScore]:
    """``faults`` with their windows; params : (S,) config.PARAMS."""
    return [replace(fault, window=_window(fault, faults, rows, signals, params, rate_hz)) for fault in faults]


def allowed_frames(p: NDArray[np.void]) -> int:
    """For how many frames of a window a kept vote may be off; p : PARAMS of the signal."""
    return int(p["persistence"]) + int(p["singular_persistence"]) + MARGIN


def last_frame(fault: FaultScore, faults: Sequence[FaultScore], frames: int) -> int:
    """The frame before which the window ends: the next onset on the signal, or the number of frames."""
    begin = -1 if fault.onset_frame is None else fault.onset_frame
    onsets = [f.onset_frame for f in faults if f.signal == fault.signal and f.onset_frame is not None]
    return min((onset for onset in onsets if onset > begin), default=frames)


def _window(
    fault: FaultScore,
    faults: Sequence[FaultScore],
    rows: Block,
    signals: Monitored,
    params: NDArray[np.void],
    rate_hz: float,
) -> Window | None:
    onset = fault.onset_frame
    if onset is None or fault.channel is None or fault.signal not in INDEX:
        return None
    s, end = INDEX[fault.signal], last_frame(fault, faults, len(rows))
    p = params[s]
    off = np.abs(difference(rows["voted"][onset:end, s], rows["truth"][onset:end, s], SIGNALS[s].wraps))
    above = np.isfinite(rows["truth"][onset:end, s]) & ~(off <= p["threshold"])
    finite = off[np.isfinite(off)]
    fitted = int(p["fitted"])
    faulty = np.logical_or.reduce(signals.acted[:onset, s, :fitted], axis=0)
    failed = (rows["state"][max(onset - 1, 0), s, :fitted] == State.FAILED) & (onset > 0)
    return Window(
        end_frame=end,
        good_before=int((~faulty & ~failed).sum()),
        latent_before=int((faulty & ~failed).sum()),
        above_threshold_s=float(above.sum() / rate_hz),
        error_max=float(finite.max()) if len(finite) else 0.0,
        kept=bool(not above[-1] and above.sum() <= allowed_frames(p)),
        lost_s=float((rows["level"][onset:end, s] == 0).sum() / rate_hz),
    )
