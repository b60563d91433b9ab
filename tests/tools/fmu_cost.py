"""CPU time of a step of an aircraft's FMU in FMPy, of both versions: the step, the inputs, and all outputs.

python tests/tools/fmu_cost.py [SCENARIO] [FRAMES]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Any, Final, get_args

sys.path.insert(0, str(Path(__file__).parents[1]))

from fmu_master import INPUTS, Master

from rig.flight.aircraft_fmu.aircraft_archive import build
from rig.flight.loop import fly_rows
from rig.scenario.scenario import load
from rig.unit.fmu_description import Version

WARM: Final = 100  # frames that are not counted
PARTS: Final = ("inputs", "step", "outputs")


def cost(name: str, version: Version, frames: int, folder: Path) -> dict[str, float]:
    """Return the CPU time of each part of a step, us."""
    build(name, folder / f"{version}.fmu", version)
    rows = fly_rows(load(name), frames + WARM)
    master, sums = Master(folder / f"{version}.fmu", folder), dict.fromkeys(PARTS, 0.0)
    by_type: dict[str, list[Any]] = {}
    for variable in master.described.modelVariables:
        if variable.causality == "output":
            by_type.setdefault(variable.type, []).append(variable)
    readers = [master.reader([variable.name for variable in kind]) for kind in by_type.values()]
    for k in range(len(rows) - 1):
        acts = (
            lambda k=k: master.put(INPUTS, rows["surface"][k].tolist()),
            master.step,
            lambda: [read() for read in readers],
        )
        for part, act in zip(PARTS, acts, strict=True):
            began = process_time()
            act()
            sums[part] += (process_time() - began) * (k >= WARM)
    master.close()
    return {part: total / (len(rows) - 1 - WARM) * 1e6 for part, total in sums.items()}


def main() -> None:
    """Print one line for each version."""
    name = sys.argv[1] if len(sys.argv) > 1 else "f16_pitch_rate_hardover"
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 5000
    for version in get_args(Version):
        with tempfile.TemporaryDirectory() as folder:
            found = cost(name, version, frames, Path(folder))
        texts = ", ".join(f"{part} {us:.0f}" for part, us in found.items())
        print(f"{name}, FMI {version}.0: {texts}, together {sum(found.values()):.0f} us of CPU a frame")


if __name__ == "__main__":
    main()
