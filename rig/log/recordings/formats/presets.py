"""Which topics of a log are redundant sensors: a preset writes the CONFIG of ``rig vote`` for one log.

The first candidate of a quantity that two instances have is taken.  Candidates of at least FAST_HZ come first: one
sample a second of a gyro that is sampled a thousand times a second is vibration, and a mean is not.

Thresholds are where a difference begins to matter: about half of what autopilots refuse to arm with; of barometers,
what two sound ones may differ by.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from tomli_w import dumps

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.text import choices, plain, quoted
from rig.core.units.conversion import conversion
from rig.log.recordings.formats.contents import LogContents, Topic

FAST_HZ: Final = 5.0
PERSISTENCE_S: Final = 1.0
AXES: Final = "xyz"


class Fields(NamedTuple):
    """The fields of one quantity in one message: one, or three axes; ``mean``: of a tenth of a second or more."""

    message: str
    names: tuple[str, ...]
    mean: bool = False


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that several sensors may measure: where it is, best first.

    threshold : from where on a difference matters; range : of samples; both in ``unit``
    """

    name: str
    threshold: float
    range: tuple[float, float]
    unit: str
    candidates: tuple[Fields, ...]


class Found(NamedTuple):
    """A quantity of a log with its instances."""

    quantity: Quantity
    fields: Fields
    topics: tuple[Topic, ...]  # at most four
    others: tuple[Topic, ...] = ()  # beyond four

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the names of the signals: gyro_x, gyro_y, gyro_z."""
        name = self.quantity.name
        return (name,) if len(self.fields.names) == 1 else tuple(f"{name}_{axis}" for axis in AXES)


def _indexed(name: str) -> tuple[str, ...]:
    return tuple(f"{name}[{i}]" for i in range(len(AXES)))


def _dotted(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for axis in AXES)


def _lettered(name: str) -> tuple[str, ...]:
    return tuple(f"{name}{axis.upper()}" for axis in AXES)


def _quantities(candidates: dict[str, tuple[Fields, ...]]) -> tuple[Quantity, ...]:
    known: dict[str, tuple[float, tuple[float, float], str]] = {
        "gyro": (0.05, (-70.0, 70.0), "rad/s"),
        "accel": (0.5, (-320.0, 320.0), "m/s^2"),
        "mag": (0.2, (-50.0, 50.0), "gauss"),
        "baro": (200.0, (1_000.0, 120_000.0), "Pa"),
        "airspeed": (2.0, (-50.0, 400.0), "m/s"),
        "differential_pressure": (50.0, (-20_000.0, 70_000.0), "Pa"),
        "gnss_altitude": (5.0, (-1_000.0, 100_000.0), "m"),
    }
    return tuple(Quantity(name, *known[name], fields) for name, fields in candidates.items())


PRESETS: Final[dict[str, tuple[Quantity, ...]]] = {
    "px4": _quantities(
        {
            "gyro": (
                Fields("vehicle_imu", _indexed("gyro")),
                Fields("sensor_gyro", tuple(AXES)),
                Fields("vehicle_imu_status", _indexed("mean_gyro"), mean=True),
            ),
            "accel": (
                Fields("vehicle_imu", _indexed("accel")),
                Fields("sensor_accel", tuple(AXES)),
                Fields("vehicle_imu_status", _indexed("mean_accel"), mean=True),
            ),
            "mag": (Fields("vehicle_magnetometer", _indexed("magnetometer_ga")),),
            "baro": (Fields("sensor_baro", ("pressure",)),),
            "airspeed": (Fields("airspeed", ("indicated_airspeed_m_s",)),),
            "differential_pressure": (
                Fields("differential_pressure", ("differential_pressure_pa",)),
                Fields("differential_pressure", ("differential_pressure_raw_pa",)),
            ),
            "gnss_altitude": (Fields("sensor_gps", ("altitude_msl_m",)), Fields("sensor_gps", ("alt",))),
        }
    ),
    "ardupilot": _quantities(
        {
            "gyro": (Fields("IMU", _lettered("Gyr")), Fields("GYR", _lettered("Gyr"))),
            "accel": (Fields("IMU", _lettered("Acc")), Fields("ACC", _lettered("Acc"))),
            "mag": (Fields("MAG", _lettered("Mag")),),
            "baro": (Fields("BARO", ("Press",)),),
            "airspeed": (Fields("ARSP", ("Airspeed",)),),
            "gnss_altitude": (Fields("GPS", ("Alt",)),),
        }
    ),
    "ros2-imu": _quantities(
        {
            "gyro": (Fields("", _dotted("angular_velocity")),),
            "accel": (Fields("", _dotted("linear_acceleration")),),
            "mag": (Fields("", _dotted("magnetic_field")),),
            "baro": (Fields("", ("fluid_pressure",)),),
            "gnss_altitude": (Fields("", ("altitude",)),),
        }
    ),
}


def found(contents: LogContents, path: Path, preset: str | None = None) -> list[Found]:
    """Return the quantities of which the log has two or more instances.

    preset : None: that of the format.  BadInput: unknown, of another format, the format has none, one channel only.
    """
    if preset is not None and preset not in PRESETS:
        raise BadInput(f"--preset: unknown preset {quoted(preset)}; {choices(preset, PRESETS)}")
    if not contents.preset:
        raise BadInput(f"{path}: a {contents.format} log has no preset: --config with a [mapping] of its columns")
    if preset not in (None, contents.preset):
        raise BadInput(f"{path}: a {contents.format} log: --preset {contents.preset}, not {preset}")
    ready = comparable(contents)
    if not ready:
        raise BadInput(f"{path}: one channel of each sensor: nothing to compare{_why(contents)}")
    return ready


def comparable(contents: LogContents) -> list[Found]:
    """Return the quantities of the format's preset of which the log has two or more instances."""
    quantities = PRESETS.get(contents.preset, ())
    return [found for quantity in quantities if (found := _instances(quantity, contents)) is not None]


def _why(contents: LogContents) -> str:
    unusable = [f"{topic.name}: {topic.unusable}" for topic in contents.topics if topic.unusable]
    return f" ({'; '.join(unusable)})" if unusable else ""


def _instances(quantity: Quantity, contents: LogContents) -> Found | None:
    """Return the best candidate that two instances have; None: there is none."""
    there = [(fields, _topics(fields, contents)) for fields in quantity.candidates]
    there = [(fields, topics) for fields, topics in there if len(topics) > 1]
    fast = [one for one in there if not one[0].mean and min(t.rate_hz for t in one[1]) >= FAST_HZ]
    means = [one for one in there if one[0].mean]
    best = next(iter((*fast, *means, *there)), None)
    return None if best is None else Found(quantity, best[0], tuple(best[1][:CHANNELS]), tuple(best[1][CHANNELS:]))


def _topics(fields: Fields, contents: LogContents) -> list[Topic]:
    of = (t for t in contents.topics if (not fields.message or t.message == fields.message) and not t.unusable)
    return [topic for topic in of if topic.rows > 1 and topic.holds(fields.names)]


def config(contents: LogContents, path: Path, preset: str | None = None) -> dict[str, Any]:
    """Return the tables of a CONFIG that votes all quantities of ``found``; BadInput as there."""
    mapping: dict[str, str] = {}
    signal: dict[str, dict[str, Any]] = {}
    triads: dict[str, list[str]] = {}
    for one in found(contents, path, preset):
        for name, field in zip(one.signals, one.fields.names, strict=True):
            try:
                signal[name] = _settings(one.quantity, one.topics[0].units[field] or one.quantity.unit)
            except ValueError as error:  # a damaged log
                raise BadInput(f"{path}: {one.topics[0].name}: {field}: unit: {error}") from None
            mapping.update({f"{name}.{c}": f"{topic.name}:{field}" for c, topic in enumerate(one.topics, 1)})
        if len(one.signals) == len(AXES):
            triads[one.quantity.name] = list(one.signals)
    return {"unresolved_s": 0.0, "signal": signal, "triads": triads, "mapping": mapping}


def text(tables: dict[str, Any], contents: LogContents, path: Path) -> str:
    """Return the tables of ``config`` as a CONFIG to keep."""
    about = f"# rig vote: the {contents.preset} preset for {plain(path.name)}, to be adapted\n"
    return (
        f"{about}# the thresholds are where a difference begins to matter; rig thresholds designs others\n\n"
        + dumps(tables)
    )


def _settings(quantity: Quantity, unit: str) -> dict[str, Any]:
    """Return the settings of a signal whose columns are in ``unit``."""
    factor = conversion(quantity.unit).factor / conversion(unit, conversion(quantity.unit).si).factor

    def here(amount: float) -> float:
        return float(f"{amount * factor:.6g}")

    return {
        "unit": unit,
        "threshold": here(quantity.threshold),
        "range": [here(limit) for limit in quantity.range],
        "persistence_s": PERSISTENCE_S,
        "split_persistence_s": PERSISTENCE_S,
        "tie_break": ["ilm"],
    }
