"""The viewer program that comes with rerun-sdk, as a process of ours: loopback only, no usage analytics.

rerun-sdk's own rr.spawn looks for `rerun` on the PATH, listens on every interface and waits 11 s when there is
no display; so the program is started here.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import psutil

from rig.errors import BadInput, RigError

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

LOOPBACK: Final = "127.0.0.1"


def program() -> Path:
    """The viewer's executable inside the installed rerun-sdk; RigError when it is not there."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
        if (folder / name).is_file():
            return folder / name
    raise RigError("the Rerun viewer is not part of the installed rerun-sdk")


def environment(given: Mapping[str, str] | None = None) -> dict[str, str]:
    """Variables for the viewer's process: ``given`` (ours) with its usage analytics switched off.

    Rerun collects none where it believes to run on a build server, and then leaves the user's own
    setting (`rerun analytics`) alone: it neither reads nor writes it.
    """
    ours = os.environ if given is None else given
    return {name: value for name, value in ours.items() if name != "FORCE_RERUN_ANALYTICS"} | {"CI": "true"}


def free_port(preferred: int = 0) -> int:
    """``preferred`` when nobody listens there, else any free port of this machine."""
    with socket.socket() as probe:
        try:
            probe.bind((LOOPBACK, preferred))
        except OSError:
            probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def listening(port: int, timeout_s: float = 0.5) -> bool:
    """Whether somebody accepts connections on ``port`` of this machine."""
    try:
        socket.create_connection((LOOPBACK, port), timeout_s).close()
    except OSError:
        return False
    return True


def connected(port: int) -> bool:
    """Whether somebody holds a connection to ``port``, on which this process listens.

    rerun-sdk 0.41 does not tell when a viewer connects to its server, so the system is asked.  An operating system
    that does not say it counts as connected: nobody may wait for ever.
    """
    return _has(port, psutil.CONN_ESTABLISHED)


def opened(port: int, timeout_s: float = 5.0) -> bool:
    """Whether this process, which was told to, listens on ``port`` within the time."""
    deadline = time.monotonic() + timeout_s
    while not _has(port, psutil.CONN_LISTEN):
        if time.monotonic() > deadline or (listening(port) and not _has(port, psutil.CONN_LISTEN)):
            return False
        time.sleep(0.01)
    return True


def _has(port: int, status: str) -> bool:
    """Whether this process has a connection of ``status`` on ``port``; True where the system does not say."""
    try:
        sockets = psutil.Process().net_connections(kind="tcp")
    except psutil.AccessDenied:
        return True
    return any(one.status == status and one.laddr.port == port for one in sockets)


def require_display(asked: str) -> None:
    """BadInput, naming what was ``asked``, when a window cannot be opened; only Linux and its kin can tell."""
    if sys.platform in ("win32", "darwin"):
        return
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise BadInput(f"{asked}: no display for the viewer (DISPLAY and WAYLAND_DISPLAY are not set)")


def start(
    arguments: Sequence[str], port: int, timeout_s: float = 15.0, *, stay: bool = False
) -> subprocess.Popen[bytes]:
    """Run the viewer program until it listens on ``port``; it outlives us if it may ``stay``.

    RigError when it ends or does not listen in time.
    """
    process = launch(arguments, stay=stay)
    await_port(process, port, timeout_s)
    return process


def launch(arguments: Sequence[str], *, stay: bool = False) -> subprocess.Popen[bytes]:
    """Run the viewer program, which takes some tenths of a second before it listens: ``await_port``."""
    return subprocess.Popen(
        [str(program()), "--bind", LOOPBACK, *arguments],
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=stay,
    )


def await_port(process: subprocess.Popen[bytes], port: int, timeout_s: float = 15.0) -> None:
    """Wait until the viewer listens on ``port``; RigError when it ends, or, ended by us, does not in time."""
    deadline = time.monotonic() + timeout_s
    while not listening(port):
        if process.poll() is not None:
            raise RigError(f"the Rerun viewer ended at once (exit code {process.returncode}): no usable display?")
        if time.monotonic() > deadline:
            stop(process)
            raise RigError(f"the Rerun viewer did not start within {timeout_s:g} s")
        time.sleep(0.02)


def address(port: int) -> str:
    """Where a viewer that listens on ``port`` is reached."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def connect(port: int) -> ViewerClient:
    """The viewer that listens on ``port``, to be driven; RuntimeError when it does not answer.

    It is driven through rerun.experimental, which may change with any release: by what is got from here alone.
    """
    from rerun.experimental import ViewerClient

    return ViewerClient.connect(address(port))


def stop(process: subprocess.Popen[bytes], timeout_s: float = 5.0) -> None:
    """End a viewer: ask, then kill."""
    process.terminate()
    try:
        process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
