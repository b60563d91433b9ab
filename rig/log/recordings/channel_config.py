"""Settings of one recorded channel: ``[channel."<signal>.<number>"]`` and ``[rotation.<triad>.<number>]`` of CONFIG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.settings import Settings
from rig.core.text import quoted

_MOST: Final = 9999  # channels of a recording
_SQUARE: Final = 1e-3  # by which the matrix of a rotation may differ from one
_TINY: Final = 1e-12  # of a coefficient that is zero but for rounding


class Channel(Settings):
    """A ``[channel]`` table: the sample is ``sign * scale * recorded + offset``, in ``unit``."""

    sign: Literal[-1, 1] = 1
    scale: float = Field(default=1.0, gt=0)
    unit: str | None = None  # of the column and of the offset; that of the signal when not given
    offset: float = 0.0  # added
    convention: Literal["0 to 360", "-180 to 180"] | None = None  # in degrees, whatever the unit, of an angle

    @property
    def is_full_turn(self) -> bool:
        """Return True if angles are counted from zero."""
        return self.convention == "0 to 360"


class Rotation(Settings):
    """A ``[rotation]`` table: from the axes of the recorder to those of the triad, v = R v_recorder.

    R = Rz(yaw) Ry(pitch) Rx(roll), or a matrix.
    """

    roll_deg: float = Field(default=0.0, ge=-360, le=360)
    pitch_deg: float = Field(default=0.0, ge=-360, le=360)
    yaw_deg: float = Field(default=0.0, ge=-360, le=360)
    matrix: list[list[float]] | None = None

    @model_validator(mode="after")
    def _is_rotation(self) -> Rotation:
        if self.matrix is None:
            return self
        if self.model_fields_set & {"roll_deg", "pitch_deg", "yaw_deg"}:
            raise ValueError("matrix: give it or angles, not both")
        if len(self.matrix) != 3 or any(len(row) != 3 for row in self.matrix):
            raise ValueError("matrix: must be three rows of three numbers")
        m = np.array(self.matrix)
        if np.abs(m @ m.T - np.eye(3)).max() > _SQUARE:
            raise ValueError("matrix: must be a rotation, its rows of length 1 and at right angles")
        if np.linalg.det(m) < 0:
            raise ValueError("matrix: mirrors an axis, which no rotation does; sign = -1 of [channel] turns one round")
        return self

    def as_matrix(self) -> NDArray[np.float64]:
        """Return R (3, 3)."""
        if self.matrix is not None:
            return np.array(self.matrix)
        (sr, sp, sy), (cr, cp, cy) = (
            f(np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg])) for f in (np.sin, np.cos)
        )
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        made = about_z @ about_y @ about_x
        return np.where(np.abs(made) < _TINY, 0.0, made)


def voting_channels(
    path: Path, default: Mapping[str, Any], signals: Mapping[str, Mapping[str, Any]]
) -> dict[str, list[int]]:
    """Return ``channels`` of the tables of signals, and under "" of the default.

    BadInput: no list of two to four different numbers; it names ``path``, the recording.
    """
    found: dict[str, list[int]] = {}
    for name, table in (("", default), *signals.items()):
        given = table.get("channels")
        if given is None:
            continue
        numbers = [c for c in given if type(c) is int and 1 <= c <= _MOST] if isinstance(given, list) else []
        if len(set(numbers)) != len(given if isinstance(given, list) else [0]) or not 2 <= len(numbers) <= CHANNELS:
            where = f"signal.{name}" if name else "default"
            raise BadInput(
                f"{path}: {where}.channels of CONFIG: must be two to {CHANNELS} different recorded channels, "
                f"got {quoted(given)}"
            )
        found[name] = numbers
    return found
