"""``rig study``: published results computed again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option, Typer

from rig.cli.common import GROUP, Json, Workers, emit
from rig.cli.table import Column, columns, line, table
from rig.cli.working import working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rig.studies.ding2015 import Study
    from rig.studies.tolerant import Summary

study = Typer(help="Published results, computed again.", **GROUP)
Seeds = Annotated[int, Option(metavar="N", help="Seeds of every case.", min=1, max=1000)]


@study.command()
def ding2015(
    out: Annotated[Path, Option(metavar="DIR", help="Folder of the figures, made when missing.")] = Path("logs"),
    as_json: Json = False,
) -> None:
    """Compute the B707 with a lying pitch-angle sensor: printed numbers against ours, and the honest experiment."""
    from rig.errors import BadInput
    from rig.studies import figures
    from rig.studies.ding2015 import study as compute
    from rig.util.files import reported

    with reported(f"--out {out}", BadInput, "figures cannot be kept there"):
        out.mkdir(parents=True, exist_ok=True)
    with working("computing the study", not as_json):
        result = compute()
        files = [str(path) for path in figures.write(result, out)]
    emit(as_json, {**result.as_dict(), "figures": files}, lambda: _ding2015(result, files))


@study.command("fault-tolerant")
def fault_tolerant(seeds: Seeds = 1, workers: Workers = 2, as_json: Json = False) -> None:
    """Fly lying pitch-angle sensors by case and law, in JSBSim: 648 flights for each seed, some ten minutes."""
    from rig.studies import tolerant

    with working(f"flying {648 * seeds} flights", not as_json):
        flown, flights = tolerant.study(range(1, seeds + 1), workers)
    emit(as_json, lambda: tolerant.as_dict(flown, flights), lambda: _laws(tolerant.summarise(flown), flights))


@study.command("rate-bias")
def rate_bias(
    seeds: Seeds = 1,
    drawn: Annotated[int, Option(metavar="N", help="Draw so many faults instead of the grid.", min=0, max=10**6)] = 0,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Fly biased rates and halved attitudes, by the plain and the fault-tolerant law: 1881 flights for each seed."""
    from rig.studies import rate_bias
    from rig.util.console import console

    numbers = range(1, seeds + 1)
    random = [flight for seed in numbers for flight in rate_bias.drawn(drawn, seed)]
    flights = random or rate_bias.grid(numbers)
    with working(f"flying {len(flights)} flights", not as_json):
        flown = rate_bias.study(flights, workers)
    emit(as_json, lambda: rate_bias.as_dict(flown), lambda: rate_bias.show(flown, console()))


def _laws(cases: Sequence[Summary], flights: int) -> None:
    shown = (
        *(Column("hold", "hold"), Column("fault", "fault"), Column("law", "law")),
        Column("peak", lambda case: 1e3 * case.pitch_peak_rad, ".1f", "mrad"),
        Column("steady", lambda case: 1e3 * case.pitch_steady_rad, ".1f", "mrad"),
        *(Column("altitude lost", "altitude_loss_m", ".1f", "m"), Column("load factor", "load_factor_max", ".2f")),
        Column("found", _detected),
        Column("survived", _survived),
    )
    table(cases, shown)
    line(f"{flights} flights; the worst of each case; intervals: exact, 95 %")


def _detected(case: Summary) -> str:
    return "never" if case.detected_after_s is None else f"{case.detected} in {case.detected_after_s:.2f} s"


def _survived(case: Summary) -> str:
    return f"{case.survived} of {case.flights} ({case.survived_low:.2f} to {case.survived_high:.2f})"


def _ding2015(result: Study, files: list[str]) -> None:
    d, (nominal, fastest, slowest) = result.as_dict(), result.settling_s
    settled = f"{nominal:.2f} s; +-10 %: {fastest:.2f} to {slowest:.2f} s"
    pitch = f"true {result.honest_pitch:.3f}, measured {d['honest_measured_pitch']:.3f}"
    rows = [
        ("stacked matrix at F = 0.5", "64 entries", f"largest difference {d['stacked_max_error']:.2g}"),
        ("K2", "2 x 8, LQR on the stacked matrix", f"largest difference {d['k2_max_error']:.2g}"),
        ("K1, columns 1 to 4", "2 x 4, LQR on A, B alone", f"largest difference {d['k1_left_max_error']:.2g}"),
        ("K1, columns 5 to 8", "2 x 4", "no such regulator exists: see below"),
        ("error system settles (2 %)", "a figure", settled),
        ("pitch angle after the fault", "1", pitch),
    ]
    table(rows, columns("what", "printed", "ours"))
    for remark in REMARKS:
        line(remark)
    line(f"the printed law, given the true state: pitch angle {result.with_truth_pitch:.3f}")
    for path in files:
        line(f"written  {path}")


REMARKS = (
    "",
    "What does not reproduce, and why:",
    "- K1, columns 5 to 8: without a fault nothing controls the observation error, and its speed does not decay (speed",
    "  does not show in the pitch angle), so the Riccati equation has no stabilising solution to print.",
    "- The return to y_r = 1: the error system drops the fault's own input (F - 1) H C x_r. With it, the loop brings",
    "  the measured pitch angle to 1 and the true one to 1 / F = 2: nothing in this law knows F.",
    "- B's throttle column is a force and a moment, not divided by mass and inertia; X_theta has the sign of +g.",
)
