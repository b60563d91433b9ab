"""``rig reliability trials``: parse, call, print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.common import Json, emit
from rig.cli.working import working
from rig.util.progress import tell

Workers = Annotated[int, typer.Option(metavar="N", help="Processes.", min=1, max=1024)]


def trials(
    campaign: Annotated[
        str, typer.Argument(metavar="FILE|NAME", help="A campaign like `reliability`, its file or bundled name.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the counts, new or empty.", show_default=False)],
    runs: Annotated[int, typer.Option(metavar="N", help="Trials in all.", min=1, max=10**9, show_default=False)],
    seed: Annotated[int, typer.Option(metavar="N", help="Of all draws.", min=0, max=2**63 - 1)] = 0,
    good_before: Annotated[str, typer.Option(help="Good channels before the fault, with commas: 4, 3.")] = "4,3",
    workers: Workers = 2,
    set_: Annotated[list[str] | None, typer.Option("--set", help="Lay KEY=VALUE over every run.")] = None,
    as_json: Json = False,
) -> None:
    """Count what the next fault does where it leaves two good channels, in open-loop trials on a recorded truth."""
    from rig.campaign.config import find, read
    from rig.campaign.plan import Plan
    from rig.errors import BadInput
    from rig.reliability.trials_folder import fly_trials
    from rig.scenario import parse_set

    plan = Plan(read(campaign, dict(map(parse_set, set_ or []))), str(find(campaign)))
    if not all(part.strip() in ("1", "2", "3", "4") for part in good_before.split(",")):
        raise BadInput(f"--good-before {good_before}: must be numbers of channels, as in 4,3")
    good = sorted({int(part) for part in good_before.split(",")}, reverse=True)
    with working("recording the healthy flights", not as_json):
        about = fly_trials(plan, out, runs, seed, workers, good, report=lambda done, count: tell("trials", done, count))
    emit(as_json, {"out": str(out), **about}, lambda: typer.echo(f"{about['trials']} trials: {out}"))
