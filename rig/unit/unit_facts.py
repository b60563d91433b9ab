"""Texts on a unit for a log, a table and a page, from its settings as a log keeps them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rig.core.difference import difference

_BUILD: Final = 12  # characters of a hash that are shown


def differences(was: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return what differs of what two units read, a line each; was, now : as of ``about``, or of ``identity``."""
    files = "read_sha256" if "read_sha256" in was else "sha256"  # in a log or folder of an earlier version
    found = difference(*({key: one[key] for key in ("environment", files) if key in one} for one in (was, now)))
    voter_was, voter_now = was.get("voter"), now.get("voter")
    beside = differences(voter_was, voter_now) if voter_was and voter_now else []
    return found + [f"voter: {line}" for line in beside]


def what_it_reads(unit: Mapping[str, Any]) -> str:
    """Return what a unit reads, for a person: ``files median.so 0a1b2c3d4e5f; environment VOTER=mean``.

    unit : as of ``about``; empty for a unit of an earlier version, a box, or none
    """
    files = ", ".join(f"{name} {digest[:_BUILD]}" for name, digest in sorted(unit.get("read_sha256", {}).items()))
    variables = ", ".join(f"{name}={value}" for name, value in sorted(unit.get("environment", {}).items()))
    return "; ".join(f"{what} {text}" for what, text in (("files", files), ("environment", variables)) if text)


def voter(manager: str, unit: Mapping[str, Any] | None = None) -> str:
    """Return the voter of a flight, as every command names it: the unit under test, or without one the manager.

    unit : ``name``, ``role`` and ``lane`` of its settings, and those of its ``voter``
    """
    if not unit or unit.get("name") is None:
        return f"manager {manager}"
    named = f"{'law' if unit.get('role') == 'control-law' else 'unit'} {unit['name']}"
    if unit.get("lane") is not None:
        return f"manager {manager}, {named} as lane {unit['lane']}"
    if unit.get("role") != "control-law":
        return named
    return f"{voter(manager, unit.get('voter'))}, {named}"


def votes(unit: Mapping[str, Any]) -> bool:
    """Return True if a unit, by its settings in a log, replaces the manager."""
    return unit.get("role") != "control-law" or unit.get("voter") is not None


def voted_by(manager: str, unit: Mapping[str, Any] | None) -> str:
    """Return the voter for the column ``manager`` of ``runs``: ``mean``, or ``unit mvs 0a1b2c3d4e5f``.

    unit : its settings, and its build as ``sha256``; a box at an address has none
    """
    if unit is None:
        return manager
    return voter(manager, {**unit, "name": f"{unit['name']} {unit.get('sha256', '')[:_BUILD]}".rstrip()})
