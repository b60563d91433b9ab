"""The destination of a stream: a file, a server for viewers, a window, or a viewer that already runs."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from rig.core.errors import BadInput, RigError
from rig.core.event import Event
from rig.core.files import reported
from rig.core.frame import Table
from rig.show.viewer import viewer
from rig.show.viewer.facts import Facts, Layout
from rig.show.viewer.story import Story

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    from rig.show.viewer.rerun_columns import Columns

APPLICATION: Final = "jsbsim-rig"  # the viewer keeps one layout per application
GRPC_PORT: Final = 9876  # Rerun's own default ports, when they are free
WEB_PORT: Final = 9090
FLUSH_S: Final = 60.0  # longest wait until a file is written
SERVER_MEMORY: Final = "512MB"  # kept for viewers that connect late; the oldest data are dropped first
WORDS: Final = ("off", "save", "serve", "spawn")
DESCRIPTORS: Final = Path("/dev/fd")  # names of pipes; not on Windows
_CHUNK: Final = 1 << 20  # bytes
_ADDRESS: Final = re.compile(r"rerun\+http://(?:127\.0\.0\.1|localhost):(\d{1,5})/proxy")


def check_where(where: str) -> None:
    """Raise BadInput unless ``where`` is one of WORDS or the address of a viewer that listens on this machine.

    "spawn" needs a display.  The check precedes all output.
    """
    match = _ADDRESS.fullmatch(where)
    if where not in WORDS and (match is None or not 0 < int(match[1]) < 65536):
        allowed = f"{', '.join(WORDS)} or rerun+http://127.0.0.1:PORT/proxy"
        raise BadInput(f"--rerun {where}: unknown, or not on this machine; allowed: {allowed}")
    if match is not None and not viewer.listening(int(match[1])):
        raise BadInput(f"--rerun {where}: no viewer listens there; start the viewer first, or use spawn, serve or save")
    if where == "spawn":
        viewer.require_display("--rerun spawn")


class About(NamedTuple):
    """The content of the viewer: its title, its flights in words (Markdown), its layout.

    blueprint : makes the layout of what is no flight; None: that of ``layout``
    """

    title: str
    text: str = ""
    layout: Layout = Layout()
    blueprint: Callable[[], rrb.Blueprint] | None = None


class Sink:
    """A Rerun recording, its data, and the resources that are closed with it."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        where: str,
        about: About,
        browser: str = "",
        connect: Callable[[], None] | None = None,
        also: Callable[[], None] | None = None,
        check: Callable[[], None] | None = None,
    ) -> None:
        """Keep the recording; ``connect`` is called first, ``also`` last, ``check`` before each block is sent."""
        self.where = where
        self.browser = browser
        self._recording = recording
        self._about = about
        self._connect = connect
        self._also = also
        self._check = check
        self._columns: list[Columns | None] = [None] * len(about.layout.shown)
        [*_, top] = about.layout.shown
        self._live = top.facts if top.facts.seen is None else None  # of a flight in progress
        self._story: Story | None = None

    @property
    def recording(self) -> rr.RecordingStream:
        """The recording; the caller sends what is no flight."""
        return self._recording

    def begin(self) -> None:
        """Connect and send the static data; may block for ever, as may send and flush."""
        from rig.show.viewer.scene import send_about, send_frame

        if self._connect is not None:
            self._connect()
        self._recording.send_recording_name(self._about.title)
        text = self._about.text if self._live is None else f"# IN FLIGHT\n\n{self._about.text}"
        send_about(self._recording, text, static=self._live is None)
        send_frame(self._recording)

    def send(self, table: Table, rate_hz: float, events: Sequence[Event], flight: int = 0) -> None:
        """Send frames and events of ``flight``, an index into ``shown`` of the layout, to Rerun."""
        from rig.show.viewer.rerun_columns import Columns
        from rig.show.viewer.style import FLIGHT_COLORS

        if self._check is not None:
            self._check()
        columns = self._columns[flight]
        if columns is None:
            shown = self._about.layout.shown[flight]
            columns = Columns(self._recording, rate_hz, shown.facts, shown.root, FLIGHT_COLORS[shown.below])
            self._columns[flight] = columns
        columns.send(table, events)
        if self._live is not None and len(table):
            self._tell(self._live, table, rate_hz)

    def _tell(self, facts: Facts, table: Table, rate_hz: float) -> None:
        """Send the headline of a flight in progress, if it has changed."""
        from rig.show.viewer.scene import send_about

        if self._story is None:
            self._story = Story(facts, rate_hz)
        if self._story.add(table):
            text = f"# {self._story.headline('IN FLIGHT')}\n\n{self._about.text}"
            send_about(self._recording, text, int(table["frame"][-1]) / rate_hz)

    def end(self, flight: int) -> None:
        """End the strips of ``flight`` while another one continues."""
        columns = self._columns[flight]
        if columns is not None:
            columns.end()

    def flush(self, timeout_s: float) -> None:
        """Wait until all data are written or transmitted; RuntimeError or ValueError: timeout."""
        self._recording.flush(timeout_sec=timeout_s)

    def close(self) -> None:
        """Close the file, the connection or the servers.  OSError: the file could not be written, and is removed."""
        self._recording.disconnect()
        if self._also is not None:
            self._also()


def open_sink(where: str, about: About, out_path: Path, server_memory: str = SERVER_MEMORY) -> Sink:
    """Open the sink of ``where`` (checked, not "off"); BadInput or RigError if that is impossible.

    out_path : the file of "save", which is replaced
    """
    import rerun as rr

    from rig.show.viewer.blueprint import blueprint

    recording = rr.RecordingStream(APPLICATION)
    layout = blueprint(about.layout) if about.blueprint is None else about.blueprint()
    if where == "save":
        return _save(recording, layout, out_path, about)
    if where == "serve":
        return _serve(recording, layout, about, server_memory)
    url = where
    if where == "spawn":  # a separate viewer that outlives this process
        port = viewer.free_port(GRPC_PORT)
        viewer.start(["--port", str(port), "--expect-data-soon"], port, stay=True)
        url = viewer.address(port)
    return Sink(recording, url, about, connect=lambda: recording.connect_grpc(url, default_blueprint=layout))


def _save(recording: rr.RecordingStream, layout: rrb.Blueprint, path: Path, about: About) -> Sink:
    with reported(path, BadInput):
        path.parent.mkdir(parents=True, exist_ok=True)
        if not DESCRIPTORS.is_dir():
            path.open("wb").close()  # raises an error; Rerun would write a line into its log
            recording.save(path, default_blueprint=layout)
            return Sink(recording, str(path), about)
        file = PipedFile(path)
    try:
        recording.save(file.pipe, default_blueprint=layout)
    except RuntimeError as error:
        raise RigError(f"{path}: cannot be written: {error}") from None
    finally:
        os.close(file.writing)
    return Sink(recording, str(path), about, also=file.close, check=file.check)


def _serve(recording: rr.RecordingStream, layout: rrb.Blueprint, about: About, server_memory: str) -> Sink:
    try:
        web = viewer.WebViewer(WEB_PORT)
    except OSError as error:
        raise RigError(f"the viewer's page cannot be served: {error}") from None
    try:
        url = _listen(recording, layout, server_memory, web.port)
    except (OSError, RuntimeError, RigError) as error:
        web.close()
        recording.disconnect()
        raise RigError(f"the viewer's data cannot be served: {error}") from None
    web.serve(url)
    return Sink(recording, url, about, web.url, also=web.close)


def _listen(recording: rr.RecordingStream, layout: rrb.Blueprint, server_memory: str, web_port: int) -> str:
    """Serve ``recording`` to viewers on a port of this process, for the page on ``web_port``: its address.

    If another process has taken the port meanwhile, rerun-sdk 0.41 writes a log line and continues without a server.
    """
    import rerun as rr

    for preferred in (GRPC_PORT, 0, 0):
        port = viewer.free_port(preferred)
        page = [f"http://{viewer.LOOPBACK}:{web_port}"]
        server = rr.GrpcServerSink(viewer.LOOPBACK, port, server_memory_limit=server_memory, cors_allow_origin=page)
        recording.set_sinks(server, default_blueprint=layout)
        if viewer.opened(port):
            return server.uri
    raise RigError("another process took every free port")


class PipedFile:
    """A file that receives the data written to ``pipe``; after an error the rest is read and dropped.

    Rerun's own writer would wait for ever when a disk is full.
    ``writing`` is the descriptor of the pipe's other end: close it once the writer has opened ``pipe``.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, and begin to read.  OSError: it cannot be opened."""
        self._path, self._file = path, path.open("wb", buffering=0)
        self._error: OSError | None = None
        self._reading, self.writing = os.pipe()
        self.pipe = DESCRIPTORS / str(self.writing)
        self._thread = threading.Thread(target=self._copy, name="recording", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise the OSError of a file that could not be written."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait until the writer has closed its end; OSError as ``check``: the file is removed."""
        self._thread.join()
        if self._error is not None:
            self._path.unlink(missing_ok=True)
        self.check()

    def _copy(self) -> None:
        with self._file, open(self._reading, "rb", buffering=0) as pipe:  # noqa: PTH123 # a descriptor, no path
            while data := pipe.read(_CHUNK):
                try:
                    while self._error is None and data:
                        data = data[self._file.write(data) :]
                except OSError as error:
                    self._error = error
