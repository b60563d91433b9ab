"""Durations in frames, or in seconds, which hold at every frame rate."""

from __future__ import annotations

from rig.core.frame import to_frame
from rig.core.settings import Settings


def refuse_both(settings: Settings, *names: str) -> None:
    """Raise ValueError when a setting is given in frames, ``<name>``, and in seconds, ``<name>_s``."""
    for name in names:
        if getattr(settings, f"{name}_s") is not None and name in settings.model_fields_set:
            raise ValueError(f"{name} and {name}_s are the same setting, give one of them")


def in_frames(frames: int, seconds: float | None, rate_hz: float) -> int:
    """Return ``frames``, or of a time that was given instead the frames that last at least as long, one or more."""
    return frames if seconds is None else max(1, to_frame(seconds, rate_hz))
