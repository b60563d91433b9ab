"""Runs the monitor's tests in forks of a warm process, one a mutant: cosmic-ray starts thousands of runs.

python tests/tools/mutation/server.py PORT      # loopback only; the client is one line of bash, see run.sh
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import socket
import subprocess
import sys
from importlib import import_module
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"  # mutants of kernels run as plain Python
os.environ["RIG_FEWER_EXAMPLES"] = "1.5"

import hypothesis.extra.numpy  # noqa: F401  # warm
import pytest
import scipy.spatial.transform  # noqa: F401  # warm

import rig.flight.loop  # noqa: F401  # warm: the libraries stay, itself is forgotten below

for name in [name for name in sys.modules if name.split(".")[0] == "rig"]:
    del sys.modules[name]
# What does not read rig.computer stays; all else is read again by every run.
for name in ("core.frame", "core.kernels", "core.units.angles", "world.faults", "world.plant", "world.sensors"):
    import_module(f"rig.{name}")
if any(name.startswith("rig.computer") for name in sys.modules):
    raise SystemExit("a module that is kept reads rig.computer: its mutants would not be seen")

# Test files by module, in stages of which the first failure ends a run: most mutants die early.
MONITOR = ("examples kernels manager resolve last_channel reference_threshold", "box common baselines")
STAGES: dict[str, tuple[str, ...]] = {
    "__init__": ("stage", "own references"),
    "manager_config": ("kernels", "discrete examples manager baselines stage"),
    "designed": ("stage", "references"),
    "discrete": ("discrete",),
    "discrete_config": ("discrete kernels stage",),
    "managers": ("baselines", "stage own"),
    "memory": ("inertial_unit",),
    "kinematics": ("kinematics", "pitch_reference", "references"),
    "own": ("own",),
    "durations": ("kernels discrete",),
    "references": ("stage kinematics", "pitch_reference", "references"),
    "reference_sources": ("common", "stage", "references"),
    "strapdown": ("strapdown", "inertial_unit"),
    "inertial_unit": ("strapdown inertial_unit",),
    "unit_bank": ("unit_bank", "rate_bias"),
    "rate_bias": ("rate_bias_kernels", "rate_bias"),
    "decision": ("decision", "rate_bias"),
}
FLIGHTS = ("flies", "flight_in", "inertial_unit", "a_wind_makes", "lost_pitch_rate", "compiled_and")  # seconds each
FLIGHTS += ("both_references_of_a_signal", "run_away_together", "settled_rightly", "reads_its_partners")
QUIET = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "-W", "ignore"]
QUIET += ["-p", "no:unraisableexception"]  # it collects garbage twice
QUIET += ["-k", f"not ({' or '.join(FLIGHTS)})"]


def serve(port: int) -> None:
    """Answer every connection with the exit code of one test run in a fork."""
    with socket.create_server(("127.0.0.1", port), backlog=8) as server:
        while True:
            connection, _ = server.accept()
            if os.fork() == 0:
                server.close()
                code = run()
                with contextlib.suppress(OSError):
                    connection.sendall(f"{code}\n".encode())
                os._exit(0)
            connection.close()
            with contextlib.suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass


def run() -> int:
    """One run, in stages that end with the first failure; a mutant that never ends is stopped by the alarm."""
    import signal

    signal.alarm(380)
    for stage in stages():
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            code = int(pytest.main([*QUIET, *stage]))
        if code != 0:
            return code
    return 0


def stages() -> list[list[str]]:
    """The test files of the mutated module, of a part of the monitor its own first."""
    changed = subprocess.run(["git", "diff", "--name-only"], capture_output=True, text=True, check=True).stdout
    module = Path(changed.strip() or "none").stem
    named = os.environ.get("RIG_MUTATION_TESTS", "").split()
    stages = [named] if named else [names.split() for names in STAGES.get(module, (module, *MONITOR))]
    found = [[str(path) for name in names for path in tests_of(name)] for names in stages]
    return [paths for paths in found if paths]


def tests_of(name: str) -> list[Path]:
    """The test files of a module of the monitor, of its references or of the pitch-angle monitor."""
    rooms = ("redundancy", "analytic", "fdi")
    return [path for room in rooms if (path := Path(f"tests/test_{room}_{name}.py")).exists()]


if __name__ == "__main__":
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main(["--version"])  # warm: the plugins
    gc.collect()
    gc.freeze()
    serve(int(sys.argv[1]))
