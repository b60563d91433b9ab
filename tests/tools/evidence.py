"""What the monitor gets wrong: last channels, third faults, splits, boxes, common faults, healthy channels, counted.

    python tests/tools/evidence.py [--workers 2] [--rows last,third,... | --counts] [--set KEY=VALUE] [--json FILE]

Every row flies each signal, sign and aircraft that its function in evidence_rows.py names; the same code prints the
same counts.  Asked for by name alone: slow, slow-weather, references-healthy, whole-boxes, bursts, trend.  What became
of these is read from the frames, beside the truth and the samples before any fault; each has a table of its own.
--counts flies all rows and leaves these tables out.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Final

from evidence_found import outcome_of
from evidence_rows import BY_FRAMES, COUNTED, Table

Cells = Mapping[str, Callable[[list[Table]], object]]


def words(one: Table) -> list[str]:
    """Return aircraft, and what else its row says about a flight."""
    return str(one["about"]).split()


def grid(
    head: str,
    found: list[Table],
    lines: Callable[[Table], Sequence[str]],
    across: Callable[[Table], str],
    cells: Cells,
) -> str:
    """Return a table: each flight counts in all of its ``lines``, in the columns of what it is ``across``."""
    groups = list(dict.fromkeys(map(across, found)))
    kept: dict[tuple[int, str], dict[str, list[Table]]] = {}
    for one in found:
        for place in enumerate(lines(one)):
            kept.setdefault(place, {group: [] for group in groups})[across(one)].append(one)
    columns = [head, *(f"{group}: {cell}" if cell else group for group in groups for cell in cells)]
    text = [" | ".join(columns), "|".join("---" for _ in columns)]
    for (_, line), of in sorted(kept.items(), key=lambda item: item[0][0]):
        text.append(" | ".join([line, *(str(cell(of[group])) for group in groups for cell in cells.values())]))
    return "\n".join([f"| {text[0]} |", f"|{text[1]}|", *(f"| {line} |" for line in text[2:])])


def sums(key: str) -> Callable[[list[Table]], int]:
    """Return what counts the flights in which ``key`` is there."""
    return lambda flights: sum(bool(one[key]) for one in flights)


def drifts(row: str, found: list[Table]) -> str:
    """Return flights with a drift by signal, aircraft, thresholds a second and all together, by kind."""
    cells: Cells = {
        **{"flights": len, "right": sums("right"), "wrong": sums("wrong"), "undeclared": sums("undeclared")},
        **{"lost": lambda flights: len(flights) - sums("survived")(flights), "given up": sums("given_up")},
    }

    def lines(one: Table) -> list[str]:
        aircraft, signal, _, rate = words(one)
        return [signal, aircraft, rate.lstrip("+-") + "/s", "all"]

    return grid(row, found, lines, lambda one: words(one)[2], cells)


def trends(row: str, found: list[Table]) -> str:
    """Return what a third fault and two alike come to without a reference, by signal, by the window of the trend."""
    cells: Cells = {
        **{"flights": len, "right": sums("right"), "wrong": sums("wrong"), "undeclared": sums("undeclared")},
        **{"given up": sums("given_up")},
    }
    return grid(row, found, lambda one: [words(one)[1], words(one)[2], "all"], lambda one: words(one)[3], cells)


def units(row: str, found: list[Table]) -> str:
    """Return failed channels of the faulty signals and all of them, of the rest of their box, of healthy boxes."""
    cells: Cells = {
        "faulty failed": lambda flights: (
            f"{sum(one['faulty'] - len(one['missed']) for one in flights)} of {sum(one['faulty'] for one in flights)}"
        ),
        "rest of the box": lambda flights: sum(len(one["unit"]) for one in flights),
        "healthy": lambda flights: sum(len(one["wrong"]) + len(one["along"]) for one in flights),
    }
    return grid(row, found, lambda one: [" ".join(words(one)[1:3]), "all"], lambda one: words(one)[3], cells)


def burst(row: str, found: list[Table]) -> str:
    """Return flights in which anybody was failed, and all, by frames and signal, by size and filter."""
    cells: Cells = {"": lambda flights: f"{sums('wrong')(flights)} of {len(flights)}"}

    def across(one: Table) -> str:
        filtered = "" if words(one)[2] == "0" else f", filter {words(one)[2]} s"
        return words(one)[4].lstrip("+-") + " thresholds" + filtered

    def lines(one: Table) -> list[str]:
        return [f"frames: {words(one)[3]}", words(one)[1], "all"]

    return grid(row, found, lines, across, cells)


def references(row: str, found: list[Table]) -> str:
    """Return the largest error of each reference, in its thresholds, and the share of frames without a usable one."""
    each = [
        {"signal": name, "aircraft": words(one)[0], "error": error, "unusable": share}
        for one in found
        for name, (error, share) in one["references"].items()
    ]
    cells: Cells = {
        "largest error": lambda flights: f"{max(one['error'] for one in flights):.3f}",
        "unusable": lambda flights: f"{100.0 * sum(one['unusable'] for one in flights) / len(flights):.2f} %",
    }
    return grid(row, each, lambda one: [one["signal"]], lambda one: one["aircraft"], cells)


OF_ROW: Final[dict[str, Callable[[str, list[Table]], str]]] = {
    **{"slow": drifts, "slow-weather": drifts, "references-healthy": references},
    **{"whole-boxes": units, "bursts": burst, "trend": trends},
}
LISTED: Final = 40  # flights of a row that are not right; more are in the JSON file alone


def counts(found: list[Table]) -> str:
    """The counts, a line each row."""
    lines = [
        "| row | flights | hours | survive | right | flights that fail a healthy channel | and leave a faulty one |"
    ]
    lines.append("|---|---|---|---|---|---|---|")
    for row in dict.fromkeys(one["row"] for one in found):
        mine = [one for one in found if one["row"] == row]
        sums = [sum(bool(one[key]) for one in mine) for key in ("survived", "right", "wrong", "missed")]
        hours = sum(one["hours"] for one in mine)
        lines.append(f"| {row} | {len(mine)} | {hours:.1f} | " + " | ".join(map(str, sums)) + " |")
    return "\n".join(lines)


def not_right(found: list[Table]) -> str:
    """Return a line for each row: its flights that are not right, aircraft that are wrong alike together."""
    rows: dict[str, dict[str, list[str]]] = {}
    for flown in found:
        if not (flown["right"] and flown["survived"]):
            name, _, about = flown["about"].partition(" ")
            wrong = f" fails {', '.join(flown['wrong'])}" if flown["wrong"] else ""
            missed = f" leaves {len(flown['missed'])}" if flown["missed"] else ""
            off = f" flies {', '.join(flown['undeclared'])} off" if flown.get("undeclared") else ""
            lost = "" if flown["survived"] else " loses the aircraft"
            rows.setdefault(flown["row"], {}).setdefault(f"{about}:{wrong}{missed}{off}{lost}", []).append(name)
    return "\n".join(
        f"- {row}: " + "; ".join(f"{', '.join(names)} {about}" for about, names in flights.items())
        for row, flights in rows.items()
        if sum(map(len, flights.values())) <= LISTED
    )


def main() -> int:
    """Fly the rows that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--rows", default=",".join(COUNTED))
    which.add_argument("--counts", action="store_true", help="of all rows, without the tables of single rows")
    parser.add_argument("--set", action="append", default=[], help="laid over the settings of every flight")
    parser.add_argument("--json", default="")
    asked, rows = parser.parse_args(), {**COUNTED, **BY_FRAMES}
    names = list(rows) if asked.counts else asked.rows.split(",")
    unknown = [row for row in names if row not in rows]
    if unknown:
        parser.error(f"--rows: not {', '.join(unknown)}: allowed: {', '.join(rows)}")
    tries = [one.seeded(i, asked.set) for row in names for i, one in enumerate(rows[row](), 1)]
    began = perf_counter()
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("forkserver")) as pool:
        found = list(pool.map(outcome_of, tries, chunksize=4))
    tables = [
        of(row, mine)
        for row, of in OF_ROW.items()
        if not asked.counts and (mine := [one for one in found if one["row"] == row])
    ]
    print(counts(found), *tables, not_right(found), sep="\n\n")
    print(f"\n{len(found)} flights in {perf_counter() - began:.0f} s")
    if asked.json:
        Path(asked.json).write_text(json.dumps(found, indent=0), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
