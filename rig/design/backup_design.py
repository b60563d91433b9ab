"""Design the laws for lost signals: lift, short period, and the compensators of the standby law.

A compensator is a linear-quadratic regulator on estimates of a Kalman filter (LQG) for the short period with its
actuator.  Two bandwidths define it: the regulator's and the observer's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from rig.computer.control.gains_file import BACKUP
from rig.core.units.constants import GRAVITY

Matrix = NDArray[np.float64]
Sensor = Literal["load", "alpha"]
SENSORS: Final[tuple[Sensor, ...]] = ("load", "alpha")
# Lost with the pitch rate, so that the standby law flies on this sensor alone.
LOST: Final[dict[Sensor, tuple[str, ...]]] = {
    "load": ("pitch_rate", "pitch_angle"),
    "alpha": ("pitch_rate", "pitch_angle", "normal_load_factor"),
}
NONE: Final = {f"backup_{sensor}_{name}": 0.0 for sensor in SENSORS for name in BACKUP}  # no compensator yet
_OBSERVERS_RAD_S: Final = (8.0, 12.0, 16.0, 20.0, 25.0)
_REGULATORS_RAD_S: Final = (1.0, 1.5, 2.0, 2.5, 3.0)
_INTEGRALS: Final = (0.2, 0.05)


@dataclass(frozen=True)
class Bandwidth:
    """The bandwidths of one compensator."""

    observer_rad_s: float
    regulator_rad_s: float
    integral_share: float


def candidates() -> list[Bandwidth]:
    """Return the candidates: slow observers first, which pass little noise, then slow regulators."""
    return [Bandwidth(*x) for x in product(_OBSERVERS_RAD_S, _REGULATORS_RAD_S, _INTEGRALS)]


def regulator(a: Matrix, b: Matrix, q: Matrix, r: Matrix) -> Matrix:
    """Return the gain K of u = -K x that minimises the integral of x'Qx + u'Ru (Kalman 1960)."""
    return np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))


def short_period(a: Matrix, b: Matrix, airspeed: float, lever: float) -> dict[str, float]:
    """Return the short period's coefficients for the substitutes and the observers.

    a (2, 2), b (2,) : rates of (alpha, q) by (alpha, q) and by the elevator; airspeed [m/s]
    lever : the accelerometer's place ahead of the centre of gravity [m]
    """
    load = (-airspeed * a[0] + lever * a[1]) / GRAVITY
    pull = np.linalg.solve(np.column_stack([a[:, 1], b]), -a[:, 0])  # q and elevator that hold alpha = 1
    return {
        "lift_slope_1_rad": airspeed / GRAVITY * pull[0],
        "load_by_alpha_1_rad": load[0],
        "load_by_pitch_rate_s": load[1] + airspeed / GRAVITY,
        "load_by_elevator_1_rad": (-airspeed * b[0] + lever * b[1]) / GRAVITY,
        "alpha_rate_by_alpha_1_s": a[0, 0],
        "alpha_rate_by_pitch_rate": a[0, 1],
        "alpha_rate_by_elevator_1_s": b[0],
        "pitch_acceleration_by_alpha_1_s2": a[1, 0],
        "pitch_acceleration_by_pitch_rate_1_s": a[1, 1],
        "pitch_acceleration_by_elevator_1_s2": b[1],
    }


def roll_and_yaw(a: Matrix, b: Matrix) -> dict[str, float]:
    """Return the models of roll and yaw rate; a (4, 4), b (4, 2) of (beta, p, r, phi) and (aileron, rudder)."""
    return {
        "roll_acceleration_by_sideslip_1_s2": a[1, 0],
        "roll_acceleration_by_roll_rate_1_s": a[1, 1],
        "roll_acceleration_by_aileron_1_s2": b[1, 0],
        "yaw_acceleration_by_sideslip_1_s2": a[2, 0],
        "yaw_acceleration_by_yaw_rate_1_s": a[2, 2],
        "yaw_acceleration_by_rudder_1_s2": b[2, 1],
    }


def compensator(a: Matrix, b: Matrix, period: dict[str, float], sensor: Sensor, chosen: Bandwidth) -> dict[str, float]:
    """Return the five gains of one sensor; ``period`` from ``short_period``.

    Weights: q 1, integral of alpha (share w^2)^2, elevator (M_elevator / w)^2, w the regulator's bandwidth;
    the observer's disturbance enters at the elevator, its noise is such that it follows at its bandwidth.
    """
    w, v = chosen.regulator_rad_s, chosen.observer_rad_s
    a3, b3 = np.zeros((3, 3)), np.array([[b[0]], [b[1]], [0.0]])
    a3[:2, :2], a3[2, 0] = a, 1.0
    weights = np.diag([0.0, 1.0, (chosen.integral_share * w**2) ** 2])
    k = regulator(a3, b3, weights, np.array([[(b[1] / w) ** 2]]))[0]
    c = np.array([[1.0, 0.0]])
    if sensor == "load":
        c = np.array([[period["load_by_alpha_1_rad"], period["load_by_pitch_rate_s"]]])
    noise = np.array([[(c[0, 0] * b[1] / v**2) ** 2]])
    observe = regulator(a.T, c.T, np.outer(b, b) + 1e-9 * np.eye(2), noise)[0]
    return {f"backup_{sensor}_{name}": float(x) for name, x in zip(BACKUP, (*k, *observe), strict=True)}
