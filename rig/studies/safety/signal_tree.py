"""The loss of one signal as a fault tree, from rates and from the manager's outcomes for the next fault.

Events are the first failure of each channel, of each LRU, and of each fixed pair of channels (common cause); `not
tolerated with g good channels` is a plain probability.  A tree has no order.  If a single fault and a pair meet, each
order is therefore an event of probability p x P(order), with P(order) one half: exact to first order of the rates.
Source: docs/explanation/reliability.md, 'Fault tree'; coverage as an event, Dugan and Trivedi (1989).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from rig.studies.reliability.rates_file import Layer
from rig.studies.safety.fault_tree import FaultTree


@dataclass(frozen=True, slots=True)
class SignalModel:
    """The inputs of a tree and its chain; chances of `not tolerated` by the good channels before the fault."""

    signal: str
    channels: int
    per_hour: float  # independent faults of one channel: (1 - beta) lambda
    pair_per_hour: float  # faults common to one fixed pair: beta lambda / C(n, 2)
    box_per_hour: float  # of the LRU of one channel
    settle_h: float
    single: Mapping[int, float]
    alike: Mapping[int, float]
    near: Mapping[int, float]  # of a second fault before the first is settled
    layers: Sequence[Layer] = field(default=())

    @property
    def one_channel(self) -> float:
        """Return the rate per hour of faults of one channel, alone or by its LRU."""
        return self.per_hour + self.box_per_hour

    def next_fault(self, good: int) -> float:
        """Return the chance that the next single fault is not tolerated, with a second one within the settling time."""
        if good == 1:
            return 1.0
        second = (good - 1) * self.one_channel * self.settle_h
        overtaken = second / (1.0 + second)
        return (1.0 - overtaken) * self.single[good] + overtaken * self.near.get(good, 1.0)


def signal_tree(model: SignalModel) -> FaultTree:
    """Return the tree of the loss of the signal, or of a layer in series with it."""
    tree = FaultTree(f"loss_of_{model.signal}", "lost")
    sums = [_signal(tree, model), *(_layer(tree, layer) for layer in model.layers)]
    tree.any_of("lost", sums, f"{model.signal} lost: annunciated loss or undetected error")
    return tree


def _signal(tree: FaultTree, model: SignalModel) -> str:
    n = model.channels
    single = [_channel(tree, model, i) for i in range(1, n + 1)]
    pairs = _pairs(tree, model)
    # A near fault of the first one is a separate event.
    not_correct = {g: model.single[g] if g == n else model.next_fault(g) for g in range(n, 1, -1)}
    lost = _in_turn(tree, "", n, single, not_correct)
    lost += _near(tree, model)
    if pairs:
        lost += _common(tree, model, single, pairs)
    failed = [_failed(tree, i, single[i - 1], pairs) for i in range(1, n + 1)]
    lost.append(tree.all_of("all_failed", failed, f"all {n} channels failed"))
    return tree.any_of("signal_lost", lost, f"{model.signal}: one of the ways to lose it")


def _channel(tree: FaultTree, model: SignalModel, i: int) -> str:
    own = tree.event(f"channel_{i}", f"channel {i} fails, any kind", model.per_hour)
    if not model.box_per_hour:
        return own
    box = tree.event(f"box_{i}", f"LRU of channel {i} fails", model.box_per_hour)
    return tree.any_of(f"channel_{i}_or_box", [own, box], f"channel {i} fails alone or with its LRU")


def _pairs(tree: FaultTree, model: SignalModel) -> dict[tuple[int, int], str]:
    if not model.pair_per_hour:
        return {}
    return {
        (i, j): tree.event(f"pair_{i}_{j}", f"channels {i} and {j} fail alike at once", model.pair_per_hour)
        for i, j in combinations(range(1, model.channels + 1), 2)
    }


def _in_turn(
    tree: FaultTree, prefix: str, n: int, failed: Sequence[str], not_correct: Mapping[int, float]
) -> list[str]:
    """Add: k of n failed, and the k-th fault not tolerated with n - k + 1 good, for each k but the last."""
    gates = []
    for good, chance in not_correct.items():
        k = n - good + 1
        event = tree.event(f"{prefix}not_correct_{good}_good", f"not tolerated with {good} good", chance=chance)
        some = tree.at_least(f"{prefix}failed_{k}_of_{n}", k, failed, f"{k} of {n} failed")
        gates.append(tree.all_of(f"{prefix}lost_at_{k}", [some, event], f"{k} failed, not tolerated with {good} good"))
    return gates


def _near(tree: FaultTree, model: SignalModel) -> list[str]:
    """Add a second fault before the first is settled: n (n - 1) lambda^2 tau an hour."""
    n = model.channels
    if n < 2:
        return []
    per_hour = n * (n - 1) * model.one_channel**2 * model.settle_h
    near = tree.event("near", "a second channel fails before the first is settled", per_hour)
    event = tree.event(
        "not_correct_near", f"two near faults not tolerated with {n} good", chance=model.near.get(n, 1.0)
    )
    return [tree.all_of("lost_by_near", [near, event], "two near faults, not tolerated")]


def _common(
    tree: FaultTree, model: SignalModel, single: Sequence[str], pairs: Mapping[tuple[int, int], str]
) -> list[str]:
    """Add a pair as the first fault, and each order of a pair with a single fault or with another pair."""
    n = model.channels
    any_pair = tree.any_of("pair", list(pairs.values()), "a common-cause pair")
    chance = model.alike.get(n, 1.0)
    event = tree.event(f"alike_not_correct_{n}_good", f"two alike not tolerated with {n} good", chance=chance)
    gates = [tree.all_of("lost_by_pair", [any_pair, event], f"two alike, not tolerated with {n} good")]
    if n < 3:
        return gates
    apart, within = [], []
    for (i, j), pair in pairs.items():
        for k, each in enumerate(single, 1):
            both = tree.all_of(f"channel_{k}_with_pair_{i}_{j}", [each, pair])
            (within if k in (i, j) else apart).append(both)
    overlapping = [
        tree.all_of(f"pair_{a}_{b}_with_pair_{c}_{d}", [one, other])
        for ((a, b), one), ((c, d), other) in combinations(pairs.items(), 2)
        if {a, b} & {c, d}
    ]
    after_single, after_pair = model.alike.get(n - 1, 1.0), model.next_fault(n - 2)
    gates += _orders(tree, "apart", apart, "a single fault and a pair of two others", after_single, after_pair)
    gates += _orders(tree, "within", within, "a single fault and a pair with its channel", model.next_fault(n - 1), 0.0)
    event = tree.event(
        "pair_then_pair_not_correct",
        f"pair, then one of its channels with a third: {n - 2} good, not tolerated",
        chance=after_pair,
    )
    two = tree.any_of("two_pairs", overlapping, "two pairs with one channel in both")
    return [*gates, tree.all_of("lost_by_two_pairs", [two, event], "two pairs, not tolerated")]


def _orders(
    tree: FaultTree, name: str, sets: Sequence[str], label: str, single_first: float, pair_first: float
) -> list[str]:
    """Add sets of a single fault and a pair with an event for each order: p x P(order).

    One order excludes the other, but a tree takes events as independent.  The second probability is therefore divided
    by the probability of not the first, so that either of the two has the sum of both.
    """
    one, other = 0.5 * single_first, 0.5 * pair_first
    events = [tree.event(f"{name}_single_then_pair", "single then pair, not tolerated: p x P(order)", chance=one)]
    if other > 0.0:
        chance = other / (1.0 - one)
        events.append(
            tree.event(
                f"{name}_pair_then_single",
                "pair then single, not tolerated: p x P(order), given not the other order",
                chance=chance,
            )
        )
    some = tree.any_of(f"pair_{name}", sets, label)
    order = tree.any_of(f"{name}_order", events, "not tolerated in one of the orders")
    return [tree.all_of(f"lost_by_{name}", [some, order], f"{label}, not tolerated")]


def _failed(tree: FaultTree, i: int, single: str, pairs: Mapping[tuple[int, int], str]) -> str:
    """Return the event that channel ``i`` has failed in any way."""
    common = [pair for members, pair in pairs.items() if i in members]
    return tree.any_of(f"channel_{i}_failed", [single, *common], f"channel {i} failed") if common else single


def _layer(tree: FaultTree, layer: Layer) -> str:
    """Add a layer in series with given coverages."""
    n, name = layer.channels, layer.name
    each = [tree.event(f"{name}_{i}", f"{name} {i} fails", layer.per_hour) for i in range(1, n + 1)]
    given = {n - k: chance for k, chance in enumerate(layer.not_covered[:-1])}
    lost = _in_turn(tree, f"{name}_", n, each, given)
    lost.append(tree.all_of(f"{name}_all_failed", each, f"all {n} failed"))
    return tree.any_of(f"{name}_lost", lost, f"layer {name} lost")
