"""A row's parts by themselves: what kernels of the computer are given, for the tests that call one."""

from __future__ import annotations

from typing import Any

from rig.computer.analytic import references
from rig.frame import Block, nested


def ports(block: Block, k: int) -> tuple[Any, Any]:
    """BUS and FCC records of row k: the row's own memory."""
    row = nested(block)[k]
    return row["bus"], row["fcc"]


def refer(block: Block, k: int, data: references.ReferenceData) -> None:
    """Write the references of row k."""
    references.refer(*ports(block, k), data)


def remember(block: Block, k: int, data: references.ReferenceData) -> None:
    """Keep the votes of row k."""
    references.remember(*ports(block, k), data)
