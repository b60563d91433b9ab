"""``rig replay``, ``rig diff``, ``rig info``, ``rig export``: parse, call, print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli import complete
from rig.cli.common import AllowCode, Json, UnitFile, emit
from rig.cli.working import working
from rig.text import plain

if TYPE_CHECKING:
    from rig.recordings.flown import Recorded

LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="A log of a flight.", show_default=False)]


def replay(
    log: LogFile,
    fly: Annotated[bool, typer.Option("--fly", help="Fly the whole recorded scenario again.")] = False,
    redundancy: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What if: a TOML file with another redundancy table.", show_default=False),
    ] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="What if: redundancy.manager=mean; repeatable.",
            autocompletion=complete.sets,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Log of the what if.", show_default="<log>.what-if.mcap")
    ] = None,
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Run the recorded manager over the recorded channels and compare every frame.

    Exit code 0 when all is identical to the bit, 1 when not.  A what if compares decisions, and ends with 0.
    """
    from rig.errors import BadInput
    from rig.recordings.flown import recorded

    asked = redundancy is not None or bool(sets)
    if fly and asked:
        raise BadInput("--fly flies what was recorded: it cannot be joined with --redundancy or --set")
    if out is not None and not asked:
        raise BadInput("--out is where a what if is written: it needs --redundancy or --set")
    if asked and unit is not None:
        raise BadInput("--unit replays what was recorded: it cannot be joined with --redundancy or --set")
    with working("reading the log", not as_json):
        recording = recorded(log, allow_code)
    if asked:
        _what_if(recording, redundancy, sets or [], out, as_json)
    else:
        _again(recording, fly, unit, as_json)


def _again(recording: Recorded, fly: bool, unit: Path | None, as_json: bool) -> None:
    """Replay or fly again; exit code 1 when anything differs."""
    from rig.cli import show_replay as show
    from rig.replay.verify import verify
    from rig.unit.unit import running

    with working("flying again" if fly else "replaying", not as_json), running(unit) as tested:
        found = verify(recording, fly, tested)
    emit(as_json, {"log": str(recording.path), **found.as_dict()}, lambda: show.verified(recording, found))
    if not found.comparison.identical:
        raise typer.Exit(1)


def _what_if(recording: Recorded, file: Path | None, sets: list[str], out: Path | None, as_json: bool) -> None:
    from rig.cli import show_replay as show
    from rig.replay.what_if import changed, what_if

    changes = [*([str(file)] if file else []), *sets]
    with working("replaying", not as_json):
        answer = what_if(recording, changed(recording, file, sets), out, changes)
    about = {"log": str(recording.path), "what_if": str(answer.path), "changes": changes, "events": answer.events}
    emit(as_json, {**about, "open_loop": True, **answer.moved.as_dict()}, lambda: show.what_if(recording, answer))


def diff(
    a: Annotated[Path, typer.Argument(metavar="LOG_A", help="A log.", show_default=False)],
    b: Annotated[Path, typer.Argument(metavar="LOG_B", help="Another.", show_default=False)],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(metavar="X", help="1e-6 for all fields, 'pitch_rate.*=0.01' for some; repeatable."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare two logs field by field; exit code 0 when nothing differs by more than its tolerance, else 1."""
    from rig.cli import show_replay as show
    from rig.replay.before_after import diff as compare
    from rig.replay.before_after import side

    with working("comparing", not as_json):
        left, right = side(a), side(b)
        found = compare(left, right, tolerance or ())
    rate_hz = left.rate_hz if left.rate_hz == right.rate_hz else None
    emit(as_json, {"a": str(a), "b": str(b), **found.as_dict()}, lambda: show.comparison(found, rate_hz))
    if not found.same:
        raise typer.Exit(1)


def info(log: LogFile, as_json: Json = False) -> None:
    """What a log says of its flight, and whether the file is whole; exit code 2 when it is not."""
    from rig.cli import show_replay as show
    from rig.errors import BadLog
    from rig.log.info import info as tell

    found = tell(log)
    emit(as_json, found, lambda: show.info(found))
    if found["damage"] is not None:
        raise BadLog(f"{log}: {found['health']}")


def export(
    log: LogFile,
    to: Annotated[str, typer.Option(metavar="FORMAT", help="csv, parquet or npz.", show_default=False)],
    signals: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Signals, discretes, control, flight, inertial, demand.", show_default="all"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The file to write.", show_default="<log>.<to>")
    ] = None,
    for_vote: Annotated[bool, typer.Option("--for-vote", help="Only what rig vote reads.")] = False,
    as_json: Json = False,
) -> None:
    """Write a log as a table, its columns named as rig vote names them."""
    from rig.log import read_log
    from rig.log.export import export as write

    owners = [part.strip() for part in (signals or "").split(",") if part.strip()]
    target = out or Path(f"{log.with_suffix('')}.{to}")
    with working("writing", not as_json):
        recording = read_log(log)
        columns = write(recording, to, target, owners, for_vote)
    about = {"log": str(log), "out": str(target), "rows": len(recording.rows), "columns": columns}
    text = f"{target}: {len(recording.rows)} rows, {len(columns)} columns"
    emit(as_json, about, lambda: typer.echo(plain(text)))
