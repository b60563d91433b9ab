"""Refusals of a wrong command line, in one line like any other: what is wrong, and where all of it is listed."""

from __future__ import annotations

import re
from typing import Any, Final

from rig.core.renamed import COMMANDS, OPTIONS, is_gone, now_called
from rig.core.text import must_be, shorten

MOST_OF_A_WORD: Final = 400  # characters of a wrong command line that are repeated
_UNKNOWN_COMMAND: Final = re.compile("No such command '([^']*)'")
_EXTRA: Final = re.compile(r"Got unexpected extra arguments?(?:\(s\))? \((.*)\)")
_NO_VALUE: Final = re.compile("Option '([^']*)' requires an argument")


def refusal(error: Any) -> str:
    """Return the line for an error of the command line; ``error``: click's, its kinds differ between versions."""
    return _renamed(error) or f"{shorten(_said(error), MOST_OF_A_WORD)}; see: {_path(error)} --help"


def _path(error: Any) -> str:
    return error.ctx.command_path if error.ctx else "rig"


def _said(error: Any) -> str:
    message = error.format_message().rstrip(".")
    kind, param = type(error).__name__, getattr(error, "param", None)
    if kind == "NoSuchOption":
        near = getattr(error, "possibilities", None)
        return f"{error.option_name}: no such option" + (f"; nearest: {', '.join(sorted(near))}" if near else "")
    if unknown := _UNKNOWN_COMMAND.match(message):
        near = re.findall("'([^']*)'", message[unknown.end() :])
        return f"{unknown[1]}: no such command" + (f"; nearest: {', '.join(near)}" if near else "")
    if kind == "MissingParameter" and param is not None:
        argument = param.param_type_name == "argument"
        return f"{param.metavar if argument else param.opts[0]}: missing {param.param_type_name}"
    if extra := _EXTRA.match(message):
        return f"{extra[1]}: one argument too many" if " " not in extra[1] else f"{extra[1]}: too many arguments"
    if empty := _NO_VALUE.match(message):
        return f"{empty[1]}: needs a value"
    if kind == "BadParameter" and param is not None:
        argument = param.param_type_name == "argument"
        return f"{param.metavar if argument else param.opts[0]}: {must_be(error.message.rstrip('.'))}"
    return message


def _renamed(error: Any) -> str:
    """Return the line on a renamed command or option, or on an option that is gone; "" if the error is another."""
    unknown, context = _UNKNOWN_COMMAND.match(error.format_message()), error.ctx
    group = f"rig {context.info_name}" if context and context.parent else "rig"
    command, option = f"{group} {unknown[1]}" if unknown else "", getattr(error, "option_name", "")
    for old, names in ((command, COMMANDS), (option, OPTIONS)):
        if old in names:
            return now_called(old, names[old])
    gone = is_gone(option)
    return f"{option} {gone}" if gone else ""
