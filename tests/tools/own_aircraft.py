"""Make, check and fly aircraft from models of JSBSim's, by the commands alone: ``python tests/tools/own_aircraft.py``.

Prints one table: aircraft, flight point, trim, least margins, what the flight came to (60 s with autopilot hold and a
pitch-rate hardover on channel 3).  Base models as arguments; a few minutes each.  Exit code 1 when one does not fly.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

BASES = ("c172x", "c310", "A320")
HEADS = ("aircraft", "flight point", "trim: m/s, alpha deg, throttle", "least gain dB", "least phase deg", "flight")
Row = tuple[str, ...]


def rig(folder: Path, *words: str) -> tuple[int, str, str]:
    """Exit code, output and errors of one command."""
    command = [sys.executable, "-m", "rig", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    return done.returncode, done.stdout, done.stderr.strip()


def rows(folder: Path, base: str) -> list[Row]:
    """One row a flight point; one that says why when the aircraft cannot be made."""
    name = f"my_{base}"
    code, _, error = rig(folder, "aircraft", "new", name, "--base", base)
    if code:
        return [(base, "-", error, "-", "-", "not made")]
    _, output, _ = rig(folder, "aircraft", "check", name, "--json")
    checked = json.loads(output)
    return [_row(folder, name, trim, checked["loops"]) for trim in checked["trims"]]


def _row(folder: Path, name: str, trimmed: dict[str, Any], loops: list[dict[str, Any]]) -> Row:
    trim = trimmed["trim"]
    text = f"{trim['airspeed_m_s']:.0f}, {trim['alpha_rad'] * 57.29578:.1f}, {trim['throttle']:.2f}"
    margins = [loop["margin"] for loop in loops if loop["point"] == trimmed["name"]]
    gain = min(min(m["gain_increase_db"], m["gain_decrease_db"]) for m in margins)
    phase = min(m["phase_deg"] for m in margins)
    outcome = flown(folder, name, trimmed["name"])
    return (name, trimmed["name"], text, f"{gain:.1f}", f"{phase:.1f}", outcome)


def flown(folder: Path, name: str, point: str) -> str:
    """What a flight came to: ``good`` first when it flew on and failed that channel and no other."""
    words = ("fly", f"{name}/hardover.toml", "--set", f"flight_point={point}", "--json")
    code, output, error = rig(folder, *words)
    if code:
        return error
    flight = json.loads(output)
    peaks = flight["peaks"]
    good = flight["survived"] and flight["failed"] == {"pitch_rate": [3]} and flight["duration_s"] == 60.0
    held = f"altitude off by {peaks['altitude_deviation_m']:.1f} m, failed {flight['failed']}"
    return f"{'good' if good else 'not good'}: {flight['end_reason']}, {held}"


def main() -> None:
    """Print the table."""
    good = True
    print(f"| {' | '.join(HEADS)} |", f"|{'---|' * len(HEADS)}", sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for base in sys.argv[1:] or BASES:
            for row in rows(Path(folder), base):
                print(f"| {' | '.join(row)} |", flush=True)
                good = good and row[-1].startswith("good")
    sys.exit(not good)


if __name__ == "__main__":
    main()
