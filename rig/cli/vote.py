"""``rig vote``: parse, call, print."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.common import AllowCode, Json, emit
from rig.cli.working import working


def vote(
    recorded: Annotated[
        Path, typer.Argument(metavar="INPUT", help="CSV, Parquet or MCAP, or a folder of tables.", show_default=False)
    ],
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="What to write: .csv, .parquet or .mcap.", show_default=False)
    ],
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Settings of the signals, TOML.", show_default="those of the flight's log"),
    ] = None,
    align: Annotated[bool, typer.Option("--align", help="Take constant delays and offsets off the channels.")] = False,
    align_from: Annotated[
        float | None, typer.Option(help="Begin of the stretch to find them in, s.", show_default="first row")
    ] = None,
    align_to: Annotated[float | None, typer.Option(help="Its end, s.", show_default="6 s after its begin")] = None,
    align_matrix: Annotated[
        bool, typer.Option("--align-matrix", help="Take misalignments off the triads of CONFIG too.")
    ] = False,
    inject: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Put the faults of FILE into the channels and score who is failed."),
    ] = None,
    repair_time: Annotated[
        bool, typer.Option("--repair-time", help="Drop rows whose time repeats or steps back, and say how many.")
    ] = False,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Vote on recorded channels with the redundancy manager of the flight."""
    from rig.bench.vote_run import Options, run
    from rig.bench.vote_summary import show
    from rig.errors import BadInput
    from rig.recordings.alignment import AlignOptions
    from rig.util.console import console

    if not align and (align_from, align_to, align_matrix) != (None, None, False):
        raise BadInput("--align-from, --align-to and --align-matrix need --align")
    for option, value in (("--align-from", align_from), ("--align-to", align_to)):
        if value is not None and not isfinite(value):
            raise BadInput(f"{option}: input should be a finite number, got {value}")
    stretch = AlignOptions(align_from, align_to, align_matrix) if align else None
    options = Options(stretch, inject, repair_time, allow_code)
    with working("reading", not as_json):
        found = run(recorded, config, out, options)
    emit(as_json, found, lambda: show(console(), found))
