"""``rig reliability``: from rates and measured outcomes to a probability per flight hour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.common import GROUP, Json, emit
from rig.cli.reliability_trials import trials

if TYPE_CHECKING:
    from rig.reliability.chain_file import ChainResult

reliability_app = typer.Typer(help="From rates and measured outcomes to a probability per flight hour.", **GROUP)


@reliability_app.callback()
def _group() -> None:
    """A group, however many commands it has."""


@reliability_app.command()
def chain(
    file: Annotated[Path, typer.Argument(help="Rates between states, TOML.", show_default=False)],
    as_json: Json = False,
) -> None:
    """Print the probability of every state of a chain that is given as rates."""
    from rig.reliability.chain_file import solve_file

    found = solve_file(file)
    emit(as_json, lambda: as_dict(found), lambda: show(found))


def as_dict(found: ChainResult) -> dict[str, object]:
    """The result as plain data."""
    return {
        "hours": found.hours,
        "start": found.start,
        "probability": found.probability,
        "death": found.death,
        "death_probability": found.of_death,
    }


def show(found: ChainResult) -> None:
    """The states, and the sum over those that nothing leaves."""
    from rig.console import console

    screen = console()
    screen.table(
        ("state", f"probability after {found.hours:g} h", ""),
        ((name, f"{p:.12e}", "death" if name in found.death else "") for name, p in found.probability.items()),
    )
    screen.print(f"death states: {found.of_death:.12e}" if found.death else "no death state: every state is left")


reliability_app.command()(trials)
