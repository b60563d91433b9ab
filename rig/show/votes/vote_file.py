"""The output of ``rig vote`` read back for a picture: the messages of an MCAP file, or a table.

A table has no channels.  No output has the thresholds: they are in the configuration of the vote.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.files import open_regular
from rig.core.frame import CHANNELS, INDEX, SIGNALS, DecidedBy, Pattern, State
from rig.core.text import quoted, shorten
from rig.core.units.quantities import scale_shown, unit_shown
from rig.log import foreign
from rig.log.export import UNITS
from rig.log.foreign import Source
from rig.log.recordings.columns_file import TABLES, Table
from rig.log.recordings.csv_file import arrow_file
from rig.log.recordings.stamps import TIME, clock
from rig.show.votes.shown_signal import Array, Codes, ShownSignal, around, since_first

OF_SIGNAL, OF_DISCRETE = "rig.Signal", "rig.Discrete"
VOTED: Final = ".voted"
_LARGEST_UNITS: Final = 1 << 20  # bytes
_STATES: Final = {state.name.lower(): int(state) for state in State}
_PATTERNS: Final = {pattern.label: int(pattern) for pattern in Pattern}
_RULES: Final = {rule.name.lower(): int(rule) for rule in DecidedBy}
_NUMBERS: Final = ("channels", "voted", "level", "pattern", "decided_by", "state")  # fields of FRAME


def read_votes(path: Path) -> list[ShownSignal]:
    """Return the signals of an output of ``rig vote``: .mcap, .csv or .parquet.

    BadInput or BadLog, one line: it is missing, cut, damaged, or no such output.
    """
    return _of_table(path) if path.suffix in TABLES else _of_messages(path)


def is_votes(path: Path) -> bool:
    """Return True for a table, and for an MCAP file with votes that is no log of a flight.  BadLog: it cannot be read.

    Any other file is read as the log of a flight, whose refusal has the reason.
    """
    if path.suffix in TABLES:
        return True
    if path.suffix != ".mcap":
        return False
    topics = foreign.topics(path)
    return "/flight" not in topics and not {OF_SIGNAL, OF_DISCRETE}.isdisjoint(topics.values())


def _of_messages(path: Path) -> list[ShownSignal]:
    present = {
        topic: (message, fields)
        for topic, (message, fields) in foreign.messages_of(path).items()
        if message in (OF_SIGNAL, OF_DISCRETE)
    }
    wanted = {topic: {name for name in fields if _is_wanted(name)} for topic, (_, fields) in present.items()}
    shown: list[ShownSignal] = []
    for topic, source in foreign.read(path, wanted).items():
        time_s = since_first(clock(f"{path}: {topic}", source.time_s).time_s)
        name = topic.removeprefix("/signal/").removeprefix("/discrete/")
        shown.append(_of_source(f"{path}: {topic}", name, time_s, source, present[topic][0] == OF_DISCRETE))
    return shown


def _is_wanted(name: str) -> bool:
    return name in _NUMBERS or name.startswith(("ch_", "st_"))


def _of_source(where: str, name: str, time_s: Array, source: Source, discrete: bool) -> ShownSignal:
    """Return one topic as a signal in the unit of display; of a name that the rig does not know in SI units."""
    fields, scale, unit, wraps = source.fields, 1.0, "", False
    if not discrete and name in INDEX:
        signal = SIGNALS[INDEX[name]]
        scale, unit, wraps = scale_shown(signal.unit), unit_shown(signal.unit), signal.wraps
    for needed in ("voted", "level", *(f"{kind}_{c + 1}" for kind in ("ch", "st") for c in range(CHANNELS))):
        if needed not in fields:
            raise BadInput(f"{where}: no field {needed!r}: no output of rig vote")
    states = [_codes(where, fields, f"st_{c + 1}", _STATES) for c in range(CHANNELS)]
    fitted = [c for c, state in enumerate(states) if len(state) and state[0] != State.ABSENT]
    voted, channels = around(fields["voted"], [fields[f"ch_{c + 1}"] for c in fitted], wraps)
    return ShownSignal(
        name,
        unit,
        time_s,
        [channel * scale for channel in channels],
        voted * scale,
        [states[c] for c in fitted],
        _codes(where, fields, "level", range(CHANNELS + 1)),
        _codes(where, fields, "pattern", _PATTERNS) if "pattern" in fields else None,
        _codes(where, fields, "decided_by", _RULES) if "decided_by" in fields else None,
        discrete=discrete,
    )


def _codes(where: str, fields: Mapping[str, Array], name: str, known: Mapping[str, int] | range) -> Codes:
    """Return a field as codes; BadInput: one is unknown."""
    values, codes = fields[name], list(known.values() if isinstance(known, Mapping) else known)
    wrong = np.flatnonzero(~np.isin(values, codes))
    if len(wrong):
        raise BadInput(f"{where}: row {wrong[0] + 1}: {name} is one of 0 to {max(codes)}, got {values[wrong[0]]:g}")
    return values.astype(np.uint8)


def _of_table(path: Path) -> list[ShownSignal]:
    header = Table(path, lambda _: False).header
    stems = [name.removesuffix(VOTED) for name in header if name.endswith(VOTED)]
    names = [stem for stem in stems if f"{stem}.level" in header]
    if TIME not in header or not names:
        there = shorten(", ".join(header))
        raise BadInput(f"{path}: no output of rig vote, which has {TIME} and NAME{VOTED}; there are: {there}")
    numbers = {TIME, *(f"{name}{end}" for name in names for end in (VOTED, ".level"))}
    words = [key for name in names for key in _word_columns(name, header)]
    table, said = Table(path, numbers.__contains__), _words(path, words)
    time_s = since_first(clock(str(path), table.column(TIME)).time_s)
    units = _units(path)
    return [_of_columns(path, name, time_s, table, said, units.get(f"{name}{VOTED}", "")) for name in names]


def _word_columns(name: str, header: Sequence[str]) -> Iterator[str]:
    """Yield the columns of words of a signal that the table has."""
    ends = (".pattern", ".decided_by", *(f".state.{c + 1}" for c in range(CHANNELS)))
    yield from (f"{name}{end}" for end in ends if f"{name}{end}" in header)


def _of_columns(path: Path, name: str, time_s: Array, table: Table, said: Mapping[str, Any], unit: str) -> ShownSignal:
    level = {"level": np.nan_to_num(table.column(f"{name}.level"), nan=-1.0)}
    of = [f"{name}.state.{c + 1}" for c in range(CHANNELS)]
    pattern, rule = f"{name}.pattern", f"{name}.decided_by"
    return ShownSignal(
        name,
        unit,
        time_s,
        [],
        table.column(f"{name}{VOTED}"),
        [_of_words(path, key, said[key], _STATES) for key in of if key in said],
        _codes(f"{path}: {name}", level, "level", range(CHANNELS + 1)),
        _of_words(path, pattern, said[pattern], _PATTERNS) if pattern in said else None,
        _of_words(path, rule, said[rule], _RULES) if rule in said else None,
        discrete=pattern not in said,
    )


def _words(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """Return columns of words as dictionaries of few words and (n,) places in them."""
    kind = pa.dictionary(pa.int32(), pa.string())
    try:
        if path.suffix == ".parquet":
            table = Table(path, set(names).__contains__)
            return {name: table.arrow(name).cast(kind) for name in names}
        how = pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names, kind), include_columns=list(names))
        with arrow_file(path) as file:
            read = pyarrow.csv.read_csv(file, convert_options=how)
        return {name: read.column(name) for name in names}
    except pa.ArrowException as error:
        raise BadInput(f"{path}: cannot be read: {' '.join(str(error).split())[:200]}") from None


def _of_words(path: Path, name: str, column: Any, known: Mapping[str, int]) -> Codes:
    """Return the code of each word of a column; BadInput: an unknown word."""
    return np.concatenate([_part(path, name, part, known) for part in column.chunks])


def _part(path: Path, name: str, part: Any, known: Mapping[str, int]) -> Codes:
    words: list[Any] = part.dictionary.to_pylist()
    places: NDArray[Any] = part.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    used = sorted({int(place) for place in np.unique(places)})
    strange = [None if place < 0 else words[place] for place in used if place < 0 or words[place] not in known]
    if strange:
        raise BadInput(f"{path}: column {name!r}: one of {', '.join(known)}, got {quoted(strange[0])}")
    return np.array([known.get(word, 0) for word in words], np.uint8)[places]


def _units(path: Path) -> dict[str, str]:
    """Return the units of the columns: in a Parquet file, beside a CSV file; none if there is no such file."""
    if path.suffix == ".parquet":
        with arrow_file(path) as file:
            schema = pyarrow.parquet.read_schema(file)
        found = {field.name: (field.metadata or {}).get(b"unit", b"") for field in schema}
        return {name: unit.decode(errors="replace") for name, unit in found.items()}
    beside = path.with_name(f"{path.name}{UNITS}")
    if not beside.exists():
        return {}
    with open_regular(beside, _LARGEST_UNITS) as file:
        try:
            units = json.loads(file.read())
        except (ValueError, RecursionError):
            units = None
    if not isinstance(units, dict) or not all(isinstance(unit, str) for unit in units.values()):
        raise BadInput(f"{beside}: must be units by column, as rig vote writes them")
    return units
