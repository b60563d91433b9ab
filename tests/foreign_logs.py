"""Small logs of other systems, written by hand or by the formats' own writers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

PX4_LOGS = Path(__file__).parent.parent / "../shared/data/px4_logs"
_ULOG = {"uint64_t": "Q", "uint32_t": "I", "uint8_t": "B", "float": "f", "double": "d", "int32_t": "i"}


def ulog_message(letter: str, data: bytes) -> bytes:
    """A message of a ULog file."""
    return struct.pack("<HB", len(data), ord(letter)) + data


def ulog(
    topics: Mapping[tuple[str, int], tuple[Mapping[str, str], Sequence[Sequence[float]]]], more: bytes = b""
) -> bytes:
    """A ULog file of topics by name and instance: the types of their fields, and rows; rows in the order of time."""
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + ulog_message("B", bytes(40))
    formats = {name: fields for (name, _), (fields, _) in topics.items()}
    for name, fields in formats.items():
        head += ulog_message("F", f"{name}:{''.join(f'{kind} {field};' for field, kind in fields.items())}".encode())
    rows = []
    for number, ((name, instance), (fields, of)) in enumerate(topics.items()):
        head += ulog_message("A", struct.pack("<BH", instance, number) + name.encode())
        layout = "<H" + "".join(_ULOG[kind] for kind in fields.values())
        whole = [kind in ("uint64_t", "uint32_t", "uint8_t", "int32_t") for kind in fields.values()]
        for row in of:
            cells = [int(cell) if is_whole else cell for cell, is_whole in zip(row, whole, strict=True)]
            rows.append((row[0], ulog_message("D", struct.pack(layout, number, *cells))))
    return head + b"".join(data for _, data in sorted(rows, key=lambda row: row[0])) + more


IMU_FIELDS = {"timestamp": "uint64_t", "device_id": "uint32_t", "x": "float", "y": "float", "z": "float"}


def gyros(
    count: int = 3, rows: int = 100, rate_hz: float = 50.0, devices: Sequence[int] = (11, 22, 33, 44, 55)
) -> bytes:
    """A ULog of gyros that measure the same, with noise."""
    rng = np.random.default_rng(0)
    t = np.arange(rows) / rate_hz
    topics = {}
    for i in range(count):
        values = np.stack([np.sin(t), np.cos(t), 0.1 * t], axis=1) + rng.normal(0, 0.002, (rows, 3))
        topics["sensor_gyro", i] = (
            IMU_FIELDS,
            [(1e6 + 1e6 * s + 100 * i, devices[i], *v) for s, v in zip(t, values, strict=True)],
        )
    return ulog(topics)


_LETTERS = {
    **{"b": "b", "B": "B", "M": "B", "h": "h", "H": "H", "c": "h", "C": "H", "i": "i", "I": "I", "e": "i", "E": "I"},
    **{"L": "i", "f": "f", "d": "d", "q": "q", "Q": "Q", "n": "4s", "N": "16s", "Z": "64s"},
}


def dataflash_message(number: int, letters: str, cells: Iterable[Any]) -> bytes:
    """A message of a dataflash log."""
    made = [cell.encode() if isinstance(cell, str) else cell for cell in cells]
    return b"\xa3\x95" + bytes([number]) + struct.pack("<" + "".join(_LETTERS[each] for each in letters), *made)


def dataflash(
    messages: Mapping[str, tuple[str, str, Sequence[Sequence[Any]]]],
    units: Mapping[str, tuple[str, str]] | None = None,
    clock: int = 0,
) -> bytes:
    """A dataflash log of messages by name: letters, columns, rows; ``units``: unit and multiplier ids of a message.

    clock : column by which rows are in order
    """
    kinds = {"FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns")}
    if units is not None:
        kinds |= {"UNIT": (1, "QbZ", "TimeUS,Id,Label"), "MULT": (2, "Qbd", "TimeUS,Id,Mult")}
        kinds |= {"FMTU": (3, "QBNN", "TimeUS,FmtType,UnitIds,MultIds")}
    for number, (name, (letters, columns, _)) in enumerate(messages.items(), 10):
        kinds[name] = (number, letters, columns)
    made = b""
    for name, (number, letters, columns) in kinds.items():
        length = 3 + struct.calcsize("<" + "".join(_LETTERS[each] for each in letters))
        made += dataflash_message(0x80, "BBnNZ", (number, length, name, letters, columns))
    if units is not None:
        for unit_id, label in {
            "s": "s",
            "#": "instance",
            "E": "rad/s",
            "o": "m/s/s",
            "G": "Gauss",
            "P": "Pa",
            "-": "",
        }.items():
            made += dataflash_message(1, "QbZ", (0, ord(unit_id), label))
        for factor_id, factor in {"-": 0.0, "?": 1.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6}.items():
            made += dataflash_message(2, "Qbd", (0, ord(factor_id), factor))
        for name, (unit_ids, factor_ids) in units.items():
            made += dataflash_message(3, "QBNN", (0, kinds[name][0], unit_ids, factor_ids))
    rows = [
        (row[clock], dataflash_message(kinds[n][0], kinds[n][1], row))
        for n, (_, _, of) in messages.items()
        for row in of
    ]
    return made + b"".join(data for _, data in sorted(rows, key=lambda row: row[0]))


IMU = ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
IMU_UNITS = ("s#EEEooo", "F-000000")


def imus(count: int = 3, rows: int = 100, rate_hz: float = 25.0) -> bytes:
    """A dataflash log of IMUs that measure the same, with noise."""
    rng = np.random.default_rng(1)
    made = []
    for k in range(rows):
        t = k / rate_hz
        for i in range(count):
            values = np.array([np.sin(t), np.cos(t), 0.1, 0.2, 0.3, -9.8]) + rng.normal(0, 0.002, 6)
            made.append((1_000_000 + round(1e6 * t) + 10 * i, i, *values))
    return dataflash({"IMU": (*IMU, made)}, {"IMU": IMU_UNITS})


class RosBag:
    """A bag that rosbags writes."""

    def __init__(self, path: Path, mcap: bool = False) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3)
        self._connections: dict[tuple[str, str], Any] = {}

    def __enter__(self) -> RosBag:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def write(self, topic: str, kind: str, log_ns: int, message: Any) -> None:
        """Write a message."""
        key = topic, f"sensor_msgs/msg/{kind}"
        if key not in self._connections:
            self._connections[key] = self._writer.add_connection(*key, typestore=self.store)
        self._writer.write(self._connections[key], log_ns, self.store.serialize_cdr(message, key[1]))

    def header(self, stamp_ns: int, frame: str) -> Any:
        """A header."""
        types = self.store.types
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)

    def imu(
        self, topic: str, log_ns: int, values: Sequence[float], frame: str = "imu", stamp_ns: int | None = None
    ) -> None:
        """Write an Imu of six values."""
        types = self.store.types
        vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
        message = types["sensor_msgs/msg/Imu"](
            header=self.header(log_ns if stamp_ns is None else stamp_ns, frame),
            orientation=turn(x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.arange(9.0),
            angular_velocity=vector(*values[:3]),
            angular_velocity_covariance=np.arange(9.0) + 10,
            linear_acceleration=vector(*values[3:]),
            linear_acceleration_covariance=np.arange(9.0) + 20,
        )
        self.write(topic, "Imu", log_ns, message)
