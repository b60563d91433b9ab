"""Isolation of a biased rate: a synthetic flight with faults of gyros, unit and pitch-angle sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.computer.fdi.monitor import monitor_pitch_angle
from rig.computer.fdi.pitch_test_state import BOTH, GYROS_ALONE, STATE, UNIT_ALONE, Config, parameters
from rig.core.frame import INDEX, INERTIAL, S, SensorFault, Source, Trust, new_block
from rig.core.units.constants import GRAVITY

pytestmark = pytest.mark.requirement("fault-tolerant", "the three hypotheses, isolation and return")

RATE_HZ, SPEED, THETA, NOISE = 100.0, 190.0, 0.05, 0.0002
Q, R, PITCH, ROLL, HEADING = (
    INDEX[name] for name in ("pitch_rate", "yaw_rate", "pitch_angle", "roll_angle", "heading")
)
UNIT_RATES = [INERTIAL.index(f"{axis}_rate_rad_s") for axis in ("roll", "pitch", "yaw")]
UNIT_VELOCITY = [INERTIAL.index(f"velocity_{axis}_m_s") for axis in ("north", "east")]


class Flight:
    """Level flight at 190 m/s, wings level or in a turn; faults are changed between the calls of ``fly``.

    said : the pitch angle that the law read; passed_on : whether it was the sensor's, bit for bit, in every frame
    """

    def __init__(self, bank: float = 0.0, unit_off: tuple[float, float] = (0.0, 0.0)) -> None:
        self.param, self.state, self.row = parameters(Config(), True, RATE_HZ), np.zeros(1, STATE), new_block(1)[0]
        self.rng, self.heading = np.random.default_rng(1), 1.0
        self.gyro = self.unit = self.sensor = 0.0  # biases
        self.roll_factor, self.lost = 1.0, False  # of the voted bank angle; pitch gyros
        self.rolling = 0.0
        self.roll_drift, self.side = unit_off  # biases of the unit's roll rate and of the lateral load factor
        self.turn_to(bank)
        self.row["level"] = 4
        self.fly(30.0)

    def turn_to(self, bank: float) -> None:
        """At once."""
        self.bank, self.rate = bank, GRAVITY * math.tan(bank) / SPEED

    def roll_to(self, bank: float, seconds: float = 3.0) -> None:
        """At a steady roll rate."""
        first, self.rolling = self.bank, (bank - self.bank) / seconds
        for i in range(round(seconds * RATE_HZ)):
            self.turn_to(first + self.rolling * (i + 1) / RATE_HZ)
            self.fly(1.0 / RATE_HZ)
        self.rolling = 0.0

    def fly(self, seconds: float) -> None:
        self.passed_on, self.found, self.trusts = True, set(), set()
        for _ in range(round(seconds * RATE_HZ)):
            self.frame()

    def frame(self) -> None:
        noise = NOISE * self.rng.standard_normal(4)
        cosine, sine = math.cos(self.bank), math.sin(self.bank)
        q, r = self.rate * math.cos(THETA) * sine, self.rate * math.cos(THETA) * cosine
        self.heading += self.rate / RATE_HZ
        north, east = SPEED * math.cos(self.heading), SPEED * math.sin(self.heading)
        p = self.rolling + self.roll_drift - self.rate * math.sin(THETA)
        self.row["inertial"][[*UNIT_RATES, *UNIT_VELOCITY]] = p, q + self.unit + noise[0], r, north, east
        x = np.zeros(S)
        x[Q], x[R], x[ROLL] = q + self.gyro + noise[1], r + noise[2], self.roll_factor * self.bank
        x[PITCH], x[HEADING] = THETA + self.sensor + noise[3], self.heading % (2.0 * math.pi)
        x[INDEX["angle_of_attack"]] = math.atan(math.tan(THETA) / cosine)
        x[INDEX["normal_load_factor"]], x[INDEX["lateral_load_factor"]] = math.cos(THETA) / cosine, self.side
        x[INDEX["longitudinal_load_factor"]] = math.sin(THETA)
        x[INDEX["static_pressure"]], x[INDEX["dynamic_pressure"]] = 46_600.0, 11_790.0
        self.row["source"][Q] = int(Source.DEGRADED if self.lost else Source.VOTED)
        read = x[PITCH]
        monitor_pitch_angle(self.row["inertial"], self.row, self.param, self.state, x)
        self.said = x[PITCH]
        self.passed_on = self.passed_on and self.said == read
        self.found.add(SensorFault(self.row["sensor_fault"]))
        self.trusts.add(Trust(self.row["trust"]))

    @property
    def rates(self) -> int:
        return int(self.state[0]["rates"])


@pytest.mark.parametrize(
    "bias", [-0.05, 0.003, *(pytest.param(bias, marks=pytest.mark.long) for bias in (-0.01, 0.02))]
)
def test_a_biased_gyro_is_the_answer_and_the_sensor_flies_on(bias: float):
    flight = Flight()
    flight.gyro = bias
    flight.fly(30.0)
    assert (
        flight.found == {SensorFault.NONE, SensorFault.RATE_BIAS}
        and flight.row["sensor_fault"] == SensorFault.RATE_BIAS
    )
    assert flight.trusts == {Trust.TRUSTED} and flight.passed_on and flight.rates == UNIT_ALONE


def test_when_the_bias_is_gone_the_gyros_are_used_again():
    flight = Flight()
    flight.gyro = 0.02
    flight.fly(20.0)
    flight.gyro = 0.0
    flight.fly(4.0)
    assert flight.row["sensor_fault"] == SensorFault.RATE_BIAS
    flight.fly(10.0)
    assert flight.row["sensor_fault"] == SensorFault.NONE and flight.rates == BOTH
    flight.fly(30.0)
    assert flight.found == {SensorFault.NONE} and flight.passed_on


def test_a_trip_by_a_difference_that_is_as_good_as_none_is_not_reported():
    flight = Flight()
    flight.gyro = 0.0009
    isolated = set()
    for _ in range(10):
        flight.fly(1.0)
        isolated.add(flight.rates)
        assert flight.found == {SensorFault.NONE} and flight.trusts == {Trust.TRUSTED} and flight.passed_on
    assert UNIT_ALONE in isolated


@pytest.mark.parametrize("offset", [-0.02, 0.005])
@pytest.mark.parametrize("bank", [pytest.param(0.0, marks=pytest.mark.long), 0.5])
def test_a_sensor_that_jumps_is_found_in_two_frames_all_the_same(offset: float, bank: float):
    flight = Flight(bank)
    flight.sensor = offset
    flight.fly(2.0 / RATE_HZ)
    assert flight.row["trust"] == Trust.CORRECTED
    flight.fly(10.0)
    assert flight.said == pytest.approx(THETA, abs=0.001) and SensorFault.RATE_BIAS not in flight.found


def test_a_sensor_that_jumps_is_found_while_the_gyros_are_biased():
    flight = Flight()
    flight.gyro = 0.02
    flight.fly(10.0)
    flight.sensor = 0.02
    flight.fly(10.0)
    assert flight.row["trust"] == Trust.CORRECTED and flight.row["sensor_fault"] == SensorFault.UNDETERMINED
    assert flight.said == pytest.approx(THETA, abs=0.002)


def test_a_sensor_is_corrected_by_the_gyros_again_once_they_are_well():
    """The drift goes along when the rates change: 30 s on the estimate after two changes."""
    flight = Flight()
    flight.gyro = 0.03
    flight.fly(10.0)
    flight.gyro = 0.0
    flight.fly(20.0)
    flight.sensor = 0.02
    flight.fly(30.0)
    assert flight.rates == BOTH and flight.said == pytest.approx(THETA, abs=0.002)


@pytest.mark.parametrize("bias", [-0.02, 0.003])
def test_a_biased_unit_is_no_fault_of_a_channel_and_leaves_the_gyros_alone(bias: float):
    flight = Flight()
    flight.unit = bias
    flight.fly(20.0)
    assert flight.found == {SensorFault.NONE} and flight.passed_on and flight.rates == GYROS_ALONE
    flight.sensor = 0.01
    flight.fly(1.0)
    assert flight.row["trust"] == Trust.CORRECTED and flight.said == pytest.approx(THETA, abs=0.001)


def test_a_unit_that_comes_back_is_heard_again():
    flight = Flight()
    flight.unit = math.nan
    flight.fly(10.0)
    assert flight.rates == GYROS_ALONE and flight.found == {SensorFault.NONE} and flight.passed_on
    flight.unit = 0.0
    flight.fly(10.0)
    assert flight.rates == BOTH
    flight.gyro = 0.01
    flight.fly(10.0)
    assert flight.row["sensor_fault"] == SensorFault.RATE_BIAS and flight.passed_on


def test_a_unit_that_is_lost_while_it_drives_the_filter_leaves_the_bias_as_drift():
    flight = Flight()
    flight.gyro = 0.02
    flight.fly(10.0)
    flight.unit = math.nan
    flight.fly(20.0)
    assert flight.rates == GYROS_ALONE and flight.row["sensor_fault"] == SensorFault.NONE and flight.passed_on
    assert flight.state[0]["filter"]["drift"] == pytest.approx(0.02, abs=2e-4)


@pytest.mark.requirement("fault-tolerant", "a bank angle that is wrong by little")
@pytest.mark.parametrize(
    ("bank", "factor"), [(0.5, 0.5), pytest.param(0.28, 1.13, marks=pytest.mark.long), (-0.28, 0.87)]
)
def test_a_bank_angle_that_is_wrong_in_a_turn_is_no_sensor_fault(bank: float, factor: float):
    """By a little, too: 36 mrad is no more than the unit's bank angle may be off by."""
    flight, isolated = Flight(bank), set()
    flight.roll_factor = factor
    for _ in range(20):
        flight.fly(1.0)
        isolated.add(flight.rates)
        assert flight.found <= {SensorFault.NONE, SensorFault.RATE_BIAS} and flight.passed_on
    assert UNIT_ALONE in isolated
    flight.turn_to(0.0)  # back to both rates, with what is left of the unit's error
    flight.fly(20.0)
    assert flight.rates == BOTH and flight.found <= {SensorFault.NONE, SensorFault.RATE_BIAS} and flight.passed_on


def test_a_ramp_of_the_sensor_in_a_turn_is_found_with_the_bank_angle_off_by_as_much_as_fault_free():
    flight = Flight(0.5)
    flight.roll_factor = 0.98
    flight.fly(20.0)
    for i in range(300):
        flight.sensor = 0.002 * i / RATE_HZ
        flight.fly(1.0 / RATE_HZ)
    assert flight.row["trust"] == Trust.CORRECTED and SensorFault.RATE_BIAS not in flight.found


UNIT_OFF = [(-0.0017, 0.012), (0.0017, -0.012)]  # the unit's bank angle is off by 18 mrad, either way


@pytest.mark.requirement("fault-tolerant", "the unit's usual error costs no ramp in a turn")
@pytest.mark.parametrize("unit_off", UNIT_OFF)
@pytest.mark.parametrize("rate", [-0.001, pytest.param(0.001, marks=pytest.mark.long)])
def test_a_ramp_in_a_turn_is_found_as_early_as_without_a_unit_whose_bank_angle_is_off(
    unit_off: tuple[float, float], rate: float
):
    """What is off in straight flight, too, says nothing in a turn."""
    after = []
    for lost in (False, True):
        flight = Flight(0.0, unit_off)
        flight.unit = math.nan if lost else 0.0
        flight.roll_to(0.5)
        flight.fly(5.0)
        for i in range(1000):
            flight.sensor = rate * i / RATE_HZ
            flight.fly(1.0 / RATE_HZ)
            if flight.row["trust"] == Trust.CORRECTED:
                after.append(i)
                break
    assert len(after) == 2 and after[0] <= after[1] + 5 and SensorFault.RATE_BIAS not in flight.found


@pytest.mark.requirement("fault-tolerant", "a bank angle that is wrong by little")
@pytest.mark.parametrize("unit_off", UNIT_OFF)
@pytest.mark.parametrize("factor", [0.95, pytest.param(1.05, marks=pytest.mark.long)])
def test_a_bank_angle_that_is_wrong_in_a_turn_is_no_sensor_fault_beside_a_unit_that_is_off(
    unit_off: tuple[float, float], factor: float
):
    """5 % of 0.5 rad are 25 mrad; the rates stay suspected until the turn is over."""
    flight, isolated = Flight(0.0, unit_off), False
    flight.roll_to(0.5)
    flight.fly(5.0)
    flight.roll_factor = factor
    for _ in range(40):
        flight.fly(1.0)
        assert flight.trusts == {Trust.TRUSTED} and flight.passed_on
        assert flight.rates == UNIT_ALONE or not isolated
        isolated = flight.rates == UNIT_ALONE
    assert isolated
    flight.roll_to(0.0)
    flight.fly(20.0)
    assert flight.rates == BOTH and flight.trusts == {Trust.TRUSTED} and flight.passed_on


def test_lost_gyros_are_not_compared_with_the_unit():
    flight = Flight()
    flight.lost, flight.gyro = True, 0.05
    flight.fly(10.0)
    assert flight.rates == BOTH and flight.found == {SensorFault.NONE} and flight.passed_on
    flight.lost, flight.gyro = False, 0.0
    flight.fly(10.0)
    assert flight.rates == BOTH and flight.passed_on
