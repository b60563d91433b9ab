"""The monitors of an actuator's channels: who finds what, after how long, and who is left alone."""

import numpy as np
import pytest
from servos import LAG_S, RATE_LIMIT, STOP, moved

from rig.core.frame import ActuatorMonitor
from rig.world.faults.servo_parts import Part

RATE_HZ, ONSET = 100.0, 20
STROKE = 2.0 * STOP
NONE = ActuatorMonitor.NONE


def found(rows, surface: int = 0) -> dict[int, tuple[ActuatorMonitor, int]]:
    """Who failed which channel, and how many frames after the onset, the onset's frame counted."""
    by = rows["failed_by"][:, surface]
    return {
        c + 1: (ActuatorMonitor(by[-1, c]), int(np.argmax(by[:, c] != NONE)) - ONSET + 1) for c in range(4) if by[-1, c]
    }


def breaking(**fields):
    """Break the parts of the first surface in the channel that each names, from the onset on."""

    def broken(data, k):
        if k == ONSET:
            for name, (c, value) in fields.items():
                data.broken[0, Part[name.upper()], c] = value

    return broken


def test_a_coil_that_runs_away_is_found_by_its_current():
    rows = moved([0.0] * 100, breaking(commanded=(1, 0.0), added=(1, 1.0)))
    assert found(rows) == {2: (ActuatorMonitor.CURRENT, 5)}
    assert found(rows, surface=1) == {}
    assert abs(rows["ram"][-1, 0]) < 1e-6


def test_an_open_coil_that_its_wire_tells_of_is_found_by_continuity():
    rows = moved([0.0] * 100, breaking(commanded=(3, 0.0), open_seen=(3, 1)))
    assert found(rows) == {4: (ActuatorMonitor.CONTINUITY, 2)}


def test_an_open_coil_that_nothing_tells_of_hides_while_nothing_moves():
    assert found(moved([0.0] * 300, breaking(commanded=(3, 0.0)))) == {}
    moving = 0.3 * np.sign(np.sin(np.arange(300) / 30))
    assert found(moved(moving, breaking(commanded=(3, 0.0))))[4][0] == ActuatorMonitor.CURRENT


@pytest.mark.parametrize("share", [-0.1, 0.1])
def test_a_position_sensor_that_is_off_is_found_by_the_others(share: float):
    rows = moved([0.0] * 100, breaking(offset=(0, share * STROKE)))
    assert found(rows) == {1: (ActuatorMonitor.POSITION, 5)}


def test_a_position_sensor_within_the_threshold_is_let_be():
    assert found(moved([0.0] * 300, breaking(offset=(0, 0.029 * STROKE)))) == {}


def test_a_spool_that_jams_open_fails_all_channels_and_the_ram_is_bypassed():
    def broken(data, k):
        if k == ONSET:
            data.broken[0, Part.JAMMED] = 1.0

    asked = 0.2 * np.sin(np.arange(400) / 20)
    rows = moved(asked, broken)
    assert len(found(rows)) == 4 and rows["bypassed"][-1, 0] == 1
    assert (rows["bypassed"][:, 1] == 0).all()
    assert abs(rows["ram"][-1, 0]) < abs(rows["ram"][150, 0]) + 1e-9


def test_a_spool_model_waits_while_currents_miscompare():
    def two_run_away(data, k):
        if k == ONSET:
            data.broken[0, Part.COMMANDED, :2], data.broken[0, Part.ADDED, :2] = 0.0, 1.0

    rows = moved([0.0] * 100, two_run_away, spool={"threshold": 0.35, "persistence_s": 0.02})
    assert found(rows) == {1: (ActuatorMonitor.CURRENT, 5), 2: (ActuatorMonitor.CURRENT, 5)}


def test_a_shut_off_valve_that_sticks_is_reported_and_fails_no_channel():
    rows = moved([0.0] * 100, breaking(commanded=(1, 0.0), added=(1, 1.0), valve_stuck=(1, 1)))
    assert found(rows) == {2: (ActuatorMonitor.CURRENT, 5)}
    differs = rows["valve_differs"][:, 0]
    assert list(differs[-1]) == [0, 1, 0, 0]
    shut = int(np.argmax(rows["valve"][:, 0, 1]))
    assert int(np.argmax(differs[:, 1])) - shut == 5  # commanded in one frame, sensed from the next on
    assert rows["ram"][-1, 0] == pytest.approx(LAG_S * RATE_LIMIT / 3, rel=1e-5)


STICKING = breaking(commanded=(1, 0.0), added=(1, 1.0), valve_stuck=(1, 1))


def test_the_models_know_what_a_stuck_valve_lets_through():
    rows = moved([0.0] * 200, STICKING, spool={"threshold": 1e-3}, ram={"threshold": 1e-2})
    assert found(rows) == {2: (ActuatorMonitor.CURRENT, 5)}
    last = rows[-1, 0]
    good = [0, 2, 3]
    # Three currents balance the full one; without it in the models the spool would be a quarter open.
    assert last["current"] == pytest.approx([-1 / 3, 1, -1 / 3, -1 / 3], rel=1e-5)
    assert last["spool_model"][good] == pytest.approx(0.0, abs=1e-5) and last["spool"] == pytest.approx(0.0, abs=1e-5)
    assert last["ram_model"][good] == pytest.approx(LAG_S * RATE_LIMIT / 3, rel=1e-5)


def test_three_channels_move_the_ram_against_a_stuck_valve_from_stop_to_stop():
    asked = np.repeat([0.0, -2.0, 2.0, -2.0], 200) * STOP
    rows = moved(asked, STICKING)
    assert found(rows) == {2: (ActuatorMonitor.CURRENT, 5)}
    ram = rows["ram"][:, 0]
    assert [ram[399], ram[599], ram[799]] == [-STOP, STOP, -STOP]
    assert np.diff(ram[206:216]) == pytest.approx((1 - 3) / 4 * RATE_LIMIT / RATE_HZ, rel=1e-5)


def test_a_jam_behind_a_stuck_valve_is_found_by_the_spool():
    def broken(data, k):
        STICKING(data, k)
        if k == 120:
            data.broken[0, Part.JAMMED] = 1.0

    at = np.arange(200)
    rows = moved(np.where(at < 120, 0.0, STOP), broken)
    by = rows["failed_by"][-1, 0]
    assert list(by) == [ActuatorMonitor.SPOOL, ActuatorMonitor.CURRENT, ActuatorMonitor.SPOOL, ActuatorMonitor.SPOOL]


def test_without_monitors_no_channel_is_failed():
    rows = moved([0.0] * 100, breaking(commanded=(1, 0.0), added=(1, 1.0)), monitors=False)
    assert found(rows) == {}


def test_a_lost_pressure_is_known_to_the_models():
    def broken(data, k):
        if k >= ONSET:
            data.broken[0, Part.PRESSURE, 0] = 0.0

    assert found(moved(0.3 * np.sign(np.sin(np.arange(400) / 40)), broken)) == {}


@pytest.mark.parametrize("rate_hz", [25.0, 100.0, 1000.0])
@pytest.mark.parametrize("seed", range(5))
def test_healthy_actuators_are_let_be_at_the_ends_of_their_travel_and_speed(rate_hz: float, seed: int):
    t = np.arange(int(6 * rate_hz)) / rate_hz
    asked = np.where(t % 2 < 1, 1.2, -1.2) * STOP
    rows = moved(
        asked,
        rate_hz=rate_hz,
        seed=seed,
        lvdt_bias_tolerance=0.0025,
        lvdt_scale_tolerance=0.005,
        lvdt_noise_std=0.0005,
        coil_tolerance=0.03,
        rate_tolerance=0.05,
        spool_tolerance=0.1,
    )
    assert not rows["failed_by"].any() and not rows["valve_differs"].any()
