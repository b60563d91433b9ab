"""What replay, diff and info print for people."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rich.console import Console
from rich.table import Table

from rig.console import styled
from rig.offline.compare import Comparison
from rig.offline.decisions import Decisions

MOST_LINES = 40  # of a table on the terminal; --json has all


def comparison(screen: Console, found: Comparison) -> None:
    """The fields that are not equal, and the verdict."""
    for line in found.remarks:
        screen.print(f"  {line}", style="yellow")
    for line in found.notes:
        screen.print(f"  {line}", soft_wrap=True)
    missing = Counter((f.name.split(".")[0], f.verdict) for f in found.fields if f.verdict.startswith("missing"))
    for (owner, verdict), count in missing.items():
        screen.print(f"  {owner}: {count} fields {verdict}", style="yellow")
    unequal = [field for field in found.fields if field.verdict in ("within", "different")]
    if unequal:
        table = Table("field", "verdict", "frames", "first", "largest", box=None)
        order = sorted(unequal, key=lambda field: (field.verdict != "different", field.first_frame or 0))
        for field in order[:MOST_LINES]:
            first = "" if field.first_frame is None else str(field.first_frame)
            table.add_row(field.name, field.verdict, str(field.frames), first, _number(field.largest))
        screen.print(table)
        _rest(screen, len(unequal))
    counted = ", ".join(f"{count} {name}" for name, count in found.counts().items() if count)
    word = "identical" if found.identical else "same" if found.same else "different"
    screen.print(styled((word, "bold"), f": {found.frames} frames, fields: {counted}"))


def decisions(screen: Console, found: Decisions, rate_hz: float) -> None:
    """Which decisions moved."""
    if found.failures:
        table = Table("channel", "failed", "now", box=None)
        for entry in found.failures:
            frames = [_frame(frame, rate_hz) for frame in (entry.old_frame, entry.new_frame)]
            table.add_row(f"{entry.signal}.{entry.channel}", *frames)
        screen.print(table)
    if found.moved:
        table = Table("decision", "frames", "from s", "old", "new", box=None)
        for entry in found.moved[:MOST_LINES]:
            channel = "" if entry.channel is None else f".{entry.channel}"
            span = f"{entry.first_frame}" + ("" if entry.last_frame == entry.first_frame else f" to {entry.last_frame}")
            at = f"{entry.first_frame / rate_hz:.2f}"
            table.add_row(f"{entry.signal}{channel} {entry.decision}", span, at, entry.old, entry.new)
        screen.print(table)
        _rest(screen, len(found.moved))
    if found.votes:
        table = Table("vote", "frames", "first", "largest", box=None)
        for vote in found.votes:
            table.add_row(vote.signal, str(vote.frames), str(vote.first_frame), _number(vote.largest))
        screen.print(table)
    if not found.moved and not found.votes:
        screen.print("no decision and no vote moved")


def _frame(frame: int | None, rate_hz: float) -> str:
    return "never" if frame is None else f"{frame} ({frame / rate_hz:.2f} s)"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _rest(screen: Console, count: int) -> None:
    if count > MOST_LINES:
        screen.print(f"  and {count - MOST_LINES} more, with --json")


def info(screen: Console, found: dict[str, Any]) -> None:
    """One log."""
    result = found["result"] or {}
    screen.print(styled((found["title"] or found["log"], "bold"), f"  {found['aircraft']}, seed {found['seed']}"))
    if found["what_if"] is not None:
        screen.print(f"what if  {found['what_if']}, over the channels of {found['what_if_of']}; never flown")
    planned = "" if found["planned_s"] is None else f" of {found['planned_s']:g} s"
    screen.print(f"flown    {found['frames']} frames, {found['duration_s']:g} s{planned}, at {found['rate_hz']:g} Hz")
    screen.print(f"result   {_result(result)}")
    events = ", ".join(f"{count} {name}" for name, count in found["events"].items())
    screen.print(f"events   {events or 'none'}")
    screen.print(f"topics   {len(found['topics'])}, {sum(found['topics'].values())} messages, {found['bytes']} bytes")
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    screen.print(f"versions schema {found['schema_version']}, {versions}", soft_wrap=True)
    screen.print(f"commit   {found['commit'] or 'not said'}, on {found['machine'] or 'a machine that is not said'}")
    screen.print(f"digest   {result.get('digest', 'not said')}")
    screen.print(f"health   {found['health']}", soft_wrap=True)


def _result(result: dict[str, str]) -> str:
    if not result:
        return "none: the flight was not ended by the loop"
    return f"{'survived' if result.get('survived') == 'True' else 'lost'}: {result.get('end_reason', '')}"
