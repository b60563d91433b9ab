"""A unit that is stopped in the middle of a lockstep flight, as in a debugger: is the digest the same?

    python tests/tools/unit_stopped.py FOLDER [--seconds 10]

FOLDER has libmonitor.so and monitor_udp (docs/examples/unit/Makefile).  Stopped by SIGSTOP and, where there is one,
by a debugger (gdb); timeout_s = 0.  A line a flight, with the longest reply; exit code 1 when a digest differs.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import psutil
from unit_files import written

import rig
from rig.unit.settings import Unit

STOPPED_AT = 1000  # frames
Stop = Callable[[psutil.Process, float], None]


def by_signal(process: psutil.Process, seconds: float) -> None:
    """SIGSTOP now, SIGCONT later."""
    process.send_signal(signal.SIGSTOP)
    threading.Timer(seconds, process.send_signal, (signal.SIGCONT,)).start()


def by_debugger(process: psutil.Process, seconds: float) -> None:
    """Attach gdb now, detach later."""
    script = ["-ex", f"shell sleep {seconds:g}", "-ex", "detach", "-ex", "quit"]
    command = ["gdb", "-q", "-nx", "-batch", "-p", str(process.pid), *script]
    subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 30.0
    while process.status() != psutil.STATUS_TRACING_STOP:
        if time.monotonic() > until:
            sys.exit("gdb has not attached within 30 s: is it permitted? (kernel.yama.ptrace_scope)")
        time.sleep(0.01)


def fly(folder: Path, tested: Unit, stop: Stop | None, seconds: float) -> rig.Flight:
    """One flight of the default scenario; its unit is stopped between two frames in the middle."""
    before, done = set(psutil.Process().children()), False

    def progress(frames: int, of: int) -> None:
        nonlocal done
        if stop is not None and not done and frames >= STOPPED_AT:
            done = True
            (process,) = set(psutil.Process().children()) - before
            stop(process, seconds)

    return rig.fly(out=folder, unit=tested, progress=progress)


def main() -> None:
    """Print a line a flight."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0)
    given = parser.parse_args()
    built = given.folder.resolve()
    carriers: dict[str, dict[str, Any]] = {
        "child": {"path": str(built / "libmonitor.so")},
        "UDP": {"carrier": "udp", "command": [str(built / "monitor_udp"), "--rig", "{address}"]},
    }
    stops: dict[str, Stop | None] = {"not stopped": None, "SIGSTOP": by_signal}
    if shutil.which("gdb"):
        stops["gdb"] = by_debugger
    same = True
    with tempfile.TemporaryDirectory() as name:
        for carrier, keys in carriers.items():
            tested, digest = written(Path(name), {"name": "monitor", "timeout_s": 0, **keys}), ""
            for how, stop in stops.items():
                flight = fly(Path(name), tested, stop, given.seconds)
                digest = digest or flight.digest
                same = same and flight.digest == digest
                worst_s = (flight.unit or {})["reply"]["worst_us"] / 1e6
                print(
                    f"{carrier:5} {how:11}  {flight.frames} frames, longest reply {worst_s:6.3f} s, "
                    f"digest {flight.digest[:16]} {'the same' if flight.digest == digest else 'ANOTHER'}",
                    flush=True,
                )
    sys.exit(not same)


if __name__ == "__main__":
    main()
