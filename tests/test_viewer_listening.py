"""The commands that serve, as users start them: every socket of theirs and their children's is on the loopback."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from ipaddress import ip_address
from pathlib import Path

import psutil
import pytest

START_S = 300.0  # at most: the first flight after an installation compiles
STEADY_S = 1.0  # the sockets are looked at until there has been no new one for so long
SERVERS = 2  # recording and page


@pytest.mark.long
def test_every_socket_of_a_served_flight_and_of_a_served_log_is_on_the_loopback(tmp_path: Path):
    flown = ["fly", "f16_pitch_rate_hardover", "--set", "duration_s=600", "--out", "logs", "--realtime-factor", "1"]
    watched([*flown, "--rerun", "serve", "--no-wait"], tmp_path)
    (log,) = (tmp_path / "logs").glob("*.mcap")
    watched(["view", str(log), "--serve"], tmp_path)


def test_a_socket_on_every_address_would_be_seen():
    for family, address in ((socket.AF_INET, "0.0.0.0"), (socket.AF_INET6, "::")):
        with socket.socket(family, socket.SOCK_STREAM) as server, socket.socket(family, socket.SOCK_DGRAM) as talker:
            server.bind((address, 0))
            server.listen()
            talker.bind((address, 0))
            found = {port for where, port in listening(psutil.Process()) if not on_loopback(where)}
            assert {server.getsockname()[1], talker.getsockname()[1]} <= found


def watched(arguments: list[str], folder: Path) -> None:
    """Run ``rig`` until it has served for a while; AssertionError when a socket is not on the loopback."""
    command = subprocess.Popen([sys.executable, "-m", "rig", *arguments], cwd=folder, stdout=subprocess.DEVNULL)
    try:
        process, seen, last = psutil.Process(command.pid), set[tuple[str, int]](), time.monotonic()
        while len(seen) < SERVERS or time.monotonic() - last < STEADY_S:
            assert command.poll() is None, f"rig {arguments[0]} ended before it served"
            assert time.monotonic() - last < START_S, f"rig {arguments[0]} served {len(seen)} of {SERVERS}"
            new = listening(process) - seen
            seen, last = seen | new, time.monotonic() if new else last
            time.sleep(0.02)
        assert all(on_loopback(where) for where, _ in seen), seen
    finally:
        command.terminate()  # Ctrl-C is ignored by what was begun in the background
        command.wait(60.0)


def listening(process: psutil.Process) -> set[tuple[str, int]]:
    """Address and port of every socket of the process and its children that anybody can send to."""
    found: set[tuple[str, int]] = set()
    for one in (process, *process.children(recursive=True)):
        try:
            sockets = one.net_connections(kind="inet")  # of IPv4 and IPv6
        except psutil.NoSuchProcess:
            continue
        open_to_all = (
            s for s in sockets if s.status == psutil.CONN_LISTEN or (s.type == socket.SOCK_DGRAM and not s.raddr)
        )
        found |= {(s.laddr.ip, s.laddr.port) for s in open_to_all}
    return found


def on_loopback(address: str) -> bool:
    return ip_address(address).is_loopback
