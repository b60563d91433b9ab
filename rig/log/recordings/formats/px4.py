"""PX4 logs (.ulg).

An instance is a device.  Where the autopilot moved a device to another place in flight (``multi_id``), rows are told
apart by device id: else a fault would end in one instance and begin in another.

Added fields, because no mapping could name them otherwise:
    gyro[i] = delta_angle[i] / delta_angle_dt, accel[i] = delta_velocity[i] / delta_velocity_dt   of vehicle_imu
An altitude is NaN while the receiver has no fix in three dimensions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.recordings.formats.contents import LogContents, OpenLog, Topic, cut_short, read_log, share, topic_of
from rig.log.recordings.formats.gathered import gathered, numbers
from rig.log.recordings.formats.ulog import MAGIC, TopicRows, read_ulog
from rig.log.recordings.stamps import Floats

__all__ = ["FORMAT", "MAGIC", "Px4Log"]
FORMAT: Final = "PX4"
_MILLIBAR_BELOW: Final = 2_000.0  # a pressure; sensor_baro was in millibar up to 1.11 and is in Pa from 1.13 on
_APART_US: Final = 1_000_000  # of timestamp_sample and timestamp, at most
_FIX: Final = 3  # of fix_type
_DERIVED: Final = {
    "gyro": ("delta_angle", "delta_angle_dt", "rad/s"),
    "accel": ("delta_velocity", "delta_velocity_dt", "m/s^2"),
}
_ALTITUDE: Final = {"altitude_msl_m": "m", "alt": "mm"}
_UNITS: Final = {  # of messages that have redundant sensors; the format has no units
    "vehicle_imu_status": {"mean_gyro": "rad/s", "mean_accel": "m/s^2"},
    "sensor_gyro": dict.fromkeys("xyz", "rad/s"),
    "sensor_accel": dict.fromkeys("xyz", "m/s^2"),
    "sensor_mag": dict.fromkeys("xyz", "gauss"),
    "vehicle_magnetometer": {"magnetometer_ga": "gauss"},
    "airspeed": {"indicated_airspeed_m_s": "m/s", "true_airspeed_m_s": "m/s"},
    "differential_pressure": {"differential_pressure_pa": "Pa", "differential_pressure_raw_pa": "Pa"},
    **dict.fromkeys(("sensor_gps", "vehicle_gps_position"), _ALTITUDE),
}
_DEVICES: Final = ("gyro_device_id", "device_id")


class _Rows(NamedTuple):
    """The rows of one instance."""

    kind: TopicRows
    at: NDArray[np.int64]  # (n,) first byte of each


class Px4Log(OpenLog):
    """A ULog file."""

    def __init__(self, path: Path) -> None:
        """Read the structure of the file.  BadInput: a version that is not known, no topic."""
        self._data = read_log(path)
        ulog = read_ulog(self._data, str(path))
        lost = f"{ulog.lost_s:.3g} s were lost by the logger ({ulog.dropouts} dropouts)"
        self._remarks = [*([lost] if ulog.dropouts else []), *cut_short(ulog.cut)]
        self._rows = {topic.name: (topic, rows) for topic, rows in self._topics(ulog.topics)}
        if not self._rows:
            raise BadInput(f"{path}: a {FORMAT} log without data{share(ulog.left_out, len(self._data))}")
        if sum(topic.message == "sensor_mag" for topic, _ in self._rows.values()) > 1:
            self._remarks.append("sensor_mag is in the frame of each sensor and without its calibration: not compared")
        damage = [share(ulog.left_out, len(self._data)).removeprefix("; ")] if ulog.left_out else []
        topics = tuple(self._rows[name][0] for name in sorted(self._rows))
        self._contents = LogContents(FORMAT, "px4", topics, tuple(self._remarks), tuple(damage))

    @property
    def contents(self) -> LogContents:
        """Return what the log holds."""
        return self._contents

    def source(self, topic: Topic, fields: Collection[str]) -> Source:
        """Return time [s] since power-on and the ``fields``."""
        rows = self._rows[topic.name][1]
        return Source(self._time_s(rows), {name: self._values(topic.message, rows, name) for name in fields})

    def _topics(self, found: list[TopicRows]) -> Iterator[tuple[Topic, _Rows]]:
        """Yield each topic with its rows."""
        by_message: dict[str, dict[int, _Rows]] = {}
        for one in found:
            rows = _Rows(one, np.frombuffer(one.at, np.int64))
            instances = by_message.setdefault(one.name, {})
            before = instances.get(one.multi_id)
            if before is not None and before.kind.kind == one.kind:  # subscribed twice
                rows = _Rows(one, np.sort(np.concatenate([before.at, rows.at])))
            elif before is not None and len(before.at) > len(rows.at):
                rows = before
            instances[one.multi_id] = rows
        for message, instances in by_message.items():
            for instance, device, rows in self._by_device(message, instances):
                names = _names(rows.kind)
                units = {name: self._unit(message, name, rows) for name in (*names, *_derived(names))}
                yield topic_of(message, instance, self._time_s(rows), units, device), rows

    def _by_device(self, message: str, instances: dict[int, _Rows]) -> Iterator[tuple[str, str, _Rows]]:
        """Yield instance, device and rows: by ``multi_id``, or by device id where one ``multi_id`` had two devices."""
        key = next((key for key in _DEVICES if all(key in _names(rows.kind) for rows in instances.values())), None)
        ids = {} if key is None else {i: self._column(rows, key) for i, rows in instances.items()}
        devices = {i: np.unique(of[of != 0]) for i, of in ids.items()}
        first = instances[min(instances)]
        alike = all(rows.kind.kind == first.kind.kind for rows in instances.values())
        if all(len(found) <= 1 for found in devices.values()) or not alike:
            yield from ((str(i), _hex(devices.get(i, ())), rows) for i, rows in sorted(instances.items()))
            return
        self._remarks.append(f"{message}: devices changed their places in flight: instances are told by device id")
        at, of = (np.concatenate([by[i] for i in instances]) for by in ({i: r.at for i, r in instances.items()}, ids))
        order = np.argsort(self._column(_Rows(first.kind, at), "timestamp"), kind="stable")
        for device in np.unique(of[of != 0]):
            mine = order[of[order] == device]
            yield f"device_{int(device)}", _hex([device]), _Rows(first.kind, at[mine])

    def _column(self, rows: _Rows, name: str) -> NDArray[Any]:
        """Return a field as it is in the file."""
        kind, offset = rows.kind.fields[name]
        return gathered(self._data, rows.at, offset, kind)

    def _values(self, message: str, rows: _Rows, name: str) -> Floats:
        """Return a field, or an added one, as numbers."""
        names = _names(rows.kind)
        if name in names:
            values = numbers(self._column(rows, name))
            if name in _ALTITUDE and message in _UNITS and "fix_type" in names:
                values[self._column(rows, "fix_type") < _FIX] = np.nan
            return values
        kind, _, index = name.partition("[")
        delta, step, _ = _DERIVED[kind]
        step_us = numbers(self._column(rows, step))
        step_us[step_us <= 0] = np.nan
        return numbers(self._column(rows, f"{delta}[{index}")) / (step_us * 1e-6)

    def _time_s(self, rows: _Rows) -> Floats:
        """Return the time of the samples: ``timestamp_sample``, which is 0 in whole topics, else ``timestamp``."""
        stamps = self._column(rows, "timestamp").astype(np.int64)
        if "timestamp_sample" in _names(rows.kind):
            sampled = self._column(rows, "timestamp_sample").astype(np.int64)
            if sampled[0] > 0 and (np.diff(sampled) > 0).all() and (np.abs(stamps - sampled) < _APART_US).all():
                stamps = sampled
        time_s = stamps.astype(np.float64)
        time_s /= 1e6  # in place: a long log has many
        return time_s

    def _unit(self, message: str, name: str, rows: _Rows) -> str:
        """Return the unit of a field; of the barometer by its values, because its name did not change."""
        kind = name.partition("[")[0]
        if message == "sensor_baro" and name == "pressure":
            return "hPa" if float(np.nanmedian(self._column(rows, name))) < _MILLIBAR_BELOW else "Pa"
        if message == "vehicle_imu" and kind in _DERIVED:
            return _DERIVED[kind][2]
        return _UNITS.get(message, {}).get(kind, "")


def _names(rows: TopicRows) -> tuple[str, ...]:
    return tuple(rows.fields)


def _hex(devices: Collection[int] | NDArray[Any]) -> str:
    return f"{int(next(iter(devices))):#x}" if len(devices) else ""


def _derived(names: tuple[str, ...]) -> Iterator[str]:
    """Yield the added fields of a message with the fields ``names``."""
    for name, (delta, step, _) in _DERIVED.items():
        if step in names:
            yield from (f"{name}[{i}]" for i in range(3) if f"{delta}[{i}]" in names)
