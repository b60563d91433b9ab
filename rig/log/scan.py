"""Check every byte of a log, and repair one that was cut.

Each byte of the file is under one of three checksums (chunk, data section, footer): what comes out of a
log without BadLog is what was written.  A log that another program wrote again, in another structure, is read by
remade.py; it has the checksums that the program gave it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

from mcap.opcode import Opcode

from rig.core.errors import BadLog
from rig.core.files import open_regular, replaced, reported
from rig.core.frame import Table
from rig.log.container import MAGIC, Container, Packed
from rig.log.decode import Damaged, Decoder, Part, damage
from rig.log.log_records import About, Descriptions, note, records, written_again
from rig.log.remade import remade_parts
from rig.log.schema import ALL_TOPICS, MESSAGES_SINCE, RESULT, RIG, opening

RECOVERED: Final = "recovered"  # name of the metadata record of a log that was mended


@dataclass(slots=True)
class Contents(About):
    """A log that was checked: numbers of its frames, messages and events, and the place of its damage."""

    frames: int = 0
    messages: Counter[str] = field(default_factory=Counter)  # by their topics
    last_frame: int = 0
    events: Counter[str] = field(default_factory=Counter)  # by their names
    damaged: Damaged | None = None

    @property
    def damage(self) -> str:
        """One line; empty when every byte is as it was written."""
        return "" if self.damaged is None else self.damaged.what


def contents(path: Path) -> Contents:
    """Scan the log at ``path``, up to its damage if it has any; raise BadLog if it is no log of the rig."""
    counted = Contents()
    try:
        for part in iter_parts(path, counted):
            counted.frames += len(part.rows)
            counted.last_frame = int(part.rows["frame"][-1]) if len(part.rows) else counted.last_frame
            counted.events.update(event.name for event in part.events)
            for run in part.runs:
                for channel in run.channels:
                    counted.messages[ALL_TOPICS[channel - 1].name] += len(run.times)
    except Damaged as error:
        counted.damaged = error
    return counted


def iter_parts(path: Path, about: About) -> Iterator[Part]:
    """Read ``path`` from end to end, filling ``about``; Damaged at the first byte that is not as it was written."""
    with open_regular(path, kind=BadLog) as file, reported(path, BadLog, "cannot be read"):
        yield from _parts(file, path, about)


def _parts(file: BinaryIO, path: Path, about: About) -> Iterator[Part]:
    if file.read(len(MAGIC)) != MAGIC:
        raise BadLog(f"{path}: not an MCAP file")
    if written_again(file, path):
        yield from remade_parts(file, path, about)
        return
    described = Descriptions(path)
    with Decoder(path) as decoder:
        try:
            for record in records(file, path):
                if record.opcode == Opcode.CHUNK:
                    with damage(path, record.offset):
                        layout = described.check(about)
                    yield from decoder.add(record.content, record.offset, layout)
                elif record.opcode != Opcode.MESSAGE_INDEX:  # which the chunks tell better
                    yield from decoder.rest()  # what a record says counts only when all before it is whole
                    with damage(path, record.offset):
                        note(record, path, about, described)
        except Damaged:
            yield from decoder.rest()
            raise


@dataclass(frozen=True, slots=True)
class Recovered:
    """The result of a recovery; ``complete`` if the log was whole, and then nothing was written."""

    frames: int
    last_time_s: float  # of the last frame; 0 when there is none
    complete: bool
    lost_bytes: int  # of the file, after its last whole record
    damage: str  # one line; empty when complete


def recover(path: Path | str, out: Path | str) -> Recovered:
    """Write every whole chunk before the cut or the damage in ``path`` to ``out``, with a new summary.

    ``out`` appears only when it is whole, and may be ``path``.  BadLog when ``path`` is no log of the rig or
    was cut before its metadata; RigError when ``out`` cannot be written.
    """
    path, out = Path(path), Path(out)
    log, lost = contents(path), 0
    if log.damaged is not None:
        _check_mendable(path, log)
        with replaced(out) as draft, reported(out):
            if log.again:
                _write_again(path, draft, log)
            else:
                with closing(Container(draft, opening(log.parts))) as file:
                    _copy(path, file, log)
        lost = path.stat().st_size - log.damaged.at
    last_s = log.last_frame / log.rate_hz
    return Recovered(log.frames, last_s, complete=not log.damage, lost_bytes=lost, damage=log.damage)


def _check_mendable(path: Path, log: Contents) -> None:
    if not log.metadata:
        raise BadLog(f"{path}: {log.damage}, before its metadata: nothing can be recovered")
    version = log.metadata["schema_version"]
    if int(version) < MESSAGES_SINCE:
        raise BadLog(f"{path}: schema version {version}; rig recover repairs logs from version {MESSAGES_SINCE} on")


def _copy(path: Path, file: Container, log: Contents) -> None:
    file.metadata(RIG, log.metadata)
    for name, data in log.attachments.items():
        file.attachment(name, data)
    with suppress(Damaged):  # the damage that brought us here
        for part in iter_parts(path, About()):
            if (chunk := part.chunk) is not None:
                file.chunk(Packed(chunk.data, chunk.uncompressed_crc, chunk.uncompressed_size, part.runs))
    file.metadata(RECOVERED, {"damage": log.damage})
    if log.result is not None:
        file.metadata(RESULT, log.result)
    file.finish()


def _write_again(path: Path, draft: Path, log: Contents) -> None:
    """Write the frames before the damage of a log whose chunks are not the rig's."""
    from rig.log.writer import LogWriter  # which needs kernels

    with LogWriter(draft, log.rate_hz, log.metadata, log.attachments.items(), parts=log.parts) as writer:
        with suppress(Damaged):
            for part in iter_parts(path, About()):
                writer.write(Table(part.rows, part.beside, part.timing), part.events)
        writer.note(RECOVERED, {"damage": log.damage})
        writer.close(log.result)
