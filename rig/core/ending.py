"""The end of a flight in words, from what logs and tables keep of it."""

from __future__ import annotations

from typing import Final

from rig.core.frame import End
from rig.core.units.quantities import seconds

WHOLE: Final = "duration flown"  # the end reason of a flight that was neither lost nor interrupted
_CAUSES: Final = {end.label: end.cause for end in End}


def why_lost(end_reason: str) -> str:
    """Return why a flight was lost: ``angle of attack beyond its limit``."""
    return _CAUSES.get(end_reason, end_reason)


def lost_at(frames: int, rate_hz: float) -> str:
    """Return the time of the last of ``frames``, in which the aircraft was lost, with its unit; as its event has it."""
    return seconds(max(frames - 1, 0), rate_hz)


def ending(survived: bool, end_reason: str, frames: int, rate_hz: float) -> str:
    """Return ``survived, 60 s flown`` or ``lost at 10.60 s: angle of attack beyond its limit``."""
    if not survived:
        return f"lost at {lost_at(frames, rate_hz)}: {why_lost(end_reason)}"
    flown = f"survived, {frames / rate_hz:g} s flown"
    return flown if end_reason == WHOLE else f"{flown}, {end_reason or 'no reason given'}"
