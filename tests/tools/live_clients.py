"""Do viewers hold a flight up?  Real-time flights, served to good and bad clients; not a test, run it by hand:

    python tests/tools/live_clients.py [--seconds 30] [--scenario NAME]

    off        no stream at all
    watch      no stream, the page on a terminal
    nobody     served, no client
    reading    a headless viewer that reads
    stopped    one that connects, reads a little and is stopped (SIGSTOP): its connection stays and takes no more
    killed     one that is killed half-way (SIGKILL)
    silent     a plain TCP connection that never says or reads anything

For each: how long frames took (us) and how late they began (us), from the log; what became of the stream.  Compare the
rows with each other, not with those of another machine.  The viewer needs a Vulkan driver (docs/viewer.md).
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from rig.log import read_log
from rig.view import viewer

CASES = ("off", "watch", "nobody", "reading", "stopped", "killed", "silent")


def main() -> None:
    """Fly each case and print its row."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=int, default=30)
    parser.add_argument("--scenario", default="f16_pitch_rate_hardover")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=CASES)
    asked = parser.parse_args()
    print(f"{'':8} {'frame us':>26} {'late us':>26} {'over':>5}   stream")
    print(f"{'client':8} {'50 %':>8} {'99 %':>8} {'worst':>8} {'50 %':>8} {'99 %':>8} {'worst':>8} {'runs':>5}")
    for case in asked.cases:
        with tempfile.TemporaryDirectory() as folder:
            print(fly(case, asked.scenario, asked.seconds, Path(folder)), flush=True)


def fly(case: str, scenario: str, seconds: int, out: Path) -> str:
    """One flight in a process of its own; its row of the table."""
    command = [sys.executable, "-m", "rig", "fly", scenario, "--set", f"duration_s={seconds}", "--out", str(out)]
    command += ["--realtime-factor", "1"]
    if case == "watch":
        stream = None
        _run_on_a_terminal([*command, "--watch"])
    else:
        command += ["--json", "--rerun", "off" if case == "off" else "serve"]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        stream = _attended(process, case, seconds)
    [log] = out.glob("*.mcap")
    timing = read_log(log).timing
    said = (
        "" if stream is None else f"{stream['sent_frames']} sent, {stream['dropped_frames']} dropped {stream['error']}"
    )
    overruns = int(((timing["late_us"] + timing["frame_us"]) > 10_000).sum())
    return f"{case:8} {_spread(timing['frame_us'])} {_spread(timing['late_us'])} {overruns:5}   {said}"


def _spread(values: Any) -> str:
    return " ".join(f"{value:8.0f}" for value in (*np.percentile(values, (50, 99)), values.max()))


def _attended(process: subprocess.Popen[str], case: str, seconds: int) -> Any:
    """Wait for the flight, with its client; what it says of its stream."""
    assert process.stdout is not None
    assert process.stderr is not None
    if case == "off":
        return json.loads(process.communicate()[0])["stream"]
    address = parse_qs(urlsplit(process.stderr.readline().split()[-1]).query)["url"][0]
    with _client(case, address, seconds):
        said, complaints = process.communicate()
    if process.returncode:
        raise SystemExit(complaints)
    return json.loads(said)["stream"]


@contextmanager
def _client(case: str, address: str, seconds: int) -> Iterator[None]:
    """The client that the case is about; it is gone, whatever state it was in, when the flight is over."""
    if case == "nobody":
        yield
    elif case == "silent":
        with socket.create_connection((viewer.LOOPBACK, urlsplit(address.removeprefix("rerun+")).port or 0)):
            yield
    else:
        port = viewer.free_port()
        client = viewer.start(["--headless", "--hide-welcome-screen", "--port", str(port), address], port, 60.0)
        number = {"stopped": signal.SIGSTOP, "killed": signal.SIGKILL}.get(case)
        timer = threading.Timer(seconds / 3, lambda: number and client.send_signal(number))
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            client.kill()
            client.wait()


def _run_on_a_terminal(command: list[str]) -> None:
    """Run ``command`` on a terminal of its own, which takes all that is written."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs)
    os.close(theirs)
    while process.poll() is None:
        try:
            os.read(ours, 65536)
        except OSError:  # the other end is closed
            time.sleep(0.05)
    os.close(ours)


if __name__ == "__main__":
    main()
