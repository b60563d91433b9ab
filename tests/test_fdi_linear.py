"""The fault-tolerant law's estimate on the B707 of Ding 2015: the linear yardstick.

A linear-quadratic law with integral action tracks a unit step on the estimated pitch angle.  Measured are the pitch
angle, which fails, and the pitch rate, both with noise of 0.002; no air data, so no path.  A and B fly 10 percent off,
the kinematic row theta' = q of A included, so the rate may be off as much (``scale_sigma``).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_are

from rig.computer.analytic.pitch_filter import Noise
from rig.computer.fdi.monitor import monitor_pitch_angle
from rig.computer.fdi.pitch_test_state import STATE, Config, parameters
from rig.core.frame import INDEX, S, Source, Trust, new_block
from rig.scenario import scenario
from rig.world.plant.airframe import LinearConfig

RATE_HZ, FAULT_S, END_S, NOISE = 100.0, 5.0, 25.0, 0.002
THETA, Q = INDEX["pitch_angle"], INDEX["pitch_rate"]
SETTINGS = Config(
    lag_s=0.5,
    innovation_floor_rad=NOISE,
    turn_error=0.0,
    timing_s=0.0,
    max_correction_rad=1.5,
    noise=Noise(rate_noise_rad_sqrt_s=NOISE / RATE_HZ**0.5, drift_sigma_rad_s=0.0, scale_sigma=0.1),
)
QUICK = ((0.9, 1.1), (1.0, 1.0), (1.1, 0.9))  # the quick tests
PERTURBED = [
    pytest.param(which, marks=[] if which in QUICK else [pytest.mark.long])
    for which in product((0.9, 1.0, 1.1), (0.9, 1.0, 1.1))
]


@dataclass(frozen=True)
class Flown:
    theta: NDArray[np.float64]  # true
    trust: NDArray[np.int64]

    def against(self, healthy: Flown) -> tuple[float, float]:
        """Peak and steady deviation of the true pitch angle that the fault made."""
        off = (self.theta - healthy.theta)[round(FAULT_S * RATE_HZ) :]
        return float(np.abs(off).max()), float(abs(off[-500:].mean()))


@cache
def model() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B's elevator column, as in aircraft/b707."""
    airframe = scenario.load(None, ["aircraft=b707", "flight_point=35000ft_m08", "faults=[]"]).airframe
    assert isinstance(airframe, LinearConfig)
    return np.array(airframe.model.A), np.array(airframe.model.B)[:, 1]


def regulator(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gains on alpha, q, theta and the integral of its error; speed is not needed to hold an attitude."""
    big, drive = np.zeros((4, 4)), np.zeros((4, 1))
    big[:3, :3], big[3, 2], drive[:3, 0] = a[1:, 1:], 1.0, b[1:]
    p = solve_continuous_are(big, drive, np.diag([0.0, 1.0, 4.0, 1.0]), np.eye(1))
    return (drive.T @ p)[0]


def fly(
    a_factor: float = 1.0,
    b_factor: float = 1.0,
    factor: float = 1.0,
    ramp_s: float = 0.0,
    tolerant: bool = True,
    seed: int = 1,
) -> Flown:
    a, b = model()
    k = regulator(a, b)
    dt, count = 1.0 / RATE_HZ, round(END_S * RATE_HZ)
    chain = np.zeros((5, 5))
    chain[:4, :4], chain[:4, 4] = a_factor * a, b_factor * b
    step = expm(chain * dt)
    noise = NOISE * np.random.default_rng(seed).standard_normal((count, 3))
    x, integral = np.zeros(4), 0.0
    row, state, param = new_block(1), np.zeros(1, STATE), parameters(SETTINGS, True, RATE_HZ)
    row["source"][0] = int(Source.DEGRADED)
    row["source"][0, [THETA, Q, INDEX["yaw_rate"], INDEX["roll_angle"]]] = int(Source.VOTED)
    measured = np.zeros(S)
    measured[[INDEX["static_pressure"], INDEX["dynamic_pressure"]]] = 23_800.0, 10_700.0
    theta, trust = np.zeros(count), np.zeros(count, np.int64)
    for i in range(count):
        t = i * dt
        share = 0.0 if t < FAULT_S else 1.0 if ramp_s == 0.0 else min((t - FAULT_S) / ramp_s, 1.0)
        measured[THETA] = (1.0 + (factor - 1.0) * share) * x[3] + noise[i, 0]
        measured[Q] = x[2] + noise[i, 1]
        if tolerant:
            monitor_pitch_angle(row["inertial"][0], row[0], param, state, measured)
        said = measured[THETA]
        integral += dt * (said - 1.0)
        u = -k @ np.array([x[1] + noise[i, 2], measured[Q], said - 1.0, integral])
        theta[i], trust[i] = x[3], row["trust"][0]
        x = step[:4, :4] @ x + step[:4, 4] * u
    return Flown(theta, trust)


@cache
def healthy(which: tuple[float, float]) -> Flown:
    return fly(*which)


def test_without_the_estimate_the_true_pitch_angle_goes_to_twice_the_step():
    assert fly(factor=0.5, tolerant=False).theta[-1] == pytest.approx(2.0, abs=0.02)


@pytest.mark.requirement("fault-tolerant", "the linear yardstick")
def test_half_the_effectiveness_moves_the_true_pitch_angle_by_less_than_the_yardstick():
    peak, steady = fly(factor=0.5).against(healthy((1.0, 1.0)))
    assert peak <= 0.01 and steady <= 0.002


@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(3, 12))])
def test_likewise_with_other_noise(seed: int):
    peak, steady = fly(factor=0.5, seed=seed).against(fly(seed=seed))
    assert peak <= 0.01 and steady <= 0.004


@pytest.mark.requirement("fault-tolerant", "the linear yardstick")
@pytest.mark.parametrize("which", PERTURBED)
@pytest.mark.parametrize("ramp_s", [0.0, 10.0])
def test_in_all_perturbations_within_three_percent_jump_and_ramp(which: tuple[float, float], ramp_s: float):
    peak, _ = fly(*which, factor=0.5, ramp_s=ramp_s).against(healthy(which))
    assert peak <= 0.03


@pytest.mark.parametrize("which", PERTURBED)
def test_nothing_trips_without_a_fault(which: tuple[float, float]):
    assert (healthy(which).trust == Trust.TRUSTED).all()
