"""Mends a log that was cut: a killed process, a full disk, a lost machine."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadLog, RigError
from rig.files import replaced
from rig.log.container import Container
from rig.log.decode import Damaged, Part
from rig.log.index import Packed
from rig.log.layout import log_times
from rig.log.scan import About, iter_parts
from rig.log.schema import SCHEMA_VERSION
from rig.log.tables import RESULT, RIG, opening, runs_of

RECOVERED: Final = "recovered"  # name of the metadata record that says so


@dataclass(frozen=True, slots=True)
class Recovered:
    """What was saved; ``complete`` when there was nothing to mend, and then nothing was written."""

    frames: int
    last_time_s: float  # of the last frame; 0 when there is none
    complete: bool
    lost_bytes: int  # of the file, after its last whole record
    damage: str  # what was wrong, one line; empty when complete


def recover(path: Path | str, out: Path | str) -> Recovered:
    """Write every whole chunk before the cut or the damage in ``path`` to ``out``, with a new summary.

    ``out`` appears only when it is whole, and may be ``path``.  BadLog when ``path`` is no log of ours or
    was cut before its metadata; RigError when ``out`` cannot be written.
    """
    path, out = Path(path), Path(out)
    about, tally = About(), _Tally()
    try:
        for part in iter_parts(path, about):
            tally.add(part)
    except Damaged as error:
        damage, lost = error.what, path.stat().st_size - error.at
    else:
        return Recovered(tally.frames, tally.last / about.rate_hz, complete=True, lost_bytes=0, damage="")
    if not about.metadata:
        raise BadLog(f"{path}: {damage}, before its metadata: nothing can be recovered")
    version = about.metadata["schema_version"]
    if int(version) != SCHEMA_VERSION:
        raise BadLog(f"{path}: schema version {version}; only logs of version {SCHEMA_VERSION} are mended")
    _write(path, out, about, damage)
    return Recovered(tally.frames, tally.last / about.rate_hz, complete=False, lost_bytes=lost, damage=damage)


@dataclass(slots=True)
class _Tally:
    frames: int = 0
    last: int = 0

    def add(self, part: Part) -> None:
        self.frames += len(part.rows)
        if len(part.rows):
            self.last = int(part.rows["frame"][-1])


def _write(path: Path, out: Path, about: About, damage: str) -> None:
    with replaced(out) as made:
        try:
            file = Container(made, opening())
            try:
                _copy(path, file, about, damage)
            finally:
                file.close()
        except OSError as error:
            raise RigError(f"{out}: cannot be written: {error.strerror}") from None


def _copy(path: Path, file: Container, about: About, damage: str) -> None:
    file.metadata(RIG, about.metadata)
    for name, data in about.attachments.items():
        file.attachment(name, data)
    with suppress(Damaged):  # the damage that brought us here
        for part in iter_parts(path, About()):
            file.chunk(_packed(part, about.rate_hz))
    file.metadata(RECOVERED, {"damage": damage})
    if about.result is not None:
        file.metadata(RESULT, about.result)
    file.finish()


def _packed(part: Part, rate_hz: float) -> Packed:
    chunk = part.chunk
    times = log_times(part.rows["frame"], rate_hz)
    return Packed(chunk.data, chunk.uncompressed_crc, chunk.uncompressed_size, runs_of(times, part.event_entries))
