"""What ``rig reliability`` prints for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rig.reliability.chain import ChainResult
from rig.reliability.plan import Needed
from rig.reliability.rates import SignalRates
from rig.reliability.result import TARGETS, TITLES, Result, decided_by, interval
from rig.util.console import console

if TYPE_CHECKING:
    from rig.reliability.margin import Margin


def chain(found: ChainResult) -> None:
    """The states, and the sum over those that nothing leaves."""
    screen = console()
    screen.table(
        ("state", f"probability after {found.hours:g} h", ""),
        ((name, f"{p:.12e}", "death" if name in found.death else "") for name, p in found.probability.items()),
    )
    screen.print(f"death states: {found.of_death:.12e}" if found.death else "no death state: every state is left")


def run(found: Sequence[Result], given: SignalRates, assumptions: Sequence[str]) -> None:
    """Assumptions first, then the numbers, then what decides them."""
    screen = console()
    screen.print("This holds if:")
    for line in assumptions:
        screen.print(f"  - {line}")
    screen.print("")
    screen.print(f"{found[0].signal}: probability per flight hour, median (95 %)")
    shown = [what for what in TITLES if any(what in one.estimates for one in found)]
    heads = ("manager", "channels", "per hour", "common", "checks", *(TITLES[what] for what in shown), "perfect")
    screen.table((*heads, *TARGETS), (_row(one, shown) for one in found))
    screen.print("")
    screen.table(
        ("manager", "channels", "decided by"),
        ((one.manager, str(one.case.channels), decided_by(one)) for one in _first_of_each(found, given)),
    )


def _row(one: Result, shown: Sequence[str]) -> tuple[str, ...]:
    case = one.case
    checks = f"every {case.flights_between_checks}" if case.flights_between_checks > 1 else "each flight"
    return (
        one.manager,
        str(case.channels),
        f"{case.per_hour:g}",
        f"{100 * case.beta:g} %",
        checks,
        *(interval(one.estimates[what]) if what in one.estimates else "" for what in shown),
        f"{one.perfect:.2e}",
        *("met" if met else "not met" for met in one.requirement.values()),
    )


def _first_of_each(found: Sequence[Result], given: SignalRates) -> list[Result]:
    """One case of each manager and number of channels: the first rate and share, checked after each flight."""
    first = (given.per_hour[0], given.beta[0], 1)
    return [one for one in found if (one.case.per_hour, one.case.beta, one.case.flights_between_checks) == first]


def plan(found: Sequence[Needed], cost_s: Sequence[float | None]) -> None:
    """A row for each number of good channels."""
    screen = console()
    screen.table(
        ("good before", "not kept, at most", "trials without one", "how", "here, one core"),
        (
            (
                str(one.good_before),
                f"{one.chance:.3g}" if one.chance < 1.0 else "any",
                f"{one.trials:,}",
                "open loop" if one.open_loop else "flights",
                "" if seconds is None else f"{seconds:.3g} s",
            )
            for one, seconds in zip(found, cost_s, strict=True)
        ),
    )


def margins(signal: str, found: Sequence[Margin], target: float | None, chosen: Margin | None) -> None:
    """A row for each threshold; the one that meets the target last."""
    screen = console()
    screen.print(f"{signal}: false isolations of a healthy channel, an hour (95 %)")
    screen.table(
        ("threshold", "an hour", "in the first frames", "sets of errors", "repetitions"),
        (_margin(one) for one in (*found, *([] if chosen is None else [chosen]))),
    )
    if chosen is not None:
        screen.print(f"at most {target:g} an hour: threshold {chosen.threshold:.5g}")


def _margin(one: Margin) -> tuple[str, ...]:
    if one.per_hour is None:
        return f"{one.threshold:.5g}", f"< 1e-12 (at most {one.high:.1e})", "", "", ""
    rate = f"{one.per_hour:.3e} ({one.low:.3e} to {one.high:.3e})"
    cut = f", {one.cut} excursions cut off" if one.cut else ""
    sets = f"{min(one.sets)} to {max(one.sets)}{cut}"
    return f"{one.threshold:.5g}", rate, f"{one.at_start:.1e} a flight", sets, str(one.repetitions)
