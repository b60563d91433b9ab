"""``rig.read_log`` and ``rig.Log``: a log for programs and notebooks.

Reading a log loads neither numba nor JSBSim.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rig import log

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Log(log.Log):
    """A whole flight: ``rows`` (n,) of FLAT, ``timing`` (n,) of TIMING, events, metadata, result, attachments."""

    def plot(self, name: str) -> Figure:
        """Return a figure of channels, vote and truth of one signal over the flight; BadInput: unknown signal."""
        from rig.show.notebook.log_shown import plot

        return plot(self, name)

    def __repr__(self) -> str:
        """Return one line: scenario, outcome and failed channels."""
        from rig.show.notebook.log_shown import line

        return line(self)

    def _repr_html_(
        self, overrides: Sequence[str] = (), path: Path | None = None, conclusion: Sequence[str] | None = None
    ) -> str:
        """Return a small table for a notebook: scenario, verdict, failed channels, conclusion, digest."""
        from rig.show.notebook.log_shown import table
        from rig.verdict.of_log import conclude

        return table(self, conclude(self) if conclusion is None else conclusion, overrides, path)


def read_log(path: Path | str) -> Log:
    """Read the flight at ``path``; BadLog, one line: the file is missing, foreign, cut or damaged.

    Takes two kilobytes of memory per frame, twice that while reading; ``rig.log.iter_chunks`` reads long logs.
    """
    return Log.read(path)
