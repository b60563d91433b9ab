"""What the control law keeps: its fixed parameters and its state, one record each.

Plain records, so that copying the state copies the law: for a replay, or to try what would happen.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.frame import COMMANDS, DEMANDS, SURFACES, S

STICK, ANGLE, PATH = 0, 1, 2  # what an axis follows: stick; pitch or roll attitude; altitude or heading

PARAM: Final = np.dtype(
    [
        ("dt", "f8"),
        ("max_bank", "f8"),
        ("max_climb_angle", "f8"),
        ("max_load_change", "f8"),
        ("max_load_factor", "f8"),
        ("min_load_factor", "f8"),
        ("max_alpha", "f8"),
        ("schedule_share", "f8"),  # of a new sample that passes the filter in one frame
        ("airspeed_share", "f8"),
        ("climb_crossover", "f8"),
        ("max_yaw", "f8"),
        ("low", "f8", (len(SURFACES),)),
        ("high", "f8", (len(SURFACES),)),
        ("vertical", "i8"),
        ("lateral", "i8"),
        ("speed", "i8"),
    ],
    align=True,
)
# What evolves from frame to frame; the captured values change at engagement only.
DYNAMIC: Final = (
    "elevator_integral",
    "aileron_integral",
    "rudder_integral",
    "throttle_integral",
    "altitude_reference",
    "altitude_rate",
    "altitude_integral",
    "altitude_estimate",
    "climb_rate",
    "acceleration_error",
    "airspeed",  # filtered
    "schedule_pressure",  # filtered
)
CAPTURED: Final = ("pitch_angle", "roll_angle", "altitude", "heading", "held_airspeed")
STATE: Final = np.dtype(
    [
        *((name, "f8") for name in (*DYNAMIC, *CAPTURED)),
        ("measured", "f8", (S,)),  # the last finite value of each signal; NaN until there is one
        ("demand", "f8", (len(DEMANDS),)),  # likewise, 0 until there is one
        ("command", "f8", (len(COMMANDS),)),
        ("surface", "f8", (len(SURFACES),)),
        ("started", "i8"),
        ("law", "i8"),
    ],
    align=True,
)
