"""What a unit under test costs: the loop frame, without the log, in pairs against our own manager.

    python tests/tools/unit_bench.py FOLDER [--pairs 35] [--scenario NAME] [--forms child UDP]

FOLDER has libmonitor.so, monitor.fmu, monitor_udp (docs/examples/unit/Makefile); both sides decide the same.  A shared
host is slow for seconds at a time: all forms take turns, so that each meets the same times, and a median is of many.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from rig import loop
from rig.flight.unit_loop import unit_computer
from rig.scenario import Scenario, load
from rig.unit.unit import UnitUnderTest, running

FORMS: dict[str, dict[str, Any]] = {
    "in process": {"path": "libmonitor.so", "isolate": False},
    "child": {"path": "libmonitor.so"},
    "FMU": {"carrier": "fmu", "path": "monitor.fmu"},
    "UDP": {"carrier": "udp", "command": ["monitor_udp", "--rig", "{address}"]},
}


def frame_us(scenario: Scenario, unit: UnitUnderTest | None) -> tuple[float, float]:
    """Microseconds of a frame of the loop (plant, sensors, faults, computer): mean with all around, median frame.

    Other load on the machine takes few frames and makes them long: the mean has it, the median has not.
    """
    rig = loop.Rig(scenario, None if unit is None else unit_computer(unit))
    frames: list[float] = []
    began = time.perf_counter()
    for _, timing in loop.frames(rig, scenario):
        frames += timing["frame_us"].tolist()
    took = time.perf_counter() - began
    if unit is not None:
        unit.end()
    return took / scenario.frames * 1e6, median(frames)


Pair = tuple[tuple[float, float], tuple[float, float]]  # of frame_us: ours, theirs


def told(pairs: list[Pair], measure: int) -> str:
    """One of both measures of all pairs."""
    ours, theirs = (median(side[measure] for side in both) for both in zip(*pairs, strict=True))
    ratios = [theirs[measure] / ours[measure] for ours, theirs in pairs]
    low, middle, high = quantiles(ratios, n=4)
    return (
        f"ours {ours:6.2f} us, unit {theirs:6.2f} us, ratio median {middle:.3f} "
        f"(quartiles {low:.3f} {high:.3f}, all {min(ratios):.3f} to {max(ratios):.3f})"
    )


def unit_file(folder: Path, built: Path, form: str) -> Path:
    """The unit file of a form, in ``folder``."""
    keys = {"name": "monitor", **FORMS[form]}
    if "path" in keys:
        keys["path"] = str(built / keys["path"])
    if "command" in keys:
        program, *rest = keys["command"]
        keys["command"] = [str(built / program), *rest]
    path = folder / f"{form}.toml"
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()))
    return path


def measured(scenario: Scenario, built: Path, forms: list[str], pairs: int) -> dict[str, list[Pair]]:
    """Pairs of flights of each form, the forms in turns."""
    found: dict[str, list[Pair]] = {form: [] for form in forms}
    with tempfile.TemporaryDirectory() as name, ExitStack() as units:
        running_units = {form: units.enter_context(running(unit_file(Path(name), built, form))) for form in forms}
        for unit in (None, *running_units.values()):
            frame_us(scenario, unit)  # compiles
        for _ in range(pairs):
            for form, unit in running_units.items():
                found[form].append((frame_us(scenario, None), frame_us(scenario, unit)))
    return found


def main() -> None:
    """Print two lines a form."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=35)
    parser.add_argument("--scenario")
    parser.add_argument("--forms", nargs="+", choices=FORMS, default=list(FORMS))
    given = parser.parse_args()
    for form, pairs in measured(load(given.scenario), given.folder.resolve(), given.forms, given.pairs).items():
        for i, measure in enumerate(("mean", "median frame")):
            print(f"{form:10} {measure:12}  {told(pairs, i)} of {given.pairs} pairs", flush=True)


if __name__ == "__main__":
    main()
