"""``rig campaign``: fly many flights of one plan, and report them."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from typer import Exit, Typer, echo

from rig.cli import complete
from rig.cli import show_campaign as show
from rig.cli.catalogue import of_file
from rig.cli.common import (
    GROUP,
    AllowCode,
    AllowCodeOrSet,
    Json,
    Logs,
    Scheduler,
    Sets,
    UnitFile,
    arg,
    begun,
    emit,
    opt,
    require_ended,
)
from rig.cli.fly import show_flight
from rig.core.outputs import require_apart, require_page

app = Typer(help="Fly many flights of one plan, and say what they show.", **GROUP)

File = Annotated[
    str, arg("FILE|NAME", "A campaign file or the name of a bundled one.", autocompletion=complete.campaigns)
]
Dir = Annotated[Path, arg("DIR", "A campaign's output folder.")]
Runs = Annotated[int | None, opt("N", "The first N runs only.", show_default="all")]


@app.command()
def plan(
    file: File, sets: Sets = None, runs: Runs = None, allow_code: AllowCodeOrSet = False, as_json: Json = False
) -> None:
    """List the runs before flying them, with an estimate of time and disk."""
    from rig.studies.campaign.estimate import estimate
    from rig.studies.campaign.plan import read_plan

    planned = read_plan(file, sets, allow_code)
    planned.check()
    expected = estimate(planned, runs)
    listed = lambda: {**asdict(expected), "list": show.plan_rows(planned, runs)}  # noqa: E731 # read once
    emit(as_json, listed, lambda: show.plan(planned, expected))


@app.command()
def run(
    file: File,
    out: Annotated[Path, begun("Output folder")],
    workers: Annotated[int | None, opt("N", "Processes.", min=1, max=1024, show_default="the file's")] = None,
    runs: Runs = None,
    scheduler: Scheduler = None,
    logs: Annotated[
        str | None, opt("WHICH", "Logs to keep: all, failures, none, sample:N.", show_default="the file's")
    ] = None,
    sets: Sets = None,
    unit: UnitFile = None,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """Fly the runs of a campaign that are not done yet: begin it, or go on."""
    from rig.studies.campaign.pool import get_ready

    if scheduler is None:
        get_ready()  # beside what follows, which takes a second to be imported and read
    from rig.studies.campaign.plan import read_plan
    from rig.studies.campaign.run_campaign import run as fly
    from rig.unit.unit_file import read_unit

    planned, tested = read_plan(file, sets, allow_code), unit and read_unit(unit)
    asked = {"runs": runs, "workers": workers, "scheduler": scheduler, "logs": logs, "unit": tested}
    with show.progress(enabled=not as_json) as report:
        result = fly(planned, out, report=report, **asked)
    emit(as_json, result.as_dict, lambda: show.result(result))
    require_ended(result, f"{result.done} of {result.runs} runs done")


@app.command()
def status(folder: Dir, as_json: Json = False) -> None:
    """Print how far a campaign is, who votes, and the results of its runs."""
    from rig.studies.campaign.folder import not_flown, open_folder

    held = open_folder(folder)
    state = {**held.status(), "by": held.by, **not_flown(held.tables["runs"])}
    emit(as_json, state, lambda: show.status(state))


@app.command()
def fly(
    folder: Dir,
    run: Annotated[int, opt("N", "The run's number in the table, from 0.", min=0)],
    out: Logs = Path("logs"),
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Fly one run of a campaign again, with its full log, and compare its digest with the table's."""
    from rig.studies.campaign.folder import open_folder
    from rig.studies.campaign.run_campaign import again
    from rig.unit.unit_file import read_unit

    flight, digest = again(open_folder(folder, allow_code), run, out, unit and read_unit(unit))
    same = None if digest is None else digest == flight.digest
    told = {"run": run, "table_digest": digest, "same": same, "conclusion": [*(flight.conclusion or ())]}
    data = {**flight.summary(), **told}
    notes = {None: "not in the table yet", True: "the same digest as in the table", False: "NOT the table's digest"}
    emit(as_json, data, lambda: show_flight(flight, f"{run}: {notes[same]}"))
    if same is False:
        raise Exit(1)


@app.command()
def report(
    folder: Dir,
    out: Annotated[Path | None, opt("FILE", "The file to write.", show_default="DIR/report.html")] = None,
    as_json: Json = False,
) -> None:
    """Write the report: one HTML file that opens offline; with --json its figures."""
    from rig.studies.campaign.campaign_page import report as write
    from rig.studies.campaign.folder import open_folder

    target = out or folder / "report.html"
    require_apart({"--out": target}, [folder])
    require_page("--out", out)
    summary = write(open_folder(folder), target)
    emit(as_json, {"report": str(target), **summary}, lambda: show.report(summary, target))


@app.command()
def schema() -> None:
    """Print the JSON schema of campaign files, for editors."""
    echo(of_file("campaign"))


@app.command()
def compare(first: Dir, second: Dir, as_json: Json = False) -> None:
    """Compare two campaigns on the same seeds, run by run: exact paired tests (McNemar)."""
    from rig.studies.campaign.campaign_summary import compare as pair
    from rig.studies.campaign.folder import open_folder

    pairs = pair(open_folder(first), open_folder(second))
    emit(as_json, pairs, lambda: show.compare(pairs))
