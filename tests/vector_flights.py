"""Flights of the conformance vectors: what goes into one signal or one discrete, and what the requirement answers.

The answers are those of the oracles alone (oracle.py and those that go with it).
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi, sqrt
from typing import Any

from oracle import Frame
from oracle_answers import Settings
from oracle_boxes import ResettableOracle
from oracle_discrete import DiscreteOracle, DiscreteSettings
from oracle_flights import (
    SLOPES,
    Flight,
    Pick,
    at_the_stop,
    build,
    by_level,
    by_rules,
    filtered,
    left_by_extremes,
    one_side,
)
from oracle_flights import slow_faults as with_slow_faults
from oracle_slow_flights import slow_tests

from rig.core.frame import DISCRETES

FRAMES = 30  # of a case,
LONG = 720  # and of one of slow-fault tests, which learn for seconds
RANGE = 250.0  # thresholds, either way, of a signal that is no angle
TURN = 2 * pi
NOISE = 1e-9  # rad; where it moves a decision, rounding would
END = 1e-3  # rad, of an angle's range: no vote is nearer to it, where rounding would go round the circle
MOVING = [x for x in SLOPES if x]  # the trend of an angle at rest hangs on rounding
DENSITY = 1.225  # kg/m3, of the air at sea level
NEVER = 1_000_000  # frames of agreement until a reset

Reset = frozenset[int]
NO_RESET: Reset = frozenset()


@dataclass
class NoisySettings(Settings):
    """The same circle with another rounding."""

    draw: random.Random = field(default_factory=lambda: random.Random(1))

    def near(self, x: float, base: float) -> float:
        return super().near(x, base) + self.draw.uniform(-NOISE, NOISE)


@dataclass(frozen=True)
class Flown:
    """One signal of a case: its settings, what it is given in each frame, and the answers that it must get."""

    flight: Flight
    low: float = -RANGE
    high: float = RANGE
    resets: tuple[Reset, ...] = (NO_RESET,) * FRAMES
    readmit_frames: int = NEVER
    airspeed_m_s: float = 0.0  # error of a reference that is a dynamic pressure; 0 of any other
    kind: type[ResettableOracle] = ResettableOracle

    @property
    def settings(self) -> Settings:
        """Those of the flight, within the sensor's range and without lanes, of which a unit is not told."""
        s = self.flight.settings
        return replace(s, low=self.low, high=self.high, tie_break=tuple(name for name in s.tie_break if name != "lane"))

    @cached_property
    def answers(self) -> list[Frame]:
        return self._answers()[0]

    @cached_property
    def rules(self) -> set[str]:
        """The oracle's rules for few votes that the flight reached."""
        return self._answers()[1]

    def _answers(self) -> tuple[list[Frame], set[str]]:
        oracle, rules, answers = self.kind(self.settings, readmit_frames=self.readmit_frames), set[str](), []
        flight = self.flight
        given = zip(flight.samples, flight.ilm, flight.references, flight.seconds, strict=True)
        for (samples, ilm, reference, second), reset in zip(given, self.resets, strict=True):
            oracle.command(set(reset))
            oracle.s = oracle.references.s = self.settings_of(reference)
            frame = oracle.step(samples, ilm, reference, second)
            if self.settings.turn:
                voted = self.low + (frame.voted - self.low) % TURN
                oracle.vote = None if oracle.vote is None else voted
                frame = replace(frame, voted=voted)
            answers.append(frame)
            rules |= oracle.rules
        return answers, rules

    def settings_of(self, reference: float | None) -> Settings:
        """Those of a frame; of a dynamic pressure by the error of its airspeed if that is the less (references.md)."""
        if not self.airspeed_m_s or reference is None:
            return self.settings
        error = sqrt(2 * DENSITY * (self.settings.limited(reference) or 0.0)) * self.airspeed_m_s
        return replace(self.settings, reference_threshold=min(self.settings.reference_threshold, error))

    def with_settings(self, **changes: Any) -> Flown:
        return replace(self, flight=replace(self.flight, settings=replace(self.settings, **changes)))

    def hangs_on(self, **changes: Any) -> bool:
        """Whether other settings give other answers."""
        return self.with_settings(**changes).answers != self.answers

    def by(self, kind: type[ResettableOracle]) -> Flown:
        """The same, answered by another rule."""
        return replace(self, kind=kind)

    @property
    def hangs_on_rounding(self) -> bool:
        """Whether the answers of an angle change with a noise far below all thresholds."""
        noisy = replace(self, flight=replace(self.flight, settings=NoisySettings(**vars(self.settings))))
        seen = [frame.voted for frame in self.answers if frame.pattern != "lost"]
        if any(min(voted - self.low, self.high - voted) < END for voted in seen):
            return True
        for _ in range(3):
            for mine, theirs in zip(self.answers, noisy._answers()[0], strict=True):
                if abs(mine.voted - theirs.voted) > 100 * NOISE or replace(mine, voted=0.0) != replace(
                    theirs, voted=0.0
                ):
                    return True
        return False


def slow_faults(flight: Flight, frames: int = FRAMES) -> Flight:
    """The first frames of a flight; of a shorter one the last frame goes on."""
    fields = ("samples", "ilm", "references", "seconds", "lanes")
    rows = {name: getattr(flight, name) or [()] for name in fields}
    return replace(flight, **{name: (row + row[-1:] * frames)[:frames] for name, row in rows.items()})


def scaled(flight: Flight, factor: float) -> Flight:
    """The same in another unit: a power of two changes no bit of any difference."""

    def times(row: Sequence[float | None]) -> list[float | None]:
        return [None if x is None else factor * x for x in row]

    s = flight.settings
    scale = ("low", "high", "trend_small")
    thresholds = {
        name: factor * limit
        for name, limit in vars(s).items()
        if limit is not None and ("threshold" in name or (name in scale and limit >= 0.0))
    }
    samples, references, seconds = (
        [times(row) for row in flight.samples],
        times(flight.references),
        times(flight.seconds),
    )
    return Flight(replace(s, **thresholds), samples, flight.ilm, references, seconds, flight.lanes)


def plain(seed: int) -> Flown:
    """A random signal that is no angle."""
    draw = random.Random(f"plain {seed}")
    factor = draw.choice([0.125, 0.5, 1.0, 4.0])
    return Flown(scaled(slow_faults(build(draw.choice)), factor), -RANGE * factor, RANGE * factor)


def levelled(seed: int) -> Flown:
    """A random signal with thresholds of its own for three and for two samples."""
    draw = random.Random(f"levels {seed}")
    return Flown(by_level(slow_faults(build(draw.choice)), draw.choice))


def smoothed(seed: int) -> Flown:
    """A random signal that is compared behind a filter."""
    draw = random.Random(f"filter {seed}")
    return Flown(filtered(slow_faults(build(draw.choice)), draw.choice))


def bursting(seed: int) -> Flown:
    """A random signal behind a filter, with bursts on one to three channels, alike or not, shorter than they may be."""
    draw = random.Random(f"bursts {seed}")
    flight = slow_faults(filtered(build(draw.choice), draw.choice))
    value, samples = draw.choice([0.0, 3.0]), list[list[float | None]]()
    while len(samples) < FRAMES:
        hit, alike = draw.sample(range(4), draw.choice([0, 1, 2, 2, 3])), draw.choice([True, True, False])
        size = draw.choice([3.0, 6.0, -9.0, 400.0])
        off = [size * (1 if alike else i + 1) if c in hit else 0.0 for i, c in enumerate(range(4))]
        off = [x + draw.choice([0.0, 0.0, 0.375]) for x in off]
        for _ in range(draw.choice([1, 2, 3, 5])):
            samples.append([value + off[c] if c < flight.settings.channels else None for c in range(4)])
    references = [None if x is None else value + 1 / 2048 for x in flight.references]
    return Flown(replace(flight, samples=samples[:FRAMES], references=references), low=-2e3, high=2e3)


def biased(seed: int) -> Flown:
    """A random signal whose channels differ by slow faults."""
    draw = random.Random(f"lasting {seed}")  # the word that the vectors were drawn by
    return Flown(slow_faults(with_slow_faults(build(draw.choice), draw.choice)))


def tested(seed: int) -> Flown:
    """A random signal with slow-fault tests and small faults, in steps that take little room in a file."""
    draw = random.Random(f"slow tests {seed}")
    flight = slow_tests(build(draw.choice), draw.choice)

    def coarse(x: float | None, step: float) -> float | None:
        return None if x is None else round(x / step) * step

    samples = [[coarse(x, 1 / 256) for x in row] for row in flight.samples]
    references = [coarse(x, 1 / 1024) for x in flight.references]
    commanded = (*map(Reset, flight.resets), *[NO_RESET] * LONG)[:LONG]
    flight = slow_faults(replace(flight, samples=samples, references=references), LONG)
    high = min(flight.settings.high, RANGE)
    return Flown(flight, high=high, resets=commanded, readmit_frames=flight.readmit_frames)


def ruled(seed: int) -> Flown:
    """A random signal with settings of rules that are off by default."""
    draw = random.Random(f"rules {seed}")
    return Flown(slow_faults(by_rules(build(draw.choice), draw.choice)))


def split_in_trends(seed: int) -> Flown:
    """Two against two, or one against one, that rise or fall, each by steps of its own; monitors tell who is good."""
    draw = random.Random(f"trends {seed}")
    s = Settings(
        threshold_duplex=2.0,
        trend_frames=draw.choice([1, 2, 3]),
        split_persistence=draw.choice([4, 9, 30]),
        tie_break=tuple(draw.sample(["ilm", "trend"], 2)),
        weighted=True,
        channels=draw.choice([4, 4, 2]),
    )
    flight, side, upper = Flight(s), draw.choice([1.0, -1.0]), draw.random() < 0.5
    at = draw.sample([0.0, 0.25, 3.0, 3.25] if s.channels == 4 else [0.0, 3.0], s.channels)
    flags = one_side([*at, 9.0, 9.0][:4], upper) if s.channels == 4 else ("absent",) * 4
    steps = [draw.sample([0.0625, 0.125, 0.1875, 0.25], 4) for _ in range(2)]
    for k in range(FRAMES):
        at = [x + side * steps[k % 2][c] if k else x for c, x in enumerate(at)]
        flight.samples.append([*at, None, None][:4])
        flight.ilm.append(flags)
    flight.references, flight.seconds = [None] * FRAMES, [None] * FRAMES
    return Flown(slow_faults(flight))


def paired(seed: int) -> Flown:
    """A random signal of which extremes leave two channels, often with other rules on."""
    draw = random.Random(f"extremes {seed}")
    flight = left_by_extremes(build(draw.choice), draw.choice)
    if draw.random() < 0.5:
        flight = replace(flight, seconds=[x if draw.random() < 0.9 else None for x in flight.references])
    flight = slow_faults(by_rules(flight, draw.choice) if draw.random() < 0.5 else flight)
    resets = [Reset(draw.sample(range(4), draw.choice([0, 0, 1, 2, 4]))) for _ in range(FRAMES)]
    return Flown(flight, resets=tuple(resets), readmit_frames=draw.choice([1, 2, 3, NEVER, NEVER]))


def stopped(seed: int) -> Flown:
    """A random signal within a narrow range: samples stay at its ends, where their references go on."""
    draw = random.Random(f"stops {seed}")
    flight = at_the_stop(slow_faults(build(draw.choice)), draw.choice)
    return Flown(with_repeats(flight, draw.choice), flight.settings.low, flight.settings.high)


def repeating(seed: int) -> Flown:
    """A random signal of whose channels one or two stick, with gaps, and none may repeat for ever."""
    draw = random.Random(f"repeats {seed}")
    return Flown(with_repeats(slow_faults(build(draw.choice)), draw.choice))


def beyond_with_resets(seed: int) -> Flown:
    """Channels that stay at the end of the range, one of which goes off, comes back and is missing now and then."""
    draw, value = random.Random(f"beyond {seed}"), RANGE if seed % 2 else -RANGE
    s = Settings(persistence=draw.randint(1, 3), channels=draw.choice([4, 3]))
    flight, one, resets = Flight(s), draw.randrange(3), list[Reset]()
    while len(flight.samples) < FRAMES:
        away = draw.choice([-3.0 * value / RANGE, None, None, 0.0, 0.0])
        for _ in range(draw.randint(1, 4)):
            row = [value if c != one or away == 0.0 else None if away is None else value + away for c in range(4)]
            flight.samples.append([x if c < s.channels else None for c, x in enumerate(row)])
            resets.append(Reset(draw.sample(range(4), draw.choice([0, 1, 4]))))
    flight.ilm, flight.references = [("absent",) * 4] * FRAMES, [None] * FRAMES
    flight.seconds = [None] * FRAMES
    return Flown(slow_faults(flight), resets=tuple(resets[:FRAMES]), readmit_frames=draw.randint(2, 4))


def smoothed_and_repeating(seed: int) -> Flown:
    """The same behind a filter."""
    draw = random.Random(f"filtered repeats {seed}")
    return Flown(with_repeats(slow_faults(filtered(build(draw.choice), draw.choice)), draw.choice))


def with_repeats(flight: Flight, pick: Pick) -> Flight:
    """The same with a count of repeats, channels that stick for a while and, in some frames, none or one missing."""
    samples = [list(row) for row in flight.samples]
    for _ in range(pick([1, 2, 3])):
        first, stuck = pick(range(FRAMES)), {pick(range(4)), pick(range(4))}
        for k in range(first, min(first + pick([5, 9, 20]), FRAMES)):
            samples[k] = [samples[first][c] if c in stuck else x for c, x in enumerate(samples[k])]
    for _ in range(pick([0, 2, 4])):
        k, gone = pick(range(FRAMES)), pick([range(4), range(1), range(1, 4)])
        samples[k] = [None if c in gone else x for c, x in enumerate(samples[k])]
    s = replace(flight.settings, stale_frames=pick([2, 3, 5]))
    return replace(flight, settings=s, samples=samples)


def smoothed_with_resets(seed: int) -> Flown:
    """The same, with channels that go and come and commands to readmit them."""
    found, draw = with_resets(seed), random.Random(f"filter {seed}")
    return replace(found, flight=filtered(found.flight, draw.choice))


def to_the_ends(seed: int) -> Flown | None:
    """A random signal whose sensor ends at its largest and at its smallest sample; None if a vote lies beyond."""
    found = plain(seed)
    samples = [x for row in found.flight.samples for x in row if x is not None]
    low, high = min(samples, default=0.0), max(samples, default=0.0)
    inside = low < 0.0 < high and all(low <= frame.voted <= high for frame in found.answers)
    return replace(found, low=low, high=high) if inside else None


def at_airspeed(seed: int) -> Flown | None:
    """A random signal as if it were a dynamic pressure; None where the reference is none."""
    found, draw = plain(seed), random.Random(f"airspeed {seed}")
    references = [x for x in found.flight.references if x is not None]
    if min(references, default=0.0) < 0.2 * found.high:
        return None
    error = found.settings.reference_threshold * draw.choice([0.3, 0.6, 1.0])
    return replace(found, airspeed_m_s=error / sqrt(2 * DENSITY * references[0]))


def at_the_limits(seed: int) -> Flown:
    """Channels that agree, and two references about as far from them and from each other as makes a common mode."""
    draw = random.Random(f"limits {seed}")
    s = replace(build(draw.choice).settings, common_persistence=draw.randint(1, 5))
    flight, value = Flight(s), draw.choice([0.0, -2.5, 8.0])
    first, second = s.reference_threshold, s.second_threshold
    while len(flight.samples) < FRAMES:
        side, beyond = draw.choice([1, -1]), draw.choice([0.0, 0.25])
        one = max(1.5 * first, s.threshold) + beyond
        enough = max(1.5 * second, s.threshold)
        other = draw.choice([enough, enough + 0.25, one + first + second, one - first - second])
        for _ in range(draw.randint(1, 9)):
            value += 0.125
            flight.samples.append([value if c < s.channels else None for c in range(4)])
            flight.ilm.append(("good",) * 4)
            flight.references.append(value + side * one)
            flight.seconds.append(value + side * other)
    return Flown(slow_faults(flight))


def angle(seed: int, late: int = 0) -> Flown | None:
    """A random angle, heading or bank; None for one in which rounding would decide.

    late : frames without a sample; then opposite zero
    """
    draw = random.Random(f"angle {seed}")
    flight = build(lambda choices: draw.choice(MOVING if choices is SLOPES else choices), turn=True)
    if len(flight.samples) < FRAMES:
        return None
    low, opposite = draw.choice([0.0, -pi]), pi if late else 0.0

    def into(x: float | None) -> float | None:
        return None if x is None else low + (x + opposite - low) % TURN

    flight.samples = [[None if k < late else into(x) for x in row] for k, row in enumerate(flight.samples)]
    flight.references, flight.seconds = [into(x) for x in flight.references], [into(x) for x in flight.seconds]
    found = Flown(slow_faults(flight), low, low + TURN)
    return None if found.hangs_on_rounding else found


def with_absent_monitors(seed: int) -> Flown:
    """A random signal of which some monitors are absent where they would say bad."""
    found, draw = plain(seed), random.Random(f"absent {seed}")
    absent = draw.sample(range(4), draw.choice([1, 2, 2, 3, 4]))
    return spoken(found, {c: {"bad": "absent"} for c in absent})


def spoken(flown: Flown, instead: dict[int, dict[str, str]]) -> Flown:
    """The same with other words of some monitors."""
    ilm = [tuple(instead.get(c, {}).get(flag, flag) for c, flag in enumerate(row)) for row in flown.flight.ilm]
    return replace(flown, flight=replace(flown.flight, ilm=ilm))


def with_resets(seed: int) -> Flown:
    """One to three channels that go off and come back, and commands in time, too early and in disagreement."""
    draw = random.Random(f"resets {seed}")
    s = Settings(
        persistence=draw.randint(1, 4), split_persistence=draw.randint(1, 4), channels=draw.choice([4, 4, 4, 3])
    )
    flight, resets, value = Flight(s), list[Reset](), draw.choice([0.0, -2.5, 8.0])
    while len(flight.samples) < FRAMES:
        off = draw.sample(range(s.channels), draw.choice([0, 0, 1, 1, 2]))
        away = [draw.choice([None, 3.0, -3.0, 1.0]) if c in off else 0.0 for c in range(s.channels)] + [None] * 4
        for _ in range(draw.randint(1, 7)):
            value += 0.125
            flight.samples.append([None if x is None else value + x for x in away[:4]])
            flight.ilm.append(("absent",) * 4)
            flight.references.append(None)
            flight.seconds.append(None)
            resets.append(Reset(draw.sample(range(4), draw.choice([0, 0, 1, 1, 2, 4]))))
    return Flown(slow_faults(flight), resets=tuple(resets[:FRAMES]), readmit_frames=draw.randint(1, 5))


@dataclass(frozen=True)
class FlownDiscrete:
    """One discrete of a case: samples None where they are declared bad."""

    settings: DiscreteSettings
    samples: tuple[tuple[bool | None, ...], ...]
    resets: tuple[Reset, ...] = (NO_RESET,) * FRAMES

    @cached_property
    def answers(self) -> list[tuple[int, list[str], int]]:
        oracle = DiscreteOracle(self.settings)
        return [oracle.step(list(row), set(reset)) for row, reset in zip(self.samples, self.resets, strict=True)]


def quiet_discrete(fail_safe: int, frames: int = FRAMES) -> FlownDiscrete:
    """Four channels that agree throughout."""
    return FlownDiscrete(DiscreteSettings(fail_safe=fail_safe), ((True,) * 4,) * frames, (NO_RESET,) * frames)


def discrete(seed: str, resets: bool = True) -> FlownDiscrete:
    """Stretches in which some channels are off the others, or are declared bad."""
    draw = random.Random(seed)
    s = DiscreteSettings(draw.randint(0, 1), draw.randint(1, 5), draw.randint(1, 5), draw.choice([4, 4, 4, 3, 2]))
    samples, commands = list[tuple[bool | None, ...]](), list[Reset]()
    while len(samples) < FRAMES:
        truth, off = draw.random() < 0.5, draw.sample(range(4), draw.choice([0, 1, 1, 2, 2, 3]))
        how = [draw.choice([None, not truth, not truth]) if c in off else truth for c in range(4)]
        for _ in range(draw.randint(1, 7)):
            samples.append(tuple(how))
            commands.append(Reset(draw.sample(range(4), draw.choice([0, 0, 1, 4])) if resets else ()))
    return FlownDiscrete(s, tuple(samples[:FRAMES]), tuple(commands[:FRAMES]))


def quiet_discretes(frames: int = FRAMES) -> list[FlownDiscrete]:
    """All discretes of a case that is of signals alone."""
    return [quiet_discrete(one.fail_safe, frames) for one in DISCRETES]


def quiet_signal() -> Flown:
    """Four channels that agree throughout, at rest."""
    flight = Flight(Settings(), [[1.0, 1.25, 1.5, 1.5]], [("absent",) * 4], [None], [None])
    return Flown(slow_faults(flight))
