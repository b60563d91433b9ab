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
    """The log of a whole flight in memory."""

    def plot(self, name: str) -> Figure:
        """Return a figure of channels, voted value and truth of one signal; BadInput: unknown signal."""
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
    """Read the log of a flight into memory.

    path : file of the log
    A frame needs 2 kB of memory, and 4 kB while it is read; ``rig.log.iter_chunks`` reads a long log chunk by chunk.
    BadLog, one line: the file is missing, cut, damaged or no log of the rig.
    """
    return Log.read(path)
