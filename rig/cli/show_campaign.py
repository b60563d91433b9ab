"""What ``rig campaign`` prints for people."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from rig.campaign.estimate import Estimate
from rig.campaign.plan import Plan
from rig.campaign.run import Progress, Report, Result
from rig.cli.show import bar, conclusion, next_steps
from rig.cli.show import flight as show_flight
from rig.flight.assembly import Flight
from rig.util.console import console, styled

MOST_ROWS: Final = 60  # of a plan on a terminal; --json has all


@contextmanager
def progress(enabled: bool) -> Iterator[Report | None]:
    """Runs done, rate, time left and failures on a terminal; nothing in a pipe."""
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[text]}"), TimeRemainingColumn())
    with bar(enabled, *columns) as shown:
        yield None if shown is None else _reporter(shown)


def _reporter(shown: Bar) -> Report:
    task = shown.add_task("runs", total=None, text="")

    def report(state: Progress) -> None:
        counts = {name: n for name, n in state.outcomes.items() if n and name != "flown"}
        trouble = "".join(f", {n} {name}" for name, n in counts.items())
        text = f"{state.flights_per_s:.1f} flights/s{trouble}"
        shown.update(task, completed=state.done, total=state.runs, text=text)

    return report


def plan_rows(planned: Plan, runs: int | None = None) -> list[dict[str, Any]]:
    """Every run of a plan: number, seed, what varies."""
    count = planned.count(runs)
    listed = (planned[number] for number in range(count))
    return [{"run": run.number, "seed": run.data["seed"], **run.choice} for run in listed]


def plan(planned: Plan, expected: Estimate) -> None:
    """The first runs of a plan and the estimate."""
    screen = console()
    rows = plan_rows(planned, min(expected.runs, MOST_ROWS))
    names = list(dict.fromkeys(name for row in rows for name in row))
    screen.table(names, ([_cell(row.get(name)) for name in names] for row in rows))
    if expected.runs > len(rows):
        screen.print(f"and {expected.runs - len(rows)} more runs")
    logs = f"{expected.logs} logs" if planned.campaign.run.logs != "failures" else "logs of failures not counted"
    screen.print(
        f"{expected.runs} runs, {expected.flight_s / 3600:.2f} h of flight: about {duration(expected.wall_s)} "
        f"on {expected.workers} workers ({expected.us_per_frame:.0f} us a frame), {size(expected.disk_bytes)}, {logs}"
    )


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)


def duration(seconds: float) -> str:
    """As a reader would say it."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def size(count: int) -> str:
    """Bytes, as a reader would say it."""
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.1f} GB"


def result(flown: Result) -> None:
    """What a call of ``run`` came to."""
    screen = console()
    trouble = "".join(f", {n} {name}" for name, n in flown.outcomes.items() if name != "flown")
    screen.print(f"runs     {flown.done} of {flown.runs} done{trouble}")
    screen.print(f"flown    {flown.flown} now in {flown.wall_s:.1f} s, {flown.flights_per_s:.1f} flights/s")
    screen.print(f"table    {flown.table_sha256}")
    screen.print(f"folder   {flown.out}", soft_wrap=True)


def status(found: dict[str, Any]) -> None:
    """How far a campaign is."""
    screen = console()
    screen.print(found["title"] or found["folder"], style="bold")
    outcomes = ", ".join(f"{n} {name}" for name, n in found["outcomes"].items()) or "none"
    screen.print(
        f"runs     {found['done']} of {found['runs']} done: {outcomes}; {found['aircraft_lost']} aircraft lost"
    )
    screen.print(f"logs     {found['logs']} kept")
    screen.print(f"table    {found['table_sha256']}")


def again(flown: Flight, number: int, same: bool | None, said: list[str]) -> None:
    """A run flown again, and its conclusion."""
    show_flight(flown)
    conclusion(said)
    says = {None: "not in the table yet", True: "the same digest as in the table", False: "NOT the table's digest"}
    console().print(f"run      {number}: {says[same]}")
    next_steps(flown.log)


def report(found: dict[str, Any], target: Path) -> None:
    """The headline of a report, the resolvers, and where the rest is."""
    screen, head = console(), found["headline"]
    screen.print(styled((found["title"], "bold"), f"  {head['done']} of {found['runs']} runs"))
    screen.print(f"{'faults':18} {_accounted(head)}")
    for name, label in _SHARES.items():
        screen.print(f"{label:18} {_share(head[name])}")
    alarms = head["false_alarms"]
    if alarms["value"] is not None:
        interval = f"{alarms['low']:.3g} to {alarms['high']:.3g}"
        counted = f"{alarms['count']} in {alarms['of']:.4g} h"
        screen.print(f"{'false alarms':18} {alarms['value']:.3g} a channel hour ({interval}), {counted}")
    for column in ("failed_with_box", "failed_by_rule"):
        if head.get(column):
            screen.print(f"{column.replace('_', ' '):18} {head[column]}: healthy channels, for a fault elsewhere")
    if found["resolvers"]:
        names = ("resolver", "pattern", "asked", "answered", "right", "wrong", "open")
        rows = ([*(str(row[name]) for name in names), _share(row["right_share"])] for row in found["resolvers"])
        screen.table((*("correct" if name == "right" else name for name in names), "correct of decided"), rows)
    screen.print(f"{'report':18} {target}", soft_wrap=True)


_SHARES: Final = {
    "detection": "detection",
    "right_isolation": "correct isolation",
    "wrong_isolation": "wrong isolation",
    "survival": "survival",
}


def _accounted(head: dict[str, Any]) -> str:
    """What became of every fault of the table, so that the counts add up; detection is of the detectable ones."""
    detectable = head["detection"]["of"]
    elsewhere = head["faults"] - head["not_executed"] - head["undetectable"] - detectable
    parts = {
        "detectable": detectable,
        "undetectable (error below the threshold)": head["undetectable"],
        "not executed": head["not_executed"],
        "on no channel (surface, reference, inertial unit)": elsewhere,
    }
    return f"{head['faults']}, counted by channel: " + ", ".join(f"{n} {what}" for what, n in parts.items() if n)


def _share(rate: dict[str, Any]) -> str:
    if rate["value"] is None:
        return "none"
    return f"{rate['count']} of {rate['of']}: {rate['value']:.4f} ({rate['low']:.4f} to {rate['high']:.4f})"


def compare(found: dict[str, Any]) -> None:
    """Paired outcomes of two campaigns."""
    screen = console()
    screen.print(f"{found['runs']} runs and {found['faults']} faults that both flew; what differs:")
    for line in found["differs"] or ["nothing"]:
        screen.print(f"  {line}", soft_wrap=True)
    rows = []
    for row in found["outcomes"]:
        pairs = row["pairs"]
        shares = (_share(row["first"]), _share(row["second"]))
        rows.append(
            (row["outcome"], *shares, f"{pairs['only_first']}", f"{pairs['only_second']}", f"{pairs['p_value']:.3g}")
        )
    screen.table(("outcome", "first", "second", "only first", "only second", "p"), rows)
