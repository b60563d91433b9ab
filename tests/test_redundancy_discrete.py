"""The voter of the discretes: majority, fail-safe value, persistence, validity, in-line monitors, readmission."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import FEWER
from hypothesis import given, settings
from hypothesis import strategies as st
from one_stage import step_stage
from oracle_discrete import DiscreteOracle, DiscreteSettings
from pydantic import ValidationError

from rig.computer.redundancy.discrete import DiscreteVoter
from rig.computer.redundancy.discrete_config import DiscreteConfig, DiscreteConfigs, discrete_parameters
from rig.computer.redundancy.resets import Reset, command
from rig.core.frame import DISCRETE_INDEX, DISCRETES, INDEX, Block, D, Ilm, State, new_block

WHEELS, GEAR = DISCRETE_INDEX["weight_on_wheels"], DISCRETE_INDEX["gear_down"]
OK, SUSPECT, FAILED, ABSENT = State.OK, State.SUSPECT, State.FAILED, State.ABSENT


def vote(
    samples: Any,
    *,
    d: int = WHEELS,
    valid: Any = 1,
    ilm: Any = Ilm.GOOD,
    channels: int = 4,
    resets: Any = (),
    **given_settings: Any,
) -> Block:
    """Rows of discrete ``d``; the others agree on their fail-safe value."""
    block = new_block(len(samples))
    block["discrete_valid"], block["discrete_ilm"] = 1, Ilm.GOOD
    block["discrete_channels"] = np.array([discrete.fail_safe for discrete in DISCRETES])[:, None]
    block["discrete_channels"][:, d] = samples
    block["discrete_valid"][:, d], block["discrete_ilm"][:, d] = valid, ilm
    config = DiscreteConfigs.model_validate({DISCRETES[d].name: {"persistence": 3, **given_settings}})
    fitted = np.where(np.arange(D) == d, channels, 4)
    for frame, channel in resets:
        block["discrete_reset"][frame, d] |= 1 << (channel - 1)
    stage = DiscreteVoter(discrete_parameters(config, fitted, 8, 100.0))
    for k in range(len(block)):
        step_stage(stage, block, k)
    return block


@pytest.mark.requirement("redundancy", "discrete: the majority; a tie or no sample gives the fail-safe value")
@pytest.mark.parametrize(
    ("samples", "voted"),
    [((1, 1, 1, 0), 1), ((0, 0, 0, 1), 0), ((1, 1, 0, 0), 0), ((1, 1, 1, 1), 1), ((0, 0, 0, 0), 0)],
)
def test_a_discrete_is_its_majority_and_a_tie_its_fail_safe_value(samples, voted):
    block = vote([samples])
    assert block["discrete_voted"][0, WHEELS] == voted
    assert block["discrete_voted"][0, GEAR] == 1  # fail-safe 1, untouched


@pytest.mark.requirement("redundancy", "discrete: the majority; a tie or no sample gives the fail-safe value")
@pytest.mark.parametrize(
    ("samples", "voted"),
    [((1, 1, 0, 0), 1), ((0, 0, 0, 1), 0), ((0, 0, 0, 0), 0), ((1, 0, 1, 1), 1), ((1, 1, 1, 1), 1), ((0, 1, 0, 0), 0)],
)
def test_a_discrete_whose_fail_safe_is_one_gives_one_for_a_tie_alone(samples, voted):
    block = vote([samples], d=GEAR)
    assert block["discrete_voted"][0, GEAR] == voted
    assert block["discrete_level"][0, GEAR] == 4
    assert block["discrete_state"][0, GEAR].tolist() == [int(x != voted) for x in samples]


def test_the_fail_safe_value_is_a_setting():
    assert vote([(1, 1, 0, 0)], fail_safe=1)["discrete_voted"][0, WHEELS] == 1


@pytest.mark.requirement(
    "redundancy", "discrete: failed after `persistence` frames off the vote, latched, without a vote"
)
def test_a_discrete_channel_that_differs_for_its_persistence_is_failed_for_good():
    samples = [(1, 1, 1, 0)] * 2 + [(1, 1, 1, 1)] + [(1, 1, 1, 0)] * 3 + [(1, 1, 1, 1)] * 2
    block = vote(samples)
    states = [SUSPECT] * 2 + [OK] + [SUSPECT] * 2 + [FAILED] * 3
    assert block["discrete_state"][:, WHEELS, 3].tolist() == states
    assert block["discrete_level"][:, WHEELS].tolist() == [4] * 5 + [3] * 3


@pytest.mark.requirement(
    "redundancy", "discrete: failed after `persistence` frames off the vote, latched, without a vote"
)
def test_failed_discrete_channels_have_no_vote():
    block = vote([(1, 1, 1, 0)] * 3 + [(1, 0, 0, 0)] * 4)
    assert block["discrete_voted"][3:, WHEELS].tolist() == [0] * 4  # two of three now say 0
    assert block["discrete_level"][-1, WHEELS] == 2


def test_the_last_discrete_channel_is_its_own_majority():
    block = vote([(1, 1, 0, 0)] * 3 + [(1, 1, 0, 1)] * 3 + [(0, 0, 1, 0)] * 4)
    assert block["discrete_voted"][:, WHEELS].tolist() == [0] * 6 + [1] * 4
    assert block["discrete_level"][-1, WHEELS] == 1


@pytest.mark.requirement(
    "redundancy", "discrete: a sample that is flagged, or whose monitor reports bad, is not voted and miscompares"
)
@pytest.mark.parametrize("flag", [{"valid": [1, 0, 0, 1]}, {"ilm": [2, 0, 0, 1]}], ids=["invalid", "its own monitor"])
def test_a_sample_declared_bad_is_not_voted_and_miscompares(flag):
    """Two of four that say 1 are declared bad: the other two decide, where 2:2 would have been fail-safe."""
    block = vote([(0, 1, 1, 0)] * 3, d=GEAR, **flag)
    assert block["discrete_voted"][:, GEAR].tolist() == [0, 0, 0]
    assert block["discrete_state"][:, GEAR].tolist() == [[OK, SUSPECT, SUSPECT, OK]] * 2 + [[OK, FAILED, FAILED, OK]]
    agreeing = vote([(0, 0, 0, 0)] * 3, d=GEAR, **flag)
    assert agreeing["discrete_state"][-1, GEAR].tolist() == [OK, FAILED, FAILED, OK]


@pytest.mark.requirement("redundancy", "discrete: the majority; a tie or no sample gives the fail-safe value")
def test_without_a_sample_the_vote_is_fail_safe_and_after_the_persistence_no_channel_is_left():
    block = vote([(0, 0, 0, 0)] * 3, d=GEAR, valid=0)
    assert block["discrete_voted"][:, GEAR].tolist() == [1, 1, 1]
    assert block["discrete_level"][:, GEAR].tolist() == [4, 4, 0]
    assert (block["discrete_state"][2, GEAR] == FAILED).all()


@pytest.mark.requirement(
    "redundancy", "discrete: a sample that is flagged, or whose monitor reports bad, is not voted and miscompares"
)
def test_the_last_channel_whose_monitor_says_bad_gives_the_fail_safe_value():
    ilm = np.full((8, 4), Ilm.GOOD)
    ilm[4:, 3] = Ilm.BAD
    valid = [(0, 0, 0, 1)] * 8
    block = vote([(0, 0, 0, 1)] * 8, valid=valid, ilm=ilm)
    assert block["discrete_voted"][:, WHEELS].tolist() == [1] * 4 + [0] * 4
    assert block["discrete_level"][:, WHEELS].tolist() == [4, 4, 1, 1, 1, 1, 0, 0]


@pytest.mark.requirement("redundancy", "discrete: two to four channels")
@pytest.mark.parametrize(("channels", "samples", "voted"), [(3, (1, 1, 0, 0), 1), (2, (1, 0, 1, 1), 0)])
def test_channels_that_are_not_fitted_have_no_vote(channels, samples, voted):
    block = vote([samples], channels=channels)
    assert block["discrete_voted"][0, WHEELS] == voted
    assert block["discrete_level"][0, WHEELS] == channels
    assert (block["discrete_state"][0, WHEELS, channels:] == ABSENT).all()
    assert (block["discrete_state"][0, WHEELS, :channels] != ABSENT).all()


@pytest.mark.requirement("redundancy", "discrete: readmission by command only, after agreement without a break")
def test_a_reset_readmits_a_channel_that_has_agreed_long_enough_and_no_other():
    """Channel 4 is failed in frame 2 and agrees from frame 3 on: five frames are complete after frame 7."""
    samples = [(1, 1, 1, 0)] * 3 + [(1, 1, 1, 1)] * 9
    block = vote(samples, readmit_frames=5, resets=[(7, 4), (8, 4)])
    assert (block["discrete_state"][:, WHEELS, 3] == FAILED).tolist() == [False] * 2 + [True] * 6 + [False] * 4
    assert block["discrete_level"][:, WHEELS].tolist() == [4] * 2 + [3] * 6 + [4] * 4
    other = vote(samples, readmit_frames=5, resets=[(8, 3)])
    assert other["discrete_state"][-1, WHEELS, 3] == FAILED


@pytest.mark.requirement("redundancy", "discrete: readmission by command only, after agreement without a break")
def test_a_frame_without_agreement_begins_the_wait_for_a_reset_again():
    samples = [(1, 1, 1, 0)] * 3 + [(1, 1, 1, 1)] * 3 + [(1, 1, 1, 0)] + [(1, 1, 1, 1)] * 5
    block = vote(samples, readmit_frames=5, resets=[(8, 4), (11, 4)])
    assert (block["discrete_state"][2:, WHEELS, 3] == FAILED).all()
    assert vote([*samples, samples[0]], readmit_frames=5, resets=[(12, 4)])["discrete_state"][12, WHEELS, 3] == SUSPECT


def test_settings_of_a_discrete_become_a_record_with_their_defaults():
    configs = DiscreteConfigs.model_validate(
        {"gear_down": {"persistence_s": 0.05, "fail_safe": 0}, "weight_on_wheels": {"persistence": 4}}
    )
    params = discrete_parameters(configs, np.array([4, 2, 3]), 9, 400.0)
    assert params["persistence"].tolist() == [4, 20, 9]
    assert params["fail_safe"].tolist() == [0, 0, 0] and params["fitted"].tolist() == [4, 2, 3]
    assert params["readmit_frames"].tolist() == [100] * 3
    assert discrete_parameters(DiscreteConfigs(), np.array([4, 4, 4]), 8, 100.0)["fail_safe"].tolist() == [0, 1, 0]


@pytest.mark.parametrize(
    "bad",
    [
        {"persistence": 0},
        {"persistence_s": 0.0},
        {"persistence": 8, "persistence_s": 0.1},
        {"readmit_frames": 0},
        {"fail_safe": 2},
        {"fail_safe": -1},
    ],
)
def test_settings_without_a_meaning_are_refused(bad):
    with pytest.raises(ValidationError):
        DiscreteConfig.model_validate(bad)


def test_commands_are_told_apart_by_the_name_of_the_signal():
    resets = [Reset(at_s=1.0, signal="heading"), Reset(at_s=2.0, signal="gear_down", channels=[2])]
    rows = new_block(150, 80)
    command(rows, resets, 100.0)
    assert np.argwhere(rows["reset"]).tolist() == [[20, INDEX["heading"]]] and rows["reset"].max() == 0b1111
    assert np.argwhere(rows["discrete_reset"]).tolist() == [[120, GEAR]] and rows["discrete_reset"].max() == 0b0010


@st.composite
def flights(draw):
    """Settings, (n, 4) samples with None for a bad one, how each is bad, and the channels reset in each frame."""
    chosen = DiscreteSettings(
        fail_safe=draw(st.integers(0, 1)),
        persistence=draw(st.integers(1, 4)),
        readmit_frames=draw(st.integers(1, 4)),
        channels=draw(st.sampled_from([4, 4, 3, 2])),
    )
    samples: list[list[bool | None]] = []
    for _ in range(draw(st.integers(1, 6))):
        row = draw(st.lists(st.sampled_from([True, True, False, None]), min_size=4, max_size=4))
        samples += [row] * draw(st.integers(1, 6))
    resets = draw(st.lists(st.sets(st.integers(0, 3), max_size=2), min_size=len(samples), max_size=len(samples)))
    by_flag = draw(st.lists(st.booleans(), min_size=4, max_size=4))
    return chosen, samples, by_flag, resets


@settings(max_examples=round(200 / FEWER), deadline=None, derandomize=True)
@given(flights())
def test_every_frame_of_a_discrete_is_that_of_the_requirement(flight):
    chosen, samples, by_flag, resets = flight
    bad = np.array([[x is None for x in row] for row in samples])
    out = vote(
        [[bool(x) for x in row] for row in samples],
        d=GEAR,
        valid=~(bad & by_flag),
        ilm=np.where(bad & ~np.array(by_flag), Ilm.BAD, Ilm.ABSENT),
        channels=chosen.channels,
        resets=[(k, c + 1) for k, row in enumerate(resets) for c in row],
        fail_safe=chosen.fail_safe,
        persistence=chosen.persistence,
        readmit_frames=chosen.readmit_frames,
    )
    oracle = DiscreteOracle(chosen)
    for k, row in enumerate(samples):
        states = [State(x).name.lower() for x in out["discrete_state"][k, GEAR]]
        said = int(out["discrete_voted"][k, GEAR]), states, int(out["discrete_level"][k, GEAR])
        assert said == oracle.step(row, resets[k]), k
