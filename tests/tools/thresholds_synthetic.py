"""Budgets of false isolations on noise of known kinds: designed on 2 h, counted in 40 h; run it by hand:

python tests/tools/thresholds_synthetic.py [hours]

Four channels at 100 Hz that differ by noise alone: white; first order with a time constant of 50 ms; white with a scale
that moves slowly (its logarithm has a standard deviation of 0.3 and a time constant of 60 s, common to all channels).
The events are false isolations of the flight's manager, which goes on with all channels after each.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from scipy.signal import lfilter

from rig.recordings.settings import RecordedSignal
from rig.thresholds.design import Flight, Grid, designs
from rig.thresholds.holdout import count
from rig.thresholds.run import STRETCHES

RATE_HZ: Final = 100.0
DESIGN_H: Final = 2.0
BUDGETS: Final = (10.0, 1.0, 0.1)
GIVEN: Final = RecordedSignal(threshold=1.0)


def first_order(rng: np.random.Generator, shape: tuple[int, int], time_s: float) -> Any:
    """Noise of standard deviation 1 and a time constant."""
    a = float(np.exp(-1.0 / (RATE_HZ * time_s)))
    start = a * rng.normal(size=(shape[0], 1))
    return lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], rng.normal(size=shape), axis=1, zi=start)[0]


KINDS: Final[dict[str, Callable[[np.random.Generator, int], Any]]] = {
    "white": lambda rng, n: rng.normal(size=(4, n)),
    "first order, 50 ms": lambda rng, n: first_order(rng, (4, n), 0.05),
    "slowly moving scale": lambda rng, n: np.exp(0.3 * first_order(rng, (1, n), 60.0)) * rng.normal(size=(4, n)),
}


def flights(kind: str, hours: float, seed: int) -> list[Flight]:
    """Flights of a quarter of an hour."""
    rng = np.random.default_rng([seed, *kind.encode()])
    n = round(900 * RATE_HZ)
    return [Flight(f"{kind} {k}", KINDS[kind](rng, n), RATE_HZ) for k in range(round(4 * hours))]


def main() -> None:
    """Print the rates of every kind, persistence and budget."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 40.0
    print(f"designed on {DESIGN_H:g} h, counted in {hours:g} h, budgets {BUDGETS} an hour; threshold: events, an hour")
    for kind in KINDS:
        design_data = [
            Flight(one.name, part, RATE_HZ)
            for one in flights(kind, DESIGN_H, 1)
            for part in np.array_split(one.samples, STRETCHES // 8, axis=1)
        ]
        test_data = flights(kind, hours, 2)
        for frames in (8, 24):
            cells: list[str] = []
            for budget in BUDGETS:
                made = designs(design_data, GIVEN, Grid(budget, (frames,), (4,), (0.0,)))[0]
                found = count(test_data, GIVEN, made, budget)[4]
                rate = found.counted / found.hours
                cells.append(f"{made.threshold.upper:.3f}: {found.counted}, {rate:.3g}{' over' if found.over else ''}")
            print(f"{kind}, {frames} frames:  " + "   ".join(cells), flush=True)


if __name__ == "__main__":
    main()
