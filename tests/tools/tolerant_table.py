"""Tables of tolerant.py: faults found by row, fault-free hours with exact intervals."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.campaign.statistics import poisson

SETTLED_S: Final = 10  # after which the usual difference of the rates is known
Table = dict[str, Any]


def counts(flown: list[Table]) -> str:
    """Faults found, a line each row, fault and way of flying at the onset."""
    heads = "flights | found | before the onset | `RATE_BIAS` | after, s | estimate off by, mrad"
    lines = [f"| row | fault | | {heads} |", "|---|---|---|---|---|---|---|---|---|"]
    for which in dict.fromkeys(kind(x) for x in flown):
        mine = [x for x in flown if kind(x) == which]
        delays = [x["after_s"] for x in mine if x["after_s"] is not None]
        span = f"{min(delays):.2f} to {max(delays):.2f}" if delays else "never"
        sums = [len(mine), len(delays), sum(x["before"] for x in mine), sum(x["biased"] for x in mine)]
        off = 1e3 * max(x["estimate_rad"] for x in mine)
        lines.append(f"| {' | '.join(which)} | {' | '.join(map(str, sums))} | {span} | {off:.1f} |")
    return "\n".join(lines)


def kind(one: Table) -> tuple[str, str, str]:
    """The line that a flight counts in."""
    return one["row"], one["fault"], one["where"]


def same_frame(flown: list[Table]) -> str:
    """How many faults were found in the same frame with the unit and with it lost, and which were not."""
    ours, theirs = ([x for x in flown if x["row"] == row] for row in ("with the unit", "unit lost"))
    pairs = [(a, a["after_s"], b["after_s"]) for a, b in zip(ours, theirs, strict=True)]
    lines = [f"{' '.join(named(one))}: {a} s with the unit, {b} s with it lost" for one, a, b in pairs if a != b]
    same = sum(a is not None and a == b for _, a, b in pairs)
    return "\n".join([*lines, f"found in the same frame by both: {same} of {len(pairs)}"])


def named(one: Table) -> list[str]:
    """A flight: fault, aircraft, flight point, turbulence, straight or turn."""
    return [one["fault"], *(one["case"][key] for key in ("aircraft", "flight_point", "turbulence")), one["where"]]


def fault_free(flown: list[Table]) -> str:
    """Hours, trips, and how near to a trip they came."""
    rate = poisson(sum(x["trips"] for x in flown), sum(x["hours"] for x in flown))
    one, two = (max(x["sigmas"][i] for x in flown) for i in (0, 1))
    bank, tilt, apart, both = np.concatenate([x["seconds"][SETTLED_S:] for x in flown]).T
    first = max(row[2] for x in flown for row in x["seconds"][:SETTLED_S])
    return "\n".join(
        (
            f"{rate.count} trips in {rate.of:.1f} hours ({rate.low:.2g} to {rate.high:.2g} an hour, exact, 95 %)",
            f"RATE_BIAS in {sum(x['biased'] for x in flown)} of {len(flown)} flights",
            f"innovation: {one:.2f} sigma in one frame, {two:.2f} in two running",
            f"estimate off by {1e3 * max(x['estimate_rad'] for x in flown):.2f} mrad",
            f"bank angles: {spread(bank)} mrad, {int((bank > 0.04).sum())} times over 40; tilt: {spread(tilt)} mrad",
            f"rates: {spread(apart)} mrad/s; in the first {SETTLED_S} s {1e3 * first:.2f}",
            f"both rates in order at the end of {int(both.sum())} of {len(both)} seconds after that",
        )
    )


def spread(values: NDArray[np.float64]) -> str:
    """The largest, and below what 99 % are; in thousandths."""
    return f"{1e3 * values.max():.2f} (99 %: {1e3 * np.quantile(values, 0.99):.2f})"
