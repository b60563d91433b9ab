"""``rig campaign``: plan, fly, report and compare campaigns of many flights."""

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
    emit,
    opt,
    require_ended,
    resumes,
)
from rig.cli.fly import show_flight
from rig.cli.working import working
from rig.core.outputs import require_apart, require_page

app = Typer(**GROUP)

File = Annotated[
    str, arg("FILE|NAME", "Campaign file, or name of a bundled campaign.", autocompletion=complete.campaigns)
]
Dir = Annotated[Path, arg("DIR", "Output folder of a campaign.")]
Runs = Annotated[int | None, opt("N", "Number of runs, from the first.", show_default="all")]
UntilWidth = Annotated[
    str | None, opt("half-width=H", "Stop when the 95 % interval of the proportion of --of is this narrow.", "--until")
]
Of = Annotated[str | None, opt("COLUMN", "Yes/no result of a flight, e.g. detected, survived, or a requirement.")]
By = Annotated[str | None, opt("COLUMN", "A proportion for each value, e.g. signal.", show_default="one of all")]


@app.command()
def plan(
    file: File,
    sets: Sets = None,
    runs: Runs = None,
    until: UntilWidth = None,
    proportion: Annotated[
        float, opt("P", "Proportion that is expected, for the number of flights of --until.", min=0.0, max=1.0)
    ] = 0.5,
    unit: UnitFile = None,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """List the runs of a campaign, estimate their time and disk space, and print the identity of its results.

    The estimate flies one run, which is not kept.
    """
    from rig.studies.campaign.estimate import estimate
    from rig.studies.campaign.folder import Folder
    from rig.studies.campaign.plan import read_plan
    from rig.studies.campaign.until import flights_needed
    from rig.unit.unit_file import read_unit

    planned, tested = read_plan(file, sets, allow_code), unit and read_unit(unit)
    planned.check()
    needed = until and flights_needed(until, proportion, planned, runs)
    expected, folder = estimate(planned, runs, tested), Folder(Path(), planned, tested)
    own = {"identity": folder.mark, "unit": folder.about.get("unit"), **({"until": needed} if needed else {})}
    listed = lambda: {**asdict(expected), **own, "list": show.plan_rows(planned, runs)}  # noqa: E731 # read once
    emit(as_json, listed, lambda: show.plan(planned, expected, folder, needed or None))


@app.command()
def run(
    file: File,
    out: Annotated[Path, resumes("campaign")],
    workers: Annotated[
        int | None, opt("N", "Number of processes.", min=1, max=1024, show_default="as in the file")
    ] = None,
    runs: Runs = None,
    scheduler: Scheduler = None,
    until: UntilWidth = None,
    of: Of = None,
    by: By = None,
    logs: Annotated[
        str | None, opt("WHICH", "Logs to keep: all, failures, none or sample:N.", show_default="as in the file")
    ] = None,
    sets: Sets = None,
    unit: UnitFile = None,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """Fly the runs of a campaign that are not done yet, and write one table of results."""
    from rig.studies.campaign.pool import get_ready

    if scheduler is None:
        get_ready()  # beside what follows, which takes a second to be imported and read
    from rig.studies.campaign.plan import read_plan
    from rig.studies.campaign.run_campaign import run as fly
    from rig.studies.campaign.until import read_until
    from rig.unit.unit_file import read_unit

    planned, tested = read_plan(file, sets, allow_code), unit and read_unit(unit)
    wanted = read_until(until, of, by, planned, planned.count(runs))
    asked = {
        **{"runs": runs, "workers": workers, "scheduler": scheduler, "logs": logs},
        **{"unit": tested, "until": wanted},
    }
    with show.progress(enabled=not as_json) as report:
        result = fly(planned, out, report=report, **asked)
    emit(as_json, result.as_dict, lambda: show.result(result))
    require_ended(result, f"{result.done} of {result.runs} runs done")


@app.command()
def status(folder: Dir, as_json: Json = False) -> None:
    """Print how many runs of a campaign are done, which manager votes, and the outcomes."""
    from rig.studies.campaign.folder import not_flown, open_folder
    from rig.studies.campaign.until import kept

    held = open_folder(folder)
    state = {
        **held.status(),
        "until": kept(held),
        "by": held.by,
        "reads": held.unit_reads,
        **not_flown(held.tables["runs"]),
    }
    emit(as_json, state, lambda: show.status(state))


@app.command()
def fly(
    folder: Dir,
    run: Annotated[int, opt("N", "Number of the run, as in the table.", min=0)],
    out: Logs = Path("logs"),
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Fly one run of a campaign again, write its full log, and compare its digest with the table.

    Exit code 1: the digests differ.
    """
    from rig.studies.campaign.folder import open_folder
    from rig.studies.campaign.run_campaign import again
    from rig.unit.unit_file import read_unit

    flight, digest = again(open_folder(folder, allow_code), run, out, unit and read_unit(unit))
    same = None if digest is None else digest == flight.digest
    told = {"run": run, "table_digest": digest, "same": same, "conclusion": [*(flight.conclusion or ())]}
    data = {**flight.summary(), **told}
    notes = {None: "not in the table yet", True: "same digest as in the table", False: "digest DIFFERS from the table"}
    emit(as_json, data, lambda: show_flight(flight, f"{run}: {notes[same]}"))
    if same is False:
        raise Exit(1)


@app.command()
def report(
    folder: Dir,
    out: Annotated[Path | None, opt("FILE", "Page to write, .html.", show_default="DIR/report.html")] = None,
    as_json: Json = False,
) -> None:
    """Write the report of a campaign as one HTML page that opens offline; --json prints its figures."""
    from rig.studies.campaign.campaign_page import report as write
    from rig.studies.campaign.folder import open_folder

    target = out or folder / "report.html"
    require_apart({"--out": target}, [folder])
    require_page("--out", out)
    summary = write(open_folder(folder), target)
    emit(as_json, {"report": str(target), **summary}, lambda: show.report(summary, target))


@app.command()
def sensitivity(
    folder: Dir,
    of: Annotated[str, opt("COLUMN", "Number of a flight, e.g. delay_s, or a requirement: its least robustness.")],
    out: Annotated[Path | None, opt("FILE", "Page to write, .html.", show_default="DIR/sensitivity.html")] = None,
    seed: Annotated[int, opt("N", "Seed of the resamples and of the dummy input.", min=0)] = 0,
    as_json: Json = False,
) -> None:
    """Rank what a campaign varied by its effect on a result, beside what noise alone would show."""
    from rig.studies.campaign.drivers import sensitivity as rank
    from rig.studies.campaign.folder import open_folder
    from rig.studies.campaign.sensitivity_page import write

    target = out or folder / "sensitivity.html"
    require_apart({"--out": target}, [folder])
    require_page("--out", out)
    with working(of, enabled=not as_json, compiles=False):
        found = rank(open_folder(folder), of, seed)
    write(target, found)
    emit(as_json, {"report": str(target), **found}, lambda: show.sensitivity(found, target))


@app.command()
def schema() -> None:
    """Print the JSON schema of campaign files, for an editor."""
    echo(of_file("campaign"))


@app.command()
def compare(
    first: Annotated[Path, arg("DIR_A", "Output folder of the first campaign.")],
    second: Annotated[Path, arg("DIR_B", "Output folder of the second campaign.")],
    as_json: Json = False,
) -> None:
    """Compare two campaigns of the same seeds run by run, with exact paired tests (McNemar)."""
    from rig.studies.campaign.campaign_summary import compare as pair
    from rig.studies.campaign.folder import open_folder

    pairs = pair(open_folder(first), open_folder(second))
    emit(as_json, pairs, lambda: show.compare(pairs))
