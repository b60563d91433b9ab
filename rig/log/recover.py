"""Mends a log that was cut: a killed process, a full disk, a lost machine."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadLog
from rig.log.container import Container
from rig.log.decode import Damaged, Part
from rig.log.index import Packed
from rig.log.layout import log_times
from rig.log.scan import About, iter_parts
from rig.log.schema import SCHEMA_VERSION
from rig.log.tables import RESULT, RIG, opening, runs_of
from rig.util.files import replaced, reported

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
    about, frames, last, damage, lost = About(), 0, 0, "", 0
    try:
        for part in iter_parts(path, about):
            frames += len(part.rows)
            last = int(part.rows["frame"][-1]) if len(part.rows) else last
    except Damaged as error:
        damage, lost = error.what, path.stat().st_size - error.at
        _mend(path, out, about, damage)
    return Recovered(frames, last / about.rate_hz, complete=not damage, lost_bytes=lost, damage=damage)


def _mend(path: Path, out: Path, about: About, damage: str) -> None:
    if not about.metadata:
        raise BadLog(f"{path}: {damage}, before its metadata: nothing can be recovered")
    version = about.metadata["schema_version"]
    if int(version) != SCHEMA_VERSION:
        raise BadLog(f"{path}: schema version {version}; only logs of version {SCHEMA_VERSION} are mended")
    with replaced(out) as made, reported(out), closing(Container(made, opening())) as file:
        _copy(path, file, about, damage)


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
