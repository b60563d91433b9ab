"""The viewer program of rerun-sdk as a child process: loopback only, no usage analytics.

rr.spawn of rerun-sdk searches `rerun` on the PATH, listens on every interface and waits 11 s if there is no display,
so this module starts the program.  rr.serve_web_viewer listens on every interface too, and its page reports usage to
its makers.  So this module takes the files of the page once from the viewer program and serves them on the loopback
address, with a policy that lets the browser connect to this machine only.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote, urlsplit
from urllib.request import ProxyHandler, build_opener

import psutil

from rig.core.errors import BadInput, RigError
from rig.core.files import is_file

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

LOOPBACK: Final = "127.0.0.1"
POLICY: Final = "connect-src 'self' http://127.0.0.1:* http://localhost:* blob: data:"
_FILES: Final = ("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/sw.js", "/favicon.ico")
_KEPT_HEADERS: Final = ("Content-Type", "rerun-final-length")  # the second drives the progress bar of the page


def program() -> Path:
    """Return the executable of the viewer in the installed rerun-sdk; RigError: it is missing."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
        if is_file(folder / name):
            return folder / name
    raise RigError("the Rerun viewer is not part of the installed rerun-sdk")


def environment(given: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return variables for the process of the viewer: ``given`` (of this process) with usage analytics switched off.

    Rerun collects no usage data on a build server, and then neither reads nor writes the setting of the user
    (`rerun analytics`).
    """
    base = os.environ if given is None else given
    return {name: value for name, value in base.items() if name != "FORCE_RERUN_ANALYTICS"} | {"CI": "true"}


def free_port(preferred: int = 0) -> int:
    """Return ``preferred`` if no program listens there, or any free port of this machine."""
    with socket.socket() as probe:
        try:
            probe.bind((LOOPBACK, preferred))
        except OSError:
            probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def listening(port: int, timeout_s: float = 0.5) -> bool:
    """Return True if a program accepts connections on ``port`` of this machine."""
    try:
        socket.create_connection((LOOPBACK, port), timeout_s).close()
    except OSError:
        return False
    return True


def connected(port: int) -> bool:
    """Return True if a program is connected to ``port``, on which this process listens.

    rerun-sdk 0.41 does not report connections to its server, so this function reads them from the operating system.
    If the system does not report them, the result is True, so that no caller waits for ever.
    """
    return _has(port, psutil.CONN_ESTABLISHED)


def opened(port: int, timeout_s: float = 5.0) -> bool:
    """Return True if this process listens on ``port`` within the time."""
    deadline = time.monotonic() + timeout_s
    while not _has(port, psutil.CONN_LISTEN):
        if time.monotonic() > deadline or (listening(port) and not _has(port, psutil.CONN_LISTEN)):
            return False
        time.sleep(0.01)
    return True


def _has(port: int, status: str) -> bool:
    """Return True if this process has a connection of ``status`` on ``port``; True if the system does not report it."""
    try:
        sockets = psutil.Process().net_connections(kind="tcp")
    except psutil.AccessDenied:
        return True
    return any(each.status == status and each.laddr.port == port for each in sockets)


def require_display(asked: str) -> None:
    """Raise BadInput, which names ``asked``, if there is no display; not checked on Windows and macOS."""
    if sys.platform in ("win32", "darwin"):
        return
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise BadInput(f"{asked}: no display for the viewer (DISPLAY and WAYLAND_DISPLAY are not set)")


def start(
    arguments: Sequence[str], port: int, timeout_s: float = 15.0, *, stay: bool = False
) -> subprocess.Popen[bytes]:
    """Run the viewer program until it listens on ``port``; with ``stay`` it outlives this process.

    RigError: it ends, or does not listen in time.
    """
    process = launch(arguments, stay=stay)
    await_port(process, port, timeout_s)
    return process


def launch(arguments: Sequence[str], *, stay: bool = False) -> subprocess.Popen[bytes]:
    """Run the viewer program; it listens after some tenths of a second: ``await_port``."""
    return subprocess.Popen(
        [str(program()), "--bind", LOOPBACK, *arguments],
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=stay,
    )


def await_port(
    process: subprocess.Popen[bytes], port: int, timeout_s: float = 15.0, needs: str = "no usable display?"
) -> None:
    """Wait until the viewer listens on ``port``; RigError: it ends (the message has ``needs``), or a timeout."""
    deadline = time.monotonic() + timeout_s
    while not listening(port):
        if process.poll() is not None:
            raise RigError(f"the Rerun viewer ended at once (exit code {process.returncode}): {needs}")
        if time.monotonic() > deadline:
            stop(process)
            raise RigError(f"the Rerun viewer did not start within {timeout_s:g} s")
        time.sleep(0.02)


def address(port: int) -> str:
    """Return the address of a viewer that listens on ``port``."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def connect(port: int) -> ViewerClient:
    """Connect to the viewer that listens on ``port``; RuntimeError: it does not reply.

    The client belongs to rerun.experimental, which may change with any release; only this module imports it.
    """
    from rerun.experimental import ViewerClient

    return ViewerClient.connect(address(port))


def stop(process: subprocess.Popen[bytes], timeout_s: float = 5.0) -> None:
    """End a viewer: terminate, then kill."""
    process.terminate()
    try:
        process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class WebViewer:
    """The page of the viewer on ``port``: reserved at once, served from ``serve`` until closed."""

    def __init__(self, preferred: int) -> None:
        """Reserve the port ``preferred`` if it is free, or any free one."""
        self.url = ""
        self.files = _fetch()
        try:
            self._server = ThreadingHTTPServer((LOOPBACK, preferred), _handler(self.files))
        except OSError:
            self._server = ThreadingHTTPServer((LOOPBACK, 0), _handler(self.files))
        self._server.daemon_threads = True
        self._served = False
        self.port = self._server.server_port

    def serve(self, grpc_url: str) -> None:
        """Serve the page; its address shows the data of the server at ``grpc_url``."""
        self.url = f"http://{LOOPBACK}:{self.port}/?url={quote(grpc_url, safe='')}&theme=dark"
        threading.Thread(target=self._server.serve_forever, name="web viewer", daemon=True).start()
        self._served = True

    def close(self) -> None:
        """Stop serving; a page that is open stays open."""
        if self._served:
            self._server.shutdown()
        self._server.server_close()


File = tuple[dict[str, str], bytes]  # headers, contents


def _fetch() -> dict[str, File]:
    """Fetch the page's files, about 45 MB, from the viewer program; which runs for a moment."""
    port = free_port()
    unused = address(free_port())
    process = start(["--serve-web", "--web-viewer-port", str(port), unused], port)
    opener = build_opener(ProxyHandler({}))  # no proxy for loopback addresses
    try:
        files: dict[str, File] = {}
        for path in _FILES:
            with opener.open(f"http://{LOOPBACK}:{port}{path}", timeout=10) as reply:
                headers = {name: reply.headers[name] for name in _KEPT_HEADERS if name in reply.headers}
                files[path] = headers, reply.read()
        return files
    finally:
        stop(process)


def _handler(files: dict[str, File]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 30

        def do_GET(self) -> None:  # the name that http.server asks for
            file = files.get(urlsplit(self.path).path)
            headers, contents = file or ({"Content-Type": "text/plain"}, b"not found\n")
            self.send_response(200 if file else 404)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(contents)))
            self.send_header("Content-Security-Policy", POLICY)
            self.end_headers()
            self.wfile.write(contents)

        def log_message(self, format: str, *args: Any) -> None:
            """Print nothing: the terminal belongs to the flight."""

    return Handler
