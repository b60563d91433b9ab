"""The whole loop as a linear system: airframe, actuators, sensors and the control law as it is coded.

The law is not written down a second time: its kernel is differenced about trimmed flight, so that
margins are those of the code that flies.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from rig.control.airdata import GAS_CONSTANT, GRAVITY, LAPSE_RATE, TROPOPAUSE_ALTITUDE, temperature
from rig.control.autopilot import Config, Control
from rig.control.gains import Gains
from rig.control.margins import Loop, Matrix, sampled_loop
from rig.control.record import DYNAMIC
from rig.frame import DISCRETE_INDEX, INDEX, SURFACES, Block, S, new_block
from rig.plant.airframe import Config as Airframe
from rig.plant.airframe import FlightPoint
from rig.plant.linear import Linear, Trim

Law = Literal["stick", "autopilot"]
Plane = Literal["longitudinal", "lateral"]
# Outputs of each plane that the law reads, and its surfaces.
OUTPUTS: Final[dict[Plane, tuple[str, ...]]] = {
    "longitudinal": (
        "pitch_rate",
        "angle_of_attack",
        "static_pressure",
        "dynamic_pressure",
        "pitch_angle",
        "normal_load_factor",
    ),
    "lateral": ("roll_rate", "yaw_rate", "angle_of_sideslip", "roll_angle", "heading"),
}
ACTUATORS: Final[dict[Plane, tuple[str, str]]] = {
    "longitudinal": ("elevator", "throttle"),
    "lateral": ("aileron", "rudder"),
}
# What the law remembers of each plane; the rest of its state does not move in small motions.
MEMORY: Final[dict[tuple[Law, Plane], tuple[str, ...]]] = {
    ("autopilot", "longitudinal"): tuple(
        name for name in DYNAMIC if name not in ("aileron_integral", "rudder_integral")
    ),
    ("stick", "longitudinal"): ("elevator_integral", "airspeed", "schedule_pressure"),
    ("autopilot", "lateral"): ("aileron_integral", "rudder_integral"),
    ("stick", "lateral"): ("aileron_integral", "rudder_integral"),
}
_SURFACE_INDEX: Final = {name.removesuffix("_rad"): i for i, name in enumerate(SURFACES)}
_HEADING: Final = 1.0  # rad, of the linearised flight; any
# With the sticks nobody holds speed, bank or spiral: a drift that doubles in no less than 14 s is the pilot's.
PILOT_CATCHES_1_S: Final = 0.05


def build(airframe: Airframe, point: FlightPoint, linear: Linear, gains: Gains, law: Law, plane: Plane) -> Loop:
    """The sampled loop of one plane; commands of the actuators in the order of ``ACTUATORS[plane]``."""
    a, b, c, d = _airframe(airframe, linear, point, plane)
    lags = [getattr(airframe, name).lag_s for name in ACTUATORS[plane]]
    period = 1.0 / gains.rate_hz
    f, g, h = sampled_loop(a, b, c, d, lags, gains.sensor_lag_s, period)
    ac, bc, cc, dc = _law(gains, linear.trim, point, law, plane)
    n, m = g.shape
    return Loop(
        f=np.block([[f, np.zeros((n, len(ac)))], [bc @ h, ac]]),
        g=np.vstack([g, np.zeros((len(ac), m))]),
        k=-np.hstack([dc @ h, cc]),
        period_s=period,
        growth_1_s=PILOT_CATCHES_1_S if law == "stick" else 0.0,
    )


def _airframe(
    airframe: Airframe, linear: Linear, point: FlightPoint, plane: Plane
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """(A, B, C, D) with altitude or heading as a fifth state."""
    trim = linear.trim
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    c, d = np.zeros((len(OUTPUTS[plane]), 5)), np.zeros((len(OUTPUTS[plane]), 2))
    if plane == "lateral":
        a[:4, :4], b[:4] = linear.lateral_a, linear.lateral_b
        a[4, 2] = 1.0 / np.cos(trim.theta_rad)
        for row, state in enumerate((1, 2, 0, 3, 4)):
            c[row, state] = 1.0
        return a, b, c, d
    a[:4, :4], b[:4] = linear.longitudinal_a, linear.longitudinal_b
    a[4, 1], a[4, 3] = -trim.airspeed_m_s, trim.airspeed_m_s
    density = 2.0 * trim.dynamic_pressure_pa / trim.airspeed_m_s**2
    air = temperature(point.altitude_m)
    lapse = LAPSE_RATE if point.altitude_m < TROPOPAUSE_ALTITUDE else 0.0
    c[0, 2] = c[1, 1] = c[4, 3] = 1.0
    c[2, 4] = -density * GRAVITY
    c[3, 0] = density * trim.airspeed_m_s
    c[3, 4] = -trim.dynamic_pressure_pa / air * (GRAVITY / GAS_CONSTANT - lapse)
    # n_z = V (q - alpha rate) / g, plus what the pitch acceleration adds ahead of the centre of gravity.
    lever = airframe.accelerometer.x_m / GRAVITY
    c[5] = -trim.airspeed_m_s / GRAVITY * a[1] + lever * a[2]
    c[5, 2] += trim.airspeed_m_s / GRAVITY
    d[5] = -trim.airspeed_m_s / GRAVITY * b[1] + lever * b[2]
    return a, b, c, d


def _law(gains: Gains, trim: Trim, point: FlightPoint, law: Law, plane: Plane) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """(A, B, C, D) of the law, x+ = A x + B y, u = C x + D y, by central differences of the kernel."""
    control, block = trimmed(gains, trim, point, law)
    rest = control.state.copy()
    memory = MEMORY[law, plane]
    columns: list[Matrix] = []

    def difference(change: Matrix | None, name: str, size: float) -> Matrix:
        results = []
        for sign in (size, -size):
            control.state[:] = rest
            block["voted"][1] = block["voted"][0]
            if change is None:
                control.state[name] += sign
            else:
                block["voted"][1] += sign * change
            control.step(block, 1)
            state = [float(control.state[field][0]) for field in memory]
            results.append(np.array([*state, *block["surface"][1]]))
        return (results[0] - results[1]) / (2.0 * size)

    for field in memory:
        columns.append(difference(None, field, _step(field)))
    for signal in OUTPUTS[plane]:
        columns.append(difference(np.eye(S)[INDEX[signal]], signal, _step(signal)))
    jacobian = np.array(columns).T
    n = len(memory)
    surfaces = [n + _SURFACE_INDEX[name] for name in ACTUATORS[plane]]
    return jacobian[:n, :n], jacobian[:n, n:], jacobian[surfaces, :n], jacobian[surfaces, n:]


def _step(name: str) -> float:
    return 1.0 if "pressure" in name else 1e-2 if name.startswith(("altitude", "airspeed")) else 1e-5


def trimmed(gains: Gains, trim: Trim, point: FlightPoint, law: Law) -> tuple[Control, Block]:
    """A control stage after its first frame in trimmed flight, and the block (2 rows) of that frame."""
    wide = [(-2.0, 2.0)] * len(SURFACES)
    control = Control(Config(), gains, gains.rate_hz, wide)
    control.reset([trim.elevator_rad, trim.aileron_rad, trim.rudder_rad, trim.throttle])
    block = new_block(2)
    voted = block["voted"][0]
    voted[INDEX["angle_of_attack"]] = trim.alpha_rad
    voted[INDEX["pitch_angle"]] = trim.theta_rad
    voted[INDEX["heading"]] = _HEADING
    voted[INDEX["normal_load_factor"]] = np.cos(trim.theta_rad)
    voted[INDEX["longitudinal_load_factor"]] = np.sin(trim.theta_rad)
    density = 2.0 * trim.dynamic_pressure_pa / trim.airspeed_m_s**2
    voted[INDEX["static_pressure"]] = density * GAS_CONSTANT * temperature(point.altitude_m)
    voted[INDEX["dynamic_pressure"]] = trim.dynamic_pressure_pa
    block["discrete_voted"][:, DISCRETE_INDEX["autopilot_engaged"]] = law == "autopilot"
    control.step(block, 0)
    return control, block
