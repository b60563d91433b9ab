"""The ``[computers]`` table: how many computers fly."""

from __future__ import annotations

from pydantic import Field

from rig.frame import COMPUTERS
from rig.settings import Settings


class Config(Settings):
    """The computers of a flight, lanes A to D: each owns its channel of every signal, discrete and servo."""

    count: int = Field(default=1, ge=1, le=len(COMPUTERS))  # 1: one computer reads all channels
