"""Files with a checksum of their bytes: tables in Parquet, and JSON.

A sealed file holds ``rig.sha256=`` and the SHA-256 of all its bytes, with zeros in the place of these 64 digits: in the
metadata of a table, or under the last key of a JSON object.  It is one file, complete or absent after a kill.
It also holds the place for which it was written: a copy at another place is refused.
"""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rig.core.errors import BadInput
from rig.core.files import read_bytes

if TYPE_CHECKING:
    import polars as pl

MOST_BYTES: Final = 1 << 28  # of a JSON file of a folder
_MARK: Final = b"rig.sha256="
_DIGITS: Final = 64
_BLANK: Final = _MARK.decode() + "0" * _DIGITS
_SEAL, _PLACE, _ROWS = "seal", "place", "rows"  # keys
DAMAGED: Final = "its bytes were changed after it was written"
NO_SEAL: Final = "it has no checksum"
ELSEWHERE: Final = "it was written for another place, so it is a copy"


def table(frame: pl.DataFrame, place: str) -> bytes:
    """Return a table as Parquet under a checksum; ``place``: the only one at which it is read."""
    memory = io.BytesIO()
    frame.write_parquet(memory, metadata={_PLACE: place, _ROWS: str(len(frame)), _SEAL: _BLANK})
    return _sealed(memory.getvalue())


def fault_of_table(data: bytes, place: str) -> tuple[str, int]:
    """Return the fault of the bytes of a table at ``place``, "" if none, and the number of its rows."""
    import polars as pl

    if wrong := fault(data):
        return wrong, 0
    held = pl.read_parquet_metadata(data)
    return ("", int(held[_ROWS])) if held[_PLACE] == place else (ELSEWHERE, 0)


def read_table(path: Path, place: str, remedy: str, under_seal: bool = True) -> pl.DataFrame:
    """Read a table.  BadInput: it is no file, cannot be read, or is not the table that was written at ``place``.

    remedy : end of the error's line;  under_seal : False for a table of an earlier version, without a checksum
    """
    import polars as pl

    data = read_bytes(path, MOST_BYTES)
    try:
        wrong = fault_of_table(data, place)[0] if under_seal else ""
        if not wrong:
            return pl.read_parquet(data, hive_partitioning=False)
    except (OSError, KeyError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        wrong = f"cannot be read ({' '.join(str(error).split())[:120]})"
    raise BadInput(f"{path}: {wrong}; {remedy}")


def to_json(data: dict[str, Any], place: str = "") -> bytes:
    """Return plain data as JSON under a checksum."""
    return _sealed(json.dumps({**data, _PLACE: place, _SEAL: _BLANK}, indent=1, allow_nan=False).encode())


def read_json(path: Path, remedy: str, place: str = "", formats: tuple[int, int] | None = None) -> dict[str, Any]:
    """Read the JSON object that ``to_json`` wrote.  BadInput: it cannot be read, is none, or has other bytes.

    remedy : follows what is wrong
    formats : the ``format`` that it may have: this version's, and an earlier one's, whose files have no checksum
    """
    data = read_bytes(path, MOST_BYTES)
    try:
        content = json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: cannot be read: {' '.join(str(error).split())[:120]}; {remedy}") from None
    if not isinstance(content, dict):
        raise BadInput(f"{path}: is damaged: it is not a table; {remedy}")
    if formats is not None:
        if content.get("format") not in formats:
            raise BadInput(f"{path}: is damaged, or not of this version of the rig; {remedy}")
        if content["format"] == formats[1] and _SEAL not in content:
            return content
    wrong = fault(data) or (ELSEWHERE if content.get(_PLACE) != place else "")
    if wrong:
        raise BadInput(f"{path}: is damaged: {wrong}; {remedy}")
    return {key: value for key, value in content.items() if key not in (_PLACE, _SEAL)}


def identity(*parts: bytes) -> str:
    """Return a short hash of the content of a folder, for the places of its files."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()[:16]


def _sealed(data: bytes) -> bytes:
    at = data.rindex(_MARK) + len(_MARK)  # the last one: text in the data may look like it
    return data[:at] + hashlib.sha256(data).hexdigest().encode() + data[at + _DIGITS :]


def fault(data: bytes) -> str:
    """Return the fault of the bytes of a file with a checksum, "" if none."""
    at = data.rfind(_MARK) + len(_MARK)
    if at < len(_MARK):
        return NO_SEAL
    digest = hashlib.sha256(data[:at])
    digest.update(b"0" * _DIGITS)
    digest.update(data[at + _DIGITS :])
    return "" if digest.hexdigest().encode() == data[at : at + _DIGITS] else DAMAGED
