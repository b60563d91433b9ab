"""Discretes that are wrong in flight: what the voter takes, and what the law makes of it."""

import numpy as np

from rig.core.frame import COMMANDS, DISCRETE_INDEX, FLIGHT_INDEX, INDEX, Block, End, State
from rig.flight.loop import Rig, frames
from rig.scenario import scenario

WHEELS, GEAR = DISCRETE_INDEX["weight_on_wheels"], DISCRETE_INDEX["gear_down"]
PITCH, ROLL, ALTITUDE = INDEX["pitch_angle"], INDEX["roll_angle"], FLIGHT_INDEX["altitude_m"]


def flown(name: str, *overrides: str) -> Block:
    which = scenario.load(name, overrides)
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


def test_two_of_four_squat_switches_that_jam_change_no_bit_of_the_flight():
    rows = flown("f16_weight_on_wheels_split", "duration_s=14")
    clean = flown("f16_weight_on_wheels_split", "duration_s=14", "faults=[]")
    for field in ("truth", "flight", "surface", "voted"):
        assert rows[field].tobytes() == clean[field].tobytes(), field
    assert not rows["discrete_voted"][:, WHEELS].any()
    assert rows["discrete_state"][-1, WHEELS].tolist() == [State.OK, State.OK, State.FAILED, State.FAILED]


def test_three_of_four_are_used_and_the_attitude_is_held_until_they_are_back():
    """Limits of the discretes: ten seconds in a climbing turn cost 42 m and 0.02 rad of attitude."""
    rows, clean = flown("f16_weight_on_wheels_wrong"), flown("f16_weight_on_wheels_wrong", "faults=[]")
    ground = rows["discrete_voted"][:, WHEELS] == 1
    assert np.flatnonzero(ground).tolist() == list(range(800, 1800))
    assert rows["discrete_state"][-1, WHEELS].tolist() == [State.FAILED, State.OK, State.OK, State.OK]
    for angle, name in ((PITCH, "pitch_angle_rad"), (ROLL, "roll_angle_rad")):
        asked = rows["command"][:, COMMANDS.index(name)]
        assert (asked[ground] == asked[800]).all() and (asked[1800:] != asked[800]).any()
        assert np.abs(rows["truth"][ground, angle] - asked[800])[100:].max() < 0.03
    off = np.abs(rows["flight"][:, ALTITUDE] - clean["flight"][:, ALTITUDE])
    assert 30.0 < off.max() < 60.0 and off[-1] < 5.0
    assert rows["end"][-1] == End.FLYING


def test_one_gear_switch_against_one_flies_with_less_bank():
    rows = flown("b737_gear_down_inverted", "duration_s=30")
    asked, voted = rows["command"][:, COMMANDS.index("roll_angle_rad")], rows["discrete_voted"][:, GEAR]
    assert np.flatnonzero(voted).tolist() == list(range(2000, 3000))  # from the third switch on
    assert asked[:2000].max() > 0.5 and asked[2000:].max() <= 0.4363
    back = rows["discrete_state"][1200, GEAR]  # the reset finds the second switch good again, the first not
    assert back.tolist() == [State.FAILED, State.OK, State.OK, State.ABSENT]
