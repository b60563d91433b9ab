"""A recorded noise file: four columns of CSV, one a channel, in the unit of the signal, at its own rate.

It replaces the drawn noise.  The start is drawn from the seed, the same row for all four columns, so that
noise common to the channels stays common; after the last row comes the first.  Between rows the noise is on the
straight line: nothing but additions and multiplications of single numbers, so every machine gets the same bits.

A scenario keeps the file's place and SHA-256, not its rows: flown again from a log, the file must still be there and
be the same, or the flight is refused.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.files import is_file, read_bytes
from rig.core.frame import CHANNELS
from rig.core.text import shorten
from rig.world.sensors.data_sheet import Sensor

LARGEST_NOISE: Final = 128 << 20  # bytes of a file


class Recorded:
    """The rows of a noise file at the rate of the flight."""

    def __init__(self, sensor: Sensor, name: str, rate_hz: float, rng: Generator) -> None:
        """Raise BadInput when the file cannot be used, or is not the one that the scenario was loaded with."""
        where = f"sensors.{name}.noise_file"
        path = Path(str(sensor.noise_file))
        data = _bytes(path, where)
        sha256 = hashlib.sha256(data).hexdigest()
        if sensor.noise_sha256 not in (None, sha256):
            changed = f"SHA-256 is {sha256}, must be {sensor.noise_sha256}"
            raise BadInput(f"{where}: {path} has changed: {changed}")
        self._rows = _parse(data, path, where)
        self._step = float(sensor.noise_rate_hz or rate_hz) / rate_hz  # rows a frame
        self._start = int(rng.integers(len(self._rows)))
        self._frame = 0

    def add(self, out: Any) -> None:
        """Add the next rows to ``out`` (n, 4)."""
        at = np.arange(self._frame, self._frame + len(out)) * self._step + self._start
        whole = np.floor(at)
        row = whole.astype(np.int64) % len(self._rows)
        before, after = self._rows[row], self._rows[(row + 1) % len(self._rows)]
        out += before + (at - whole)[:, None] * (after - before)
        self._frame += len(out)


def pin(sensors: Any, folder: Path) -> Any:
    """Return the ``[sensors]`` table with the place and SHA-256 of every noise file written in.

    A file is looked for beside the scenario (``folder``), then from the present folder.  A SHA-256 that stands there
    already is kept.  BadInput when there is no such file.
    """
    if not isinstance(sensors, dict):
        return sensors  # refused later, with its key
    pinned = dict(sensors)
    for name, table in sensors.items():
        file = table.get("noise_file") if isinstance(table, dict) else None
        if isinstance(file, str):
            where = f"sensors.{name}.noise_file"
            path = next((p for p in (folder / file, Path(file)) if is_file(p)), None)
            if path is None:
                raise BadInput(f"{where}: {shorten(file)}: no such file")
            path = path.resolve()
            pinned_hash = {"noise_sha256": hashlib.sha256(_bytes(path, where)).hexdigest()}
            pinned[name] = {**pinned_hash, **table, "noise_file": str(path)}
    return pinned


def _bytes(path: Path, where: str) -> bytes:
    return read_bytes(path, LARGEST_NOISE, f"{where}: {path}")


def _parse(data: bytes, path: Path, where: str) -> NDArray[np.float64]:
    """Return (rows, 4); a first line that is not numbers names the columns."""
    text = data.decode("utf-8", errors="replace")
    first = text.partition("\n")[0]
    if not text.strip():
        raise BadInput(f"{where}: {path}: is empty")
    try:
        rows = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=0 if _is_row(first) else 1, ndmin=2)
    except ValueError as error:
        raise BadInput(f"{where}: {path}: not a CSV of numbers: {str(error).splitlines()[0]}") from None
    if len(rows) < 2 or rows.shape[1] != CHANNELS:
        raise BadInput(f"{where}: {path}: must have {CHANNELS} columns and at least 2 rows, got {rows.shape[::-1]}")
    if not np.isfinite(rows).all():
        raise BadInput(f"{where}: {path}: row {int(np.argmin(np.isfinite(rows).all(axis=1))) + 1} is not finite")
    return rows


def _is_row(line: str) -> bool:
    try:
        return [float(item) for item in line.split(",")] != []
    except ValueError:
        return False
