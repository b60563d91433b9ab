"""INPUT of ``rig vote``: a CSV, Parquet or MCAP file, a log of another system, or a folder of tables with a mapping.

    the rig's columns or log     read as they are
    [mapping] in CONFIG          "<column>" = "<source>:<field>"; the source is a topic of a log, or
                                 a file in the folder INPUT; a single table needs no source: "<field>"
    log of another system        formats/; a preset writes its mapping

Signals are read in the unit that CONFIG gives them and converted to SI (``load``).

Each source has its own times, those of the log or of a field of its messages (source_times.py), which are unrolled
(rollover.py) and checked or repaired (stamps.py).  The rows are those of the first source that the mapping names; of
another, each row takes the sample nearest in time, or none when the nearest is more than its usual step away.
Topics of a log of another system are averaged and interpolated (join.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from stat import S_ISDIR
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.files import reported
from rig.core.text import choices, quoted, shorten
from rig.core.units.conversion import conversion
from rig.log import foreign
from rig.log.foreign import Source
from rig.log.recordings.channel_samples import calibrated
from rig.log.recordings.columns_file import TABLES, Table
from rig.log.recordings.csv_file import TableFormat
from rig.log.recordings.doubts import out_of_range
from rig.log.recordings.formats.contents import OpenLog
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.join import joined, shortened, whole
from rig.log.recordings.mapped import Place, fields_of, places
from rig.log.recordings.own_logs import read_ours
from rig.log.recordings.recording import Recording, assemble, with_discretes
from rig.log.recordings.rollover import unrolled
from rig.log.recordings.source_times import (
    by_fields,
    by_log_fields,
    log_field,
    nearest_rows,
    refuse_apart,
    refuse_unknown,
    sampled_s,
    usual_step_s,
    with_fields,
)
from rig.log.recordings.stamps import TIME, Floats, clock, gaps, strange_rate
from rig.log.recordings.unit_row import stated
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig

ENDINGS: Final = (*TABLES, ".mcap")


def load(
    path: Path, config: VoteConfig, source: str, repair: bool = False, log: OpenLog | None = None
) -> tuple[Recording, dict[str, RecordedSignal]]:
    """Return the recording at ``path`` and the settings of its signals, both in SI units, with what is doubtful told.

    source : of ``config``, named in errors; log : the log at ``path`` if it is open already
    BadInput in one line: as ``read``, settings that do not fit the recording, every channel of a signal out of a
    default range.
    """
    recording = read(path, config, repair, log)
    given = stated(str(path), recording.units, config)
    recording, config = replace(recording, remarks=(*recording.remarks, *given.remarks)), config.with_units(given.units)
    settings = config.signals(recording.signals, source)
    if not recording.in_si:
        converted = {
            name: recording.signals[name].times(chosen.scale) for name, chosen in settings.items() if chosen.scale != 1
        }
        recording = replace(recording, signals={**recording.signals, **converted})
    recording = calibrated(recording, settings, config, source)
    warnings = out_of_range(str(path), recording, settings)
    return replace(recording, warnings=(*recording.warnings, *warnings)), settings


def read(path: Path, config: VoteConfig, repair: bool = False, log: OpenLog | None = None) -> Recording:
    """Return the recording at ``path``, with ``repair`` without rows whose time repeats or is out of order.

    BadInput in one line when it cannot be used.
    """
    return with_discretes(str(path), _read(path, config, repair, log), config.discrete)


def _read(path: Path, config: VoteConfig, repair: bool, log: OpenLog | None) -> Recording:
    folder = _is_folder(path)
    if (log := log or open_log(path)) is not None and not _is_elsewhere(path, log, config):
        return _of_log(path, log, config, repair)
    if config.time or (config.times and not folder and path.suffix != ".mcap"):
        _refuse_message_times(path, config, folder)
    if folder:
        named = _places(path, config, lambda name: _is_file(path / name))
        sources, remarks, units = _folder(path, fields_of(named), config.tables, config.times)
        stated_of = {column: unit for column, place in named.items() if (unit := units.get(place))}
        return replace(_joined(path, config, named, sources, remarks, repair), units=stated_of)
    if path.suffix not in ENDINGS:
        raise BadInput(f"{path}: unknown ending; allowed: {', '.join(ENDINGS)}, or a folder of tables")
    if path.suffix == ".mcap":
        _refuse_tables(path, config)
    if path.suffix == ".mcap" and config.mapping:
        return _messages(path, config, repair)
    return read_ours(path, repair) if path.suffix == ".mcap" else _table(path, config, repair)


def _refuse_message_times(path: Path, config: VoteConfig, folder: bool) -> None:
    """Raise BadInput if CONFIG names a field of messages and INPUT has none."""
    if folder or path.suffix in TABLES:
        key = "time" if config.time else "times"
        raise BadInput(f"{path}: {key}: names a field of messages; the column of tables is time_column")
    if path.suffix == ".mcap" and not config.mapping:
        raise BadInput(f"{path}: time: needs a [mapping] of messages")


def _refuse_tables(path: Path, config: VoteConfig) -> None:
    """Raise BadInput for settings of tables, which messages do not have."""
    usual = TableFormat(config.time_column)
    allowed = [usual, usual._replace(time_unit=config.time_unit if config.message_times.given else "s")]
    if config.tables not in allowed:
        raise BadInput(
            f"{path}: time_unit, separator and decimal are those of tables; messages have their log time, "
            'or that of a field: time = "header.stamp"'
        )


def _messages(path: Path, config: VoteConfig, repair: bool) -> Recording:
    """Return the columns of the mapping in messages that are protobuf or JSON."""
    times, remarks, damage = config.message_times, list[str](), list[str]()
    topics = foreign.topics(path, lenient=True)
    named = _places(path, config, lambda name: name in topics or name.rpartition("#")[0] in topics)
    found = foreign.read(path, with_fields(fields_of(named), times), damage)
    made = _joined(path, config, named, by_fields(path, found, times, remarks), remarks, repair, times.given)
    return replace(made, warnings=(*(f"{path}: {line}" for line in damage), *made.warnings))


def _is_elsewhere(path: Path, log: OpenLog, config: VoteConfig) -> bool:
    """Return True if the mapping names topics of an MCAP file that are not of ROS 2."""
    if path.suffix != ".mcap" or not config.mapping:
        return False
    topics, own = foreign.topics(path, lenient=True), {topic.name for topic in log.contents.topics}
    wanted = fields_of(_places(path, config, lambda name: name in topics or name in own)).keys()
    return wanted.isdisjoint(own) and wanted <= topics.keys()


def _is_folder(path: Path) -> bool:
    with reported(path, BadInput, "cannot be read"):
        try:
            return S_ISDIR(path.stat().st_mode)
        except FileNotFoundError:
            raise BadInput(f"{path}: no such file") from None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _of_log(path: Path, log: OpenLog, config: VoteConfig, repair: bool) -> Recording:
    """Return the columns of the mapping in a log of another system, on the rows of one of its topics."""
    contents, sources, times = log.contents, dict[str, Source](), config.message_times
    if not config.mapping:
        raise BadInput(f"{path}: a {contents.format} log: CONFIG needs a [mapping]; rig vote --write makes one")
    names = {topic.name for topic in contents.topics}
    named = _places(path, config, names.__contains__)
    refuse_unknown(wanted := fields_of(named), times.of)
    for name, fields in wanted.items():
        topic = contents.named(path, name)
        for field in sorted(fields - set(topic.units)):
            raise BadInput(f"{path}: topic {name!r} has no field {quoted(field)}; {choices(field, topic.units)}")
        read = log.source(topic, fields | log_field(f"{path}: {name}", contents, topic, times(name)))
        sources[name] = whole(f"{path}: {name}", read)
    sources = by_log_fields(path, sources, times, told := list[str]())
    clocks = {name: clock(f"{path}: {name}", source.time_s, repair, times.given) for name, source in sources.items()}
    signals: dict[str, list[str]] = {}
    for channel, place in named.items():
        signals.setdefault(channel.rpartition(".")[0].removesuffix(".ilm"), []).append(place.source)
    rows, taken = joined(str(path), sources, clocks, signals)

    def column(name: str) -> Floats:
        if name == TIME:
            return rows.time_s
        return taken(*named[name])

    repairs = tuple(own.repair for own in clocks.values() if own.repair is not None)
    warnings = [line for own in clocks.values() for line in gaps(own.source, own.time_s)]
    warnings += shortened(str(path), rows, clocks)
    made = assemble(str(path), [TIME, *config.mapping], column, voting=config.voting(path))
    remarks = (*(f"{path}: {line}" for line in (f"{contents.format} log", *contents.remarks)), *told)
    damage = tuple(f"{path}: {line}" for line in contents.damage)
    return replace(made, kept=rows.kept, repairs=repairs, remarks=remarks, warnings=(*damage, *warnings))


def _places(path: Path, config: VoteConfig, is_source: Callable[[str], bool]) -> dict[str, Place]:
    """Return the place of each column that the mapping names."""
    if not config.mapping:
        raise BadInput(f"{path}: a folder: CONFIG needs a [mapping] of columns to its files")
    return places(config.mapping, is_source)


def _table(path: Path, config: VoteConfig, repair: bool) -> Recording:
    """Return the recording in one table, by the mapping if there is one."""
    mapping, time = config.mapping, config.time_column
    table = Table(path, {time, *mapping.values()}.__contains__ if mapping else lambda _: True, config.tables)
    names = mapping or {name: name for name in table.names if name != time}
    for name in (*([time] if mapping or time != TIME else []), *mapping.values()):
        _must_have(path, table, name)
    if time not in table.names:
        return assemble(str(path), names, table.column)  # which refuses it
    time_s, _, told = _unrolled(table)

    def column(name: str) -> Floats:
        return time_s if name == TIME else table.column(names[name])

    made = assemble(str(path), [TIME, *names], column, repair, config.voting(path))
    units = {name: unit for name in names if (unit := table.units.get(names[name]))}
    remarks, warnings = (*table.remarks, *told), (*made.warnings, *strange_rate(str(path), made.time_s))
    return replace(made, remarks=remarks, warnings=warnings, units=units)


def _unrolled(table: Table, zero_ns: int | None = None) -> tuple[Floats, int | None, list[str]]:
    """Return the times of a table without roll-overs and their zero, as ``Table.time_s``, and what is told of them."""
    time_s, zero_ns = table.time_s(zero_ns)
    unit = "s" if zero_ns is not None else table.time_unit
    time_s, told = unrolled(str(table.path), time_s, conversion(unit, "s").factor, unit, (zero_ns or 0) / 1e9)
    return time_s, zero_ns, told


def _must_have(path: Path, table: Table, name: str) -> None:
    if name not in table.names:
        there = shorten(", ".join(table.header))
        raise BadInput(f"{path}: no column {name!r}, which CONFIG names (time_column, [mapping]); there are: {there}")


def _folder(
    path: Path, wanted: Mapping[str, set[str]], written: TableFormat, times: Mapping[str, str]
) -> tuple[dict[str, Source], list[str], dict[Place, str]]:
    """Return the sources in a folder, with time since the first row of the first, what is told, and rows of units.

    times : columns of time, by source, of those that are not called as in ``written``
    """
    sources: dict[str, Source] = {}
    units: dict[Place, str] = {}
    remarks: list[str] = []
    refuse_unknown(wanted, times)
    zero = None
    for name, fields in wanted.items():
        time = times.get(name, written.time_column)
        file = path / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise BadInput(f"[mapping] {name}: must be a file in the folder {path}")
        if file.suffix not in TABLES:
            raise BadInput(f"{file}: a source in a folder is one of {', '.join(TABLES)}")
        table = Table(file, {time, *fields}.__contains__, written._replace(time_column=time))
        for needed in (time, *sorted(fields)):
            _must_have(file, table, needed)
        time_s, own_zero, told = _unrolled(table, zero)
        if sources and (zero is None) != (own_zero is None):
            raise BadInput(f"{file}: {time} is a time of the calendar in one source and a number in another")
        zero = own_zero
        sources[name] = Source(time_s, {field: table.column(field) for field in fields})
        remarks += [*table.remarks, *told]
        units |= {Place(name, field): unit for field, unit in table.units.items()}
    return sources, remarks, units


def _joined(
    path: Path,
    config: VoteConfig,
    named: Mapping[str, Place],
    sources: Mapping[str, Source],
    remarks: list[str],
    repair: bool,
    unit: bool = True,
) -> Recording:
    """Return the columns of the mapping on the rows of the first source; unit : CONFIG may give that of time."""
    clocks = {name: clock(f"{path}: {name}", source.time_s, repair, unit) for name, source in sources.items()}
    first = next(iter(clocks.values()))
    refuse_apart(path, clocks)
    at_s = {name: sampled_s(own.time_s) for name, own in clocks.items()}
    first_s = next(iter(at_s.values()))
    nearest = {name: nearest_rows(first_s, own_s, usual_step_s(clocks[name].time_s)) for name, own_s in at_s.items()}

    def column(name: str) -> Floats:
        if name == TIME:
            return first.time_s
        source, field = named[name]
        rows, near = nearest[source]
        return np.where(near, clocks[source].of(sources[source].fields[field])[rows], np.nan)

    repairs = tuple(own.repair for own in clocks.values() if own.repair is not None)
    warnings = [line for own in clocks.values() for line in gaps(own.source, own.time_s)]
    warnings += strange_rate(first.source, first.time_s, unit)
    made = assemble(str(path), [TIME, *named], column, voting=config.voting(path))
    return replace(made, kept=first.kept, repairs=repairs, remarks=tuple(remarks), warnings=tuple(warnings))
