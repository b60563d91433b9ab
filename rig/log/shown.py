"""A log in one line, and as the small table that a notebook shows of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.frame import DISCRETES, SIGNALS, State

if TYPE_CHECKING:
    from rig.log.reader import Log

Conclude = Callable[["Log"], list[str]]
_conclude: list[Conclude] = []  # at most one


def conclude_with(function: Conclude) -> None:
    """Show in tables what ``function`` says of a log; it scores, and so is in a room that this one may not import."""
    _conclude[:] = [function]


def line(log: Log) -> str:
    """Return a log in one line."""
    said = resolved(log)
    named = said.get("title") or said.get("aircraft") or "recording"
    seed = f" seed {said['seed']}" if "seed" in said else ""
    return f"<Log {named}{seed}: {_verdict(log)}, failed {_failed(log)}>"


def html(log: Log, overrides: Sequence[str] = (), path: Path | None = None) -> str:
    """Return a table: what was flown, verdict, failed channels, conclusion, digest; no frames."""
    said = resolved(log)
    manager = said.get("redundancy", {}).get("manager", "")
    about = (f"seed {said.get('seed', '')}", f"manager {manager}" if manager else "", *overrides)
    cells = [
        ("scenario", f"{said.get('title') or said.get('aircraft', '')}, {', '.join(filter(None, about))}"),
        ("verdict", _verdict(log)),
        ("failed channels", _failed(log)),
        *(("conclusion" if i == 0 else "", text) for i, text in enumerate(_concluded(log))),
        ("digest", (log.result or {}).get("digest", "none")),
        *([("log", str(path))] if path is not None else []),
    ]
    style = 'style="text-align:left;vertical-align:top"'
    rows = "".join(f"<tr><th {style}>{escape(head)}</th><td {style}>{escape(text)}</td></tr>" for head, text in cells)
    return f"<table>{rows}</table>"


def resolved(log: Log) -> dict[str, Any]:
    """Return the scenario of a log as plain data; empty where there is none that can be read."""
    try:
        said = json.loads(log.metadata.get("scenario", "{}"))
    except (ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _verdict(log: Log) -> str:
    length = f"{len(log.rows) / log.rate_hz:g} s"
    if log.result is None:
        return f"not finished, {length}"
    verdict = "survived" if log.result.get("survived") == "True" else "lost"
    return f"{verdict} ({log.result.get('end_reason', 'no reason given')}, {length})"


def _failed(log: Log) -> str:
    """The channels that are failed in the last frame."""
    found = []
    for field, named in (("state", SIGNALS), ("discrete_state", DISCRETES)):
        last = log.rows[field][-1:] == State.FAILED
        for place in np.flatnonzero(last.any(axis=(0, 2))):
            channels = ", ".join(str(c + 1) for c in np.flatnonzero(last[0, place]))
            found.append(f"{named[place].name} {channels}")
    return "; ".join(found) or "no channel"


def _concluded(log: Log) -> list[str]:
    return [text for conclude in _conclude for text in conclude(log)]
