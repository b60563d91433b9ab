"""Versions of all packages, recorded in every log."""

from __future__ import annotations

import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("jsbsim-rig", "jsbsim", "numpy", "numba", "mcap", "rerun-sdk")


@cache
def versions() -> dict[str, str]:
    """Return package versions, Python, machine type and, in a checkout, the git commit."""
    texts = {f"version {name}": _version(name) for name in PACKAGES}
    texts["version python"] = platform.python_version()
    texts["machine"] = platform.machine()
    commit = _commit()
    return {**texts, "git commit": commit} if commit else texts


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _commit() -> str:
    """Return the checkout's commit, with ``+`` when files differ from it; empty outside a checkout."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    try:
        answer = subprocess.run(
            ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=5,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return answer.stdout.strip()
