"""Flights for the oracle: stretches of constant offsets on a common ramp, with dropouts, monitors and a reference.

One builder for two sources of choices: hypothesis, which shrinks what fails, and a seeded generator, whose even
draws reach the rules for few votes far more often.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, permutations, product
from typing import Any

import numpy as np
from hypothesis import strategies as st
from oracle_answers import TIE_BREAKS, Settings

Pick = Callable[[Sequence[Any]], Any]

LEVELS = [0.0, 0.25, 0.5, 1.0, 1.5, 3.0, 3.5, -3.0, 6.0, -6.0, 9.25]
SPLIT = list(permutations([0.0, 0.25, 2.5, 2.75]))  # 2:2
NOISY = list(permutations([0.0, 1.25, 2.75, 3.0]))  # 1:1:2, as noise makes it of a 2:2
APART = list(permutations([0.0, 1.5, 3.0, -1.5]))  # 1:1:1:1; with a channel silent 1:1:1
TOGETHER = list(permutations([0.0, 0.25, 0.5, 0.5]))
SLOPES = [0.0, 0.0, 0.125, -0.125, 0.5]
SAYS = list(product(["good", "bad", "absent"], repeat=4))
ONE_GOOD = list(permutations(["good", "bad", "bad", "bad"]))
TWO_GOOD = list(permutations(["good", "good", "bad", "bad"]))
ONE_SIDE = [()]  # a good and a bad pair, as the samples split
NO_MONITOR = [("absent",) * 4]
MONITORS = [SAYS, ONE_GOOD, TWO_GOOD, ONE_SIDE, ONE_SIDE, NO_MONITOR, NO_MONITOR]
REFERENCES = [None, None, 0.0, 0.25, 3.0, -1.5, 1.5, 6.25]
SECONDS = [*REFERENCES, 3.25, 2.5, -2.0]
ORDERS = list(permutations(TIE_BREAKS))
NO_CHANNEL = [()]
ONE_OR_TWO = [c for n in (1, 2) for c in permutations(range(4), n)]
ALL_BUT_ONE = [*permutations(range(4), 3), (0, 1, 2, 3)]


@dataclass
class Flight:
    settings: Settings
    samples: list[list[float | None]] = field(default_factory=list)
    ilm: list[tuple[str, ...]] = field(default_factory=list)
    references: list[float | None] = field(default_factory=list)
    seconds: list[float | None] = field(default_factory=list)
    lanes: list[tuple[int, ...]] = field(default_factory=list)  # channels whose computers are failed
    resets: list[tuple[int, ...]] = field(default_factory=list)  # channels commanded to be readmitted
    readmit_frames: int = 100

    @property
    def frames(self) -> list[tuple[Any, ...]]:
        """Samples, monitors, references and failed computers of each frame."""
        n = len(self.samples)
        columns = self.samples, self.ilm, self.references, self.seconds or [None] * n, self.lanes or [()] * n
        return list(zip(*columns, strict=True))


def some_settings(pick: Pick, turn: bool) -> Settings:
    """Settings of a signal; on a circle no threshold is met exactly, where rounding would decide."""
    beside = 1 / 1024 if turn else 0.0
    return Settings(
        threshold=1.0 + beside,
        persistence=pick(range(1, 8)),
        split_persistence=pick(range(1, 7)),
        tie_break=tuple(pick(ORDERS)[: pick([6, 6, 5, 4, 3, 2, 1, 0])]),
        trend_frames=pick([1, 2, 3, 4, 8]),
        reference_threshold=pick([0.5, 1.0, 2.0]) + beside,
        second_threshold=pick([0.5, 1.0, 2.0]) + beside,
        common_persistence=pick([1, 2, 3, 10]),
        common_fails=pick([True, False]),
        channels=pick([4] * 6 + [3, 3, 2]),
        turn=2 * np.pi if turn else 0.0,
    )


def build(pick: Pick, turn: bool = False) -> Flight:
    """A flight of one to nine stretches of one to nine frames."""
    flight = Flight(some_settings(pick, turn))
    value = pick([0.0, 3.0, -2.5, 100.0])
    for _ in range(pick(range(1, 10))):
        slope = pick(SLOPES)
        offsets = pick(pick([TOGETHER, SPLIT, NOISY, APART, APART, [None]])) or [pick(LEVELS) for _ in range(4)]
        flags = pick(pick([SAYS, ONE_GOOD, TWO_GOOD, ONE_SIDE, ONE_SIDE, NO_MONITOR, NO_MONITOR])) or one_side(
            offsets, pick([True, False])
        )
        silent = pick(pick([NO_CHANNEL] * 7 + [ONE_OR_TWO, ONE_OR_TWO, ALL_BUT_ONE]))
        offset, second = pick(REFERENCES), pick(SECONDS)
        lanes = pick(pick([NO_CHANNEL, ONE_OR_TWO]))
        for _ in range(pick([1, 1, 2, 2, 3, 3, 4, 6, 9])):
            value += slope
            present = set(range(flight.settings.channels)) - set(silent)
            flight.samples.append([value + offsets[c] if c in present else None for c in range(4)])
            flight.ilm.append(flags)
            flight.references.append(None if offset is None else value + offset)
            flight.seconds.append(None if second is None else value + second)
            flight.lanes.append(lanes)
    return flight


def one_side(offsets: Sequence[float], upper: bool) -> tuple[str, ...]:
    """Monitors that say good of the two larger (smaller) samples and bad of the others."""
    return tuple("good" if (x in sorted(offsets)[2:]) == upper else "bad" for x in offsets)


def by_rules(flight: Flight, pick: Pick) -> Flight:
    """The same with the settings of rules that are off by default, and with single frames that are not as the rest."""
    turn = flight.settings.turn
    more = {
        "count_down": pick([0.0, 0.0, 0.5, 1.0, 2.5]),
        "unresolved_frames": pick([0, 3, 7, 12]),
        "trend_small": pick([-1.0, -1.0, 0.0, 0.2]),
        "trend_tumbles": pick([False, False, True]),
        "trend_beside_reference": pick([False, True]),
        "referred": pick([False, True]),
        "weighted": pick([False, True]),
    }
    changed = replace(flight, settings=replace(flight.settings, **more))
    for _ in range(pick([0, 1, 2, 4])):
        k, c = pick(range(len(flight.samples))), pick(range(flight.settings.channels))
        spoil(changed, pick(["reference", "monitors", "sample", "lanes"] + ["frozen"] * (not turn)), k, c, pick)
    return changed


def spoil(flight: Flight, what: str, k: int, c: int, pick: Pick) -> None:
    """Change frame ``k``, of channel ``c`` where it is about one; a frozen one and its neighbour stay for long."""
    if what == "reference":
        flight.references[k] = pick([None, 6.0])
    elif what == "monitors":
        flight.ilm[k] = pick(pick([SAYS, TWO_GOOD]))
    elif what == "sample":
        flight.samples[k] = [None if d == c else x for d, x in enumerate(flight.samples[k])]
    elif what == "lanes":
        flight.lanes[k] = pick(ONE_OR_TWO)
    else:
        freeze(flight.samples, {c, pick(range(4))}, k, pick([3, 9, 20]))


def freeze(samples: list[list[float | None]], stuck: set[int], k: int, frames: int) -> None:
    """Let channels repeat what they show in frame ``k``."""
    for later in islice(range(k + 1, len(samples)), frames):
        samples[later] = [samples[k][c] if c in stuck else x for c, x in enumerate(samples[later])]


def at_the_stop(flight: Flight, pick: Pick) -> Flight:
    """The same within a sensor's range, at the ends of which samples stay and their references go on."""
    there = sorted(x for row in flight.samples for x in row if x is not None) or [0.0]
    low, high = (there[round(part * (len(there) - 1))] + pick([0.0, 0.0, 0.125]) for part in (0.2, 0.8))
    s = replace(flight.settings, low=low - 1.0, high=high)
    samples = [[None if x is None else min(max(x, s.low), s.high) for x in row] for row in flight.samples]
    return replace(flight, settings=s, samples=samples)


def left_by_extremes(flight: Flight, pick: Pick) -> Flight:
    """Four apart, of which two are left, that agree or not, and are in order or not; then the flight."""
    s = replace(flight.settings, channels=4, threshold_duplex=pick([None, 2.0]), tie_break=("trend", "extremes"))
    value, slopes = pick([0.0, 3.0]), pick([(0.0, 0.0), (0.125, -0.125), (-0.125, 0.125), (0.125, 0.125)])
    offsets = pick([(0.0, 1.75), (0.0, 2.25), (1.75, 0.0), (0.0, 5.0)])
    reference = pick([None, 0.0, 0.875, 6.25, -3.25, 3.5])
    before = s.split_persistence + pick(range(4))
    frames = before + pick([4, 9, 14])
    samples: list[list[float | None]] = [
        [value + off + k * slope for off, slope in zip(offsets, slopes, strict=True)] + [value + 9.0, value - 9.0]
        for k in range(frames)
    ]
    references = [None] * before + [None if reference is None else value + reference] * (frames - before)
    if pick([False, True]):
        references[before + 2] = pick([None, value])
    beside = pick([None, 0.0, 0.25])
    seconds = [None if x is None or beside is None else x + beside for x in references]
    settled = Flight(s, samples, [("absent",) * 4] * frames, references, seconds, [()] * frames)
    return before_the(flight, settled)


def before_the(flight: Flight, first: Flight) -> Flight:
    """The flight after another one, whose settings hold."""
    names = ("samples", "ilm", "references", "seconds", "lanes")
    return replace(first, **{name: getattr(first, name) + getattr(flight, name) for name in names})


def held(flight: Flight, pick: Pick) -> Flight:
    """A split that is answered in few frames, with samples missing in single ones and channels that jump; then the
    flight."""
    tie_break = pick([("ilm",), ("reference",), ("ilm", "reference")])
    waits = {"split_persistence": pick([4, 6, 10]), "unresolved_frames": pick([0, 6, 12, 20])}
    s = replace(flight.settings, tie_break=tie_break, **waits)
    calm, frames = pick([1, 3]), pick([8, 14, 24])
    offsets = pick(pick([SPLIT, APART]) if s.channels == 4 else APART)
    value, slope = pick([0.0, 3.0]), pick([0.0, 0.125])
    samples: list[list[float | None]] = [
        [value + k * slope + (offsets[c] if k >= calm else c / 16) if c < s.channels else None for c in range(4)]
        for k in range(calm + frames)
    ]
    n = len(samples)
    split = Flight(s, samples, [("absent",) * 4] * n, [None] * n, [None] * n, [()] * n)
    for _ in range(pick([1, 2, 3, 5])):
        disturb(split, pick(["gap", "jump", "answer"]), pick(range(calm - 1, n)), pick(range(s.channels)), pick)
    return before_the(flight, split)


def disturb(flight: Flight, what: str, k: int, c: int, pick: Pick) -> None:
    """From frame ``k`` on, let channel ``c`` be missing for one frame, be elsewhere, or be said to be good."""
    samples = flight.samples
    if what == "gap":
        samples[k][c] = None
    elif what == "jump":
        add(samples, c, k, pick([1, 3, 30]), pick([2.5, 40.0, -40.0]))
    else:
        for later in islice(range(k, len(samples)), pick([1, 1, 2, 6])):
            good = flight.references[later] = samples[later][c]
            sides = [good is not None and x is not None and abs(x - good) < 1.0 for x in samples[later]]
            flight.ilm[later] = tuple("good" if side else "bad" for side in sides)


def add(samples: list[list[float | None]], c: int, k: int, frames: int, offset: float) -> None:
    """Let a channel be off for some frames, from frame ``k`` on."""
    for row in samples[k : k + frames]:
        x = row[c]
        row[c] = None if x is None else x + offset


def by_level(flight: Flight, pick: Pick) -> Flight:
    """The same with thresholds of their own for three and for two samples."""
    triplex, duplex = (pick([0.5, 1.5, 2.75, 3.25, None]) for _ in range(2))
    return replace(flight, settings=replace(flight.settings, threshold_triplex=triplex, threshold_duplex=duplex))


def filtered(flight: Flight, pick: Pick) -> Flight:
    """The same behind a filter; no threshold is met exactly, no sample or reference lies on another: rounding, or the
    order of equals, would decide."""
    s, beside = flight.settings, 1 / 1024
    more = {name: getattr(s, name) + beside for name in ("threshold", "reference_threshold", "second_threshold")}
    levels = {name: pick([None, 0.5 + beside, 2.0 + beside]) for name in ("threshold_triplex", "threshold_duplex")}
    samples = [[None if x is None else x + c / 16384 for c, x in enumerate(row)] for row in flight.samples]
    for _ in range(pick([0, 1, 2])):  # one missing, or the first of all, and a burst right after it
        c, k = pick(range(4)), pick([0, *range(len(samples))])
        add(samples, c, k, pick([1, 2, 4]), pick([6.5, 120.0, -120.0]))
        if k:
            samples[k - 1][c] = None
    references = [None if x is None else x + beside / 2 for x in flight.references]
    chosen = replace(s, filter_share=pick([0.15, 0.4, 0.9]), **more, **levels)
    return replace(flight, settings=chosen, samples=samples, references=references)


def slow_faults(flight: Flight, pick: Pick) -> Flight:
    """The same for longer and with biases, which are summed or not; samples may not repeat for ever."""
    s = flight.settings
    more = {
        "slow_allowance": pick([0.10037, 0.30171]),
        "slow_limit": pick([0.0, 0.30713, 1.11131]),
        "stale_frames": pick([0, 3, 12]),
    }
    beside = {name: getattr(s, name) + 1 / 1024 for name in ("threshold", "reference_threshold", "second_threshold")}
    longer = [k for k in range(len(flight.samples)) for _ in range(pick([1, 1, 4, 9]))]
    biases = [pick([0.0, 0.0, 0.203125, 0.453125, -0.453125]) for _ in range(4)]
    samples, ilm = [flight.samples[k] for k in longer], [flight.ilm[k] for k in longer]
    references, seconds = [flight.references[k] for k in longer], [flight.seconds[k] for k in longer]
    lanes = [flight.lanes[k] for k in longer]
    if pick([False, True]):  # all move in every frame
        samples = [[None if x is None else x + k % 2 / 64 for x in row] for k, row in enumerate(samples)]
    for _ in range(pick([0, 1, 2, 3])):
        freeze(samples, {pick(range(4)), pick(range(4))}, pick(range(len(samples))), pick([6, 20, 50]))
    for _ in range(pick([0, 0, 3])):
        k = pick(range(len(samples)))
        samples[k] = [None if pick([True, False, False]) else x for x in samples[k]]
    calm = pick([0, 12, 40])  # frames before all that
    flicker = [pick([0, 0, 0, 1, 2, 5]) for _ in range(4)]  # frames, of a coarse sensor at rest
    rest = [[3.0 + k // max(n, 1) % 2 * min(n, 1) / 8 for n in flicker] for k in range(calm)]
    rest = [[x if c < s.channels else None for c, x in enumerate(row)] for row in rest]
    samples, ilm = rest + samples, [("good",) * 4] * calm + ilm
    references, seconds = [pick([None, 3.0])] * calm + references, [None] * calm + seconds
    samples = [[None if x is None else x + bias for x, bias in zip(row, biases, strict=True)] for row in samples]
    references = [None if x is None else x + 1 / 2048 for x in references]
    return Flight(replace(s, **more, **beside), samples, ilm, references, seconds, [()] * calm + lanes)


def with_commands(flight: Flight, pick: Pick) -> Flight:
    """The same with commands to readmit channels."""
    resets = [pick(pick([NO_CHANNEL] * 6 + [ONE_OR_TWO, ALL_BUT_ONE])) for _ in flight.samples]
    return replace(flight, resets=resets, readmit_frames=pick([1, 2, 5]))


def by_all(flight: Flight, pick: Pick) -> Flight:
    """The same with several of these at once."""
    for change in (held, left_by_extremes, by_level, filtered, slow_faults, at_the_stop, with_commands):
        if pick([True, False]) and not (flight.settings.turn and change in (left_by_extremes, at_the_stop)):
            flight = change(flight, pick)
    return flight


@st.composite
def flights(draw: Any, turn: bool = False) -> Flight:
    def pick(choices: Sequence[Any]) -> Any:
        return draw(st.sampled_from(choices))

    flight = build(pick, turn)
    return by_rules(flight, pick) if pick([False, True]) else flight


def seeded(seed: int, turn: bool = False) -> Flight:
    """One of the flights drawn evenly; every other has rules that are off by default."""
    pick = random.Random(seed).choice
    flight = build(pick, turn)
    return by_rules(flight, pick) if seed % 2 else flight
