"""The crash table: the ways in which a unit can fail, what the rig prints, its exit code, the log, what is left.

    python tests/tools/unit_crashes.py

A row a way, in Markdown.  Needs a C compiler; `rig` is that of this environment.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import psutil
from unit_files import library, udp, unit, written

from rig.errors import BadLog
from rig.log import read_log
from rig.log.info import info
from rig.unit.settings import Unit

RIG = [sys.executable, "-m", "rig", "fly", "--set", "duration_s=2", "--set", "faults.0.start_s=0.5"]
BY_LIBRARY = {
    "SIGSEGV": "segv",
    "abort": "abort",
    "exit(3)": "exit",
    "endless loop": "hang",
    "step returns 5": "error",
    "open returns 7": "open",
    "NaN in a vote": "nan vote",
    "a state out of its enum": "state",
    "says nothing": "silent",
    "prints": "print",
}
BY_UDP = {
    "short answer": "short",
    "long answer": "long",
    "stale answer": "stale",
    "doubled answer": "double",
    "another session's answer": "foreign",
    "another layout's answer": "layout",
    "wrong magic": "magic",
    "wrong checksum": "crc",
    "built for another layout": "built for another layout",
}


def ways(folder: Path) -> list[tuple[str, Unit, dict[str, str]]]:
    """Each way with its unit and the environment that makes it fail."""
    found: list[tuple[str, Unit, dict[str, str]]] = []

    def add(name: str, kind: str | None, environment: dict[str, str] | None = None, **keys: Any) -> None:
        own = folder / name.replace(" ", "_").replace("/", "_")
        own.mkdir()
        if kind is None:
            tested = written(own, {"name": "u", **keys})
        else:
            tested = unit(own, "faulty", **keys) if environment else udp(own, [[kind, 60, 60]], **keys)
        found.append((name, tested, environment or {}))

    for name, fault in BY_LIBRARY.items():
        add(name, "faulty", {"FAULT": fault}, timeout_s=1.0)
        if fault in ("segv", "hang"):
            add(f"{name}, on_dead hold", "faulty", {"FAULT": fault}, timeout_s=1.0, on_dead="hold")
            add(f"{name}, on_dead backup", "faulty", {"FAULT": fault}, timeout_s=1.0, on_dead="backup")
    add("changes the rounding, in process", "faulty", {"FAULT": "rounding"}, isolate=False)
    for name, kind in BY_UDP.items():
        add(name, kind, timeout_s=1.0)
    command = {"carrier": "udp", "start_s": 1.0}
    add("no library", None, path=str(Path(__file__)))
    add("no such functions", None, path=str(next(Path("/lib").rglob("libm.so.6"))))
    add("no such program", None, **command, command=["no-such-program"])
    add("silent program", None, **command, command=["sleep", "60"])
    add("nobody at the address", None, **command, address="127.0.0.1:9")
    return found


def row(name: str, tested: Unit, environment: dict[str, str]) -> str:
    """Fly once; a row of the table."""
    folder = tested.source.partition("/unit.toml")[0]
    command = [*RIG, "--unit", f"{folder}/unit.toml", "--out", f"{folder}/logs"]
    ended = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=120)
    said = ended.stderr.strip().replace(folder + "/", "")
    if ended.returncode == 0:
        said = "; ".join(line for line in ended.stdout.splitlines() if line.startswith(("unit", "printed", "verdict")))
    left = [p.pid for p in psutil.process_iter(["cmdline"]) if folder in " ".join(p.info["cmdline"] or [])]
    return f"| {name} | {' '.join(said.split())} | {ended.returncode} | {_log(Path(folder) / 'logs')} | {len(left)} |"


def _log(folder: Path) -> str:
    for path in folder.glob("*.mcap"):
        try:
            whole = info(path)["damage"] is None
            return f"{len(read_log(path).rows)} frames, {'whole' if whole else 'damaged'}"
        except BadLog as error:
            return f"damaged: {error}"
    return "none"


def main() -> None:
    """Print the table."""
    library("faulty")
    print("| the unit | printed | exit code | log | processes left |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for way in ways(Path(name)):
            print(row(*way).replace(json.dumps(name)[1:-1], ""), flush=True)


if __name__ == "__main__":
    main()
