"""What the tests of units show, at length: python tests/tools/unit_shows.py defects | starts [N] | manners

defects  the monitor in C with each slow defect: what `rig unit check` says of it first
starts   N flights (100) of a box over a network that loses a tenth of the start-up's datagrams and doubles a tenth
manners  units of bad manners: the line that each is told with, and the processes that are left
"""

import os
import socket
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from test_unit_long import SLOW
from test_unit_manners import BOXES, CLOSES, COMMANDS, FILES, FORKS, LEAVE, LIBRARIES, Box, Network, bad_library
from test_unit_vectors import EXAMPLES, OWN, SOURCES, with_defect
from unit_files import build, compiled, library, written

import rig
from rig.bench.unit_check import check
from rig.core.errors import RigError
from rig.unit import guard
from rig.unit.unit_file import read_unit

SHORT = ("duration_s=0.3", "faults=[]")
IN_FLIGHT = ("segv", "abort", "exit", "hang", "error", "state", "silent")  # of tests/units/faulty.c
SUBREAPER = 36  # of prctl: who loses its parent becomes a child of this process, and is counted
Start = Callable[[Path], str]


def defects(folder: Path) -> None:
    """Print what the conformance test says of each defect."""
    objects = {name: compiled([EXAMPLES / name], folder / f"{name}.o", "-O0", OWN, "-c") for name in SOURCES}
    missed = 0
    for i, defect in enumerate(SLOW):
        place = folder / f"defect{i}"
        place.mkdir()
        with_defect(defect, objects, place)
        written(place, {"name": "defect", "path": "libdefect.so"})
        wrong = [one for one in check(place / "unit.toml").requirements if not one.passed and one.part == "decisions"]
        missed += not wrong
        print(f"{defect.name}: {f'{wrong[0].name}: {wrong[0].detail}' if wrong else 'NOT FOUND'}", flush=True)
    print(f"{len(SLOW)} defects, {missed} not found")


def starts(folder: Path, count: int) -> None:
    """Print what became of ``count`` flights."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    process = subprocess.Popen([build(folder, "monitor_udp"), "--listen", address])
    network = Network(address, 1)
    tested = written(folder, {"name": "u", "carrier": "udp", "address": f"127.0.0.1:{network.near.getsockname()[1]}"})
    outcomes = Counter[str]()
    try:
        for _ in range(count):
            outcomes[_flown(folder, tested) or "flown"] += 1
    finally:
        network.stop()
        process.kill()
        process.wait()
    print(f"{count} starts, {network.worse} datagrams lost or doubled: {dict(outcomes)}")


def _flown(folder: Path, tested: Any) -> str:
    """Return the line with which a flight is refused or ended, or what its unit said last; "" for a good one."""
    try:
        flight = rig.fly(overrides=SHORT, out=folder, unit=tested)
    except RigError as error:
        return str(error).split("; the log is complete")[0].replace(f"{folder}/", "")
    said = (flight.printed.strip().splitlines() or [""])[-1]
    wrong = {name: flight.unit[name] for name in ("refused", "not_finite") if flight.unit and flight.unit[name]}
    return " ".join(filter(None, (said, str(wrong) if wrong else "")))


def manners(folder: Path) -> None:
    """Print the line of each unit, and count what is left of all."""
    guard._set_process(SUBREAPER, 1)
    count, silent = 0, 0
    for name, start in _ill_mannered():
        place = folder / f"{count}"
        place.mkdir()
        said, left = start(place), len(guard._descendants())
        count, silent = count + 1, silent + (not said or "\n" in said)
        print(f"| {name} | {said} | {left} |", flush=True)
    print(f"{count} units, {silent} without a line of their own, processes left: {len(guard._descendants())}")


def _ill_mannered() -> Iterator[tuple[str, Start]]:
    """Yield units by name, each as what flies it in a folder and returns its line."""
    for name, (manner, _) in BOXES.items():
        yield f"box: {name}", lambda place, manner=manner: _box(place, manner)
    for name, (command, _) in COMMANDS.items():
        keys = {"name": "u", "carrier": "udp", "start_s": 1.0}
        yield (
            f"command: {name}",
            lambda place, c=command, keys=keys: _flown(place, written(place, {**keys, "command": c(place)})),
        )
    for text in FILES:
        yield f"file: {text.strip().splitlines()[-1]}", lambda place, text=text: _file(place, text)
    for name, (parts, _) in LIBRARIES.items():
        yield f"library: {name}", lambda place, parts=parts: _flown(place, bad_library(place, **parts))
    for name, (close, _) in CLOSES.items():
        yield f"library: {name} in close", lambda place, close=close: _flown(place, bad_library(place, close=close))
    for name, how in FORKS.items():
        parts = {"open": LEAVE.format("613", how), "close": "abort();"}
        yield f"library: leaves a child that {name}", lambda place, p=parts: _flown(place, bad_library(place, **p))
    for fault in IN_FLIGHT:
        yield f"library: {fault} in frame 10", lambda place, fault=fault: _in_flight(place, fault)


def _box(place: Path, manner: Callable[[bytes], list[bytes]]) -> str:
    box = Box(manner)
    try:
        return _flown(place, written(place, {"name": "u", "carrier": "udp", "address": box.address, "start_s": 0.6}))
    finally:
        box.stop()


def _file(place: Path, text: str) -> str:
    (place / "unit.toml").write_text('name = "u"\n' + text)
    try:
        read_unit(place / "unit.toml")
    except RigError as error:
        return str(error).replace(f"{place}/", "")
    return ""


def _in_flight(place: Path, fault: str) -> str:
    os.environ.update(FAULT=fault, FAULT_FRAME="10")
    keys = {"name": "u", "path": str(library("faulty")), "timeout_s": 0.5}
    return _flown(place, written(place, keys))


if __name__ == "__main__":
    show, *given = sys.argv[1:] or ["manners"]
    with TemporaryDirectory() as scratch:
        if show == "starts":
            starts(Path(scratch), int(given[0]) if given else 100)
        else:
            {"defects": defects, "manners": manners}[show](Path(scratch))
