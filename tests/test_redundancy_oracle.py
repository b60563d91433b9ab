"""The monitor against tests/oracle.py, which was written from the requirement alone, over random flights."""

import numpy as np
import pytest
from conftest import FEWER, vote_samples
from hypothesis import example, given, settings
from hypothesis import strategies as st
from oracle import Oracle, Settings

from rig.frame import Ilm, Pattern, Resolver, State

LEVELS = st.sampled_from([0.0, 0.25, 0.5, 1.0, 1.5, 3.0, 3.5, -3.0, 6.0, -6.0, 9.25])
SLOPES = st.sampled_from([0.0, 0.0, 0.125, -0.125, 0.5])
FLAGS = {"bad": int(Ilm.BAD), "good": int(Ilm.GOOD), "absent": int(Ilm.ABSENT)}


@st.composite
def flights(draw, turn: bool = False):
    """Settings and (n, 4) samples: stretches of constant offsets on a common ramp, with dropouts and jitter."""
    channels = draw(st.sampled_from([4, 4, 4, 3, 2]))
    chosen = Settings(
        threshold=1.0,
        persistence=draw(st.integers(1, 5)),
        singular_persistence=draw(st.integers(1, 6)),
        resolvers=tuple(draw(st.permutations(["ilm", "trend", "reference"]))[: draw(st.integers(0, 3))]),
        trend_frames=draw(st.integers(1, 4)),
        reference_threshold=draw(st.sampled_from([0.5, 1.0, 2.0])),
        channels=channels,
        turn=2 * np.pi if turn else 0.0,
    )
    samples, ilm, references = [], [], []
    value = draw(st.sampled_from([0.0, 3.0, -2.5, 100.0]))
    for _ in range(draw(st.integers(1, 4))):
        slope, offsets = draw(SLOPES), draw(st.lists(LEVELS, min_size=4, max_size=4))
        flags = draw(st.lists(st.sampled_from(["good", "bad", "absent"]), min_size=4, max_size=4))
        offset = draw(st.sampled_from([None, 0.0, 0.25, 3.0, -3.0, 1.5]))
        silent = draw(st.sets(st.integers(0, 3), max_size=2))
        for _ in range(draw(st.integers(1, 9))):
            value += slope
            row = [None if c in silent or c >= channels else value + offsets[c] for c in range(4)]
            samples.append(row)
            ilm.append(flags)
            references.append(None if offset is None else value + offset)
    return chosen, samples, ilm, references


def check(chosen: Settings, samples, ilm, references) -> None:
    wrapped = chosen.turn > 0
    limits = (0.0, 2 * np.pi) if wrapped else (-1000.0, 1000.0)
    given_samples = np.array([[np.nan if x is None else x for x in row] for row in samples], float)
    given_reference = np.array([np.nan if x is None else x for x in references], float)
    if wrapped:
        given_samples, given_reference = given_samples % (2 * np.pi), given_reference % (2 * np.pi)
        samples = [[None if np.isnan(x) else x for x in row] for row in given_samples.tolist()]
        references = [None if np.isnan(x) else x for x in given_reference.tolist()]
    out = vote_samples(
        given_samples,
        reference=given_reference,
        ilm=[[FLAGS[f] for f in row] for row in ilm],
        wraps=wrapped,
        limits=limits,
        channels=chosen.channels,
        threshold=chosen.threshold,
        persistence=chosen.persistence,
        singular_persistence=chosen.singular_persistence,
        resolvers=list(chosen.resolvers),
        trend_frames=chosen.trend_frames,
        reference_threshold=chosen.reference_threshold,
    )
    oracle = Oracle(chosen)
    for k, (row, flags, reference) in enumerate(zip(samples, ilm, references, strict=True)):
        expected = oracle.step(row, flags, reference)
        said = (
            Pattern(out.pattern[k]).label,
            Resolver(out.resolver[k]).name.lower(),
            [State(x).name.lower() for x in out.state[k, : chosen.channels]],
            int(out.level[k]),
            (int(out.trend_high[k]), int(out.trend_low[k])),
            bool(out.reference_usable[k]),
        )
        wanted = (
            expected.pattern,
            expected.resolver,
            expected.states,
            expected.level,
            expected.trend,
            expected.usable,
        )
        assert said == wanted, k
        if wrapped:
            assert abs(np.sin((out.voted[k] - expected.voted) / 2)) < 1e-9, k
            oracle.vote = float(out.voted[k])  # the same turn for both
        else:
            assert out.voted[k] == pytest.approx(expected.voted, abs=1e-9), k
        assert (out.state[k, chosen.channels :] == State.ABSENT).all()


@settings(max_examples=250 // FEWER, deadline=None, derandomize=True)
@given(flights())
def test_every_decision_and_vote_is_that_of_the_requirement(flight):
    check(*flight)


PLAIN = Settings(turn=2 * np.pi)


@settings(max_examples=120 // FEWER, deadline=None, derandomize=True)
@given(flights(turn=True))
@example((PLAIN, [[0.1, 6.2, 0.0, 6.25]] * 12, [["good"] * 4] * 12, [0.05] * 12))
@example((PLAIN, [[0.1, 6.2, 2.0, 2.1]] * 12, [["good"] * 4] * 12, [6.28] * 12))
def test_and_of_an_angle_on_the_circle(flight):
    chosen, samples, ilm, references = flight
    check(chosen, samples, ilm, references)
