"""Foreign text in the output: without control characters, in one line, shortened; and the nearest known names.

Titles, names, paths and values come from files of any origin.  Printed text must neither move the cursor nor hide the
reason of an error behind a megabyte of its cause.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable
from typing import Final

LONGEST_LINE: Final = 590  # characters of an error, so that with "error: " it is below 600
LONGEST_VALUE: Final = 80  # of a value quoted in it
LONGEST_LIST: Final = 120  # of names that are all listed; of more only the nearest
NEAREST: Final = 3
_UNSEEN: Final = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # control, direction, halves of pairs, separators


def plain(text: str, keep: str = "") -> str:
    """Escape every character that a terminal would act on (\\u001b), except those in ``keep``."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if c in keep or unicodedata.category(c) not in _UNSEEN else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def one_line(text: str) -> str:
    """Return ``text`` as one plain line of at most LONGEST_LINE characters."""
    return shorten(plain(" ".join(text.split())), LONGEST_LINE)


def shorten(text: str, most: int = LONGEST_VALUE) -> str:
    """Cut the middle out of a ``text`` of more than ``most`` characters."""
    if len(text) <= most:
        return text
    head = most // 2
    return f"{text[:head]} ... {text[len(text) - (most - head - 5) :]}"


def quoted(value: object) -> str:
    """Return the value as Python writes it, shortened."""
    try:
        return shorten(repr(value))
    except ValueError:  # Python writes no whole number of more than 4300 digits
        return "a number of thousands of digits"


def choices(given: str, known: Iterable[str], where: str = "") -> str:
    """Return the allowed names in place of ``given``: all of ``known``, or the nearest of a long list.

    where : the command or page with the whole list
    """
    names = list(known)
    listed = ", ".join(names)
    if len(listed) <= LONGEST_LIST:
        return f"allowed: {listed}"
    count = f"{len(names)} allowed"
    return f"nearest: {', '.join(nearest(given, names))} ({count}{f', see {where}' if where else ''})"


_RULES: Final = (  # pydantic's words, and those of a rule
    (r"input should be greater than or equal to (\S+)", r"must be \1 or more"),
    (r"input should be less than or equal to (\S+)", r"must be at most \1"),
    (r"input should be greater than (\S+)", r"must be above \1"),
    (r"input should be less than (\S+)", r"must be below \1"),
    (
        r"input should be a valid (?:integer|number), (?:unable to parse|got a number with a fractional part).*",
        "NUMBER",
    ),
    (r"input should be a valid integer", "must be a whole number"),
    (r"input should be a valid string", "must be a text"),
    (r"input should be a valid boolean.*", "must be true or false"),
    (r"input should be a valid (?:dictionary|object).*", "must be a table"),
    (r"input should be a valid ", "must be a "),
    (r"input should be ", "must be "),
    (r"field required", "missing"),
)


def must_be(message: str) -> str:
    """Return a message of pydantic as a rule: ``must be above 0`` for ``Input should be greater than 0``."""
    message = message.removeprefix("Value error, ").replace("\n", " ")
    for pattern, rule in _RULES:
        if found := re.match(pattern, message, re.IGNORECASE):
            what = "must be a whole number" if "integer" in found[0] else "must be a number"
            return f"{what if rule == 'NUMBER' else found.expand(rule)}{message[found.end() :]}"
    return f"{message[:1].lower()}{message[1:]}"


def nearest(given: str, known: Iterable[str]) -> list[str]:
    """Return the NEAREST names that are most similar to ``given``, the most similar first."""
    return difflib.get_close_matches(given[:LONGEST_VALUE], list(known), NEAREST, cutoff=0.0)
