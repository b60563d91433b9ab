"""The physics of a servo: analytic expectations for spool, ram, stops, pressures and bypass."""

from math import exp, sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from servos import LAG_S, RATE_LIMIT, STOP, moved

from rig.world.actuators.servo import RAM, SPEED, SPOOL, move_spool, substeps, transition
from rig.world.faults.servo_parts import Part

RATE_HZ = 100.0


@pytest.mark.parametrize("damping", [0.3, 0.7])
@pytest.mark.parametrize("substep_s", [1e-4, 5e-4, 1.25e-3])
def test_a_spool_follows_a_step_as_a_second_order_system_does(damping: float, substep_s: float):
    w = 500.0
    steps, moves = 40, np.zeros(3)
    matrix = transition(w, damping, substep_s).ravel()
    opened = sum(move_spool(moves, matrix, 1.0) for _ in range(steps))
    t, damped = steps * substep_s, w * sqrt(1 - damping**2)
    fade = exp(-damping * w * t)
    x = 1 - fade * (np.cos(damped * t) + damping * w / damped * np.sin(damped * t))
    assert moves[SPOOL] == pytest.approx(x, abs=1e-9)
    assert moves[SPEED] == pytest.approx(fade * w**2 / damped * np.sin(damped * t), rel=1e-6, abs=1e-6)
    assert opened == pytest.approx(t - (moves[SPEED] + 2 * damping * w * x) / w**2)  # its equation, integrated once
    assert moves[RAM] == 0.0


@pytest.mark.parametrize("damping", [0.1, 0.7, 1.0, 1.0 + 1e-9, 1.9])
@pytest.mark.parametrize("spool_rad_s", [50.0, 500.0, 5000.0])
def test_the_transition_is_the_exponential_of_the_spools_equation(spool_rad_s: float, damping: float):
    a = np.zeros((4, 4))  # spool, speed, its integral, input
    a[0, 1], a[1, 0], a[1, 1], a[1, 3], a[2, 0] = (
        1.0,
        -(spool_rad_s**2),
        -2 * damping * spool_rad_s,
        spool_rad_s**2,
        1.0,
    )
    expected = expm(a * 1e-3)[:3][:, (0, 1, 3)]
    scale = np.outer((1.0, spool_rad_s, 1e-3), (1.0, 1.0 / spool_rad_s, 1.0))
    assert np.abs((transition(spool_rad_s, damping, 1e-3) - expected) / scale).max() < 1e-11


def test_substeps_are_whole_and_no_longer_than_a_millisecond():
    for rate in (25.0, 50.0, 100.0, 128.0, 400.0, 1000.0):
        count = substeps(1.0 / rate)
        assert 1.0 / rate / count <= 1e-3 + 1e-12
        assert count == 1 or 1.0 / rate / (count - 1) > 1e-3


@pytest.mark.parametrize("rate_hz", [25.0, 100.0, 1000.0])
def test_a_small_step_is_that_of_the_lag_two_milliseconds_later(rate_hz: float):
    size, frames = 0.01, int(0.4 * rate_hz)
    ram = moved([size] * frames, rate_hz=rate_hz)["ram"][:, 0]
    t = np.arange(1, frames + 1) / rate_hz - 2e-3
    assert np.abs(ram - size * (1 - np.exp(-np.maximum(t, 0) / LAG_S))).max() < 0.02 * size


def test_a_large_step_moves_at_the_rate_limit_and_rests_at_the_stop():
    ram = moved([2.0 * STOP] * 200)["ram"][:, 1]
    assert np.diff(ram[6:35]) == pytest.approx(RATE_LIMIT / RATE_HZ, rel=1e-6)
    assert ram[-1] == STOP


@pytest.mark.parametrize(("pressures", "share"), [((1.0, 1.0), 1.0), ((0.0, 1.0), 0.5), ((0.4, 1.0), 0.7)])
def test_the_ram_is_as_fast_as_both_pressures_are_on_the_mean(pressures: tuple[float, float], share: float):
    def broken(data, k):
        data.broken[0, Part.PRESSURE, :2] = pressures

    ram = moved([STOP] * 40, broken)["ram"][:, 0]
    assert np.diff(ram[6:20]) == pytest.approx(share * RATE_LIMIT / RATE_HZ, rel=1e-6)


def test_without_pressure_the_ram_goes_to_its_bypassed_place():
    def broken(data, k):
        data.broken[0, Part.PRESSURE] = 0.0

    rows = moved([0.2] * 100, broken, trim=0.2, bypass_s=0.5, bypass_rad=-0.1)
    t = np.arange(1, 101) / RATE_HZ
    assert rows["ram"][:, 2] == pytest.approx(-0.1 + 0.3 * np.exp(-t / 0.5))
    assert (rows["bypassed"] == 1).all()


def test_one_channel_that_is_left_moves_the_ram_at_a_quarter_of_the_speed():
    def broken(data, k):
        data.broken[:, Part.COMMANDED, 1:] = 0.0

    ram = moved([STOP] * 40, broken, monitors=False)["ram"][:, 0]
    assert np.diff(ram[4:20]) == pytest.approx(RATE_LIMIT / 4 / RATE_HZ, rel=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_good_coils_balance_those_that_run_away(count: int):
    def broken(data, k):
        data.broken[:, Part.COMMANDED, :count], data.broken[:, Part.ADDED, :count] = 0.0, 1.0

    ram = moved([0.0] * 200, broken, monitors=False)["ram"][:, 0]
    # count full currents against 4 - count of gain times the error.
    assert ram[-1] == pytest.approx(count / (4 - count) * LAG_S * RATE_LIMIT, rel=1e-6)


def test_three_that_run_away_win():
    def broken(data, k):
        data.broken[:, Part.COMMANDED, :3], data.broken[:, Part.ADDED, :3] = 0.0, 1.0

    assert moved([0.0] * 200, broken, monitors=False)["ram"][-1, 0] == STOP


def test_a_jammed_spool_moves_the_ram_at_its_opening_to_the_stop():
    def broken(data, k):
        if k == 5:
            data.broken[:, Part.JAMMED] = 1.0

    rows = moved([0.01] * 700, broken, monitors=False)
    speed = rows["spool"][6, 0] * RATE_LIMIT
    assert np.diff(rows["ram"][5:8, 0]) == pytest.approx(speed / RATE_HZ, rel=1e-5) and speed > 0.01
    assert rows["ram"][-1, 0] == STOP


@pytest.mark.parametrize(("left", "rate"), [(1.0, 1.0), (0.5, 0.5)])
def test_a_leak_takes_its_share_of_the_flow(left: float, rate: float):
    def broken(data, k):
        data.broken[:, Part.LEFT] = left

    ram = moved([STOP] * 40, broken, monitors=False)["ram"][:, 0]
    assert np.diff(ram[6:20]) == pytest.approx(rate * RATE_LIMIT / RATE_HZ, rel=1e-6)


def test_parts_and_noise_come_from_the_seed_alone():
    drawn = [
        moved(np.sin(np.arange(60) / 9) * 0.2, seed=seed, lvdt_noise_std=0.001, coil_tolerance=0.03)
        for seed in (3, 3, 4)
    ]
    assert np.array_equal(drawn[0], drawn[1]) and not np.array_equal(drawn[0], drawn[2])
