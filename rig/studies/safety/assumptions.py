"""What a safety case rests on beside its flights, one line each; docs/safety.md explains them."""

from __future__ import annotations

from rig.studies.reliability.compute_results import assumptions as of_chain
from rig.studies.reliability.rates_file import Rates
from rig.studies.safety.tree_result import TreeResult


def assumptions(rates: Rates, signal: str, result: TreeResult) -> list[str]:
    """Return the conditions under which tree, chain and sets hold."""
    given = rates.signals[signal]
    most = max(abs(each.differs) for each in result.at)
    box = f"; its box fails {given.box_per_hour:g} times an hour ({given.box_source})" if given.box_per_hour else ""
    return [
        *of_chain(rates, signal, []),
        f"common mode hits one of the fixed pairs of channels, each as often; never three at once{box}",
        f"the static tree is {result.static}: it differs from the chain by at most {100 * most:.2g} %, as an order of "
        "faults is an event of probability p x P(order)",
        "false isolations are not in the tree; every flight begins without a fault",
        "sizes, moments and channels of faults are drawn as docs/safety.md says: others give other chances",
    ]
