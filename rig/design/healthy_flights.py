"""The healthy flights over which the references are measured: manoeuvres, turbulence, seeds."""

from __future__ import annotations

from typing import Any, Final

SEEDS: Final = (1, 2, 3, 4, 5, 6, 7, 8)  # of calibration, noise and turbulence, for every flight
TURBULENCE: Final = ("none", "light", "moderate")
Case = tuple[str, str, int]  # flight, turbulence, seed


def _manoeuvre(kind: str, axis: str, start_s: float, amplitude: float, **more: float) -> dict[str, Any]:
    return {"kind": kind, "axis": axis, "start_s": start_s, "amplitude": amplitude, **more}


def _on_the_sticks(*manoeuvres: dict[str, Any]) -> dict[str, Any]:
    return {"duration_s": 20.0, "pilot": {"autopilot_engaged": False, "manoeuvres": list(manoeuvres)}}


# Brisk but ordinary: about a third of the load factor and half of the roll rate that the stick can ask.
FLIGHTS: Final[dict[str, dict[str, Any]]] = {
    "pitch": _on_the_sticks(
        _manoeuvre("3-2-1-1", "stick_pitch", 2.0, 0.3, duration_s=3.5),
        _manoeuvre("doublet", "stick_pitch", 10.0, 0.4, duration_s=3.0),
    ),
    "roll and yaw": _on_the_sticks(
        _manoeuvre("doublet", "stick_roll", 2.0, 0.5, duration_s=2.0),
        _manoeuvre("doublet", "pedal", 10.0, 0.5, duration_s=3.0),
    ),
    "climb and turn": {
        "duration_s": 60.0,
        "pilot": {
            "manoeuvres": [
                _manoeuvre("step", "altitude", 5.0, 60.0),
                _manoeuvre("step", "heading", 30.0, 0.35),
            ],
        },
    },
}


def cases() -> list[Case]:
    """Every flight of a flight point, in order."""
    return [(flight, turbulence, seed) for flight in FLIGHTS for turbulence in TURBULENCE for seed in SEEDS]


def label(flight_point: str, case: Case) -> str:
    """A measured flight as references.toml names it."""
    flight, turbulence, seed = case
    return f"{flight_point}, {flight}, turbulence {turbulence}, seed {seed}"
