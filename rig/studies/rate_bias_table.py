"""Counts of ``rig study rate-bias``: shares with exact intervals, and the worst flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

from rig.campaign.statistics import proportion
from rig.studies.rate_bias import POINTS, Flown
from rig.util.console import Screen


def summarise(flown: Sequence[Flown]) -> list[dict[str, Any]]:
    """Summarise by kind of fault and aircraft, and all of them last: counts, shares with exact 95 % intervals."""
    kinds = list(dict.fromkeys(x.fault.kind for x in flown))
    groups = [
        (kind, name, [x for x in flown if (x.fault.kind, x.case.aircraft) == (kind, name)])
        for kind, name in product(kinds, POINTS)
    ]
    return [
        *({"kind": kind, "aircraft": name, **_counts(group)} for kind, name, group in groups if group),
        {"kind": "all", "aircraft": "all", **_counts(flown)},
    ]


def _counts(flown: Sequence[Flown]) -> dict[str, Any]:
    return {
        "flights": len(flown),
        "within": asdict(proportion(sum(x.within for x in flown), len(flown))),
        "blamed": asdict(proportion(sum(x.blamed for x in flown), len(flown))),
        "answered": sum(x.answered_after_s is not None for x in flown),
        "early": sum(x.early for x in flown),
        "identical": sum(x.identical for x in flown),
        "lost_plain": sum(not x.plain_survived for x in flown),
        "lost_tolerant": sum(not x.tolerant_survived for x in flown),
        "most_above_plain_m": max(x.tolerant_m - x.plain_m for x in flown),
    }


def worst(flown: Sequence[Flown], most: int = 5) -> list[Flown]:
    """Sort by: out of bounds, sensor blamed, error above the plain law's, error."""
    ranked = sorted(flown, key=lambda x: (x.within, not x.blamed, x.plain_m - x.tolerant_m, -x.tolerant_m))
    return ranked[:most]


def as_dict(flown: Sequence[Flown]) -> dict[str, Any]:
    """Return the plain data of ``rig study rate-bias --json``."""
    return {"table": summarise(flown), "worst": [asdict(x) for x in worst(flown)], "rows": [asdict(x) for x in flown]}


def show(flown: Sequence[Flown], screen: Screen) -> None:
    """Print the table, and the worst flights with the commands that fly them again."""
    heads = (
        *("fault", "aircraft", "within bounds", "sensor blamed", "rate biased, early", "identical"),
        *("lost: plain, tolerant", "above plain, m"),
    )
    rows = []
    for x in summarise(flown):
        counts = (f"{x['answered']}, {x['early']}", f"{x['identical']}", f"{x['lost_plain']}, {x['lost_tolerant']}")
        shares = (_share(x["within"]), _share(x["blamed"]))
        rows.append((x["kind"], x["aircraft"], *shares, *counts, f"{x['most_above_plain_m']:.1f}"))
    screen.table(heads, rows)
    screen.print("intervals: exact, 95 %; identical: both laws gave the same surface commands, bit for bit")
    for x in worst(flown):
        told = "within bounds" if x.within else "out of bounds"
        screen.print(
            f"{told}: plain {x.plain_m:.1f} m, fault-tolerant {x.tolerant_m:.1f} m: {x.command}", soft_wrap=True
        )


def _share(rate: dict[str, Any]) -> str:
    return f"{rate['count']} of {rate['of']} ({rate['low']:.3f} to {rate['high']:.3f})"
