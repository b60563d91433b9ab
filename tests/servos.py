"""One set of servo actuators without an aircraft, moved frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.computer.servo_monitors import monitors
from rig.core.frame import MOVED, second_rows
from rig.core.kernels import bind
from rig.flight.put_out import move_surfaces
from rig.world.actuators.actuators_table import Config
from rig.world.actuators.servo_stage import ActuatorData, Actuators, stops_of
from rig.world.plant.airframe import Actuator

LAG_S, RATE_LIMIT, STOP = 0.05, 1.0, 0.4
SURFACE = Actuator(lag_s=LAG_S, rate_limit_rad_s=RATE_LIMIT, min_rad=-STOP, max_rad=STOP)
EXACT: dict[str, Any] = dict.fromkeys(
    (
        "lvdt_bias_tolerance",
        "lvdt_scale_tolerance",
        "lvdt_noise_std",
        "coil_tolerance",
        "rate_tolerance",
        "spool_tolerance",
    ),
    0.0,
)
Broken = Callable[[ActuatorData, int], None]


def moved(
    asked: NDArray[np.float64] | list[float],
    broken: Broken | None = None,
    rate_hz: float = 100.0,
    trim: float = 0.0,
    seed: int = 0,
    **settings: Any,
) -> NDArray[Any]:
    """The records (n, 3) SERVO of all frames; every surface is asked for ``asked`` (n,), rad."""
    config = Config(model="servo", **(EXACT | settings))
    surfaces = dict.fromkeys(MOVED, SURFACE)
    watch = monitors(config, stops_of(surfaces), rate_hz)
    servos = Actuators(config, surfaces, np.full(3, trim), rate_hz, 1, SeedSequence(seed), watch)
    servos.prepare(second_rows(len(asked))["servo"])
    by_channel, out = servos.data.asked, np.zeros(4)
    step = bind(move_surfaces, by_channel, out, 0, servos.data)
    for k, wanted in enumerate(asked):
        if broken is not None:
            broken(servos.data, k)
        by_channel[:, :3] = wanted
        step(by_channel, out, k, servos.data)
    return servos.data.rows.copy()
