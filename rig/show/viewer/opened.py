"""Logs opened in the viewer with the columns and the layout of the live stream; up to four flights together.

Rerun can also open the .mcap directly, but without a layout, and dates the flight 1970.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Protocol

from rig.core.ending import ending
from rig.core.errors import BadInput, BadLog, RigError
from rig.core.files import replaced, reported
from rig.core.text import plain
from rig.log import Log, read_log, scenario_of
from rig.show.viewer import viewer
from rig.show.viewer.facts import TAGS, Layout, of_log, together
from rig.show.viewer.sink import FLUSH_S, SERVER_MEMORY, About, Sink, open_sink
from rig.show.viewer.story import look

BATCH: Final = 6000  # frames per batch


class Contents(Protocol):
    """Contents of the viewer: flights, or votes on a recording."""

    @property
    def about(self) -> About: ...  # noqa: D102
    @property
    def frames(self) -> int: ...  # noqa: D102
    @property
    def counted(self) -> str: ...  # noqa: D102
    @property
    def moment_s(self) -> float: ...  # noqa: D102
    @property
    def room(self) -> int: ...  # noqa: D102
    def send(self, sink: Sink) -> None: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class Opened:
    """Logs that were read, and their layout; the last is on top."""

    logs: tuple[Log, ...]
    about: About

    @property
    def frames(self) -> int:
        """Number of frames of all logs."""
        return sum(len(log.rows) for log in self.logs)

    @property
    def counted(self) -> str:
        """The name of the things in ``frames``."""
        return "frames"

    @property
    def moment_s(self) -> float:
        """The initial time of the cursor: the isolation of the decisive fault, or the last event, or the end."""
        log, seen = self.logs[-1], self.about.layout.shown[-1].facts.seen
        if seen is not None and seen.isolated_s is not None:
            return seen.isolated_s
        frame = log.events[-1].frame if log.events else int(log.rows["frame"][-1])
        return frame / log.rate_hz

    @property
    def room(self) -> int:
        """Bytes of the frames of all logs."""
        return sum(log.rows.nbytes for log in self.logs)

    def send(self, sink: Sink) -> None:
        """Send all frames and events, and wait until they are written or transmitted."""
        sink.begin()
        longest_s = max(len(log.rows) / log.rate_hz for log in self.logs)
        for flight, log in enumerate(self.logs):
            for first in range(0, len(log.rows), BATCH):
                part, events = slice(first, first + BATCH), log.events if first == 0 else ()
                sink.send(log.table[part], log.rate_hz, events, flight)
            if len(log.rows) / log.rate_hz < longest_s:
                sink.end(flight)
        sink.flush(FLUSH_S)


def read(paths: Sequence[Path], tab: str = "overview", map_tiles: bool = False) -> Opened:
    """Read the logs at ``paths``; the last is on top.

    BadInput: too many; BadLog, one line: a file is missing, foreign, cut, damaged or empty.
    """
    if not 1 <= len(paths) <= len(TAGS):
        raise BadInput(f"{len(paths)} logs: 1 to {len(TAGS)} can be shown together")
    logs = tuple(read_log(path) for path in paths)
    for path, log in zip(paths, logs, strict=True):
        if not len(log.rows):
            raise BadLog(f"{path}: has no frames")
    looked = []
    for log in logs:
        facts = replace(of_log(log.metadata), paced=bool(log.timing["late_us"].any()))
        looked.append(look(facts, log.table, log.rate_hz, log.result is not None))
    shown, names = together([facts for facts, _ in looked]), _names(paths)
    mark = "#" if len(logs) == 1 else "##"
    lines = [
        f"{mark} {flight.prefix}{headline}\n\n{_words(flight.prefix + name, log)}"
        for flight, (_, headline), name, log in zip(shown, looked, names, logs, strict=True)
    ]
    title = ", ".join(flight.prefix + name for flight, name in zip(shown, names, strict=True))
    return Opened(logs, About(title, "\n\n".join(lines), Layout(shown, tab, map_tiles)))


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the names of the files, with enough of their folders to distinguish them."""
    depth = 1
    whole = [path.resolve().parts for path in paths]
    while depth < max(map(len, whole)) and len({parts[-depth:] for parts in whole}) < len(set(whole)):
        depth += 1
    return [plain(str(Path(*parts[-depth:]).with_suffix(""))) for parts in whole]


def _words(name: str, log: Log) -> str:
    """Return a line of Markdown that identifies the flight of a log."""
    result = log.result or {}
    scenario = scenario_of(log.metadata, name)
    parts = [
        scenario.get("title") or scenario.get("aircraft", ""),
        f"seed {log.metadata['seed']}" if "seed" in log.metadata else "",
        f"{log.rate_hz:g} Hz",
        ending(result.get("survived") == "True", result.get("end_reason", ""), log.frames, log.rate_hz)
        if result
        else f"not finished, {log.frames / log.rate_hz:g} s",
    ]
    return f"**{name}** " + "; ".join(filter(None, parts))


def save(opened: Contents, rrd: Path) -> None:
    """Write ``rrd``, with the layout in it; BadInput: it cannot be opened; RigError: disk error."""
    if rrd.suffix != ".rrd":
        raise BadInput(f"{rrd}: must end in .rrd")
    with replaced(rrd) as part, reported(rrd):
        sink = open_sink("save", opened.about, part)
        try:
            opened.send(sink)
        except RuntimeError as error:  # by Rerun
            raise RigError(f"{rrd}: cannot be written: {error}") from None
        finally:
            sink.close()


def serve(opened: Contents) -> Sink:
    """Serve the flights to viewers on this machine until the sink is closed; its ``browser`` is the address to open."""
    room = max(int(SERVER_MEMORY.removesuffix("MB")), 4 * opened.room // 1_000_000)
    sink = open_sink("serve", opened.about, Path(), f"{room}MB")
    opened.send(sink)
    return sink


@contextmanager
def as_file(opened: Contents) -> Iterator[Path]:
    """Write a temporary .rrd of the flights: a viewer loads a file much faster than a stream."""
    with tempfile.TemporaryDirectory(prefix="rig-view-") as folder:
        rrd = Path(folder) / "flights.rrd"
        save(opened, rrd)
        yield rrd


@contextmanager
def window(opened: Contents, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Open a viewer's window with the flights, closed at the end.  ``arguments`` are for the viewer program.

    The viewer starts while the file is written.  RigError: the viewer did not open the file.
    """
    port = viewer.free_port()
    process = viewer.launch(["--port", str(port), "--expect-data-soon", *arguments])
    try:
        with as_file(opened) as rrd:
            viewer.await_port(process, port)
            try:
                viewer.connect(port).open(str(rrd))
            except (RuntimeError, OSError) as error:
                raise RigError(f"the viewer: {str(error).splitlines()[0]}") from None
            yield process
    finally:
        viewer.stop(process)
