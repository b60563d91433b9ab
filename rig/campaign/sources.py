"""The source of a manager of the user's own: its file, and the files beside it that it imports, for an identity.

Files are found and read as the import would find them; no code of theirs is run.  Not followed: what is installed (but
the package that the manager itself is of), what a program imports by a name that it computes, and data files.
"""

from __future__ import annotations

import ast
import hashlib
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import invalidate_caches
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from rig.errors import BadInput

_OURS: Final = "rig"  # its sources are in the identity of the rig
_INSTALLED: Final = ("stdlib", "platstdlib", "purelib", "platlib")


def sources(managers: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the SHA-256 of each file by its name, of every manager that is the user's own, sorted.  BadInput."""
    return {name: dict(sorted(_files(name))) for name in sorted({*managers}) if ":" in name}


@cache
def first_sources(manager: str) -> dict[str, str]:
    """Return the files as they were when this process first asked: a class that it has imported is of these."""
    return sources([manager])[manager]


def _files(manager: str) -> Iterator[tuple[str, str]]:
    """Yield name and SHA-256 of the file of a manager, and of those that it imports.  BadInput: no such module."""
    invalidate_caches()  # a file may be newer than a folder's listing
    module = manager.partition(":")[0]
    top = _spec(module.partition(".")[0], [*([] if "" in sys.path else [""]), *sys.path])
    root = None if top is None else _root(top)
    if root is None:
        raise BadInput(f"redundancy.manager: {manager!r}: no module {module!r} in this folder, nor installed")
    only = module.partition(".")[0] if _is_installed(root) else None
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        for name, path, is_package in _on_the_way(waiting.pop(), root):
            if name in seen:
                continue
            seen.add(name)
            data = _read(manager, path)
            yield path.relative_to(root).as_posix(), hashlib.sha256(data).hexdigest()
            package = name if is_package else name.rpartition(".")[0]
            waiting += [each for each in _imported(data, package) if _is_followed(each, only)]


def _spec(name: str, paths: list[str]) -> ModuleSpec | None:
    """Return where a module without dots is; by an installed finder (an editable installation) when in no folder."""
    found = PathFinder.find_spec(name, paths)
    if found is None:
        try:
            found = find_spec(name)
        except (ImportError, ValueError):
            return None
    return found


def _root(spec: ModuleSpec) -> Path | None:
    """Return the folder that a top module is in; None of one without a file."""
    folders = list(spec.submodule_search_locations or ())
    if folders:
        return Path(folders[0]).absolute().parent
    return Path(spec.origin).absolute().parent if spec.origin and spec.has_location else None


def _is_installed(root: Path) -> bool:
    """Return whether what lies in a folder was installed there, so that its neighbours are none of the manager's."""
    return root.resolve() in {Path(sysconfig.get_path(name)).resolve() for name in _INSTALLED}


def _is_followed(module: str, only: str | None) -> bool:
    top = module.partition(".")[0]
    return top != _OURS and only in (None, top)


def _on_the_way(module: str, root: Path) -> Iterator[tuple[str, Path, bool]]:
    """Yield the modules with a file that an import of ``module`` runs: name, file, whether it is a package."""
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


def _imported(source: bytes, package: str) -> Iterator[str]:
    """Yield every module that a source may import, its package given; none of one that is no Python text."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError):  # a library, say; its import tells what is wrong
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            if base:
                yield base
            yield from (f"{base}.{alias.name}".lstrip(".") for alias in node.names)
