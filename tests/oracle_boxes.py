"""What several channels have in common, once more from the requirement alone: a box that dies, channels that come back.

Flights of several signals: channels that fall silent or go off on many signals at once, and on few.  A failed channel
agrees in a frame in which its sample can be compared and lies within the threshold of the vote, behind the filter.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from oracle import Frame, Oracle
from oracle_answers import RESOLVERS, Settings

SIGNALS = 6
Row = tuple[list[float | None], tuple[str, ...], float | None]  # samples, in-line monitors, reference


@dataclass
class BoxFlight:
    settings: list[Settings]
    box_signals: int
    box_persistence: int
    frames: list[list[Row]] = field(default_factory=list)  # for each frame, one row a signal


@dataclass
class BoxOracle:
    """The signals of a flight and the boxes that they share."""

    flight: BoxFlight
    counts: list[int] = field(default_factory=lambda: [0] * 4)
    rules: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.signals = [Oracle(s) for s in self.flight.settings]

    def step(self, rows: Sequence[Row]) -> list[Frame]:
        frames = [one.step(*row) for one, row in zip(self.signals, rows, strict=True)]
        needed, there = self.flight.box_signals, set[int]()
        for c in range(4):
            accusing = sum(c in one.accused for one in self.signals)
            self.counts[c] = self.counts[c] + 1 if accusing >= needed > 0 else 0
            if accusing or any(c in self.in_use(one) for one in self.signals):
                there.add(c)
        dead = {c for c in range(4) if self.counts[c] >= self.flight.box_persistence}
        if dead and 2 * len(dead) > len(there):
            self.rules.add("an accused majority")
            return frames
        return [self.without(dead, *pair) for pair in zip(self.signals, frames, strict=True)]

    @staticmethod
    def in_use(one: Oracle) -> set[int]:
        return set(range(one.s.channels)) - one.failed

    def without(self, dead: set[int], one: Oracle, frame: Frame) -> Frame:
        """The signal's frame once these boxes are failed on it."""
        now = dead & self.in_use(one)
        if not now:
            return frame
        self.rules.add(f"{len(dead)} failed as boxes")
        self.rules.add("failed where it was silent" if now & one.accused else "failed where nothing spoke against it")
        one.failed |= now
        one.lasting.level_changed(one.failed)
        states = ["failed" if c in one.failed else state for c, state in enumerate(frame.states)]
        return Frame(
            frame.voted, states, frame.level - len(now), frame.pattern, "box", frame.trend, frame.usable, frame.common
        )


def seeded_boxes(seed: int) -> BoxFlight:
    """Stretches in which nobody, or one to three channels, are silent or off on some of the signals."""
    draw = random.Random(seed)
    settings = [some_settings(draw) for _ in range(SIGNALS)]
    flight = BoxFlight(settings, draw.choice([0, 2, 3, 3, 4, 4]), draw.choice([2, 3, 5, 8]))
    for _ in range(draw.randint(2, 6)):
        dead = draw.sample(range(4), draw.choice([0, 1, 1, 2, 2, 3]))
        hit = draw.sample(range(SIGNALS), draw.choice([1, 3, 4, 5, 6, 6]))
        how = [draw.choice([None, 3.0, -3.0, 0.25]) for _ in range(SIGNALS)]
        references = [draw.choice([None, None, 0.0, 0.25, 3.0]) for _ in range(SIGNALS)]
        ilm = [tuple(draw.choice(["good", "bad", "absent", "absent"]) for _ in range(4)) for _ in range(SIGNALS)]
        for _ in range(draw.choice([1, 3, 5, 9, 12])):
            flight.frames.append(
                [
                    row(s.channels, dead if i in hit else (), how[i], ilm[i], references[i])
                    for i, s in enumerate(settings)
                ]
            )
    return flight


def row(channels: int, dead: Sequence[int], how: float | None, ilm: tuple[str, ...], reference: float | None) -> Row:
    """One signal in one frame: the good channels nearly at zero, the dead ones silent or off."""
    samples = [how if c in dead else 0.125 * c for c in range(channels)]
    return samples + [None] * (4 - channels), ilm, reference


def some_settings(draw: random.Random) -> Settings:
    return Settings(
        persistence=draw.randint(1, 8),
        singular_persistence=draw.randint(1, 10),
        resolvers=tuple(draw.sample(list(RESOLVERS), draw.choice([5, 5, 3, 2]))),
        channels=draw.choice([4, 4, 4, 3]),
    )


@dataclass
class ResettableOracle(Oracle):
    """One signal; ``command`` comes before the ``step`` of its frame."""

    readmit_frames: int = 100
    agreed: list[int] = field(default_factory=lambda: [0] * 4)  # frames in a row, of a failed channel

    def command(self, channels: set[int]) -> None:
        """Readmit those of the commanded channels that have agreed long enough."""
        for c in channels & self.failed:
            if self.agreed[c] >= self.readmit_frames:
                self.failed.remove(c)
                self.counts[c] = self.agreed[c] = 0
                self.lasting.forget(c)

    def step(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, second: float | None = None
    ) -> Frame:
        out = set(self.failed)
        frame = super().step(samples, ilm, reference, second)
        voted = self.smooth("vote", frame.voted) or 0.0
        for c, x in enumerate(samples):
            agrees = (
                x is not None
                and self.s.apart(self.memory[c] - self.lasting.bias[c], voted) <= self.s.threshold
                and not self.lasting.repeats_for_too_long(c)
            )
            self.agreed[c] = self.agreed[c] + 1 if c in out and agrees else 0
        return frame
