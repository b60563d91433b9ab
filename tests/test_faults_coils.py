"""The in-line monitors of sticks and pedal: what the sum of an LVDT's coils tells, and what it cannot tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from faulted import PARSE, faulted, healthy
from one_stage import sense, suite, truths
from pydantic import ValidationError

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, Block, DecidedBy, Ilm, State
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.world.faults import Coils

STICK = INDEX["stick_pitch"]
ALL, NONE = ({"stick_pitch": Coils(coverage, tolerance=0.04, frames=3)} for coverage in (1.0, 0.0))


def said(*faults: dict[str, Any], coils: Any = ALL, seed: int = 7, signal: str = "stick_pitch") -> list[int]:
    """The frames in which the monitor of channel 2 said bad; every fault begins in frame 10."""
    placed = [{"signal": signal, "channels": [2], "start_s": 0.1, **fault} for fault in faults]
    block = faulted(*placed, coils=coils, seed=seed)
    others = np.delete(block["ilm"].reshape(len(block), -1), 4 * INDEX[signal] + 1, axis=1)
    assert (others == Ilm.GOOD).all()
    return np.flatnonzero(block["ilm"][:, INDEX[signal], 1] == Ilm.BAD).tolist()


def test_an_error_of_a_coil_is_seen_in_the_third_frame_beyond_the_tolerance():
    assert said({"kind": "offset", "offset": 0.05, "end_s": 0.3}) == list(range(12, 30))
    assert said({"kind": "offset", "offset": -0.05}) == list(range(12, 60))
    assert said({"kind": "offset", "offset": 0.039}) == []
    # beyond 0.04 from frame 18 on, 0.08 s after the onset
    assert said({"kind": "drift", "rate_per_s": 0.52}) == list(range(20, 60))


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "hardover", "direction": "low"},
        {"kind": "noise", "std": 5.0},
        {"kind": "bias_instability", "std": 1.0, "time_constant_s": 0.1},
        {"kind": "oscillation", "amplitude": 0.3, "frequency_hz": 1.0},
        {"kind": "oscillation", "amplitude": 0.9, "frequency_hz": 1.0, "replacing": True},
        {"kind": "spikes", "amplitude": 0.3, "times_s": [0.05], "width_s": 0.1},
        {"kind": "intermittent", "gap_s": 0.1, "contact_s": 0.1, "in_gaps": "low"},
        {"kind": "cross_talk", "source": "stick_roll", "gain": 0.9},
    ],
    ids=lambda fault: fault["kind"],
)
def test_faults_of_one_coil_change_the_sum(fault: dict[str, Any]):
    assert said(fault) and not said(fault, coils=NONE) and not said(fault, coils=None)


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "stuck", "value": -0.9},
        {"kind": "stuck"},
        {"kind": "scale", "factor": 0.1},
        {"kind": "sign_reversal"},
        {"kind": "delay", "latency_s": 0.3},
        {"kind": "frame_skew", "skew_s": 0.3},
        {"kind": "quantisation", "step": 0.9},
        {"kind": "duplicate_frame", "every_s": 0.02},
        {"kind": "spikes", "value": -0.9, "times_s": [0.05], "width_s": 0.1},
        {"kind": "intermittent", "gap_s": 0.1, "contact_s": 0.1},
        {"kind": "dropout"},
        {"kind": "dropout", "flagged": False},
    ],
    ids=lambda fault: fault["kind"],
)
def test_a_jam_swapped_wires_excitation_and_all_that_is_digital_leave_the_sum(fault: dict[str, Any]):
    assert said(fault) == []


def test_each_episode_counts_from_its_beginning():
    again = {"kind": "offset", "offset": 0.5, "duration_s": 0.1, "repeat_every_s": 0.2}
    assert said(again) == [*range(12, 20), *range(32, 40), *range(52, 60)]


def test_spikes_shorter_than_the_persistence_are_not_seen():
    assert said({"kind": "spikes", "amplitude": 0.3, "times_s": [0.05], "width_s": 0.02}) == []


def test_what_is_given_overrides_what_is_measured():
    offset = {"kind": "offset", "offset": 0.5}
    assert said({**offset, "seen_by_ilm": False}) == []
    assert said({"kind": "stuck", "seen_by_ilm": True}) == list(range(10, 60))
    assert said({**offset, "offset": 0.01, "seen_by_ilm": True}) == list(range(10, 60))
    assert said(offset, {"kind": "ilm", "says": "blind"}) == []


def test_a_signal_without_coils_has_no_monitor_that_measures():
    assert said({"kind": "offset", "offset": 0.5}, signal="stick_roll") == []


def test_the_share_of_faults_that_are_seen_is_the_coverage_and_hangs_on_the_seed_and_the_name():
    half = {"stick_pitch": Coils(0.5, 0.04, 3)}
    fault, other = {"kind": "offset", "offset": 0.5}, {"kind": "drift", "rate_per_s": 0.0}
    seen = [bool(said(fault, coils=half, seed=seed)) for seed in range(60)]
    assert 18 <= sum(seen) <= 42  # 30 expected, sigma 3.9
    assert [bool(said(other, fault, coils=half, seed=seed)) for seed in range(60)] == seen
    named = [bool(said({**fault, "id": "other"}, coils=half, seed=seed)) for seed in range(60)]
    assert named != seen


def test_all_channels_of_one_fault_are_seen_or_none():
    half = {"stick_pitch": Coils(0.5, 0.04, 3)}
    fault = {"kind": "offset", "offset": 0.5, "signal": "stick_pitch", "channels": [1, 3], "start_s": 0.1}
    for seed in range(12):
        ilm = faulted(fault, coils=half, seed=seed)["ilm"][-1, STICK]
        assert ilm[0] == ilm[2]


def test_a_channel_that_is_not_fitted_keeps_no_monitor():
    block = healthy()
    block["channels"][:, STICK, 1], block["ilm"][:, STICK, 1] = np.nan, Ilm.ABSENT
    fault = {"kind": "offset", "offset": 0.5, "signal": "stick_pitch", "channels": [2], "start_s": 0.1}
    assert (faulted(fault, block=block, coils=ALL)["ilm"][:, STICK, 1] == Ilm.ABSENT).all()


# False alarms

MONITOR = {"coverage": 1.0, "tolerance": 0.04, "frames": 3, "false_alarm_per_hour": 360.0, "false_alarm_s": 0.1}


def alarms(frames: int = 60_000, seed: int = 0, **keys: Any) -> Any:
    """(frames, 4): where the monitors of the pitch stick say bad, and of no other signal."""
    own = suite(stick_pitch={"monitor": {**MONITOR, **keys}})
    ilm = sense(truths(frames), own, field="ilm", seed=seed)
    assert (np.delete(ilm, STICK, axis=1) == Ilm.GOOD).all()
    return ilm[:, STICK] == Ilm.BAD


def test_false_alarms_come_at_their_rate_and_last_their_time():
    """Ten minutes at 360 an hour are 60 on each channel, each of ten frames, each channel at moments of its own."""
    bad = alarms()
    begun = (np.diff(bad.astype(int), axis=0, prepend=0) == 1).sum(axis=0)
    assert ((begun > 30) & (begun < 95)).all()
    assert bad.sum() == pytest.approx(10 * begun.sum(), rel=0.02)
    assert np.abs(np.corrcoef(bad.T) - np.eye(4)).max() < 0.1
    assert (alarms(seed=1) != bad).any()


def test_without_a_rate_there_are_none_and_no_draw_shifts_another():
    assert not alarms(3000, false_alarm_per_hour=0.0).any()
    noisy = {"noise_std": 0.1}
    plain = sense(truths(300), suite(stick_roll=noisy, pedal=noisy))
    watched = sense(truths(300), suite(stick_roll={**noisy, "monitor": MONITOR}, pedal=noisy))
    assert plain.tobytes() == watched.tobytes()


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"pitch_rate": {"monitor": MONITOR}}, "pitch_rate: monitor: only sticks and pedal have coils"),
        ({"pedal": {"monitor": {**MONITOR, "coverage": 1.5}}}, "less than or equal to 1"),
        ({"pedal": {"monitor": {"coverage": 1.0}}}, "tolerance"),
    ],
)
def test_a_monitor_that_cannot_be_is_refused(table: Any, says: str):
    with pytest.raises(ValidationError, match=says):
        suite(**table)


def test_a_wrong_setting_is_one_line():
    with pytest.raises(BadInput, match=r"sensors\.pedal\.monitor\.coverage") as refused:
        scenario.load(None, ["sensors.pedal.monitor.coverage=2"])
    assert "\n" not in str(refused.value)


# In flight


def test_every_stick_and_pedal_of_the_bundled_aircraft_is_watched():
    which = scenario.load(None)
    watched = [s.name for s in SIGNALS if getattr(which.sensors, s.name).monitor is not None]
    assert watched == ["stick_pitch", "stick_roll", "pedal"]


@pytest.mark.parametrize("offset", [-0.1, 0.1])
def test_a_pair_of_bad_coils_is_settled_by_the_monitor(offset: float):
    """Two channels of the pitch stick off alike: no partner tells which pair, the sums of their coils do."""
    fault = f'faults=[{{kind="offset",signal="stick_pitch",channels=[1,2],start_s=1.0,offset={offset}}}]'
    sets = [fault, "duration_s=2.0", "sensors.stick_pitch.monitor.coverage=1.0"]
    which = scenario.load("f16_pitch_rate_hardover", sets, 3)
    rows: Block = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    assert np.flatnonzero(rows["state"][-1, STICK] == State.FAILED).tolist() == [0, 1]
    assert DecidedBy.ILM in rows["decided_by"][:, STICK]


def test_the_setting_is_a_choice_of_three():
    assert [
        PARSE.validate_python(
            {"kind": "stuck", "signal": "pedal", "channels": [1], "start_s": 0.0, **given}
        ).seen_by_ilm
        for given in ({}, {"seen_by_ilm": True}, {"seen_by_ilm": False})
    ] == [None, True, False]
