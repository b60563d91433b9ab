"""Level flight by the rig's search: for propellers, and for the reason if JSBSim's trim finds none.

JSBSim's trim lets revolutions settle in steps of half a second, at which a powerful engine on a light propeller
stalls, and a governor never comes to rest.  Here the aircraft is held still while time advances in small
steps, until the revolutions rest.  Then level flight is a search along the throttle alone: with it open the
aircraft must gain speed, with it closed lose speed, and in between neither.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import jsbsim
import numpy as np
from numpy.typing import NDArray

from rig.world.plant.airframe import Config

Vector = NDArray[np.float64]

# What is searched at one throttle, in words, and the accelerations that it brings to nothing.
_UNKNOWNS: Final = (
    "ic/alpha-rad",
    "fcs/elevator-cmd-norm",
    "ic/phi-rad",
    "fcs/aileron-cmd-norm",
    "fcs/rudder-cmd-norm",
)
_WORDS: Final = ("stall: angle of attack", "elevator", "bank angle", "aileron", "rudder")
_RATES: Final = ("wdot-ft_sec2", "qdot-rad_sec2", "vdot-ft_sec2", "pdot-rad_sec2", "rdot-rad_sec2")
_STEP_RAD: Final = 1e-3
_LONGEST_RAD: Final = np.array([0.1, 0.2, 0.1, 0.2, 0.2])  # moved at once
_STEEPEST_BANK_RAD: Final = 0.35
_AT_REST: Final = 1e-5  # ft/s2 and rad/s2
_ENOUGH: Final = 0.01  # of the acceleration along the body: the rest need not be nearer, far from level flight
_NEARLY: Final = 1e-3  # the same, of a trim that is taken: what JSBSim's own leaves
_ITERATIONS: Final = 12
_THROTTLE_ITERATIONS: Final = 30
_ALPHAS: Final = 40  # at which the elevator is tried
_RUNS: Final = 50  # of JSBSim between two looks at revolutions and thrust
_LEAST_LOOKS, _MOST_LOOKS = 4, 120  # actuators need two seconds, revolutions at most a minute
_RESTS: Final = 1e-8  # change of both between two looks, relative
_INTEGRATORS: Final = [
    f"simulation/integrator/{what}/{kind}" for what in ("rate", "position") for kind in ("rotational", "translational")
]
_PAST_RATES: Final = 5  # that an integrator of JSBSim's keeps
_PROPAGATE: Final = "simulation/models/FGPropagate/enabled"


class NoLevel(Exception):
    """No level flight, with the reason; ``limit`` is the reason without figures."""

    def __init__(self, limit: str, figures: str = "") -> None:
        super().__init__(f"{limit}: {figures}" if figures else limit)
        self.limit = limit


@dataclass(frozen=True)
class Level:
    """Level flight: throttle 0 to 1, and ``_UNKNOWNS`` in rad."""

    throttle: float
    angles: Vector


def turns_propellers(fdm: jsbsim.FGFDMExec) -> bool:
    """Return True if the first engine drives a propeller."""
    return bool(fdm.get_property_manager().hasNode("propulsion/engine/propeller-rpm"))


def start(fdm: jsbsim.FGFDMExec) -> None:
    """Start every engine that does not run, its revolutions at idle."""
    propulsion = fdm.get_propulsion()
    for i in range(propulsion.get_num_engines()):
        if not fdm[f"propulsion/engine[{i}]/set-running"]:
            propulsion.get_engine(i).init_running()


def settle(fdm: jsbsim.FGFDMExec) -> None:
    """Evaluate the forces in JSBSim's initial state, with actuators, engines and revolutions of propellers at rest."""
    if not turns_propellers(fdm):
        evaluate(fdm)
        return
    start(fdm)
    fdm.run_ic()
    engines = range(fdm.get_propulsion().get_num_engines())
    names = [f"propulsion/engine[{i}]/{name}" for i in engines for name in ("propeller-rpm", "thrust-lbs")]
    fdm[_PROPAGATE] = 0.0
    before = np.full(len(names), np.inf)
    for look in range(_MOST_LOOKS):
        for _ in range(_RUNS):
            fdm.run()
        now = np.array([fdm[name] for name in names])
        if look >= _LEAST_LOOKS and np.all(np.abs(now - before) <= _RESTS * np.maximum(np.abs(now), 1.0)):
            break
        before = now
    fdm[_PROPAGATE] = 1.0
    fdm.set_sim_time(0.0)


def evaluate(fdm: jsbsim.FGFDMExec) -> None:
    """Evaluate the forces in JSBSim's initial state, actuators and turbines where they are led."""
    fdm.set_trim_status(True)
    fdm.run_ic()
    fdm.set_trim_status(False)


def fly(fdm: jsbsim.FGFDMExec, level: Level) -> None:
    """Put an initialised JSBSim into this level flight by the same steps each time, for the same bits."""
    _set(fdm, 1.0, level.angles)
    settle(fdm)
    _set(fdm, level.throttle, level.angles)
    settle(fdm)
    _remember_rest(fdm)


def _remember_rest(fdm: jsbsim.FGFDMExec) -> None:
    """Let JSBSim's integrators hold the rates of now as past ones.

    They hold those from before the engines settled; to begin again would set turboprops back to idle.
    """
    kept = {name: fdm[name] for name in _INTEGRATORS}
    for name in kept:
        fdm[name] = 0.0
    for _ in range(_PAST_RATES):
        fdm.run()
    for name, value in kept.items():
        fdm[name] = value
    fdm.set_sim_time(0.0)


def alpha_held(fdm: jsbsim.FGFDMExec, airframe: Config) -> float:
    """Return the angle of attack [rad] up to which full elevator pitches the nose down; inf beyond the limit.

    fdm : in level flight, which is gone afterwards
    """
    elevator, trim, most = airframe.elevator, fdm["aero/alpha-rad"], airframe.limits.angle_of_attack_max_rad

    def pitches(alpha_rad: float, elevator_rad: float) -> float:
        fdm["ic/alpha-rad"], fdm["fcs/elevator-cmd-norm"] = alpha_rad, elevator_rad
        fdm["ic/gamma-deg"] = 0.0
        evaluate(fdm)
        return float(fdm["accelerations/qdot-rad_sec2"])

    stop = min((elevator.min_rad, elevator.max_rad), key=lambda position: pitches(trim, position))
    tried = (float(alpha) for alpha in np.linspace(trim, most, _ALPHAS))
    return next((alpha for alpha in tried if pitches(alpha, stop) >= 0.0), np.inf)


def find(fdm: jsbsim.FGFDMExec, airframe: Config) -> Level:
    """Search level flight at JSBSim's initial speed and altitude; raise NoLevel with the reason if there is none."""
    search = _Search(fdm, airframe)
    open_gains = search.gains_speed(1.0)
    if open_gains < 0.0:
        raise _short_of_thrust(search, open_gains)
    closed_gains = search.gains_speed(0.0)
    if closed_gains > 0.0:
        raise NoLevel("throttle at its lower stop", "the aircraft accelerates with closed throttle")
    throttle = search.throttle(closed_gains, open_gains)
    if search.rest() > _NEARLY:
        raise search.at_stops() or NoLevel("no state at rest was found")
    return Level(throttle, search.angles)


def _short_of_thrust(search: _Search, gains: float) -> NoLevel:
    """Return why full throttle is not enough: a surface at its stop causes drag, or the engines give too little."""
    fdm = search.fdm
    thrust = fdm["forces/fbx-prop-lbs"]
    share = max(thrust, 0.0) / (thrust - gains * fdm["inertia/mass-slugs"])
    stopped = search.at_stops()
    return stopped or NoLevel("throttle at its stop", f"full throttle gives {share:.0%} of the required thrust")


class _Search:
    """The state of a search: angles that were found last, and how they move the accelerations."""

    def __init__(self, fdm: jsbsim.FGFDMExec, airframe: Config) -> None:
        self.fdm, limits = fdm, airframe.limits
        alphas = (limits.angle_of_attack_min_rad, limits.angle_of_attack_max_rad)
        surfaces = [(s.min_rad, s.max_rad) for s in (airframe.elevator, airframe.aileron, airframe.rudder)]
        stops = [alphas, surfaces[0], (-_STEEPEST_BANK_RAD, _STEEPEST_BANK_RAD), *surfaces[1:]]
        self._low, self._high = np.array(stops, np.float64).T
        self._moves: Vector | None = None  # what the angles do to the accelerations
        self._left = 0.0
        self.angles: Vector = np.clip(np.array([0.03, 0.0, 0.0, 0.0, 0.0]), self._low, self._high)

    def gains_speed(self, throttle: float) -> float:
        """Return the acceleration along the body at this throttle [ft/s2], all others brought to rest."""
        rates = self._rates(throttle, self.angles)
        if self._moves is None:
            columns = [(self._rates(throttle, self.angles + step) - rates) / _STEP_RAD for step in _STEPS]
            self._moves = np.array(columns).T
        moves = self._moves
        for _ in range(_ITERATIONS):
            if np.abs(rates).max() < max(_AT_REST, _ENOUGH * abs(self.fdm["accelerations/udot-ft_sec2"])):
                break
            step = np.clip(-np.linalg.lstsq(moves, rates, rcond=None)[0], -_LONGEST_RAD, _LONGEST_RAD)
            after: Vector = np.clip(self.angles + step, self._low, self._high)
            moved = after - self.angles
            if not moved.any():
                break
            now = self._rates(throttle, after)
            moves += np.outer(now - rates - moves @ moved, moved) / (moved @ moved)  # Broyden (1965)
            self.angles, rates = after, now
        self._left = np.abs(rates).max()
        return float(self.fdm["accelerations/udot-ft_sec2"])

    def throttle(self, low_gains: float, high_gains: float) -> float:
        """Return the throttle at which speed stays, by false position, halved where one end stands (Illinois)."""
        low, high, side = 0.0, 1.0, 0
        middle = high
        for _ in range(_THROTTLE_ITERATIONS):
            middle = (low * high_gains - high * low_gains) / (high_gains - low_gains)
            gains = self.gains_speed(middle)
            if abs(gains) < _AT_REST or high - low < 1e-12:
                break
            if gains > 0.0:
                high, high_gains, low_gains, side = middle, gains, low_gains / (2.0 if side == 1 else 1.0), 1
            else:
                low, low_gains, high_gains, side = middle, gains, high_gains / (2.0 if side == -1 else 1.0), -1
        return middle

    def rest(self) -> float:
        """Return the greatest acceleration that the last search left, ft/s2 or rad/s2."""
        return max(float(self._left), abs(float(self.fdm["accelerations/udot-ft_sec2"])))

    def at_stops(self) -> NoLevel | None:
        """Return which angle stands at its stop, the first in the order of ``_UNKNOWNS``; None: none does."""
        for word, x, low, high in zip(_WORDS, self.angles, self._low, self._high, strict=True):
            if not low < x < high:
                return NoLevel(f"{word} at its limit", f"{x:+.2f} rad")
        return None

    def _rates(self, throttle: float, angles: Vector) -> Vector:
        _set(self.fdm, throttle, angles)
        settle(self.fdm)
        return np.array([self.fdm[f"accelerations/{name}"] for name in _RATES])


_STEPS: Final[Vector] = _STEP_RAD * np.eye(len(_UNKNOWNS))


def _set(fdm: jsbsim.FGFDMExec, throttle: float, angles: Vector) -> None:
    fdm["fcs/throttle-cmd-norm"] = throttle
    for name, value in zip(_UNKNOWNS, angles, strict=True):
        fdm[name] = float(value)
    fdm["ic/gamma-deg"] = 0.0  # last: bank and angle of attack turn the velocity
