"""The baseline managers as managers: whom they fail, when, and what they are told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import constant, vote_samples
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rig.bench.vote_rows import vote
from rig.computer.redundancy.baseline_managers.baseline_settings import BASELINE_PARAMS, Baselines, extended
from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.managers import BASELINES, KINDS, manager_kind, with_settings
from rig.core.frame import DecidedBy, State
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import VoteConfig

MONITORS = tuple(kind.name for kind in KINDS if kind.settings is not None and kind.settings.levels)
TURN = 2.0 * np.pi
monitors = pytest.mark.parametrize("baseline", MONITORS)


def healthy(n: int = 300, seed: int = 0, channels: int = 4) -> Any:
    """Noise and constants of the defaults, in thresholds of 1."""
    rng = np.random.default_rng(seed)
    out = np.full((n, 4), np.nan)
    out[:, :channels] = rng.normal(0, 0.04, (n, channels)) + rng.uniform(-0.1, 0.1, channels)
    return out


@monitors
@pytest.mark.parametrize("channels", [4, 3])
@pytest.mark.parametrize("bad", [0, 2])
def test_an_offset_of_three_thresholds_fails_its_channel_alone(baseline: str, channels: int, bad: int):
    samples = healthy(channels=channels)
    samples[100:, bad] += 3.0
    out = vote_samples(samples, manager=baseline, channels=channels, reference=0.0)
    at = out.failed_at()[bad]
    assert at is not None and 100 < at < 150
    assert [other for c, other in enumerate(out.failed_at()[:channels]) if c != bad] == [None] * (channels - 1)
    assert abs(out.voted[-1]) < 0.2 and out.level[-1] == channels - 1


@monitors
def test_a_third_fault_leaves_the_good_channel(baseline: str):
    """Of two that are left the reference tells which is right."""
    samples = healthy(600)
    for begin, c in ((100, 3), (250, 0), (400, 2)):
        samples[begin:, c] += 3.0
    out = vote_samples(samples, manager=baseline, reference=0.0)
    failed = [-1 if at is None else at for at in out.failed_at()]
    assert failed[1] == -1 and 100 < failed[3] < 250 < failed[0] < 400 < failed[2] < 500
    assert out.level[-1] == 1 and abs(out.voted[-1]) < 0.2


@monitors
def test_a_last_channel_that_its_reference_contradicts_is_lost(baseline: str):
    samples = healthy(200, channels=1)
    samples[100:, 0] += 5.0
    out = vote_samples(samples, manager=baseline, channels=1, reference=0.0)
    assert out.failed_at()[0] == 108 and out.level[-1] == 0 and abs(out.voted[-1]) < 0.2


@monitors
def test_no_sample_fails_a_channel_after_the_persistence_and_the_vote_stands(baseline: str):
    samples = constant(1.0, 1.0, 1.0, 1.0, frames=60)
    samples[20:, 0], samples[40:] = np.nan, np.nan
    out = vote_samples(samples, manager=baseline, reference=1.0)
    assert out.failed_at() == [28, 48, 48, 48]
    assert (out.voted == 1.0).all() and out.level[-1] == 0


BURSTS = st.tuples(st.integers(0, 3), st.sampled_from([1, 3, 7]), st.sampled_from([10.0, -100.0]), st.integers(0, 9))


@monitors
@settings(max_examples=10)
@given(BURSTS)
@example((2, 7, -100.0, 0))
def test_a_burst_of_less_than_the_persistence_fails_no_channel(baseline: str, burst: tuple[int, int, float, int]):
    fails_no_channel(baseline, *burst)


@pytest.mark.long
@monitors
@given(BURSTS)
def test_nor_does_any_of_many_bursts(baseline: str, burst: tuple[int, int, float, int]):
    fails_no_channel(baseline, *burst)


def fails_no_channel(baseline: str, bad: int, frames: int, size: float, seed: int) -> None:
    for begin in (1, 120):
        samples = healthy(220, seed)
        samples[begin : begin + frames, bad] += size
        out = vote_samples(samples, manager=baseline, reference=0.0)
        assert out.failed_at() == [None] * 4, begin


@pytest.mark.parametrize("baseline", ["cusum", "glr", "parity", "bayes"])
def test_as_published_one_bad_sample_is_enough(baseline: str):
    samples = healthy()
    samples[100, 2] += 100.0
    assert flown(samples, baseline, {"bounded": False}).failed_at() == [None, None, 101, None]


def flown(samples: Any, baseline: str, told: dict[str, Any], **more: Any) -> Any:
    return vote_samples(samples, manager=baseline, told=told, **more)


@pytest.mark.parametrize("baseline", ["cusum", "glr", "parity"])
@pytest.mark.parametrize("split", [(0.0, 0.0, 8.0, 8.0), (0.0, 8.0, np.nan, np.nan)])
def test_an_even_split_that_nothing_settles_holds_or_guesses(baseline: str, split: tuple[float, ...]):
    channels = int(np.isfinite(split).sum())
    samples = np.vstack([np.where(np.isnan(split), np.nan, constant(0, 0, 0, 0)), constant(*split, frames=100)])
    held, guessed = (flown(samples, baseline, {"ties": ties}, channels=channels) for ties in ("hold", "guess"))
    assert held.failed_at() == [None] * 4 and held.decided_by[-1] == DecidedBy.UNRESOLVED
    begun = int(np.argmax(held.decided_by == DecidedBy.UNRESOLVED))
    assert (held.voted[begun:] == held.voted[begun - 1]).all()
    assert (guessed.state[-1] == State.FAILED).sum() >= 1


def test_parity_fails_the_farthest_of_the_half_that_the_reference_contradicts():
    samples = np.vstack([constant(0, 0, 0, 0), constant(0.0, 0.1, 8.0, 8.1, frames=100)])
    out = flown(samples, "parity", {}, reference=0.0)
    first = min((at, c) for c, at in enumerate(out.failed_at()) if at is not None)
    assert first[1] == 3


@monitors
def test_one_channel_is_failed_in_a_frame(baseline: str):
    samples = healthy()
    samples[100:, 0] += 4.0
    samples[100:, 3] -= 4.0
    out = vote_samples(samples, manager=baseline, reference=0.0)
    at = sorted(frame for frame in out.failed_at() if frame is not None)
    assert len(at) == 2 and at[0] < at[1]


@monitors
def test_an_angle_is_compared_the_short_way_round(baseline: str):
    """The decisions of the same samples far from the turn."""
    samples = healthy() * 0.02
    samples[100:, 1] += 0.06
    plain = vote_samples(samples, manager=baseline, reference=0.0, threshold=0.02)
    turned = vote_samples(
        samples % TURN, manager=baseline, reference=0.0, threshold=0.02, wraps=True, limits=(0.0, TURN)
    )
    assert plain.failed_at()[1] is not None and turned.failed_at() == plain.failed_at()
    assert np.allclose(np.sin(turned.voted), np.sin(plain.voted), atol=1e-9)


@monitors
def test_a_stale_sample_fails_its_channel(baseline: str):
    samples = healthy(200)
    samples[50:, 2] = samples[50, 2]
    assert vote_samples(samples, manager=baseline, reference=0.0).failed_at() == [None] * 4
    out = vote_samples(samples, manager=baseline, reference=0.0, stale_frames=20)
    assert out.failed_at() == [None, None, 78, None]  # 20 repetitions, of which the last is the first of 8 frames


@monitors
def test_a_reset_readmits_a_channel_that_agrees_again(baseline: str):
    samples = healthy(500)
    samples[100:200, 3] += 3.0
    out = vote_samples(samples, manager=baseline, reference=0.0, resets=[(400, 4)])
    assert out.state[399, 3] == State.FAILED and (out.state[400:] == State.OK).all() and out.level[-1] == 4


def test_each_baseline_says_which_settings_a_calibration_chooses():
    for kind in KINDS:
        if kind.settings is not None:
            assert kind.settings is type(getattr(Baselines(), kind.name))
            assert set(kind.settings.levels) <= set(kind.settings.model_fields)
            assert bool(kind.settings.levels) == (kind.name in MONITORS)
            assert manager_kind(kind.name).latches == (kind.name in MONITORS)


def recording(samples: Any) -> Recording:
    return Recording(np.arange(len(samples)) / 100, {"x": Samples(list(samples.T)), "y": Samples(list(samples.T))})


def test_a_recording_is_voted_with_settings_of_single_signals():
    samples = healthy()
    samples[100:, 2] += 1.0
    told = {"cusum": {"signals": {"y": {"allowance": 2.0}}}}
    config = VoteConfig.model_validate({"default": {"threshold": 1.0, "manager": "cusum"}, "baselines": told})
    out = vote(recording(samples), config.signals(["x", "y"], ""), [], baselines=config.baselines)
    assert [failure.channel for failure in out["x"].failures] == [3] and not out["y"].failures


@pytest.mark.parametrize(
    ("set_to", "said"),
    [
        ("cusum.allowance=-1", "redundancy.baselines.cusum.allowance"),
        ("cusum.alowance=1", "allowance"),
        ("glr.window=101", "redundancy.baselines.glr.window"),
        ("bayes.limit=2", "redundancy.baselines.bayes.limit"),
        ("parity.ties=maybe", "redundancy.baselines.parity.ties"),
        ("cusum.signals.pitch_rat.allowance=1", "pitch_rate"),
        ("cusum.signals.pitch_rate.alowance=1", "signals.pitch_rate.alowance"),
    ],
)
def test_bad_settings_are_one_line(rig_command: Any, set_to: str, said: str):
    code, out, err = rig_command("fly", "--set", f"redundancy.baselines.{set_to}", "--set", "duration_s=1")
    assert (code, out, err.count("\n")) == (2, "", 1) and said in err


def test_a_table_of_a_signal_has_no_tables_of_signals():
    with pytest.raises(ValueError, match=r"signals\.pitch_rate\.signals: unknown key"):
        Baselines.model_validate({"cusum": {"signals": {"pitch_rate": {"signals": {}}}}})


def test_records_that_have_the_settings_of_baseline_stay_as_they_are():
    params = with_settings(np.zeros(1, PARAMS), "cusum")
    assert extended(params, BASELINE_PARAMS) is params


@pytest.mark.parametrize(
    ("samples", "voted"),
    [
        ((0.5, np.nan, np.nan, np.nan), 0.5),  # one alone
        ((-1e300, -1e300, 1e300, 1e300), 0.0),  # no distance is a number: the median
    ],
)
def test_weights_that_vanish_leave_the_median(samples: tuple[float, ...], voted: float):
    with np.errstate(all="ignore"):  # interpreted kernels warn where compiled ones overflow in silence
        out = vote_samples(constant(*samples, frames=3), manager="weighted", limits=(-1e308, 1e308))
    assert (out.voted == voted).all()


@pytest.mark.parametrize("baseline", ["cusum", "bayes"])
def test_a_unit_under_test_is_told_what_it_would_be_with_our_manager(baseline: str):
    from rig.flight.loop import redundancy
    from rig.flight.unit_loop import config_of
    from rig.scenario import scenario
    from rig.unit.unit_records import Role

    told = []
    for manager in ("cross-channel", baseline):
        which = scenario.load("f16_pitch_rate_hardover", [f"redundancy.manager={manager}"])
        told.append(config_of(which, redundancy(which), np.zeros(4), next(iter(Role))))
    assert told[0].tobytes() == told[1].tobytes()


@pytest.mark.parametrize("baseline", BASELINES)
def test_a_flight_and_its_lanes_vote_alike(baseline: str):
    """Four computers with whole links have what one has."""
    from rig.flight.loop import Rig, frames
    from rig.scenario import scenario

    votes = []
    for count in (1, 4):
        sets = [
            f"redundancy.manager={baseline}",
            f"computers.count={count}",
            "duration_s=2",
            "computers.clock_drift_ppm=0",
        ]
        which = scenario.load("f16_pitch_rate_hardover", [*sets, "faults.0.start_s=1"])
        votes.append(np.concatenate([rows["state"].copy() for rows, _ in frames(Rig(which), which)]))
    assert np.array_equal(*votes) and ((votes[0] == State.FAILED).any() == (baseline in MONITORS))
