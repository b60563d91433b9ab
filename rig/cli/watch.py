"""``rig watch``: parse, read, play."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def watch(
    log: Annotated[Path, typer.Argument(help="A log.", show_default=False)],
    speed: Annotated[float, typer.Option(help="Times real time.", min=0.01, max=1000.0)] = 1.0,
    from_s: Annotated[float, typer.Option("--from", help="Where to begin, s.", min=0.0)] = 0.0,
) -> None:
    """Play the redundancy page of a log on the terminal; Ctrl-C ends."""
    from rig.console import console
    from rig.errors import BadLog
    from rig.log import read_log
    from rig.view.watch.played import play

    found = read_log(log)
    if not len(found.rows):
        raise BadLog(f"{log}: has no frames")
    play(found, log.stem, console(), speed, from_s)
