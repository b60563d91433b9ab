"""``rig reliability``: from rates and measured outcomes to a probability per flight hour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from typer import Option, Typer, echo

from rig.cli.common import GROUP, Json, Seed, Sets, Workers, arg, comma_list, emit, opt, whole_numbers
from rig.cli.printing import line, table
from rig.cli.working import working
from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.outputs import require_apart, require_page

if TYPE_CHECKING:
    from rig.studies.reliability.chain import ChainResult
    from rig.studies.reliability.false_isolations import FalseIsolationRate
    from rig.studies.reliability.per_hour import Result
    from rig.studies.reliability.rates_file import SignalRates

SCENARIO = "f16_pitch_rate_offset_in_manoeuvre"
_TRIALS: Final = (
    Column("good before"),
    Column("not kept, at most", lambda cell: f"{cell['chance']:.3g}" if cell["chance"] < 1.0 else "any"),
    Column("trials without one", "trials", ","),
    Column("how", lambda cell: "open loop" if cell["open_loop"] else "flights", worth=7),
    Column("here, one core", lambda cell: None if cell["seconds"] is None else f"{cell['seconds']:.3g} s"),
)
reliability_app = Typer(help="From rates and measured outcomes to a probability per flight hour.", **GROUP)
RatesFile = Annotated[Path, opt("FILE", "Rates with their sources, TOML.", "--rates")]
Hours = Annotated[float, opt("H", "Duration of a flight, h.", min=0.001, max=1000.0)]
SignalName = Annotated[str | None, opt("SIGNAL", "Of the rates file; its only one.", "--signal")]


@reliability_app.command()
def chain(
    file: Annotated[Path, arg("FILE", "Rates between states, TOML.")],
    as_json: Json = False,
) -> None:
    """Print the probability of every state of a chain that is given as rates."""
    from rig.studies.reliability.chain import solve_file

    with working("solving the chain", not as_json, steps=True):
        solved = solve_file(file)
    emit(as_json, lambda: {**solved._asdict(), "death_probability": solved.of_death}, lambda: _show_chain(solved))


@reliability_app.command()
def run(
    folders: Annotated[list[Path], arg("DIR...", "Flown campaigns or trials, of any managers.")],
    rates: RatesFile,
    hours: Hours = 1.0,
    channels: Annotated[str, opt("N,N...", "Numbers of channels.")] = "1,2,3,4",
    signal: SignalName = None,
    checks: Annotated[int, opt("N", "Flights between two full checks, beside one.", min=1, max=1000)] = 50,
    report: Annotated[Path | None, opt("FILE", "Write a page with the pictures, HTML.", "--report", "--plot")] = None,
    as_json: Json = False,
) -> None:
    """Print undetected errors, annunciated losses and lost aircraft per flight hour, and what decides them."""
    from rig.core.frame import CHANNELS
    from rig.studies.reliability.compute_results import assumptions
    from rig.studies.reliability.compute_results import run as reckon
    from rig.studies.reliability.rates_file import read_rates

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
        from rig.studies.reliability.reliability_page import write_report

        write_report(results, lines, report)
    data = lambda: {"assumptions": lines, "results": [result.as_dict() for result in results]}  # noqa: E731
    emit(as_json, data, lambda: _show_run(results, given, lines))


@reliability_app.command()
def plan(
    target: Annotated[float, opt("P", "Probability per flight hour to be shown.", min=1e-15, max=1.0)],
    rates: RatesFile,
    hours: Hours = 1.0,
    signal: SignalName = None,
    cost: Annotated[bool, Option(help="Measure what a trial and a flight take here.")] = True,
    as_json: Json = False,
) -> None:
    """Print how many trials a target needs for each number of good channels, and what they cost here."""
    from rig.studies.reliability.rates_file import read_rates
    from rig.studies.reliability.sample_size import measure, needed

    read = read_rates(rates)
    _, given = read.of(signal, str(rates))
    trials = needed(target, max(given.per_hour), hours=hours)
    here = measure() if cost else None
    cells = [{**each._asdict(), "seconds": here and here.of(each.trials, each.open_loop)} for each in trials]
    emit(as_json, {"cells": cells}, lambda: table(cells, _TRIALS))


@reliability_app.command()
def trials(
    campaign: Annotated[str, arg("FILE|NAME", "A campaign like `reliability`, its file or bundled name.")],
    out: Annotated[Path, opt("DIR", "Folder for the counts, new or empty.")],
    runs: Annotated[int, opt("N", "Trials in all.", min=1, max=10**9)],
    seed: Seed = 0,
    good_before: Annotated[str, opt("N,N...", "Good channels before the fault: 4, 3.")] = "4,3",
    workers: Workers = 2,
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Count what the next fault does where it leaves two good channels, in open-loop trials on a recorded truth."""
    from rig.core.frame import CHANNELS
    from rig.studies.campaign.plan import read_plan
    from rig.studies.reliability.trials_folder import fly_trials

    plan = read_plan(campaign, sets)
    good = whole_numbers("--good-before", good_before, 1, CHANNELS, "numbers of channels")[::-1]
    with working("recording the healthy flights", not as_json):
        counts = fly_trials(plan, out, runs, seed, workers, good)
    emit(as_json, {"out": str(out), **counts}, lambda: echo(f"{counts['trials']} trials: {out}"))


@reliability_app.command()
def false_isolations(
    signal: Annotated[str, arg("SIGNAL", "As in rig signals.")],
    threshold: Annotated[
        str | None, opt("X,X...", "Thresholds, unit of the signal.", show_default="the scenario's")
    ] = None,
    target: Annotated[float | None, opt("P", "Find the threshold with so few an hour of a channel.")] = None,
    scenario: Annotated[
        str, opt("FILE|NAME", "Aircraft, sensors, manager, flight; its faults are left out.")
    ] = SCENARIO,
    persistence: Annotated[
        int | None, opt("N", "Frames until a channel is failed.", min=1, max=100, show_default="the scenario's")
    ] = None,
    sets: Sets = None,
    flights: Annotated[int, opt("N", "Sets of sensor errors of a repetition.", min=50, max=10**6)] = 4000,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Count how often healthy channels are failed, down to 1e-12 an hour, by splitting."""
    from rig.studies.reliability.false_isolation_target import run
    from rig.studies.reliability.false_isolations import FLOOR, Effort

    if target is not None and not FLOOR <= target <= 1.0:
        raise BadInput(f"--target: false isolations an hour of a channel, from {FLOOR:g} to 1, got {target:g}")
    above_0 = "--threshold", threshold or "", "numbers above 0", float, lambda value: isfinite(value) and value > 0.0
    given = None if threshold is None else comma_list(*above_0)
    rates, chosen = run(signal, scenario, sets or [], given, persistence, target, seed, Effort(flights=flights))
    data = {"signal": signal, "false_isolations": [asdict(each) for each in rates]}
    data |= {} if chosen is None else {"target": target, "chosen": asdict(chosen)}
    emit(as_json, data, lambda: _show_rates(signal, rates, target, chosen))


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
    from rig.studies.reliability.per_hour import DECIDED, TARGETS_EXPLAINED, numbers

    line("This holds if:")
    for assumption in assumptions:
        line(f"  - {assumption}", indent=4)
    line()
    line(f"{results[0].signal}: probability per flight hour, median (95 %)")
    table(results, numbers(results))
    line(TARGETS_EXPLAINED)
    line()
    first = (given.per_hour[0], given.beta[0], 1)  # one case of each manager and number of channels
    cases = [(result.case.per_hour, result.case.beta, result.case.flights_between_checks) for result in results]
    table([result for result, case in zip(results, cases, strict=True) if case == first], DECIDED)


def _show_rates(
    signal: str, rates: Sequence[FalseIsolationRate], target: float | None, chosen: FalseIsolationRate | None
) -> None:
    """Print a row for each threshold; the one that meets the target last."""
    line(f"{signal}: false isolations of a healthy channel, an hour (95 %)")
    table([*rates, *([] if chosen is None else [chosen])], _RATES)
    for each in rates:
        if each.few is not None:
            line(f"threshold {each.threshold:.5g}: the bound alone: {each.few}; --flights N draws more")
    if chosen is not None:
        line(f"at most {target:g} an hour: threshold {chosen.threshold:.5g}")


def _counted(
    title: str, text: Callable[[FalseIsolationRate], str], none: Callable[[FalseIsolationRate], str] = lambda _: ""
) -> Column:
    """Return a column of rates that events were counted of, ``none``: of the others."""
    return Column(title, lambda rate: (none if rate.per_hour is None else text)(rate))


_RATES: Final = (
    Column("threshold", format=".5g"),
    _counted(
        "an hour",
        lambda m: f"{m.per_hour:.3e} ({m.low:.3e} to {m.high:.3e})",
        lambda m: f"at most {m.high:.1e}",
    ),
    _counted("in the first frames", lambda m: f"{m.at_start:.1e} a flight"),
    _counted(
        "sets of errors",
        lambda m: f"{min(m.sets)} to {max(m.sets)}" + (f", {m.cut} excursions cut off" if m.cut else ""),
    ),
    _counted("repetitions", lambda m: str(m.repetitions)),
)
