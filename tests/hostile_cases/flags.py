"""Kind ``flag``: every argument and option of every command of ``rig --help`` with a hostile word."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

from hostile_cases.case import Case, Draw
from hostile_cases.store import Store
from hostile_cases.values import REFUSED, WORDS, short

_SOUND: Final = {
    ("scenario",): "everything.toml",
    ("file",): "campaign.toml",
    ("folder",): "camp",
    ("first",): "camp",
    ("second",): "camp",
    ("log",): "log.mcap",
    ("logs",): "log.mcap",
    ("a",): "log.mcap",
    ("b",): "log.mcap",
    ("recorded",): "in.csv",
    ("name",): "f16",
    ("kind",): "offset",
}
_NEEDED: Final = {
    "vote": {"--config": "vote.toml", "--out": "o.csv"},
    "export": {"--to": "csv"},
    "view": {"--save": "v.rrd"},
    "campaign run": {"--out": "o"},
    "campaign fly": {"--run": "0"},
    "watch": {"--speed": "1000"},
}
# A legal number would take minutes there, a legal path would write into the checkout: only what is refused at once.
_REFUSE: Final = {
    *("cost --repeats", "study fault-tolerant --seeds", "study fault-tolerant --workers", "study rate-bias --seeds"),
    *("study rate-bias --drawn", "study rate-bias --workers", "fly --realtime-factor"),
}
_STUDIES: Final = ("ding2015", "fault-tolerant", "rate-bias")
_SKIPPED: Final = {"view --serve", "aircraft design --json", *(f"study {name} --json" for name in _STUDIES)}


@cache
def options() -> list[tuple[str, str, str, bool]]:
    """(command, the option or "" for an argument, the parameter's name, whether it takes a word)."""
    return [
        (command, option, name, annotation is not None)
        for command, option, name, annotation in parameters()
        if f"{command} {option}" not in _SKIPPED
    ]


def parameters() -> list[tuple[str, str, str, Any]]:
    """(command, the option or "" for an argument, the parameter's name, what it takes or None), of typer's own tree."""
    import typer
    from typer.main import get_command

    import rig.cli.main

    assert typer
    return [
        (command, option, parameter.name, None if getattr(parameter, "is_flag", False) else _annotation(parameter))
        for command, made in _commands(get_command(rig.cli.main.app), ())
        for parameter in made.params
        for option in ([""] if parameter.param_type_name == "argument" else parameter.opts[:1])
        if parameter.name != "help"
    ]


def _annotation(parameter: Any) -> Any:
    return parameter.type_descriptor.annotation


def _commands(command: Any, above: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    if hasattr(command, "commands"):
        for name, below in sorted(command.commands.items()):
            yield from _commands(below, (*above, name))
    else:
        yield " ".join(above), command


# A folder that is there would be written into after minutes.
_NO_FOLDER: Final = [
    *("nowhere/g.toml", "everything.toml/g.toml", "/proc/nowhere/g.toml", "\x1b[2J/g.toml", "[/red]/g.toml"),
]


def flag(draw: Draw, store: Store) -> Case:
    """One parameter with a hostile word; the others sound."""
    command, option, name, takes = draw.turn(options())
    heavy = f"{command} {option}" in _REFUSE or command == "aircraft design"
    word = draw.rng.choice(REFUSED if heavy else WORDS)[:130_000].replace("\x00", "")
    given = {key: value for key, value in _NEEDED.get(command, {}).items() if key != option}
    if command == "aircraft design" and option == "--out":
        word = draw.rng.choice(_NO_FOLDER)
    if takes and option == "--rerun":
        word = draw.rng.choice(
            [*REFUSED, "rerun+http://", "rerun+http://127.0.0.1:1/proxy", "save ", "http://[::1", "-"]
        )
    arguments = [
        _sound(command, other, word if not option and other == name else None) for other in _arguments(command)
    ]
    argv = [*command.split(), *[a for a in arguments if a is not None]]
    argv += [part for key, value in given.items() for part in (key, value)]
    if option:
        argv += [option, word] if takes else [f"{option}={word}" if draw.rng.random() < 0.5 else option]
    if draw.rng.random() < 0.05:
        argv += draw.rng.choice([["--nonsense"], ["\x1b[2J"], ["--", "-x"], ["[/red]"], ["--json", "--json"]])
    return draw.case(
        argv,
        f"{command} {option or name}: {short(word)}",
        lambda folder: _files(folder, store, argv),
        leave="evilmod" in word,
    )


def _arguments(command: str) -> list[str]:
    return [name for owner, option, name, _ in options() if owner == command and not option]


def _sound(command: str, name: str, word: str | None) -> str | None:
    return word if word is not None else _SOUND.get((name,))


def _files(folder: Path, store: Store, argv: list[str]) -> None:
    for name in ("everything.toml", "campaign.toml", "camp", "log.mcap", "in.csv", "vote.toml"):
        if name in argv:
            store.copy(name, folder)
