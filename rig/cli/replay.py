"""``rig replay``, ``diff``, ``info``, ``export``, ``recover``: work on a log, and print the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Exit, echo

from rig.cli.common import AllowCodeOrSet, Json, LogFile, Sets, UnitFile, arg, emit, flag, opt
from rig.cli.printing import MOST_LINES, field, line, table
from rig.cli.working import working
from rig.core.column import Column
from rig.core.errors import BadInput, BadLog
from rig.core.files import is_file, is_folder
from rig.core.outputs import require_apart, require_ending
from rig.core.text import plain
from rig.core.units.quantities import duration, moment, number, unit_shown

if TYPE_CHECKING:
    from rig.bench.replay.compare_flights import Comparison
    from rig.bench.replay.decisions import Decisions, Moved
    from rig.log.recordings.flown_log import Recorded

MOST_OVERRIDES: Final = 8  # of a log
REFERENCE: Final = "reference_usable"  # a decision that follows from the manager, signal by signal
AFTER: Final = ("pattern", "decided_by", REFERENCE)  # decisions that are told after states, levels and sources
FEW: Final = 3  # signals whose references are told one by one
LAYOUTS: Final = ("foxglove",)


def replay(
    log: LogFile,
    fly: Annotated[bool, flag("--fly", "Fly the whole recorded scenario again.")] = False,
    redundancy: Annotated[
        Path | None, opt("FILE", "What-if run with the redundancy table of this file, TOML.", show_default=False)
    ] = None,
    sets: Sets = None,
    out: Annotated[
        Path | None, opt("FILE", "File for the log of the what-if run.", show_default="<log>.what-if.mcap")
    ] = None,
    unit: UnitFile = None,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """Run the redundancy manager and the actuator monitors again on the recorded inputs, and compare each frame.

    Exit code 0: all frames are identical to the bit. Exit code 1: a frame differs. A what-if run (--redundancy, --set)
    compares the decisions, and its exit code is 0.
    """
    from rig.log.recordings.flown_log import recorded

    asks = redundancy is not None or bool(sets)
    if fly and asks:
        raise BadInput("--fly: not with --redundancy or --set, which change the recorded scenario")
    if out is not None and not asks:
        raise BadInput("--out: needs --redundancy or --set, as only a what-if run writes a log")
    if asks and unit is not None:
        raise BadInput("--unit: not with --redundancy or --set")
    require_apart({"--out": out}, [log, redundancy])
    require_ending("--out", out, "a log", ".mcap")
    with working("reading the log", not as_json):
        recording = recorded(log, allow_code)
    if asks:
        _what_if(recording, redundancy, sets or [], out, as_json)
    else:
        _again(recording, fly, unit, as_json)


def _again(recording: Recorded, fly: bool, unit: Path | None, as_json: bool) -> None:
    """Replay or fly again; exit code 1 when anything differs."""
    from rig.bench.replay.verify import verify
    from rig.unit.running_unit import running

    with working("flying again" if fly else "replaying", not as_json), running(unit) as tested:
        result = verify(recording, fly, tested)

    def text() -> None:
        _comparison(result.comparison, recording.log.rate_hz)
        if not result.comparison.identical:
            _decisions(result.decisions, recording.log.rate_hz)

    emit(as_json, {"log": str(recording.path), **result.as_dict()}, text)
    if not result.comparison.identical:
        raise Exit(1)


def _what_if(recording: Recorded, file: Path | None, sets: list[str], out: Path | None, as_json: bool) -> None:
    from rig.bench.replay.what_if import changed, what_if

    changes = [*([str(file)] if file else []), *sets]
    with working("replaying", not as_json):
        answer = what_if(recording, changed(recording, file, sets), out, changes)

    def text() -> None:
        for note in answer.notes:
            line(f"  {note}")
        _decisions(answer.moved, recording.log.rate_hz)
        line("open loop: trajectory and commands stay as recorded")
        field("written", str(answer.path))

    data = {"log": str(recording.path), "what_if": str(answer.path), "changes": changes, "events": answer.events}
    emit(as_json, {**data, "open_loop": True, "notes": answer.notes, **answer.moved.as_dict()}, text)


def diff(
    a: Annotated[Path, arg("LOG_A", "First log, or MCAP file of rig vote.")],
    b: Annotated[Path, arg("LOG_B", "Second log or file.")],
    tolerance: Annotated[
        list[str] | None, opt("X", "Allowed difference: 1e-6 for all fields, 'pitch_rate.*=0.01' for some. Repeatable.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare two logs field by field, and print the largest differences.

    Exit code 0: no field differs by more than its tolerance. Exit code 1: a field differs.
    """
    from rig.bench.replay.before_after import diff as compare
    from rig.bench.replay.before_after import side

    with working("comparing", not as_json):
        left, right = side(a), side(b)
        result = compare(left, right, tolerance or ())
    rate_hz = left.rate_hz if left.rate_hz == right.rate_hz else None
    emit(as_json, {"a": str(a), "b": str(b), **result.as_dict()}, lambda: _comparison(result, rate_hz))
    if not result.same:
        raise Exit(1)


def _comparison(result: Comparison, rate_hz: float | None) -> None:
    """Print the unequal fields and the verdict; without a rate print frames instead of times."""
    for remark in result.remarks:
        line(f"  {remark}", style="yellow")
    for note in result.notes:
        line(f"  {note}")
    missing = Counter((f.name.split(".")[0], f.verdict) for f in result.fields if f.verdict.startswith("missing"))
    for (owner, verdict), count in missing.items():
        line(f"  {owner}: {count} fields {verdict}", style="yellow")
    unequal = [field for field in result.fields if field.verdict in ("within", "different")]
    first = Column("first", lambda f: moment(f.first_frame, rate_hz) if rate_hz else _frame(f.first_frame))
    shown = (Column("field", "name"), Column("result", "verdict"), Column("frames", worth=7), first)
    order = sorted(unequal, key=lambda f: (f.verdict != "different", f.first_frame or 0))
    table(order, (*shown, *_difference(lambda f: f.name)), MOST_LINES)
    counted = ", ".join(f"{count} {name}" for name, count in result.counts().items() if count)
    word = "identical" if result.identical else "same" if result.same else "different"
    line((word, "bold"), f": {result.frames} frames, fields: {counted}")


def _frame(frame: int | None) -> str:
    return "" if frame is None else f"frame {frame}"


def _difference(name: Callable[[Any], str]) -> tuple[Column, Column]:
    """Return the columns of the largest difference of the log's column ``name`` of a row, and of its unit."""
    from rig.log.columns import unit_of

    return (
        Column("largest difference", lambda row: number(row.largest, unit_of(name(row)))),
        Column("unit", lambda row: unit_shown(unit_of(name(row))), worth=8),
    )


def _by_worth(moved: Sequence[Moved]) -> tuple[list[Moved], list[str]]:
    """Return the changes, states and levels first, and the signals of which only the reference changed, if many."""
    signals = list(dict.fromkeys(change.signal for change in moved if change.decision == REFERENCE))
    summed = signals if len(signals) > FEW else []
    shown = [change for change in moved if not summed or change.decision != REFERENCE]
    return sorted(shown, key=lambda change: change.decision in AFTER), summed


def _decisions(moves: Decisions, rate_hz: float) -> None:
    """Print the decisions and votes that differ from the recording."""
    failures = (
        Column("channel", lambda f: f"{f.signal}.{f.channel}"),
        Column("isolated", lambda f: moment(f.old_frame, rate_hz) or "never"),
        Column("now", lambda f: moment(f.new_frame, rate_hz) or "never"),
    )
    decisions = (
        Column("decision", lambda d: f"{d.signal}{'' if d.channel is None else f'.{d.channel}'} {d.decision}"),
        Column("from", lambda d: moment(d.first_frame, rate_hz)),
        Column("for", lambda d: duration(d.last_frame - d.first_frame + 1, rate_hz), worth=7),
        *(Column("old"), Column("new")),
    )
    votes = (
        *(Column("vote", "signal"), Column("frames", worth=7)),
        Column("first", lambda v: moment(v.first_frame, rate_hz)),
        *_difference(lambda v: f"{v.signal}.voted"),
    )
    moved, references = _by_worth(moves.moved)
    table(moves.failures, failures)
    table(moved, decisions, MOST_LINES)
    if references:
        line(f"  {REFERENCE} changed for {len(references)} signals: {', '.join(references)}")
    table(moves.votes, votes)
    if not moves.moved and not moves.votes:
        line("no decision and no vote changed")


def info(
    log: Annotated[Path, arg("LOG", "Log of a flight, or a log of PX4, ArduPilot, ROS 2 or MDF 4.")],
    topics: Annotated[bool, flag("--topics", "List all topics of a log of another system.")] = False,
    as_json: Json = False,
) -> None:
    """Print the scenario, outcome, events and versions of a log, and whether the file is complete.

    A log of another system: print its sensors with instance, rate and unit, and what rig vote can compare.
    Exit code 2: the file is damaged.
    """
    from rig.cli import show_contents
    from rig.log.info import info as read_info
    from rig.log.recordings.formats.known import open_log

    other = open_log(log) if is_file(log) or is_folder(log) else None
    if other is not None:
        show_contents.info(log, other.contents, topics, as_json)
        return
    if topics:
        raise BadInput(f"{log}: --topics: for logs of other systems; that of a flight lists them with --json")
    facts = read_info(log)
    emit(as_json, facts, lambda: _info(facts))
    if facts["damage"] is not None:
        raise BadLog(f"{log}: {facts['health']}")


def _info(facts: dict[str, Any]) -> None:
    from rig.core.ending import ending
    from rig.unit.unit_facts import voter, what_it_reads

    result, sets = facts["result"] or {}, facts["overrides"]
    line((facts["title"] or facts["log"], "bold"), f"  {facts['aircraft']}, seed {facts['seed']}")
    who, _, name = voter(facts["manager"] or "unknown", {**facts, "name": facts["unit"]}).partition(" ")
    field(who, name)
    if read := what_it_reads(
        {"read_sha256": facts["unit_files"] or {}, "environment": facts["unit_environment"] or {}}
    ):
        field("reads", read)
    if sets:
        left = len(sets) - MOST_OVERRIDES
        field("set", ", ".join(sets[:MOST_OVERRIDES]) + (f" and {left} more, with --json" if left > 0 else ""))
    if facts["what_if"] is not None:
        field("what if", f"{facts['what_if']}, over the channels of {facts['what_if_of']}; not flown")
    planned = "" if facts["planned_s"] is None else f" of {facts['planned_s']:g} s"
    field("flown", f"{facts['frames']} frames, {facts['duration_s']:g} s{planned}, at {facts['rate_hz']:g} Hz")
    end = result.get("survived") == "True", result.get("end_reason", ""), facts["frames"], facts["rate_hz"]
    field("result", ending(*end) if result else "none: the log has no end of the flight")
    for note in facts["notes"]:
        field("note", note, style="yellow")
    field("events", ", ".join(f"{count} {name}" for name, count in facts["events"].items()) or "none")
    field("topics", f"{len(facts['topics'])}, {sum(facts['topics'].values())} messages, {facts['bytes']} bytes")
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    field("versions", f"schema {facts['schema_version']}, {versions}")
    field("commit", f"{facts['commit'] or 'unknown'}, on {facts['machine'] or 'an unknown machine'}")
    field("digest", result.get("digest", "none"))
    field("health", facts["health"])


def export(
    log: LogFile,
    to: Annotated[str | None, opt("FORMAT", "Format: csv, parquet or npz.", show_default="ending of --out")] = None,
    layout: Annotated[str | None, opt("VIEWER", "Viewer whose layout is written instead of a table: foxglove.")] = None,
    signals: Annotated[
        str | None,
        opt(
            "A,B",
            "Columns: signals, discretes, control, flight, inertial, autopilot_command, actuator.elevator.",
            show_default="all",
        ),
    ] = None,
    out: Annotated[Path | None, opt("FILE", "File to write.", show_default="<log>.<to>")] = None,
    for_vote: Annotated[bool, flag("--for-vote", "Write only the columns that rig vote reads.")] = False,
    as_json: Json = False,
) -> None:
    """Write a log as a table with the column names of rig vote, or write a viewer's layout for the log."""
    if to is not None and layout is not None:
        raise BadInput("--to, --layout: only one of them at a time")
    if layout is not None:
        if signals is not None or for_vote:
            raise BadInput("--signals, --for-vote: not with --layout")
        _export_layout(log, layout, out, as_json)
    else:
        owners = [part.strip() for part in (signals or "").split(",") if part.strip()]
        _export_table(log, _format(to, out), out, owners, for_vote, as_json)


def _format(to: str | None, out: Path | None) -> str:
    """Return the format of a table: that of ``--to``, or of the ending of ``--out``.  BadInput: neither, or not one."""
    from rig.log.export import ENDINGS

    ending = "" if out is None else out.suffix.removeprefix(".")
    if to is None and out is None:
        raise BadInput(f"--to, --out: one is needed: --to {'|'.join(ENDINGS)}, or --out FILE with such an ending")
    if to is None and ending not in ENDINGS:
        raise BadInput(f"--out {out}: must end in {', '.join(f'.{each}' for each in ENDINGS)}, or needs --to")
    if to is not None and ending in ENDINGS and ending != to:
        raise BadInput(f"--out {out}: must end in .{to}, the format of --to")
    return to or ending


def _export_table(log: Path, to: str, out: Path | None, owners: list[str], for_vote: bool, as_json: bool) -> None:
    """Write the table, and print its size."""
    from rig.log.export import export as write

    target = out or Path(f"{log.with_suffix('')}.{to}")
    require_apart({"--out": target}, [log])
    with working("writing", not as_json, compiles=False):
        names, rows, units = write(log, to, target, owners, for_vote)
    data = {"log": str(log), "out": str(target), "rows": rows, "columns": names, "units": units}
    text = f"{target}: {rows} rows, {len(names)} columns"
    emit(as_json, data, lambda: echo(plain(text)))


def _export_layout(log: Path, viewer: str, out: Path | None, as_json: bool) -> None:
    """Write the layout, and print the signal and time at which it opens."""
    if viewer not in LAYOUTS:
        raise BadInput(f"--layout {viewer}: must be {', '.join(LAYOUTS)}")
    from rig.show.viewer import foxglove, opened

    target = out or Path(f"{log.with_suffix('')}{foxglove.ENDING}")
    require_apart({"--out": target}, [log])
    with working("writing", not as_json):
        recording = opened.read([log])
        made = foxglove.write(recording, target)
    data = {"log": str(log), "out": str(target), **made._asdict()}
    zoom = "" if made.zoom_s is None else f", zoom {made.zoom_s[0]:.1f} to {made.zoom_s[1]:.1f} s"
    text = f"{target}: {made.panels} panels, {made.signal.replace('_', ' ')}{zoom}"
    emit(as_json, data, lambda: echo(plain(text)))


def recover(
    log: LogFile,
    out: Annotated[Path | None, opt("FILE", "File for the recovered log.", show_default="<log>.recovered.mcap")] = None,
    as_json: Json = False,
) -> None:
    """Recover a log that was cut off: keep each complete chunk, and write a new summary."""
    from dataclasses import asdict

    from rig.log import recover as mend

    target = out or log.with_suffix(".recovered.mcap")
    require_apart({"--out": target}, [log])
    mended = mend(log, target)
    content = f"{mended.frames} frames, the last at {mended.last_time_s:g} s"
    if mended.complete:
        text, kept = f"{log}: complete, nothing to recover: {content}", log
    else:
        text, kept = f"{target}: {content}; {mended.damage}, {mended.lost_bytes} bytes lost", target
    emit(as_json, {"log": str(kept), **asdict(mended)}, lambda: echo(plain(text)))
