"""``rig reliability``: from rates and measured outcomes to a probability per flight hour."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.common import GROUP, Json, emit
from rig.cli.reliability_margin import margin
from rig.cli.reliability_trials import trials
from rig.cli.working import working
from rig.errors import BadInput

reliability_app = typer.Typer(help="From rates and measured outcomes to a probability per flight hour.", **GROUP)
RatesFile = Annotated[
    Path, typer.Option("--rates", metavar="FILE", help="Rates with their sources, TOML.", show_default=False)
]
Hours = Annotated[float, typer.Option(metavar="X", help="Duration of a flight.", min=1e-3, max=1e3)]
SignalName = Annotated[
    str | None, typer.Option("--signal", help="Of the rates file; its only one.", show_default=False)
]


@reliability_app.command()
def chain(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Rates between states, TOML.", show_default=False)],
    as_json: Json = False,
) -> None:
    """Print the probability of every state of a chain that is given as rates."""
    from rig.cli import show_reliability as show
    from rig.reliability.chain import solve_file

    found = solve_file(file)
    emit(as_json, lambda: {**found._asdict(), "death_probability": found.of_death}, lambda: show.chain(found))


@reliability_app.command()
def run(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Flown campaigns or trials, of any managers.", show_default=False),
    ],
    rates: RatesFile,
    hours: Hours = 1.0,
    channels: Annotated[str, typer.Option(help="Numbers of channels.")] = "1,2,3,4",
    signal: SignalName = None,
    checks: Annotated[
        int, typer.Option(metavar="N", help="Flights between two full checks, beside one.", min=1, max=1000)
    ] = 50,
    report: Annotated[
        Path | None,
        typer.Option("--report", "--plot", help="Write a page with the pictures, HTML.", show_default=False),
    ] = None,
    as_json: Json = False,
) -> None:
    """Print bad votes, known losses and lost aircraft per flight hour, and what decides them."""
    from rig.cli import show_reliability as show
    from rig.reliability.rates import read_rates
    from rig.reliability.run import assumptions
    from rig.reliability.run import run as reckon

    read = read_rates(rates)
    name, given = read.of(signal, str(rates))
    with working("reading the cells", not as_json):
        found = reckon(folders, read, name, _numbers(channels), hours, checks)
    lines = assumptions(read, name, found)
    if report is not None:
        from rig.reliability.report import write_report

        write_report(found, lines, report)
    emit(as_json, lambda: _as_dict(found, lines), lambda: show.run(found, given, lines))


def _as_dict(found: list[Any], assumptions: list[str]) -> dict[str, Any]:
    return {"assumptions": assumptions, "results": [one.as_dict() for one in found]}


def _numbers(text: str) -> list[int]:
    """Numbers of channels from a list with commas."""
    from rig.frame import CHANNELS

    parts = text.split(",")
    if not all(part.strip().isdecimal() and 1 <= int(part) <= CHANNELS for part in parts):
        raise BadInput(f"--channels: numbers from 1 to {CHANNELS} with commas between, got {text}")
    return sorted({int(part) for part in parts})


@reliability_app.command()
def plan(
    target: Annotated[float, typer.Option(help="Probability per flight hour to be shown.", min=1e-15, max=1.0)],
    rates: RatesFile,
    hours: Hours = 1.0,
    signal: SignalName = None,
    cost: Annotated[bool, typer.Option(help="Measure what a trial and a flight take here.")] = True,
    as_json: Json = False,
) -> None:
    """Print how many trials a target needs for each number of good channels, and what they cost here."""
    from rig.cli import show_reliability as show
    from rig.reliability.plan import needed
    from rig.reliability.rates import read_rates

    read = read_rates(rates)
    _, given = read.of(signal, str(rates))
    found = needed(target, max(given.per_hour), hours=hours)
    seconds: list[float | None] = [None] * len(found)
    if cost:
        from rig.reliability.plan import measure

        taken = measure()
        seconds = [taken.of(one.trials, one.open_loop) for one in found]
    cells = [{**one._asdict(), "seconds": taking} for one, taking in zip(found, seconds, strict=True)]
    emit(as_json, lambda: {"cells": cells}, lambda: show.plan(found, seconds))


reliability_app.command()(trials)
reliability_app.command()(margin)
