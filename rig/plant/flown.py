"""The plant that an aircraft's settings ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig.plant import wind
from rig.plant.airframe import Airframe, FlightPoint, LinearConfig
from rig.plant.jsbsim import Plant

if TYPE_CHECKING:
    from rig.plant.linear_plant import LinearPlant


def plant(
    airframe: Airframe,
    flight_point: FlightPoint,
    air: wind.Config,
    turbulence: wind.Turbulence,
    rate_hz: float,
    steps_per_frame: int,
    seed: int,
) -> Plant | LinearPlant:
    """The aircraft, trimmed at ``flight_point``; BadInput when it cannot be loaded or trimmed there."""
    if isinstance(airframe, LinearConfig):
        from rig.plant.linear_plant import LinearPlant  # scipy's linear algebra takes its time, and few fly it

        return LinearPlant(airframe, flight_point, air, turbulence, rate_hz, steps_per_frame, seed)
    return Plant(airframe, flight_point, air, turbulence, rate_hz, steps_per_frame, seed)
