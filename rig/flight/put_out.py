"""The last stretch of a frame: from the surfaces that the computer commands to where they are."""

from __future__ import annotations

from rig.computer.servo_monitors import watch_surface
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel
from rig.world.actuators.servo_stage import fly_frame, sense, shift_positions, wire
from rig.world.faults import actuate, break_parts


@kernel
def put_out(row, k, still, faults, actuators, orders):
    """Pass the surfaces that the computers of row k command on to the actuators, which move; a fault comes between.

    still : of the control law, the surfaces that no channel moves;  actuators : None if the plant's lag moves them
    orders : of four computers, each of which asks its own channel; None: the row's surfaces are asked of all
    """
    surface, actuator = row["fcc"]["surface"], row["actuation"]["surface_command"]
    for i in range(len(surface)):
        actuator[i] = surface[i] if orders is None else orders.given[i]
    if actuators is None:
        actuate(row, faults)
    else:
        break_parts(row, actuators.broken, actuators.whole, faults)
        ask(surface, actuators.asked, actuators.off, orders)
        move_surfaces(actuators.asked, actuator, k, actuators)
        actuate(row, faults)
        shift_positions(actuator, k, actuators)
        for i in range(len(actuators.state)):
            still[i] = actuators.rows[k, i]["bypassed"]


@kernel
def move_surfaces(asked, actuator, k, data):
    """Sense, monitor and move all three surfaces for a frame.

    asked : (4, 4) what each channel is asked for;  actuator : (4,) where they are at the end of the frame
    Writes row k of ``data.rows`` and ``data.positions``;  data : ActuatorData
    """
    for i in range(len(data.state)):
        row = data.rows[k, i]
        for c in range(CHANNELS):
            row["asked"][c] = asked[c, i]
        wire(i, data.noise[k, i], data)
        sense(row, i, data)
        watch_surface(row, data.designed[i], i, data.off, data.monitors)
        fly_frame(row, i, data)
        actuator[i] = row["ram"]


@kernel
def ask(surface, asked, off, orders):
    """Write what each channel is asked for, (4, 4), by its own lane if there are lanes, and which lanes are off."""
    for c in range(asked.shape[0]):
        off[c] = 0 if orders is None else orders.off[c]
        for i in range(asked.shape[1]):
            asked[c, i] = surface[i] if orders is None else orders.asked[c, i]
