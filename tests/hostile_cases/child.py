"""The process of a case: its own session, folder, limits and files of output; the command, then the end."""

from __future__ import annotations

import io
import json
import os
import resource
import sys
import tempfile
import traceback
import types
from hashlib import sha1
from pathlib import Path
from stat import S_ISDIR, S_ISLNK, S_ISREG
from typing import Any, Final

from hostile_cases.case import Case
from hostile_cases.values import EVIL, MARK

ADDRESS_SPACE: Final = (
    12 << 30
)  # what numba, polars and rerun reserve is far below; 2 GB resident is the parent's limit
UNEXPECTED: Final = 70  # exit code: the case itself could not be made


def run(case: Case, box: Path) -> None:
    """Run a case in ``box`` and end this process; it has been forked for this alone."""
    code = UNEXPECTED
    try:
        _own(box)
        case.make(box / "work")
        os.chdir(box / "work")
        (box / "before.json").write_text(json.dumps(snapshot(box / "work")))
        (box / "ready").touch()
        code = case.call() if case.call else command(case.argv)
    except BaseException:  # noqa: BLE001 # whatever it was, the parent reads it
        traceback.print_exc()
        code = 1 if (box / "ready").exists() else UNEXPECTED
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _own(box: Path) -> None:
    os.setsid()
    for name in ("work", "tmp"):
        (box / name).mkdir()
    (box / "work" / "evilmod.py").write_text(EVIL)
    (box / "precious").write_text("precious")
    os.environ["TMPDIR"], tempfile.tempdir = str(box / "tmp"), None
    os.environ.pop("DISPLAY", None)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))
    quiet(box)


def quiet(folder: Path) -> None:
    """Nothing to read; what is written goes to ``out`` and ``err`` in a folder."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
        stream = io.TextIOWrapper(
            io.FileIO(number, "w", closefd=False), "utf-8", "backslashreplace", write_through=True
        )
        setattr(sys, ("stdout", "stderr")[number - 1], stream)
        setattr(sys, ("__stdout__", "__stderr__")[number - 1], stream)


def command(argv: tuple[str, ...]) -> int:
    """``rig ARGV`` as its shell script calls it; the exit code."""
    from rig.cli.main import main

    sys.argv = ["rig", *argv]
    sys.modules["__main__"] = types.ModuleType("__main__")  # workers of a campaign import what is there
    try:
        main()
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def snapshot(folder: Path) -> dict[str, str]:
    """Every path below a folder with its type, size and hash; what running code leaves is left to another check."""
    found: dict[str, str] = {}
    for path in sorted(folder.rglob("*")):
        if "__pycache__" in path.parts or path.name == MARK:
            continue
        about: Any = path.lstat()
        text = f"{about.st_mode:o}"
        if S_ISREG(about.st_mode):
            text += f" {about.st_size} {sha1(path.read_bytes()).hexdigest()}"
        elif S_ISLNK(about.st_mode):
            text += f" {path.readlink()}"
        elif not S_ISDIR(about.st_mode):
            text += f" {about.st_rdev}"
        found[str(path.relative_to(folder))] = text
    return found
