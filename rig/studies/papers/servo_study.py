"""The servo of one surface alone, beside the lags that it replaces.

The servo must follow a small step like a first-order lag, slightly later: spool and sub-step delay it.  A large step is
limited in rate.  Two models are common: the speed of the lag is limited (Stevens and Lewis, Aircraft Control and
Simulation, section 3.5), or a limit follows the lag (JSBSim's actuator), which lags once more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, Final

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from rig.computer.servo_monitors import monitors
from rig.core.errors import BadInput
from rig.core.frame import MOVED, second_rows
from rig.core.kernels import bind
from rig.core.text import choices, quoted
from rig.flight.put_out import move_surfaces
from rig.scenario.aircraft import own_tables
from rig.world.actuators.actuators_table import Config, refuse_unfit
from rig.world.actuators.servo import LONGEST_SUBSTEP_S
from rig.world.actuators.servo_stage import Actuators, stops_of
from rig.world.plant.airframe import Actuator, parse

Floats = NDArray[np.float64]
RATES_HZ: Final = (25.0, 50.0, 100.0, 200.0, 400.0, 1000.0)
FREQUENCIES_HZ: Final = (0.5, 1.0, 2.0, 4.0)
SMALL: Final = 0.5  # of the largest step without rate limiting
LONGEST_SHIFT_S: Final = 0.02  # that is looked for
_FINE: Final = 10  # steps of a lag in one of the servo's
_EXACT: Final = Config(
    model="servo",
    lvdt_bias_tolerance=0.0,
    lvdt_scale_tolerance=0.0,
    lvdt_noise_std=0.0,
    coil_tolerance=0.0,
    rate_tolerance=0.0,
    spool_tolerance=0.0,
)


@dataclass(frozen=True, slots=True)
class Response:
    """The response of one surface to a step at time 0, from the middle of its travel."""

    aircraft: str
    surface: str
    rate_hz: float
    step_rad: float
    time_s: Floats  # (n,) ends of sub-steps
    ram_rad: Floats  # (n,)
    limited_lag_rad: Floats  # (n,) lag whose speed is limited
    lag_then_limit_rad: Floats  # (n,) JSBSim's

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        arrays = {name: getattr(self, name).tolist() for name in ("time_s", "ram_rad", *_LAGS)}
        return {name: getattr(self, name) for name in ("aircraft", "surface", "rate_hz", "step_rad")} | arrays


_LAGS: Final = ("limited_lag_rad", "lag_then_limit_rad")


@dataclass(frozen=True, slots=True)
class Compared:
    """The servo beside the lags at one rate."""

    rate_hz: float
    shift_s: float  # by which the small step comes later than that of the lag
    small_step: float  # largest difference after that shift, of the step
    large_step_rad: float  # largest difference from the lag whose speed is limited, after the same shift
    large_step_jsbsim_rad: float  # from JSBSim's, after it too
    gain: tuple[float, ...]  # over the lag's, at FREQUENCIES_HZ
    delay_s: tuple[float, ...]  # behind the lag, at FREQUENCIES_HZ


def surface_of(aircraft: str, name: str) -> Actuator:
    """Return a surface's actuator.  BadInput: an unknown aircraft or surface, or one that no servo can move."""
    if name not in MOVED:
        raise BadInput(f"--surface: no servo moves {quoted(name)}, {choices(name, MOVED)}")
    airframe = parse(own_tables(aircraft)["airframe"], f"aircraft {aircraft}")
    try:
        refuse_unfit(_EXACT, airframe)
    except ValueError as error:
        raise BadInput(f"aircraft {aircraft}: {error}") from None
    return getattr(airframe, name)


def step_response(aircraft: str, surface: str, rate_hz: float, step_rad: float, duration_s: float = 1.0) -> Response:
    """Return the response to a step, rad, at ``rate_hz`` frames a second.  BadInput as ``surface_of``."""
    actuator = surface_of(aircraft, surface)
    time_s, ram = _move(actuator, rate_hz, duration_s, lambda time_s: np.full(len(time_s), step_rad))
    limited, behind = limited_lag(actuator, time_s, step_rad), lag_then_limit(actuator, time_s, step_rad)
    return Response(aircraft, surface, rate_hz, step_rad, time_s, ram, limited, behind)


def compare(aircraft: str, surface: str, rates_hz: Sequence[float] = RATES_HZ) -> list[Compared]:
    """Return the servo beside the lags at each of ``rates_hz``."""
    actuator = surface_of(aircraft, surface)
    small = SMALL * actuator.lag_s * actuator.rate_limit_rad_s
    large = 0.9 * min(actuator.max_rad, -actuator.min_rad)
    sizes = small, large
    return [_compared(actuator, *(step_response(aircraft, surface, hz, size) for size in sizes)) for hz in rates_hz]


def _compared(actuator: Actuator, small: Response, large: Response) -> Compared:
    shift, off = _shifted(small)
    later = [np.interp(large.time_s - shift, large.time_s, getattr(large, name), left=0.0) for name in _LAGS]
    limited, behind = (float(np.abs(large.ram_rad - lag).max()) for lag in later)
    answers = [frequency_response(actuator, small.rate_hz, hz) for hz in FREQUENCIES_HZ]
    gains, delays = zip(*answers, strict=True)
    return Compared(small.rate_hz, shift, off / small.step_rad, limited, behind, gains, delays)


def _shifted(small: Response) -> tuple[float, float]:
    """Return the shift of the lag, s, with the smallest largest difference, and that difference, rad."""
    times, lag = small.time_s, small.limited_lag_rad

    def off(shift: float) -> float:
        return float(np.abs(small.ram_rad - np.interp(times - shift, times, lag, left=0.0)).max())

    found: Any = minimize_scalar(off, bounds=(0.0, LONGEST_SHIFT_S), method="bounded")
    return float(found.x), float(found.fun)


def frequency_response(actuator: Actuator, rate_hz: float, frequency_hz: float) -> tuple[float, float]:
    """Return gain relative to the lag and delay behind it, s, for a sine below the rate limit, held by frames."""
    size = SMALL * min(actuator.lag_s, 1.0 / (2.0 * pi * frequency_hz)) * actuator.rate_limit_rad_s
    cycles = max(3.0, np.ceil(5.0 * actuator.lag_s * frequency_hz) + 2.0)
    turn = 2.0 * pi * frequency_hz

    def asked(time_s: Floats) -> Floats:
        return size * np.sin(turn * time_s)

    time_s, ram = _move(actuator, rate_hz, cycles / frequency_hz, asked)
    last = time_s > (cycles - 1.0) / frequency_hz
    basis = np.column_stack([np.sin(turn * time_s[last]), np.cos(turn * time_s[last])])
    in_phase, quadrature = np.linalg.lstsq(basis, ram[last], rcond=None)[0] / size
    over = complex(in_phase, quadrature) * complex(1.0, turn * actuator.lag_s)
    held_s = 0.5 / rate_hz  # the delay of any actuator by holding a command for a frame
    return abs(over), -float(np.angle(over)) / turn - held_s


def limited_lag(actuator: Actuator, time_s: Floats, step_rad: float) -> Floats:
    """Return the exact response of a lag whose speed is limited: the limit, then the lag alone."""
    t, speed = actuator.lag_s, actuator.rate_limit_rad_s
    ramp_s = max(0.0, step_rad / speed - t)
    left = min(step_rad, speed * t)
    return np.where(time_s < ramp_s, speed * time_s, step_rad - left * np.exp(-np.maximum(time_s - ramp_s, 0.0) / t))


def lag_then_limit(actuator: Actuator, time_s: Floats, step_rad: float) -> Floats:
    """Return the response of a rate limit behind a lag, in steps of a tenth of those of ``time_s``."""
    t, speed, step_s = actuator.lag_s, actuator.rate_limit_rad_s, float(time_s[0]) / _FINE
    wanted = step_rad * (1.0 - np.exp(-step_s * np.arange(1, len(time_s) * _FINE + 1) / t))
    y, found = 0.0, np.empty(len(wanted))
    for k, x in enumerate(wanted):
        y += min(max(x - y, -speed * step_s), speed * step_s)
        found[k] = y
    return found[_FINE - 1 :: _FINE]


def _move(
    actuator: Actuator, rate_hz: float, duration_s: float, asked_rad: Callable[[Floats], Floats]
) -> tuple[Floats, Floats]:
    """Return times and ram at the ends of all sub-steps; ``asked_rad``: commands at the starts of frames."""
    parts = max(1, int(np.ceil(1.0 / (rate_hz * LONGEST_SUBSTEP_S) - 1e-9)))
    frames = int(np.ceil(duration_s * rate_hz))
    surfaces = dict.fromkeys(MOVED, actuator)
    watch = monitors(_EXACT, stops_of(surfaces), rate_hz)
    servos = Actuators(_EXACT, surfaces, np.zeros(3), rate_hz, parts, SeedSequence(0), watch)
    servos.prepare(second_rows(frames)["servo"])
    asked, moved, ram = asked_rad(np.arange(frames) / rate_hz), np.zeros(4), np.empty((frames, parts))
    step = bind(move_surfaces, servos.data.asked, moved, 0, servos.data)
    for k in range(frames):
        servos.data.asked[:, :3] = asked[k]
        step(servos.data.asked, moved, k, servos.data)
        ram[k] = servos.data.positions[:, 0]
    return np.arange(1, frames * parts + 1) / (rate_hz * parts), ram.ravel()
