"""Values that no JSBSim model gives, for an aircraft.toml: actuators and limits of flight, each with its source.

Kinds are those of ``BaseModel.kind``.  All values are assumed for the type and marked so; replace them by known ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from rig.world.plant.base_model import Kind

STOP_RAD: Final = 0.35  # of a surface whose stops the model does not give, and of a normalised one at 1


@dataclass(frozen=True)
class Figures:
    """The assumed values of one kind of aircraft; rad, s, g; ``..._source`` is a comment in the file."""

    lag_s: float
    rate_limit_rad_s: float
    actuator_source: str
    throttle_lag_s: float
    throttle_rate_1_s: float
    limits: dict[str, float]
    limits_source: str


FIGURES: Final[dict[Kind, Figures]] = {
    "light": Figures(
        lag_s=0.1,
        rate_limit_rad_s=1.047,
        actuator_source=(
            "0.1 s, the most delay that MIL-F-8785C 3.5.3 allows for level 1; 60 deg/s, the elevator of Stevens and "
            "Lewis, Aircraft Control and Simulation"
        ),
        throttle_lag_s=0.2,
        throttle_rate_1_s=0.5,
        limits={
            "angle_of_attack_min_rad": -0.26,
            "angle_of_attack_max_rad": 0.35,
            "sideslip_max_rad": 0.35,
            "load_factor_min": -2.28,
            "load_factor_max": 5.7,
            "body_rate_max_rad_s": 1.5,
            "pitch_angle_max_rad": 0.79,
            "roll_angle_max_rad": 1.22,
        },
        limits_source="ultimate load, 1.5 times the limit load of -1.52 and +3.8 g (14 CFR 23.337, normal category)",
    ),
    "fighter": Figures(
        lag_s=0.0495,
        rate_limit_rad_s=1.047,
        actuator_source=(
            "lag 1/20.2 s and 60 deg/s, the F-16's elevator (Stevens and Lewis, Aircraft Control and Simulation, "
            "after NASA TP-1538)"
        ),
        throttle_lag_s=0.2,
        throttle_rate_1_s=0.5,
        limits={
            "angle_of_attack_min_rad": -0.35,
            "angle_of_attack_max_rad": 0.61,
            "sideslip_max_rad": 0.52,
            "load_factor_min": -4.0,
            "load_factor_max": 10.0,
            "body_rate_max_rad_s": 5.3,
        },
        limits_source="those of the bundled F-16: one g beyond its structural limits of -3 and +9 g",
    ),
    "transport": Figures(
        lag_s=0.1,
        rate_limit_rad_s=0.646,
        actuator_source=(
            "0.1 s, the most delay that MIL-F-8785C 3.5.3 allows for level 1; 37 deg/s as the bundled B747"
        ),
        throttle_lag_s=0.3,
        throttle_rate_1_s=0.2,
        limits={
            "angle_of_attack_min_rad": -0.17,
            "angle_of_attack_max_rad": 0.35,
            "sideslip_max_rad": 0.26,
            "load_factor_min": -1.5,
            "load_factor_max": 3.75,
            "body_rate_max_rad_s": 0.8,
            "pitch_angle_max_rad": 0.79,
            "roll_angle_max_rad": 1.22,
        },
        limits_source="ultimate load, 1.5 times the limit load of -1 and +2.5 g (14 CFR 25.337)",
    ),
}
MIXTURE: Final = 0.7  # best power near 1500 m in JSBSim's piston engine: 1.3 x 0.7 of stoichiometric at sea level
REVOLUTIONS: Final = 0.7  # of a governed propeller, of the way from its least to its most: cruise


def held(engines: int, engine: str, blade_angles_deg: tuple[float, float] | None) -> dict[str, float]:
    """Return the levers held beside the throttle: mixture, and revolutions of a governed propeller."""
    made: dict[str, float] = {}
    for i in range(engines):
        if engine == "piston":
            made[f"fcs/mixture-cmd-norm[{i}]"] = MIXTURE
        if blade_angles_deg and blade_angles_deg[1] > blade_angles_deg[0]:
            made[f"fcs/advance-cmd-norm[{i}]"] = REVOLUTIONS
    return made


def limits(kind: Kind) -> dict[str, Any]:
    """Return the ``[airframe.limits]`` of one kind."""
    return dict(FIGURES[kind].limits)
