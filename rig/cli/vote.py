"""``rig vote``: parse, call, print."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from rig.cli.common import AllowCode, Json, emit


def vote(
    recorded: Annotated[
        Path, typer.Argument(metavar="INPUT", help="CSV, Parquet or MCAP, or a folder of tables.", show_default=False)
    ],
    config: Annotated[Path, typer.Option(help="Settings of the signals, TOML.", show_default=False)],
    out: Annotated[Path, typer.Option(help="What to write: .csv, .parquet or .mcap.", show_default=False)],
    align: Annotated[bool, typer.Option("--align", help="Take constant delays and offsets off the channels.")] = False,
    align_from: Annotated[
        float | None, typer.Option(help="Begin of the stretch to find them in, s.", show_default="first row")
    ] = None,
    align_to: Annotated[float | None, typer.Option(help="Its end, s.", show_default="last row")] = None,
    repair_time: Annotated[
        bool, typer.Option("--repair-time", help="Drop rows whose time repeats or steps back, and say how many.")
    ] = False,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Vote on recorded channels with the redundancy manager of the flight."""
    from rig.console import console
    from rig.errors import BadInput
    from rig.offline.vote_summary import show

    if not align and (align_from, align_to) != (None, None):
        raise BadInput("--align-from and --align-to need --align")
    for option, value in (("--align-from", align_from), ("--align-to", align_to)):
        if value is not None and not isfinite(value):
            raise BadInput(f"{option}: input should be a finite number, got {value}")
    found = _vote(recorded, config, out, (align_from, align_to) if align else None, repair_time, allow_code)
    emit(as_json, found, lambda: show(console(), found))


def _vote(
    recorded: Path,
    config: Path,
    out: Path,
    stretch: tuple[float | None, float | None] | None,
    repair: bool,
    allow_code: bool,
) -> dict[str, Any]:
    """Read, align on ``stretch`` if there is one, vote, write; the summary, and the seconds of each step."""
    from rig.offline.align import align
    from rig.offline.discrete_vote import vote_all
    from rig.offline.read_recording import read
    from rig.offline.vote import vote as run
    from rig.offline.vote_settings import read_config
    from rig.offline.vote_summary import summary
    from rig.offline.write_votes import Result, output, write
    from rig.trust import Trust

    seconds: dict[str, float] = {}
    clock = perf_counter()

    def lap(stage: str) -> None:
        nonlocal clock
        now = perf_counter()
        seconds[stage], clock = now - clock, now

    with output(out, recorded) as part:
        settings = read_config(config)
        recording = read(recorded, settings, repair)
        signals = settings.signals(recording.signals, str(config))
        discretes = settings.discretes(recording.discretes, str(config))
        lap("read")
        corrections = None
        if stretch is not None:
            recording, corrections = align(recording, signals, *stretch)
            lap("align")
        resets, trust = settings.resets, Trust(str(config), allow_code)
        voted = Result(run(recording, signals, resets, trust), vote_all(recording, discretes, resets))
        lap("vote")
        write(part, out, recording, voted)
        lap("write")
    return {"out": str(out), **summary(recording, voted, corrections), "seconds": seconds}
