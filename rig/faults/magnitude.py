"""Magnitudes of faults: in the unit of the signal, or in thresholds of its monitor; one of the two forms is given."""

from __future__ import annotations

from typing import Any

from pydantic import model_validator

from rig.faults.settings import Act, Effect, Placed, quantity


def in_thresholds(key: str) -> str:
    """The key that gives the magnitude ``key`` in thresholds."""
    return f"{key.removesuffix('_per_s')}_thresholds_per_s" if key.endswith("_per_s") else f"{key}_thresholds"


def threshold_quantity(key: str, **bounds: Any) -> Any:
    """The setting of the magnitude ``key`` in thresholds."""
    unit = "thresholds/s" if key.endswith("_per_s") else "thresholds"
    return quantity(unit, f"or instead of `{key}`: in thresholds of the signal's monitor", None, **bounds)


def require_one(fault: Placed, *keys: str) -> None:
    """ValueError unless exactly one of ``keys`` is given."""
    if sum(getattr(fault, key) is not None for key in keys) != 1:
        raise ValueError(f"either {' or '.join(keys)}")


def one_form(key: str) -> Any:
    """A validator of a kind: the magnitude ``key`` is given in one of its two forms."""

    def check(fault: Placed) -> Placed:
        require_one(fault, key, in_thresholds(key))
        return fault

    return model_validator(mode="after")(check)


def sized(fault: Placed, act: Act, key: str, second: float = 0.0) -> Effect:
    """The effect with the magnitude ``key`` in the form that is given."""
    value = getattr(fault, key)
    if value is not None:
        return Effect(act, value, second)
    return Effect(act, getattr(fault, in_thresholds(key)), second, thresholds=True)
