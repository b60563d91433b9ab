"""The whole loop as a linear system: airframe, actuators, sensors and the control law as coded.

The law is not written a second time.  Its kernel is differenced about trimmed flight, so the gain and phase margins are
those of the code that flies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from rig.computer.control.autopilot import Config, Control
from rig.computer.control.gains_file import Gains
from rig.computer.control.law_state import DYNAMIC
from rig.core.frame import CHANNELS, DISCRETE_INDEX, INDEX, SURFACES, Block, S, new_block
from rig.core.units.atmosphere import temperature
from rig.core.units.constants import GAS_CONSTANT, GRAVITY, LAPSE_RATE, TROPOPAUSE_ALTITUDE
from rig.design.stability_margins import Loop, Matrix, sampled_loop
from rig.world.plant.airframe import Airframe, FlightPoint
from rig.world.plant.linearise import Linear, Trim

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
# The law's memory of each plane; the rest of its state does not change in small motions.
_LATERAL_MEMORY: Final = ("aileron_integral", "rudder_integral", "smooth_roll_angle", "smooth_heading")
_LEARNED: Final = ("lift_error", "turn_error", "path_error")  # only while no signal is lost, and slowly
_RESERVE: Final = (*_LEARNED, "smooth_pitch_angle", "backup_alpha", "backup_pitch_rate", "backup_elevator")
MEMORY: Final[dict[tuple[Law, Plane], tuple[str, ...]]] = {
    ("autopilot", "longitudinal"): tuple(name for name in DYNAMIC if name not in (*_LATERAL_MEMORY, *_RESERVE)),
    ("stick", "longitudinal"): ("elevator_integral", "airspeed", "schedule_pressure"),
    ("autopilot", "lateral"): ("aileron_integral", "rudder_integral"),
    ("stick", "lateral"): ("aileron_integral", "rudder_integral"),
}
# The same with signals lost, with elements of arrays; ``measured.`` is the substitute of a signal.
_LOST_MEMORY: Final[dict[Plane, tuple[str, ...]]] = {
    "longitudinal": (
        *(name for name in DYNAMIC if name not in (*_LATERAL_MEMORY, *_LEARNED)),
        *("rate_bias.0", "deflection.0"),
    ),
    "lateral": (*_LATERAL_MEMORY, *("rate_bias.1", "deflection.1", "rate_bias.2", "deflection.2")),
}
_SURFACE_INDEX: Final = {name.removesuffix("_rad"): i for i, name in enumerate(SURFACES)}
_HEADING: Final = 1.0  # rad, of the linearised flight; any
# With the stick no law holds speed, bank or spiral: the pilot handles a drift that doubles in 14 s or more.
PILOT_CATCHES_1_S: Final = 0.05


def build(
    airframe: Airframe,
    point: FlightPoint,
    linear: Linear,
    gains: Gains,
    law: Law,
    plane: Plane,
    lost: Sequence[str] = (),
) -> Loop:
    """Return the sampled loop of one plane; actuators' commands in the order of ``ACTUATORS[plane]``.

    The ``lost`` signals have no channel and no reference, and all fades are over.
    """
    a, b, c, d = _airframe(airframe, linear, point, plane)
    lags = [getattr(airframe, name).lag_s for name in ACTUATORS[plane]]
    period = 1.0 / gains.rate_hz
    f, g, h = sampled_loop(a, b, c, d, lags, gains.sensor_lag_s, period)
    ac, bc, cc, dc = _law(gains, linear.trim, point, law, plane, lost)
    n, m = g.shape
    return Loop(
        f=np.block([[f, np.zeros((n, len(ac)))], [bc @ h, ac]]),
        g=np.vstack([g, np.zeros((len(ac), m))]),
        k=-np.hstack([dc @ h, cc]),
        period_s=period,
        growth_1_s=PILOT_CATCHES_1_S if law == "stick" or lost else 0.0,
    )


def _airframe(
    airframe: Airframe, linear: Linear, point: FlightPoint, plane: Plane
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return (A, B, C, D) with altitude or heading as a fifth state."""
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
    # n_z = V (q - alpha rate) / g, plus the effect of the pitch acceleration ahead of the centre of gravity.
    lever = airframe.accelerometer.x_m / GRAVITY
    c[5] = -trim.airspeed_m_s / GRAVITY * a[1] + lever * a[2]
    c[5, 2] += trim.airspeed_m_s / GRAVITY
    d[5] = -trim.airspeed_m_s / GRAVITY * b[1] + lever * b[2]
    return a, b, c, d


def _law(
    gains: Gains, trim: Trim, point: FlightPoint, law: Law, plane: Plane, lost: Sequence[str]
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return (A, B, C, D) of the law, x+ = A x + B y, u = C x + D y, by central differences of the kernel."""
    control, block = trimmed(gains, trim, point, law, lost)
    rest = control.state.copy()
    memory = MEMORY[law, plane]
    if lost:
        memory = (*_LOST_MEMORY[plane], *(f"measured.{INDEX[name]}" for name in lost))
    columns: list[Matrix] = []

    def difference(change: Matrix | None, name: str, size: float) -> Matrix:
        results = []
        for sign in (size, -size):
            control.state[:] = rest
            block["voted"][1] = block["voted"][0]
            if change is None:
                _slot(control, name)[0] += sign
            else:
                block["voted"][1] += sign * change
            control.step(block, 1)
            state = [float(_slot(control, field)[0]) for field in memory]
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


def _slot(control: Control, name: str) -> NDArray[np.float64]:
    """Return (1,) view of a field of the state, or of an element of one."""
    field, _, element = name.partition(".")
    return control.state[field][:, int(element)] if element else control.state[field]


def _step(name: str) -> float:
    if name == f"measured.{INDEX['static_pressure']}":
        return 1.0
    return 1.0 if "pressure" in name else 1e-2 if name.startswith(("altitude", "airspeed")) else 1e-5


def trimmed(gains: Gains, trim: Trim, point: FlightPoint, law: Law, lost: Sequence[str] = ()) -> tuple[Control, Block]:
    """Return a control stage in trimmed flight and its block of 2 rows, the second without the ``lost`` signals."""
    wide = [(-2.0, 2.0)] * len(SURFACES)
    control = Control(Config(source_fade_s=0.0), gains, gains.rate_hz, wide)
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
    block["voted"][1] = voted
    block["level"] = CHANNELS
    control.step(block, 0)
    if lost:
        block["level"][1, [INDEX[name] for name in lost]] = 0
        control.step(block, 1)
    return control, block
