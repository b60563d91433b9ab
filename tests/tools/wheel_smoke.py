"""``make wheel``: build the sdist, and the wheel from it, into dist/, and try the wheel outside the checkout.

python tests/tools/wheel_smoke.py [--if-possible] [DIST]

--if-possible  where the packages that build cannot be installed, say so in one line: no failure

The wheel is installed into a new environment, into which the packages of the present one are linked (not its
jsbsim-rig): only what builds is downloaded.  The commands run in an empty folder, so that no file of the checkout is
found by chance.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
import venv
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Final

ROOT: Final = Path(__file__).parents[2]
STEP_S: Final = 1200.0  # a first flight compiles
# With {rig} and {python} of the new environment; each must end with exit code 0.
COMMANDS: Final = (
    *("{rig} --version", "{rig} fly --set duration_s=2", "{rig} score {log}", "{rig} aircraft list"),
    "{rig} campaign plan smoke",
)
WHERE: Final = (
    "import rig, pathlib; home = pathlib.Path(rig.__file__).parent; print(home, (home / 'py.typed').is_file())"
)


def run(command: Sequence[str], folder: Path) -> str:
    """Run one command in ``folder`` and return what it printed; end here with its output when it fails."""
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
    began = perf_counter()
    ran = subprocess.run(
        command, cwd=folder, env=environment, timeout=STEP_S, check=False, text=True, capture_output=True
    )
    print(
        f"{perf_counter() - began:6.1f} s  {' '.join(Path(part).name for part in command if ' ' not in part)}",
        flush=True,
    )
    if ran.returncode:
        sys.exit(f"exit code {ran.returncode}\n{ran.stdout}{ran.stderr}")
    return ran.stdout


def environment(folder: Path) -> Path:
    """Make an empty environment, without even pip; return its folder of commands."""
    venv.create(folder)
    return Path(_path("scripts", folder))


def _path(kind: str, folder: Path) -> str:
    return sysconfig.get_path(kind, "venv", {"base": str(folder), "platbase": str(folder)})


def borrow(folder: Path) -> None:
    """Link the packages of the present environment into another; a .pth would not do, JSBSim looks for its folder."""
    theirs = Path(_path("purelib", folder))
    for ours in {sysconfig.get_path(kind) for kind in ("purelib", "platlib")}:
        for path in Path(ours).iterdir():
            own = "jsbsim_rig" in path.name or path.name == "__pycache__"
            if not own and not (theirs / path.name).exists():
                (theirs / path.name).symlink_to(path)


def pip(python: str, *what: str) -> list[str]:
    """Return the command that installs into the environment of ``python`` with the pip of the present one."""
    return [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check", "install", "--quiet", *what]


def builder(python: str) -> bool:
    """Install what builds; whether that was possible."""
    command = pip(python, "-c", str(ROOT / "constraints.txt"), "build", "hatchling")
    return subprocess.run(command, timeout=STEP_S, check=False).returncode == 0


def built(python: str, dist: Path) -> Path:
    """Build the sdist and, from it, the wheel; return the wheel."""
    dist.mkdir(parents=True, exist_ok=True)
    run([python, "-m", "build", "--no-isolation", "--outdir", str(dist), str(ROOT)], dist)
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    return dist / f"jsbsim_rig-{version}-py3-none-any.whl"


def smoke(python: str, rig: str, folder: Path) -> None:
    """Run the commands of the installed package in an empty folder."""
    home, typed = run([python, "-c", WHERE], folder).split()
    if Path(home).is_relative_to(ROOT) or typed != "True":
        sys.exit(f"{home}: the installed package was not found, or has no py.typed")
    for command in COMMANDS:
        log = next(folder.glob("logs/*.mcap"), "")
        run(command.format(rig=rig, log=log).split(), folder)


def main() -> int:
    """Build, install, run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--if-possible", action="store_true")
    parser.add_argument("dist", nargs="?", type=Path, default=ROOT / "dist")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        building, trying, empty = (Path(made) / name for name in ("building", "trying", "empty"))
        empty.mkdir()
        builds = str(environment(building) / "python")
        if not builder(builds):
            print("not run: the wheel's smoke test (what builds it cannot be installed)")
            return int(not options.if_possible)
        wheel = built(builds, options.dist.resolve())
        scripts = environment(trying)
        run(pip(str(scripts / "python"), "--no-deps", "--no-index", str(wheel)), empty)
        borrow(trying)
        smoke(str(scripts / "python"), str(scripts / "rig"), empty)
    print(f"{wheel.name}: works outside the checkout")
    return 0


if __name__ == "__main__":
    sys.exit(main())
