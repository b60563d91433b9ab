"""The last stretch of a frame: from the surfaces that the computer commands to where they are."""

from __future__ import annotations

from rig.actuators.stage import move_surfaces, shift_positions
from rig.faults import actuate, break_parts
from rig.kernels import kernel


@kernel
def put_out(row, k, still, faults, actuators):
    """Pass the surfaces that the computer of row k commands on to the actuators, which move; a fault comes between.

    still : of the control law, the surfaces that nobody moves;  actuators : None where the plant's own lag moves them
    """
    surface, actuator = row["fcc"]["surface"], row["actuation"]["actuator"]
    if actuators is None:
        for i in range(len(surface)):
            actuator[i] = surface[i]
        actuate(row, faults)
    else:
        break_parts(row, actuators.broken, actuators.whole, faults)
        move_surfaces(surface, actuator, k, actuators)
        actuate(row, faults)
        shift_positions(actuator, k, actuators)
        for i in range(len(actuators.state)):
            still[i] = actuators.rows[k]["actuator"][i]["bypassed"]
