"""Flights long enough for the slow-fault tests to learn, with small faults; then one of the other flights."""

from __future__ import annotations

from dataclasses import replace
from math import sin
from random import Random

from oracle_flights import Flight, Pick, before_the, filtered, slow_faults, with_commands

BESIDE = 1.0 / 1024.0
STUCK = 0.022  # of two alike, off the truth of the onset
BY_SQUARES = ("noise", "oscillation", "third noise")  # of which the tests tell something only after five seconds
SINGLE = ("none", "offset", "drift", "noise", "noise", "noise", "oscillation", "stuck")
PAIRS = ("pair", "pair drift", "pair oscillation", "pair stuck")
FAULTS = (*SINGLE, *(*PAIRS, "third", "third", "third", "third noise") * 3)
STOP = 3.34375  # an end of the range, where samples are cut off


def slow_tests(flight: Flight, pick: Pick) -> Flight:
    """The flight after some seconds with the tests on, alone or with another rule beside them."""
    more = {
        "slow_means": pick([1.0, 1.3]),
        "slow_squares": pick([1.0, 1.7]),
        "slow_halves": pick([1.0, 1.0, 1.0, 2.0]),
        "slow_bias": pick([0.05, 0.3]),
        "slow_scale": pick([0.0, 0.01]),
        "slow_noise": pick([0.01, 0.03]),
        "slow_skew": pick([0.0, 0.5, 3.0]),
        "slow_reference": pick([0.0, 0.05, 0.02, 0.02, 0.01]),
        "slow_reference_frames": pick([0.0, 1.0]),
        "high": pick([*[flight.settings.high] * 4, STOP]),
    }
    beside = {name: getattr(flight.settings, name) + BESIDE for name in ("threshold", "reference_threshold")}
    flight = replace(flight, settings=replace(flight.settings, **beside, **more))
    changed = pick([as_it_is, as_it_is, filtered, slow_faults, slow_faults])(flight, pick)
    return within_range(pick([as_it_is, with_commands])(before_the(changed, some_seconds(changed, pick)), pick))


def within_range(flight: Flight) -> Flight:
    """The flight with every sample above the range cut off at its end."""
    high = flight.settings.high
    return replace(flight, samples=[[None if x is None else min(x, high) for x in row] for row in flight.samples])


def as_it_is(flight: Flight, _: Pick) -> Flight:
    return flight


def some_seconds(flight: Flight, pick: Pick) -> Flight:
    """Noise of 0.02 and biases up to 0.1 on a value that moves little, and a fault after some seconds."""
    s, seed = flight.settings, pick(range(10**6))
    random, other = Random(seed), Random(-seed - 1)
    burst, glitch = burst_of_two(other), reference_glitch(other)
    calm, after, fault = pick([150, 380, 380, 600]), pick([120, 260]), pick(FAULTS)
    calm = 600 if fault in BY_SQUARES else calm
    after = 260 if fault in ("pair stuck", "third noise") else after
    slope, swing, bias = pick([0.0, 0.002]), pick([0.0, 0.3]), [random.uniform(-0.1, 0.1) for _ in range(4)]
    apart = pick([0, 20, 20])  # frames, between two that fail before a third
    size, wrong = pick([0.08, 0.15, 0.3, 0.6]) * pick([1, -1]), random.sample(range(s.channels), 2)
    left = random.choice([c for c in range(s.channels) if c != wrong[0]])
    slope, swing = (0.0, 0.0) if fault == "pair stuck" else (slope, swing)
    off, holds = pick([None, 0.0, 0.2, 0.2]), dict[int, float]()
    samples, references = list[list[float | None]](), list[float | None]()
    for k in range(calm + after):
        truth, row = 3.0 + slope * k + swing * sin(k / 40.0), list[float | None]()
        for c in range(4):
            x = truth + bias[c] + random.gauss(0.0, 0.02)
            if k >= calm and c in (wrong if fault.startswith("pair") else wrong[:1]):
                kind = fault.removeprefix("pair").removeprefix("third").strip() or "offset"
                hold = holds.setdefault(c, truth + bias[c] + STUCK if fault == "pair stuck" else x)
                x = faulty(kind, x, size, k - calm, random, hold)
            if fault.startswith("third") and c not in (wrong[0], left) and k > 20 + apart * c:
                x -= 5.0
            x += burst.get((k, c), 0.0)
            row.append(x if c < s.channels and random.random() > 0.001 else None)
        samples.append(row)
        references.append(None if off is None else truth + off + random.gauss(0.0, 0.004) + glitch.get(k, 0.0))
    n = len(samples)
    return Flight(s, samples, [("absent",) * 4] * n, references, [None] * n, [()] * n)


def burst_of_two(random: Random) -> dict[tuple[int, int], float]:
    """What two channels are off for up to three frames, by frame and channel, alike or not; of most flights nothing."""
    start, frames, two = random.randrange(20, 600), random.randint(1, 3), random.sample(range(4), 2)
    off = random.choice([(0.0, 0.0), (0.0, 0.0), (5.0, 5.0), (5.0, 8.0), (3.0, 6.0)])
    return {(start + k, c): error for k in range(frames) for c, error in zip(two, off, strict=True)}


def reference_glitch(random: Random) -> dict[int, float]:
    """What the reference is off for a moment, by frame; of most flights nothing."""
    start, (size, frames) = random.randrange(20, 500), random.choice([(0.0, 0)] * 4 + [(9.0, 1), (-9.0, 1), (4.0, 90)])
    return dict.fromkeys(range(start, start + frames), size)


def faulty(fault: str, x: float, size: float, k: int, random: Random, hold: float) -> float:
    """A sample, ``k`` frames after the onset; hold : that of the onset."""
    moved = {
        "offset": size,
        "drift": size * k / 50.0,
        "noise": random.gauss(0.0, abs(size)),
        "oscillation": size * sin(k / 6.0),
        "stuck": hold - x,
    }
    return x + moved.get(fault, 0.0)
