"""``rig reliability``: the probability of failure per flight hour, from rates and measured outcomes."""

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
    Column("not correct, at most", lambda cell: f"{cell['chance']:.3g}" if cell["chance"] < 1.0 else "any"),
    Column("trials with none", "trials", ","),
    Column("how", lambda cell: "open loop" if cell["open_loop"] else "flights", worth=7),
    Column("time here, one core", lambda cell: None if cell["seconds"] is None else f"{cell['seconds']:.3g} s"),
)
reliability_app = Typer(**GROUP)
RatesFile = Annotated[Path, opt("FILE", "Failure rates with their sources, TOML.", "--rates")]
Hours = Annotated[float, opt("H", "Duration of a flight, h.", min=0.001, max=1000.0)]
SignalName = Annotated[str | None, opt("SIGNAL", "Signal of the rates file. Optional if the file has one.", "--signal")]


@reliability_app.command()
def chain(
    file: Annotated[Path, arg("FILE", "Rates between the states of a chain, TOML.")],
    as_json: Json = False,
) -> None:
    """Solve a Markov chain given as rates, and print the probability of each state."""
    from rig.studies.reliability.chain import solve_file

    with working("solving the chain", not as_json, steps=True):
        solved = solve_file(file)
    emit(as_json, lambda: {**solved._asdict(), "death_probability": solved.of_death}, lambda: _show_chain(solved))


@reliability_app.command()
def run(
    folders: Annotated[list[Path], arg("DIR...", "Folders of flown campaigns or trials, of one manager or several.")],
    rates: RatesFile,
    hours: Hours = 1.0,
    channels: Annotated[str, opt("N,N...", "Numbers of channels to compute.")] = "1,2,3,4",
    signal: SignalName = None,
    checks: Annotated[
        int, opt("N", "Flights between two full checks. Results for 1 are always printed too.", min=1, max=1000)
    ] = 50,
    report: Annotated[Path | None, opt("FILE", "Page with the pictures, .html.", "--report", "--plot")] = None,
    as_json: Json = False,
) -> None:
    """Compute undetected errors, annunciated losses and lost aircraft per flight hour, and their main causes."""
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
    target: Annotated[float, opt("P", "Target probability per flight hour.", min=1e-15, max=1.0)],
    rates: RatesFile,
    hours: Hours = 1.0,
    signal: SignalName = None,
    cost: Annotated[bool, Option(help="Measure the time of a trial and of a flight on this machine.")] = True,
    as_json: Json = False,
) -> None:
    """Print the number of trials that a target needs for each number of good channels, and their cost."""
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
    campaign: Annotated[str, arg("FILE|NAME", "Campaign like the bundled reliability: file or name.")],
    out: Annotated[Path, opt("DIR", "Output folder, new or empty.")],
    runs: Annotated[int, opt("N", "Total number of trials.", min=1, max=10**9)],
    seed: Seed = 0,
    good_before: Annotated[str, opt("N,N...", "Numbers of good channels before the fault.")] = "4,3",
    workers: Workers = 2,
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Run open-loop trials of the next fault, which leaves two good channels or more, and count the outcomes."""
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
    signal: Annotated[str, arg("SIGNAL", "Signal, as in rig signals.")],
    threshold: Annotated[
        str | None, opt("X,X...", "Thresholds, in the unit of the signal.", show_default="as in the scenario")
    ] = None,
    target: Annotated[
        float | None,
        opt("P", "Target false isolations per channel hour; prints the lowest threshold found to meet it."),
    ] = None,
    scenario: Annotated[
        str, opt("FILE|NAME", "Scenario with aircraft, sensors, manager and flight. Its faults are left out.")
    ] = SCENARIO,
    persistence: Annotated[
        int | None, opt("N", "Persistence, frames.", min=1, max=100, show_default="as in the scenario")
    ] = None,
    sets: Sets = None,
    flights: Annotated[int, opt("N", "Draws of sensor errors per repetition.", min=50, max=10**6)] = 4000,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Estimate the false isolations per hour of a healthy channel, down to 1e-12, by multilevel splitting."""
    from rig.studies.reliability.false_isolation_target import run
    from rig.studies.reliability.false_isolations import FLOOR, Effort

    if target is not None and not FLOOR <= target <= 1.0:
        raise BadInput(f"--target: must be from {FLOOR:g} to 1 false isolations per channel hour, got {target:g}")
    above_0 = "--threshold", threshold or "", "numbers above 0", float, lambda value: isfinite(value) and value > 0.0
    given = None if threshold is None else comma_list(*above_0)
    rates, chosen = run(signal, scenario, sets or [], given, persistence, target, seed, Effort(flights=flights))
    data = {"signal": signal, "false_isolations": [asdict(each) for each in rates]}
    data |= {} if chosen is None else {"target": target, "chosen": asdict(chosen)}
    emit(as_json, data, lambda: _show_rates(signal, rates, target, chosen))


def _show_chain(solved: ChainResult) -> None:
    """Print the states, and the sum over the states that no transition leaves."""
    death = Column("", lambda item: "death" if item[0] in solved.death else "")
    table(
        solved.probability.items(),
        (Column("state", 0), Column(f"probability after {solved.hours:g} h", 1, ".12e"), death),
    )
    line(f"death states: {solved.of_death:.12e}" if solved.death else "no death state: transitions leave every state")


def _show_run(results: Sequence[Result], given: SignalRates, assumptions: Sequence[str]) -> None:
    """Print the assumptions, then the numbers, then their main causes."""
    from rig.studies.reliability.per_hour import DECIDED, TARGETS_EXPLAINED, numbers

    line("This holds if:")
    for assumption in assumptions:
        line(f"  - {assumption}", indent=4)
    line()
    line(f"{results[0].signal}: probability per flight hour, median (95 % interval)")
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
    line(f"{signal}: false isolations per hour of a healthy channel (95 % interval)")
    table([*rates, *([] if chosen is None else [chosen])], _RATES)
    for each in rates:
        if each.few is not None:
            line(f"threshold {each.threshold:.5g}: upper bound only: {each.few}; raise --flights")
    if chosen is not None:
        line(f"at most {target:g} per hour: threshold {chosen.threshold:.5g}")


def _counted(
    title: str, text: Callable[[FalseIsolationRate], str], none: Callable[[FalseIsolationRate], str] = lambda _: ""
) -> Column:
    """Return a column of the rates with counted events; ``none``: the text of the other rates."""
    return Column(title, lambda rate: (none if rate.per_hour is None else text)(rate))


_RATES: Final = (
    Column("threshold", format=".5g"),
    _counted(
        "per hour",
        lambda m: f"{m.per_hour:.3e} ({m.low:.3e} to {m.high:.3e})",
        lambda m: f"at most {m.high:.1e}",
    ),
    _counted("in the first frames", lambda m: f"{m.at_start:.1e} per flight"),
    _counted(
        "error draws",
        lambda m: f"{min(m.sets)} to {max(m.sets)}" + (f", {m.cut} excursions cut off" if m.cut else ""),
    ),
    _counted("repetitions", lambda m: str(m.repetitions)),
)
