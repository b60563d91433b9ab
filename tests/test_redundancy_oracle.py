"""The monitor against tests/oracle.py, which was written from the requirement alone, over random flights."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import log1p
from random import Random

import numpy as np
import pytest
from conftest import FEWER, Voted, vote_samples
from hypothesis import example, given, settings
from one_stage import step_stage
from oracle import Frame
from oracle_answers import Settings
from oracle_boxes import SIGNALS, BoxFlight, BoxOracle, ResettableOracle, seeded_boxes, seeded_sources
from oracle_flights import (
    Flight,
    Pick,
    at_the_stop,
    by_all,
    by_level,
    filtered,
    flights,
    held,
    left_by_extremes,
    seeded,
    slow_faults,
    with_commands,
)
from oracle_slow_flights import slow_tests

from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.manager_params import PARAM_FIELDS
from rig.computer.redundancy.managers import Manager
from rig.core.frame import DecidedBy, Ilm, Pattern, State, new_block

FLAGS = {"bad": int(Ilm.BAD), "good": int(Ilm.GOOD), "absent": int(Ilm.ABSENT)}


OF_TESTS = tuple(each.name for each in PARAM_FIELDS if each.part == "slow_tests")


def run(flight: Flight) -> Voted:
    """Run a flight through the manager; None is a sample that is not a number."""
    s = flight.settings
    return vote_samples(
        np.array(flight.samples, float),
        reference=np.array(flight.references, float),
        second=np.array(flight.seconds, float) if flight.seconds else None,
        second_threshold=s.second_threshold,
        common=(s.common_persistence, s.common_fails),
        ilm=[[FLAGS[flag] for flag in row] for row in flight.ilm],
        wraps=s.turn > 0,
        limits=(0.0, 2 * np.pi) if s.turn else (max(s.low, -1000.0), min(s.high, 1000.0)),
        lanes=[[c in failed for c in range(4)] for failed in flight.lanes] or None,
        params={
            "unresolved_frames": s.unresolved_frames,
            "referred": s.referred,
            **{name: getattr(s, name) for name in OF_TESTS},
        },
        resets=[(k, c + 1) for k, commanded in enumerate(flight.resets) for c in commanded],
        readmit_frames=flight.readmit_frames,
        channels=s.channels,
        threshold=s.threshold,
        persistence=s.persistence,
        split_persistence=s.split_persistence,
        tie_break=list(s.tie_break),
        count_down=s.count_down or None,
        trend_frames=s.trend_frames,
        trend_small=None if s.trend_small < 0 or s.trend_tumbles else s.trend_small,
        trend_window="tumbling" if s.trend_tumbles else "sliding",
        trend_beside_reference=s.trend_beside_reference,
        mean="trend-weighted" if s.weighted else "plain",
        reference_threshold=s.reference_threshold,
        threshold_triplex=s.threshold_triplex,
        threshold_duplex=s.threshold_duplex,
        filter_s=-1.0 / (100.0 * log1p(-s.filter_share)) if s.filter_share else 0.0,
        slow_allowance=s.slow_allowance if s.slow_limit else None,
        slow_limit=s.slow_limit / 100.0 if s.slow_limit else None,
        stale_frames=s.stale_frames,
    )


def on_the_circle(flight: Flight) -> Flight:
    """The same flight with every value in [0, 2 pi)."""
    turn = 2 * np.pi
    samples = [[None if x is None else x % turn for x in row] for row in flight.samples]
    references = [None if x is None else x % turn for x in flight.references]
    seconds = [None if x is None else x % turn for x in flight.seconds]
    return replace(flight, samples=samples, references=references, seconds=seconds)


def check(flight: Flight, name: str = "") -> set[str]:
    """Compare every frame with the oracle; return which of its rules the flight reached."""
    s, reached = flight.settings, set[str]()
    flight = on_the_circle(flight) if s.turn else flight
    out, oracle = run(flight), ResettableOracle(s, readmit_frames=flight.readmit_frames)
    resets = flight.resets or [()] * len(flight.samples)
    for k, (given_in_frame, reset) in enumerate(zip(flight.frames, resets, strict=True)):
        oracle.command(set(reset))
        wanted = oracle.step(*given_in_frame)
        reached |= oracle.rules
        assert decision(out, k, s.channels, wanted.voted) == wanted, (name, k)
        assert (out.state[k, s.channels :] == State.ABSENT).all()
        if s.turn:
            assert abs(np.sin((out.voted[k] - wanted.voted) / 2)) < 1e-9, (name, k)
            oracle.vote = None if oracle.vote is None else float(out.voted[k])  # the same turn for both
        else:
            assert near(out.voted[k], wanted.voted), (name, k)
    return reached


def near(vote: float, wanted: float) -> bool:
    """Whether two votes differ by rounding alone."""
    return abs(vote - wanted) <= 1e-9 + 1e-6 * abs(wanted)


STATES, PATTERNS = [x.name.lower() for x in State], [x.label for x in Pattern]
TIE_BREAKS = [x.name.lower() for x in DecidedBy]


def decision(out: Voted, k: int, channels: int, voted: float) -> Frame:
    """Frame ``k`` of the manager in the oracle's words, but for the vote, which rounding may move."""
    return Frame(
        voted,
        [STATES[x] for x in out.state[k, :channels].tolist()],
        int(out.level[k]),
        PATTERNS[out.pattern[k]],
        TIE_BREAKS[out.decided_by[k]],
        (int(out.trend_high[k]), int(out.trend_low[k])),
        bool(out.reference_usable[k]),
        bool(out.common_mode[k]),
    )


PLAIN = Settings(turn=2 * np.pi)


@settings(max_examples=round(75 / FEWER), deadline=None, derandomize=True)
@given(flights())
def test_every_decision_and_vote_is_that_of_the_requirement(flight: Flight):
    check(flight)


@settings(max_examples=round(40 / FEWER), deadline=None, derandomize=True)
@given(flights(turn=True))
@example(Flight(PLAIN, [[0.1, 6.2, 0.0, 6.25]] * 12, [("good",) * 4] * 12, [0.05] * 12))
@example(Flight(PLAIN, [[0.1, 6.2, 2.0, 2.1]] * 12, [("good",) * 4] * 12, [6.28] * 12))
def test_and_of_an_angle_on_the_circle(flight: Flight):
    check(flight)


RULES = (
    *(f"2:2 settled by {name}" for name in ("ilm", "lane", "reference", "trend")),
    *(f"1:1:1:1 settled by {name}" for name in ("ilm", "reference", "extremes")),
    *(f"1:1:1 settled by {name}" for name in ("ilm", "reference", "middle")),
    *(f"1:1 settled by {name}" for name in ("ilm", "lane", "reference", "trend")),
    *(f"{pattern} by no rule" for pattern in ("2:2", "1:1:1:1", "1:1:1", "1:1")),
    *(f"last channel: {said}" for said in ("ilm, reference voted", "ilm, vote held", "reference, reference voted")),
    *(f"last channel: {said}" for said in ("ilm and reference", "failed by ilm", "failed by reference")),
    *(f"freeze: {said}" for said in ("count kept", "miscompare not counted", "not comparable")),
    *(f"freeze: {said}" for said in ("last channel exempt", "what was left is longer")),
    *(f"common mode: {said}" for said in ("reported", "lost", "references apart")),
    *("an answer too young", "given up", "frozen side", "counted down"),
)
OF_SLOW_FAULTS = (
    "slow",
    "stale",
    "stale in a split",
    "a repeat of which too few tell",
)
OF_SLOW_TESTS = (
    *(f"test: {said}" for said in ("one by slow_means", "one by slow_squares", "not alone", "a slope", "no slope")),
    *(f"test: {said}" for said in ("a half of 2", "a half of 4", "beside two that stand still", "the noisy of two")),
    "test: near an end of the range",
    *("test: a channel is missing", "test: a median off the majority", "test: halves of which four were never in use"),
    *("test: learned again after a reset", "slow beside the tests"),
    *("test: straight on after a turn", "test: noise of the data sheet"),
)
OF_PAIRS = (
    *("the pair of extremes cut", "reference not monitored by a suspected pair", "both of a pair wrong by trend"),
    "common mode: lost",
)
OF_FILTERS = (
    *("split closed behind the filter", "counted down: the rest of a burst"),
    *("filter begun at first", "filter begun beside the smoothed vote"),
)
OF_HOLDS = (
    *(f"hold: {said}" for said in ("from the last vote", "halves", "jumped", "goes on after a gap or an answer")),
    *(f"open: {said}" for said in ("an answer has stood", "kept beside a young answer", "kept in a frame with a gap")),
    "given up",
)
FAMILIES: dict[str, tuple[Callable[[Flight, Pick], Flight], int, tuple[str, ...]]] = {
    "drawn evenly": (lambda flight, pick: flight, 1250, RULES),
    "thresholds by level": (by_level, 150, ()),
    "behind a filter": (filtered, 150, OF_FILTERS),
    "slow faults": (slow_faults, 200, OF_SLOW_FAULTS),
    "slow-fault tests": (slow_tests, 300, OF_SLOW_TESTS),
    "held": (held, 200, OF_HOLDS),
    "left by extremes": (left_by_extremes, 300, OF_PAIRS),
    "at the stop": (at_the_stop, 150, ()),
    "readmitted": (with_commands, 150, ()),
    "all at once": (by_all, 200, (*OF_SLOW_FAULTS, OF_FILTERS[0], "given up")),
}
RARE = {  # seeds beyond the first of a family, that reach the rules which those do not reach
    "drawn evenly": (252, 1028),
    "slow-fault tests": (10, 12, 18, 22, 29, 40, 52, 59, 135),
    "left by extremes": (257,),
}
OF_ANGLES = [name for name in FAMILIES if name not in ("left by extremes", "at the stop")]


def survey(family: str, seeds: Iterable[int], turn: bool = False) -> Counter[str]:
    """Check the flights of a family; return how many of them reached each rule."""
    change, where = FAMILIES[family][0], " on the circle" if turn else ""
    reached = Counter[str]()
    for seed in seeds:
        reached.update(check(change(seeded(seed, turn), Random(seed).choice), f"seed {seed}{where}"))
    return reached


def few(family: str) -> int:
    """How many flights of a family are quick: those of the slow-fault tests are long."""
    return 6 if family == "slow-fault tests" else FAMILIES[family][1] // 8


@pytest.mark.parametrize("family", FAMILIES)
def test_so_are_those_of_flights_of_every_family(family: str):
    reached = survey(family, [*range(few(family)), *RARE.get(family, ())])
    assert [rule for rule in FAMILIES[family][2] if not reached[rule]] == []


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_so_are_those_of_many_flights_which_reach_every_rule_often(family: str):
    _, flown, rules = FAMILIES[family]
    reached = survey(family, range(round(flown / FEWER)))
    # A part of the flights need not reach every rule.
    assert FEWER > 1 or {rule: reached[rule] for rule in rules if reached[rule] < 5} == {}


@pytest.mark.parametrize("family", OF_ANGLES)
def test_and_of_angles(family: str):
    survey(family, range(few(family) // 2), turn=True)


@pytest.mark.long
@pytest.mark.parametrize("family", OF_ANGLES)
def test_and_of_many_angles(family: str):
    survey(family, range(round(FAMILIES[family][1] / 3 / FEWER)), turn=True)


OF_FLIGHTS = (
    *("unresolved_frames", "referred", "box", "tells", "sources"),
    *("common_persistence", "common_fails", "second_threshold"),
)


def run_boxes(flight: BoxFlight) -> list[Voted]:
    """All signals of a flight through one manager; what each of them came to."""
    params = np.zeros(SIGNALS, PARAMS)
    for record, s in zip(params, flight.settings, strict=True):
        given = {key: getattr(s, key) for key in ("threshold", "persistence", "split_persistence")}
        config = SignalConfig.model_validate({**given, "tie_break": list(s.tie_break)})
        fill(record, config, (-1000.0, 1000.0), s.channels, False, 100.0)
        for name in OF_FLIGHTS:
            record[name] = getattr(s, name)
    block = new_block(len(flight.frames))
    block["channels"] = block["reference"] = block["second_reference"] = np.nan
    for k, frame in enumerate(flight.frames):
        for i, (samples, flags, reference, second) in enumerate(frame):
            block["channels"][k, i], block["ilm"][k, i] = np.array(samples, float), [FLAGS[flag] for flag in flags]
            block["reference"][k, i] = np.nan if reference is None else reference
            block["second_reference"][k, i] = np.nan if second is None else second
    block["valid"] = 1
    chosen = None if flight.box_signals < 0 else flight.box_signals
    manager = Manager("cross-channel", params, box_signals=chosen, box_persistence=flight.box_persistence)
    for k in range(len(block)):
        step_stage(manager, block, k)
    return [Voted(block, i) for i in range(SIGNALS)]


BOX_RULES = (
    *("1 failed as boxes", "2 failed as boxes", "an accused majority", "a box of one signal", "no boxes"),
    *("failed where it was silent", "failed where nothing spoke against it"),
)
SOURCE_RULES = ("common mode: in dispute", "common mode: lost", "common mode: reported")


def survey_boxes(drawn: Callable[[int], BoxFlight], seeds: Iterable[int]) -> Counter[str]:
    """Check all signals of flights; return how many of them reached each rule."""
    reached = Counter[str]()
    for seed in seeds:
        flight = drawn(seed)
        out, oracle = run_boxes(flight), BoxOracle(flight)
        for k, given_in_frame in enumerate(flight.frames):
            for i, wanted in enumerate(oracle.step(given_in_frame)):
                found = decision(out[i], k, flight.settings[i].channels, wanted.voted)
                assert found == wanted, (seed, k, i)
                assert near(out[i].voted[k], wanted.voted), (seed, k, i)
        reached.update(oracle.rules)
    return reached


@pytest.mark.parametrize(
    ("drawn", "seeds", "rules"),
    [(seeded_boxes, range(61), BOX_RULES), (seeded_sources, range(12), SOURCE_RULES)],
)
def test_what_signals_have_in_common_is_decided_as_the_requirement_does(
    drawn: Callable[[int], BoxFlight], seeds: range, rules: tuple[str, ...]
):
    reached = survey_boxes(drawn, seeds)
    assert [rule for rule in rules if not reached[rule]] == []


@pytest.mark.long
@pytest.mark.parametrize(
    ("drawn", "flown", "rules"), [(seeded_boxes, 400, BOX_RULES), (seeded_sources, 60, SOURCE_RULES)]
)
def test_so_it_is_in_many_flights_which_reach_every_rule_often(
    drawn: Callable[[int], BoxFlight], flown: int, rules: tuple[str, ...]
):
    reached = survey_boxes(drawn, range(round(flown / FEWER)))
    assert FEWER > 1 or {rule: reached[rule] for rule in rules if reached[rule] < 6} == {}
