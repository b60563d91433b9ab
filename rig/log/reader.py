"""Reads a log back into the very rows that were flown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.frame import FLAT, TIMING, Block
from rig.log import arrays, shown
from rig.log.arrays import DiscreteArrays, SignalArrays
from rig.log.scan import About, iter_parts
from rig.record.event import Event

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure


@dataclass(slots=True, repr=False)
class Log:
    """A whole flight: ``rows`` (n,) of FLAT, ``timing`` (n,) of TIMING, and all that is known of it."""

    rate_hz: float
    rows: Block
    timing: NDArray[Any]
    events: list[Event]
    metadata: dict[str, str]
    result: dict[str, str] | None  # None when the flight was not ended by the loop
    attachments: dict[str, bytes]

    @property
    def scenario_text(self) -> str | None:
        """The first file attached, which is the scenario."""
        first = next(iter(self.attachments.values()), None)
        return None if first is None else first.decode("utf-8")

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,) simulation time of the rows."""
        return self.rows["frame"] / self.rate_hz

    def signal(self, name: str) -> SignalArrays:
        """The arrays of one signal; KeyError when there is no such signal."""
        return arrays.of_signal(self.rows, self.rate_hz, name)

    def discrete(self, name: str) -> DiscreteArrays:
        """The arrays of one discrete; KeyError when there is no such discrete."""
        return arrays.of_discrete(self.rows, self.rate_hz, name)

    def to_polars(self, *owners: str) -> pl.DataFrame:
        """One row a frame, the columns named as in ``rig export``; SI units, enums as words.

        owners : signals, discretes, topics (control, flight, ...); all if none.  KeyError: one that is not known.
        """
        from rig.log.dataframe import dataframe

        return dataframe(self.rows, self.time_s, owners)

    def plot(self, name: str) -> Figure:
        """Channels, vote and truth of one signal over the flight; KeyError when there is no such signal."""
        from rig.log.plot import plot

        return plot(self, name)

    def __repr__(self) -> str:
        """One line: what was flown, and how it ended."""
        return shown.line(self)

    def _repr_html_(self) -> str:
        """A small table for a notebook: scenario, verdict, failed channels, conclusion, digest."""
        return shown.html(self)


def read_log(path: Path | str) -> Log:
    """The flight at ``path``; BadLog in one line when it is missing, foreign, cut or damaged.

    Two kilobytes of memory a frame, twice that while reading; ``iter_chunks`` reads long logs.
    """
    about = About()
    blocks: list[Block] = []
    timings: list[NDArray[Any]] = []
    events: list[Event] = []
    for part in iter_parts(Path(path), about):
        blocks.append(part.rows)
        timings.append(part.timing)
        events += part.events
    rows, timing = _joined(blocks, FLAT), _joined(timings, TIMING)
    return Log(about.rate_hz, rows, timing, events, about.metadata, about.result, about.attachments)


def _joined(parts: list[NDArray[Any]], dtype: np.dtype[Any]) -> NDArray[Any]:
    """np.concatenate of the bytes: of structured arrays it goes field by field and promises no padding."""
    joined = np.empty(sum(map(len, parts)), dtype)
    if parts:
        np.concatenate([part.view(np.uint8) for part in parts], out=joined.view(np.uint8))
    return joined


def iter_chunks(path: Path | str) -> Iterator[tuple[Block, NDArray[Any], list[Event]]]:
    """A log a second at a time, in bounded memory: rows, timing, events of each chunk.

    Damage is reported when it is reached, after the chunks before it have been given.
    """
    for part in iter_parts(Path(path), About()):
        yield part.rows, part.timing, part.events
