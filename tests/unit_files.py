"""Units for the tests: the C files of docs and tests, built once, unit files that name them, a library called here."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
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
    LAYOUT,
    OUTPUT,
    PART,
    READY,
    RESOLVERS,
    SETTINGS,
    VERSION,
    Said,
)

SOURCES = Path(__file__).parents[1] / "docs" / "examples" / "unit"
COMPILER = shutil.which("gcc") or shutil.which("cc")
OF_FRAME = [name for name in INPUT.names or () if name in (FLAT.names or ()) and name != "frame"]


def build(folder: Path, target: str, flags: str = "", **variables: str) -> Path:
    """Make one target of the examples' Makefile in ``folder``; variables : others of its own."""
    made = folder / target
    command = ["make", "-C", str(SOURCES), f"BUILD={folder}", f"CC={COMPILER}", f"CFLAGS={flags}", str(made)]
    command += [f"{name}={value}" for name, value in variables.items()]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return made


def config(params: NDArray[Any], discretes: NDArray[Any], boxes: NDArray[Any]) -> NDArray[Any]:
    """The CONFIG record, one element, of the records that the rig's own manager and voter are made from."""
    record = np.zeros(1, CONFIG)
    for part, fields in SETTINGS.items():
        for name in fields:
            value = (discretes if part == "discrete" else params)[name]
            record[part][0][name] = without_lanes(value)[:, :RESOLVERS] if name == "resolvers" else value
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


ROOT = Path(__file__).parents[1]
HERE = ROOT / "tests/units"
FLAGS = ("-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared")
needs_a_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc)")


def compiled(sources: list[Path], target: Path, *flags: str) -> Path:
    """A shared library of C files; the header is the one that the rig writes now."""
    assert COMPILER is not None
    target.parent.mkdir(parents=True, exist_ok=True)
    include = target.parent / "rig_unit.h"
    include.write_text(header())
    made = target.with_suffix(f".{os.getpid()}")
    command = [COMPILER, *FLAGS, *flags, f"-I{include.parent}", "-o", str(made), *map(str, sources), "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return made.replace(target)


@cache
def library(name: str) -> Path:
    """A library of docs/examples/unit or tests/units by the name of its C file."""
    target = cache_root() / "test-units" / f"{LAYOUT:016x}-{os.getpid()}" / f"lib{name}.so"
    if (HERE / f"{name}.c").exists():
        return compiled([HERE / f"{name}.c"], target)
    return build(target.parent, target.name)


def unit(folder: Path, name: str = "first_valid", **keys: Any) -> Unit:
    """The unit of a file in ``folder`` that names a library."""
    lines = {"name": name, "path": str(library(name)), **keys}
    return written(folder, lines)


def written(folder: Path, keys: dict[str, Any]) -> Unit:
    """A unit file with these keys, read."""
    path = folder / "unit.toml"
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()))
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
    sizes = {"input": INPUT, "output": OUTPUT, "config": CONFIG, "part": PART, "ready": READY}
    known = json.dumps({**{key: dtype.itemsize for key, dtype in sizes.items()}, "layout": LAYOUT, "version": VERSION})
    command = [sys.executable, str(HERE / "udp.py"), str(path), "{address}", json.dumps(plan), known]
    return written(folder, {"name": "planned", "carrier": "udp", "command": command, **keys})
