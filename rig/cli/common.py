"""What the commands share: their options, what the shell completes, lists with commas, JSON or text."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple, TypeVar

from typer import Argument, Option, echo

from rig.cli import complete
from rig.errors import BadInput

if TYPE_CHECKING:
    from rig.recordings.alignment import AlignOptions

Number = TypeVar("Number", int, float)
GROUP: Final[dict[str, Any]] = {
    "no_args_is_help": True,
    "pretty_exceptions_enable": False,
    "rich_markup_mode": "rich",
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
AllowCode = Annotated[
    bool, Option("--allow-code", help="Allow Python code that a file or log names as its manager (module:name).")
]
AllowCodeOrSet = Annotated[
    bool,
    Option(
        "--allow-code",
        help="Allow Python code that a file names as its manager (module:name); what --set names is always allowed.",
    ),
]
LogFile = Annotated[Path, Argument(metavar="LOG", help="The log of a flight.", show_default=False)]
Json = Annotated[bool, Option("--json", help="Print one JSON object and nothing else.")]
UnitFile = Annotated[
    Path | None,
    Option("--unit", metavar="FILE", help="A unit file: the flight software under test.", show_default=False),
]
Logs = Annotated[Path, Option(metavar="DIR", help="Folder of the log.")]

ScenarioName = Annotated[
    str | None,
    Argument(
        metavar="FILE|NAME",
        help="A scenario file or the name of a bundled one.",
        show_default="f16_pitch_rate_hardover",
        autocompletion=complete.scenarios,
    ),
]
Sets = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key, e.g. redundancy.manager=mean; repeatable.",
        autocompletion=complete.sets,
    ),
]
Seed = Annotated[int, Option(metavar="N", help="Seed of all random draws.", min=0, max=2**63 - 1)]
Workers = Annotated[int, Option(metavar="N", help="Processes.", min=1, max=1024)]


class Align(NamedTuple):
    """The options --align of the commands that read recordings."""

    on: bool
    from_s: float | None
    to_s: float | None
    matrix: bool

    def options(self) -> AlignOptions | None:
        """Return how to align, None without --align; BadInput where the others are given without it."""
        from rig.recordings.alignment import AlignOptions

        if not self.on and self[1:] != (None, None, False):
            raise BadInput("--align-from, --align-to and --align-matrix need --align")
        for option, value in (("--align-from", self.from_s), ("--align-to", self.to_s)):
            if value is not None and not isfinite(value):
                raise BadInput(f"{option}: input should be a finite number, got {value}")
        return AlignOptions(*self[1:]) if self.on else None


def emit(as_json: bool, data: Any, text: Callable[[], object]) -> None:
    """Print ``data``, or what it returns, as one JSON object; or call ``text``, which prints for people."""
    if as_json:
        echo(json.dumps(data() if callable(data) else data, allow_nan=False))
    else:
        text()


def comma_list(
    option: str, text: str, allowed: str, read: Callable[[str], Number], accept: Callable[[Number], bool]
) -> list[Number]:
    """Return the numbers between the commas of ``text``; BadInput names what is ``allowed``."""
    try:
        numbers = [read(part.strip()) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(accept(number) for number in numbers):
        raise BadInput(f"{option}: {allowed} with commas between, got {text or 'nothing'}")
    return numbers


def whole_numbers(option: str, text: str, least: int, most: int, allowed: str = "whole numbers") -> list[int]:
    """Return the whole numbers between the commas of ``text``, from ``least`` to ``most``, each once, in order."""
    return sorted(
        set(comma_list(option, text, f"{allowed} from {least} to {most}", _whole, range(least, most + 1).__contains__))
    )


def _whole(text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise ValueError(text)
    return int(text[:18])  # Python refuses thousands of digits
