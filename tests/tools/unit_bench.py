"""What a unit under test costs: the loop frame, without the log, in pairs against our own manager.

    python tests/tools/unit_bench.py FOLDER [--pairs 7] [--scenario NAME] [--forms child UDP]

FOLDER has libmonitor.so, monitor.fmu, monitor_udp (docs/examples/unit/Makefile); both sides decide the same.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from statistics import median

from rig import loop
from rig.computer.external.unit import UnitUnderTest, running
from rig.scenario import Scenario, load
from rig.under_test import put

FORMS = {
    "in process": {"path": "libmonitor.so", "isolate": False},
    "child": {"path": "libmonitor.so"},
    "FMU": {"carrier": "fmu", "path": "monitor.fmu"},
    "UDP": {"carrier": "udp", "command": ["monitor_udp", "--rig", "{address}"]},
}


def frame_us(scenario: Scenario, unit: UnitUnderTest | None) -> tuple[float, float]:
    """Microseconds of a frame of the loop (plant, sensors, faults, computer): mean with all around, median frame.

    Other load on the machine takes few frames and makes them long: the mean has it, the median has not.
    """
    rig = loop.Rig(scenario)
    if unit is not None:
        put(unit, rig, scenario)
    frames: list[float] = []
    began = time.perf_counter()
    for _, timing in loop.frames(rig, scenario):
        frames += timing["frame_us"].tolist()
    took = time.perf_counter() - began
    if unit is not None:
        unit.end()
    return took / scenario.frames * 1e6, median(frames)


def told(pairs: list[tuple[float, float]]) -> str:
    """One of both measures of all pairs."""
    ratios = sorted(theirs / ours for ours, theirs in pairs)
    ours, theirs = (median(side) for side in zip(*pairs, strict=True))
    return (
        f"ours {ours:6.2f} us, unit {theirs:6.2f} us, ratio median {median(ratios):.3f} "
        f"({ratios[0]:.3f} to {ratios[-1]:.3f})"
    )


def main() -> None:
    """Print a line a form."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--scenario")
    parser.add_argument("--forms", nargs="+", choices=FORMS, default=list(FORMS))
    given = parser.parse_args()
    scenario = load(given.scenario)
    frame_us(scenario, None)  # compiles
    for form in given.forms:
        keys = FORMS[form]
        keys = {key: str(given.folder.resolve() / value) if key == "path" else value for key, value in keys.items()}
        if "command" in keys:
            program, *rest = FORMS[form]["command"]
            keys["command"] = [str(given.folder.resolve() / program), *rest]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "unit.toml"
            lines = {"name": "monitor", **keys}
            file.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in lines.items()))
            with running(file) as unit:
                frame_us(scenario, unit)  # compiles
                pairs = [(frame_us(scenario, None), frame_us(scenario, unit)) for _ in range(given.pairs)]
        for i, measure in enumerate(("mean", "median frame")):
            found = told([(ours[i], theirs[i]) for ours, theirs in pairs])
            print(f"{form:10} {measure:12}  {found} of {given.pairs} pairs", flush=True)


if __name__ == "__main__":
    main()
