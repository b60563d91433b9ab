"""INPUT of ``rig vote``: a CSV, Parquet or MCAP file, or a folder of tables with a mapping.

    our columns or our log       read as they are
    [mapping] in CONFIG          "<column of ours>" = "<source>:<field>"; the source is a topic of an MCAP file, or
                                 a file in the folder INPUT; a single table needs no source: "<field>"

Sources have times of their own, which are checked or repaired first (clock.py).  The rows are those of the first
source that the mapping names; of another, each row takes the sample nearest in time, or none when the nearest is
more than its sampling interval away.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from stat import S_ISDIR
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput
from rig.log import foreign
from rig.log.foreign import Source
from rig.recordings.clock import TIME, Floats, clock
from rig.recordings.own_logs import read_ours
from rig.recordings.recording import Recording, assemble, with_discretes
from rig.recordings.settings import VoteConfig
from rig.recordings.table import TABLES, Table
from rig.util.files import reported

ENDINGS: Final = (*TABLES, ".mcap")


def read(path: Path, config: VoteConfig, repair: bool = False) -> Recording:
    """Return the recording at ``path``, with ``repair`` without rows whose time repeats or steps back.

    BadInput in one line when it cannot be used.
    """
    return with_discretes(str(path), _read(path, config, repair), config.discrete)


def _read(path: Path, config: VoteConfig, repair: bool) -> Recording:
    if _is_folder(path):
        wanted = _wanted(path, config)
        return _joined(path, config, _folder(path, wanted, config.time_column), repair)
    if path.suffix not in ENDINGS:
        raise BadInput(f"{path}: unknown ending; allowed: {', '.join(ENDINGS)}, or a folder of tables")
    if path.suffix == ".mcap" and config.mapping:
        return _joined(path, config, foreign.read(path, _wanted(path, config)), repair)
    if path.suffix == ".mcap":
        return read_ours(path, repair)
    if config.mapping:
        return _mapped_table(path, config, repair)
    table = Table(path)
    return assemble(str(path), table.names, table.column, repair)


def _is_folder(path: Path) -> bool:
    with reported(path, BadInput, "cannot be read"):
        try:
            return S_ISDIR(path.stat().st_mode)
        except FileNotFoundError:
            raise BadInput(f"{path}: no such file") from None


def _wanted(path: Path, config: VoteConfig) -> dict[str, set[str]]:
    """Return the fields of each source that the mapping names, the source of the rows first."""
    if not config.mapping:
        raise BadInput(f"{path}: a folder: CONFIG needs a [mapping] of columns to its files")
    wanted: dict[str, set[str]] = {}
    for column, place in config.mapping.items():
        source, colon, field = place.rpartition(":")
        if not (source and colon and field):
            raise BadInput(f"[mapping] {column}: must be '<source>:<field>', got {place!r}")
        wanted.setdefault(source, set()).add(field)
    return wanted


def _mapped_table(path: Path, config: VoteConfig, repair: bool) -> Recording:
    table = Table(path, {config.time_column, *config.mapping.values()}.__contains__)
    renamed = {TIME: config.time_column, **config.mapping}
    for name in renamed.values():
        _must_have(path, table, name)
    return assemble(str(path), renamed, lambda name: table.column(renamed[name]), repair)


def _must_have(path: Path, table: Table, name: str) -> None:
    if name not in table.names:
        raise BadInput(f"{path}: no column {name!r}, which CONFIG names")


def _folder(path: Path, wanted: Mapping[str, set[str]], time_column: str) -> dict[str, Source]:
    sources: dict[str, Source] = {}
    for name, fields in wanted.items():
        file = path / name
        if file.suffix not in TABLES:
            raise BadInput(f"{file}: a source in a folder is one of {', '.join(TABLES)}")
        table = Table(file, {time_column, *fields}.__contains__)
        for needed in (time_column, *sorted(fields)):
            _must_have(file, table, needed)
        sources[name] = Source(table.column(time_column), {field: table.column(field) for field in fields})
    return sources


def _joined(path: Path, config: VoteConfig, sources: Mapping[str, Source], repair: bool) -> Recording:
    """Return the columns of the mapping on the rows of the first source."""
    clocks = {name: clock(f"{path}: {name}", source.time_s, repair) for name, source in sources.items()}
    first = next(iter(clocks.values()))
    nearest = {name: nearest_rows(first.time_s, own.time_s) for name, own in clocks.items()}

    def column(name: str) -> Floats:
        if name == TIME:
            return first.time_s
        source, _, field = config.mapping[name].rpartition(":")
        rows, near = nearest[source]
        return np.where(near, clocks[source].of(sources[source].fields[field])[rows], np.nan)

    repairs = tuple(own.repair for own in clocks.values() if own.repair is not None)
    return replace(assemble(str(path), [TIME, *config.mapping], column), kept=first.kept, repairs=repairs)


def nearest_rows(time_s: Floats, own_s: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """For each of ``time_s`` the row of ``own_s`` (rising) nearest to it, and whether it is near enough."""
    after = np.clip(np.searchsorted(own_s, time_s), 1, max(len(own_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(own_s) - 1)
    rows = np.where(time_s - own_s[before] <= own_s[after] - time_s, before, after)
    interval = float(np.median(np.diff(own_s))) if len(own_s) > 1 else 0.0
    return rows, np.abs(own_s[rows] - time_s) <= interval
