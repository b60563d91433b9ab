"""Design the slow-fault tests of a signal from healthy flights: factors on their limits, and the reference's error.

The tests run over every flight, and isolate no channel: first with factors of 1, then with those that follow.  A share
is what a statistic reaches of its bare limit.  A residual counts up to a step that grows with the factor, so with a
larger factor the share of a channel that differs for good is larger, too: factors are raised until they hold.

factors    RESERVE times the largest share of the means, of the mean of squares and of the halves, and at least LEAST
reference  level: REFERENCE_RESERVE times the largest error at rest, a mean over 25 frames without the learned bias;
           and the share of the rate of motion by which larger errors in motion exceed it
hold-out   every second flight designs, the shares of the others are counted that exceed the factors; and the other way
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.slow_halves import MEANS_FROM, SQUARES_FROM
from rig.computer.redundancy.slow_tests import isolate_slow
from rig.computer.redundancy.slow_tests_config import SlowTests, tests_params
from rig.computer.redundancy.state import new_state
from rig.core.kernels import long_kernel
from rig.core.threads import heed
from rig.core.units.angles import difference
from rig.studies.thresholds.design import rounded_up
from rig.studies.thresholds.residual_series import ILM, VALID, wide
from rig.studies.thresholds.slow_test_delays import Delays, delays

Floats = NDArray[np.float64]
RESERVE: Final = 1.3  # of the factors
# Factors where the data ask for less.  Halves have no reserve: their reference decides, and a pair that is suspected
# late is mistaken for one channel.
LEAST: Final = {"factor": 1.1, "squares_factor": 1.1, "halves_factor": 1.0}
REFERENCE_RESERVE: Final = 1.2
LEAST_ERROR: Final = 0.02  # thresholds: what a reference is trusted to at most
MOST_ERROR: Final = 0.4  # thresholds: a reference in error by more decides nothing
FACTORS: Final = tuple(LEAST)
FIELDS: Final = ("slow_means", "slow_squares", "slow_halves")  # of PARAMS, in the same order
HELD: Final = 1.05  # of a factor, which the next may be: then it holds
ROUNDS: Final = 10
DESIGNED: Final = (*FACTORS, "reference_error", "reference_frames")  # keys
BINS: Final = 40  # of the rate of motion
BIN: Final = 0.01  # thresholds a frame: width of a bin
REFERENCE_KNOWN: Final = 500  # frames that are learned of a reference before its error counts
ERROR_FRAMES: Final = 25.0  # of the mean that its error is
DIGITS: Final = 3


class Measured(NamedTuple):
    """A flight's largest shares (3,) in the order of FACTORS, its reference's errors (BINS,), noise and allowance.

    errors : largest by rate of motion, unit of the signal; 0: none
    noise, allowance : mean standard deviation, and mean allowance for motion, the same unit
    """

    shares: Floats
    errors: Floats
    noise: float
    allowance: float


@dataclass(frozen=True, slots=True)
class SlowDesign:
    """The designed keys of ``slow_tests``, and what they were designed from; amounts in the unit of the signal."""

    keys: dict[str, float]
    shares: dict[str, float]  # largest of all flights, by factor
    beyond: int | None  # held-out flights beyond the factors of the others; None: one flight alone
    flights: int
    noise: float
    allowance: float
    delays: Delays
    in_motion: Delays  # with that allowance

    @property
    def reserves(self) -> dict[str, float | None]:
        """Return what each factor is of the largest share; None where the data have none."""
        return {name: self.keys[name] / share if share > 0.0 else None for name, share in self.shares.items()}

    @property
    def notes(self) -> list[str]:
        """Return what limits the design: held-out flights beyond it, no flight that was long enough, one alone."""
        if not any(self.shares.values()):
            return ["slow-fault tests: no flight lasts until they know noise and biases; the factors are the least"]
        if self.beyond is None:
            return ["slow-fault tests: one flight alone; nothing is held out"]
        if self.beyond:
            return [
                f"slow-fault tests: {self.beyond} of {self.flights} held-out flights exceed the factors of the others"
            ]
        return []

    def in_unit(self, scale: float) -> SlowDesign:
        """Return the design in a unit that is ``scale`` of this one."""
        keys = {key: _rounded(value / scale) if key == "reference_error" else value for key, value in self.keys.items()}
        return replace(self, keys=keys, noise=self.noise / scale, allowance=self.allowance / scale)


def watched(flight: tuple[Floats, Floats | None], params: Any, tests: Mapping[str, Any]) -> Measured:
    """Run the tests over a flight; shares are of the bare limits, whatever the factors.

    flight : samples (n, CHANNELS), NaN if one is not comparable, and the reference (n,)
    params : PARAMS record of the signal; tests : its fields of the tests
    """
    heed()
    samples, reference = flight
    factors = np.array([tests[name] for name in FIELDS])
    bare = wide(params)
    tested = bare.copy()
    for name, value in tests.items():
        tested[name] = value
    shares, errors, noise = np.zeros(len(FACTORS)), np.zeros(BINS), np.zeros(3)
    reference = np.full(len(samples), np.nan) if reference is None else np.ascontiguousarray(reference)
    width, given = BIN * float(params["threshold"]), (VALID, ILM)
    state, out = new_state(bare), (shares, errors, noise)
    _watch(np.ascontiguousarray(samples), reference, given, (bare, tested), state, width, out)
    deviation, allowance = (float(total) for total in noise[:2] / max(noise[2], 1.0))
    return Measured(shares * factors, errors, deviation, allowance)


def settled(
    measure: Callable[[Mapping[str, float]], list[Measured]], threshold: float, reserve: float = RESERVE
) -> list[Measured] | None:
    """Return what was measured in all flights when the factors that follow from it held; None: none do.

    measure : flights with given factors
    """
    flights = measure(dict.fromkeys(FACTORS, 1.0))
    for _ in range(ROUNDS):
        keys = keys_of(flights, threshold, reserve)
        factors = {name: keys[name] for name in FACTORS}
        again = measure(factors)
        needed = keys_of(again, threshold, reserve)
        if all(needed[name] <= HELD * factors[name] for name in FACTORS):
            return flights
        flights = again
    return None


def slow_design(
    flights: Sequence[Measured],
    given: SlowTests,
    thresholds: tuple[float, int],
    rate_hz: float,
    reserve: float = RESERVE,
) -> SlowDesign:
    """Return the design from what was measured in ``flights``, of which there is one at least.

    given : figures of the sensor; thresholds : that of all channels, unit of the signal, and how many channels
    """
    threshold, channels = thresholds
    keys, largest = keys_of(flights, threshold, reserve), _largest(flights)
    halves = (flights[0::2], flights[1::2])
    beyond = None
    if all(halves):
        beyond = sum(_beyond(keys_of(one, threshold, reserve), other) for one, other in (halves, halves[::-1]))
    noise, allowance = (float(np.median(of)) for of in zip(*(flight[2:] for flight in flights), strict=True))
    tests = given.model_copy(update=keys)
    sensor = (tests, tests.sheet(None), threshold, max(noise, 1e-300), (channels, rate_hz))
    told = (noise, allowance, delays(*sensor), delays(*sensor, allowance))
    return SlowDesign(keys, dict(zip(FACTORS, largest, strict=True)), beyond, len(flights), *told)


def keys_of(flights: Sequence[Measured], threshold: float, reserve: float = RESERVE) -> dict[str, float]:
    """Return the keys of ``slow_tests``; those of the reference only if it was seen and is exact enough."""
    keys = {
        name: _rounded(max(LEAST[name], reserve * share))
        for name, share in zip(FACTORS, _largest(flights), strict=True)
    }
    errors = REFERENCE_RESERVE * np.max([flight.errors for flight in flights], axis=0)
    level = max(float(errors[0]), LEAST_ERROR * threshold)
    if errors.any() and level < MOST_ERROR * threshold:
        rises = [(float(e) - level) / (BIN * threshold * b) for b, e in enumerate(errors) if b > 0 and e > 0.0]
        keys |= {"reference_error": _rounded(level), "reference_frames": _rounded(max(0.0, *rises, 0.0))}
    return keys


def _largest(flights: Sequence[Measured]) -> list[float]:
    return [float(share) for share in np.max([flight.shares for flight in flights], axis=0)]


def _beyond(keys: Mapping[str, float], flights: Iterable[Measured]) -> int:
    """Count the flights with a share beyond its factor."""
    limits = np.array([keys[name] for name in FACTORS])
    return sum(bool((flight.shares > limits).any()) for flight in flights)


def _rounded(value: float) -> float:
    return rounded_up(value * (1.0 - 1e-12), DIGITS)  # 1.3 times 0.9 is 1.17


@long_kernel
def _watch(samples, reference, given, params, state, width, out):
    """Write the largest shares and errors of a flight, and the sums of its noise and allowance, and of frames.

    width : of a bin, changes of a frame
    """
    p, q, st, off = params[0][0], params[1][0], state[0], 0.0
    (valid, ilm), (shares, errors, noise) = given, out
    t = st["tests"]
    for k in range(len(samples)):
        manage_signal(samples[k], valid, ilm, reference[k], np.nan, p, st)
        isolate_slow(reference[k], st["last_n"], q, st)
        if st["last_n"] < 2 or t["learned"] < MEANS_FROM:
            continue
        variance = max(t["noise"], t["shaken"], q["slow_noise"] ** 2)
        noise[0] += np.sqrt(variance)
        moved = abs(difference(t["last_middle"], t["usual_middle"], p["wraps"]))
        noise[1] += 2.0 * q["slow_scale"] * moved + q["slow_skew"] * t["motion"]
        noise[2] += 1.0
        for c in range(p["fitted"]):
            means = max(abs(t["fast"][c]) / t["fast_limit"], abs(t["slow"][c]) / t["slow_limit"])
            shares[0] = max(shares[0], means)
            if t["learned"] >= SQUARES_FROM:
                shares[1] = max(shares[1], (t["square"][c] / t["healthy"] - 1.0) / t["square_limit"])
        shares[2] = max(shares[2], t["halves_share"])
        if t["reference_learned"] > REFERENCE_KNOWN and np.isfinite(t["reference_off"]):
            off += (t["reference_off"] - off) / ERROR_FRAMES
            b = min(int(t["motion"] / width), BINS - 1)
            errors[b] = max(errors[b], abs(off))


def bare_tests(given: SlowTests, factors: Mapping[str, float] | None = None) -> Mapping[str, Any]:
    """Return the fields of PARAMS of the tests with ``factors``, or factors of 1, from figures that ``given`` has."""
    return tests_params(given.model_copy(update=dict(factors or dict.fromkeys(FACTORS, 1.0))), None)
