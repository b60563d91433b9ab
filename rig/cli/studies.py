"""``rig study``: parse, call, print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.common import GROUP, Json, emit
from rig.cli.working import working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rig.studies.ding2015 import Study
    from rig.studies.tolerant import Summary

study = typer.Typer(help="Published results, computed again.", **GROUP)
Seeds = Annotated[int, typer.Option(metavar="N", help="Seeds of every case.", min=1, max=1000)]
Workers = Annotated[int, typer.Option(metavar="N", help="Processes.", min=1, max=1024)]


@study.command()
def ding2015(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the figures, made when missing.")] = Path("logs"),
    as_json: Json = False,
) -> None:
    """The B707 with a lying pitch-angle sensor: printed numbers against ours, and the honest experiment."""
    from rig.errors import BadInput
    from rig.studies import figures
    from rig.studies.ding2015 import study as compute
    from rig.util.files import reported

    with reported(f"--out {out}", BadInput, "figures cannot be kept there"):
        out.mkdir(parents=True, exist_ok=True)
    with working("computing the study", not as_json):
        found = compute()
        files = [str(path) for path in figures.write(found, out)]
    emit(as_json, {**found.as_dict(), "figures": files}, lambda: _show(found, files))


@study.command("fault-tolerant")
def fault_tolerant(
    seeds: Seeds = 1,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Lying pitch-angle sensors by case and law, flown by JSBSim: 648 flights for each seed, some ten minutes."""
    from rig.studies import tolerant

    with working(f"flying {648 * seeds} flights", not as_json):
        flown, flights = tolerant.study(range(1, seeds + 1), workers)
    laws = lambda: _show_laws(tolerant.summarise(flown), flights)  # noqa: E731 # shown once
    emit(as_json, lambda: tolerant.as_dict(flown, flights), laws)


@study.command("rate-bias")
def rate_bias(
    seeds: Seeds = 1,
    drawn: Annotated[
        int, typer.Option(metavar="N", help="Draw so many faults instead of the grid.", min=0, max=10**6)
    ] = 0,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Biased rates and halved attitudes, by the plain and the fault-tolerant law: 1881 flights for each seed."""
    from rig.studies import rate_bias
    from rig.util.console import console

    numbers = range(1, seeds + 1)
    random = [flight for seed in numbers for flight in rate_bias.drawn(drawn, seed)]
    flights = random or rate_bias.grid(numbers)
    with working(f"flying {len(flights)} flights", not as_json):
        flown = rate_bias.study(flights, workers)
    emit(as_json, lambda: rate_bias.as_dict(flown), lambda: rate_bias.show(flown, console()))


def _show_laws(found: Sequence[Summary], flights: int) -> None:
    from rig.util.console import console

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
    rows, screen = [], console()
    for x in found:
        late = "never" if x.detected_after_s is None else f"{x.detected} in {x.detected_after_s:.2f} s"
        errors = (f"{1e3 * x.pitch_peak_rad:.1f}", f"{1e3 * x.pitch_steady_rad:.1f}", f"{x.altitude_loss_m:.1f}")
        share = f"{x.survived} of {x.flights} ({x.survived_low:.2f} to {x.survived_high:.2f})"
        rows.append((x.hold, x.fault, x.law, *errors, f"{x.load_factor_max:.2f}", late, share))
    screen.table(heads, rows)
    screen.print(f"{flights} flights; the worst of each case; intervals: exact, 95 %")


def _show(found: Study, files: list[str]) -> None:
    from rig.util.console import console

    d, screen, (nominal, fastest, slowest) = found.as_dict(), console(), found.settling_s
    rows = [
        ("stacked matrix at F = 0.5", "64 entries", f"largest difference {d['stacked_max_error']:.2g}"),
        ("K2", "2 x 8, LQR on the stacked matrix", f"largest difference {d['k2_max_error']:.2g}"),
        ("K1, columns 1 to 4", "2 x 4, LQR on A, B alone", f"largest difference {d['k1_left_max_error']:.2g}"),
        ("K1, columns 5 to 8", "2 x 4", "no such regulator exists: see below"),
        ("error system settles (2 %)", "a figure", f"{nominal:.2f} s; +-10 %: {fastest:.2f} to {slowest:.2f} s"),
        (
            "pitch angle after the fault",
            "1",
            f"true {found.honest_pitch:.3f}, measured {d['honest_measured_pitch']:.3f}",
        ),
    ]
    screen.table(("what", "printed", "ours"), rows)
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
