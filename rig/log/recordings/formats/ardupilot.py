"""ArduPilot dataflash logs (.BIN).

An instance is what the unit ``#`` of a message names (FMTU).  A field that is called I is an integral term in some
messages; only logs without units have it as the instance of a sensor message.  Before 4.x the instance was in the name
of the message: IMU, IMU2, IMU3.  Values are in the unit of FMTU, its multiplier applied; an altitude of GPS is NaN
without a fix in three dimensions.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.recordings.formats.contents import LogContents, OpenLog, Topic, cut_short, read_log, share, topic_of
from rig.log.recordings.formats.dataflash import MAGIC, SCALED, TEXTS, Message, read_dataflash
from rig.log.recordings.formats.gathered import numbers
from rig.log.recordings.stamps import Floats

__all__ = ["FORMAT", "MAGIC", "ArduPilotLog"]
FORMAT: Final = "ArduPilot"
_FIX: Final = 3  # of GPS.Status
_NUMBERED: Final = re.compile(r"(?P<message>IMU|MAG|BARO|BAR|ARSP|ASP|GPS|GYR|ACC)(?P<number>[2-9])")
_OLD_NAMES: Final = {"BAR": "BARO", "ASP": "ARSP"}
_OF_SENSORS: Final = ("IMU", "MAG", "BARO", "ARSP", "GPS", "GYR", "ACC")
_UNITS: Final = {  # of sensor messages in logs without FMTU, with the factor to it
    **{f"Gyr{axis}": ("rad/s", 1.0) for axis in "XYZ"},
    **{f"Acc{axis}": ("m/s^2", 1.0) for axis in "XYZ"},
    **{f"Mag{axis}": ("gauss", 1e-3) for axis in "XYZ"},
    **{"Press": ("Pa", 1.0), "Airspeed": ("m/s", 1.0), "Alt": ("m", 1.0)},
}
_AS_WE_WRITE: Final = {"m/s/s": "m/s^2", "Gauss": "gauss"}


class _Rows(NamedTuple):
    """The rows of one instance."""

    message: Message
    mine: Any  # rows of the message, as an index
    base: str  # name of the message without its number


class ArduPilotLog(OpenLog):
    """A dataflash file."""

    def __init__(self, path: Path) -> None:
        """Read the structure of the file.  BadInput: no message with a time."""
        data = read_log(path)
        self._log = read_dataflash(data)
        self._rows = {topic.name: (topic, rows) for m in self._log.messages for topic, rows in self._topics(m)}
        left = self._log.left_out
        if not self._rows:
            raise BadInput(f"{path}: an {FORMAT} log without data{share(left, len(data))}")
        damage = [share(left, len(data)).removeprefix("; ")] if left else []
        topics = tuple(self._rows[name][0] for name in sorted(self._rows))
        self._contents = LogContents(FORMAT, "ardupilot", topics, tuple(cut_short(self._log.cut)), tuple(damage))

    @property
    def contents(self) -> LogContents:
        """Return what the log holds."""
        return self._contents

    def source(self, topic: Topic, fields: Collection[str]) -> Source:
        """Return time [s] since power-on and the ``fields``."""
        rows = self._rows[topic.name][1]
        name, tick_s = _clock(rows.message) or ("", 0.0)
        time_s = numbers(self._log.column(rows.message, name, rows.mine)) * tick_s
        return Source(time_s, {name: self._values(rows, name) for name in fields})

    def _topics(self, message: Message) -> Iterator[tuple[Topic, _Rows]]:
        """Yield the instances of a message; none of one without a time."""
        if (clock := _clock(message)) is None:
            return
        numbered = _NUMBERED.fullmatch(message.name)
        base = message.name if numbered is None else numbered["message"]
        base = _OLD_NAMES.get(base, base)
        time_s = numbers(self._log.column(message, clock[0])) * clock[1]
        units = {name: _unit(message, base, name)[0] for name, of in message.letters.items() if of not in TEXTS}
        by = message.instance
        if not by and message.units is None and base in _OF_SENSORS and "I" in message.letters:
            by = "I"
        if not by or message.letters[by] in TEXTS:
            number = "0" if numbered is None else str(int(numbered["number"]) - 1)
            rows = _Rows(message, slice(None), base)
            yield topic_of(base, number if base in _OF_SENSORS else "", time_s, units), rows
            return
        of = self._log.column(message, by)
        for number in np.unique(of).tolist():
            mine = np.flatnonzero(of == number)
            yield topic_of(base, str(int(number)), time_s[mine], units), _Rows(message, mine, base)

    def _values(self, rows: _Rows, name: str) -> Floats:
        """Return a field in its unit."""
        message = rows.message
        values = numbers(self._log.column(message, name, rows.mine))
        factor = SCALED.get(message.letters[name], 1.0) * _unit(message, rows.base, name)[1]
        if factor != 1.0:
            values *= factor
        if rows.base == "GPS" and name == "Alt" and "Status" in message.letters:
            values[self._log.column(message, "Status", rows.mine) < _FIX] = np.nan
        return values


def _clock(message: Message) -> tuple[str, float] | None:
    """Return the field of the time since power-on and its tick, s; TimeMS of GPS in 3.x is the time of the week."""
    of_gps = [("T", 1e-3)] if message.name.startswith("GPS") else []
    known = [("TimeUS", 1e-6), *of_gps, ("TimeMS", 1e-3)]
    return next((clock for clock in known if message.letters.get(clock[0], "Z") not in TEXTS), None)


def _unit(message: Message, base: str, name: str) -> tuple[str, float]:
    """Return the unit of a field and the factor to it: of FMTU, else of the sensor's field."""
    given = (message.units or {}).get(name, "")
    if given:
        return _AS_WE_WRITE.get(given, given), message.factors.get(name, 1.0)
    return _UNITS.get(name, ("", 1.0)) if base in _OF_SENSORS else ("", 1.0)
