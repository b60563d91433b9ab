"""Runs the monitor's tests in forks of a warm process, one a mutant: cosmic-ray starts thousands of runs.

python tests/mutation/server.py PORT      # loopback only; the client is one line of bash, see run.sh
"""

from __future__ import annotations

import contextlib
import io
import os
import socket
import sys

os.environ["NUMBA_DISABLE_JIT"] = "1"  # mutants of kernels run as plain Python
os.environ["RIG_FEWER_EXAMPLES"] = "3"

import hypothesis.extra.numpy  # noqa: F401  # warm
import pytest

import rig.loop  # noqa: F401  # warm: what it imports stays, itself is forgotten below and read anew by every run

for name in [name for name in sys.modules if name.split(".")[0] == "rig"]:
    del sys.modules[name]

# The quick ones first: most mutants die early.
ALL = (
    "kernels",
    "examples",
    "manager",
    "stage",
    "baselines",
    "motion",
    "inclination",
    "reference",
    "own",
    "oracle",
    "last_channel",
    "revision2",
)
TESTS = [f"tests/test_redundancy_{name}.py" for name in os.environ.get("RIG_MUTATION_TESTS", " ".join(ALL)).split()]
FLIGHTS = ("flies", "flight_in", "inertial_unit", "a_wind", "lost_pitch_rate", "compiled_and")  # seconds each
QUIET = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "-W", "ignore"]
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
    """One run; a mutant that never ends is stopped by the alarm."""
    import signal

    signal.alarm(120)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return int(pytest.main([*QUIET, *TESTS]))


if __name__ == "__main__":
    serve(int(sys.argv[1]))
