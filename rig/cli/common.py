"""What the commands share: options, the look of a group, one JSON object or text."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rig.cli import complete

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

ScenarioName = Annotated[
    str | None,
    typer.Argument(
        metavar="FILE|NAME",
        help="A scenario file or the name of a bundled one.",
        show_default="f16_pitch_rate_hardover",
        autocompletion=complete.scenarios,
    ),
]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key, e.g. redundancy.manager=mean; repeatable.",
        autocompletion=complete.sets,
    ),
]


def emit(as_json: bool, data: Any, text: Callable[[], object]) -> None:
    """Print ``data``, or what it returns, as one JSON object; or call ``text``, which prints for people."""
    if as_json:
        typer.echo(json.dumps(data() if callable(data) else data, allow_nan=False))
    else:
        text()
