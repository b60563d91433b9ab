"""The ways in which a unit can fail: what the rig prints, its exit code, the log, what is left."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import psutil
from unit_files import library, udp, unit, written

from figures import table
from rig.core.errors import BadLog
from rig.log import read_log
from rig.log.info import info
from rig.unit.unit_file import Unit

RIG: Final = [sys.executable, "-m", "rig", "fly", "--set", "duration_s=2", "--set", "faults.0.start_s=0.5"]
BY_LIBRARY: Final = {
    **{"SIGSEGV": "segv", "abort": "abort", "exit(3)": "exit", "endless loop": "hang", "step returns 5": "error"},
    **{"open returns 7": "open", "NaN in a vote": "nan vote", "a state out of its enum": "state"},
    **{"says nothing": "silent", "prints": "print"},
}
BY_UDP: Final = {
    **{"short answer": "short", "long answer": "long", "stale answer": "stale", "doubled answer": "double"},
    **{"another session's answer": "foreign", "another layout's answer": "layout", "wrong magic": "magic"},
    **{"wrong checksum": "crc", "built for another layout": "built for another layout"},
}
UNREACHED: Final[dict[str, dict[str, Any]]] = {
    "no library": {"path": str(Path(__file__))},
    "no such functions": {"path": str(next(Path("/lib").rglob("libm.so.6"), "libm.so.6"))},
    "no such program": {"transport": "udp", "start_s": 1.0, "command": ["no-such-program"]},
    "silent program": {"transport": "udp", "start_s": 1.0, "command": ["sleep", "60"]},
    "no program at the address": {"transport": "udp", "start_s": 1.0, "address": "127.0.0.1:9"},
}


def ways(folder: Path) -> Iterator[tuple[str, Unit, dict[str, str]]]:
    """Yield each way, its unit, and the environment that makes it fail."""

    def own(name: str) -> Path:
        made = folder / name.replace(" ", "_").replace("/", "_")
        made.mkdir()
        return made

    for name, fault in BY_LIBRARY.items():
        for on_dead in ("end", "hold", "backup") if fault in ("segv", "hang") else ("end",):
            way = name if on_dead == "end" else f"{name}, on_dead {on_dead}"
            yield way, unit(own(way), "faulty", timeout_s=1.0, on_dead=on_dead), {"FAULT": fault}
    way = "changes the rounding, in process"
    yield way, unit(own(way), "faulty", isolate=False), {"FAULT": "rounding"}
    for name, kind in BY_UDP.items():
        yield name, udp(own(name), [[kind, 60, 60]], timeout_s=1.0), {}
    for name, keys in UNREACHED.items():
        yield name, written(own(name), {"name": "u", **keys}), {}


def row(_: str, tested: Unit, environment: dict[str, str]) -> tuple[str, ...]:
    """Fly once; return what is seen of it."""
    folder = tested.source.partition("/unit.toml")[0]
    command = [*RIG, "--unit", f"{folder}/unit.toml", "--out", f"{folder}/logs"]
    ended = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=120)
    text = ended.stderr.strip().replace(folder + "/", "")
    if ended.returncode == 0:
        text = "; ".join(line for line in ended.stdout.splitlines() if line.startswith(("unit", "printed")))
    text = " ".join(text.partition("; the log is complete")[0].split())
    left = [p.pid for p in psutil.process_iter(["cmdline"]) if folder in " ".join(p.info["cmdline"] or [])]
    return text, str(ended.returncode), _log(Path(folder) / "logs"), str(len(left))


def _log(folder: Path) -> str:
    for path in folder.glob("*.mcap"):
        try:
            whole = info(path)["damage"] is None
            return f"{len(read_log(path).rows)} frames, {'whole' if whole else 'damaged'}"
        except BadLog as error:
            return f"damaged: {error}"
    return "none"


def unit_failures() -> None:
    """Print a row for ways that end alike; needs a C compiler."""
    library("faulty")
    with tempfile.TemporaryDirectory() as folder:
        alike: dict[tuple[str, ...], list[str]] = {}
        for way in ways(Path(folder)):
            alike.setdefault(row(*way), []).append(way[0])
    heads = ("the unit", "printed", "exit code", "log", "processes left")
    table(heads, (["; ".join(names), *cells] for cells, names in alike.items()))
