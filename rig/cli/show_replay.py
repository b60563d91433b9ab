"""What replay, diff and info print for people."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rig.log.columns import unit_of
from rig.recordings.flown import Recorded
from rig.replay.compare import Comparison
from rig.replay.decisions import Decisions
from rig.replay.verify import Verified
from rig.replay.what_if import WhatIf
from rig.units.quantities import duration, moment, number, unit_shown
from rig.util.console import Screen, console, styled

MOST_LINES = 40  # of a table on the terminal; --json has all
MOST_OVERRIDES = 8  # of a log


def verified(recording: Recorded, found: Verified) -> None:
    """A replay or a flight again: the fields, and where they are not identical the decisions that moved."""
    comparison(found.comparison, recording.log.rate_hz)
    if not found.comparison.identical:
        _decisions(found.decisions, recording.log.rate_hz)


def what_if(recording: Recorded, answer: WhatIf) -> None:
    """The decisions that moved, and where the log of the answer is."""
    _decisions(answer.moved, recording.log.rate_hz)
    console().print("open loop: truth and commands are those of the recording, whatever the new votes say")
    console().print(f"written  {answer.path}", soft_wrap=True)


def comparison(found: Comparison, rate_hz: float | None) -> None:
    """The fields that are not equal, and the verdict; without a rate the frames alone."""
    screen = console()
    for line in found.remarks:
        screen.print(f"  {line}", style="yellow")
    for line in found.notes:
        screen.print(f"  {line}", soft_wrap=True)
    missing = Counter((f.name.split(".")[0], f.verdict) for f in found.fields if f.verdict.startswith("missing"))
    for (owner, verdict), count in missing.items():
        screen.print(f"  {owner}: {count} fields {verdict}", style="yellow")
    unequal = [field for field in found.fields if field.verdict in ("within", "different")]
    if unequal:
        order = sorted(unequal, key=lambda field: (field.verdict != "different", field.first_frame or 0))
        rows = [
            (f.name, f.verdict, f"{f.frames}", _at(f.first_frame, rate_hz), *_sized(f.largest, unit_of(f.name)))
            for f in order[:MOST_LINES]
        ]
        screen.table(("field", "result", "frames", "first", "largest difference", "unit"), rows)
        _rest(screen, len(unequal))
    counted = ", ".join(f"{count} {name}" for name, count in found.counts().items() if count)
    word = "identical" if found.identical else "same" if found.same else "different"
    screen.print(styled((word, "bold"), f": {found.frames} frames, fields: {counted}"))


def _decisions(found: Decisions, rate_hz: float) -> None:
    screen = console()
    if found.failures:
        rows = [
            (f"{entry.signal}.{entry.channel}", *(_failed(at, rate_hz) for at in (entry.old_frame, entry.new_frame)))
            for entry in found.failures
        ]
        screen.table(("channel", "failed", "now"), rows)
    if found.moved:
        rows = []
        for entry in found.moved[:MOST_LINES]:
            channel = "" if entry.channel is None else f".{entry.channel}"
            length = duration(entry.last_frame - entry.first_frame + 1, rate_hz)
            at = moment(entry.first_frame, rate_hz)
            rows.append((f"{entry.signal}{channel} {entry.decision}", at, length, entry.old, entry.new))
        screen.table(("decision", "from", "for", "old", "new"), rows)
        _rest(screen, len(found.moved))
    if found.votes:
        rows = (
            (v.signal, f"{v.frames}", moment(v.first_frame, rate_hz), *_sized(v.largest, unit_of(f"{v.signal}.voted")))
            for v in found.votes
        )
        screen.table(("vote", "frames", "first", "largest difference", "unit"), rows)
    if not found.moved and not found.votes:
        screen.print("no decision and no vote moved")


def _failed(frame: int | None, rate_hz: float) -> str:
    return "never" if frame is None else moment(frame, rate_hz)


def _at(frame: int | None, rate_hz: float | None) -> str:
    """The time of a frame where the rate is known, else the frame."""
    return moment(frame, rate_hz) if rate_hz else "" if frame is None else f"frame {frame}"


def _sized(value: float | None, unit: str) -> tuple[str, str]:
    return number(value, unit), unit_shown(unit)


def _rest(screen: Screen, count: int) -> None:
    if count > MOST_LINES:
        screen.print(f"  and {count - MOST_LINES} more, with --json")


def info(found: dict[str, Any]) -> None:
    """One log."""
    screen, result = console(), found["result"] or {}
    screen.print(styled((found["title"] or found["log"], "bold"), f"  {found['aircraft']}, seed {found['seed']}"))
    screen.print(f"manager  {found['manager'] or 'not said'}")
    if found["overrides"]:
        left = len(found["overrides"]) - MOST_OVERRIDES
        more = f" and {left} more, with --json" if left > 0 else ""
        screen.print(f"set      {', '.join(found['overrides'][:MOST_OVERRIDES])}{more}", soft_wrap=True)
    if found["what_if"] is not None:
        screen.print(f"what if  {found['what_if']}, over the channels of {found['what_if_of']}; never flown")
    planned = "" if found["planned_s"] is None else f" of {found['planned_s']:g} s"
    screen.print(f"flown    {found['frames']} frames, {found['duration_s']:g} s{planned}, at {found['rate_hz']:g} Hz")
    outcome = f"{'survived' if result.get('survived') == 'True' else 'lost'}: {result.get('end_reason', '')}"
    screen.print(f"result   {outcome if result else 'none: the flight was not ended by the loop'}")
    events = ", ".join(f"{count} {name}" for name, count in found["events"].items())
    screen.print(f"events   {events or 'none'}")
    screen.print(f"topics   {len(found['topics'])}, {sum(found['topics'].values())} messages, {found['bytes']} bytes")
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    screen.print(f"versions schema {found['schema_version']}, {versions}", soft_wrap=True)
    screen.print(f"commit   {found['commit'] or 'not said'}, on {found['machine'] or 'a machine that is not said'}")
    screen.print(f"digest   {result.get('digest', 'not said')}")
    screen.print(f"health   {found['health']}", soft_wrap=True)
