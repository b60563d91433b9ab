"""The model of the fault tree as a chain of constant rates: a check of the tree, a file for `rig reliability chain`.

By symmetry a state is the number of good channels.  C(g, 2) of the fixed pairs hit two good channels, g k hit one and
act as a single fault, and the others hit none.
Source: docs/explanation/reliability.md, 'The model'.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import comb, prod

import numpy as np

from rig.core.errors import BadInput
from rig.studies.reliability.chain import MOST_STATES, probabilities
from rig.studies.reliability.rates_file import Layer
from rig.studies.safety.signal_tree import SignalModel

LOST = "lost"
Way = tuple[int, int | None, float]  # from a number of good channels to a number, None: lost; per hour


def ways(model: SignalModel) -> Iterator[Way]:
    """Yield the transitions of the signal alone."""
    n = model.channels
    for good in range(n, 0, -1):
        hit_one = good * (model.one_channel + (n - good) * model.pair_per_hour)
        yield from _next(good, 1, hit_one, model.next_fault(good))
        if model.pair_per_hour and good >= 2:
            yield from _next(good, 2, comb(good, 2) * model.pair_per_hour, model.alike.get(good, 1.0))


def layer_ways(layer: Layer) -> Iterator[Way]:
    """Yield the transitions of a layer."""
    for k, chance in enumerate(layer.not_covered):
        yield from _next(layer.channels - k, 1, (layer.channels - k) * layer.per_hour, chance)


def _next(good: int, hit: int, per_hour: float, not_correct: float) -> Iterator[Way]:
    if good > hit:
        yield good, good - hit, per_hour * (1.0 - not_correct)
        yield good, None, per_hour * not_correct
    else:
        yield good, None, per_hour


Transitions = list[tuple[str, str, float]]


def transitions(model: SignalModel) -> Transitions:
    """Return the transitions of the signal and its layers together, by the names of the states."""
    parts: list[tuple[str, int, list[Way]]] = [("good", model.channels, list(ways(model)))]
    parts += [(layer.name, layer.channels, list(layer_ways(layer))) for layer in model.layers]
    count = prod(n for _, n, _ in parts) + 1
    if count > MOST_STATES:
        raise BadInput(f"{len(model.layers)} layers make a chain of {count} states; at most {MOST_STATES} are allowed")
    return [
        (_state(parts, at), LOST if to is None else _state(parts, (*at[:i], to, *at[i + 1 :])), per_hour)
        for at in product(*(range(n, 0, -1) for _, n, _ in parts))
        for i, (_, _, of_part) in enumerate(parts)
        for good, to, per_hour in of_part
        if good == at[i] and per_hour > 0.0
    ]


def _state(parts: Sequence[tuple[str, int, list[Way]]], at: Sequence[int]) -> str:
    return ", ".join(f"{good} {name}" for (name, _, _), good in zip(parts, at, strict=True))


def lost(steps: Transitions, hours: float) -> float:
    """Return the probability of ``lost`` after ``hours``, from the first named state."""
    names = list(dict.fromkeys(name for step in steps for name in step[:2]))
    place = {name: i for i, name in enumerate(names)}
    matrix = np.zeros((len(names), len(names)))
    for of, to, per_hour in steps:
        matrix[place[of], place[to]] += per_hour
    return float(probabilities(matrix, 0, hours)[place[LOST]])


def chain_file(steps: Transitions, hours: float, title: str) -> str:
    """Return the text of a file for `rig reliability chain`."""
    lines = [f'    {{ from = "{of}", to = "{to}", per_hour = {per_hour!r} }},' for of, to, per_hour in steps]
    head = [f"# {title}: rig reliability chain FILE", f"hours = {hours!r}", f'start = "{steps[0][0]}"']
    return "\n".join([*head, "transitions = [", *lines, "]"]) + "\n"
