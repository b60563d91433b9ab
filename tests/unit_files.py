"""Units for the tests: the C files of docs and tests, built once, and unit files that name them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from unit_library import COMPILER
from unit_library import build as make

from rig.kernels import cache_root
from rig.unit.header import header
from rig.unit.layout import CONFIG, INPUT, LAYOUT, OUTPUT, PART, READY
from rig.unit.settings import Unit, read_unit

ROOT = Path(__file__).parents[1]
HERE = ROOT / "tests/units"
FLAGS = ("-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared")
needs_a_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc)")


def build(sources: list[Path], target: Path, *flags: str) -> Path:
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
        return build([HERE / f"{name}.c"], target)
    return make(target.parent, target.name)


def unit(folder: Path, name: str = "first_valid", **keys: Any) -> Unit:
    """The unit of a file in ``folder`` that names a library."""
    lines = {"name": name, "path": str(library(name)), **keys}
    return written(folder, lines)


def written(folder: Path, keys: dict[str, Any]) -> Unit:
    """A unit file with these keys, read."""
    path = folder / "unit.toml"
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()))
    return read_unit(path)


def udp(folder: Path, plan: list[Any], name: str | Path = "first_valid", **keys: Any) -> Unit:
    """A library, by its name or path, behind tests/units/udp.py with a plan of what goes wrong."""
    path = library(name) if isinstance(name, str) else name.resolve()
    sizes = {"input": INPUT, "output": OUTPUT, "config": CONFIG, "part": PART, "ready": READY}
    known = json.dumps({**{key: dtype.itemsize for key, dtype in sizes.items()}, "layout": LAYOUT})
    command = [sys.executable, str(HERE / "udp.py"), str(path), "{address}", json.dumps(plan), known]
    return written(folder, {"name": "planned", "carrier": "udp", "command": command, **keys})
