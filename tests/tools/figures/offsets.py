"""The smallest offset of one channel that is found, and what the largest that is not found does to the aircraft."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from evidence_rows import AIRCRAFT, SIGNAL_NAMES, Table, flight, manoeuvre, offset, toml

from figures import table
from rig.core.frame import INDEX
from rig.scenario import scenario
from rig.studies.campaign.flying import fly
from rig.studies.campaign.pool import each

LEAST_FAULTS: Final = 30  # to say a share of
DETECTED_SHARE: Final = 0.99
BELOW: Final = 0.9  # of a threshold
ONSET_S: Final = 4.0
LIMIT_G: Final = 0.5
LIMIT_DEG_S: Final = 10.0
DESIGNS: Final = {"two alike": 4, "one of two": 2}  # channels that go on when the fault is not found
CONDITIONS: Final = {
    "level": (),
    "manoeuvre": (
        "pilot.autopilot_engaged=false",
        "pilot.manoeuvres=" + toml([manoeuvre("3-2-1-1", "stick_pitch", 3.0, 0.3, duration_s=3.5)]),
    ),
}
GONE: Final = [{"kind": "hardover", "channels": [c], "start_s": 0.5 + 0.4 * i} for i, c in enumerate((3, 4))]
RATES: Final = ("roll_rate", "pitch_rate", "yaw_rate")


def smallest(faults: pl.DataFrame) -> str:
    """Return the size from which on at least 99 % are isolated rightly; - where too few are."""
    ordered = faults.sort("magnitude")
    sizes, right = ordered["magnitude"].to_numpy(), (ordered["isolation"] == "correct").to_numpy().astype(float)
    share = np.cumsum(right[::-1])[::-1] / np.arange(len(right), 0, -1)  # of the faults from each on
    good = np.flatnonzero(share[: len(share) - LEAST_FAULTS + 1] >= DETECTED_SHARE)
    return f"{sizes[good[0]]:.3g}" if len(good) else "-"


def found_from(folder: str) -> dict[str, list[str]]:
    """Return how many faults of each signal a folder of ``detectability`` has, and the smallest found: all, of each."""
    runs = pl.read_parquet(Path(folder) / "runs" / "*.parquet").select("run", "aircraft")
    faults = pl.read_parquet(Path(folder) / "faults" / "*.parquet").join(runs, on="run")
    rows: dict[str, list[str]] = {}
    for signal in SIGNAL_NAMES:
        of_signal = faults.filter(pl.col("signal") == signal)
        parts = [of_signal, *(of_signal.filter(pl.col("aircraft") == name) for name in AIRCRAFT)]
        rows[signal] = [str(len(of_signal)), *map(smallest, parts)]
    return rows


def flown(aircraft: str, condition: str, faults: list[Table]) -> Any:
    """Return the frames of a flight of ten seconds."""
    sets = flight("undetected", "", aircraft, 10.0, faults, *CONDITIONS[condition], "seed=3").sets
    return fly(scenario.load(None, sets)).rows


def moved(case: tuple[str, str, str, str]) -> tuple[str, str, float, float, int]:
    """Return signal, design, largest change of load factor [g] and of a body rate [deg/s], flights that found it."""
    aircraft, condition, name, design = case
    earlier = [] if design == "two alike" else [{**fault, "signal": name} for fault in GONE]
    channels = [1, 2] if design == "two alike" else [1]
    usual = flown(aircraft, condition, earlier)["truth"]
    load_g, rate_deg_s, found = 0.0, 0.0, 0
    for sign in (1, -1):
        rows = flown(aircraft, condition, [offset(name, channels, sign * BELOW, ONSET_S), *earlier])
        n = min(len(rows), len(usual))
        change = np.abs(rows["truth"][:n] - usual[:n])
        load_g = max(load_g, float(change[:, INDEX["normal_load_factor"]].max()))
        rate_deg_s = max(rate_deg_s, float(np.degrees(change[:, [INDEX[rate] for rate in RATES]].max())))
        found += int(rows["level"][-1, INDEX[name]] < DESIGNS[design])
    return name, design, load_g, rate_deg_s, found


def worst(results: list[tuple[str, str, float, float, int]]) -> Iterator[list[str]]:
    """Yield a row for each signal."""
    for name in SIGNAL_NAMES:
        mine = {design: [result for result in results if result[:2] == (name, design)] for design in DESIGNS}
        moves = [
            max(column) for design in DESIGNS for column in zip(*(result[2:4] for result in mine[design]), strict=True)
        ]
        load_g, rate_deg_s = max(moves[::2]), max(moves[1::2])
        nearer = "load factor" if load_g / LIMIT_G > rate_deg_s / LIMIT_DEG_S else "rate"
        over = "over" if load_g > LIMIT_G or rate_deg_s > LIMIT_DEG_S else "within"
        found = sum(result[4] for design in DESIGNS for result in mine[design])
        yield [name, *(f"{move:.3g}" for move in moves), f"{nearer}, {over}", str(found)]


def offsets(folder: str) -> None:
    """Print the smallest offset that is found, in a folder of the campaign ``detectability``.

    Beside it: how far offsets of 0.9 thresholds move the aircraft; two of four alike, and one of the last two.
    """
    cases, of_folder = list(product(AIRCRAFT, CONDITIONS, SIGNAL_NAMES, DESIGNS)), found_from(folder)
    heads = (
        *("signal", "faults", "all aircraft", *AIRCRAFT),
        "two alike: g",
        "deg/s",
        "one of two: g",
        "deg/s",
        f"limits {LIMIT_G:g} g, {LIMIT_DEG_S:g} deg/s",
    )
    moves = worst(list(each(moved, cases, 2)))
    table((*heads, "found after all"), ([name, *of_folder[name], *row] for name, *row in moves))
