"""The loss of a signal from the flown minimal sets: a tree with the modes of a channel as events, and the chain.

A channel fails once, in one mode.  The tree takes its modes as independent events, so that two can happen to one
channel; the result is an upper bound.  In the chain a state is the sequence of modes so far, and each order has its
probability.  Neither includes common cause or the reference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path

from rig.core.errors import BadInput
from rig.studies.reliability.rates_file import SignalRates
from rig.studies.safety.confirm_sets import claims
from rig.studies.safety.cutset_plan import read_asked
from rig.studies.safety.fault_tree import FaultTree
from rig.studies.safety.sequences import CONDITIONS, MOST, Modes
from rig.studies.safety.signal_chain import LOST, Transitions


@dataclass(frozen=True)
class ModeModel:
    """The minimal sets of modes of channels, with the probability of each of their orders."""

    signal: str
    channels: int
    per_hour: Mapping[str, float]  # of one channel, by mode
    orders: Mapping[Modes, float]  # lost share of each order of each minimal set

    def sets(self) -> dict[Modes, float]:
        """Return the sets by their modes in alphabetical order, with the mean probability of their orders."""
        found: dict[Modes, list[float]] = {}
        for order, chance in self.orders.items():
            found.setdefault(tuple(sorted(order)), []).append(chance)
        return {modes: sum(chances) / len(chances) for modes, chances in found.items()}


def read_mode_model(
    folder: Path, given: SignalRates, signal: str, channels: int, hours: float, source: str
) -> ModeModel:
    """Return the model of a folder of cut sets; of a set in several conditions, the one with the most losses.

    Faults with level flight between them come before one manoeuvre by the chance of the rates file.
    BadInput: cut sets of another signal, or no set of channels' modes, so that the top event cannot happen.
    """
    asked = read_asked(folder)
    if asked.signal != signal:
        raise BadInput(f"{folder}: has cut sets of {asked.signal}, not of {signal}")
    if len(given.per_hour) > 1:
        raise BadInput(
            f"{source}: {signal}.per_hour: a tree needs one value, got {len(given.per_hour)}: {given.per_hour}"
        )
    orders: dict[Modes, float] = {}
    for claim in claims(folder):
        if CONDITIONS[claim.condition].gap == "settled":
            weight = given.level(hours) ** (len(claim.modes) - 1)
            for order, (lost, flown) in claim.sequences.items():
                if sorted(order) == sorted(claim.modes) and set(order) <= set(given.kinds):
                    orders[order] = max(orders.get(order, 0.0), weight * lost / flown)
    if not any(orders.values()):
        raise BadInput(f"{folder}: no settled set of the kinds in {source} loses {signal}; the top event cannot happen")
    alone = (1.0 - given.beta[0]) * given.per_hour[0]
    return ModeModel(signal, channels, {kind: alone * share for kind, share in given.kinds.items()}, orders)


def mode_tree(model: ModeModel) -> FaultTree:
    """Return the tree: every set on every choice of channels, and all channels failed."""
    tree, n = FaultTree(f"loss_of_{model.signal}_by_sets", "lost"), range(1, model.channels + 1)
    events = {
        (mode, i): tree.event(f"{mode}_{i}", f"channel {i}: {mode}", rate)
        for i, (mode, rate) in product(n, model.per_hour.items())
    }
    tops = []
    for number, (modes, chance) in enumerate(sorted(model.sets().items()), 1):
        name = ", ".join(modes)
        chosen = sorted({tuple(sorted(zip(modes, on, strict=True))) for on in permutations(n, len(modes))})
        gates = [
            tree.all_of(f"set_{number}_{k}", [events[place] for place in places]) for k, places in enumerate(chosen, 1)
        ]
        some = tree.any_of(f"set_{number}", gates, name)
        lost = tree.event(f"set_{number}_not_correct", f"{name}: not tolerated, mean of its orders", chance=chance)
        tops.append(tree.all_of(f"lost_by_set_{number}", [some, lost], f"{name}, not tolerated"))
    failed = [
        tree.any_of(f"channel_{i}", [events[mode, i] for mode in model.per_hour], f"channel {i} failed") for i in n
    ]
    tops.append(tree.all_of("all_failed", failed, f"all {model.channels} channels failed"))
    tree.any_of("lost", tops, f"{model.signal} lost")
    return tree


def mode_chain(model: ModeModel) -> Transitions:
    """Return the transitions by the sequence of modes so far; from order 3 on, only the number of channels counts."""
    steps: Transitions = []
    for length in range(model.channels):
        for so_far in product(model.per_hour, repeat=min(length, MOST)):
            for mode, rate in model.per_hour.items():
                order = (*so_far, mode)
                chance = 1.0 if length + 1 == model.channels else model.orders.get(order, 0.0)
                per_hour = (model.channels - length) * rate
                kept = [(_name(so_far), _name(order[:MOST]), per_hour * (1.0 - chance))] if chance < 1.0 else []
                lost = [(_name(so_far), LOST, per_hour * chance)] if chance > 0.0 else []
                steps += kept + lost
    return steps


def _name(modes: Modes) -> str:
    return ", ".join(modes) or "none"
