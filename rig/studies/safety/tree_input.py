"""The inputs of a fault tree: one manager's counts and one rate, by the posterior means of the cells.

It also lists the assumptions of a safety case beside its flights; docs/explanation/reliability.md explains them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb
from pathlib import Path

import polars as pl

from rig.core.errors import BadInput
from rig.studies.reliability.compute_results import assumptions as of_chain
from rig.studies.reliability.compute_results import by_manager, require
from rig.studies.reliability.model import Given
from rig.studies.reliability.next_fault import KEPT, Outcomes, outcomes
from rig.studies.reliability.rates_file import Rates
from rig.studies.reliability.tally import Cells, together
from rig.studies.safety.fault_tree import require_name
from rig.studies.safety.signal_tree import SignalModel
from rig.studies.safety.tree_result import TreeResult


def read_model(
    folders: Sequence[Path], rates: Rates, signal: str, channels: int, hours: float, source: str
) -> SignalModel:
    """Return the model of a signal with a number of channels.

    hours  : of a flight, for the chance that all its faults come between two manoeuvres
    source : the rates file
    BadInput: several rates, several managers, a cell that was not flown, or a layer whose name XML does not allow
    """
    given = rates.signals[signal]
    for key, values in (("per_hour", given.per_hour), ("beta", given.beta)):
        if len(values) > 1:
            raise BadInput(f"{source}: {signal}.{key}: a tree needs one value, got {len(values)}: {values}")
    for i, layer in enumerate(rates.layers):
        require_name(f"{source}: layers.{i}.name", layer.name)
    flown = _one_manager(folders)
    require(flown, signal, channels, given, ", ".join(map(str, folders)))
    counts = flown.counts.filter(pl.col("signal") == signal)
    known = outcomes(counts, given.kinds, flown.manager, None, level=given.level(hours))
    per_hour, beta = given.per_hour[0], given.beta[0]
    return SignalModel(
        signal,
        channels,
        per_hour=(1.0 - beta) * per_hour,
        pair_per_hour=beta * per_hour / comb(channels, 2) if channels > 1 else 0.0,
        box_per_hour=given.box_per_hour,
        settle_h=known.settle_s / 3600.0,
        **not_correct(known),
        layers=tuple(rates.layers),
    )


def _one_manager(folders: Sequence[Path]) -> Cells:
    flown = by_manager(folders)
    if len(flown) > 1:
        raise BadInput(f"{', '.join(map(str, folders))}: a tree needs one manager, got {', '.join(flown)}")
    ((manager, parts),) = flown.items()
    return together(manager, parts)


def not_correct(known: Outcomes) -> Mapping[str, dict[int, float]]:
    """Return the chances of a fault that is not tolerated, by design and good channels; ``known`` has the mean alone.

    Pairs of faults that were not flown are never tolerated, as in the chain of `rig reliability run`.
    """
    given = Given(known.draws, known.announced, {}, 0.0)
    levels = [good for design, good in known.draws if design == "single"]
    return {
        design: {good: 1.0 - float(given.of(design, good)[0, KEPT]) for good in levels}
        for design in ("single", "alike", "near")
    }


def assumptions(rates: Rates, signal: str, result: TreeResult) -> list[str]:
    """Return the conditions under which tree, chain and sets are valid, a line each."""
    given = rates.signals[signal]
    most = max(abs(each.differs) for each in result.at)
    box = (
        f"; the LRU of a channel fails {given.box_per_hour:g} times an hour ({given.box_source})"
        if given.box_per_hour
        else ""
    )
    static = "an upper bound" if result.static == "upper bound" else result.static
    return [
        *of_chain(rates, signal, []),
        f"common mode hits each fixed pair of channels equally often, and never three channels at once{box}",
        f"the static tree is {static}: it differs from the chain by at most {100 * most:.2g} %, because "
        "an order of faults is an event of probability p x P(order)",
        "the tree has no false isolations; every flight begins without a fault",
        "sizes, times and channels of faults are as in docs/explanation/reliability.md; others change results",
    ]
