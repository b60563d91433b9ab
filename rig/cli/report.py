"""``rig report``: parse, call, print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.common import Json, emit
from rig.cli.working import working


def report(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="The log of a flight.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The file to write.", show_default="<log>.html")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write one HTML file of one flight, which opens offline and prints: what happened, when and why."""
    from rig.cli.show import conclusion
    from rig.report.flight import report as write
    from rig.text import plain

    target = out or log.with_suffix(".html")
    with working("reading the log", not as_json):
        found = write(log, target)

    def text() -> None:
        conclusion(found["conclusion"])
        typer.echo(plain(f"report   {target}"))

    emit(as_json, found, text)
