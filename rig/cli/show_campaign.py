"""How ``rig campaign`` prints."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from rig.cli.table import Column, field, file_size, line, rest, rough_duration, share, table
from rig.cli.working import bar

if TYPE_CHECKING:
    from rig.campaign.estimate import Estimate
    from rig.campaign.plan import Plan
    from rig.campaign.run import Progress, Report, Result

MOST_ROWS: Final = 60  # of a plan on a terminal; --json has all
_WIDTH: Final = 19  # of a report's labels
_SHARES: Final = {
    "detection": "detection",
    "right_isolation": "correct isolation",
    "wrong_isolation": "wrong isolation",
    "survival": "survival",
}
_RESOLVERS: Final = (
    *(Column("resolver", "resolver"), Column("pattern", "pattern"), Column("asked", "asked", worth=4)),
    *(Column("answered", "answered", worth=6), Column("correct", "right", worth=7), Column("wrong", "wrong", worth=8)),
    Column("open", "open", worth=5),
    Column("correct of decided", lambda row: share(row["right_share"])),
)
_SERVOS: Final = (
    *(Column("fault of an actuator", "kind"), Column("acted", "acted", worth=4)),
    *(Column("found", lambda row: share(row["found"])), Column("by", "by", worth=7)),
    *(Column("median s", "median_s", ".3f", worth=6), Column("longest s", "longest_s", ".3f", worth=5)),
)
_REQUIREMENTS: Final = (
    *(Column("requirement", "requirement"), Column("met", lambda row: share(row["met"]))),
    *(Column("least margin", "least_margin", ".3g"), Column("in run", "least_run")),
    *(Column("on", "signal", worth=5), Column("at s", "instant_s", ".2f", worth=4)),
)
_OUTCOMES: Final = (
    *(Column("outcome", "outcome"), Column("first", lambda row: share(row["first"]))),
    Column("second", lambda row: share(row["second"])),
    *(Column("only first", "pairs.only_first", worth=7), Column("only second", "pairs.only_second", worth=7)),
    Column("p", "pairs.p_value", ".3g"),
)


@contextmanager
def progress(enabled: bool) -> Iterator[Report | None]:
    """Show runs done, rate, time left and failures on a terminal; nothing in a pipe."""
    parts = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[text]}"), TimeRemainingColumn())
    with bar(enabled, *parts) as shown:
        yield None if shown is None else _reporter(shown)


def _reporter(shown: Bar) -> Report:
    task = shown.add_task("runs", total=None, text="")

    def report(state: Progress) -> None:
        text = f"{state.flights_per_s:.1f} flights/s{_trouble(state.outcomes)}"
        shown.update(task, completed=state.done, total=state.runs, text=text)

    return report


def _trouble(outcomes: dict[str, int]) -> str:
    return "".join(f", {count} {name}" for name, count in outcomes.items() if count and name != "flown")


def unflown(count: int, first_reason: str | None) -> str:
    """Return how many runs could not be flown, and why the first could not."""
    return f"{count} {'run' if count == 1 else 'runs'} could not be flown; {first_reason}"


def plan_rows(planned: Plan, runs: int | None = None) -> list[dict[str, Any]]:
    """Return every run of a plan: number, seed, what varies."""
    listed = (planned[number] for number in range(planned.count(runs)))
    return [{"run": run.number, "seed": run.data["seed"], **run.choice} for run in listed]


def plan(planned: Plan, expected: Estimate) -> None:
    """Print the first runs of a plan and the estimate."""
    rows = plan_rows(planned, min(expected.runs, MOST_ROWS))
    table(rows, [_varied(name) for name in dict.fromkeys(name for row in rows for name in row)])
    rest(expected.runs, MOST_ROWS, "and {} more runs")
    logs = f"{expected.logs} logs" if planned.campaign.run.logs != "failures" else "logs of failures not counted"
    line(
        f"{expected.runs} runs, {expected.flight_s / 3600:.2f} h of flight: about {rough_duration(expected.wall_s)} on "
        f"{expected.workers} workers ({expected.us_per_frame:.0f} us a frame), {file_size(expected.disk_bytes)}, {logs}"
    )


def _varied(name: str) -> Column:
    """Return the column of a key that varies; a run may be without it."""

    def text(row: dict[str, Any]) -> str | None:
        value = row.get(name)
        return f"{value:.6g}" if isinstance(value, float) else None if value is None else str(value)

    return Column(name, text)


def result(flown: Result) -> None:
    """Print what a call of ``run`` flew."""
    field("runs", f"{flown.done} of {flown.runs} done{_trouble(flown.outcomes)}")
    field("flown", f"{flown.flown} now in {flown.wall_s:.1f} s, {flown.flights_per_s:.1f} flights/s")
    field("table", flown.table_sha256)
    field("folder", str(flown.out))


def status(state: dict[str, Any]) -> None:
    """Print how far a campaign is."""
    line((state["title"] or state["folder"], "bold"))
    outcomes = ", ".join(f"{count} {name}" for name, count in state["outcomes"].items()) or "none"
    field("runs", f"{state['done']} of {state['runs']} done: {outcomes}; {state['aircraft_lost']} aircraft lost")
    field("logs", f"{state['logs']} kept")
    field("table", state["table_sha256"])


def report(summary: dict[str, Any], target: Path) -> None:
    """Print the headline of a report, the resolvers, and where the rest is."""
    head = summary["headline"]
    line((summary["title"], "bold"), f"  {head['done']} of {summary['runs']} runs")
    field("faults", _accounted(head), width=_WIDTH)
    for name, label in _SHARES.items():
        field(label, share(head[name]), width=_WIDTH)
    alarms = head["false_alarms"]
    if alarms["value"] is not None:
        interval = f"{alarms['low']:.3g} to {alarms['high']:.3g}"
        text = f"{alarms['value']:.3g} a channel hour ({interval}), {alarms['count']} in {alarms['of']:.4g} h"
        field("false alarms", text, width=_WIDTH)
    for column in ("failed_with_box", "failed_by_rule"):
        if head.get(column):
            field(column.replace("_", " "), f"{head[column]}: healthy channels, for a fault elsewhere", width=_WIDTH)
    if head.get("suspect_channels"):
        text = f"{head['suspect_channels']} channels in {head['suspect_runs']} runs: in many frames, never failed"
        field("suspect", text, width=_WIDTH, style="yellow")
    table(summary["resolvers"], _RESOLVERS)
    table(summary["requirements"], _REQUIREMENTS)
    table(summary["servos"], _SERVOS)
    field("report", str(target), width=_WIDTH)


def _accounted(head: dict[str, Any]) -> str:
    """Return what became of every fault of the table, so that the counts add up; detection is of detectable ones."""
    detectable = head["detection"]["of"]
    elsewhere = head["faults"] - head["not_executed"] - head["undetectable"] - detectable
    parts = {
        "detectable": detectable,
        "undetectable (error below the threshold)": head["undetectable"],
        "not executed": head["not_executed"],
        "on no channel (surface, reference, inertial unit)": elsewhere,
    }
    return f"{head['faults']}, counted by channel: " + ", ".join(f"{n} {what}" for what, n in parts.items() if n)


def compare(pairs: dict[str, Any]) -> None:
    """Print paired outcomes of two campaigns."""
    line(f"{pairs['runs']} runs and {pairs['faults']} faults that both flew; what differs:")
    for difference in pairs["differs"] or ["nothing"]:
        line(f"  {difference}")
    table(pairs["outcomes"], _OUTCOMES)
