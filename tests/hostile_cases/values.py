"""What is written where a number, a name or a table is expected: TOML text, and words of a command line."""

from __future__ import annotations

import json
from random import Random
from typing import Final

MARK: Final = "ran_code"  # the file that the class of ``evilmod`` writes
EVIL: Final = f"open({MARK!r}, 'w').close()\nclass M:\n    def __init__(self, params): open({MARK!r}, 'w').close()\n"

TEXTS: Final = [
    "",
    " ",
    "x",
    "[/red]",
    "[bold]x[/bold][/]",
    "[link=file:///x]x",
    "\x1b]0;OWNED\x07\x1b[2J",
    "\x9b2J",
    "a\x00b",
    "a\nb",
    "a\r\nb",
    "\u202etxt.exe",
    "../../x",
    "/proc/version",  # a path may be written to, by root too: only where nothing comes of it
    "/proc/nowhere/x",
    "n" * 300,
    "x" * 100_000,
    "¹²",
    "١٢",
    "é" * 200,
    "-1",
    "--help",
    "%s%n{}{0.__class__}",
    "$(touch ran_code)",
    "evilmod:M",
    "sys:exit",
    "NaN",
    "a.b.c",
    "a" + ".a" * 3000,
]
NUMBERS: Final = [
    *("nan", "-nan", "inf", "-inf", "1e300", "-1e300", "1.7e308", "1e17", "5e-324", "1e-300", "-0.0", "0", "0.0"),
    *("-1", "-1.5", "1", "2", "2.5", "255", "2147483648", "9223372036854775807", "9223372036854775808"),
    *("-9223372036854775809", "18446744073709551616", "1" + "0" * 400, "9" * 5000),
]
SHAPES: Final = [
    *("true", "false", "[]", "{}", "[[]]", "[{}]", "[1, 'a', {}]", "[nan, inf]", "[" + "0," * 5000 + "]"),
    *("[" * 60 + "]" * 60, "[" * 2000 + "]" * 2000, "{x = {y = [1]}}", "{'[/red]' = 1}", "{'a b' = 1.0}"),
    *("{'-1' = 1.0}", "1979-05-27T07:32:00Z", "1979-05-27", "07:32:00"),
]


def _quoted(text: str) -> str:
    return json.dumps(text).replace("\x7f", "\\u007f").replace("\x9b", "\\u009b")


_TEXTS: Final = list(map(_quoted, TEXTS))


def hostile(rng: Random, sound: object) -> str:
    """A value as TOML text; more often than not one of the type of the ``sound`` value, so that it goes further."""
    alike = _TEXTS if isinstance(sound, str) else SHAPES if isinstance(sound, bool | list | dict) else NUMBERS
    return rng.choice(alike if rng.random() < 0.6 else [*_TEXTS, *NUMBERS, *SHAPES])


KEYS: Final = [json.dumps(text) for text in TEXTS if len(text) < 2000]
# Of a command line: an argument holds no NUL, and the largest one that Linux passes on has 128 kB.
WORDS: Final = [text for text in (*TEXTS, *NUMBERS) if "\x00" not in text]
# Neither a legal number of a flag nor a file: the command refuses at once.
REFUSED: Final = ["", "x", "nan", "-1", "2.5e", "[/red]", "\x1b[2J", "a\nb", "x" * 2000, "1e999", "٣x", "9" * 5000]


def short(text: str) -> str:
    """Text for a table: printable and not long."""
    shown = repr(text)
    return shown if len(shown) <= 48 else f"{shown[:30]}... ({len(text)} characters)"
