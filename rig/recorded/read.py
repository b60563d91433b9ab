"""INPUT of ``rig vote``: a CSV, Parquet or MCAP file, or a folder of tables with a mapping.

    our columns or our log       read as they are
    [mapping] in CONFIG          "<column of ours>" = "<source>:<field>"; the source is a topic of an MCAP file, or
                                 a file in the folder INPUT; a single table needs no source: "<field>"

Sources have times of their own.  The rows are those of the first source that the mapping names; of another,
each row takes the sample nearest in time, or none when the nearest is more than its sampling interval away.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput, BadLog
from rig.frame import CHANNELS, SIGNALS, State
from rig.log import foreign, read_log
from rig.log.foreign import Source
from rig.recorded.config import VoteConfig
from rig.recorded.record import TIME, Floats, Recording, Samples, assemble, check_time
from rig.recorded.table import TABLES, Table

ENDINGS: Final = (*TABLES, ".mcap")


def read(path: Path, config: VoteConfig) -> Recording:
    """The recording at ``path``; BadInput in one line when it cannot be used."""
    if not path.exists():
        raise BadInput(f"{path}: no such file")
    if path.is_dir():
        wanted = _wanted(path, config)
        return _joined(path, config, _folder(path, wanted, config.time_column))
    if path.suffix not in ENDINGS:
        raise BadInput(f"{path}: unknown ending; allowed: {', '.join(ENDINGS)}, or a folder of tables")
    if path.suffix == ".mcap":
        return _joined(path, config, foreign.read(path, _wanted(path, config))) if config.mapping else _ours(path)
    if config.mapping:
        return _mapped_table(path, config)
    table = Table(path)
    return assemble(str(path), table.names, table.column)


def _ours(path: Path) -> Recording:
    """A log of a flight, or the output of an earlier vote."""
    try:
        topics = foreign.topics(path)
    except BadLog:
        read_log(path)  # says more, if it is a log of a flight that was cut
        raise
    if "/flight" in topics:
        return _flown(path)
    ours = [topic for topic, schema in topics.items() if schema == "rig.Signal"]
    if not ours:
        raise BadInput(f"{path}: not a log of this rig: CONFIG needs a [mapping] of its topics: {', '.join(topics)}")
    return _voted(path, ours)


def _flown(path: Path) -> Recording:
    log = read_log(path)
    rows = log.rows
    if len(rows) == 0:
        raise BadInput(f"{path}: no rows")
    recorded: dict[str, Samples] = {}
    for i, signal in enumerate(SIGNALS):
        fitted = range(int((rows["state"][0, i] != State.ABSENT).sum()))
        recorded[signal.name] = Samples(
            [rows["channels"][:, i, c].copy() for c in fitted],
            [rows["ilm"][:, i, c].copy() for c in fitted],
            rows["reference"][:, i].copy(),
            [rows["valid"][:, i, c].copy() for c in fitted],
        )
    return Recording(rows["frame"] / log.rate_hz, recorded)


def _voted(path: Path, topics: list[str]) -> Recording:
    per_channel = [f"{kind}_{c}" for kind in ("ch", "valid", "ilm", "st") for c in range(1, CHANNELS + 1)]
    sources = foreign.read(path, {topic: {*per_channel, "reference"} for topic in topics})
    recorded: dict[str, Samples] = {}
    for topic, (_, fields) in sources.items():
        fitted = [c for c in range(1, CHANNELS + 1) if fields[f"st_{c}"][0] != State.ABSENT]
        recorded[topic.removeprefix("/signal/")] = Samples(
            [fields[f"ch_{c}"] for c in fitted],
            [fields[f"ilm_{c}"].astype(np.uint8) for c in fitted],
            fields["reference"],
            [fields[f"valid_{c}"].astype(np.uint8) for c in fitted],
        )
    return Recording(sources[topics[0]].time_s, recorded)


def _wanted(path: Path, config: VoteConfig) -> dict[str, set[str]]:
    """The fields of each source that the mapping names, the source of the rows first."""
    if not config.mapping:
        raise BadInput(f"{path}: a folder: CONFIG needs a [mapping] of columns to its files")
    wanted: dict[str, set[str]] = {}
    for column, place in config.mapping.items():
        source, colon, field = place.rpartition(":")
        if not (source and colon and field):
            raise BadInput(f"[mapping] {column}: must be '<source>:<field>', got {place!r}")
        wanted.setdefault(source, set()).add(field)
    return wanted


def _mapped_table(path: Path, config: VoteConfig) -> Recording:
    table = Table(path, {config.time_column, *config.mapping.values()}.__contains__)
    renamed = {TIME: config.time_column, **config.mapping}
    for name in renamed.values():
        _must_have(path, table, name)
    return assemble(str(path), renamed, lambda name: table.column(renamed[name]))


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


def _joined(path: Path, config: VoteConfig, sources: Mapping[str, Source]) -> Recording:
    """The columns of the mapping on the rows of the first source."""
    for name, source in sources.items():
        check_time(f"{path}: {name}", source.time_s)
    time_s = next(iter(sources.values())).time_s
    nearest = {name: nearest_rows(time_s, source.time_s) for name, source in sources.items()}

    def column(name: str) -> Floats:
        if name == TIME:
            return time_s
        source, _, field = config.mapping[name].rpartition(":")
        rows, near = nearest[source]
        return np.where(near, sources[source].fields[field][rows], np.nan)

    return assemble(str(path), [TIME, *config.mapping], column)


def nearest_rows(time_s: Floats, own_s: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """For each of ``time_s`` the row of ``own_s`` (rising) nearest to it, and whether it is near enough."""
    after = np.clip(np.searchsorted(own_s, time_s), 1, max(len(own_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(own_s) - 1)
    rows = np.where(time_s - own_s[before] <= own_s[after] - time_s, before, after)
    interval = float(np.median(np.diff(own_s))) if len(own_s) > 1 else 0.0
    return rows, np.abs(own_s[rows] - time_s) <= interval
