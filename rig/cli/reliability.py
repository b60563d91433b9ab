"""``rig reliability``: from rates and measured outcomes to a probability per flight hour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Argument, Option, Typer, echo

from rig.cli.common import GROUP, Json, Seed, Sets, Workers, comma_list, emit, whole_numbers
from rig.cli.table import Column, line, table
from rig.cli.working import working
from rig.errors import BadInput
from rig.util.outputs import require_apart, require_page
from rig.util.progress import tell

if TYPE_CHECKING:
    from rig.reliability.chain import ChainResult
    from rig.reliability.margin import Margin
    from rig.reliability.rates import SignalRates
    from rig.reliability.result import Result

SCENARIO = "f16_pitch_rate_offset_in_manoeuvre"
_TRIALS: Final = (
    Column("good before", "good_before"),
    Column("not kept, at most", lambda cell: f"{cell['chance']:.3g}" if cell["chance"] < 1.0 else "any"),
    Column("trials without one", "trials", ","),
    Column("how", lambda cell: "open loop" if cell["open_loop"] else "flights", worth=7),
    Column("here, one core", lambda cell: None if cell["seconds"] is None else f"{cell['seconds']:.3g} s"),
)
reliability_app = Typer(help="From rates and measured outcomes to a probability per flight hour.", **GROUP)
RatesFile = Annotated[
    Path, Option("--rates", metavar="FILE", help="Rates with their sources, TOML.", show_default=False)
]
Hours = Annotated[float, Option(metavar="H", help="Duration of a flight, h.", min=1e-3, max=1e3)]
SignalName = Annotated[
    str | None, Option("--signal", metavar="SIGNAL", help="Of the rates file; its only one.", show_default=False)
]


@reliability_app.command()
def chain(
    file: Annotated[Path, Argument(metavar="FILE", help="Rates between states, TOML.", show_default=False)],
    as_json: Json = False,
) -> None:
    """Print the probability of every state of a chain that is given as rates."""
    from rig.reliability.chain import solve_file

    with working("solving the chain", not as_json, steps=True):
        solved = solve_file(file)
    emit(as_json, lambda: {**solved._asdict(), "death_probability": solved.of_death}, lambda: _show_chain(solved))


@reliability_app.command()
def run(
    folders: Annotated[
        list[Path],
        Argument(metavar="DIR...", help="Flown campaigns or trials, of any managers.", show_default=False),
    ],
    rates: RatesFile,
    hours: Hours = 1.0,
    channels: Annotated[str, Option(metavar="N,N...", help="Numbers of channels.")] = "1,2,3,4",
    signal: SignalName = None,
    checks: Annotated[
        int, Option(metavar="N", help="Flights between two full checks, beside one.", min=1, max=1000)
    ] = 50,
    report: Annotated[
        Path | None,
        Option("--report", "--plot", metavar="FILE", help="Write a page with the pictures, HTML.", show_default=False),
    ] = None,
    as_json: Json = False,
) -> None:
    """Print bad votes, known losses and lost aircraft per flight hour, and what decides them."""
    from rig.frame import CHANNELS
    from rig.reliability.rates import read_rates
    from rig.reliability.run import assumptions
    from rig.reliability.run import run as reckon

    require_apart({"--report": report}, [*folders, rates])
    require_page("--report", report)
    read = read_rates(rates)
    name, given = read.of(signal, str(rates))
    with working("reading the cells", not as_json):
        results = reckon(
            folders, read, name, whole_numbers("--channels", channels, 1, CHANNELS, "numbers"), hours, checks
        )
    lines = assumptions(read, name, results)
    if report is not None:
        from rig.reliability.reliability_page import write_report

        write_report(results, lines, report)
    data = lambda: {"assumptions": lines, "results": [result.as_dict() for result in results]}  # noqa: E731
    emit(as_json, data, lambda: _show_run(results, given, lines))


@reliability_app.command()
def plan(
    target: Annotated[float, Option(metavar="P", help="Probability per flight hour to be shown.", min=1e-15, max=1.0)],
    rates: RatesFile,
    hours: Hours = 1.0,
    signal: SignalName = None,
    cost: Annotated[bool, Option(help="Measure what a trial and a flight take here.")] = True,
    as_json: Json = False,
) -> None:
    """Print how many trials a target needs for each number of good channels, and what they cost here."""
    from rig.reliability.plan import needed
    from rig.reliability.rates import read_rates

    read = read_rates(rates)
    _, given = read.of(signal, str(rates))
    trials = needed(target, max(given.per_hour), hours=hours)
    seconds: list[float | None] = [None] * len(trials)
    if cost:
        from rig.reliability.plan import measure

        measured = measure()
        seconds = [measured.of(each.trials, each.open_loop) for each in trials]
    cells = [{**each._asdict(), "seconds": cost_s} for each, cost_s in zip(trials, seconds, strict=True)]
    emit(as_json, {"cells": cells}, lambda: _show_plan(cells))


@reliability_app.command()
def trials(
    campaign: Annotated[
        str, Argument(metavar="FILE|NAME", help="A campaign like `reliability`, its file or bundled name.")
    ],
    out: Annotated[Path, Option(metavar="DIR", help="Folder for the counts, new or empty.", show_default=False)],
    runs: Annotated[int, Option(metavar="N", help="Trials in all.", min=1, max=10**9, show_default=False)],
    seed: Seed = 0,
    good_before: Annotated[str, Option(metavar="N,N...", help="Good channels before the fault: 4, 3.")] = "4,3",
    workers: Workers = 2,
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Count what the next fault does where it leaves two good channels, in open-loop trials on a recorded truth."""
    from rig.campaign.config import find, read
    from rig.campaign.plan import Plan
    from rig.frame import CHANNELS
    from rig.overrides import parse_set
    from rig.reliability.trials_folder import fly_trials

    plan = Plan(read(campaign, dict(map(parse_set, sets or []))), str(find(campaign)))
    good = whole_numbers("--good-before", good_before, 1, CHANNELS, "numbers of channels")[::-1]
    with working("recording the healthy flights", not as_json):
        counts = fly_trials(
            plan, out, runs, seed, workers, good, report=lambda done, count: tell("trials", done, count)
        )
    emit(as_json, {"out": str(out), **counts}, lambda: echo(f"{counts['trials']} trials: {out}"))


@reliability_app.command()
def margin(
    signal: Annotated[str, Argument(metavar="SIGNAL", help="As in rig signals.", show_default=False)],
    threshold: Annotated[
        str | None,
        Option(metavar="X,X...", help="Thresholds, unit of the signal.", show_default="the scenario's"),
    ] = None,
    target: Annotated[
        float | None,
        Option(metavar="P", help="Find the threshold with so few an hour of a channel.", show_default=False),
    ] = None,
    scenario: Annotated[
        str, Option(metavar="FILE|NAME", help="Aircraft, sensors, manager, flight; its faults are left out.")
    ] = SCENARIO,
    persistence: Annotated[
        int | None,
        Option(metavar="N", help="Frames until a channel is failed.", min=1, max=100, show_default="the scenario's"),
    ] = None,
    sets: Sets = None,
    flights: Annotated[
        int, Option(metavar="N", help="Sets of sensor errors of a repetition.", min=50, max=10**6)
    ] = 4000,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Count how often healthy channels are failed, down to 1e-12 an hour, by splitting."""
    from rig.reliability.margin import FLOOR, Effort
    from rig.reliability.margin_target import run

    if target is not None and not FLOOR <= target <= 1.0:
        raise BadInput(f"--target: false isolations an hour of a channel, from {FLOOR:g} to 1, got {target:g}")
    given = None if threshold is None else _thresholds(threshold)
    margins, chosen = run(signal, scenario, sets or [], given, persistence, target, seed, Effort(flights=flights))
    data = {
        "signal": signal,
        "margins": [asdict(each) for each in margins],
        **({} if chosen is None else {"target": target, "chosen": asdict(chosen)}),
    }
    emit(as_json, data, lambda: _show_margins(signal, margins, target, chosen))


def _thresholds(text: str) -> list[float]:
    return comma_list("--threshold", text, "numbers above 0", float, lambda value: isfinite(value) and value > 0.0)


def _show_chain(solved: ChainResult) -> None:
    """Print the states, and the sum over those that nothing leaves."""
    death = Column("", lambda item: "death" if item[0] in solved.death else "")
    table(
        solved.probability.items(),
        (Column("state", 0), Column(f"probability after {solved.hours:g} h", 1, ".12e"), death),
    )
    line(f"death states: {solved.of_death:.12e}" if solved.death else "no death state: every state is left")


def _show_run(results: Sequence[Result], given: SignalRates, assumptions: Sequence[str]) -> None:
    """Print assumptions first, then the numbers, then what decides them."""
    from rig.reliability.result import TARGETS_EXPLAINED, TITLES, decided_by

    line("This holds if:")
    for assumption in assumptions:
        line(f"  - {assumption}", indent=4)
    line()
    line(f"{results[0].signal}: probability per flight hour, median (95 %)")
    shown = [what for what in TITLES if any(what in result.estimates for result in results)]
    table(results, _numbers(shown))
    line(TARGETS_EXPLAINED)
    line()
    decided = (Column("manager", "manager"), Column("channels", "case.channels"), Column("decided by", decided_by))
    first = (given.per_hour[0], given.beta[0], 1)  # one case of each manager and number of channels
    cases = [(result.case.per_hour, result.case.beta, result.case.flights_between_checks) for result in results]
    table([result for result, case in zip(results, cases, strict=True) if case == first], decided)


def _numbers(shown: Sequence[str]) -> list[Column]:
    """Return the columns of a result: its case, the estimates ``shown``, perfect isolation, the targets."""
    from rig.reliability.result import TARGETS, TITLES, interval

    def estimate(what: str, worth: int) -> Column:
        def text(result: Result) -> str:
            return interval(result.estimates[what]) if what in result.estimates else ""

        return Column(TITLES[what].partition(",")[0].removesuffix(" of the signal"), text, worth=worth)

    return [
        *(Column("manager", "manager"), Column("channels", "case.channels"), Column("per hour", "case.per_hour", "g")),
        Column("common", lambda result: f"{100 * result.case.beta:g} %"),
        Column("checks", _checks),
        *(estimate(what, 8 - i) for i, what in enumerate(shown)),
        Column("perfect", "perfect", ".2e", worth=5),
        *(Column(name, f"standing.{name}") for name in TARGETS),
    ]


def _checks(result: Result) -> str:
    between = result.case.flights_between_checks
    return f"every {between}" if between > 1 else "each flight"


def _show_plan(cells: Sequence[dict[str, Any]]) -> None:
    """Print a row for each number of good channels."""
    table(cells, _TRIALS)


def _show_margins(signal: str, margins: Sequence[Margin], target: float | None, chosen: Margin | None) -> None:
    """Print a row for each threshold; the one that meets the target last."""
    line(f"{signal}: false isolations of a healthy channel, an hour (95 %)")
    shown = (
        *(Column("threshold", "threshold", ".5g"), Column("an hour", _per_hour)),
        Column("in the first frames", lambda margin: f"{margin.at_start:.1e} a flight" if _counted(margin) else ""),
        *(Column("sets of errors", _sets), Column("repetitions", lambda m: str(m.repetitions) if _counted(m) else "")),
    )
    table([*margins, *([] if chosen is None else [chosen])], shown)
    for each in margins:
        if each.few is not None:
            line(f"threshold {each.threshold:.5g}: the bound alone: {each.few}; --flights N draws more")
    if chosen is not None:
        line(f"at most {target:g} an hour: threshold {chosen.threshold:.5g}")


def _counted(margin: Margin) -> bool:
    return margin.per_hour is not None


def _per_hour(margin: Margin) -> str:
    if margin.per_hour is None:
        return f"at most {margin.high:.1e}"
    return f"{margin.per_hour:.3e} ({margin.low:.3e} to {margin.high:.3e})"


def _sets(margin: Margin) -> str:
    cut = f", {margin.cut} excursions cut off" if margin.cut else ""
    return f"{min(margin.sets)} to {max(margin.sets)}{cut}" if _counted(margin) else ""
