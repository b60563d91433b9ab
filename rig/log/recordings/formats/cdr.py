"""Messages of ROS 2 as they are stored (CDR): the header, and the numbers of the four types with redundant sensors.

The definitions of these types have not changed since ROS 2 began, so none has to be read from the file.
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

_START: Final = 4  # bytes of the encapsulation; alignment counts from behind it
_NAN: Final = float("nan")


class Kind(NamedTuple):
    """A type of messages: its fields with their units, and where their numbers are.

    at : doubles before the first number of each field, counted behind ``head`` bytes and the alignment
    covariance : the double which is -1 where there is no such measurement, of each group; None: the type has none
    """

    units: dict[str, str]
    at: tuple[int, ...]
    covariance: tuple[int | None, ...]
    doubles: int
    head: int = 0


def _axes(name: str, unit: str) -> dict[str, str]:
    return {f"{name}.{axis}": unit for axis in "xyz"}


KINDS: Final = {
    "sensor_msgs/msg/Imu": Kind(
        {**_axes("angular_velocity", "rad/s"), **_axes("linear_acceleration", "m/s^2")},
        (13, 14, 15, 25, 26, 27),  # behind the orientation and its covariance
        (16, 16, 16, 28, 28, 28),
        37,
    ),
    "sensor_msgs/msg/MagneticField": Kind(_axes("magnetic_field", "T"), (0, 1, 2), (None,) * 3, 12),
    "sensor_msgs/msg/FluidPressure": Kind({"fluid_pressure": "Pa"}, (0,), (None,), 2),
    "sensor_msgs/msg/NavSatFix": Kind({"altitude": "m"}, (2,), (None,), 12, head=4),  # behind the status
}


class Decoded(NamedTuple):
    """One message: the stamp of its header, its frame, and the numbers of its fields."""

    stamp_ns: int
    frame: bytes
    values: list[float]


def decoded(raw: bytes, kind: Kind) -> Decoded:
    """Return the numbers of a message.  ValueError, struct.error: it is none of ``kind``."""
    if raw[0] != 0 or raw[1] > 1:
        raise ValueError(f"a message in the encoding {raw[0]:02x}{raw[1]:02x}; CDR is 0000 or 0001")
    order = "<" if raw[1] else ">"
    seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", raw, _START)
    end = _START + 12 + length
    if length == 0 or end > len(raw):
        raise ValueError("a message whose frame_id is longer than itself")
    head, fix = end, True
    if kind.head:
        fix = raw[end : end + 1] < b"\x80"  # a status below 0: no fix
        head = end + kind.head - (end - _START) % 2
    start = _START + (head - _START + 7) // 8 * 8
    doubles = struct.unpack_from(f"{order}{kind.doubles}d", raw, start)
    values = [doubles[at] if fix else _NAN for at in kind.at]
    for place, covariance in enumerate(kind.covariance):
        if covariance is not None and doubles[covariance] == -1.0:
            values[place] = _NAN
    return Decoded(seconds * 10**9 + nanoseconds, raw[_START + 12 : end - 1], values)
