"""The servo actuators of a flight: their drawn parts, their state, and one frame of all three."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, MOVED, SURFACES, SYSTEMS, second_rows
from rig.core.kernels import clamp, kernel
from rig.world.actuators.actuators_table import Config
from rig.world.actuators.servo import RAM, SERVO, SPOOL, asked_current, move_ram, move_spool, substeps, transition
from rig.world.faults.servo_parts import Part, whole_parts
from rig.world.plant.airframe import Actuator

# Errors of one surface's parts, and where everything stands.
PARTS: Final = np.dtype(
    [
        ("lvdt_bias", "f8", (CHANNELS,)),  # rad
        ("lvdt_scale", "f8", (CHANNELS,)),  # about the middle of the stroke
        ("lvdt_noise", "f8"),  # rad, standard deviation
        ("coil", "f8", (CHANNELS,)),  # current a current asked for
        ("middle", "f8"),  # of the stroke, rad
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("moves", "f8", (3,)),  # servo.SPOOL, SPEED, RAM
        ("model", "f8", (CHANNELS, 3)),  # the same of models: on the channel's command and the pressures,
        ("valve_model", "f8", (CHANNELS, 3)),  # and on the channel's current
        ("shut", "u1", (CHANNELS,)),  # where the shut-off valves are
        ("stuck_at", "f8", (CHANNELS,)),  # position sensors, rad; NaN: they move
        # In this frame, current = limit(coil limit(gain (asked - slope ram - shift), 1) + driven, 1).
        ("slope", "f8", (CHANNELS,)),
        ("shift", "f8", (CHANNELS,)),  # rad
        ("coil", "f8", (CHANNELS,)),
        ("driven", "f8", (CHANNELS,)),
        ("current", "f8", (CHANNELS,)),  # in this sub-step
    ],
    align=True,
)


class ActuatorData(NamedTuple):
    """Data of the servos besides the row, one record a surface unless stated otherwise."""

    built: NDArray[Any]  # (3,) SERVO, as they are
    designed: NDArray[Any]  # (3,) SERVO, as the monitors' models hold them to be
    parts: NDArray[Any]  # (3,) PARTS
    broken: NDArray[np.float64]  # (3, Part, 4) in this frame, in place
    whole: NDArray[np.float64]  # the same with nothing broken
    state: NDArray[Any]  # (3,) STATE, in place
    monitors: Any
    noise: NDArray[np.float32]  # (n, 3, 4) of a block's rows, standard normal
    rows: NDArray[Any]  # (n, 3) SERVO of a block's rows
    asked: NDArray[np.float64]  # (4, 4) workspace: what each channel is asked for, surface by surface
    off: NDArray[np.uint8]  # (4,) channels that their computers shut off
    positions: NDArray[np.float64]  # (steps, 3) rad, for each step of the plant in this frame
    substeps: int  # of a step of the plant


class Actuators:
    """The servos at their first frame, in trimmed flight; ``seeds`` gives their parts and their sensors' noise."""

    def __init__(
        self,
        config: Config,
        surfaces: Mapping[str, Actuator],
        trim_rad: NDArray[np.float64],
        rate_hz: float,
        steps_per_frame: int,
        seeds: SeedSequence,
        monitors: tuple[Any, ...],
    ) -> None:
        """surfaces : by the names of MOVED; trim_rad : (3,) where they stand; monitors : MonitorData."""
        # The order is part of every recorded flight: append, never insert.
        calibration, self._noise_rng = map(np.random.default_rng, seeds.spawn(2))
        step_s = 1.0 / (rate_hz * steps_per_frame)
        count = substeps(step_s)
        built, designed, parts = _draw(config, surfaces, step_s / count, calibration)
        state = np.zeros(len(MOVED), STATE)
        state["moves"][:, RAM], state["model"][:, :, RAM], state["stuck_at"] = trim_rad, trim_rad[:, None], np.nan
        self.data = ActuatorData(
            built=built,
            designed=designed,
            parts=parts,
            broken=whole_parts(),
            whole=whole_parts(),
            state=state,
            monitors=monitors,
            noise=np.zeros((0, len(MOVED), CHANNELS), np.float32),
            rows=second_rows(2)["servo"],  # of two: of one the view would count as contiguous
            asked=np.zeros((CHANNELS, len(SURFACES))),
            off=np.zeros(CHANNELS, np.uint8),
            positions=np.tile(trim_rad, (steps_per_frame, 1)),
            substeps=count,
        )

    def prepare(self, rows: NDArray[Any]) -> None:
        """Take the next rows to write, (n, 3) SERVO, and draw their noise, whose stream is the same for any n."""
        noise = self._noise_rng.standard_normal((len(rows), len(MOVED), CHANNELS), np.float32)
        self.data = self.data._replace(noise=noise, rows=rows)


def _draw(
    config: Config, surfaces: Mapping[str, Actuator], substep_s: float, rng: Generator
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return (3,) SERVO as built and as designed, and (3,) PARTS; all errors are drawn, whatever their tolerance."""
    designed, parts = as_designed(config, surfaces, substep_s), np.zeros(len(MOVED), PARTS)
    built = designed.copy()
    for servo, part in zip(built, parts, strict=True):
        stroke = servo["high"] - servo["low"]
        bias, scale, coil, (rate, frequency, damping, _) = rng.uniform(-1.0, 1.0, (4, CHANNELS))
        spool_rad_s = config.spool_rad_s * (1 + config.spool_tolerance * frequency)
        spool_damping = config.spool_damping * (1 + config.spool_tolerance * damping)
        servo["transition"] = transition(spool_rad_s, spool_damping, substep_s).ravel()
        servo["rate_limit"] *= 1 + config.rate_tolerance * rate
        part["lvdt_bias"] = config.lvdt_bias_tolerance * stroke * bias
        part["lvdt_scale"] = config.lvdt_scale_tolerance * scale
        part["lvdt_noise"], part["middle"] = config.lvdt_noise_std * stroke, (servo["low"] + servo["high"]) / 2
        part["coil"] = 1 + config.coil_tolerance * coil
    return built, designed, parts


def as_designed(config: Config, surfaces: Mapping[str, Actuator], substep_s: float) -> NDArray[Any]:
    """Return (3,) SERVO without any tolerance; surfaces : by the names of MOVED."""
    designed = np.zeros(len(MOVED), SERVO)
    for row, name in zip(designed, MOVED, strict=True):
        surface = surfaces[name]
        row["gain"] = 1.0 / (surface.lag_s * surface.rate_limit_rad_s)
        row["rate_limit"], row["substep_s"] = surface.rate_limit_rad_s, substep_s
        row["low"], row["high"] = surface.min_rad, surface.max_rad
        row["bypass_share"], row["bypass_rad"] = 1.0 - exp(-substep_s / config.bypass_s), config.bypass_rad
        row["transition"] = transition(config.spool_rad_s, config.spool_damping, substep_s).ravel()
    return designed


def stops_of(surfaces: Mapping[str, Actuator]) -> NDArray[np.float64]:
    """Return (3, 2) of each surface, rad."""
    return np.array([(surfaces[name].min_rad, surfaces[name].max_rad) for name in MOVED])


@kernel
def shift_positions(actuator, k, data):
    """Move all positions of the frame by what a fault behind the actuators has added to the last; (4,) ``actuator``."""
    for i in range(len(data.state)):
        added = actuator[i] - data.rows[k, i]["ram"]
        for step in range(len(data.positions)):
            data.positions[step, i] += added


@kernel
def wire(i, noise, data):
    """Find how the sensors of surface ``i`` see its ram and its coils answer in this frame: slope, shift, coil, driven.

    noise : (4,) standard normal
    """
    state, parts, broken = data.state[i], data.parts[i], data.broken[i]
    slope, shift, coil, driven, stuck_at = (
        state["slope"], state["shift"], state["coil"], state["driven"], state["stuck_at"]
    )  # fmt: skip
    for c in range(CHANNELS):
        if broken[Part.STUCK, c] == 0.0:
            stuck_at[c] = np.nan
        elif stuck_at[c] != stuck_at[c]:
            stuck_at[c] = slope[c] * state["moves"][RAM] + shift[c]  # as in the frame before
        scale, factor = parts["lvdt_scale"][c], broken[Part.FACTOR, c]
        bias = parts["lvdt_bias"][c] - scale * parts["middle"] + parts["lvdt_noise"] * noise[c]
        slope[c], shift[c] = factor * (1.0 + scale), factor * bias + broken[Part.OFFSET, c]
        if stuck_at[c] == stuck_at[c]:
            slope[c], shift[c] = 0.0, stuck_at[c]
        coil[c], driven[c] = broken[Part.COMMANDED, c] * parts["coil"][c], broken[Part.ADDED, c]


@kernel
def sense(row, i, data):
    """Write what the channels of surface ``i`` measure at the beginning of the frame."""
    state, broken, servo = data.state[i], data.broken[i], data.built[i]
    moves, models, valve_models, shut = state["moves"], state["model"], state["valve_model"], state["shut"]
    lvdt, current, asked, ram = row["lvdt"], row["current"], row["asked"], moves[RAM]
    for c in range(CHANNELS):
        lvdt[c] = state["slope"][c] * ram + state["shift"][c]
        current[c] = coil_current(asked[c], ram, c, servo["gain"], state) if shut[c] == 0 else 0.0
        row["spool_model"][c], row["ram_model"][c] = valve_models[c, SPOOL], models[c, RAM]
        row["open_coil"][c], row["valve_sensed"][c] = broken[Part.OPEN_SEEN, c] != 0.0, shut[c]
    row["spool"] = moves[SPOOL]
    for s in range(SYSTEMS):
        row["pressure"][s] = data.broken[0, Part.PRESSURE, s]


@kernel
def coil_current(asked, ram, c, gain, state):
    """Return the current in the coil of channel ``c``, whose valve lets it through."""
    told = clamp(gain * (asked - state["slope"][c] * ram - state["shift"][c]), -1.0, 1.0)
    return clamp(state["coil"][c] * told + state["driven"][c], -1.0, 1.0)


@kernel
def fly_frame(row, i, data):
    """Move valves, spool, ram and models of surface ``i`` through all steps of the plant in this frame."""
    state, broken, servo, positions = data.state[i], data.broken[i], data.built[i], data.positions
    moves, shut, held, share = state["moves"], state["shut"], 0, 0.0
    for c in range(CHANNELS):
        if shut[c] != 0 and row["valve"][c] == 0:  # its computer is engaged again: models begin where everything is
            for part in range(len(moves)):
                state["model"][c, part] = state["valve_model"][c, part] = moves[part]
        if broken[Part.VALVE_STUCK, c] == 0.0:
            shut[c] = row["valve"][c]
        held += shut[c] == 0
        share += (row["valve"][c] == 0) / CHANNELS
    pressure = (row["pressure"][0] + row["pressure"][1]) / SYSTEMS if held > 0 else 0.0
    left, jammed = broken[Part.LEFT, 0], broken[Part.JAMMED, 0] != 0.0
    for step in range(len(positions)):
        for _ in range(data.substeps):
            total, stray = drive(row["asked"], row["valve"], servo["gain"], state)
            move_models(row["asked"], row["valve"], share, stray, pressure, state, data.designed[i])
            opened = moves[SPOOL] * servo["substep_s"] if jammed else move_spool(moves, servo["transition"], total)
            move_ram(moves, servo, opened, pressure * left)
        positions[step, i] = moves[RAM]
    row["ram"], row["bypassed"] = moves[RAM], pressure * left <= 0.0


@kernel
def drive(asked, valve, gain, state):
    """Find the currents of a surface's coils; return their input to the spool, and what of it no command accounts for.

    That is what flows behind valves that are commanded to be shut and have stuck.
    """
    ram, shut, current, total, stray = state["moves"][RAM], state["shut"], state["current"], 0.0, 0.0
    for c in range(CHANNELS):
        current[c] = coil_current(asked[c], ram, c, gain, state) if shut[c] == 0 else 0.0
        total += current[c]
        stray += current[c] if valve[c] != 0 else 0.0
    return total / CHANNELS, stray / CHANNELS


@kernel
def move_models(asked, valve, share, stray, pressure, state, design):
    """Move the models of a surface's channels by a sub-step, each as if all others did as it does.

    share : of the channels that are not shut off;  stray : what those drive that should be, which is measured
    pressure : mean of the systems', which the models know, but of no leak
    """
    models, valve_models, current, transition = (
        state["model"], state["valve_model"], state["current"], design["transition"]
    )  # fmt: skip
    for c in range(CHANNELS):
        if valve[c] == 0:
            move_spool(valve_models[c], transition, share * current[c] + stray)
            ideal = share * asked_current(asked[c], models[c, RAM], design) + stray
            move_ram(models[c], design, move_spool(models[c], transition, ideal), pressure)
