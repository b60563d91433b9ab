"""Margins of a signal of a scenario: at given thresholds, and at the one that meets a target."""

from __future__ import annotations

from collections.abc import Sequence

from rig.errors import BadInput
from rig.frame import INDEX
from rig.reliability.margin import Effort, Margin, margin
from rig.reliability.margin_bench import Bench
from rig.reliability.margin_target import threshold_for
from rig.reliability.recorded import recording
from rig.scenario import load
from rig.text import choices, quoted


def run(
    signal: str,
    scenario: str,
    sets: Sequence[str],
    thresholds: Sequence[float] | None,
    persistence: int | None,
    target: float | None,
    seed: int,
    effort: Effort,
) -> tuple[list[Margin], Margin | None]:
    """Return the margins at ``thresholds``, the scenario's own when not given, and the one that meets ``target``.

    The truth is that of the healthy flight of the scenario as it is, with the overrides ``sets``.
    BadInput: signal, scenario, a setting, a degenerate estimate, a target that nothing meets.
    """
    if signal not in INDEX:
        raise BadInput(f"unknown signal {quoted(signal)}, {choices(signal, INDEX, 'rig signals')}")
    flown = load(scenario, sets)
    recorded = recording(flown, flown.seed)
    key = f"redundancy.signals.{signal}"
    more = [] if persistence is None else [f"{key}.persistence={persistence}"]
    own = Bench(load(scenario, [*sets, *more]), signal, recorded)

    def at(threshold: float) -> Bench:
        return Bench(load(scenario, [*sets, *more, *own.sets(threshold)]), signal, recorded)

    benches = [own] if thresholds is None else [at(one) for one in thresholds]
    found = [] if target is not None and thresholds is None else [margin(bench, seed, effort) for bench in benches]
    chosen = None if target is None else threshold_for(at, own.threshold, target, seed, effort)
    return found, chosen
