"""The channels of all signals at the cursor as a matrix of colours, with the legend of lines and cells.

/matrix         a cell for each channel, updated at each change of state
/matrix/names   the signals, the numbers of the channels in their colours, the legend
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SIGNALS, Block, S, State
from rig.show.viewer.style import (
    CHANNEL_COLORS,
    CHANNEL_NAMES,
    FAULT_STRIP,
    QUIET,
    REFERENCE,
    STATE_LOOKS,
    THRESHOLD,
    TRUTH,
    VOTED,
    Color,
    plain,
)

PATH: Final = "/matrix"
NAMES: Final = f"{PATH}/names"
LEGEND: Final = "/legend"
STRIP: Final = 100.0  # width of the legend in a strip
WIDTH: Final = 18.0
TOP: Final = -0.8  # rows
BOTTOM: Final = S + 4.8
_LEFT: Final = 9.2  # of the first cell
_STEP: Final = 2.1
_COLORS: Final = np.array([STATE_LOOKS[state.name][1] if state.name in STATE_LOOKS else QUIET for state in State])
_LINES: Final = (
    ("vote", VOTED),
    ("truth", TRUTH),
    ("reference", REFERENCE),
    ("threshold", THRESHOLD),
    ("fault active", FAULT_STRIP),
)


def cells() -> list[NDArray[np.float64]]:
    """Return a stroke for each channel, signal by signal."""
    return [
        np.array([[x, s + 2.0], [x + 1.2, s + 2.0]])
        for s in range(S)
        for x in (_LEFT + _STEP * c for c in range(CHANNELS))
    ]


def colors(states: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the colours of the cells (n, S * 4, 3) for ``states`` (n, S, 4)."""
    return _COLORS[np.minimum(states, State.ABSENT)].reshape(len(states), -1, 3).astype(np.uint8)


def columns(rows: Block, at: NDArray[np.intp]) -> Any:
    """Return the cells in the rows ``at``."""
    shades = colors(rows["state"][at])
    packed = [rgb for row in shades for rgb in row]
    strokes = rr.LineStrips2D.columns(
        strips=cells() * len(at), colors=packed, radii=np.full(len(packed), 0.36, np.float32)
    )
    return strokes.partition([S * CHANNELS] * len(at))


def names() -> rr.Points2D:
    """Return the labels of the cells."""
    words: list[tuple[float, float, str, Color]] = [
        (4.3, s + 1.4, plain(signal.name), VOTED) for s, signal in enumerate(SIGNALS)
    ]
    words += [(_LEFT + 0.6 + _STEP * c, -0.2, str(c + 1), CHANNEL_COLORS[c]) for c in range(CHANNELS)]
    words += [(4.0 + 4.0 * i, S + 2.0, label, color) for i, (label, color) in enumerate(STATE_LOOKS.values())]
    words += [(1.8 + 3.6 * i, S + 3.4, label, color) for i, (label, color) in enumerate(_LINES)]
    return _written(words)


def legend() -> rr.Points2D:
    """Build the legend of the colours of lines, in a strip."""
    return strip((*CHANNEL_NAMES, *_LINES))


def strip(named: Sequence[tuple[str, Color]]) -> rr.Points2D:
    """Return a legend of ``named`` colours in a strip."""
    step = STRIP / len(named)
    return _written([(step * (i + 0.5), -0.6, label, color) for i, (label, color) in enumerate(named)])


def _written(words: Sequence[tuple[float, float, str, Color]]) -> rr.Points2D:
    """Return words (x, y, text, colour) as labels."""
    return rr.Points2D(
        [[x, y] for x, y, _, _ in words],
        labels=[label for _, _, label, _ in words],
        colors=[color for *_, color in words],
        radii=0.01,
        show_labels=True,
    )
