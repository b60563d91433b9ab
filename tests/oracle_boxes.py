"""What several channels have in common, once more from the requirement alone: LRU failure, channels that come back.

Flights of several signals: channels that fall silent or go off on many signals at once, and on few.  A failed channel
agrees in a frame in which its sample can be compared and lies within the threshold of the vote, behind the filter.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from oracle import Frame, Oracle
from oracle_answers import TIE_BREAKS, Settings

SIGNALS = 6
# Samples, in-line monitors, reference, second reference.
Row = tuple[list[float | None], tuple[str, ...], float | None, float | None]


@dataclass
class BoxFlight:
    settings: list[Settings]
    box_signals: int  # -1: more than half of the box
    box_persistence: int
    frames: list[list[Row]] = field(default_factory=list)  # for each frame, one row a signal


@dataclass
class BoxOracle:
    """The signals of a flight and the boxes that they share."""

    flight: BoxFlight
    counts: dict[tuple[int, int], int] = field(default_factory=dict)  # by box and channel
    rules: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.signals = [Oracle(s) for s in self.flight.settings]

    def step(self, rows: Sequence[Row]) -> list[Frame]:
        disputed = sum(one.s.tells for one in self.signals if one.references.in_dispute)
        frames = [
            one.step(*row, in_dispute=bool(one.s.sources & disputed))
            for one, row in zip(self.signals, rows, strict=True)
        ]
        self.rules.update(*(one.rules for one in self.signals))
        for box in {one.s.box for one in self.signals} - {0}:
            members = [i for i, one in enumerate(self.signals) if one.s.box == box]
            dead = self.dead(box, [self.signals[i] for i in members])
            for i in members:
                frames[i] = self.without(dead, self.signals[i], frames[i])
        return frames

    def dead(self, box: int, signals: list[Oracle]) -> set[int]:
        """The channels that this frame fails on all ``signals`` of a box."""
        size, chosen = len(signals), self.flight.box_signals
        needed = size // 2 + 1 if chosen < 0 else min(chosen, size)
        if size < 2 or needed == 0:
            self.rules.add("a box of one signal" if size < 2 else "no boxes")
            return set()
        there = set[int]()
        for c in range(4):
            accusing = sum(c in one.accused for one in signals)
            self.counts[box, c] = self.counts.get((box, c), 0) + 1 if accusing >= needed else 0
            if accusing or any(c in one.in_use for one in signals):
                there.add(c)
        dead = {c for c in range(4) if self.counts[box, c] >= self.flight.box_persistence}
        if 2 * len(dead) > len(there):
            self.rules.add("an accused majority")
            return set()
        return dead

    def without(self, dead: set[int], one: Oracle, frame: Frame) -> Frame:
        """The signal's frame once these boxes are failed on it."""
        now = dead & one.in_use
        if not now:
            return frame
        self.rules.add(f"{len(dead)} failed as boxes")
        self.rules.add("failed where it was silent" if now & one.accused else "failed where nothing spoke against it")
        one.failed |= now
        one.slow_faults.hear(one.failed)
        one.references.level_changed()
        states = ["failed" if c in one.failed else state for c, state in enumerate(frame.states)]
        return Frame(
            frame.voted, states, frame.level - len(now), frame.pattern, "box", frame.trend, frame.usable, frame.common
        )


def seeded_boxes(seed: int) -> BoxFlight:
    """Stretches in which no channel, or one to three channels, are silent or off on some of the signals."""
    draw = random.Random(seed)
    boxes = draw.choice([[1], [1], [1], [1], [1, 2], [1, 2, 3], [0, 1], [0, 1, 2]])
    settings = [some_settings(draw, box=draw.choice(boxes)) for _ in range(SIGNALS)]
    flight = BoxFlight(settings, draw.choice([-1, -1, 0, 2, 3, 4]), draw.choice([2, 3, 5, 8]))
    for _ in range(draw.randint(2, 6)):
        dead = draw.sample(range(4), draw.choice([0, 1, 1, 2, 2, 3, 3]))
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


def seeded_sources(seed: int) -> BoxFlight:
    """Signals that agree, some of which tell of what the references of others read; references come and go."""
    draw = random.Random(seed)
    tell = draw.sample(range(SIGNALS), draw.choice([1, 2, 3]))
    settings = [
        some_settings(
            draw,
            box=0,
            tells=1 << i if i in tell else 0,
            sources=sum(1 << j for j in tell if j != i and draw.random() < 0.6),
            common_persistence=draw.randint(2, 9),
            common_fails=draw.random() < 0.3,
            second_threshold=draw.choice([0.5, 1.0]),
        )
        for i in range(SIGNALS)
    ]
    flight = BoxFlight(settings, 0, 1)
    for _ in range(draw.randint(3, 8)):
        firsts, seconds = (
            [draw.choice([None, 0.0, 0.0, 3.0, 3.0, 3.0, -3.0]) for _ in range(SIGNALS)] for _ in range(2)
        )
        for _ in range(draw.choice([1, 2, 3, 5, 9, 12])):
            flight.frames.append(
                [row(s.channels, (), None, ("absent",) * 4, firsts[i], seconds[i]) for i, s in enumerate(settings)]
            )
    return flight


def row(
    channels: int,
    dead: Sequence[int],
    how: float | None,
    ilm: tuple[str, ...],
    reference: float | None,
    second: float | None = None,
) -> Row:
    """One signal in one frame: the good channels nearly at zero, the dead ones silent or off."""
    samples = [how if c in dead else 0.125 * c for c in range(channels)]
    return samples + [None] * (4 - channels), ilm, reference, second


def some_settings(draw: random.Random, **more: Any) -> Settings:
    return Settings(
        persistence=draw.randint(1, 8),
        split_persistence=draw.randint(1, 10),
        tie_break=tuple(draw.sample(list(TIE_BREAKS), draw.choice([6, 6, 5, 3, 2]))),
        unresolved_frames=draw.choice([0, 0, 12]),
        referred=draw.random() < 0.3,
        channels=draw.choice([4, 4, 4, 3]),
        **more,
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
                self.readmitted = True
                self.references.level_changed()
                self.counts[c] = self.agreed[c] = 0
                self.slow_tests.forget()

    def step(self, samples: list[float | None], *given: Any) -> Frame:  # pyright: ignore[reportIncompatibleMethodOverride]  # hands all on
        out = set(self.failed)
        frame = super().step(samples, *given)
        self.readmitted = False
        for c, x in enumerate(self.comparable):
            agrees = (
                x is not None
                and "vote" in self.memory
                and self.s.apart(self.memory[c], self.memory["vote"]) <= self.s.threshold
            )
            self.agreed[c] = self.agreed[c] + 1 if c in out and agrees else 0
        return frame
