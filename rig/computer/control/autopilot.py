"""The control stage: voted signals in, surface positions out, one kernel call a frame.

With the discrete ``autopilot_engaged`` voted 1 the autopilot holds pitch or altitude, roll or
heading, and airspeed, about the values captured at engagement plus the autopilot commands of the frame.
With 0 the sticks command pitch rate, roll rate and sideslip, and the throttle stays where it is.

Signs: stick_pitch + pulls (nose up), stick_roll + rolls right, pedal + is the right pedal (nose
right, so a negative sideslip).  Surfaces are absolute positions in the signs of ``frame.SURFACES``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from rig.computer.control.gains_file import COLUMNS, Gains
from rig.computer.control.law import control_law
from rig.computer.control.law_state import STATE, ControlData
from rig.computer.control.modes import LATERAL, LAWS, SPEED, VERTICAL, Lateral, LawName, Speed, Vertical, names
from rig.computer.fdi.pitch_test_state import STATE as FDI_STATE
from rig.computer.fdi.pitch_test_state import Config as Tolerant
from rig.computer.fdi.pitch_test_state import parameters as fdi_parameters
from rig.core.frame import SURFACES, Block, nested
from rig.core.kept import kept
from rig.core.settings import Settings, numbers, record, share_in_frame


class Config(Settings):
    """The ``[control]`` table of a scenario: what the autopilot holds and how hard it may fly."""

    law: LawName = "autopilot"  # these four: modes.py
    vertical: Vertical = "altitude"
    lateral: Lateral = "heading"
    speed: Speed = "airspeed"
    max_bank_rad: float = Field(default=0.5236, gt=0.0, le=1.05)
    max_climb_angle_rad: float = Field(default=0.0873, gt=0.0, le=0.35)
    max_load_factor_change: float = Field(default=0.5, gt=0.0, le=3.0)  # by the autopilot, from level flight
    schedule_filter_s: float = Field(default=2.0, gt=0.0)  # on the dynamic pressure that selects gains
    airspeed_filter_s: float = Field(default=0.5, gt=0.0)
    climb_crossover_rad_s: float = Field(default=0.4, gt=0.0)  # below it barometric, above it inertial
    max_yaw_correction_rad_s: float = Field(default=0.02, ge=0.0)  # of the heading hold, by rudder
    gear_down_max_bank_rad: float = Field(default=0.4363, gt=0.0, le=1.05)  # by the autopilot, with the gear down
    gear_down_max_load_factor: float = Field(default=2.0, gt=1.0)  # with the gear down, by stick too
    gear_down_min_load_factor: float = Field(default=0.0, lt=1.0)
    source_fade_s: float = Field(default=0.5, ge=0.0)  # when a signal's source changes
    rates_from_attitude: bool = True  # when a body rate and its reference are lost; else the back-up law flies
    attitude_filter_s: float = Field(default=0.01, gt=0.0)  # on attitudes that become rates
    rate_bandwidth_rad_s: float = Field(default=12.0, gt=0.0)  # of the estimate of a rate that is not measured
    attitude_erection_s: float = Field(default=5.0, gt=0.0)  # of an attitude that is integrated from rates
    learning_s: float = Field(default=60.0, gt=0.0)  # of what substitutes for lost signals are wrong by
    backup_load_factor_change: float = Field(default=1.0, gt=0.0, le=3.0)  # by the back-up law, from a level turn
    backup_path_rad_s: float = Field(default=0.2, gt=0.0)  # bandwidth at which it holds altitude
    tolerant: Tolerant = Tolerant()

    @property
    def tested(self) -> tuple[str, ...]:
        """Signals whose common faults the law finds by itself."""
        return LAWS[names(LAWS).index(self.law)].tested


PARAM: Final = np.dtype(
    [
        ("dt", "f8"),
        *numbers(Config),
        ("max_load_factor", "f8"),  # these three of Gains
        ("min_load_factor", "f8"),
        ("max_alpha_rad", "f8"),
        ("schedule_share", "f8"),  # of a new sample that passes the filter in one frame
        ("airspeed_share", "f8"),
        ("learning_share", "f8"),  # of what a substitute is wrong by, learned in one frame while it is not needed
        ("gear_max_bank_rad", "f8"),  # with the gear down
        ("gear_max_load_factor", "f8"),
        ("gear_min_load_factor", "f8"),
        ("lag_s", "f8", (3,)),  # of elevator, aileron and rudder
        ("fade_frames", "i8"),
        ("low", "f8", (len(SURFACES),)),
        ("high", "f8", (len(SURFACES),)),
        ("vertical", "i8"),  # places in the tables of modes.py
        ("lateral", "i8"),
        ("speed", "i8"),
        ("still", "u1", (len(SURFACES),)),  # surfaces that no servo channel moves: no integrator runs
    ],
    align=True,
)


class Control:
    """Voted signals to surface positions.

    config, gains   how to fly, and the aircraft's designed numbers
    rate_hz         frames per second
    surface_limits  (low, high) of each of ``frame.SURFACES``
    ``state`` and ``param`` are plain record arrays; copying ``state`` (and ``fdi``, the fault-tolerant
    law's) copies the stage.
    """

    def __init__(
        self, config: Config, gains: Gains, rate_hz: float, surface_limits: Sequence[tuple[float, float]]
    ) -> None:
        limits = [limit for surface in surface_limits for limit in surface]
        self.param: NDArray[Any] = _parameters(config, gains, rate_hz, *map(float, limits)).copy()
        self.pressures, self.table = (part.copy() for part in _table(gains))
        self.gain = np.zeros(len(COLUMNS))
        self.state: NDArray[Any] = np.zeros(1, STATE)
        self.fdi_param = _fdi_parameters(config.tolerant, names(LAWS).index(config.law) != 0, rate_hz).copy()
        self.fdi: NDArray[Any] = np.zeros(1, FDI_STATE)
        self.reset(np.zeros(len(SURFACES)))

    def reset(self, trim_surfaces: ArrayLike) -> None:
        """Forget the flight; the first output will be ``trim_surfaces``, (4,) in the order of SURFACES."""
        self.state[:] = np.zeros(1, STATE)
        self.fdi[:] = np.zeros(1, FDI_STATE)
        self.state["measured"] = np.nan
        self.state["surface"] = np.clip(trim_surfaces, self.param["low"][0], self.param["high"][0])

    @property
    def data(self) -> ControlData:
        """Data of ``control_law`` besides the row."""
        fdi = (self.fdi_param, self.fdi)
        return ControlData(self.pressures, self.table, self.param, self.state, self.gain, *fdi)

    def step(self, block: Block, k: int) -> None:
        """Write what ``control_law`` writes of row ``k`` from its voted signals and autopilot commands."""
        row = nested(block)[k]
        control_law(row["bus"], row["fcc"], self.data)


_fdi_parameters = kept(fdi_parameters)


@kept
def _table(gains: Gains) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return gains.table()


@kept
def _parameters(config: Config, gains: Gains, rate_hz: float, *limits: float) -> NDArray[Any]:
    """Return the (1,) PARAM record; limits : low and high of each surface in turn."""
    low, high = np.reshape(limits, (-1, 2)).T
    return record(
        PARAM,
        config,
        gains,
        dt=1.0 / rate_hz,
        schedule_share=share_in_frame(config.schedule_filter_s, rate_hz),
        airspeed_share=share_in_frame(config.airspeed_filter_s, rate_hz),
        learning_share=share_in_frame(config.learning_s, rate_hz),
        gear_max_bank_rad=min(config.max_bank_rad, config.gear_down_max_bank_rad),
        gear_max_load_factor=min(gains.max_load_factor, config.gear_down_max_load_factor),
        gear_min_load_factor=max(gains.min_load_factor, config.gear_down_min_load_factor),
        fade_frames=round(config.source_fade_s * rate_hz),
        lag_s=(gains.elevator_lag_s, gains.aileron_lag_s, gains.rudder_lag_s),
        low=low,
        high=high,
        vertical=names(VERTICAL).index(config.vertical),
        lateral=names(LATERAL).index(config.lateral),
        speed=names(SPEED).index(config.speed),
        still=np.zeros(len(SURFACES)),
    )
