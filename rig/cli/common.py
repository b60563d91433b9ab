"""What the commands share: options, the look of a group, one JSON object or text."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

GROUP: Final[dict[str, Any]] = {
    "no_args_is_help": True,
    "pretty_exceptions_enable": False,
    "rich_markup_mode": "rich",
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
AllowCode = Annotated[
    bool,
    typer.Option("--allow-code", help="Run a manager that a file names (module:name), not only one of --set."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
UnitFile = Annotated[
    Path | None,
    typer.Option("--unit", metavar="FILE", help="A unit file: the flight software under test.", show_default=False),
]
Logs = Annotated[Path, typer.Option(metavar="DIR", help="Folder of the log.")]


def emit(as_json: bool, data: Any, text: Callable[[], object]) -> None:
    """Print ``data``, or what it returns, as one JSON object; or call ``text``, which prints for people."""
    if as_json:
        typer.echo(json.dumps(data() if callable(data) else data, allow_nan=False))
    else:
        text()
