"""The long sessions of the conformance test: our manager answers as the independent reading; slow defects are found."""

from __future__ import annotations

from math import isfinite, isnan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from oracle_answers import Settings
from oracle_boxes import ResettableOracle
from oracle_discrete import DiscreteOracle, DiscreteSettings
from test_unit_vectors import Library, objects, with_defect
from unit_defects import Defect
from unit_files import compiled, needs_a_compiler, written

from rig.bench.unit_check import check, long_cases, our_answers
from rig.bench.unit_long import FRAMES, MOST_FRAMES, TITLES, inputs_of
from rig.computer.redundancy.manager_params import told
from rig.core.frame import CHANNELS, Block, D, DecidedBy, Ilm, Pattern, S, State
from rig.unit.unit_records import ANSWERS
from rig.unit.vectors import VOTES_WITHIN, differences

assert objects  # the fixture
PATTERNS = {pattern.label: int(pattern) for pattern in Pattern}
STATES, TIE_BREAKS, ILM = (
    {state.name.lower(): int(state) for state in State},
    {decided_by.name.lower(): int(decided_by) for decided_by in DecidedBy},
    {int(ilm): ilm.name.lower() for ilm in Ilm},
)
GIVEN = ("channels", "valid", "ilm", "reference", "second_reference", "reset")
FLAGS = ("trend_high", "trend_low", "reference_usable", "common_mode")
ANSWERED = ("voted", "state", "level", "pattern", "decided_by", *FLAGS)


def settings(row: NDArray[Any], slow_faults: NDArray[Any], rules: NDArray[Any], tests: NDArray[Any]) -> Settings:
    """The oracle's settings of the CONFIG records of one signal."""
    number = {name: float(row[name]) for name in row.dtype.names or () if row[name].ndim == 0}
    return Settings(
        threshold=number["threshold"],
        threshold_triplex=number["threshold_triplex"],
        threshold_duplex=number["threshold_duplex"],
        reference_threshold=number["reference_threshold"],
        second_threshold=number["second_threshold"],
        persistence=int(row["persistence"]),
        split_persistence=int(row["split_persistence"]),
        trend_frames=int(row["trend_frames"]),
        filter_share=float(row["filter_gain"]),
        common_persistence=int(row["common_persistence"]),
        common_fails=bool(row["common_fails"]),
        tie_break=tuple(DecidedBy(one).name.lower() for one in row["tie_break"] if one),
        channels=int(row["fitted"]),
        turn=2 * np.pi if row["wraps"] else 0.0,
        weighted=bool(row["weighted"]),
        low=number["low"],
        high=number["high"],
        slow_allowance=float(slow_faults["slow_allowance"]),
        slow_limit=float(slow_faults["slow_limit"]),
        stale_frames=int(slow_faults["stale_frames"]),
        **{name: rules[name].item() for name in told("rules")},
        **{name: tests[name].item() for name in told("slow_tests")},
    )


class FadingOracle(ResettableOracle):
    """With what the short vectors leave off: the fade.

    It begins in the frame after a change of level, at the vote that was said before, and ends after its frames; a
    change of level ends one that is under way.
    """

    fade_frames, low, said, fade, left, shown = 0, 0.0, 0.0, 0.0, 0, 0

    def within(self, x: float) -> float:
        return self.low + (x - self.low) % self.s.turn if self.s.turn else min(max(x, self.s.low), self.s.high)

    def say(self, *given: Any) -> tuple[Any, float]:
        """A frame and the vote that is said."""
        frame = self.step(*given)
        self.vote = self.within(frame.voted)
        if self.left == self.fade_frames:
            self.fade = self.s.near(self.said, self.vote) - self.vote
        fading = 0 < self.left <= self.fade_frames and frame.level == self.shown
        self.said = self.within(self.vote + self.fade * self.left / (self.fade_frames + 1)) if fading else self.vote
        self.left = self.fade_frames if frame.level != self.shown else max(self.left - 1, 0)
        self.shown = frame.level
        return frame, self.said


def oracle_of(config: NDArray[Any], i: int) -> FadingOracle:
    """The oracle of signal ``i``."""
    row, *parts = (config[part][0, i] for part in ("signal", "slow_faults", "rules", "slow_tests"))
    oracle = FadingOracle(settings(row, *parts), readmit_frames=int(row["readmit_frames"]))
    oracle.fade_frames, oracle.low, oracle.shown = int(row["fade_frames"]), float(row["low"]), int(row["fitted"])
    return oracle


def wrong(config: NDArray[Any], inputs: NDArray[Any], rows: Block) -> dict[int, str]:
    """Where our answers of a signal are first not the oracle's."""
    oracles, found = [oracle_of(config, i) for i in range(S)], dict[int, str]()
    within = (VOTES_WITHIN * (config["signal"]["high"] - config["signal"]["low"]))[0].tolist()
    given = zip(*(inputs[name].tolist() for name in GIVEN), strict=True)
    answers = zip(*(rows[name].tolist() for name in ANSWERED), strict=True)
    for k, (asked, answered) in enumerate(zip(given, answers, strict=True)):
        disputed = sum(one.s.tells for one in oracles if one.references.in_dispute)
        for i, one in enumerate(oracles):
            frame, said = say(one, [column[i] for column in asked], bool(one.s.sources & disputed))
            states = [STATES[name] for name in frame.states] + [STATES["absent"]] * (CHANNELS - one.s.channels)
            patterns = [frame.level, PATTERNS[frame.pattern], TIE_BREAKS[frame.decided_by]]
            voted, *ours = (column[i] for column in answered)
            theirs = [states, *patterns, *frame.trend, frame.usable, frame.common]
            if ours != theirs or not abs(voted - said) <= within[i]:
                found.setdefault(i, f"frame {k}: {voted} {ours}, the oracle says {said} {theirs} {frame}")
    return found


def say(one: FadingOracle, asked: list[Any], in_dispute: bool) -> tuple[Any, float]:
    """A frame of one signal, of which columns of INPUT are ``asked``, and the vote that is said."""
    x, valid, ilm, first, second, reset = asked
    low, high = one.s.low, one.s.high
    there = [c < one.s.channels and valid[c] != 0 and isfinite(x[c]) and low <= x[c] <= high for c in range(CHANNELS)]
    samples = [x[c] if there[c] else None for c in range(CHANNELS)]
    references = [None if isnan(reference) else reference for reference in (first, second)]
    one.command({c for c in range(one.s.channels) if reset >> c & 1})
    return one.say(samples, [ILM[flag] for flag in ilm], *references, (), in_dispute)


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(TITLES)), ids=TITLES)
def test_our_manager_answers_the_long_sessions_as_the_oracle(number: int):
    """Boxes apart, which join the signals: the C monitor and the short vectors have them."""
    config, inputs = inputs_of(number)
    config["box_signals"] = 0
    assert wrong(config, inputs, our_answers(config, inputs)) == {}


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(TITLES)), ids=TITLES)
def test_so_are_the_discretes(number: int):
    config, inputs = inputs_of(number)
    rows = our_answers(config, inputs)
    for d in range(D):
        row = config["discrete"][0, d]
        names = ("fail_safe", "persistence", "readmit_frames")
        oracle = DiscreteOracle(DiscreteSettings(*(int(row[name]) for name in names), channels=int(row["fitted"])))
        for k, given in enumerate(inputs):
            good = (given["discrete_valid"][d] != 0) & (given["discrete_ilm"][d] != Ilm.BAD)
            samples = [bool(x) if ok else None for x, ok in zip(given["discrete_channels"][d], good, strict=True)]
            vote, states, level = oracle.step(
                samples, {c for c in range(CHANNELS) if given["discrete_reset"][d] >> c & 1}
            )
            said = (rows["discrete_voted"][k, d], rows["discrete_level"][k, d], rows["discrete_state"][k, d].tolist())
            assert said == (vote, level, [State[name.upper()] for name in states]), (d, k)


def test_the_sessions_go_through_all_levels_and_back():
    cases = long_cases(FRAMES)
    seen = [case.expected["level"].astype(int) for case in cases]
    assert all((np.diff(levels, axis=0) > 0).sum() >= 5 for levels in seen)
    assert sum(set(levels.ravel().tolist()) == {0, 1, 2, 3, 4} for levels in seen) >= 3
    patterns = np.concatenate([case.expected["pattern"].ravel() for case in cases])
    assert {Pattern.NORMAL, Pattern.ISOLATED, Pattern.P1_1, Pattern.LOST} <= set(patterns.tolist())
    assert all(case.expected["common_mode"].any() for case in cases)


SLOW = [
    Defect("no fade", "if ((left > 0) && (left <= p->fade_frames)) {", "if (false) {"),
    Defect("no weighting", "mean(f->low, f->high, (p->weighted != 0)", "mean(f->low, f->high, (p->weighted > 1)"),
    Defect(
        "a readmission is forgotten after 1,000 frames",
        "agrees ? (s->latches.agreed[c] + 1) : 0;",
        "agrees && (s->latches.agreed[c] < 1000) ? (s->latches.agreed[c] + 1) : 0;",
    ),
    Defect(
        "counts of eight bits",
        "(s->latches.count[c] >= (double)p->persistence)",
        "((uint8_t)s->latches.count[c] >= p->persistence)",
    ),
    Defect("agreement of eight bits", "int64_t agreed[RIG_CHANNELS]; /*", "uint8_t agreed[RIG_CHANNELS]; /*"),
    Defect(
        "the second reference ignored after a while",
        "    return off_vote(f->reference,",
        "    static unsigned calls;\n    return (calls++ < 6400U) && off_vote(f->reference,",
    ),
    Defect("the fade of eight bits", "int64_t fade_left;", "int8_t fade_left;"),
    Defect("a common mode of eight bits", "int64_t common_run;", "int8_t common_run;"),
    Defect(
        "a reference set aside is never trusted again after a while",
        "s->reference_usable = agrees;",
        "static unsigned changes;\n        s->reference_usable = agrees && (changes++ < 20U);",
    ),
    Defect(
        "a memory cleared every 256 frames",
        "    s->accused = boxes_accuse(&f, p, s);",
        "    s->accused = boxes_accuse(&f, p, s);\n"
        "    memset(s->latches.count, 0, ((stepped % 256U) == 255U) ? sizeof s->latches.count : 0U);",
    ),
    Defect(
        "the last change of the vote forgotten",
        "s->rise_vote = s->started ? difference(raw, s->vote, p) : 0.0;",
        "s->rise_vote = 0.0;",
    ),
    Defect("frames learned of eight bits", "    t->learned++;", "    t->learned = (t->learned + 1) % 256;"),
    Defect(
        "frames of a reference of eight bits",
        "t->reference_learned++;",
        "t->reference_learned = (t->reference_learned + 1) % 256;",
    ),
    Defect("what is learned kept where a channel is readmitted", "    tests_readmit(before.failed, s);\n", ""),
    Defect(
        "limits not renewed after a while",
        "(t->known >= t->limits_until)",
        "((t->known >= t->limits_until) && (t->learned < 256))",
    ),
    Defect("sums with the biases that are learned", "(f->x[c] - s->slow_tests.bias[c]) - m;", "f->x[c] - m;"),
    Defect(
        "sums that go on when the level changes",
        "{\n    memset(l->above, 0, sizeof l->above);\n    memset(l->below, 0, sizeof l->below);\n}",
        "{\n    (void)l;\n}",
    ),
    Defect("the step of a sum not limited", "step = (most < excess) ? most : excess;", "step = excess + (0.0 * most);"),
    Defect("a sum that fails a channel among others", "((2 * calm) > f->n) ? worst", "(calm >= 0) ? worst"),
    Defect("noise within the data sheet", "(sheet * sheet) - (FOLLOWS * variance)", "0.0 * (sheet * FOLLOWS)"),
    Defect(
        "the motion in which the reference's bias was learned", "fabs(t->rate - t->reference_rate)", "fabs(t->rate)"
    ),
    Defect("channels isolated beside two that stand still", "&& !suspected && !beside)", "&& !(suspected && beside))"),
    Defect("the count of repeats forgotten", "l->repeats[c]++;", "l->repeats[c] = 1;"),
    Defect("repeats of eight bits", "int64_t repeats[RIG_CHANNELS];", "uint8_t repeats[RIG_CHANNELS];"),
    Defect(
        "a stale sample that counts as agreement",
        " && !slow_is_stale(c, &s->slow_faults) && !has",
        " && !has",
    ),
]
WORD = Defect("agreement of sixteen bits", "int64_t agreed[RIG_CHANNELS]; /*", "uint16_t agreed[RIG_CHANNELS]; /*")


@needs_a_compiler
def test_the_monitor_in_c_says_the_same_bits(objects: dict[str, Path], tmp_path: Path):
    monitor = Library(compiled([*objects.values()], tmp_path / "libmonitor.so"))
    for case in long_cases(FRAMES):
        said = monitor.said(case)
        names = [name for name in ANSWERS if name not in ("surface", "law")]
        assert [name for name in names if said[name].tobytes() != case.expected[name].tobytes()] == []


@pytest.mark.long
@needs_a_compiler
@pytest.mark.parametrize("defect", SLOW, ids=[defect.name for defect in SLOW])
def test_a_slow_defect_is_found(defect: Defect, objects: dict[str, Path], tmp_path: Path):
    monitor = with_defect(defect, objects, tmp_path)
    assert any(list(differences(case, monitor.said(case))) for case in long_cases(FRAMES))


@pytest.mark.long
@needs_a_compiler
def test_a_counter_of_sixteen_bits_is_found_by_the_longest(objects: dict[str, Path], tmp_path: Path):
    monitor = with_defect(WORD, objects, tmp_path)
    assert not any(list(differences(case, monitor.said(case))) for case in long_cases(FRAMES))
    found = [text for case in long_cases(MOST_FRAMES)[:1] for text in differences(case, monitor.said(case))]
    assert "heading channel 1 is" in found[0] and int(found[0].split()[1].strip(":")) > 65_536


@pytest.mark.long
@needs_a_compiler
def test_the_check_names_signal_frame_and_field(objects: dict[str, Path], tmp_path: Path):
    with_defect(SLOW[2], objects, tmp_path)
    written(tmp_path, {"name": "forgetful", "path": "libdefect.so"})
    found = check(tmp_path / "unit.toml")
    (wrong,) = [one for one in found.requirements if not one.passed and one.part == "decisions"]
    assert wrong.name == TITLES[1] and "1 of 1 cases; frame " in wrong.detail and "must be" in wrong.detail
