"""The conformance test of a control law: a recorded flight in, surfaces out, and what a sound law does not do.

No answer is right for every law, so none is compared.  A law must be finite whatever the votes are, begin where the
aircraft is trimmed, and move no surface by a step because the manager has fewer channels.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, FLIGHT_INDEX, SIGNALS, SURFACES, S
from rig.flight import loop
from rig.flight.stages import redundancy
from rig.flight.unit_loop import config_of
from rig.scenario.scenario import load
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_records import LAW_INPUT, OF_LAW, TO_UNIT, Kind, Role, blank
from rig.unit.vectors import answers

_FLIGHT: Final = {  # a flight without faults, in which the law has something to do
    "faults": [],
    "duration_s": 4.0,
    "pilot": {
        "manoeuvres": [
            {"kind": "doublet", "axis": "roll_angle", "amplitude": 0.05, "start_s": 0.5, "duration_s": 2.0},
            {"kind": "doublet", "axis": "pitch_angle", "amplitude": 0.02, "start_s": 1.0, "duration_s": 2.0},
        ]
    },
}
_LEVELS: Final = (CHANNELS, 3, 2, 1, 0)  # of one signal, in turn; at 0 it has its reference, with the same value
_EACH: Final = 4  # frames at each level
_SETTLED: Final = 50  # frames before the first change
_STEP: Final = 0.01  # of the stroke, from one frame to the next
_TRIM: Final = 0.05  # of the stroke


def session() -> tuple[NDArray[Any], NDArray[Any]]:
    """Return CONFIG (1,) and LAW_INPUT (n,) of a flight of the built-in law."""
    scenario = load(None, _FLIGHT)
    rows = loop.fly_rows(scenario)
    trim = rows["flight"][0, [FLIGHT_INDEX[name] for name in SURFACES]]
    config = config_of(scenario, redundancy(scenario), trim, Role.CONTROL_LAW)
    return config, _numbered(rows, config)


def _numbered(rows: NDArray[Any], config: NDArray[Any]) -> NDArray[Any]:
    """Return ``rows`` (n,) with the fields of LAW_INPUT as records of one session."""
    made = blank(LAW_INPUT, TO_UNIT, Kind.FRAME).repeat(len(rows))
    for name in OF_LAW:
        made[name] = rows[name]
    made["frame"] = np.arange(len(rows))
    made["time_s"] = made["frame"] / config["rate_hz"][0]
    return made


def check(tested: UnitUnderTest, config: NDArray[Any], flown: NDArray[Any]) -> Iterator[tuple[str, str]]:
    """Yield each requirement with its fault, "" if none; flown : (n,) OUTPUT, the answers to ``session``."""
    yield "commands finite surfaces", _not_finite(flown)
    yield "begins at the trim surfaces", _not_trim(config, flown)
    yield "moves no surface by a step when a signal loses channels or has its reference", _steps(tested, config)


def hostile(draw: np.random.Generator, config: NDArray[Any], k: int) -> Any:
    """Return LAW_INPUT of frame k with what a manager may vote at worst."""
    asked = np.zeros((), LAW_INPUT)
    low, high = (config["signal"][0][name] for name in ("low", "high"))
    for name, others in (("voted", [np.nan]), ("reference", [np.nan, np.inf, -np.inf])):
        places = draw.integers(0, 3 + len(others), S)
        numbers = np.vstack([low, high, 0.5 * (low + high), *(np.full(S, number) for number in others)])
        asked[name] = numbers[places, np.arange(S)]
    for name in ("autopilot_command", "inertial"):
        asked[name] = draw.choice([np.nan, np.inf, -np.inf, 5e-324, 0.0, 1.0, -1.0], asked[name].shape)
    asked["level"] = 0 if k % 10 == 0 else draw.integers(0, CHANNELS + 1, S)
    asked["reference_usable"] = draw.integers(0, 2, S)
    asked["discrete_voted"] = draw.integers(0, 2, asked["discrete_voted"].shape)
    asked["discrete_level"] = draw.integers(0, CHANNELS + 1, asked["discrete_level"].shape)
    return asked


def not_finite(surface: NDArray[np.float64], k: int) -> str:
    """Return the first of the surfaces (4,) of frame k that is no finite number, "" if none is."""
    off = np.flatnonzero(~np.isfinite(surface))
    return f"frame {k}: {SURFACES[off[0]]} is {surface[off[0]]}" if len(off) else ""


def _not_finite(flown: NDArray[Any]) -> str:
    return next(filter(None, (not_finite(surface, k) for k, surface in enumerate(flown["surface"]))), "")


def _not_trim(config: NDArray[Any], flown: NDArray[Any]) -> str:
    off = np.abs(flown["surface"][0] - config["trim_surface"][0]) / _strokes(config)
    i = int(np.argmax(off))
    if off[i] <= _TRIM:
        return ""
    begun, trim = flown["surface"][0, i], config["trim_surface"][0, i]
    return f"{SURFACES[i]} begins at {begun:.4g}, the trim is {trim:.4g}; must be within {_TRIM:.0%} of its stroke"


def _strokes(config: NDArray[Any]) -> NDArray[np.float64]:
    return config["surface_high"][0] - config["surface_low"][0]


def _steps(tested: UnitUnderTest, config: NDArray[Any]) -> str:
    """Return the first step of a surface while each signal in turn loses its channels and all values stand still."""
    _, (first, *_) = session()
    asked = np.repeat(first.reshape(1), _SETTLED + S * len(_LEVELS) * _EACH)
    asked["reference"], asked["reference_usable"] = first["voted"], 1
    at = lambda k: divmod((k - _SETTLED) // _EACH, len(_LEVELS))  # noqa: E731 # signal and place in _LEVELS
    for k in range(_SETTLED, len(asked)):
        signal, place = at(k)
        asked["level"][k, signal] = _LEVELS[place]
    surface = answers(tested, config, _numbered(asked, config))["surface"]
    moved = np.abs(np.diff(surface[_SETTLED - 1 :], axis=0)) / _strokes(config)
    k, i = np.unravel_index(np.argmax(moved > _STEP), moved.shape)
    if not moved[k, i] > _STEP:
        return ""
    signal, place = at(_SETTLED + int(k))
    share = f"{moved[k, i]:.1%} of its stroke in one frame, at most {_STEP:.0%} is allowed"
    return f"{SURFACES[i]} moves by {share}, when {SIGNALS[signal].name} comes to level {_LEVELS[place]}"
