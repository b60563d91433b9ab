"""Write the conformance vectors of a unit under test: what a monitor must say, by the independent reading.

    python tests/tools/unit_vectors.py [FILE]      rig/unit/vectors.npz when not given

Each case is named by what it tests and holds sixteen independent signals that reach it, drawn with fixed seeds; the
answers are those of tests/oracle.py and oracle_boxes.py.  What no oracle knows is switched off: the fade after a change
of level.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import vector_boxes
import vector_holds
import vector_rules
from oracle_answers import PAIRS
from oracle_boxes import ResettableOracle
from vector_flights import (
    FRAMES,
    LONG,
    NEVER,
    Flown,
    angle,
    at_airspeed,
    at_the_limits,
    beyond_with_resets,
    biased,
    bursting,
    discrete,
    levelled,
    paired,
    plain,
    quiet_discretes,
    quiet_signal,
    repeating,
    ruled,
    smoothed,
    smoothed_and_repeating,
    smoothed_with_resets,
    split_in_trends,
    spoken,
    stopped,
    tested,
    to_the_ends,
    with_absent_monitors,
    with_resets,
)
from vector_records import MISSING, Session

from rig.core.frame import D, S
from rig.unit.vectors import FILE, Case, save

Wanted = Callable[[Flown], bool]
POOL = 3600  # random signals that the cases choose from
INVALID = ("flag",)
BEYOND = ("above", "below")
RARE = 3  # signals that fulfil a wish, at least
NO_NUMBER = ("nan", "infinity", "-infinity")


def reached(*rules: str) -> list[Wanted]:
    """Signals for each of these rules of the oracle."""
    return [lambda flown, rule=rule: rule in flown.rules for rule in rules]


def otherwise(*kinds: type[ResettableOracle]) -> list[Wanted]:
    """Signals of which each of these other rules gives other answers."""
    return [lambda flown, kind=kind: flown.by(kind).answers != flown.answers for kind in kinds]


def without(**off: Any) -> list[Wanted]:
    """Signals that are answered otherwise when each of these settings is off."""
    return [lambda flown, one={name: value}: flown.hangs_on(**one) for name, value in off.items()]


def patterns(flown: Flown) -> set[str]:
    return {frame.pattern for frame in flown.answers}


def with_a_majority(flown: Flown) -> bool:
    """Suspects, and always a majority."""
    return patterns(flown) <= {"normal", "isolated"} and "isolated" in patterns(flown)


def latched(flown: Flown) -> bool:
    """A channel failed by comparison that agrees again while others go on."""
    last, samples = flown.answers[-1], flown.flight.samples[-1]
    back = [x for x, state in zip(samples, last.states, strict=False) if state == "failed" and x is not None]
    return with_a_majority(flown) and any(abs(x - last.voted) <= flown.settings.threshold for x in back)


def exact(name: str) -> Wanted:
    """A distance that is exactly a threshold decides."""
    return lambda flown: flown.hangs_on(**{name: getattr(flown.settings, name) * (1 - 1 / 1024)})


def exact_below(flown: Flown) -> bool:
    """A reference settles two halves, exactly its threshold above a sample."""
    given = zip(flown.answers, flown.flight.samples, flown.flight.references, strict=True)
    return any(
        frame.pattern in PAIRS and frame.decided_by == "reference" and x - flown.settings.reference_threshold in samples
        for frame, samples, x in given
        if x is not None
    )


def on_a_rank(side: int) -> Wanted:
    """Two halves are settled by a reference that lies on a sample: a little to one side it is another answer."""

    def wish(flown: Flown) -> bool:
        little = side * flown.settings.threshold / 1024
        references = [None if x is None else x + little for x in flown.flight.references]
        there = replace(flown, flight=replace(flown.flight, references=references))
        frames = [
            k for k, frame in enumerate(flown.answers) if frame.pattern in PAIRS and frame.decided_by == "reference"
        ]
        return bool(frames) and any(flown.answers[k].states != there.answers[k].states for k in frames)

    return wish


def common_moves(to: bool, *names: str) -> Wanted:
    """A common mode appears, or is gone, when these thresholds are a little smaller: one was met exactly."""

    def wish(flown: Flown) -> bool:
        smaller = {name: getattr(flown.settings, name) * (1 - 1 / 1024) for name in names}
        others = flown.with_settings(**smaller).answers
        return any(a.common != b.common and b.common == to for a, b in zip(flown.answers, others, strict=True))

    return wish


def trusted_again(flown: Flown) -> bool:
    """The reference is set aside, and trusted again later."""
    usable = [frame.usable for frame, x in zip(flown.answers, flown.flight.references, strict=True) if x is not None]
    return False in usable and True in usable[usable.index(False) :]


def not_compared(flown: Flown) -> bool:
    """Samples that cannot be compared, among some that can."""
    c = flown.settings.channels
    return any(None in row[:c] and row[:c].count(None) < c - 1 for row in flown.flight.samples)


def lost(flown: Flown) -> bool:
    return "lost" in patterns(flown) and flown.answers[0].pattern != "lost"


def absent_is_not_bad(flown: Flown) -> bool:
    """Other answers when the absent monitors say bad."""
    return spoken(flown, {c: {"absent": "bad"} for c in range(4)}).answers != flown.answers


def readmitted(flown: Flown) -> bool:
    levels = [frame.level for frame in flown.answers]
    return any(b > a for a, b in pairwise(levels))


def readmitted_exactly(flown: Flown) -> bool:
    """A channel that is readmitted has agreed by exactly a threshold."""
    return readmitted(flown) and exact("threshold")(flown)


def refused_early(flown: Flown) -> bool:
    """A command comes too early: a shorter wait gives other answers."""
    return replace(flown, readmit_frames=flown.readmit_frames - 1).answers != flown.answers


def by_three(flown: Flown) -> bool:
    """Other answers when three samples have the threshold of four."""
    return flown.hangs_on(threshold_triplex=None)


def by_two(flown: Flown) -> bool:
    return flown.hangs_on(threshold_duplex=None)


def behind_filter(flown: Flown) -> bool:
    return flown.hangs_on(filter_share=0.0)


def by_repeats(flown: Flown) -> bool:
    return flown.hangs_on(stale_frames=0)


def anything(_: Flown) -> bool:
    return True


def settled(pattern: str, *by: str) -> list[Wanted]:
    return reached(*(f"{pattern} settled by {name}" for name in by))


LAST = "last channel: {}".format
FREEZE = "freeze: {}".format
NO_RULE = [f"{pattern} by no rule" for pattern in ("2:2", "1:1:1:1", "1:1:1", "1:1")]
FILTERED = [f"{pattern} settled by reference" for pattern in ("2:2", "1:1:1:1", "1:1:1", "1:1")]
# Requirement, what its signals must reach in turn, and how samples are missing in it (all ways if not given).
PLAIN: list[tuple[str, list[Wanted], Sequence[str]]] = [
    ("the vote is the median, never with a suspect in it", [with_a_majority], ()),
    (
        "samples and references exactly a threshold apart agree",
        [exact("threshold"), exact("reference_threshold"), exact_below],
        (),
    ),
    ("a reference exactly on a sample", [on_a_rank(1), on_a_rank(-1)], ()),
    ("a sample that is no number is not compared", [not_compared], NO_NUMBER),
    ("a sample out of the sensor's range is not compared", [not_compared], BEYOND),
    ("a sample flagged invalid is not compared", [not_compared], INVALID),
    ("a signal without a sample holds its last vote", [lost], ()),
    ("2:2 settled by in-line monitors", settled("2:2", "ilm"), ()),
    ("2:2 settled by the reference", settled("2:2", "reference"), ()),
    ("2:2 settled by the trend", settled("2:2", "trend"), ()),
    ("1:1 settled by in-line monitors, reference and trend", settled("1:1", "ilm", "reference", "trend"), ()),
    ("1:1:1:1 settled by in-line monitors and the reference", settled("1:1:1:1", "ilm", "reference"), ()),
    ("1:1:1:1 settled by extremes", settled("1:1:1:1", "extremes"), ()),
    ("1:1:1 settled by in-line monitors and the reference", settled("1:1:1", "ilm", "reference"), ()),
    ("1:1:1 settled by the middle", settled("1:1:1", "middle"), ()),
    ("no rule settles it: a fixed mean of the two channels beside the last vote", reached(*NO_RULE), ()),
    (
        "the shares of that mean are found once, and stay with their channels",
        otherwise(vector_rules.Moved, vector_rules.SharedAgain, vector_rules.SharedByRank),
        (),
    ),
    (
        "a split is settled by an answer that has stood, a trend for the frames that it covers",
        otherwise(vector_rules.AtOnce, vector_rules.YoungTrend),
        (),
    ),
    (
        "the last channel against its monitor",
        reached(LAST("ilm, reference voted"), LAST("ilm, vote held"), LAST("failed by ilm"), LAST("ilm and reference")),
        (),
    ),
    (
        "the last channel against its reference",
        reached(LAST("reference, reference voted"), LAST("failed by reference")),
        (),
    ),
    (
        "counts stand still during and after a split",
        reached(FREEZE("count kept"), FREEZE("miscompare not counted"), FREEZE("what was left is longer")),
        (),
    ),
    (
        "but not those of a sample that is missing or of the last channel",
        reached(FREEZE("not comparable"), FREEZE("last channel exempt")),
        (),
    ),
    ("a reference off the ranks is set aside, and trusted again after agreement", [trusted_again], ()),
    ("a reference near one of the two voting ranks agrees", otherwise(vector_rules.AgainstTheVote), ()),
    ("two references against all channels are reported", reached("common mode: reported"), ()),
    ("two references against all channels lose the signal where configured", reached("common mode: lost"), ()),
    ("two references that contradict each other are no common mode", reached("common mode: references apart"), ()),
]


# Requirement, of which signals, and what these must reach in turn.
RULED: list[tuple[str, Callable[[int], Flown | None], list[Wanted]]] = [
    ("a split that no rule settles is given up", ruled, reached("given up")),
    (
        "an agreeing frame takes off the count what is configured",
        ruled,
        [*without(count_down=0.0), lambda flown: flown.settings.count_down == 0.5 and flown.hangs_on(count_down=1.0)],
    ),
    ("a side that does not move has no trend", ruled, otherwise(vector_rules.FrozenFalls)),
    ("small changes are a trend after one frame", ruled, without(trend_small=-1.0)),
    ("trend bytes that tumble", ruled, without(trend_tumbles=False)),
    (
        "the trend is asked without a reference, or beside one where configured",
        ruled,
        without(referred=False, trend_beside_reference=False),
    ),
    (
        "means weighted by the trend",
        ruled,
        without(weighted=False),
    ),
    (
        "means of a good pair, and of two that the trend settles, weighted by it too",
        split_in_trends,
        otherwise(vector_rules.PlainPairs, vector_rules.PlainGoodPairs),
    ),
    (
        "the pair that extremes have left is under suspicion",
        paired,
        [
            *reached("the pair of extremes cut", "both of a pair wrong by trend"),
            *otherwise(vector_rules.NeverCut, vector_rules.Unsuspected),
        ],
    ),
    (
        "until a channel is readmitted; a pair that is cut agrees no more",
        paired,
        otherwise(vector_rules.StaysSuspected, vector_rules.CutAgrees, vector_rules.AgreesAtOnce),
    ),
    (
        "a hold and its wait go on through gaps and answers that do not last, but for a channel that jumps",
        vector_holds.held_in_gaps,
        otherwise(vector_holds.AnsweredOnce, vector_holds.EndedByMissing, vector_holds.KeptThroughJumps),
    ),
    ("a reference is limited to the sensor's range", stopped, otherwise(vector_rules.BeyondTheStops)),
    ("a sensor at its stop does not repeat", stopped, otherwise(vector_rules.AtTheStops)),
    ("a sample that repeats for too long is not compared", repeating, [by_repeats, *reached("stale in a split")]),
    (
        "repeats count beside others that move, and gaps do not end them",
        repeating,
        otherwise(vector_rules.OfAllAtRest, vector_rules.EndedByGaps),
    ),
    ("beside the only channel its reference moves", repeating, otherwise(vector_rules.WithoutReference)),
    ("a step of the filter is limited", smoothed, otherwise(vector_rules.LimitedSample)),
    (
        "what a filter still shows of a burst is taken off the count",
        bursting,
        otherwise(vector_rules.CountsBursts, vector_rules.EndsBursts),
    ),
    (
        "a split that only a filter still shows does not go on",
        bursting,
        otherwise(vector_rules.NeverClosed, vector_rules.OnlySettles),
    ),
    ("a filter begins again after a stale sample", smoothed_and_repeating, otherwise(vector_rules.FollowsStale)),
]
TESTED: list[tuple[str, list[Wanted]]] = [
    (
        "slow-fault tests isolate one channel by its means or its squares, or one half by the reference",
        [
            *reached(*(f"test: {said}" for said in ("one by slow_means", "one by slow_squares", "the noisy of two"))),
            *reached("test: a half of 2", "test: a half of 4"),
            *otherwise(vector_rules.IsolatedBesideOthers, vector_rules.HalvesByAnySlope),
            *otherwise(vector_rules.ReferenceAskedEarly, vector_rules.ReferenceAsKnownAtALevel),
            *otherwise(vector_rules.LearnsBursts, vector_rules.NoiseInFull),
        ],
    ),
    (
        "they are limited, learn, allow for motion, for a stop and for channels that stand still, and begin again",
        [
            *without(slow_scale=0.0, slow_skew=0.0, slow_reference_frames=0.0, slow_bias=100.0, slow_noise=1e-4),
            *without(slow_squares=1.1, slow_halves=1.1),
            *otherwise(vector_rules.KeptAfterReset, vector_rules.WeightsKeptAfterReset),
            *otherwise(vector_rules.SlowKeptAtALevel, vector_rules.LearnsEvenly, vector_rules.KnownByFrames),
            *otherwise(vector_rules.IsolatedBesideStill, vector_rules.TestedAtTheStop, vector_rules.MovedBySplits),
            *reached("test: one by slow_squares"),
        ],
    ),
    (
        "they learn a usable reference, up to its threshold, and take no gap and no median off the majority for motion",
        [
            *otherwise(vector_rules.LearnsUnusable, vector_rules.LearnsFarOff),
            *otherwise(vector_rules.MovedOffMajority, vector_rules.MovedOutOfSplits, vector_rules.MovedByGaps),
            *otherwise(vector_rules.HalfOfTheNoise, vector_rules.TurnForgotten, vector_rules.QuietSheet),
            *reached("test: a half of 2", "test: a half of 4"),
        ],
    ),
]
LIMITS = [
    (True, "reference_threshold"),
    (True, "second_threshold"),
    (True, "threshold"),
    (False, "reference_threshold", "second_threshold"),
]


@cache
def drawn(make: Callable[[int], Flown | None], seed: int) -> Flown | None:
    return make(seed)


def chosen(make: Callable[[int], Flown | None], wanted: list[Wanted]) -> list[Flown]:
    """A signal for each place, which fulfil the wishes in turn; those of a rare wish come again."""
    found = []
    for turn, wish in enumerate(wanted):
        places = len(range(turn, S, len(wanted)))
        seen = (flown for seed in range(POOL) if (flown := drawn(make, seed)) is not None and wish(flown))
        found.append(list(islice((flown for flown in seen if without_ties(flown)), places)))
        if len(found[-1]) < min(places, RARE):
            raise LookupError(f"wish {turn}: {len(found[-1])} signals")
    return [found[i % len(wanted)][(i // len(wanted)) % len(found[i % len(wanted)])] for i in range(S)]


def without_ties(flown: Flown) -> bool:
    """Whether nothing hangs on the order of equal samples."""
    return flown.by(vector_rules.OtherTies).answers == flown.answers


def of_signals(
    title: str,
    make: Callable[[int], Flown | None],
    wanted: list[Wanted],
    how: Sequence[str] = (),
    frames: int = FRAMES,
) -> Session:
    """A case of signals alone."""
    return Session(title, chosen(make, wanted), quiet_discretes(frames), missing=how or MISSING, frames=frames)


def of_discretes(title: str, seed: str, resets: bool) -> Session:
    """A case of discretes alone."""
    return Session(title, [quiet_signal()] * S, [discrete(f"{seed} {d}", resets) for d in range(D)])


def mixed(number: int) -> Session:
    """Whatever comes: every kind of signal, discretes with resets."""
    makes = [plain, plain, plain, with_resets, with_absent_monitors]
    signals = [makes[i % len(makes)](POOL + 1 + number * S + i) for i in range(S)]
    return Session(f"mixed, {number}", signals, [discrete(f"mixed {number} {d}") for d in range(D)])


def sessions() -> Iterator[Session]:
    """All cases, in order."""
    yield from (of_signals(title, plain, wanted, how) for title, wanted, how in PLAIN)
    title = "a channel that miscompares for its persistence is failed and stays so"
    yield of_signals(title, lambda seed: replace(with_resets(seed), readmit_frames=NEVER), [latched])
    title = "a sample at the end of the sensor's range is compared"
    yield of_signals(title, to_the_ends, [not_compared])
    title = "references exactly at the limits of a common mode"
    yield of_signals(title, at_the_limits, [common_moves(*moves) for moves in LIMITS])
    title = "the reference threshold of a dynamic pressure by its airspeed"
    yield of_signals(title, at_airspeed, [lambda flown: replace(flown, airspeed_m_s=0.0).answers != flown.answers])
    yield of_signals("an absent monitor is not a bad one", with_absent_monitors, [absent_is_not_bad])
    yield of_signals(
        "a reset readmits only after agreement", with_resets, [readmitted, refused_early, readmitted_exactly]
    )
    title = "a failed channel without a sample in range does not agree"
    yield of_signals(title, beyond_with_resets, [readmitted, refused_early], BEYOND)
    yield of_signals("thresholds of their own for three and for two samples", levelled, [by_three, by_two])
    yield of_signals("comparisons behind a filter", smoothed, [behind_filter, *reached(*FILTERED)])
    for number in range(2):
        title = f"small deviations are summed until they fail a channel, {number + 1}"
        yield of_signals(title, lambda seed, n=number: biased(2000 * n + seed), reached("slow"))
    yield of_signals("a sample that repeats for too long, beside what else lasts", biased, [by_repeats])
    yield of_signals(
        "a reset behind a filter", smoothed_with_resets, [lambda flown: readmitted(flown) and behind_filter(flown)]
    )
    for number in range(3):
        yield of_signals(
            f"angles on the circle, {number + 1}",
            lambda seed, n=number: angle(1000 * n + seed),
            [anything],
        )
    title = "angles are taken near to the first samples that there are"
    yield of_signals(title, lambda seed: angle(seed, 3), otherwise(vector_rules.BegunAtZero))
    for title, make, wanted in RULED:
        yield of_signals(title, make, wanted)
    for title, wanted in TESTED:
        yield of_signals(title, tested, wanted, frames=LONG)
    title = "beside slow-fault tests small deviations are summed without the biases"
    wanted = otherwise(vector_rules.SumsAboutSamples, vector_rules.SumsWithBiases)
    yield of_signals(title, tested, wanted, frames=LONG)
    yield from vector_boxes.sessions()
    for number in range(3):
        title = f"majority of discretes, the fail-safe value without one, {number + 1}"
        yield of_discretes(title, f"majority {number}", resets=False)
    for number in range(3):
        title = f"a reset readmits a discrete channel only after agreement, {number + 1}"
        yield of_discretes(title, f"resets {number}", resets=True)
    yield from (mixed(number) for number in range(1, 9))


def cases() -> list[Case]:
    return [session.case() for session in sessions()]


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    made = cases()
    save(made, path)
    frames = sum(len(case.inputs) for case in made)
    print(f"{path}: {len(made)} cases, {frames} frames, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
