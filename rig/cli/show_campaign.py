"""Printing of ``rig campaign``."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from rig.cli.common import unflown
from rig.cli.printing import MOST_LINES, field, file_size, line, rest, rough_duration, share, table
from rig.cli.working import bar
from rig.core.column import COUNT, LEVEL, Column
from rig.core.console import Screen

if TYPE_CHECKING:
    from rig.studies.campaign.estimate import Estimate
    from rig.studies.campaign.folder import Folder
    from rig.studies.campaign.plan import Plan
    from rig.studies.campaign.run_campaign import Progress, Report, Result

_APART_S: Final = 2.0  # two lines in a pipe
MOST_ROWS: Final = 60  # of a plan on a terminal; --json has all
_WIDTH: Final = 19  # of a report's labels
_SHARES: Final = {
    "detection": "detection",
    "correct_isolation": "correct isolation",
    "wrong_isolation": "wrong isolation",
    "survival": "survival",
}
_OUTCOMES: Final = (
    *(Column("outcome"), Column("first", format=COUNT), Column("second", format=COUNT)),
    *(Column("only first", "pairs.only_first"), Column("only second", "pairs.only_second")),
    Column("p", "pairs.p_value", ".3g"),
    Column("first less second", lambda row: _interval(row["difference"], "{:+.3f}"), worth=7),
    Column("first 95 %", lambda row: _interval(row["first"]), worth=5),
    Column("second 95 %", lambda row: _interval(row["second"]), worth=5),
)
_DELAYS: Final = (
    *(Column("delay", lambda row: _DELAY_NAMES[row["delay"]]), Column("faults")),
    *(Column("sooner first"), Column("sooner second")),
    *(Column("first", "first_median_s", ".3f", unit="s"), Column("second", "second_median_s", ".3f", unit="s")),
    Column("first less second, s", lambda row: _interval(row["difference_s"], "{:+.3f}")),
)
_DELAY_NAMES: Final = {"delay_from_onset_s": "from the onset", "delay_from_exceeded_s": "from the threshold"}
_DETECTABLE: Final = (
    Column("smallest detectable", lambda row: f"{row['kind']} of {row['signal']}"),
    *(Column("of", lambda row: row.get("of"), worth=8), Column("acted", worth=5), Column("found", "detected", worth=6)),
    *(Column(title, lambda row, i=i: _smallest(row, i)) for i, title in enumerate(("50 %", "99 %"))),
)


@contextmanager
def progress(enabled: bool) -> Iterator[Report | None]:
    """Show runs done, rate, time left and failures: a bar on a terminal, at most ten lines in a pipe."""
    parts = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[text]}"), TimeRemainingColumn())
    with bar(enabled, *parts) as shown:
        yield _reporter(shown) if shown is not None else _Lines().report if enabled else None


def _reporter(shown: Bar) -> Report:
    task = shown.add_task("runs", total=None, text="")

    def report(state: Progress) -> None:
        text = f"{state.flights_per_s:.1f} flights/s{_trouble(state.outcomes)}"
        shown.update(task, completed=state.done + state.not_flown, total=state.runs, text=text)

    return report


class _Lines:
    """Lines on standard error: after the first batch, then at most one per tenth of the runs."""

    def __init__(self) -> None:
        self._next, self._due = 0, 0.0

    def report(self, state: Progress) -> None:
        """Print how far the campaign is, where a line is due."""
        told, now = state.flown + state.not_flown, time.monotonic()
        if told == 0 or told < self._next or now < self._due:
            return
        self._next, self._due = told + max(1, state.runs // 10), now + _APART_S
        handled = state.done + state.not_flown
        left = (
            f", about {rough_duration((state.runs - handled) / state.told_per_s)} left" if handled < state.runs else ""
        )
        text = f"{handled} of {state.runs} runs{_trouble(state.outcomes)}, {state.told_per_s:.1f} per second{left}"
        Screen(stderr=True).print(text, soft_wrap=True)


def _trouble(outcomes: dict[str, int]) -> str:
    return "".join(f", {count} {name}" for name, count in outcomes.items() if count and name != "flown")


def plan_rows(planned: Plan, runs: int | None = None) -> list[dict[str, Any]]:
    """Return every run of a plan: number, seed, varied keys."""
    listed = (planned[number] for number in range(planned.count(runs)))
    return [{"run": run.number, "seed": run.data["seed"], **run.choice} for run in listed]


def plan(planned: Plan, expected: Estimate, folder: Folder, needed: dict[str, Any] | None) -> None:
    """Print the first runs of a plan, the estimate, unit and identity.

    folder : of the plan, on no disk; needed : the flights of ``--until``
    """
    from rig.unit.unit_facts import what_it_reads

    rows = plan_rows(planned, min(expected.runs, MOST_ROWS))
    names = dict.fromkeys(name for row in rows for name in row)  # of what varies: a run may be without it
    table(rows, [Column(name, lambda row, name=name: row.get(name), LEVEL) for name in names])
    rest(expected.runs, MOST_ROWS, "and {} more runs")
    logs = f"{expected.logs} logs" if planned.campaign.run.logs != "failures" else "logs of failures not included"
    line(
        f"{expected.runs} runs, {expected.flight_s / 3600:.2f} h of flight: about {rough_duration(expected.wall_s)} on "
        f"{expected.workers} workers ({expected.us_per_frame:.0f} us/frame), {file_size(expected.disk_bytes)}, {logs}"
    )
    if needed is not None:
        field("until", _needed(needed))
    if folder.unit is not None:
        read = what_it_reads(folder.unit.about())
        field("unit", f"{folder.unit.name} {folder.unit.build()[:12]}".rstrip() + (f": {read}" if read else ""))
    field("identity", folder.mark)


def _needed(needed: dict[str, Any]) -> str:
    """Return how many flights a half-width takes."""
    text = (
        f"half-width {needed['half_width']:g}: {needed['flights']} flights of each group at a proportion of "
        f"{needed['proportion']:g}"
    )
    if needed["flights"] < needed["worst"]:
        text += f", {needed['worst']} at 0.5"
    text += f"; {needed['fixed']} if their number were chosen before ({needed['price']:.2f} times as many)"
    return text + ("; more than the runs of the campaign" if needed["flights"] > needed["runs"] else "")


def result(flown: Result) -> None:
    """Print the result of a call of ``run``."""
    field("runs", f"{flown.done} of {flown.runs} done{_trouble(flown.outcomes)}")
    until(flown.until)
    field("flown", f"{flown.flown} now in {flown.wall_s:.1f} s, {flown.flights_per_s:.1f} flights/s")
    field("table", flown.table_sha256)
    field("folder", str(flown.out))


def until(state: dict[str, Any] | None) -> None:
    """Print where a campaign stands that stops when a proportion is known: the words, and the intervals."""
    if state is None:
        return
    from rig.studies.campaign.campaign_summary import TABLES, until_words

    field("until", until_words(state))
    table(state["groups"], TABLES["until"], MOST_LINES)


def status(state: dict[str, Any]) -> None:
    """Print how many runs of a campaign are done."""
    line((state["title"] or state["folder"], "bold"))
    outcomes = ", ".join(f"{count} {name}" for name, count in state["outcomes"].items()) or "none"
    field("runs", f"{state['done']} of {state['runs']} done: {outcomes}; {state['aircraft_lost']} aircraft lost")
    if state.get("by"):
        field("voted by", state["by"])
    if state.get("reads"):
        field("reads", state["reads"])
    if state.get("not_flown"):
        field("not flown", unflown(state["not_flown"], state["first_reason"]), style="red")
    until(state.get("until"))
    field("logs", f"{state['logs']} kept")
    field("identity", state["identity"])
    field("table", state["table_sha256"])


def report(summary: dict[str, Any], target: Path) -> None:
    """Print the headline of a report, the tie-break rules, and the file of the report."""
    from rig.studies.campaign.campaign_summary import TABLES

    head = summary["headline"]
    line((summary["title"], "bold"), f"  {head['done']} of {summary['runs']} runs")
    if summary.get("by"):
        field("voted by", summary["by"], width=_WIDTH)
    if summary.get("reads"):
        field("the unit reads", summary["reads"], width=_WIDTH)
    if head.get("not_flown"):
        field("not flown", unflown(head["not_flown"], head["first_reason"]), width=_WIDTH, style="red")
    if summary.get("by_name"):
        text = f"{', '.join(summary['by_name'])}: the figures of all runs mix different populations, see below"
        field("vary by name", text, width=_WIDTH)
    field("faults", _accounted(head), width=_WIDTH)
    for name, label in _SHARES.items():
        field(label, share(head[name]), width=_WIDTH)
    alarms = head["false_alarms"]
    if alarms["value"] is not None:
        interval = f"{alarms['low']:.3g} to {alarms['high']:.3g}"
        text = f"{alarms['value']:.3g} per channel hour ({interval}), {alarms['count']} in {alarms['of']:.4g} h"
        field("false alarms", text, width=_WIDTH)
    for column in ("failed_with_box", "failed_by_rule"):
        if head.get(column):
            field(column.replace("_", " "), f"{head[column]} healthy channels, for a fault elsewhere", width=_WIDTH)
    if head.get("suspect_channels"):
        text = (
            f"{head['suspect_channels']} channels in {head['suspect_runs']} runs: suspect in many frames, not isolated"
        )
        field("suspect", text, width=_WIDTH, style="yellow")
    until(summary.get("until"))
    table(summary.get("by_varied", ()), TABLES["by_varied"], MOST_LINES)
    table(summary.get("detectable", ()), _DETECTABLE, MOST_LINES)
    for name in ("tie_break", "requirements", "servos"):
        table(summary[name], TABLES[name])
    field("report", str(target), width=_WIDTH)


def sensitivity(found: dict[str, Any], target: Path) -> None:
    """Print the ranked inputs, the flights and inputs that are left out, and the file of the page."""
    from rig.studies.campaign.drivers import COLUMNS

    line((f"sensitivity of {found['of']}", "bold"), f"  {found['rows']} of {found['flights']} flights")
    if found["left_out"]:
        line(f"left out: {found['left_out']} flights without {found['of']}")
    if found["left_out_inputs"]:
        line(f"not used, of one value or too many names: {', '.join(found['left_out_inputs'])}")
    table(found["inputs"], COLUMNS)
    field("report", str(target), width=_WIDTH)


def _accounted(head: dict[str, Any]) -> str:
    """Return the outcomes of all faults of the table, which add up; detection counts detectable faults only."""
    detectable = head["detection"]["of"]
    elsewhere = head["faults"] - head["not_executed"] - head["undetectable"] - detectable
    parts = {
        "detectable": detectable,
        "undetectable (error below the isolation threshold)": head["undetectable"],
        "not executed": head["not_executed"],
        "on no channel (surface, reference, inertial unit)": elsewhere,
    }
    return f"{head['faults']}, counted by channel: " + ", ".join(f"{n} {what}" for what, n in parts.items() if n)


def compare(pairs: dict[str, Any]) -> None:
    """Print the managers, the differences, and the paired outcomes of two campaigns."""
    first, second = pairs["by"]["first"], pairs["by"]["second"]
    line(f"voted by {first}" + (", in both" if first == second else f"; in the second by {second}"))
    line(f"{pairs['runs']} runs and {pairs['faults']} faults are in both campaigns; differences:")
    for difference in pairs["differs"] or ["nothing"]:
        line(f"  {difference}")
    detectable = pairs["detectable"]
    line(
        f"faults: the {pairs['faults']} that acted in both; detectable (error above the isolation threshold): "
        f"{detectable['first']} in the first, {detectable['second']} in the second, {detectable['both']} in both"
    )
    table(pairs["outcomes"], _OUTCOMES)
    table([row for row in pairs["delays"] if row["faults"]], _DELAYS)


def _interval(rate: dict[str, Any], number: str = "") -> str | None:
    """Return an interval; ``number``, a format: the value with its interval."""
    if rate["value"] is None or rate["low"] is None:
        return None if rate["value"] is None or not number else number.format(rate["value"])
    form = number or "{:.3f}"
    interval = f"{form.format(rate['low'])} to {form.format(rate['high'])}"
    return f"{number.format(rate['value'])} ({interval})" if number else interval


def _smallest(row: dict[str, Any], i: int) -> str:
    """Return the smallest magnitude with its interval, as in the report; words if there is no fit."""
    if row["fit"] is None:
        return "all detected" if row["detected"] else "none detected"
    from rig.studies.campaign.campaign_page import magnitude_shown, magnitude_unit

    found, place = row["fit"]["magnitudes"][i], (row["signal"], row["kind"])
    low, high = (magnitude_shown(found[end], *place) or "?" for end in ("low", "high"))
    return f"{magnitude_shown(found['value'], *place)} ({low} to {high}) {magnitude_unit(*place)}".rstrip()
