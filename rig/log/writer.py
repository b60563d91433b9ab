"""Write a flight while it is flown: every frame of every signal, two seconds at a time at most."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import zstandard
from foxglove_schemas_protobuf.Log_pb2 import Log as FoxgloveLog
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadInput, RigError
from rig.core.event import Event
from rig.core.frame import TIMING, RowParts, Table, new_block, second_rows
from rig.log.chunk_layout import event_runs, frame_runs, log_times, row_bytes
from rig.log.container import Container, Packed, Run
from rig.log.packing import pack, plan
from rig.log.records import HEAD, MESSAGE_OPCODE
from rig.log.schema import EVENT_CHANNEL, LEVELS, RESULT, RIG, SCHEMA_VERSION, opening

# Nearly all that repeats is in the record before, so a small table finds it: of matches of five bytes, since noise
# stands between them.  A target length of 1 leaves what does not repeat as it is: noise, of which entropy coding would
# save 1 % more, in a tenth more time.
COMPRESSION: Final = zstandard.ZstdCompressionParameters(
    window_log=18, hash_log=14, chain_log=14, min_match=5, target_length=1, strategy=zstandard.STRATEGY_FAST
)
CHUNK_S: Final = 2.0  # of flight; the first records of a chunk repeat nothing
_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
CHUNK_BYTES: Final = 1 << 20  # before compression; at high rates a chunk is shorter than CHUNK_S
EVENT_BYTES: Final = 1 << 12  # of them left for events


def compile_packing(parts: RowParts) -> None:
    """Compile what packs rows for a log, before a unit waits for its first frame; parts : as of LogWriter."""
    table = Table(new_block(1), second_rows(1, parts) if parts else None, np.zeros(1, TIMING))
    pack(table, log_times(table["frame"], 1.0), plan(1, table.parts).blank.copy(), table.parts)


class LogWriter:
    """One log file, open from before the first frame to after the last.

    ``metadata`` (resolved scenario, seed, versions) and ``attachments`` (file name, bytes; the scenario
    file first) must be enough to fly it again.  ``chunk_frames``: the most in a chunk, CHUNK_S if not given;
    with few events never more than CHUNK_BYTES.  ``new``: FileExistsError if there is a file at ``path``; without it
    the file is replaced.
    ``parts``: of the second row, those that the flight has; its rows are given too.
    ``draft_of``: the file that ``path`` will be renamed to; messages name it.
    BadInput when the file cannot be made, RigError: a full disk.
    """

    def __init__(
        self,
        path: Path | str,
        rate_hz: float,
        metadata: Mapping[str, str],
        attachments: Iterable[tuple[str, bytes]] = (),
        chunk_frames: int | None = None,
        *,
        new: bool = False,
        draft_of: Path | None = None,
        parts: RowParts = (),
    ) -> None:
        self.path = Path(path)
        self._named = draft_of or self.path
        self._draft = draft_of is not None
        self._rate_hz = rate_hz
        most = (CHUNK_BYTES - EVENT_BYTES) // row_bytes(parts)
        self.chunk_frames = max(1, min(chunk_frames or int(CHUNK_S * rate_hz), most))
        self._blank_beside = second_rows(1, parts) if parts else None
        self._records = plan(self.chunk_frames, parts).blank.copy()
        self._compressor = zstandard.ZstdCompressor(compression_params=COMPRESSION)
        self._last_time = 0
        self._file: Container | None = None
        self._fill(Table(new_block(1), self._blank_beside, np.zeros(1, TIMING)), ())  # compiles before the first frame
        try:
            self._file = Container(self.path, opening(parts), new=new)
            about = {"schema_version": str(SCHEMA_VERSION), "rate_hz": repr(float(rate_hz))}
            self._file.metadata(RIG, {**metadata, **about})
            for name, data in attachments:
                self._file.attachment(name, data)
        except FileExistsError:  # new
            raise
        except OSError as error:
            if self._file is not None:
                self._file.discard()
            full = error.errno in _FULL and not self.path.exists()  # a device is there still, and is no place for a log
            kind = RigError if full else BadInput
            raise kind(f"{self._named}: the log cannot be written: {error.strerror}") from None

    def write(self, table: Table, events: Sequence[Event] = ()) -> None:
        """Append frames with their timing and the events found in them; on the disk when it returns.

        In chunks of at most ``chunk_frames``.  RigError when the disk is full: the log is then closed with
        what it holds.
        """
        timed = 0 if table.timing is None else len(table.timing)
        if timed != len(table):
            raise ValueError(f"{len(table)} rows, {timed} rows of timing")
        if table.beside is None and self._blank_beside is not None:
            table = Table(table.rows, self._blank_beside[:0], table.timing)
        starts = range(0, len(table), self.chunk_frames) or range(1 if events else 0)
        for start in starts:
            part = table[start : start + self.chunk_frames]
            self._append(*self._fill(part, events if start == starts[-1] else ()))

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record; OSError when the disk is full."""
        if self._file is not None:
            self._file.metadata(name, values)

    def close(self, result: Mapping[str, str] | None = None) -> None:
        """Write ``result`` (how the flight ended) and the summary; a second call does nothing.

        RigError when the disk is full, or when the file was deleted or moved in the meantime.
        """
        if self._file is None:
            return
        try:
            if result is not None:
                self._file.metadata(RESULT, result)
            gone = self._file.gone()
            self._file.finish()
            self._file = None
        except OSError as error:
            raise self._stopped(error) from None
        if gone:
            raise RigError(f"{self._named}: the log is no longer there: deleted or moved while it was written")

    def abort(self) -> None:
        """Close the file without its summary; ``recover`` can repair it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _fill(self, table: Table, events: Sequence[Event]) -> tuple[Any, list[Run]]:
        """Return the bytes of a chunk, which stay until the next call, and its runs."""
        times, parts = log_times(table["frame"], self._rate_hz), table.parts if self._blank_beside is not None else ()
        made = plan(len(table), parts)
        if len(self._records) != len(made.blank):
            self._records = made.blank.copy()
        data: Any = self._records
        pack(table, times, data, parts)
        entries: list[tuple[int, int]] = []
        if events:
            event_times = log_times(np.array([event.frame for event in events]), self._rate_hz)
            records = [_event(event, int(time)) for event, time in zip(events, event_times, strict=True)]
            offsets = data.nbytes + np.cumsum([0, *map(len, records)])
            entries = list(zip(event_times.tolist(), offsets[:-1].tolist(), strict=True))
            data = b"".join([data.tobytes(), *records])
        return data, [*frame_runs(times, parts), *event_runs(entries)]

    def _append(self, data: Any, runs: list[Run]) -> None:
        if self._file is None:
            raise RigError(f"{self._named}: the log is closed")
        packed = Packed(self._compressor.compress(data), crc32(data), memoryview(data).nbytes, runs)
        try:
            self._file.chunk(packed)
        except OSError as error:
            raise self._stopped(error) from None
        if runs and runs[0].channels.start != EVENT_CHANNEL:
            self._last_time = int(runs[0].times[-1])

    def _stopped(self, error: OSError) -> RigError:
        """Close the log as well as the disk allows, and say what happened."""
        assert self._file is not None
        try:
            self._file.rewind()
            self._file.finish()
            state = "the log is complete up to there"
        except OSError:
            state = "the log has no summary: run rig recover"
            self.abort()
        self._file = None
        what = "disk full" if error.errno in _FULL else "disk error"
        if self._draft:
            return RigError(f"{self._named}: cannot be written: {what} ({error.strerror})")
        end = self._last_time / 1e9
        return RigError(f"{self.path}: {what} ({error.strerror}), flight stopped at {end:.3f} s; {state}")


def _event(event: Event, time: int) -> bytes:
    message = FoxgloveLog(level=LEVELS[event.level], message=event.text, name=event.name)
    message.timestamp.FromNanoseconds(time)
    data = message.SerializeToString()
    length = HEAD.size - 9 + len(data)
    return HEAD.pack(MESSAGE_OPCODE, length, EVENT_CHANNEL, event.frame, time, time) + data
