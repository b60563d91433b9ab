"""Where a stream goes: a file, a server for viewers, a viewer's window, a viewer that runs already."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rig.errors import BadInput, RigError
from rig.frame import Block
from rig.view import viewer

if TYPE_CHECKING:
    import rerun as rr

    from rig.view.columns import EventLike

APPLICATION: Final = "jsbsim-rig"  # the viewer keeps one layout per application
GRPC_PORT: Final = 9876  # Rerun's own default ports, when they are free
WEB_PORT: Final = 9090
SERVER_MEMORY: Final = "512MB"  # what late viewers can still be sent; the oldest data go first
WORDS: Final = ("off", "save", "serve", "spawn")
_ADDRESS: Final = re.compile(r"rerun\+http://(?:127\.0\.0\.1|localhost):(\d{1,5})/proxy")


def check_where(where: str) -> None:
    """BadInput unless ``where`` is one of WORDS or the address of a viewer that listens on this machine.

    A viewer to be spawned needs a display.  Called before anything is written.
    """
    match = _ADDRESS.fullmatch(where)
    if where not in WORDS and (match is None or not 0 < int(match[1]) < 65536):
        allowed = f"{', '.join(WORDS)} or rerun+http://127.0.0.1:PORT/proxy"
        raise BadInput(f"--rerun {where}: not known, or not on this machine; allowed: {allowed}")
    if match is not None and not viewer.listening(int(match[1])):
        raise BadInput(f"--rerun {where}: nobody listens there; start the viewer first, or use spawn, serve or save")
    if where == "spawn":
        viewer.require_display("--rerun spawn")


class Sink:
    """A Rerun recording and what has to be closed with it."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        where: str,
        title: str,
        browser: str = "",
        connect: Callable[[], None] | None = None,
        also: Callable[[], None] | None = None,
    ) -> None:
        """``connect`` is called first of all, ``also`` last."""
        self.where = where
        self.browser = browser
        self._recording = recording
        self._title = title
        self._connect = connect
        self._also = also

    def begin(self) -> None:
        """Connect and send what does not change; may block for ever, as send and flush may."""
        from rig.view.columns import send_aircraft

        if self._connect is not None:
            self._connect()
        self._recording.send_recording_name(self._title)
        send_aircraft(self._recording)

    def send(self, rows: Block, rate_hz: float, events: Sequence[EventLike]) -> None:
        """Hand rows and events to Rerun."""
        from rig.view.columns import send_block

        send_block(self._recording, rows, rate_hz, events)

    def flush(self, timeout_s: float) -> None:
        """Wait until all is written or handed on; RuntimeError or ValueError when it is not in time."""
        self._recording.flush(timeout_sec=timeout_s)

    def close(self) -> None:
        """Close the file, the connection or the servers."""
        self._recording.disconnect()
        if self._also is not None:
            self._also()


def open_sink(where: str, title: str, out_path: Path) -> Sink:
    """The sink that ``where`` (checked, not "off") asks for; BadInput or RigError when it cannot be had."""
    if where == "save":
        return _save(out_path.with_suffix(".rrd"), title)
    if where == "serve":
        return _serve(title)
    if where == "spawn":
        return _connect(_spawn(), title)
    return _connect(where, title)


def _save(path: Path, title: str) -> Sink:
    import rerun as rr

    from rig.view.blueprint import blueprint

    recording = rr.RecordingStream(APPLICATION)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("wb").close()  # an error of ours, rather than a line in Rerun's log
        recording.save(path, default_blueprint=blueprint())
    except (OSError, RuntimeError) as error:
        raise BadInput(f"{path}: cannot be written: {error}") from None
    return Sink(recording, str(path), title)


def _serve(title: str) -> Sink:
    import rerun as rr

    from rig.view.blueprint import blueprint
    from rig.view.web import WebViewer

    recording = rr.RecordingStream(APPLICATION)
    web_port = viewer.free_port(WEB_PORT)
    server = rr.GrpcServerSink(
        viewer.LOOPBACK,
        viewer.free_port(GRPC_PORT),
        server_memory_limit=SERVER_MEMORY,
        cors_allow_origin=[f"http://{viewer.LOOPBACK}:{web_port}"],
    )
    try:
        recording.set_sinks(server, default_blueprint=blueprint())
        web = WebViewer(web_port, server.uri)
    except (OSError, RuntimeError) as error:
        recording.disconnect()
        raise RigError(f"--rerun serve: {error}") from None
    return Sink(recording, server.uri, title, web.url, also=web.close)


def _spawn() -> str:
    """A viewer in a window of its own, which outlives us; its address."""
    port = viewer.free_port(GRPC_PORT)
    viewer.start(["--port", str(port), "--expect-data-soon"], port, stay=True)
    return f"rerun+http://{viewer.LOOPBACK}:{port}/proxy"


def _connect(url: str, title: str) -> Sink:
    import rerun as rr

    from rig.view.blueprint import blueprint

    recording = rr.RecordingStream(APPLICATION)
    return Sink(recording, url, title, connect=lambda: recording.connect_grpc(url, default_blueprint=blueprint()))


def abandon() -> None:
    """Keep Rerun from waiting, when the process ends, for a sink that does not answer."""
    import rerun as rr

    rr.unregister_shutdown()
