"""Make and fly aircraft from models of JSBSim's, by the commands alone: ``python tests/tools/own_aircraft.py``.

Prints one table: model, kind, seconds of ``rig aircraft new``, what its flights came to at each flight point (60 s with
autopilot hold and a pitch-rate hardover on channel 3), or why it is refused.  Base models as arguments, else every one
of the installed JSBSim, which takes hours; ``--propose``: only trim them, some seconds each.  Exit code 1 when one ends
neither in flight nor in a refusal of one line.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HEADS = ("model", "kind", "s", "flown or refused")


def rig(folder: Path, *words: str) -> tuple[int, str, str]:
    """Exit code, output and errors of one command."""
    command = [sys.executable, "-m", "rig", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    return done.returncode, done.stdout, done.stderr.strip()


def row(folder: Path, base: str, *options: str) -> tuple[bool, tuple[str, ...]]:
    """Whether it flies or is refused in one line, and the row of one model."""
    began, name = time.monotonic(), f"my_{base}"
    code, output, error = rig(folder, "aircraft", "new", name, "--base", base, "--json", *options)
    seconds = f"{time.monotonic() - began:.0f}"
    if code:
        refused = code == 2 and len(error.splitlines()) == 1 and not (folder / name).exists()
        return refused, (base, "-", seconds, f"refused: {error.removeprefix('error: ')}")
    made = json.loads(output)
    points = [point["name"] for point in made["airframe"]["flight_points"]]
    if options:
        return True, (base, made["kind"], seconds, f"trims: {', '.join(points)}")
    flights = [flown(folder, name, point) for point in points]
    return all(good for good, _ in flights), (base, made["kind"], seconds, "; ".join(text for _, text in flights))


def flown(folder: Path, name: str, point: str) -> tuple[bool, str]:
    """Whether a flight went on and failed that channel and no other, and what it came to."""
    words = ("fly", f"{name}/{name}_hardover.toml", "--set", f"flight_point={point}", "--json")
    code, output, error = rig(folder, *words)
    if code:
        return False, error
    flight: dict[str, Any] = json.loads(output)
    good = flight["survived"] and flight["failed"] == {"pitch_rate": [3]} and flight["duration_s"] == 60.0
    words_of_it = "flown" if good else f"not good: {flight['end_reason']}, failed {flight['failed']}"
    return good, f"{point} {words_of_it}, altitude off by {flight['peaks']['altitude_deviation_m']:.1f} m"


def main() -> None:
    """Print the table."""
    from rig.world.plant.base_model import names

    asked = [word for word in sys.argv[1:] if not word.startswith("--")]
    options = ("--no-design",) if "--propose" in sys.argv else ()
    good = True
    print(f"| {' | '.join(HEADS)} |", f"|{'---|' * len(HEADS)}", sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for base in asked or names():
            fine, cells = row(Path(folder), base, *options)
            print(f"| {' | '.join(cells)} |", flush=True)
            good = good and fine
    sys.exit(not good)


if __name__ == "__main__":
    main()
