"""The time in a field of a message: seconds and nanoseconds, a text of ISO 8601, or a number."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

_SECONDS: Final = ("sec", "secs", "seconds")
_NANOSECONDS: Final = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")


def seconds(value: Any) -> Any:
    """Return the seconds of a stamp; any other value as it is.

    A stamp is a JSON object or a protobuf message of seconds and nanoseconds, as header.stamp is, or a text of
    ISO 8601 (without a zone: UTC).
    """
    if isinstance(value, float | int) or value is None:
        return value
    if isinstance(value, str):
        return _of_text(value)
    whole, rest = _part(value, _SECONDS), _part(value, _NANOSECONDS)
    return value if whole is None or rest is None else float(whole) + float(rest) * 1e-9


def _part(value: Any, names: tuple[str, ...]) -> Any:
    if isinstance(value, Mapping):
        return next((value[name] for name in names if name in value), None)
    fields = getattr(getattr(value, "DESCRIPTOR", None), "fields_by_name", {})
    return next((getattr(value, name) for name in names if name in fields), None)


def _of_text(text: str) -> Any:
    if "T" not in text and ":" not in text:
        return text
    at = datetime.fromisoformat(text)
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()
