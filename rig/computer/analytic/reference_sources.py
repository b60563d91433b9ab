"""Sources of the references, and the signals that each reads: the ``[redundancy.references]`` table."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from rig.computer.analytic import pitch_filter
from rig.core.frame import INERTIAL
from rig.core.settings import Settings


class Config(Settings):
    """The ``[redundancy.references]`` table: the source of each reference."""

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
# The sources of each signal beside the inertial unit, and the votes that each reads; the last is the second reference
# of a signal whose first is the unit.
_BY_VOTES: Final[dict[str, dict[str, tuple[str, ...]]]] = {
    "pitch_rate": {
        "angle_of_attack": (
            *("angle_of_attack", "angle_of_sideslip", "roll_rate", "yaw_rate"),
            *("pitch_angle", "roll_angle", *_AIR),
        ),
        "attitude": _ATTITUDE,
    },
    "roll_rate": {"attitude": _ATTITUDE},
    "yaw_rate": {"attitude": _ATTITUDE},
    "normal_load_factor": {"angle_of_attack": ("angle_of_attack", "longitudinal_load_factor", *_TURNING, *_AIR)},
    "lateral_load_factor": {"angle_of_sideslip": ("angle_of_sideslip", *_TURNING, "dynamic_pressure")},
    "longitudinal_load_factor": {},
    "angle_of_attack": {"load_factor": ("normal_load_factor", "longitudinal_load_factor", *_TURNING, *_AIR)},
    "angle_of_sideslip": {"lateral_load_factor": ("lateral_load_factor", *_TURNING, "dynamic_pressure")},
    "static_pressure": {},
    "dynamic_pressure": {},
    "pitch_angle": {"kinematic": pitch_filter.PARTNERS},
    "roll_angle": {"body_rates": (*_TURNING, "angle_of_attack", "lateral_load_factor", "pitch_angle", *_AIR)},
    "heading": {},
}
_WITH_UNIT: Final = {"dynamic_pressure": ("static_pressure",)}  # votes that the source ``inertial`` reads
# Every signal and source, with the votes that it reads.
PARTNERS: Final[dict[tuple[str, str], tuple[str, ...]]] = {
    (signal, name): read
    for signal, sources in _BY_VOTES.items()
    for name, read in {**sources, "inertial": _WITH_UNIT.get(signal, ())}.items()
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
    **{key: "inertial" for key in PARTNERS if key[1] != "inertial"},
    **{(signal, "inertial"): [*sources][-1] for signal, sources in _BY_VOTES.items() if sources},
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

# The signals that the inertial unit measures too, of the same quantity: it and four sensors of one make may err alike.
TELLING: Final = (*_TURNING, "normal_load_factor", "lateral_load_factor", "longitudinal_load_factor")


def source(config: Config, signal: str) -> str:
    """Return where the reference of ``signal`` comes from, ``none`` when it has none."""
    return getattr(config, signal, "none")


def second(config: Config, signal: str) -> str:
    """Return where the second reference of ``signal`` comes from, ``none`` when it has none."""
    return SECOND.get((signal, source(config, signal)), "none")
