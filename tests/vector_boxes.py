"""Conformance vectors of what the signals have in common: LRU failures, references that read other signals."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

from oracle import Frame, Oracle
from oracle_answers import Settings, View
from oracle_boxes import BoxFlight, BoxOracle, Row, row, seeded_boxes, seeded_sources, some_settings
from oracle_flights import Flight
from oracle_references import References
from vector_flights import FRAMES, Flown, quiet_discretes, slow_faults
from vector_records import Session
from vector_rules import EndsRuns, FirstDisputes, SecondDisputes

from rig.core.frame import S

POOL = 1200  # random flights that a case chooses from


class TrendAccuses(Oracle):
    """Another rule, for a choice of flights: a channel blamed without a majority is accused by trend and rank too."""

    def evidence(self, view: View, decided_by: str, wrong: set[int]) -> set[int]:
        return super().evidence(view, "ilm" if decided_by in ("trend", "extremes", "middle") else decided_by, wrong)


class NoneAccused(Oracle):
    """And another one: no channel blamed without a majority is accused."""

    def evidence(self, view: View, decided_by: str, wrong: set[int]) -> set[int]:
        return super().evidence(view, "trend", wrong)


class MajorityOfAll(BoxOracle):
    """Those who are there are asked of all signals, not of the box alone."""

    def dead(self, box: int, signals: list[Oracle]) -> set[int]:
        super().dead(box, signals)
        late = {c for c in range(4) if self.counts.get((box, c), 0) >= self.flight.box_persistence}
        there = {c for c in range(4) if any(c in one.accused | one.in_use for one in self.signals)}
        return late if 2 * len(late) <= len(there) else set()


class NeverSmall(BoxOracle):
    """A box of fewer signals than must accuse it never dies."""

    def dead(self, box: int, signals: list[Oracle]) -> set[int]:
        return super().dead(box, signals) if len(signals) >= self.flight.box_signals else set()


@dataclass
class Common:
    """A flight of sixteen signals, and the answers of each frame."""

    flight: BoxFlight
    oracle: BoxOracle
    answers: list[list[Frame]]
    everywhere: bool  # nearly every signal accused somebody in the frame in which a box was failed

    def hangs_on(
        self,
        one: type[Oracle] = Oracle,
        all_signals: type[BoxOracle] = BoxOracle,
        references: type[References] = References,
    ) -> bool:
        """Whether other rules give other answers."""
        return fly(self.flight, one, all_signals, references).answers != self.answers

    def hangs_on_settings(self, **changes: int) -> bool:
        """Whether other settings of every signal give other answers."""
        others = [replace(s, **changes) for s in self.flight.settings]
        return fly(replace(self.flight, settings=others)).answers != self.answers

    def hangs_on_needed(self, box_signals: int) -> bool:
        """Whether another number of signals that accuse a channel gives other answers."""
        return fly(replace(self.flight, box_signals=box_signals)).answers != self.answers


def fly(
    flight: BoxFlight,
    one: type[Oracle] = Oracle,
    all_signals: type[BoxOracle] = BoxOracle,
    references: type[References] = References,
) -> Common:
    """Answer a flight; by other rules where they are given."""
    oracle = all_signals(flight)
    oracle.signals = [one(s) for s in flight.settings]
    for signal in oracle.signals:
        signal.references = references(signal.s)
    answers, everywhere = [], False
    for rows in flight.frames:
        answers.append(oracle.step(rows))
        failed = any(frame.decided_by == "box" for frame in answers[-1])
        accusing = sum(bool(signal.accused) for signal in oracle.signals)
        everywhere = everywhere or (failed and accusing > S - 3)
    return Common(flight, oracle, answers, everywhere)


def found(
    title: str, make: Callable[[int], BoxFlight], wish: Callable[[Common], bool], first: int, more: str
) -> Session:
    """A case of a flight that fulfils a wish, looked for from the seed ``first``; more : of what draws others."""
    for seed in range(first, first + POOL):
        common = fly(to_all_signals(make(seed), Random(f"{more} {seed}")))
        if wish(common):
            flown = [one_signal(common.flight, i) for i in range(S)]
            answers = [list(frames) for frames in zip(*common.answers, strict=True)]
            needed, persistence = common.flight.box_signals, common.flight.box_persistence
            return Session(title, flown, quiet_discretes(), answers, needed, persistence)
    raise LookupError(title)


def to_all_signals(flight: BoxFlight, draw: Random) -> BoxFlight:
    """The same flight with more signals, all healthy or all hit like those that are there, FRAMES long."""
    more, boxes = S - len(flight.settings), [s.box for s in flight.settings]
    boxes += [] if len(set(boxes)) == 1 else [0, 0, 0, S, S, S]  # the others stay small
    added = [untold(some_settings(draw, box=draw.choice(boxes))) for _ in range(more)]
    healthy = draw.random() < 0.5
    frames = (flight.frames + flight.frames[-1:] * FRAMES)[:FRAMES]
    settings = [*map(untold, flight.settings), *added]
    return replace(flight, settings=settings, frames=[[*rows, *others(rows, added, healthy)] for rows in frames])


def untold(s: Settings) -> Settings:
    """Without lanes, of which a unit is not told."""
    return replace(s, tie_break=tuple(name for name in s.tie_break if name != "lane"))


def others(rows: Sequence[Row], settings: Sequence[Settings], healthy: bool) -> list[Row]:
    """One frame of signals beside those of ``rows``."""
    if healthy:
        return [row(s.channels, (), None, ("absent",) * 4, None) for s in settings]
    like = [rows[i % len(rows)] for i in range(len(settings))]
    return [
        ([x if c < s.channels else None for c, x in enumerate(samples)], ilm, first, second)
        for s, (samples, ilm, first, second) in zip(settings, like, strict=True)
    ]


def one_signal(flight: BoxFlight, i: int) -> Flown:
    samples, ilm, references, seconds = (
        list(column) for column in zip(*(rows[i] for rows in flight.frames), strict=True)
    )
    return Flown(slow_faults(Flight(flight.settings[i], samples, ilm, references, seconds)))


def in_sets(common: Common) -> bool:
    return "1 failed as boxes" in common.oracle.rules and common.hangs_on_settings(box=1)


# Title, what its flights must reach, and the seeds from which these are looked for.
BOXES: list[tuple[str, Callable[[Common], bool], tuple[int, ...]]] = [
    (
        "a failed LRU is failed on all its signals",
        lambda common: {"1 failed as boxes", "failed where nothing spoke against it"} <= common.oracle.rules,
        (3, 6, 20),
    ),
    ("and on those of no other box", in_sets, (9, 131, 238)),
    (
        "two LRUs that fail together are failed",
        lambda common: {"2 failed as boxes", "failed where it was silent"} <= common.oracle.rules,
        (49, 60),
    ),
    (
        "an accused majority of boxes is not failed",
        lambda common: "an accused majority" in common.oracle.rules,
        (29, 60, 74),
    ),
    ("a majority of those that are in the box", lambda common: common.hangs_on(all_signals=MajorityOfAll), (80, 321)),
    ("an LRU that fails on nearly every signal", lambda common: common.everywhere, (545, 553)),
    (
        "more than half of the signals of a box accuse it",
        lambda common: common.flight.box_signals == -1 and common.hangs_on_needed(2) and common.hangs_on_needed(3),
        (4, 310),
    ),
    (
        "a box of fewer signals than must accuse it dies when all of them do",
        lambda common: common.hangs_on(all_signals=NeverSmall),
        (131,),
    ),
    ("trend and rank accuse no box", lambda common: common.hangs_on(TrendAccuses), (442, 529)),
    (
        "monitors and references accuse a box without a majority",
        lambda common: common.hangs_on(NoneAccused),
        (29, 55),
    ),
]
SOURCES: list[tuple[str, Callable[[Common], bool], tuple[int, ...]]] = [
    (
        "two references are one while what they read is in dispute",
        lambda common: "common mode: in dispute" in common.oracle.rules and common.hangs_on_settings(sources=0),
        (0, 50),
    ),
    ("but go on to contradict what they did before", lambda common: common.hangs_on(references=EndsRuns), (0, 100)),
    (
        "a first reference that is set aside disputes its signal",
        lambda common: common.hangs_on(references=SecondDisputes),
        (0, 50),
    ),
    (
        "so does a second that is off its vote for long",
        lambda common: common.hangs_on(references=FirstDisputes),
        (0, 50),
    ),
]


def sessions() -> Iterator[Session]:
    """All cases, in order."""
    for title, wish, seeds in BOXES:
        for number, seed in enumerate(seeds):
            yield found(f"{title}, {number + 1}", seeded_boxes, wish, seed, "boxes")
    off = found("no box is failed where that is switched off", seeded_boxes, BOXES[0][1], 0, "boxes")
    yield Session(off.requirement, off.signals, off.discretes)
    for title, wish, seeds in SOURCES:
        for number, seed in enumerate(seeds):
            yield found(f"{title}, {number + 1}", seeded_sources, wish, seed, "sources")
