"""The charts of control and flight: numbers of one unit, and the least span of the axis.

Without a least span, noise of a thousandth of a degree would fill a chart and look like motion.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import AUTOPILOT_COMMANDS, SURFACES, Block
from rig.log.columns import COLUMNS
from rig.show.viewer.derived import DEGREE_NAMES, degrees
from rig.show.viewer.style import plain


class Chart(NamedTuple):
    """Lines of one unit.

    names : of DEGREE_NAMES; or command_*, surface_*, surface_command_*, autopilot_command_*, and flight_* of FLIGHT
    span  : least span of its axis, in its unit
    """

    name: str
    unit: str
    names: tuple[str, ...]
    span: float

    @property
    def title(self) -> str:
        """Its name and unit."""
        return f"{self.name}, {self.unit}"


CONTROL: Final = (
    Chart(
        "commanded angles",
        "deg",
        tuple(f"command_{a}_rad" for a in ("pitch_angle", "roll_angle", "sideslip", "flight_path_angle")),
        2.0,
    ),
    Chart("commanded rates", "deg/s", ("command_pitch_rate_rad_s", "command_roll_rate_rad_s"), 2.0),
    Chart("commanded heading", "deg", ("command_heading_rad",), 2.0),
    Chart("commanded and pressure altitude", "m", ("command_altitude_m", "command_pressure_altitude_m"), 20.0),
    Chart("commanded and equivalent airspeed", "m/s", ("command_airspeed_m_s", "command_equivalent_airspeed_m_s"), 5.0),
    Chart(
        "commanded changes of angles",
        "deg",
        tuple(f"autopilot_command_{name}" for name in AUTOPILOT_COMMANDS if name[-4:] == "_rad"),
        2.0,
    ),
    Chart("commanded change of altitude", "m", ("autopilot_command_altitude_m",), 20.0),
    Chart("commanded change of airspeed", "m/s", ("autopilot_command_airspeed_m_s",), 5.0),
)
SURFACE: Final = (
    *(
        Chart(name[:-4], "deg", tuple(f"{what}_{name}" for what in ("surface", "surface_command", "position")), 2.0)
        for name in SURFACES
        if name.endswith("_rad")
    ),
    Chart("throttle", "1", ("surface_throttle", "surface_command_throttle", "flight_throttle"), 0.1),
)
FLOWN: Final = (
    Chart("altitude and height", "m", ("flight_altitude_m", "flight_height_m"), 20.0),
    Chart(
        "airspeed and wind",
        "m/s",
        tuple(f"flight_{n}_m_s" for n in ("true_airspeed", "wind_north", "wind_east", "wind_down")),
        5.0,
    ),
)
CHARTS: Final = (*CONTROL, *SURFACE, *FLOWN)
_LONG: Final = ("surface_command", "autopilot_command")  # tested before the shorter beginnings of names
_COLUMNS: Final = {column.path: column for column in COLUMNS}


def _parted(name: str) -> tuple[str, str]:
    """Return the beginning of a name of a chart, and the rest."""
    long = next((each for each in _LONG if name.startswith(f"{each}_")), None)
    where = long or name.partition("_")[0]
    return where, name.removeprefix(f"{where}_")


def place(name: str) -> tuple[str, str]:
    """Return topic and field in the log of a name of a chart."""
    where, field = _parted(name)
    topics = {"flight": "/flight", "position": "/flight", "autopilot_command": "/autopilot_command"}
    return (topics[where], field) if where in topics else ("/control", name)


def label(name: str, chart: Chart) -> str:
    """Return a name of a chart in words, without its unit and without the name of the chart."""
    where, field = _parted(name)
    if where in ("surface", "surface_command", "position") or chart.name == "throttle":
        return {"surface": "command", "surface_command": "actuator input"}.get(where, "position")
    for unit in ("_rad_s", "_m_s", "_rad", "_m"):
        field = field.removesuffix(unit)
    return plain(field)


def ranges(rows: Block) -> dict[str, tuple[float, float]]:
    """Return the axis range of each chart for ``rows``, by its name."""
    turned = degrees(rows)
    ranges_by_name = {}
    for chart in CHARTS:
        columns = [
            turned[:, DEGREE_NAMES.index(name)] if name in DEGREE_NAMES
            else _COLUMNS[".".join(place(name))[1:]].of(rows)
            for name in chart.names
        ]  # fmt: skip
        ranges_by_name[chart.name] = spanned(np.concatenate(columns), chart.span)
    return ranges_by_name


def spanned(values: NDArray[np.float64], span: float) -> tuple[float, float]:
    """Return the range of the finite ``values`` with a tenth added on either side, at least ``span``."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    middle, half = (low + high) / 2, max(0.6 * (high - low), span / 2)
    return middle - half, middle + half
