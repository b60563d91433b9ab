"""Flights of ``rig study rate-bias`` drawn at random: a check that nothing was tuned to its grid."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.random import Generator, SeedSequence

from rig.aircraft import tables
from rig.studies.rate_bias import ALL_CHANNELS, BIASES_RAD_S, HALVED, ONSETS_S, POINTS, TURBULENCE, Case, Fault, Flight

KINDS: Final = {  # of ten flights
    "all four pitch rates, drawn": 5,
    "some of four pitch rates, drawn": 1,
    "all four, growing, drawn": 1,
    "scale of a rate or attitude, drawn": 2,
    "unit's pitch rate, drawn": 1,
}
MOST: Final = {"heading": 0.6, "altitude": 120.0, "airspeed": 8.0}  # rad, m, m/s


def drawn(number: int, seed: int) -> list[Flight]:
    """Draw ``number`` flights with one fault each; each depends on ``seed`` and its own number only."""
    return [_draw(np.random.default_rng(SeedSequence(seed, spawn_key=(i,))), i) for i in range(number)]


def _draw(rng: Generator, number: int) -> Flight:
    aircraft = str(rng.choice(list(POINTS)))
    points = [point["name"] for point in tables(aircraft)["airframe"]["flight_points"]]
    onset = round(rng.uniform(ONSETS_S[0], ONSETS_S[-1]), 2)
    manoeuvres = ",".join(_manoeuvre(rng, onset) for _ in range(rng.integers(1, 5)))
    case = Case(aircraft, str(rng.choice(points)), str(rng.choice(TURBULENCE)), onset, 1 + number, manoeuvres)
    kinds = [kind for kind, share in KINDS.items() for _ in range(share)]
    return case, [_fault(rng, kinds[number % len(kinds)])]


def _manoeuvre(rng: Generator, onset: float) -> str:
    """A change of heading, altitude or airspeed before or after the onset, for good or for a while."""
    axis = str(rng.choice(list(MOST)))
    keys = f'axis="{axis}",start_s={rng.uniform(1.0, onset + 40.0):.2f},amplitude={MOST[axis] * rng.uniform(-1, 1):.3f}'
    return (
        f'{{kind="step",{keys}}}'
        if rng.random() < 0.3
        else f'{{kind="hold",duration_s={rng.uniform(5, 40):.2f},{keys}}}'
    )


def _fault(rng: Generator, kind: str) -> Fault:
    size = round(float(np.exp(rng.uniform(*np.log([BIASES_RAD_S[0], BIASES_RAD_S[-1]]))) * rng.choice([-1.0, 1.0])), 5)
    if kind.startswith("unit"):
        return Fault(kind, size, f'kind="offset",signal="inertial.pitch_rate_rad_s",offset={size}')
    if kind.startswith("scale"):
        name, factor = rng.choice(["pitch_rate", *HALVED]), round(rng.uniform(0.3, 1.7), 3)
        return Fault(kind, factor, f'kind="scale",signal="{name}",channels={ALL_CHANNELS},factor={factor}')
    keys = f'kind="offset",signal="pitch_rate",offset={size}'
    if kind.startswith("some"):
        channels = sorted(int(c) for c in rng.choice([1, 2, 3, 4], rng.integers(2, 4), replace=False))
        return Fault(kind, size, f"{keys},channels={channels}")
    ramp = f",ramp_s={rng.uniform(1, 50):.2f}" if "growing" in kind else ""
    return Fault(kind, size, f"{keys},channels={ALL_CHANNELS}{ramp}")
