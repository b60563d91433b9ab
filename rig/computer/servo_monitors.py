"""The monitors of one surface's four channels; a monitor that isolates a channel opens its shut-off valve, for good.

    current     asked by the channel's computer and measured; an open coil moves nothing, so it hides from this
    continuity  of the coil's wire; sees an open coil with its coverage
    spool       the valve's model, moved by the channel's own current, and the spool; waits while a current miscompares
    position    the ram's four position sensors with each other, by the redundancy manager of a signal
    ram         the ram's model, moved by the channel's command and the pressures, and its position sensor
    valve       commanded and sensed; reports, and isolates no channel

Both models take in the measured current of channels that are shut off but whose valve has stuck.  Each monitor reads
the recorded row alone, so a log gives the same decisions again.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.state import new_state
from rig.core.frame import CHANNELS, MOVED, ActuatorMonitor, Ilm
from rig.core.kernels import kernel, long_kernel
from rig.core.settings import in_frames
from rig.world.actuators.actuators_table import Config
from rig.world.actuators.servo import asked_current

LIMITS: Final = np.dtype(
    [
        ("current", "f8"),
        ("spool", "f8"),
        ("ram", "f8"),  # rad
        ("current_frames", "i8"),
        ("continuity_frames", "i8"),
        ("spool_frames", "i8"),
        ("ram_frames", "i8"),
        ("valve_frames", "i8"),
        ("enabled", "u1"),
    ],
    align=True,
)
WATCH: Final = np.dtype(
    [
        # Frames in a row that speak against each channel.
        ("current", "i8", (CHANNELS,)),
        ("open_coil", "i8", (CHANNELS,)),
        ("spool", "i8", (CHANNELS,)),
        ("ram", "i8", (CHANNELS,)),
        ("valve", "i8", (CHANNELS,)),
        # What the manager of the position sensors is given.
        ("samples", "f8", (CHANNELS,)),
        ("valid", "u1", (CHANNELS,)),
        ("ilm", "u1", (CHANNELS,)),
        ("failed_by", "u1", (CHANNELS,)),  # ActuatorMonitor
        ("off", "u1", (CHANNELS,)),  # shut off by its computer,
        ("shut", "u1", (CHANNELS,)),  # and in the frame before
    ],
    align=True,
)


class MonitorData(NamedTuple):
    """Data of the monitors besides the row, one record a surface."""

    limits: NDArray[Any]  # (3,) LIMITS
    watch: NDArray[Any]  # (3,) WATCH, in place
    params: NDArray[Any]  # (3,) PARAMS of the position sensors
    state: NDArray[Any]  # (3,) STATE of theirs, in place


def monitors(config: Config, stops_rad: NDArray[np.float64], rate_hz: float) -> MonitorData:
    """Return the monitors at the first frame; stops_rad : (3, 2) of each surface."""
    limits, params = np.zeros(len(MOVED), LIMITS), np.zeros(len(MOVED), PARAMS)
    for row, manager, (low, high) in zip(limits, params, stops_rad, strict=True):
        stroke = high - low
        row["current"], row["spool"] = config.current.threshold, config.spool.threshold
        row["ram"] = config.ram.threshold * stroke
        for name in ("current", "continuity", "spool", "ram", "valve"):
            row[f"{name}_frames"] = in_frames(1, getattr(config, name).persistence_s, rate_hz)
        row["enabled"] = config.monitors
        among = SignalConfig(
            threshold=config.position.threshold * stroke,
            persistence_s=config.position.persistence_s,
            split_persistence_s=config.position.persistence_s,
            tie_break=["ilm"],
        )
        fill(manager, among, (low - 2 * stroke, high + 2 * stroke), CHANNELS, False, rate_hz)
    watch = np.zeros(len(MOVED), WATCH)
    watch["valid"], watch["ilm"] = 1, Ilm.ABSENT
    return MonitorData(limits, watch, params, new_state(params))


@long_kernel
def watch_rows(rows, designed, off, data):
    """Monitor ``rows`` (n, 3) SERVO, whose valve, valve_differs and failed_by are written; see below.

    off : (n, 4) channels that their computers shut off
    """
    for k in range(len(rows)):
        for i in range(len(designed)):
            watch_surface(rows[k, i], designed[i], i, off[k], data)


@kernel
def watch_surface(row, servo, i, off, data):
    """Monitor the channels of surface ``i`` in one frame.

    row : its SERVO record; reads what was asked and measured, writes valve, valve_differs and failed_by
    servo : its SERVO record, nominal;  off : (4,) channels that their computers shut off;  data : MonitorData
    """
    limits, seen = data.limits[i], data.watch[i]
    samples = seen["samples"]
    for c in range(CHANNELS):
        seen["off"][c], samples[c] = off[c], row["lvdt"][c]
    currents_differ = watch_currents(row, servo, limits, seen)
    # The position sensors of channels that are shut off are as good as ever.
    manage_signal(samples, seen["valid"], seen["ilm"], np.nan, np.nan, data.params[i], data.state[i])
    failed, in_state = seen["failed_by"], data.state[i]["failed"]
    for c in range(CHANNELS):
        shut = failed[c] != 0 or seen["shut"][c] != 0
        seen["valve"][c] = seen["valve"][c] + 1 if row["valve_sensed"][c] != shut else 0
        row["valve_differs"][c] = seen["valve"][c] >= limits["valve_frames"]
        if off[c] != 0:  # the counts begin again when its computer is engaged again
            seen["current"][c] = seen["open_coil"][c] = seen["spool"][c] = seen["ram"][c] = 0
        elif failed[c] == 0:
            watch_models(row, c, not currents_differ, limits, seen)
            if limits["enabled"] != 0:
                failed[c] = verdict(c, in_state[c], limits, seen)
        row["failed_by"][c], row["valve"][c] = failed[c], failed[c] != 0 or off[c] != 0
        seen["shut"][c] = off[c]


@kernel
def watch_currents(row, servo, limits, seen):
    """Count frames of currents that are not as asked and of wires that are open; return True if a current is not."""
    differ = False
    for c in range(CHANNELS):
        if seen["failed_by"][c] != 0 or seen["off"][c] != 0:
            continue
        asked = asked_current(row["asked"][c], row["lvdt"][c], servo)
        wrong = abs(asked - row["current"][c]) > limits["current"]
        seen["current"][c] = seen["current"][c] + 1 if wrong else 0
        seen["open_coil"][c] = seen["open_coil"][c] + 1 if row["open_coil"][c] != 0 else 0
        differ |= wrong
    return differ


@kernel
def watch_models(row, c, spool_too, limits, seen):
    """Count frames in which spool or ram are not where the models of channel ``c`` have them."""
    if spool_too:
        wrong = abs(row["spool_model"][c] - row["spool"]) > limits["spool"]
        seen["spool"][c] = seen["spool"][c] + 1 if wrong else 0
    wrong = abs(row["ram_model"][c] - row["lvdt"][c]) > limits["ram"]
    seen["ram"][c] = seen["ram"][c] + 1 if wrong else 0


@kernel
def verdict(c, sensor_failed, limits, seen):
    """Return the first monitor that isolates channel ``c`` in this frame; 0: none."""
    if seen["current"][c] >= limits["current_frames"]:
        return ActuatorMonitor.CURRENT
    if seen["open_coil"][c] >= limits["continuity_frames"]:
        return ActuatorMonitor.CONTINUITY
    if seen["spool"][c] >= limits["spool_frames"]:
        return ActuatorMonitor.SPOOL
    if sensor_failed != 0:
        return ActuatorMonitor.POSITION
    if seen["ram"][c] >= limits["ram_frames"]:
        return ActuatorMonitor.RAM
    return ActuatorMonitor.NONE
