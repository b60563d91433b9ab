"""The back-up in flight: what it keeps of the votes, what it drives, and when it comes."""

import numpy as np
import pytest
from lanes_flown import FOUR, ONSET, flown

from rig.core.frame import INDEX, DecidedBy
from rig.flight.loop import Rig, frames
from rig.scenario import scenario

STICKS = ("stick_pitch", "stick_roll", "pedal")
ORDER = f'computers.commands=[{{at_s={ONSET / 100}, do="backup"}}]'


def test_the_back_up_has_no_signal_but_the_median_of_the_sticks():
    flight = flown(seconds=0.5, sets=(ORDER,))
    level, voted = flight.rows["level"], flight.rows["voted"]
    assert (level[:ONSET] == 4).all()
    for name, s in INDEX.items():
        assert (level[ONSET:, s] == (4 if name in STICKS else 0)).all(), name
    for name in STICKS:
        channels = flight.rows["channels"][ONSET:, INDEX[name]]
        assert voted[ONSET:, INDEX[name]] == pytest.approx(np.median(channels, axis=1), abs=1e-15), name


def test_the_back_up_begins_where_the_lanes_left_the_surfaces():
    """No surface moves in the first frame by more than 2 deg, in steady flight."""
    flight = flown(seconds=0.5, sets=(ORDER, 'turbulence="none"'))
    moved = np.abs(np.diff(flight.rows["surface"], axis=0))[ONSET - 1]
    assert np.degrees(moved[:3]).max() < 2.0 and moved[3] < 0.05


def test_a_stick_that_is_not_valid_has_no_part():
    flight = flown('kind="dropout", signal="stick_pitch", channels=[2], flagged=true', seconds=0.3, sets=(ORDER,))
    s = INDEX["stick_pitch"]
    good = flight.rows["channels"][ONSET:, s][:, [0, 2, 3]]
    assert flight.rows["voted"][ONSET:, s] == pytest.approx(np.median(good, axis=1), abs=1e-15)
    assert (flight.rows["level"][ONSET:, s] == 3).all()


def test_a_command_that_two_lanes_cannot_agree_on_brings_the_back_up_and_no_lane_is_blamed():
    wrong = 'kind="wrong_command", signal="computer.A", surface="elevator", does="offset", offset=0.06'
    flight = flown(wrong, seconds=0.5, sets=("computers.count=2",))
    unresolved = flight.lanes["command_decided_by"][:, 0, 0] == DecidedBy.UNRESOLVED
    first, last = np.flatnonzero(unresolved)[[0, 9]]
    assert ONSET <= first <= ONSET + 5 and last == first + 9
    leads = flight.lanes["leads"]
    assert leads[: last + 1, 0].all() and not leads[last + 1 :].any()
    assert not flight.lanes["failed_for"].any()


def test_the_back_up_drives_all_channels_of_the_servos_and_no_monitor_trips():
    sets = ["faults=[]", "duration_s=5", FOUR, 'actuators.model="servo"', 'turbulence="severe"', ORDER]
    rig = Rig(scenario.load(None, sets))
    lanes, rows = [], []
    for block, _ in frames(rig, rig.scenario):
        rows.append(block["surface"].copy())
        lanes += rig.beside(len(block))
    told, servos = np.concatenate(rows), np.concatenate(lanes)["servo"]
    assert (servos["asked"][ONSET:] == told[ONSET:, :3, None]).all()
    assert not servos["valve"].any() and not servos["failed_by"].any() and len(told) == 500
