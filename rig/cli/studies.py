"""``rig study``: published results reproduced."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Typer

from rig.cli.common import GROUP, Json, Workers, emit, opt
from rig.cli.printing import line, table
from rig.cli.working import working
from rig.core.column import Column, columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rig.studies.papers.ding2015 import Study
    from rig.studies.papers.lane_exchange import Row
    from rig.studies.papers.rate_bias_study import LawComparison
    from rig.studies.papers.servo_study import Compared, Response
    from rig.studies.papers.tolerant import Summary

HALF = 0.5
study = Typer(**GROUP)
Seeds = Annotated[int, opt("N", "Number of seeds of each case.", min=1, max=1000)]


@study.command()
def ding2015(
    out: Annotated[Path, opt("DIR", "Folder for the figures.")] = Path("logs"),
    as_json: Json = False,
) -> None:
    """Reproduce Ding (2015), a B707 with a faulty pitch-angle sensor: print published beside computed numbers.

    Also computes the whole loop, and writes figures.
    """
    from rig.core.errors import BadInput
    from rig.core.files import reported
    from rig.studies.papers import ding2015_figures as figures
    from rig.studies.papers.ding2015 import study as compute

    with reported(f"--out {out}", BadInput, "the figures cannot be written there"):
        out.mkdir(parents=True, exist_ok=True)
    with working("computing the study", not as_json):
        result = compute()
        files = [str(path) for path in figures.write(result, out)]
    emit(as_json, {**result.as_dict(), "figures": files}, lambda: _ding2015(result, files))


@study.command()
def exchange(as_json: Json = False) -> None:
    """Check the sample exchange of four lanes exhaustively against faulty lanes, with one and two rounds."""
    from rig.studies.papers import lane_exchange as exchanges

    with working("passing samples", not as_json):
        rows = exchanges.study()
    emit(as_json, lambda: exchanges.as_dict(rows), lambda: _exchange(rows))


def _exchange(rows: Sequence[Row]) -> None:
    shown = (
        Column("rounds"),
        Column("faulty lanes", lambda row: row.faults or "none"),
        Column("placings"),
        Column("hold"),
        Column("behaviours"),
        Column("agreement broken"),
        Column("validity broken"),
    )
    table(rows, shown)
    line("a asymmetric, s symmetric, b benign, o omissive; two rounds hold while 4 > 2 a + 2 s + b + 1, omissive apart")
    for row in rows:
        if row.counterexample:
            line(f"{row.rounds} rounds, {row.faults}: {row.counterexample}")


@study.command("fault-tolerant")
def fault_tolerant(seeds: Seeds = 1, workers: Workers = 2, as_json: Json = False) -> None:
    """Fly faulty pitch-angle sensors under each control law: 648 flights per seed, about ten minutes."""
    from rig.studies.papers import tolerant

    with working(f"flying {648 * seeds} flights", not as_json):
        flown, flights = tolerant.study(range(1, seeds + 1), workers)
    emit(as_json, lambda: tolerant.as_dict(flown, flights), lambda: _laws(tolerant.summarise(flown), flights))


@study.command("rate-bias")
def rate_bias(
    seeds: Seeds = 1,
    drawn: Annotated[
        int, opt("N", "Number of random faults per seed instead of the grid, 0: the grid.", min=0, max=10**6)
    ] = 0,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Fly biased rates and halved attitudes under the plain and the fault-tolerant law: 1881 flights per seed."""
    from rig.studies.papers import rate_bias_study as rate_bias

    numbers = range(1, seeds + 1)
    random = [flight for seed in numbers for flight in rate_bias.drawn(drawn, seed)]
    flights = random or rate_bias.grid(numbers)
    with working(f"flying {len(flights)} flights", not as_json):
        flown = rate_bias.study(flights, workers)
    emit(
        as_json,
        lambda: rate_bias.as_dict(flown),
        lambda: _rate_bias(rate_bias.summarise(flown), rate_bias.worst(flown)),
    )


@study.command()
def servo(
    aircraft: Annotated[str, opt("NAME", "Aircraft: name or folder.")] = "f16",
    surface: Annotated[str, opt("NAME", "Surface: elevator, aileron or rudder.")] = "elevator",
    rate: Annotated[float, opt("HZ", "Frame rate of the step response, Hz.", min=1, max=1000)] = 100.0,
    step: Annotated[float, opt("RAD", "Size of the step, rad.", min=1e-6, max=1.0)] = 0.01,
    as_json: Json = False,
) -> None:
    """Compare the servo of one surface with a first-order lag, at six frame rates; --json prints its step response."""
    from rig.studies.papers import servo_study as servos

    if as_json:
        emit(True, servos.step_response(aircraft, surface, rate, step).as_dict(), lambda: None)
        return
    with working("moving the servo", True):
        compared = servos.compare(aircraft, surface)
    _servo(compared, servos.step_response(aircraft, surface, rate, step), servos.FREQUENCIES_HZ)


def _servo(compared: Sequence[Compared], answer: Response, frequencies_hz: Sequence[float]) -> None:
    labels = [(f"{hz:g} Hz", i) for i, hz in enumerate(frequencies_hz)]
    shown = (
        Column("frame rate", "rate_hz", "g", "Hz"),
        Column("later by", lambda row: 1e3 * row.shift_s, ".2f", "ms"),
        Column("small step", lambda row: 1e2 * row.small_step, ".2f", "%"),
        Column("large step", lambda row: degrees(row.large_step_rad), ".2f", "deg"),
        Column("from JSBSim's", lambda row: degrees(row.large_step_jsbsim_rad), ".2f", "deg"),
        *(Column(f"gain {name}", lambda row, i=i: row.gain[i], ".3f") for name, i in labels),
        *(Column(f"delay {name}", lambda row, i=i: 1e3 * row.delay_s[i], ".2f", "ms") for name, i in labels),
    )
    line(f"{answer.aircraft}, {answer.surface}: servo compared with a lag of the same lag_s and rate limit")
    table(compared, shown)
    line("small step: largest difference from the delayed lag, as a share of the step")
    line("large step: largest difference from the rate-limited lag, and from JSBSim's, which limits the lag's output")
    line("gain and delay: of a sine, relative to the lag")
    passed = next((t for t, x in zip(answer.time_s, answer.ram_rad, strict=True) if x >= HALF * answer.step_rad), None)
    half = "not in a second" if passed is None else f"after {1e3 * passed:.1f} ms"
    line(
        f"step of {answer.step_rad:g} rad at {answer.rate_hz:g} Hz: half of it {half}; --json prints the whole response"
    )


def _laws(cases: Sequence[Summary], flights: int) -> None:
    shown = (
        *(Column("hold"), Column("fault"), Column("law")),
        Column("peak", lambda case: 1e3 * case.pitch_peak_rad, ".1f", "mrad", worth=6),
        Column("steady", lambda case: 1e3 * case.pitch_steady_rad, ".1f", "mrad", worth=5),
        Column("altitude lost", "altitude_loss_m", ".1f", "m", worth=7),
        Column("load factor", "load_factor_max", ".2f", worth=4),
        Column("detected", _detected, worth=8),
        Column("survived", _survived),
    )
    table(cases, shown)
    line(f"{flights} flights; worst values of each case; exact 95 % intervals")


_GROUPS: Final = (
    *(
        Column("fault", "kind"),
        Column("aircraft"),
        Column("within bounds", lambda row: _share(row["within"])),
    ),
    Column("sensor isolated", lambda row: _share(row["blamed"]), worth=7),
    Column("rate biased, early", lambda row: f"{row['answered']}, {row['early']}", worth=4),
    Column("identical", worth=3),
    Column("lost: plain, tolerant", lambda row: f"{row['lost_plain']}, {row['lost_tolerant']}", worth=8),
    Column("above plain", "most_above_plain_m", ".1f", "m", worth=6),
)


def _share(rate: dict[str, Any]) -> str:
    return f"{rate['count']} of {rate['of']} ({rate['low']:.3f} to {rate['high']:.3f})"


def _rate_bias(groups: Sequence[dict[str, Any]], worst: Sequence[LawComparison]) -> None:
    """Print the table, and the worst flights with the commands that fly them again."""
    table(groups, _GROUPS)
    line("exact 95 % intervals; identical: both laws gave the same surface commands, to the bit")
    for pair in worst:
        where = "within bounds" if pair.within else "out of bounds"
        errors = f"plain {pair.plain_m:.1f} m, fault-tolerant {pair.tolerant_m:.1f} m"
        line(f"{where}: {errors}: {pair.command}", fold=False)


def _detected(case: Summary) -> str:
    return "never" if case.detected_after_s is None else f"{case.detected} in {case.detected_after_s:.2f} s"


def _survived(case: Summary) -> str:
    return f"{case.survived} of {case.flights} ({case.survived_low:.2f} to {case.survived_high:.2f})"


def _ding2015(result: Study, files: list[str]) -> None:
    d, (nominal, fastest, slowest) = result.as_dict(), result.settling_s
    settled = f"{nominal:.2f} s; +-10 %: {fastest:.2f} to {slowest:.2f} s"
    pitch = f"true {result.complete_pitch:.3f}, measured {d['complete_measured_pitch']:.3f}"
    rows = [
        ("stacked matrix at F = 0.5", "64 entries", f"largest difference {d['stacked_max_error']:.2g}"),
        ("K2", "2 x 8, LQR on the stacked matrix", f"largest difference {d['k2_max_error']:.2g}"),
        ("K1, columns 1 to 4", "2 x 4, LQR on A, B alone", f"largest difference {d['k1_left_max_error']:.2g}"),
        ("K1, columns 5 to 8", "2 x 4", "no such regulator exists, see below"),
        ("error system settles (2 %)", "a figure", settled),
        ("pitch angle after the fault", "1", pitch),
    ]
    table(rows, columns("quantity", "published", "computed"))
    for remark in REMARKS:
        line(remark)
    line(f"the published law with the true state: pitch angle {result.with_truth_pitch:.3f}")
    for path in files:
        line(f"written  {path}")


REMARKS = (
    "",
    "Not reproduced, with the reasons:",
    "- K1, columns 5 to 8: without a fault nothing controls the observation error, and its speed does not decay (speed",
    "  does not show in the pitch angle), so the Riccati equation has no stabilising solution to print.",
    "- The return to y_r = 1: the error system drops the fault's own input (F - 1) H C x_r. With it, the loop brings",
    "  the measured pitch angle to 1 and the true one to 1 / F = 2: the law has no estimate of F.",
    "- B's throttle column is a force and a moment, not divided by mass and inertia; X_theta has the sign of +g.",
)
