"""The linearised aircraft at one flight point: small motions about level, trimmed flight.

Longitudinal states (airspeed m/s, alpha, q, theta), inputs (elevator rad, throttle 0 to 1);
lateral states (beta, p, r, phi), inputs (aileron rad, rudder rad).  Inputs are surface positions:
actuators are no part of this model, and thrust follows the throttle at once.

The system matrix is JSBSim's own; the input matrix is taken by central differences, because
JSBSim's has wrong force rows when an actuator lags.  A linear aircraft brings its matrices itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Final

import jsbsim
import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import SURFACES
from rig.core.units.atmosphere import density, speed_of_sound
from rig.world.plant.airframe import OUTPUTS, Airframe, Config, FlightPoint, LinearConfig
from rig.world.plant.imperial import METRES_PER_FOOT, PASCALS_PER_PSF_OF_GAINS
from rig.world.plant.level import evaluate, settle, turns_propellers
from rig.world.plant.linear_plant import matrices
from rig.world.plant.loading import load

Matrix = NDArray[np.float64]

LONGITUDINAL: Final = ("Vt", "Alpha", "Q", "Theta")  # as JSBSim names them
LATERAL: Final = ("Beta", "P", "R", "Phi")
# Of what is commanded, for central differences: rad, the throttle 0 to 1.
_STEPS: Final = {"elevator": 1e-3, "throttle": 5e-3, "aileron": 1e-3, "rudder": 1e-3}
_STATE_STEPS: Final = (1.0, *[1e-3] * 7)  # of the states: ft/s, rad, rad/s
_ANY_STEP_S: Final = 0.01  # JSBSim's step; no part of a linearisation


@dataclass(frozen=True)
class Trim:
    """Level, trimmed flight at one flight point."""

    airspeed_m_s: float
    dynamic_pressure_pa: float
    alpha_rad: float
    theta_rad: float
    elevator_rad: float
    aileron_rad: float
    rudder_rad: float
    throttle: float


@dataclass(frozen=True)
class Linear:
    """dx/dt = A x + B u for both planes, about ``trim``; states and inputs as in the module's docstring.

    An aircraft that only moves up and down has zeros in its lateral matrices.
    """

    trim: Trim
    longitudinal_a: Matrix  # (4, 4)
    longitudinal_b: Matrix  # (4, 2)
    lateral_a: Matrix  # (4, 4)
    lateral_b: Matrix  # (4, 2)

    @property
    def rolls(self) -> bool:
        """True if aileron and rudder move the aircraft at all."""
        return bool(self.lateral_b.any())


def linearise(airframe: Airframe, flight_point: FlightPoint) -> Linear:
    """Return the small motions of ``airframe`` about trim at ``flight_point``; BadInput: it does not trim."""
    if isinstance(airframe, LinearConfig):
        return _given(airframe, flight_point)
    fdm = load(airframe, flight_point, _ANY_STEP_S)
    longitudinal_a, lateral_a = _differenced(fdm) if turns_propellers(fdm) else _system(fdm)
    fdm = load(airframe, flight_point, _ANY_STEP_S)
    trim = trim_of(fdm, airframe)
    for name in ("aero/alpha-rad", "aero/beta-rad", "attitude/theta-rad", "attitude/phi-rad"):
        fdm[f"ic/{name.partition('/')[2]}"] = fdm[name]  # so that the forces are evaluated in the trimmed state
    elevator, throttle, aileron, rudder = (_difference(fdm, airframe, *moved) for moved in _STEPS.items())
    longitudinal_b, lateral_b = np.array([elevator[:4], throttle[:4]]).T, np.array([aileron[4:], rudder[4:]]).T
    return Linear(trim, longitudinal_a, longitudinal_b, lateral_a, lateral_b)


def trimmed(airframe: Config, flight_point: FlightPoint) -> Trim:
    """Trim level flight at ``flight_point``, nothing linearised; BadInput when it does not trim."""
    return trim_of(load(airframe, flight_point, _ANY_STEP_S), airframe)


def _given(airframe: LinearConfig, point: FlightPoint) -> Linear:
    """Return a linear aircraft's own matrices, its outputs as the states: A' = C A C^-1, B' = C B."""
    a, b, c = matrices(airframe)
    named = [OUTPUTS.index(name) for name in airframe.model.outputs]
    c = c[named]
    if c.shape[0] != c.shape[1] or np.linalg.matrix_rank(c) < len(c):
        raise BadInput(f"airframe.model: {airframe.base_model}: C must be square and regular for a design")
    system, drive = np.zeros((len(OUTPUTS), len(OUTPUTS))), np.zeros((len(OUTPUTS), len(SURFACES)))
    system[np.ix_(named, named)], drive[named] = c @ a @ np.linalg.inv(c), c @ b
    speed = point.mach * speed_of_sound(point.altitude_m)
    trim = airframe.trim
    return Linear(
        trim=Trim(
            airspeed_m_s=speed,
            dynamic_pressure_pa=0.5 * density(point.altitude_m) * speed**2,
            alpha_rad=trim.pitch_angle_rad,
            theta_rad=trim.pitch_angle_rad,
            elevator_rad=trim.elevator_rad,
            aileron_rad=0.0,
            rudder_rad=0.0,
            throttle=trim.throttle,
        ),
        longitudinal_a=system[:4, :4],
        longitudinal_b=drive[:4][:, [0, 3]],
        lateral_a=system[4:, 4:],
        lateral_b=drive[4:, 1:3],
    )


def _system(fdm: jsbsim.FGFDMExec) -> tuple[Matrix, Matrix]:
    model = jsbsim.FGLinearization(fdm)
    a, names = np.array(model.system_matrix), list(model.x_names)
    longitudinal, lateral = ([names.index(name) for name in of] for of in (LONGITUDINAL, LATERAL))
    scale = np.array([METRES_PER_FOOT, 1.0, 1.0, 1.0])
    return a[np.ix_(longitudinal, longitudinal)] * scale[:, None] / scale, a[np.ix_(lateral, lateral)]


def _differenced(fdm: jsbsim.FGFDMExec) -> tuple[Matrix, Matrix]:
    """Difference the system centrally, revolutions settled: JSBSim may search those of a propeller a minute."""
    rest = _states(fdm)
    columns: list[Matrix] = []
    for i, step in enumerate(_STATE_STEPS):
        rates = []
        for sign in (1.0, -1.0):
            _set_states(fdm, rest + sign * step * np.eye(len(rest))[i])
            rates.append(_rates(fdm))
        columns.append((rates[0] - rates[1]) / (2.0 * step))
    columns[0] *= 1.0 / METRES_PER_FOOT  # rates are SI already, the first column is by ft/s
    system = np.array(columns).T
    return system[:4, :4], system[4:, 4:]


def _states(fdm: jsbsim.FGFDMExec) -> Matrix:
    """Return (8,) true airspeed [ft/s], alpha, q, theta, beta, p, r, phi."""
    names = ("velocities/vt-fps", "aero/alpha-rad", "velocities/q-rad_sec", "attitude/theta-rad")
    names += ("aero/beta-rad", "velocities/p-rad_sec", "velocities/r-rad_sec", "attitude/phi-rad")
    return np.array([fdm[name] for name in names])


def _set_states(fdm: jsbsim.FGFDMExec, states: Matrix) -> None:
    """Evaluate the forces in these states: attitude first, which keeps the velocity in body axes."""
    speed, alpha, q, theta, beta, p, r, phi = (float(x) for x in states)
    fdm["ic/theta-rad"], fdm["ic/phi-rad"] = theta, phi
    fdm["ic/u-fps"] = speed * cos(alpha) * cos(beta)
    fdm["ic/v-fps"] = speed * sin(beta)
    fdm["ic/w-fps"] = speed * sin(alpha) * cos(beta)
    fdm["ic/p-rad_sec"], fdm["ic/q-rad_sec"], fdm["ic/r-rad_sec"] = p, q, r
    settle(fdm)


def trim_of(fdm: jsbsim.FGFDMExec, airframe: Config) -> Trim:
    """Return the level flight that ``fdm`` is trimmed in."""
    return Trim(
        airspeed_m_s=fdm["velocities/vt-fps"] * METRES_PER_FOOT,
        dynamic_pressure_pa=fdm["aero/qbar-psf"] * PASCALS_PER_PSF_OF_GAINS,
        alpha_rad=fdm["aero/alpha-rad"],
        theta_rad=fdm["attitude/theta-rad"],
        elevator_rad=fdm[airframe.elevator.position],
        aileron_rad=fdm[airframe.aileron.position],
        rudder_rad=fdm[airframe.rudder.position],
        throttle=fdm["fcs/throttle-cmd-norm"],
    )


def _difference(fdm: jsbsim.FGFDMExec, airframe: Config, command: str, step: float) -> Matrix:
    """Return (8,) derivative of the state rates by the position that ``command`` moves."""
    name = f"fcs/{command}-cmd-norm"
    position = name if command == "throttle" else getattr(airframe, command).position
    rest = fdm[name]
    rates, positions = [], []
    for sign in (1.0, -1.0):
        fdm[name] = rest + sign * step
        if command == "throttle":
            settle(fdm)  # revolutions are a state of their own, they follow now
        else:
            evaluate(fdm)
        rates.append(_rates(fdm))
        positions.append(fdm[position])
    fdm[name] = rest
    return (rates[0] - rates[1]) / (positions[0] - positions[1])


def _rates(fdm: jsbsim.FGFDMExec) -> Matrix:
    """Return (8,) rates of the longitudinal and the lateral states."""
    u, v, w = (fdm[f"velocities/{axis}-aero-fps"] for axis in "uvw")
    du, dv, dw = (fdm[f"accelerations/{axis}dot-ft_sec2"] for axis in "uvw")
    speed = np.sqrt(u * u + v * v + w * w)
    return np.array(
        [
            (u * du + v * dv + w * dw) / speed * METRES_PER_FOOT,
            fdm["aero/alphadot-rad_sec"],
            fdm["accelerations/qdot-rad_sec2"],
            fdm["velocities/thetadot-rad_sec"],
            fdm["aero/betadot-rad_sec"],
            fdm["accelerations/pdot-rad_sec2"],
            fdm["accelerations/rdot-rad_sec2"],
            fdm["velocities/phidot-rad_sec"],
        ]
    )
