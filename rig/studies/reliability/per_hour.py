"""Undetected errors, annunciated losses and lost aircraft per flight hour, for each manager and number of channels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby, product
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from rig.core.column import PLAIN, Column
from rig.studies.reliability.chain import Floats
from rig.studies.reliability.model import Given, after_flights, one_flight, perfect, rates
from rig.studies.reliability.next_fault import BAD_LOST, KEPT, CellKey, Outcomes, outcomes
from rig.studies.reliability.rates_file import Layer, SignalRates
from rig.studies.reliability.tally import Cells

DRAWS: Final = 4000
SEED: Final = 1
TARGETS: Final = {"military": 1e-7, "civil": 1e-9}  # per flight hour; Zhang 2023, introduction
TARGETS_EXPLAINED: Final = (
    "targets: loss of function, by an undetected error or an annunciated loss, at most 1e-7 (military) or 1e-9 (civil) "
    "per flight hour; not shown: the target is inside the interval, so more trials are needed"
)
WHAT: Final = ("undetected_error", "annunciated_loss", "lost_aircraft")
TITLES: Final = {
    "undetected_error": "undetected error of the signal",
    "annunciated_loss": "annunciated loss of the signal",
    "lost_aircraft": "lost aircraft",
}
MET, NOT_SHOWN, NOT_MET = "met", "not shown", "not met"
WORTH_SAYING: Final = 0.01  # of a result
MOST: Final = 3  # parts of what decides one
_SUMS: Final = {"undetected_error": (2, 3), "annunciated_loss": (0, 1), "lost_aircraft": (1, 3)}  # of model.LOSSES
UNSEEN: Final = 0.5  # of a result from cells in which nothing was seen: above it the lower end is the prior's


@dataclass(frozen=True, slots=True)
class Estimate:
    """A probability per flight hour; ``low`` is None if the data give no lower end."""

    median: float
    low: float | None
    high: float


@dataclass(frozen=True, slots=True)
class Contribution:
    """The share of a result that would vanish if every fault of a cell were tolerated."""

    cell: str
    share: float
    trials: int
    seen: int  # of them not correct
    trials_to_halve: int  # more of them, to halve the interval if the cell alone made it


class Case(NamedTuple):
    """One chain of a sweep."""

    channels: int
    per_hour: float
    beta: float
    hours: float  # of a flight
    flights_between_checks: int


@dataclass(frozen=True, slots=True)
class Result:
    """The result of one manager and case."""

    manager: str
    signal: str
    case: Case
    estimates: dict[str, Estimate]  # by WHAT; without lost_aircraft if nothing was flown
    perfect: float
    requirement: dict[str, bool]  # by TARGETS: met by the upper end of the loss of the function
    loss: Estimate  # of the function: undetected error and annunciated loss together
    standing: dict[str, str]  # by TARGETS: met, not shown, not met
    contributions: tuple[Contribution, ...]  # to that loss, the largest first
    layers: tuple[str, ...]  # in series, with given coverages
    unreached: tuple[str, ...]  # cells in which a kind of fault never began, and counts as an undetected error

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {**asdict(self), "case": self.case._asdict()}


def results(
    flown: Cells, signal: str, given: SignalRates, cases: Sequence[Case], layers: Sequence[Layer] = ()
) -> list[Result]:
    """Compute one manager in all ``cases`` of one flight time.  BadInput names a kind of fault that was not flown."""
    counts = flown.counts.filter(pl.col("signal") == signal).sort("design", "good_before", "kind", "condition")
    rng = np.random.default_rng(SEED)
    drawn = outcomes(counts, given.kinds, flown.manager, rng, DRAWS, given.level(cases[0].hours))
    phi = false_isolations(flown.false_isolations.filter(pl.col("signal") == signal), rng)
    if given.false_isolations_per_channel_hour is not None:
        phi = dict.fromkeys(phi, np.full(DRAWS, given.false_isolations_per_channel_hour))
    base = Given(drawn.draws, drawn.announced, phi, drawn.settle_s / 3600.0, given.box_per_hour)
    made: list[Result] = []
    for _, alike in groupby(cases, lambda case: case._replace(flights_between_checks=0)):
        same = list(alike)
        several = zip(same, losses(base, same), _contributions(_mean(base), drawn, same), strict=True)
        ideal = perfect(same[0].channels, same[0].per_hour + given.box_per_hour, same[0].hours)
        made += [_result(flown.manager, signal, drawn, ideal, *parts, layers) for parts in several]
    return made


def cases(given: SignalRates, channels: Iterable[int], hours: float, checks: int) -> list[Case]:
    """Return all channels, rates and common-mode shares, checked after each flight and after ``checks`` flights."""
    sweep = product(channels, given.per_hour, given.beta, sorted({1, checks}))
    return [Case(n, rate, beta, hours, flights) for n, rate, beta, flights in sweep]


def false_isolations(table: pl.DataFrame, rng: np.random.Generator) -> dict[int, Floats]:
    """Draw (DRAWS,) false isolations per channel hour by level: Gamma(events + 1/2, hours); none without hours."""
    draws: dict[int, Floats] = {}
    for level in (4, 3, 2, 1):
        here = table.filter(pl.col("level") == level)
        events, hours = float(here["events"].sum()), float(here["channel_hours"].sum())
        draws[level] = rng.gamma(events + 0.5, 1.0 / hours, DRAWS) if hours > 0.0 else np.zeros(DRAWS)
    return draws


def _result(
    manager: str,
    signal: str,
    drawn: Outcomes,
    ideal: float,
    case: Case,
    lost: Floats,
    contributions: tuple[Contribution, ...],
    layers: Sequence[Layer],
) -> Result:
    unseen = sum(part.share for part in contributions if part.trials and not part.seen)
    more = sum(in_series(layer, case.hours) for layer in layers)
    estimates = {
        name: _estimate(lost[:, list(_SUMS[name])].sum(axis=1) + (more if name != "annunciated_loss" else 0.0), unseen)
        for name in WHAT
        if drawn.flown or name != "lost_aircraft"
    }
    loss = _estimate(lost.sum(axis=1) + more, unseen)
    standing = {name: against(loss, target) for name, target in TARGETS.items()}
    requirement = {name: verdict == MET for name, verdict in standing.items()}
    unreached = tuple(f"{design}, {good} good" for design, good in drawn.unreached if good <= case.channels)
    names = tuple(layer.name for layer in layers)
    return Result(manager, signal, case, estimates, ideal, requirement, loss, standing, contributions, names, unreached)


def against(loss: Estimate, target: float) -> str:
    """Return the verdict on a target: the whole interval of a loss is below it, above it, or neither."""
    if loss.high < target:
        return MET
    return NOT_MET if loss.low is not None and loss.low > target else NOT_SHOWN


def losses(given: Given, cases: Sequence[Case]) -> list[Floats]:
    """Return the probability (draws, 4) per flight hour of model.LOSSES; ``cases`` differ in checks only."""
    n, per_hour, beta, hours, _ = cases[0]
    flight = one_flight(rates(n, per_hour, beta, given), n, hours)
    return [after_flights(flight, hours, case.flights_between_checks) for case in cases]


def _mean(given: Given) -> Given:
    """Return the same inputs with one draw, the mean of all."""
    return replace(
        given,
        outcomes={cell: u.mean(axis=0, keepdims=True) for cell, u in given.outcomes.items()},
        false_isolation={level: phi.mean(keepdims=True) for level, phi in given.false_isolation.items()},
    )


def _estimate(values: Floats, unseen: float) -> Estimate:
    low, median, high = np.quantile(values, (0.025, 0.5, 0.975))
    return Estimate(float(median), None if unseen > UNSEEN else float(low), float(high))


def _contributions(mean: Given, drawn: Outcomes, cases: Sequence[Case]) -> list[tuple[Contribution, ...]]:
    """Return each cell's share of the losses of each case, at the means.  ``cases`` as of ``losses``."""
    flown = sorted(cell for cell in mean.outcomes if cell[1] <= cases[0].channels)
    return [_ranked(lost.sum(axis=1), flown, drawn) for lost in losses(_without_each(mean, flown), cases)]


def _without_each(mean: Given, flown: Sequence[CellKey]) -> Given:
    """Return inputs with one draw each: unchanged, without the losses of each cell, without false isolations."""
    draws = len(flown) + 2
    outcomes = {cell: np.repeat(u, draws, axis=0) for cell, u in mean.outcomes.items()}
    for i, cell in enumerate(flown, 1):
        outcomes[cell][i] = np.arange(BAD_LOST + 1) == KEPT
    false_isolation = {level: np.repeat(phi, draws) for level, phi in mean.false_isolation.items()}
    for phi in false_isolation.values():
        phi[-1] = 0.0
    return replace(mean, outcomes=outcomes, false_isolation=false_isolation)


def _ranked(lost: Floats, flown: Sequence[CellKey], drawn: Outcomes) -> tuple[Contribution, ...]:
    """Return the difference of each draw of ``_without_each`` from the first one, the largest first."""
    whole = lost[0]
    missing = (whole - lost[1:]) / whole if whole > 0.0 else np.zeros(len(lost) - 1)
    of_cells = (
        Contribution(f"{design}, {good} good", float(share), trials, drawn.seen[design, good], 3 * trials)
        for (design, good), share in zip(flown, missing[:-1], strict=True)
        for trials in [drawn.trials[design, good]]
    )
    of_healthy = Contribution("false isolations", float(missing[-1]), 0, 0, 0)
    return tuple(sorted((*of_cells, of_healthy), key=lambda part: (-part.share, part.cell)))


def in_series(layer: Layer, hours: float) -> float:
    """Return the probability per flight hour of losing a layer, by an uncovered fault or by all of its channels."""
    uncovered = {
        ("single", layer.channels - k): np.array([[1.0 - u, 0.0, 0.0, 0.0, u]]) for k, u in enumerate(layer.not_covered)
    }
    none = {level: np.zeros(1) for level in range(1, layer.channels + 1)}
    alone = Case(layer.channels, layer.per_hour, 0.0, hours, 1)
    return float(losses(Given(uncovered, {}, none, 0.0), [alone])[0].sum())


def target_text(per_hour: float) -> str:
    """Return a target per flight hour as text: 1e-7."""
    return f"{per_hour:.0e}".replace("e-0", "e-")


def interval(estimate: Estimate) -> str:
    """Return a probability with its interval, or its upper end if the data give no lower one."""
    if estimate.low is None:
        return f"< {estimate.high:.2e}"
    return f"{estimate.median:.2e} ({estimate.low:.2e} to {estimate.high:.2e})"


def decided_by(result: Result) -> str:
    """Return the cells that decide a result, the largest first, and the trials that would narrow its interval."""
    parts = [_part(contribution) for contribution in result.contributions if contribution.share >= WORTH_SAYING]
    return "; ".join(parts[:MOST]) if parts else "failure of all channels"


_OF: Final = (Column("manager", type=str), Column("channels", "case.channels"))
DECIDED: Final = (
    *_OF,
    *(
        Column("per hour", "case.per_hour", PLAIN, worth=0),
        Column("common mode", lambda result: _percent(result), worth=0),
    ),
    Column("decided by", decided_by, type=str),
)


def numbers(results: Sequence[Result]) -> list[Column]:
    """Return the columns of results: the case, the available estimates, perfect isolation, the targets."""
    every = lambda n: f"every {n}" if n > 1 else "each flight"  # noqa: E731
    shown = {what: title for what, title in TITLES.items() if any(what in result.estimates for result in results)}
    return [
        *(*_OF, Column("per hour", "case.per_hour", PLAIN)),
        Column("common", _percent, page="common mode"),
        Column("checks", lambda result: every(result.case.flights_between_checks), page="full check"),
        *(
            Column(
                title.partition(",")[0].removesuffix(" of the signal"),
                lambda result, what=what: interval(result.estimates[what]) if what in result.estimates else "",
                worth=8 - i,
                page=title,
            )
            for i, (what, title) in enumerate(shown.items())
        ),
        Column("perfect", format=".2e", worth=5, page="perfect isolation"),
        *(Column(name, f"standing.{name}", page=f"{name}, {target_text(target)}") for name, target in TARGETS.items()),
    ]


def _percent(result: Result) -> str:
    """Return the share of common mode of a result."""
    return f"{100 * result.case.beta:g} %"


def _part(of: Contribution) -> str:
    if not of.trials:
        return f"{of.cell} {100 * of.share:.0f} %"
    more = f", {of.seen} of {of.trials} not correct, {of.trials_to_halve} more trials halve the interval"
    return f"{of.cell} {100 * of.share:.0f} %{more}"
