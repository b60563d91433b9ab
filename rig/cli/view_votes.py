"""``rig view`` of votes: an output of ``rig vote``, or a recording that is voted first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rig.core.errors import BadInput, BadLog

if TYPE_CHECKING:
    from rig.show.viewer.opened_votes import OpenedVotes


def are_votes(paths: Sequence[Path], config: Path | None, preset: str | None) -> bool:
    """Return True if votes are to be viewed; False: the files are logs of flights.  BadInput: one is missing."""
    return config is not None or preset is not None or any(_has_votes(path) for path in paths)


def opened_votes(paths: Sequence[Path], config: Path | None, preset: str | None, tab: str) -> OpenedVotes:
    """Return the votes to view.

    config, preset : settings with which the one recording is voted; a log of another system is voted by its preset
    BadInput, BadLog: more files than one, a file that cannot be read or voted, no such tab.
    """
    from rig.show.viewer.opened_votes import of_signals
    from rig.show.votes.vote_file import is_votes, read_votes

    if len(paths) > 1:
        raise BadInput(f"{len(paths)} files: the votes on one recording can be shown, or one to four flights together")
    [path] = paths
    if config is None and preset is None and is_votes(path):
        return of_signals(path, read_votes(path), tab)
    from rig.bench.shown_votes import shown_votes
    from rig.bench.vote_run import Laps, Options, vote_file

    votes = vote_file(path, config, Options(preset=preset), Laps())
    return of_signals(path, shown_votes(votes.recording, votes.voted), tab)


def _has_votes(path: Path) -> bool:
    """Return True for an output of ``rig vote`` and for a log of another system; a damaged file is a flight's."""
    from rig.log.foreign import topics
    from rig.log.recordings.formats.known import format_of
    from rig.show.votes.vote_file import is_votes

    try:
        if path.suffix == ".mcap" and "/flight" in topics(path):
            return False
        return is_votes(path) or format_of(path) is not None
    except BadLog:
        return False
