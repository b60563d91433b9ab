"""Units for the tests: the C files of docs and tests, built once, unit files that name them, a library called here."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.computer.redundancy.manager_config import without_lanes
from rig.core.frame import FLAT, Block
from rig.core.kernels import cache_root
from rig.unit.header import header
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import (
    ANSWERS,
    CONFIG,
    INPUT,
    LAW_INPUT,
    LAYOUT,
    OUTPUT,
    PART,
    READY,
    SETTINGS,
    TIE_BREAKS,
    VERSION,
    Said,
)

ROOT = Path(__file__).parents[1]
SOURCES, OURS = ROOT / "docs" / "examples" / "unit", ROOT / "rig" / "unit"
KEPT, MONTH_S = cache_root() / "test-units", 30 * 86400.0
COMPILER = shutil.which("gcc") or shutil.which("cc")
OF_FRAME = [name for name in INPUT.names or () if name in (FLAT.names or ()) and name != "frame"]


def kept(name: str, reads: Iterable[str | bytes], make: Callable[[Path], Path]) -> Path:
    """The file ``name`` that ``make`` leaves in a folder, made once of what it ``reads``: later runs find it.

    What no run has asked for in a month is removed.  No test may write to it.
    """
    digest = sha256()
    for part in reads:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "big") + data)
    folder = KEPT / digest.hexdigest()[:32]
    if (folder / name).exists():
        os.utime(folder)
        return folder / name
    folder.mkdir(parents=True, exist_ok=True)
    for other in KEPT.iterdir():
        if time.time() - other.stat().st_mtime > MONTH_S:
            shutil.rmtree(other, ignore_errors=True)
    with TemporaryDirectory() as scratch:
        made = folder / f"{os.getpid()}"
        shutil.move(make(Path(scratch)), made)
    return made.replace(folder / name)


def build(target: str, flags: str = "", **variables: str) -> Path:
    """One target of the examples' Makefile; variables : others of its own."""
    given = [f"CC={COMPILER}", f"CFLAGS={flags}", *(f"{name}={value}" for name, value in variables.items())]

    def make(folder: Path) -> Path:
        command = ["make", "-C", str(SOURCES), f"BUILD={folder}", *given, str(folder / target)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return folder / target

    read = [path for path in sorted([*SOURCES.glob("*.*"), *OURS.glob("*.py")]) if path.is_file()]
    return kept(target, [*given, *_texts([SOURCES / "Makefile", *read])], make)


def _texts(paths: Iterable[Path]) -> Iterator[str | bytes]:
    for path in paths:
        yield path.name
        yield path.read_bytes()


def config(params: NDArray[Any], discretes: NDArray[Any], boxes: NDArray[Any]) -> NDArray[Any]:
    """The CONFIG record, one element, of the records that the rig's own manager and voter are made from."""
    record = np.zeros(1, CONFIG)
    for part, fields in SETTINGS.items():
        for name in fields:
            value = (discretes if part == "discrete" else params)[name]
            record[part][0][name] = without_lanes(value)[:, :TIE_BREAKS] if name == "tie_break" else value
    record["box_signals"], record["box_persistence"] = boxes["signals"], boxes["persistence"]
    record["layout"] = LAYOUT
    return record


def inputs(rows: Block) -> NDArray[Any]:
    """The INPUT records of rows of a flight."""
    records = np.zeros(len(rows), INPUT)
    for name in ("frame", *OF_FRAME):
        records[name] = rows[name]
    return records


class Library:
    """The three functions of a unit."""

    def __init__(self, path: Path) -> None:
        self._functions = ctypes.CDLL(str(path))

    def open(self, record: NDArray[Any]) -> int:
        return self._functions.rig_unit_open(record.ctypes.data_as(ctypes.c_void_p))

    def close(self) -> None:
        self._functions.rig_unit_close()

    def run(self, records: NDArray[Any]) -> NDArray[Any]:
        """Step through INPUT records in order; the OUTPUT records."""
        outputs = np.zeros(len(records), OUTPUT)
        step, source, target = self._functions.rig_unit_step, records.ctypes.data, outputs.ctypes.data
        for k in range(len(records)):
            read = ctypes.c_void_p(source + k * INPUT.itemsize)
            assert step(read, ctypes.c_void_p(target + k * OUTPUT.itemsize)) == 0
        return outputs

    def fly(self, record: NDArray[Any], rows: Block) -> NDArray[Any]:
        """A whole flight from open to close."""
        assert self.open(record) == 0
        outputs = self.run(inputs(rows))
        self.close()
        return outputs


def differing(outputs: NDArray[Any], rows: Block) -> dict[str, int]:
    """How many numbers of each answer have other bits than the rows have; empty when none has."""
    found: dict[str, int] = {}
    for name, group in ANSWERS.items():
        if group == Said.SURFACE:
            continue
        ours, theirs = (np.ascontiguousarray(records[name]) for records in (rows, outputs))
        bits = "u8" if ours.dtype == np.float64 else "u1"
        if count := int((ours.view(bits) != theirs.view(bits)).sum()):
            found[name] = count
    return found


def compared(rows: Block) -> int:
    """How many numbers ``differing`` looks at."""
    return sum(rows[name].size for name, group in ANSWERS.items() if group != Said.SURFACE)


HERE = ROOT / "tests/units"
FLAGS = ("-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared")
needs_a_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc)")


def compiled(sources: list[Path], target: Path, *flags: str) -> Path:
    """A shared library of C files; the header is the one that the rig writes now."""
    target.parent.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(of_sources(target.name, sources, *flags), target))


def of_sources(name: str, sources: list[Path], *flags: str) -> Path:
    """The same, kept."""
    assert COMPILER is not None
    compiler, ours = COMPILER, header()

    def make(folder: Path) -> Path:
        (folder / "rig_unit.h").write_text(ours)
        command = [compiler, *FLAGS, *flags, f"-I{folder}", "-o", str(folder / name), *map(str, sources), "-lm"]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return folder / name

    places = [Path(flag[2:]) for flag in flags if flag.startswith("-I")] + [path.parent for path in sources]
    headers = [path for place in dict.fromkeys(places) for path in sorted(place.glob("*.h"))]
    options = [compiler, *(flag for flag in (*FLAGS, *flags) if not flag.startswith("-I"))]
    return kept(name, [ours, *options, *_texts([*sources, *headers])], make)


@cache
def library(name: str) -> Path:
    """A library of docs/examples/unit or tests/units by the name of its C file."""
    own = HERE / f"{name}.c"
    return of_sources(f"lib{name}.so", [own]) if own.exists() else build(f"lib{name}.so")


def unit(folder: Path, name: str = "first_valid", **keys: Any) -> Unit:
    """The unit of a file in ``folder`` that names a library."""
    lines = {"name": name, "path": str(library(name)), **keys}
    return written(folder, lines)


def faulty(folder: Path, fault: str, **keys: Any) -> Unit:
    """The unit of tests/units/faulty.c with its fault, in a process of its own."""
    return unit(folder, "faulty", environment={"FAULT": fault}, **keys)


def written(folder: Path, keys: dict[str, Any]) -> Unit:
    """A unit file with these keys, read."""
    path, tables = folder / "unit.toml", {key: value for key, value in keys.items() if isinstance(value, dict)}
    lines = [f"{key} = {json.dumps(value)}\n" for key, value in keys.items() if key not in tables]
    for key, table in tables.items():
        lines += [f"[{key}]\n", *(f"{json.dumps(name)} = {json.dumps(value)}\n" for name, value in table.items())]
    path.write_text("".join(lines))
    return read_unit(path)


@contextmanager
def listening(program: Path) -> Iterator[str]:
    """The address of a running unit."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    process = subprocess.Popen([program, "--listen", address])
    try:
        yield address
    finally:
        process.kill()
        process.wait()


def udp(folder: Path, plan: list[Any], name: str | Path = "first_valid", **keys: Any) -> Unit:
    """A library, by its name or path, behind tests/units/udp.py with a plan of what goes wrong."""
    path = library(name) if isinstance(name, str) else name.resolve()
    sizes = {"input": INPUT, "law_input": LAW_INPUT, "output": OUTPUT, "config": CONFIG, "part": PART, "ready": READY}
    known = json.dumps({**{key: dtype.itemsize for key, dtype in sizes.items()}, "layout": LAYOUT, "version": VERSION})
    command = [sys.executable, str(HERE / "udp.py"), str(path), "{address}", json.dumps(plan), known]
    return written(folder, {"name": "planned", "transport": "udp", "command": command, **keys})
