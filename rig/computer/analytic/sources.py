"""Where each reference comes from, and what it reads: the ``[redundancy.references]`` table."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from rig.computer.analytic import pitch_filter
from rig.frame import INERTIAL
from rig.settings import Settings


class Config(Settings):
    """The ``[redundancy.references]`` table: where each reference comes from."""

    pitch_rate: Literal["angle_of_attack", "attitude", "inertial", "none"] = "attitude"
    roll_rate: Literal["attitude", "inertial", "none"] = "inertial"
    yaw_rate: Literal["attitude", "inertial", "none"] = "attitude"
    normal_load_factor: Literal["angle_of_attack", "inertial", "none"] = "inertial"
    lateral_load_factor: Literal["angle_of_sideslip", "inertial", "none"] = "angle_of_sideslip"
    longitudinal_load_factor: Literal["inertial", "none"] = "inertial"
    angle_of_attack: Literal["load_factor", "inertial", "none"] = "load_factor"
    angle_of_sideslip: Literal["lateral_load_factor", "inertial", "none"] = "lateral_load_factor"
    static_pressure: Literal["inertial", "none"] = "inertial"
    dynamic_pressure: Literal["inertial", "none"] = "inertial"
    pitch_angle: Literal["kinematic", "inertial", "none"] = "inertial"
    roll_angle: Literal["body_rates", "inertial", "none"] = "inertial"
    heading: Literal["inertial", "none"] = "inertial"
    inertial_lead_s: float = Field(default=0.015, ge=0)  # makes up for the unit's lag beyond that of the gyros


_TURNING: Final = ("roll_rate", "pitch_rate", "yaw_rate")
_ATTITUDE: Final = ("pitch_angle", "roll_angle", "heading")
_AIR: Final = ("dynamic_pressure", "static_pressure")
# What each source reads of the votes.
PARTNERS: Final[dict[tuple[str, str], tuple[str, ...]]] = {
    ("pitch_rate", "angle_of_attack"): (
        *("angle_of_attack", "angle_of_sideslip", "roll_rate", "yaw_rate"),
        *("pitch_angle", "roll_angle", *_AIR),
    ),
    ("pitch_rate", "attitude"): _ATTITUDE,
    ("pitch_rate", "inertial"): (),
    ("roll_rate", "attitude"): _ATTITUDE,
    ("roll_rate", "inertial"): (),
    ("yaw_rate", "attitude"): _ATTITUDE,
    ("yaw_rate", "inertial"): (),
    ("normal_load_factor", "angle_of_attack"): ("angle_of_attack", "longitudinal_load_factor", *_TURNING, *_AIR),
    ("normal_load_factor", "inertial"): (),
    ("lateral_load_factor", "angle_of_sideslip"): ("angle_of_sideslip", *_TURNING, "dynamic_pressure"),
    ("lateral_load_factor", "inertial"): (),
    ("longitudinal_load_factor", "inertial"): (),
    ("angle_of_attack", "load_factor"): ("normal_load_factor", "longitudinal_load_factor", *_TURNING, *_AIR),
    ("angle_of_attack", "inertial"): (),
    ("angle_of_sideslip", "lateral_load_factor"): ("lateral_load_factor", *_TURNING, "dynamic_pressure"),
    ("angle_of_sideslip", "inertial"): (),
    ("static_pressure", "inertial"): (),
    ("dynamic_pressure", "inertial"): ("static_pressure",),
    ("pitch_angle", "kinematic"): pitch_filter.PARTNERS,
    ("pitch_angle", "inertial"): (),
    ("roll_angle", "body_rates"): (
        *(*_TURNING, "angle_of_attack", "lateral_load_factor", "pitch_angle"),
        *_AIR,
    ),
    ("roll_angle", "inertial"): (),
    ("heading", "inertial"): (),
}
# The signals that a source remembers from when their channels agreed (strapdown.py): no partners, it goes on
# without them.
REMEMBERED: Final[dict[tuple[str, str], tuple[str, ...]]] = {
    ("static_pressure", "inertial"): ("static_pressure",),
    **{(angle, "inertial"): ("heading",) for angle in _ATTITUDE},
    **{(angle, "inertial"): ("heading",) for angle in ("angle_of_attack", "angle_of_sideslip")},
}
# The second reference of a signal, beside the one that is chosen: what that one reads, this one does not.
SECOND: Final[dict[tuple[str, str], str]] = {
    ("pitch_rate", "attitude"): "inertial",
    ("pitch_rate", "angle_of_attack"): "inertial",
    ("pitch_rate", "inertial"): "attitude",
    ("roll_rate", "attitude"): "inertial",
    ("roll_rate", "inertial"): "attitude",
    ("yaw_rate", "attitude"): "inertial",
    ("yaw_rate", "inertial"): "attitude",
    ("normal_load_factor", "angle_of_attack"): "inertial",
    ("normal_load_factor", "inertial"): "angle_of_attack",
    ("lateral_load_factor", "angle_of_sideslip"): "inertial",
    ("lateral_load_factor", "inertial"): "angle_of_sideslip",
    ("angle_of_attack", "load_factor"): "inertial",
    ("angle_of_attack", "inertial"): "load_factor",
    ("angle_of_sideslip", "lateral_load_factor"): "inertial",
    ("angle_of_sideslip", "inertial"): "lateral_load_factor",
    ("pitch_angle", "kinematic"): "inertial",
    ("pitch_angle", "inertial"): "kinematic",
    ("roll_angle", "body_rates"): "inertial",
    ("roll_angle", "inertial"): "body_rates",
}
_RATES, _VELOCITIES, _FORCES = INERTIAL[:3], INERTIAL[3:6], INERTIAL[6:]
# What the source ``inertial`` of each signal reads of the inertial unit.
FROM_UNIT: Final[dict[str, tuple[str, ...]]] = {
    **{name: (f"{name}_rad_s",) for name in _TURNING},
    "longitudinal_load_factor": (*_RATES, _FORCES[0]),
    "lateral_load_factor": (*_RATES, _FORCES[1]),
    "normal_load_factor": (*_RATES, _FORCES[2]),
    "static_pressure": (_VELOCITIES[2],),
    "dynamic_pressure": _VELOCITIES,
    **dict.fromkeys((*_ATTITUDE, "angle_of_attack", "angle_of_sideslip"), INERTIAL),
}


def source(config: Config, signal: str) -> str:
    """Return where the reference of ``signal`` comes from, ``none`` when it has none."""
    return getattr(config, signal, "none")


def second(config: Config, signal: str) -> str:
    """Return where the second reference of ``signal`` comes from, ``none`` when it has none."""
    return SECOND.get((signal, source(config, signal)), "none")
