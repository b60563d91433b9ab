"""Whole logs that say something else: texts of the metadata exchanged, sums and summary made again."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from pathlib import Path

from hostile_cases.logs import records

_METADATA, _DATA_END = 0x0C, 0x0F
_NUMBER = re.compile(r"[\d.e+-]+")  # the rate and the log's version: without them nothing can be mended


def exchanged(source: Path, target: Path, before: str, after: str, mended: bool = True) -> None:
    """The log with one text of its metadata exchanged for another; not ``mended``: cut before its summary."""
    _rewrite(source, target, lambda text: text.replace(before, after), mended)


def retold(source: Path, target: Path, key: str, value: str) -> None:
    """The log with the first ``key`` of its recorded scenario saying ``value``, or its other metadata ``value``."""
    said = json.dumps(value)

    def change(text: str) -> str:
        if text.startswith("{"):
            return re.sub(rf'"{key}":"[^"]*"', lambda _: f'"{key}":{said}', text, count=1)
        return value if key == "id" and not _NUMBER.fullmatch(text) and len(text) < 30 else text

    _rewrite(source, target, change)


def _rewrite(source: Path, target: Path, change: Callable[[str], str], mended: bool = True) -> None:
    from mcap.data_stream import ReadDataStream
    from mcap.records import Metadata

    from rig.log import recover
    from rig.log.container import encode

    data, parts = source.read_bytes(), [b"\x89MCAP0\r\n"]
    for at, opcode in records(data):
        if opcode == _DATA_END:
            break
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        record = data[at:end]
        if opcode == _METADATA:
            read = Metadata.read(ReadDataStream(io.BytesIO(record[9:])))
            record = encode(Metadata(read.name, {name: change(text) for name, text in read.metadata.items()}))
        parts.append(record)
    cut = target.with_suffix(".cut") if mended else target
    cut.write_bytes(b"".join(parts))
    if not mended:
        return
    recover(cut, target)  # writes the summary and its sums
    cut.unlink()
