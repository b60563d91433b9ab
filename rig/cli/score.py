"""``rig score``: parse, call, print."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.common import AllowCode, Json, UnitFile, emit
from rig.cli.working import working


def score(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="The log of a flight.", show_default=False)],
    no_twin: Annotated[
        bool, typer.Option("--no-twin", help="Do not fly the fault-free reference run: no transients.")
    ] = False,
    transient_load_factor: Annotated[
        float, typer.Option(metavar="X", help="Allowed of a failure transient, g.", min=1e-9)
    ] = 0.5,
    transient_pitch_rate_rad_s: Annotated[
        float, typer.Option(help="The same of body rates, rad/s.", min=1e-9, show_default="10 deg/s")
    ] = radians(10.0),
    transient_window_s: Annotated[
        float, typer.Option(metavar="X", help="Time after each onset that is scored.", min=1e-9)
    ] = 2.0,
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Score a flight against the truth: what was detected, missed and wrong, and how it flew."""
    from rig.assess.of_log import score_log
    from rig.assess.record import Yardstick
    from rig.cli.show_score import show
    from rig.settings import build
    from rig.unit.unit import running

    limits = {
        "load_factor": transient_load_factor,
        "pitch_rate_rad_s": transient_pitch_rate_rad_s,
        "window_s": transient_window_s,
    }
    with working("reading the log", not as_json), running(unit) as tested:
        scored = score_log(log, build(Yardstick, limits, "--transient"), not no_twin, allow_code, tested)
    emit(as_json, scored.as_dict, lambda: show(scored))
