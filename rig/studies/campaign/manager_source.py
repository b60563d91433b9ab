"""The source of the user's manager: its file, and the files beside it that it imports or names.

Files are found and read as an import would find them, without running their code.  Not followed: installed packages
other than the manager's own, and files that a program imports or reads by a computed name.
"""

from __future__ import annotations

import ast
import hashlib
import os
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import invalidate_caches
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput
from rig.core.files import is_file

_IMPORT: Final = """
import importlib, sys
sys.path.insert(0, "")
try:
    getattr(importlib.import_module(sys.argv[1]), sys.argv[2])
except BaseException as error:
    sys.exit(" ".join(f"{type(error).__name__}: {error}".split()))
"""
_LONGEST: Final = 255  # name of a file
_OURS: Final = "rig"  # its sources are in the identity of the rig
_INSTALLED: Final = ("stdlib", "platstdlib", "purelib", "platlib")


def sources(managers: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the SHA-256 of each file by its name, for every manager of the user, sorted.  BadInput as ``require``."""
    return {name: dict(sorted(_files(name))) for name in sorted({*managers}) if ":" in name}


def try_import(manager: str) -> None:
    """Import the module of a manager in a separate process, as a worker does.  BadInput: the import fails."""
    ended = subprocess.run(
        [sys.executable, "-P", "-c", _IMPORT, *manager.split(":", 1)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        text=True,
        errors="replace",
        check=False,
    )
    if ended.returncode:
        last = ended.stderr.strip().rpartition("\n")[2]
        why = last if ended.returncode == 1 and last else f"its import ended a process with code {ended.returncode}"
        raise BadInput(f"redundancy.manager: {manager!r} cannot be made: {why}")


@cache
def first_sources(manager: str) -> dict[str, str]:
    """Return the files as this process first read them: an imported class comes from these."""
    return sources([manager])[manager]


def _files(manager: str) -> Iterator[tuple[str, str]]:
    """Yield name and SHA-256 of a manager's file, and of the files that it imports.  BadInput: no such module."""
    invalidate_caches()  # a file may be newer than a folder's listing
    module = manager.partition(":")[0]
    top = _spec(module.partition(".")[0], [*([] if "" in sys.path else [""]), *sys.path])
    root = None if top is None else _root(top)
    if root is None:
        raise BadInput(f"redundancy.manager: {manager!r}: no module {module!r} in this folder, nor installed")
    # What lies beside an installed package was installed there: its neighbours are none of the manager's.
    installed = root.resolve() in {Path(sysconfig.get_path(name)).resolve() for name in _INSTALLED}
    yield from _followed(manager, module, root, module.partition(".")[0] if installed else None)


def sources_beside(path: Path) -> dict[str, str]:
    """Return the SHA-256 of a Python file, and of the files beside it that it imports or names, by name, sorted."""
    return dict(sorted(_followed(str(path), path.stem, path.absolute().parent, None)))


def _followed(manager: str, module: str, root: Path, only: str | None) -> Iterator[tuple[str, str]]:
    """Yield name and SHA-256 of the files of a module below ``root``, and of what it imports; ``only`` of a package."""
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        for name, path, is_package in _on_the_way(waiting.pop(), root):
            if name in seen:
                continue
            seen.add(name)
            data = _read(manager, path)
            yield path.relative_to(root).as_posix(), hashlib.sha256(data).hexdigest()
            tree, package = _parsed(data), name if is_package else name.rpartition(".")[0]
            waiting += [each for each in _imported(tree, package) if _is_followed(each, only)]
            for beside in _named(tree, path.parent):
                yield beside.relative_to(root).as_posix(), hashlib.sha256(_read(manager, beside)).hexdigest()


def _spec(name: str, paths: list[str]) -> ModuleSpec | None:
    """Return the place of a module without dots; from an installed finder (editable installation) if in no folder."""
    found = PathFinder.find_spec(name, paths)
    if found is None:
        try:
            found = find_spec(name)
        except (ImportError, ValueError):
            return None
    return found


def _root(spec: ModuleSpec) -> Path | None:
    """Return the folder of a top module; None for a module without a file."""
    folders = list(spec.submodule_search_locations or ())
    if folders:
        return Path(folders[0]).absolute().parent
    return Path(spec.origin).absolute().parent if spec.origin and spec.has_location else None


def _is_followed(module: str, only: str | None) -> bool:
    top = module.partition(".")[0]
    return top != _OURS and only in (None, top)


def _on_the_way(module: str, root: Path) -> Iterator[tuple[str, Path, bool]]:
    """Yield the modules with a file that an import of ``module`` runs: name, file, and whether it is a package."""
    paths, name = [str(root)], ""
    for part in module.split("."):
        name = f"{name}.{part}" if name else part
        spec = PathFinder.find_spec(name, paths)
        if spec is None:
            return
        if spec.has_location and spec.origin and Path(spec.origin).is_file():
            yield name, Path(spec.origin).absolute(), spec.submodule_search_locations is not None
        if spec.submodule_search_locations is None:
            return
        paths = list(spec.submodule_search_locations)


def _read(manager: str, path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"redundancy.manager: {manager!r}: {path} cannot be read: {error.strerror}") from None


def _parsed(source: bytes) -> ast.AST:
    """Return the syntax tree of a source; an empty one if it is no Python text."""
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError):  # a library, say; its import tells what is wrong
        return ast.Module([], [])


def _named(tree: ast.AST, folder: Path) -> Iterator[Path]:
    """Yield the files in ``folder`` that a source names, such as trained weights."""
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    for text in sorted(text for text in texts if 0 < len(text) <= _LONGEST and "." in text and text == Path(text).name):
        if is_file(folder / text):
            yield folder / text


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    """Yield every module that a source may import, given its package."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            if base:
                yield base
            yield from (f"{base}.{alias.name}".lstrip(".") for alias in node.names)
