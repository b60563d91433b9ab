"""``rig study``: parse, call, print."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rig.studies.ding2015 import Study
    from rig.studies.tolerant import Summary

study = typer.Typer(
    help="Published results, computed again.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@study.callback()
def _group() -> None:
    """Published results, computed again."""


@study.command()
def ding2015(
    out: Annotated[Path, typer.Option(help="Folder of the figures, made when missing.")] = Path("logs"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """The B707 with a lying pitch-angle sensor: printed numbers against ours, and the honest experiment."""
    from rig.errors import BadInput
    from rig.studies import figures
    from rig.studies.ding2015 import study as compute

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {out}: figures cannot be kept there: {error.strerror}") from None
    found = compute()
    files = [str(path) for path in figures.write(found, out)]
    if as_json:
        typer.echo(json.dumps({**found.as_dict(), "figures": files}, allow_nan=False))
    else:
        _show(found, files)


@study.command("fault-tolerant")
def fault_tolerant(
    seeds: Annotated[int, typer.Option(help="Seeds of every case.", min=1, max=1000)] = 1,
    workers: Annotated[int, typer.Option(help="Processes.", min=1, max=1024)] = 2,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Lying pitch-angle sensors by case and law, flown by JSBSim: 648 flights for each seed, some ten minutes."""
    from rig.studies import tolerant

    flown, flights = tolerant.study(range(1, seeds + 1), workers)
    if as_json:
        typer.echo(json.dumps(tolerant.as_dict(flown, flights), allow_nan=False))
    else:
        _show_laws(tolerant.summarise(flown), flights)


@study.command("rate-bias")
def rate_bias(
    seeds: Annotated[int, typer.Option(help="Seeds of every case.", min=1, max=1000)] = 1,
    drawn: Annotated[int, typer.Option(help="Draw so many faults instead of the grid.", min=0, max=10**6)] = 0,
    workers: Annotated[int, typer.Option(help="Processes.", min=1, max=1024)] = 2,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Biased rates and halved attitudes, by the plain and the fault-tolerant law: 1881 flights for each seed."""
    from rig.console import console
    from rig.studies import rate_bias, rate_bias_drawn, rate_bias_table

    numbers = range(1, seeds + 1)
    random = [flight for seed in numbers for flight in rate_bias_drawn.drawn(drawn, seed)]
    flown = rate_bias.study(random or rate_bias.grid(numbers), workers)
    if as_json:
        typer.echo(json.dumps(rate_bias_table.as_dict(flown), allow_nan=False))
    else:
        rate_bias_table.show(flown, console())


def _show_laws(found: Sequence[Summary], flights: int) -> None:
    from rich.table import Table

    from rig.console import console

    heads = (
        "hold",
        "fault",
        "law",
        "peak, mrad",
        "steady, mrad",
        "altitude lost, m",
        "load factor",
        "found",
        "survived",
    )
    table, screen = Table(*heads, box=None), console()
    for x in found:
        late = "never" if x.detected_after_s is None else f"{x.detected} in {x.detected_after_s:.2f} s"
        errors = (f"{1e3 * x.pitch_peak_rad:.1f}", f"{1e3 * x.pitch_steady_rad:.1f}", f"{x.altitude_loss_m:.1f}")
        share = f"{x.survived} of {x.flights} ({x.survived_low:.2f} to {x.survived_high:.2f})"
        table.add_row(x.hold, x.fault, x.law, *errors, f"{x.load_factor_max:.2f}", late, share)
    screen.print(table)
    screen.print(f"{flights} flights; the worst of each case; intervals: exact, 95 %")


def _show(found: Study, files: list[str]) -> None:
    from rich.table import Table

    from rig.console import console

    d, screen = found.as_dict(), console()
    table = Table("what", "printed", "ours", box=None)
    table.add_row("stacked matrix at F = 0.5", "64 entries", f"largest difference {d['stacked_max_error']:.2g}")
    table.add_row("K2", "2 x 8, LQR on the stacked matrix", f"largest difference {d['k2_max_error']:.2g}")
    table.add_row("K1, columns 1 to 4", "2 x 4, LQR on A, B alone", f"largest difference {d['k1_left_max_error']:.2g}")
    table.add_row("K1, columns 5 to 8", "2 x 4", "no such regulator exists: see below")
    nominal, fastest, slowest = found.settling_s
    spread = f"{nominal:.2f} s; +-10 %: {fastest:.2f} to {slowest:.2f} s"
    table.add_row("error system settles (2 %)", "a figure", spread)
    last = f"true {found.honest_pitch:.3f}, measured {d['honest_measured_pitch']:.3f}"
    table.add_row("pitch angle after the fault", "1", last)
    screen.print(table)
    for line in REMARKS:
        screen.print(line, soft_wrap=True)
    screen.print(f"the printed law, given the true state: pitch angle {found.with_truth_pitch:.3f}")
    for path in files:
        screen.print(f"written  {path}", soft_wrap=True)


REMARKS = (
    "",
    "What does not reproduce, and why:",
    "- K1, columns 5 to 8: without a fault nothing controls the observation error, and its speed does not decay (speed",
    "  does not show in the pitch angle), so the Riccati equation has no stabilising solution to print.",
    "- The return to y_r = 1: the error system drops the fault's own input (F - 1) H C x_r. With it, the loop brings",
    "  the measured pitch angle to 1 and the true one to 1 / F = 2: nothing in this law knows F.",
    "- B's throttle column is a force and a moment, not divided by mass and inertia; X_theta has the sign of +g.",
)
