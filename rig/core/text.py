"""Text of others in our output: no control characters, one line, not too long, the nearest of the known names.

Titles, names, paths and values come from files that anybody may have written; what is printed must neither move the
cursor nor hide the reason of an error behind a megabyte of its cause.
"""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from typing import Final

LONGEST_LINE: Final = 590  # characters of an error, so that with "error: " it is below 600
LONGEST_VALUE: Final = 80  # of a value quoted in it
LONGEST_LIST: Final = 120  # of names that are all listed; of more only the nearest
NEAREST: Final = 3
_UNSEEN: Final = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # control, direction, halves of pairs, separators


def plain(text: str, keep: str = "") -> str:
    """Escape every character that a terminal would act on (\\u001b), but for those in ``keep``."""
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
    """Return the value as Python writes it, not too long."""
    try:
        return shorten(repr(value))
    except ValueError:  # Python writes no whole number of more than 4300 digits
        return "a number of thousands of digits"


def choices(given: str, known: Iterable[str], where: str = "") -> str:
    """Say what is allowed in place of ``given``: all of ``known``, or of a long list the nearest names.

    where : where the whole list is, a command or a page
    """
    names = list(known)
    listed = ", ".join(names)
    if len(listed) <= LONGEST_LIST:
        return f"allowed: {listed}"
    count = f"{len(names)} allowed"
    return f"nearest: {', '.join(nearest(given, names))} ({count}{f', see {where}' if where else ''})"


def nearest(given: str, known: Iterable[str]) -> list[str]:
    """Return the NEAREST names that look most like ``given``, the most alike first."""
    return difflib.get_close_matches(given[:LONGEST_VALUE], list(known), NEAREST, cutoff=0.0)
