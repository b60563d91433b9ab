"""The data link between the lanes in flight: what each lane's BUS has of what was sampled, and when it was sampled."""

from typing import Any

import numpy as np
import pytest
from lanes_flown import FOUR, ONSET, Flown, flown

import rig
from rig.bench.replay.verify import verify
from rig.computer.lanes.lane_clock import CLOCK, run_on
from rig.core.errors import BadInput
from rig.core.frame import INDEX, LinkState, State
from rig.flight.fly import fly
from rig.log.recordings.flown_log import recorded
from rig.scenario import scenario
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

Q = INDEX["pitch_rate"]
FREE = ("computers.synchronised=false", "computers.exchange_rounds=1", "computers.clock_drift_ppm=0")
EXACT = ("noise_std", "noise_density", "bias_tolerance", "scale_tolerance", "lag_s", "skew_frames", "quantum")
EXACT += ("bias_instability_std", "rate_random_walk", "misalignment_tolerance_rad", "g_sensitivity_tolerance")
ALL, STEADY = np.ones(4, np.uint8), np.zeros(4)  # lanes whose clocks count; drift of faults
ONE_ROUND = ("computers.exchange_rounds=1",)


def sampled(flight: Flown, lane: int) -> Any:
    """Pitch rate of a lane, (frames,), as it was sampled."""
    return flight.rows["channels"][:, Q, lane]


def held(flight: Flown, by: int, of: int) -> Any:
    """Pitch rate of lane ``of``, (frames,), as lane ``by`` holds it."""
    return flight.bus["channels"][:, by, Q, of]


KINDS = (
    'kind="link_loss"',
    'kind="link_frozen"',
    'kind="link_corrupt"',
    'kind="link_byzantine", offset_thresholds=3.0',
)


@pytest.mark.parametrize("kind", KINDS)
def test_with_two_rounds_one_broken_way_keeps_nothing_from_anybody(kind: str):
    flight = flown(f'{kind}, signal="ccdl.A-B"')
    for name in ("channels", "valid", "ilm", "discrete_channels", "discrete_valid"):
        assert (flight.bus[name] == flight.rows[name][:, None]).all(), name
    assert flight.rows["acting"][:, 0].tolist() == [0] * ONSET + [1] * (len(flight.rows) - ONSET)


def test_a_silent_link_repeats_for_a_frame_and_then_its_samples_are_missing():
    flight = flown('kind="link_loss", signal="ccdl.A-B"', sets=ONE_ROUND)
    told, truth = held(flight, 1, 0), sampled(flight, 0)
    assert (told[: ONSET + 1] == [*truth[:ONSET], truth[ONSET - 1]]).all() and np.isnan(told[ONSET + 1 :]).all()
    assert (flight.bus["valid"][:, 1, Q, 0] == [1] * (ONSET + 1) + [0] * (len(told) - ONSET - 1)).all()
    assert (flight.bus["discrete_valid"][ONSET + 1 :, 1, :, 0] == 0).all()
    assert (held(flight, 2, 0) == truth).all() and (held(flight, 1, 3) == sampled(flight, 3)).all()
    states = flight.lanes["link"][:, 1, 0]
    assert states[ONSET] == LinkState.OLD and (states[ONSET + 1 : ONSET + 4] == LinkState.MISSING).all()
    assert (states[ONSET + 4 :] == LinkState.FAILED).all()  # the fifth frame: 0.05 s
    assert (flight.lanes["silent"][ONSET:, 1, 0] == np.arange(1, len(told) - ONSET + 1)).all()


def test_the_age_that_counts_is_a_setting_and_a_link_that_comes_back_is_fresh():
    fault = 'kind="link_frozen", signal="ccdl.A-B", duration_s=0.05'
    flight = flown(fault, sets=(*ONE_ROUND, "computers.max_age_frames=3"))
    told, truth = held(flight, 1, 0), sampled(flight, 0)
    assert (told[ONSET : ONSET + 3] == truth[ONSET - 1]).all() and np.isnan(told[ONSET + 3 : ONSET + 5]).all()
    assert (told[ONSET + 5 :] == truth[ONSET + 5 :]).all() and flight.lanes["link"][-1, 1, 0] == LinkState.FRESH


def test_what_is_damaged_is_missing_at_once():
    flight = flown('kind="link_corrupt", signal="ccdl.A-B"', sets=ONE_ROUND)
    assert np.isnan(held(flight, 1, 0)[ONSET:]).all() and flight.lanes["link"][ONSET, 1, 0] == LinkState.MISSING


def test_a_lie_adds_thresholds_to_what_one_lane_is_told():
    flight = flown('kind="link_byzantine", signal="ccdl.A-B", offset_thresholds=1.5, ramp_s=0.1', sets=ONE_ROUND)
    threshold = flight.rig.redundancy.data.manager.params["threshold"][Q]
    grown = np.clip(np.arange(-ONSET, len(flight.rows) - ONSET) / 10, 0, 1) * 1.5 * threshold
    assert held(flight, 1, 0) == pytest.approx(sampled(flight, 0) + grown, abs=1e-12)
    assert (held(flight, 2, 0) == sampled(flight, 0)).all()


def test_a_silent_node_is_missing_in_all_other_lanes_and_whole_in_its_own():
    flight = flown('kind="link_loss", signal="ccdl.D"')
    for lane in range(3):
        told = held(flight, lane, 3)
        assert np.isnan(told[ONSET + 1 :]).all() and told[ONSET] == sampled(flight, 3)[ONSET - 1]
        assert (held(flight, lane, lane) == sampled(flight, lane)).all()
    assert (flight.bus["channels"][:, 3] == flight.rows["channels"]).all()


def test_of_different_words_all_hold_what_most_were_told():
    """B tells A and C more, D less: with two rounds D holds what A and C were told, and its link is outvoted."""
    byzantine = 'kind="link_byzantine", signal="ccdl.B", offset_thresholds=1.5, different=true'
    more = 1.5 * flown().rig.redundancy.data.manager.params["threshold"][Q]
    two, one = flown(byzantine), flown(byzantine, sets=ONE_ROUND)
    for lane, sign in ((0, 1), (2, 1), (3, -1)):
        assert held(two, lane, 1)[ONSET:] == pytest.approx(sampled(two, 1)[ONSET:] + more)
        assert held(one, lane, 1)[ONSET:] == pytest.approx(sampled(one, 1)[ONSET:] + sign * more)
    assert (held(two, 1, 1) == sampled(two, 1)).all()
    assert (two.lanes["outvoted"][ONSET:, 3, 1] == 1).all() and not two.lanes["outvoted"][:, :3].any()


def failed(flight: Flown, lane: int) -> set[int]:
    """Channels of pitch rate that a lane has failed, from 1."""
    return set((np.flatnonzero(flight.lanes["state"][-1, lane, Q] == State.FAILED) + 1).tolist())


def test_one_round_parts_good_lanes_that_also_see_a_sensor_fault_and_two_do_not():
    """A tells B something else, and the pitch rate sensor of C is off: B fails A's channel too."""
    faults = (
        'kind="link_byzantine", signal="ccdl.A-B", offset_thresholds=5.0',
        'kind="offset", signal="pitch_rate", channels=[3], offset_thresholds=10.0',
    )
    one, two = flown(*faults, seconds=0.5, sets=ONE_ROUND), flown(*faults, seconds=0.5)
    assert failed(one, 1) == {1, 3} and failed(one, 2) == failed(one, 3) == {3}
    assert [failed(two, lane) for lane in range(4)] == [{3}] * 4


def test_lanes_with_clocks_that_drift_are_equal_to_the_bit():
    faults = ('kind="offset", signal="pitch_rate", channels=[3], offset=0.2',)
    flight = flown(*faults, seconds=1.0, sets=("computers.clock_offsets_s=[0,0.001,0.0005,0.0015]",))
    assert flight.lanes["clock_lead"].max() == pytest.approx(0.15) and (flight.lanes["clock_lead"][-1] < 1e-4).all()
    for name in flight.fcc.dtype.names:
        first = flight.fcc[name][:, 0].tobytes()
        assert all(flight.fcc[name][:, lane].tobytes() == first for lane in range(1, 4)), name


def test_a_lane_reads_a_message_that_comes_too_late_a_frame_later():
    flight = flown(sets=(*FREE, "computers.clock_offsets_s=[0,0.003,0.001,0.009]"))
    for i, ahead in enumerate((0.0, 0.3, 0.1, 0.9)):
        for j, sent in enumerate((0.0, 0.3, 0.1, 0.9)):
            told, truth = held(flight, i, j), sampled(flight, j)
            late = ahead - sent > 0.2 and i != j
            assert (told[1:] == (truth[:-1] if late else truth[1:])).all(), (i, j)
    assert (flight.lanes["link"][5, 3] == [LinkState.OLD, LinkState.OLD, LinkState.OLD, LinkState.ABSENT]).all()


def test_a_lane_samples_as_early_as_its_clock_is_ahead():
    """Of a signal without errors and lag: truth less the share of its last change."""
    exact = [f"sensors.pitch_rate.{name}=0" for name in EXACT]
    flight = flown(sets=(*FREE, "computers.clock_offsets_s=[0,0.0025,0.005,0.0075]", *exact))
    truth = flight.rows["truth"][:, Q]
    assert np.ptp(truth) > 1e-3
    for lane, ahead in enumerate((0.0, 0.25, 0.5, 0.75)):
        assert sampled(flight, lane)[1:] == pytest.approx(truth[1:] - ahead * np.diff(truth), abs=1e-12)


def clock(lead: list[float], gain: float, drift: float = 0.0) -> Any:
    made = np.zeros(1, CLOCK)
    made["fitted"], made["gain"], made["lead"] = 4, gain, lead
    made["drift"][0, 3] = drift
    return made[0]


def test_clocks_move_by_a_share_towards_the_mean_of_the_middle_two():
    one = clock([0.0, 0.1, 0.2, 0.8], 0.5)
    run_on(one, np.zeros((4, 4), np.int64), ALL, STEADY)
    moved = np.array([0.0, 0.1, 0.2, 0.8]) + 0.5 * (0.15 - np.array([0.0, 0.1, 0.2, 0.8]))
    assert one["lead"] == pytest.approx(moved - moved.min())


def test_a_clock_that_runs_away_does_not_take_the_others_along_and_one_that_is_not_heard_is_not_measured():
    one, deaf = clock([0.0] * 4, 0.5, drift=0.01), np.zeros((4, 4), np.int64)
    for _ in range(200):
        run_on(one, deaf, ALL, STEADY)
    assert one["lead"][:3] == pytest.approx(0.0) and one["lead"][3] == pytest.approx(0.02)  # drift / gain
    one, deaf[:, 3] = clock([0.0, 0.1, 0.2, 0.9], 1.0), 1
    run_on(one, deaf, ALL, STEADY)
    assert one["lead"][:3] == pytest.approx([0.0] * 3)


def test_free_clocks_keep_their_offsets():
    one = clock([0.0, 0.3, 0.6, 0.9], 0.0)
    run_on(one, np.zeros((4, 4), np.int64), ALL, STEADY)
    assert one["lead"] == pytest.approx([0.0, 0.3, 0.6, 0.9])


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory):
    """A flight of lanes whose clocks differ, with its log; pitch rate 3 and the link from A to B are broken."""
    faults = '{kind="offset",signal="pitch_rate",channels=[3],offset=0.2,start_s=0.2}'
    faults += ',{kind="link_loss",signal="ccdl.A-B",start_s=0.2}'
    sets = ["duration_s=1", f"faults=[{faults}]", FOUR, "computers.clock_offsets_s=[0,0.001,0.0005,0.0015]"]
    return fly(None, overrides=sets, out=tmp_path_factory.mktemp("link"))


def test_a_log_is_scored_with_the_clocks_of_its_lanes(logged):
    scored = score_log(logged.log, Yardstick(), baseline=False).score
    assert [fault.outcome for fault in scored.faults][:1] == ["detected"] and not scored.false_alarms


def test_a_replay_runs_the_exchange_again_and_a_vote_that_would_need_it_is_refused(logged, tmp_path):
    assert verify(recorded(logged.log)).comparison.identical
    told = r"^one computer votes here, not the exchange of 4, and this flight has a fault of ccdl.A-B; rig replay runs"
    with pytest.raises(BadInput, match=told):
        rig.vote(logged.log, out=tmp_path / "voted.mcap")
    assert not (tmp_path / "voted.mcap").exists()


LOSS = 'faults=[{{kind="link_loss", signal="{}", start_s=1.0}}]'


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        ([LOSS.format("ccdl.A-A"), FOUR], "faults.0.signal: no such link between two lanes, nearest.*'ccdl.A-A'"),
        ([LOSS.format("ccdl.A-C"), "computers.count=2"], "ccdl.A-C has a lane that is not there:.*lanes A to B"),
        ([LOSS.format("ccdl.B")], "ccdl.B has a lane that is not there:.*count = 1, no lanes"),
        ([LOSS.format("pitch_rate"), FOUR], "link_loss cannot act on pitch_rate, allowed: ccdl"),
        ([FOUR, "computers.synchronised=false"], "exchange_rounds: 2 needs synchronised = true; with false allowed: 1"),
        ([FOUR, "computers.clock_offsets_s=[0,0.01,0,0]"], "lane B is a frame or more ahead, 0.01 s at 100 Hz"),
        ([FOUR, "computers.clock_offsets_s=[0,0.001]"], "clock_offsets_s: 4 times of 0 or more, one a lane"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(sets: list[str], told: str):
    with pytest.raises(BadInput, match=told) as refused:
        scenario.load(None, sets)
    assert "\n" not in str(refused.value)
