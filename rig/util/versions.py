"""Which versions fly: recorded in every log."""

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
    found = {f"version {name}": _version(name) for name in PACKAGES}
    found["version python"] = platform.python_version()
    found["machine"] = platform.machine()
    commit = _commit()
    return {**found, "git commit": commit} if commit else found


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
        says = subprocess.run(
            ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=5,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return says.stdout.strip()
