"""The fault-tolerant law: what it passes on, what it finds, what it answers, and what it does not blame."""

from __future__ import annotations

import hashlib
from functools import cache

import numpy as np
import pytest
from interpreted import printed

from rig.core.errors import BadInput
from rig.core.frame import FLIGHT_INDEX, INDEX, Block, SensorFault, Trust
from rig.flight.events import EventFinder
from rig.flight.loop import Rig, frames
from rig.flight.recorder import event_finder
from rig.scenario import scenario

THETA = INDEX["pitch_angle"]
FAULT_FRAME = 2000
POINTS = {"b747": "35000ft_m084", "f16": "20000ft_m06"}


def fault(kind: str, **keys: object) -> str:
    told = {"kind": f'"{kind}"', "signal": '"pitch_angle"', "channels": [1, 2, 3, 4], "start_s": 20.0, **keys}
    return "faults=[{" + ", ".join(f"{key} = {value}" for key, value in told.items()) + "}]"


HALF = fault("scale", factor=0.5)


@cache
def flown(
    *sets: str, aircraft: str = "f16", law: str = "fault-tolerant", seed: int = 1, seconds: float = 45.0
) -> Block:
    """A flight in moderate turbulence with a step of the held pitch angle and one back."""
    steps = '{kind="step",axis="pitch_angle",start_s=10.0,amplitude=0.05},'
    steps += '{kind="step",axis="pitch_angle",start_s=30.0,amplitude=-0.05}'
    common = (f"aircraft={aircraft}", f"flight_point={POINTS[aircraft]}", f"duration_s={seconds}", "faults=[]")
    common = (*common, f"pilot={{manoeuvres=[{steps}]}}", "control.vertical=pitch", "turbulence=moderate")
    chosen = scenario.load(None, [*common, f"control.law={law}", *sets], seed)
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(chosen), chosen)])


def off(rows: Block, healthy: Block) -> np.ndarray:
    """Deviation of the true pitch angle that the fault made, from its onset."""
    assert rows["end"][-1] == 0
    return (rows["truth"][:, THETA] - healthy["truth"][:, THETA])[FAULT_FRAME:]


def first(rows: Block, trust: Trust) -> int:
    """Frames from the fault to the first with ``trust``."""
    return int(np.flatnonzero(rows["trust"] == trust)[0]) - FAULT_FRAME


@pytest.mark.requirement("fault-tolerant", "no fault: the plain law's flight")
@pytest.mark.parametrize("aircraft", POINTS)
def test_without_a_fault_it_flies_as_the_plain_law_does_bit_for_bit(aircraft: str):
    tolerant, plain = flown(aircraft=aircraft), flown(aircraft=aircraft, law="autopilot")
    for field in ("truth", "voted", "command", "surface", "law"):
        assert tolerant[field].tobytes() == plain[field].tobytes(), field
    assert (tolerant["trust"] == Trust.TRUSTED).all() and (tolerant["sensor_fault"] == SensorFault.NONE).all()
    assert (plain["trust"] == Trust.NONE).all() and not plain["estimate"].any()


@pytest.mark.requirement("fault-tolerant", "jumps and ramps, both aircraft")
@pytest.mark.parametrize("aircraft", POINTS)
@pytest.mark.parametrize(
    "sensor_fault",
    [
        HALF,
        fault("offset", offset=0.05),
        *(pytest.param(fault("scale", factor=factor), marks=pytest.mark.long) for factor in (0.2, 0.8, 1.5)),
        pytest.param(fault("offset", offset=-0.02), marks=pytest.mark.long),
    ],
)
def test_a_jump_is_found_in_two_frames_and_the_true_angle_hardly_moves(aircraft: str, sensor_fault: str):
    rows = flown(sensor_fault, aircraft=aircraft)
    moved = off(rows, flown(aircraft=aircraft))
    assert 0 <= first(rows, Trust.CORRECTED) <= 2
    assert np.abs(moved).max() < 0.003 and abs(moved[-1000:].mean()) < 0.003


@pytest.mark.requirement("fault-tolerant", "jumps and ramps, both aircraft")
@pytest.mark.parametrize("aircraft", POINTS)
@pytest.mark.parametrize(
    "sensor_fault",
    [
        fault("scale", factor=0.5, ramp_s=10.0),
        pytest.param(fault("drift", rate_per_s=0.005), marks=pytest.mark.long),
        pytest.param(fault("scale", factor=1.5, ramp_s=10.0), marks=pytest.mark.long),
    ],
)
def test_a_ramp_is_found_without_a_jump(aircraft: str, sensor_fault: str):
    rows = flown(sensor_fault, aircraft=aircraft)
    assert 0 < first(rows, Trust.CORRECTED) < 300
    assert np.abs(off(rows, flown(aircraft=aircraft))).max() < 0.005


def test_the_plain_law_holds_twice_the_angle():
    reported = "redundancy.common_mode=report"  # not given up for the references that contradict it
    moved = off(flown(HALF, reported, law="autopilot"), flown(law="autopilot"))
    assert moved[900] == pytest.approx(flown()["truth"][FAULT_FRAME, THETA], rel=0.1)


@pytest.mark.requirement("fault-tolerant", "effectiveness and offset apart")
def test_effectiveness_and_offset_are_told_apart_once_the_flight_pitches():
    scaled, shifted = flown(HALF, aircraft="b747"), flown(fault("offset", offset=0.05), aircraft="b747")
    before = slice(FAULT_FRAME + 10, 2900)
    assert (scaled["sensor_fault"][before] == SensorFault.UNDETERMINED).all()
    assert scaled["sensor_fault"][-1] == SensorFault.EFFECTIVENESS and shifted["sensor_fault"][-1] == SensorFault.OFFSET
    assert scaled["estimate"][-1, 1] == pytest.approx(0.5, abs=0.1)
    assert shifted["estimate"][-1, 2] == pytest.approx(0.05, abs=0.01)


@pytest.mark.requirement("fault-tolerant", "bound, reversion, arbiter")
def test_the_sensor_is_trusted_again_when_it_has_come_back():
    rows = flown(fault("offset", offset=0.05, end_s=25.0))
    back = first(rows[FAULT_FRAME + 100 :], Trust.TRUSTED) + FAULT_FRAME + FAULT_FRAME + 100
    assert 2500 + 450 < back < 2500 + 800
    assert (rows["trust"][back:] == Trust.TRUSTED).all()
    assert np.abs(off(rows, flown())).max() < 0.003


def test_a_small_fault_that_stays_is_not_taken_for_a_sensor_that_has_come_back():
    rows = flown(fault("drift", rate_per_s=0.0005))
    assert (rows["trust"][FAULT_FRAME + first(rows, Trust.CORRECTED) :] == Trust.CORRECTED).all()
    assert np.abs(off(rows, flown())).max() < 0.005


@pytest.mark.requirement("fault-tolerant", "bound, reversion, arbiter")
def test_the_correction_is_bounded():
    rows = flown(fault("offset", offset=0.1), "control.tolerant.max_correction_rad=0.02")
    assert rows["trust"][-1] == Trust.CORRECTED
    assert np.abs(off(rows, flown()))[500:900].min() > 0.07


@pytest.mark.requirement("fault-tolerant", "biased gyros: the plain law's flight")
@pytest.mark.parametrize("aircraft", ["f16", pytest.param("b747", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("bias", "channels"),
    [(0.05, [1, 2, 3, 4]), pytest.param(-0.004, [1, 2, 3, 4], marks=pytest.mark.long), (0.02, [1, 2])],
)
def test_with_biased_gyros_it_flies_as_the_plain_law_does_bit_for_bit(aircraft: str, bias: float, channels: list[int]):
    sensor_fault = fault("offset", signal='"pitch_rate"', offset=bias, channels=channels)
    rows, plain = flown(sensor_fault, aircraft=aircraft), flown(sensor_fault, aircraft=aircraft, law="autopilot")
    assert rows["surface_command"].tobytes() == plain["surface_command"].tobytes()
    assert 0 < np.flatnonzero(rows["sensor_fault"] == SensorFault.RATE_BIAS)[0] - FAULT_FRAME < 300
    assert (rows["trust"] == Trust.TRUSTED).all() and set(rows["sensor_fault"]) == {
        SensorFault.NONE,
        SensorFault.RATE_BIAS,
    }


@pytest.mark.requirement("fault-tolerant", "rates, bank angle or heading halved: not the sensor")
@pytest.mark.parametrize(
    "signal", ["pitch_rate", "roll_angle", *(pytest.param(s, marks=pytest.mark.long) for s in ("yaw_rate", "heading"))]
)
def test_what_it_integrates_may_be_halved_in_a_turn_and_is_not_blamed_on_the_sensor(signal: str):
    turn = 'pilot={manoeuvres=[{kind="hold",axis="heading",start_s=15.0,duration_s=20.0,amplitude=0.5}]}'
    rows = flown(fault("scale", signal=f'"{signal}"', factor=0.5), turn)
    assert (rows["trust"] == Trust.TRUSTED).all() and set(rows["sensor_fault"]) <= {
        SensorFault.NONE,
        SensorFault.RATE_BIAS,
    }


def test_a_unit_that_runs_away_changes_nothing():
    sensor_fault = 'faults=[{kind="hardover",signal="inertial.roll_rate_rad_s",start_s=20.0}]'
    assert flown(sensor_fault)["surface_command"].tobytes() == flown()["surface_command"].tobytes()


@pytest.mark.requirement("fault-tolerant", "bound, reversion, arbiter")
def test_without_the_unit_gyros_that_lie_alike_are_not_blamed_on_the_sensor_for_long():
    """The path speaks for the sensor; till then the aircraft holds."""
    gyros = fault("offset", signal='"pitch_rate"', offset=0.05).removesuffix("]")
    rows = flown(gyros + ',{kind="dropout",signal="inertial.pitch_rate_rad_s",start_s=5.0}]')
    assert rows["end"][-1] == 0
    corrected = np.flatnonzero(rows["trust"] == Trust.CORRECTED)
    assert 0 < len(corrected) < 1000 and rows["trust"][-1] != Trust.CORRECTED


@pytest.mark.requirement("fault-tolerant", "a fault of another sensor does not trip it")
@pytest.mark.parametrize(
    "signal",
    [
        *("angle_of_attack", "dynamic_pressure"),
        *(pytest.param(s, marks=pytest.mark.long) for s in ("static_pressure", "normal_load_factor")),
    ],
)
def test_other_sensors_that_lie_alike_do_not_trip_it(signal: str):
    sizes = {"angle_of_attack": 0.05, "static_pressure": 500.0, "dynamic_pressure": 800.0, "normal_load_factor": 0.2}
    sensor_fault = HALF.replace("scale", "offset").replace("factor = 0.5", f"offset = {sizes[signal]}")
    rows = flown(sensor_fault.replace("pitch_angle", signal))
    assert rows["end"][-1] == 0 and (rows["trust"] == Trust.TRUSTED).all()


@pytest.mark.requirement("fault-tolerant", "a fault of another sensor does not trip it")
def test_channels_that_the_voter_fails_do_not_trip_it():
    for signal in ("pitch_angle", "pitch_rate"):
        sensor_fault = HALF.replace("scale", "hardover").replace(", factor = 0.5", "").replace("[1, 2, 3, 4]", "[1]")
        rows = flown(sensor_fault.replace("pitch_angle", signal))
        assert (rows["trust"] == Trust.TRUSTED).all(), signal


def test_a_lost_sensor_is_left_to_the_rest_of_the_law():
    rows = flown(HALF.replace("scale", "dropout").replace(", factor = 0.5", ""))
    assert rows["end"][-1] == 0 and (rows["trust"] != Trust.CORRECTED).all()


def test_the_events_say_what_was_found():
    chosen = scenario.load("b747_pitch_sensor_half")
    finder = event_finder(chosen)
    events = [event for rows, _ in frames(Rig(chosen), chosen) for event in finder.find(rows)]
    told = [event.name for event in events if event.name.startswith(("sensor", "fault"))]
    assert told == ["fault on", "sensor corrected", "sensor fault"]
    assert "effectiveness" in next(event.text for event in events if event.name == "sensor fault")


def test_the_events_say_that_a_rate_is_biased():
    sensor_fault = fault("offset", signal='"pitch_rate"', offset=0.02)
    told = [
        event
        for event in EventFinder(["bias"]).find(flown(sensor_fault))
        if event.name in ("rate biased", "sensor fault")
    ]
    assert [event.name for event in told] == ["rate biased"]
    assert told[0].text == "pitch_angle: the sensor is correct, an angular rate is biased"


AFT = [
    ("f16", 0.21),
    *(pytest.param(*one, marks=pytest.mark.long) for one in (("f16", 0.15), ("b747", -0.3), ("b747", 0.3))),
]


@pytest.mark.requirement("fault-tolerant", "an aircraft that is not as designed")
@pytest.mark.parametrize(("aircraft", "shift_m"), AFT)
def test_an_aircraft_that_is_not_as_designed_makes_no_difference(aircraft: str, shift_m: float):
    """The centre of gravity elsewhere: the estimate has no model of the aircraft."""
    sets = (f"airframe.cg_x_shift_m={shift_m}",)
    moved = off(flown(HALF, *sets, aircraft=aircraft), flown(*sets, aircraft=aircraft))
    assert np.abs(moved).max() < 0.003


def test_settings_are_checked():
    with pytest.raises(BadInput, match="jump_sigma"):
        scenario.load(None, ["control.tolerant.jump_sigma=0"])
    with pytest.raises(BadInput, match="law"):
        scenario.load(None, ["control.law=ideal"])


def test_altitude_is_held_through_the_fault():
    sets = ("control.vertical=altitude", "pilot={manoeuvres=[]}")
    rows, healthy = flown(HALF, *sets), flown(*sets)
    lost = (healthy["flight"] - rows["flight"])[:, FLIGHT_INDEX["altitude_m"]]
    assert np.abs(lost).max() < 2.0


def digest() -> str:
    """Of a short flight with a fault."""
    rows = flown(fault("scale", factor=0.5).replace("20.0", "2.0"), seconds=4.0)
    return hashlib.sha256(rows["estimate"].tobytes()).hexdigest()


@pytest.mark.long
def test_compiled_and_interpreted_agree_bit_for_bit():
    program = "from test_fdi import digest; print(digest())"
    assert printed(program, interpreted=True) == digest()
