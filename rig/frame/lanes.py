"""The second row of a frame: what each channel of the servo actuators saw and did.  Only flights with servos have it.

LANES holds one ACTUATOR record for elevator, aileron and rudder.  Its measured numbers are what converters deliver,
in single precision; monitors see them so, and so does who repeats their decisions from a log.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame.enums import ActuatorMonitor
from rig.frame.fields import BASES, Field
from rig.frame.signals import CHANNELS, SURFACES

MOVED: Final = tuple(name.removesuffix("_rad") for name in SURFACES[:3])  # by servos; the throttle never is
SYSTEMS: Final = 2  # hydraulic
_EACH: Final = (CHANNELS,)
_MESSAGE: Final = "rig.Actuator"

# In the order of the message; what has no unit is a share: 1 is the full current, the spool's full opening, all flow.
LANE_FIELDS: Final = (
    Field("asked", "actuation", _EACH, unit="rad", message=_MESSAGE),  # of each channel, by its computer
    Field("ram", "actuation", (), unit="rad", message=_MESSAGE),  # where it is at the end of the frame
    Field("lvdt", "actuation", _EACH, "single", unit="rad", message=_MESSAGE),  # its position sensors, at the beginning
    Field("current", "actuation", _EACH, "single", message=_MESSAGE),  # measured
    Field("spool", "actuation", (), "single", message=_MESSAGE),
    Field("spool_model", "actuation", _EACH, "single", message=_MESSAGE),  # moved by the channel's own current
    Field("ram_model", "actuation", _EACH, "single", unit="rad", message=_MESSAGE),  # moved by the channel's command
    Field("pressure", "actuation", (SYSTEMS,), "single", message=_MESSAGE),
    Field("open_coil", "actuation", _EACH, "flag", message=_MESSAGE),  # the monitor of the wire says so
    Field("valve", "actuation", _EACH, "flag", message=_MESSAGE),  # shut-off valve: 1 commanded to shut the channel off
    Field("valve_sensed", "actuation", _EACH, "flag", message=_MESSAGE),
    Field("valve_differs", "actuation", _EACH, "flag", message=_MESSAGE),  # for longer than it may
    Field("failed_by", "actuation", _EACH, "enum", ActuatorMonitor, message=_MESSAGE),
    Field("bypassed", "actuation", (), "flag", message=_MESSAGE),  # no channel or no pressure moves the ram
)
ACTUATOR: Final = np.dtype(
    sorted(((f.name, BASES[f.kind], f.shape) for f in LANE_FIELDS), key=lambda f: -np.dtype(f[1]).itemsize), align=True
)
LANES: Final = np.dtype([("frame", "i8"), ("actuator", ACTUATOR, (len(MOVED),))], align=True)
LaneBlock = NDArray[Any]  # (n,) LANES


def lane_rows(frames: int) -> LaneBlock:
    """Return ``frames`` blank rows."""
    return np.zeros(frames, LANES)
