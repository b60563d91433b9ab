"""Votes on a recording, opened in the viewer as a flight is: saved, served, photographed or in a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from rig.core.text import plain
from rig.show.viewer import vote_columns
from rig.show.viewer.facts import Layout
from rig.show.viewer.sink import FLUSH_S, About, Sink
from rig.show.viewer.vote_layout import OVERVIEW, layout, main, require_tab, shown_flight
from rig.show.votes.shown_signal import ShownSignal

_TOLD: Final = 4  # isolations in the headline
NO_THRESHOLDS: Final = "differences in the unit of each signal: the file has no thresholds (--config or --preset has)"
NO_CHANNELS: Final = "a table has no channels: rig vote --out FILE.mcap keeps them"


@dataclass(frozen=True, slots=True)
class OpenedVotes:
    """Voted signals, and their text and layout in the viewer."""

    signals: Sequence[ShownSignal]
    about: About

    @property
    def frames(self) -> int:
        """Number of rows of the recording."""
        return len(self.signals[0].time_s)

    @property
    def counted(self) -> str:
        """The name of the things in ``frames``."""
        return "rows"

    @property
    def moment_s(self) -> float:
        """The initial time of the cursor: the first isolation, or the end."""
        shown = main(self.signals)
        return shown.isolations[0].time_s if shown.isolations else float(shown.time_s[-1])

    @property
    def room(self) -> int:
        """Bytes of its numbers."""
        return self.frames * len(self.signals) * 4 * len(vote_columns.NAMES)

    def send(self, sink: Sink) -> None:
        """Send all rows, and wait until they are written or transmitted."""
        sink.begin()
        vote_columns.send(sink.recording, self.signals)
        sink.flush(FLUSH_S)


def of_signals(path: Path, signals: Sequence[ShownSignal], tab: str = OVERVIEW) -> OpenedVotes:
    """Return the votes of the file ``path`` for the viewer; BadInput: no such tab."""
    require_tab(signals, tab)
    title = plain(path.name)
    about = About(title, _text(title, signals), Layout([shown_flight(title, signals)]), partial(layout, signals, tab))
    return OpenedVotes(signals, about)


def _text(title: str, signals: Sequence[ShownSignal]) -> str:
    """Return headline and file in Markdown."""
    found = sorted((mark.time_s, shown.name, mark.channel) for shown in signals for mark in shown.isolations)
    told = [f"{plain(name)}, channel {channel}: isolated at {at_s:.2f} s" for at_s, name, channel in found[:_TOLD]]
    more = [f"{len(found) - _TOLD} more isolations"] if len(found) > _TOLD else []
    headline = "; ".join([*told, *more]) or "no channel isolated"
    rows, end_s = len(signals[0].time_s), float(signals[0].time_s[-1])
    notes = [NO_CHANNELS] if not signals[0].channels else []
    if signals[0].channels and all(shown.threshold is None for shown in signals):
        notes.append(NO_THRESHOLDS)
    said = "; ".join([f"{rows} rows, {end_s:.2f} s since the first row", *notes])
    return f"# {headline}\n\n**{title}** {said}"
