"""Options and output that several commands share: lists with commas, JSON or text."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, TypeVar, get_type_hints

from typer import Argument, Exit, Option, echo

from rig.cli import complete
from rig.core.errors import BadInput
from rig.core.interrupt import CODE, FLIES_AGAIN, GOES_ON

if TYPE_CHECKING:
    from rig.log.recordings.alignment import AlignOptions
    from rig.studies.campaign.run_campaign import Ending

Number = TypeVar("Number", int, float, str)
Made = TypeVar("Made")
GROUP: Final[dict[str, Any]] = {
    "no_args_is_help": True,
    "pretty_exceptions_enable": False,
    "rich_markup_mode": "rich",
    "context_settings": {"help_option_names": ["-h", "--help"]},
}


def opt(metavar: str, text: str, *names: str, **more: Any) -> Any:
    """Declare an option with a value."""
    return Option(*names, metavar=metavar, help=text, **more)


def arg(metavar: str, text: str, **more: Any) -> Any:
    """Declare an argument; its default is shown where one is named."""
    return Argument(metavar=metavar, help=text, **{"show_default": False, **more})


def flag(name: str, text: str, **more: Any) -> Any:
    """Declare a switch."""
    return Option(name, help=text, **more)


def named(kind: Callable[..., Made], options: Any, **more: Any) -> Made:
    """Return a data class, each field from the option of the same name; ``more``: the other fields."""
    names = {field.name for field in fields(kind)} - more.keys()  # pyright: ignore[reportArgumentType]  # a data class
    return kind(**{name: getattr(options, name) for name in names if hasattr(options, name)}, **more)


AllowCode = Annotated[
    bool, flag("--allow-code", "Allow Python code that a file or log names as its manager (module:name).")
]
AllowCodeOrSet = Annotated[
    bool,
    flag(
        "--allow-code",
        "Allow Python code that a file names as its manager (module:name). Code that --set names is always allowed.",
    ),
]
LogFile = Annotated[Path, arg("LOG", "Log of a flight.")]
Json = Annotated[bool, flag("--json", "Print one JSON object and nothing else.")]
UnitFile = Annotated[Path | None, opt("FILE", "Unit file of the flight software under test.", "--unit")]
Logs = Annotated[Path, opt("DIR", "Folder for the log.")]

ScenarioName = Annotated[
    str | None,
    arg(
        "FILE|NAME",
        "Scenario file, or name of a bundled scenario.",
        show_default="f16_pitch_rate_hardover",
        autocompletion=complete.scenarios,
    ),
]
Sets = Annotated[
    list[str] | None,
    opt(
        "KEY=VALUE",
        "Override of a key, e.g. redundancy.manager=mean. Repeatable.",
        "--set",
        autocompletion=complete.sets,
    ),
]
Seed = Annotated[int, opt("N", "Seed of all random draws.", min=0, max=2**63 - 1)]
Workers = Annotated[int, opt("N", "Number of processes.", min=1, max=1024)]
Scheduler = Annotated[str | None, opt("URL", "Dask scheduler, tcp://HOST:PORT, instead of local processes.")]


def resumes(study: str) -> Any:
    """Declare ``--out`` of a study: its folder, in which the study resumes."""
    return opt("DIR", f"Output folder. An unfinished {study} resumes here.")


@dataclass(frozen=True)
class Align:
    """The alignment options of the commands that read recordings."""

    align: Annotated[bool, flag("--align", "Remove the constant delays and offsets of the channels.")] = False
    align_from: Annotated[
        float | None, opt("S", "Start of the segment used for alignment, s.", show_default="first row")
    ] = None
    align_to: Annotated[float | None, opt("S", "End of that segment, s.", show_default="6 s after its start")] = None
    align_matrix: Annotated[bool, flag("--align-matrix", "Also correct the misalignment of the triads of CONFIG.")] = (
        False
    )

    def options(self) -> AlignOptions | None:
        """Return how to align, None without --align.  BadInput: another alignment option without --align."""
        from rig.log.recordings.alignment import AlignOptions

        stretch = (self.align_from, self.align_to, self.align_matrix)
        if not self.align and stretch != (None, None, False):
            raise BadInput("--align-from, --align-to, --align-matrix: need --align")
        for option, value in (("--align-from", self.align_from), ("--align-to", self.align_to)):
            if value is not None and not isfinite(value):
                raise BadInput(f"{option}: must be a finite number, got {value}")
        return AlignOptions(*stretch) if self.align else None


def takes_options(command: Callable[[Any], None]) -> Callable[..., None]:
    """Return a command that takes its many options as one dataclass, with the parameters that typer reads.

    Each field is one parameter.  A field that is a dataclass itself is a group of options that several commands have:
    its fields are the parameters.
    """
    kind = get_type_hints(command)["options"]

    @wraps(command)
    def call(**values: Any) -> None:
        command(_filled(kind, values))

    vars(call)["__signature__"] = Signature(list(_parameters(kind)))
    return call


def _parameters(kind: type) -> Iterator[Parameter]:
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        if is_dataclass(hint := hints[field.name]):
            yield from _parameters(hint)  # pyright: ignore[reportArgumentType]  # a class, no instance
        else:
            default = Parameter.empty if field.default is MISSING else field.default
            yield Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=hint)


def _filled(kind: Any, values: dict[str, Any]) -> Any:
    hints = get_type_hints(kind)
    return kind(**{key: _filled(hint, values) if is_dataclass(hint) else values[key] for key, hint in hints.items()})


def emit(as_json: bool, data: Any, text: Callable[[], object]) -> None:
    """Print ``data``, or the value that it returns, as one JSON object; or call ``text``, which prints for people."""
    if as_json:
        echo(json.dumps(data() if callable(data) else data, allow_nan=False))
    else:
        text()


def unflown(count: int, first_reason: str | None) -> str:
    """Return how many runs were not flown, and the reason of the first."""
    return f"{count} {'run' if count == 1 else 'runs'} could not be flown; {first_reason}"


def end_interrupted(signal: int, done: str) -> NoReturn:
    """Exit with a line as the ``signal`` asked.  done : what is done"""
    echo(f"stopped: {done}; {GOES_ON}", err=True)
    raise Exit(CODE + signal)


def require_ended(ended: Ending, done: str, again: str = FLIES_AGAIN) -> None:
    """Exit with a line unless all runs are flown.  done : the runs that are done"""
    if ended.interrupted:
        end_interrupted(ended.signal, done)
    if ended.not_flown:
        echo(f"failed: {unflown(ended.not_flown, ended.first_reason)}; {again}", err=True)
        raise Exit(1)


def comma_list(
    option: str, text: str, allowed: str, read: Callable[[str], Number], accept: Callable[[Number], bool]
) -> list[Number]:
    """Return the numbers, or names, between the commas of ``text``.  BadInput: a value that is not ``allowed``."""
    try:
        numbers = [read(part.strip()) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(accept(number) for number in numbers):
        raise BadInput(f"{option}: must be {allowed}, separated by commas, got {text or 'nothing'}")
    return numbers


def names(option: str, text: str) -> list[str]:
    """Return the names between the commas of ``text``: at least one, each once, in order."""
    return list(dict.fromkeys(comma_list(option, text, "names", str, bool)))


def whole_numbers(option: str, text: str, least: int, most: int, allowed: str = "whole numbers") -> list[int]:
    """Return the whole numbers between the commas of ``text``, from ``least`` to ``most``, each once, in order."""
    return sorted(
        set(comma_list(option, text, f"{allowed} from {least} to {most}", _whole, range(least, most + 1).__contains__))
    )


def _whole(text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise ValueError(text)
    return int(text[:18])  # Python refuses thousands of digits
