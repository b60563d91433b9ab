"""Write docs/reference/cli.md: each command with its purpose, arguments and options, from the commands themselves.

python tests/tools/cli_page.py
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from typer.main import get_command

from rig.cli.main import EXAMPLE, app

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs" / "reference" / "cli.md"
HEAD: Final = """# Commands

All commands of `rig`, with their arguments and options. `rig COMMAND --help` prints the same text.
`make reference` writes this page from the commands; a test compares the two.

"""
CODES: Final = """## Exit codes

| code | meaning |
|---|---|
| 0 | The command did its work. A lost aircraft is a result, not an error. |
| 1 | The rig or the machine failed. Or the result of a check or comparison is negative, see NEGATIVE. |
| 2 | Bad input. One line on standard error names the file, the key and what is allowed. |
| 128 + n | Signal n ended the command. Ctrl-C gives 130; a flight that it ends keeps log and verdict, and gives 0. |

An error is one line on standard error. It begins with `error:` (code 2) or `failed:` (code 1).

"""
COMMON: Final = """## Options of every command

| option | meaning |
|---|---|
| `-h`, `--help` | Print the help of the command. |
| `-v`, `--verbose` | Show the log messages of JSBSim and of the rig. |
| `--version` | Print the version (`rig --version`). |

"""


class Named(NamedTuple):
    """A command, its name and the panel of its group in the help."""

    name: str
    panel: str
    command: Any


def commands(group: Any, name: str = "rig", panel: str = "") -> Iterator[Named]:
    """Yield every command below a group, in the order of the help."""
    for key, part in group.commands.items():
        of, full = panel or part.rich_help_panel, f"{name} {key}"
        if hasattr(part, "commands"):
            yield from commands(part, full, of)
        else:
            yield Named(full, of, part)


def written() -> str:
    """Return the page."""
    by_panel: dict[str, list[Named]] = {}
    for one in commands(get_command(app)):
        by_panel.setdefault(one.panel, []).append(one)
    checks = [one for group in by_panel.values() for one in group if _checks(one)]
    negative = ", ".join(f"[`{one.name}`]({_anchor(one)})" for one in checks)
    parts = [HEAD, f"{_example()}\n\n", *_overview(by_panel), CODES.replace("NEGATIVE", negative), COMMON]
    for panel, group in by_panel.items():
        parts.append(f"## {panel}\n\n")
        parts += [_section(one) for one in group]
    return "".join(parts).rstrip("\n") + "\n"


def _example() -> str:
    return re.sub(r"rig (?:fly|score|view|scenario) \w+", lambda command: f"`{command[0]}`", EXAMPLE)


def _overview(by_panel: dict[str, list[Named]]) -> Iterator[str]:
    yield "| group | command | purpose |\n|---|---|---|\n"
    for panel, group in by_panel.items():
        for i, one in enumerate(group):
            purpose = _cell(_paragraphs(one.command)[0])
            yield f"| {panel if i == 0 else ''} | [`{one.name}`]({_anchor(one)}) | {purpose} |\n"
    yield "\n"


def _anchor(one: Named) -> str:
    return f"#{one.name.replace(' ', '-')}"


def _checks(one: Named) -> bool:
    """Return True if the help of a command or of an option states exit code 1."""
    return any(re.search(r"\bcode 1\b", text or "") for text in (*_paragraphs(one.command), *_helps(one)))


def _helps(one: Named) -> Iterator[str]:
    return (param.help for param in one.command.params)


def _section(one: Named) -> str:
    params = [param for param in one.command.params if param.name != "help" and not param.hidden]
    arguments = [param for param in params if param.param_type_name == "argument"]
    options = [param for param in params if param.param_type_name == "option"]
    texts = "\n\n".join(_escaped(text) for text in _paragraphs(one.command))
    head = f"### {one.name}\n\n{texts}\n\n`{_synopsis(one.name, arguments, options)}`\n\n"
    return head + _table("argument", arguments) + _table("option", options)


def _synopsis(name: str, arguments: list[Any], options: list[Any]) -> str:
    given = [param.metavar if param.required else f"[{param.metavar}]" for param in arguments]
    needed = [f"{param.opts[0]} {param.metavar}" for param in options if param.required]
    rest = ["[OPTIONS]"] if len(needed) < len(options) else []
    return " ".join([name, *given, *needed, *rest])


def _table(kind: str, params: list[Any]) -> str:
    if not params:
        return ""
    rows = [f"| {_names(param)} | {_cell(param.help)}{_allowed(param)} | {_default(param)} |" for param in params]
    return "\n".join([f"| {kind} | meaning | default |", "|---|---|---|", *rows, "", ""])


def _names(param: Any) -> str:
    if param.param_type_name == "argument":
        return _code(param.metavar)
    names = [*param.opts, *param.secondary_opts]
    value = "" if param.is_flag else f" {param.metavar}"
    return ", ".join(_code(f"{name}{value}") for name in names)


def _allowed(param: Any) -> str:
    """Return the range of a number."""
    kind = param if hasattr(param, "min") else param.type
    low, high = getattr(kind, "min", None), getattr(kind, "max", None)
    if low is None:
        return ""
    return f" {low:g} or more." if high is None else f" From {low:g} to {_number(high)}."


def _number(number: float) -> str:
    return f"2^{int(number).bit_length()} - 1" if number == 2**63 - 1 else f"{number:.15g}"


def _default(param: Any) -> str:
    if param.required:
        return "required"
    if isinstance(param.show_default, str):
        name = re.fullmatch(r"\S*[<>_./]\S*", param.show_default)
        return _code(param.show_default) if name else _escaped(param.show_default)
    if param.default is None or param.default is False or param.default == "":
        return ""
    if param.default is True:
        return _code(param.opts[0])
    return _code(str(param.default))


def _paragraphs(command: Any) -> list[str]:
    """Return the paragraphs of a command's help, each as one line, without the example of all commands."""
    text = (command.callback.__doc__ or "").strip()
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]


def _code(text: str) -> str:
    return f"`{text}`".replace("|", "\\|")


def _cell(text: str) -> str:
    return _escaped(text).replace("|", "\\|")


def _escaped(text: str) -> str:
    return text.replace("*", "\\*").replace("<", "&lt;")


def main() -> int:
    """Write it."""
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(written(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
