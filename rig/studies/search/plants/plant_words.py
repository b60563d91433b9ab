"""Ranges and values of the inputs of a plant in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any, Final

from rig.studies.search.plants.plant_file import PlantPlan

_STRETCHES: Final = 4  # of a signal that are told
_NARROW: Final = 0.5  # of the range of a signal


def narrow(ranges: Mapping[str, Any], plan: PlantPlan) -> Iterator[str]:
    """Yield the numbers of a cluster with their ranges; of a signal the stretches within half of its range."""
    for name, found in ranges.items():
        if name not in plan.signals:
            yield f"{name} {_span(*found)}"
            continue
        signal, at_s = plan.signals[name], plan.duration_s / plan.signals[name].pieces
        ends = [(_span(low, high), high - low) for low, high in found]
        stretches = [(text, width, list(of)) for (text, width), of in groupby(range(len(ends)), key=ends.__getitem__)]
        told = [each for each in stretches if each[1] <= _NARROW * (signal.high - signal.low)]
        for text, _, of in told[:_STRETCHES]:
            last = of[-1] + (signal.shape == "constant")
            when = f"{of[0] * at_s:g} to {last * at_s:g} s" if last > of[0] else f"{last * at_s:g} s"
            yield f"{name} {text} at {when}"
        if (more := len(told) - _STRETCHES) > 0:
            yield f"{name} in {more} more stretch{'es' if more > 1 else ''}"


def values_told(inputs: Mapping[str, Any], plan: PlantPlan) -> Iterator[str]:
    """Yield the values of inputs; of a signal its stretches."""
    for name, of in inputs.items():
        if name in plan.signals:
            yield from narrow({name: [[value, value] for value in of]}, plan)
        elif isinstance(of, bool | str):
            yield f"{name} {of}"
        else:
            yield f"{name} {_short(of)}"


def _span(low: float, high: float) -> str:
    ends = (_short(low), _short(high))
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def _short(value: float) -> str:
    return f"{value:.3g}"
