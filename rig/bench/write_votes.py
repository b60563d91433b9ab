"""OUTPUT of ``rig vote``: one table, in the units of CONFIG, or an MCAP file as a flight's log, in SI units.

A draft is renamed to OUTPUT, which therefore exists only if it is complete.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import polars as pl
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.parquet import write_table

from rig.bench.rows_of_recording import FIELDS
from rig.bench.vote_rows import Result, Voted, VotedDiscrete
from rig.core.blocks import HELD, room
from rig.core.errors import BadInput, RigError
from rig.core.files import replaced
from rig.core.frame import CHANNELS, DecidedBy, Ilm, Pattern, State
from rig.core.outputs import require_apart
from rig.log.export import parquet_with_units, write_units
from rig.log.recordings.columns_file import TABLES
from rig.log.recordings.recording import Bytes, Recording
from rig.log.recordings.stamps import TIME
from rig.log.signal_messages import write_topics

ENDINGS: Final = (*TABLES, ".mcap")
STATES: Final = ("ok", "suspect", "failed")
PATTERNS: Final = tuple(pattern.label for pattern in Pattern)
TIE_BREAKS: Final = tuple(decided_by.name.lower() for decided_by in DecidedBy)
Column = tuple[NDArray[Any], tuple[str, ...]]  # of a table: (n,) values; if these are codes, their names


@contextmanager
def output(path: Path, inputs: Iterable[Path | str | None] = ()) -> Iterator[Path]:
    """Yield a draft beside ``path``, which becomes ``path`` at the end of a successful block.

    BadInput before any work: an unknown ending, a folder that is missing or not writable, an input.
    RigError: it cannot be renamed.
    """
    if path.suffix not in ENDINGS:
        raise BadInput(f"{path}: must end in one of {', '.join(ENDINGS)}")
    require_apart({"--out": path}, inputs)
    with replaced(path) as part:
        yield part


def write(part: Path, path: Path, recording: Recording, voted: Result) -> None:
    """Write ``voted`` to ``part``, the draft of ``path``, in the format of its ending. RigError: the disk."""
    try:
        if path.suffix == ".mcap":
            _mcap(part, recording, voted)
        else:
            with part.open("wb") as file:
                _table(file, path.suffix, _columns(recording, voted), units(voted))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise RigError(f"{path}: cannot be written: {' '.join(str(error).split())[:200]}") from None


def write_units_beside(path: Path, voted: Result) -> None:
    """Write the units of OUTPUT beside it, if its format has no place for them."""
    if path.suffix in TABLES:
        write_units(path, units(voted))


def units(voted: Result) -> dict[str, str]:
    """Return the unit of each column of OUTPUT that has a known one."""
    known = {name: signal.settings.unit or signal.settings.si for name, signal in voted.signals.items()}
    return {TIME: "s", **{f"{name}.voted": unit for name, unit in known.items() if unit}}


def _table(file: IO[bytes], ending: str, votes: dict[str, Column], known: dict[str, str]) -> None:
    if ending == ".csv":
        for first in range(0, len(votes[TIME][0]), HELD):
            part = {name: (values[first : first + HELD], names) for name, (values, names) in votes.items()}
            _frame(part).write_csv(file, include_header=first == 0)
    else:
        write_table(parquet_with_units(_arrow(votes), known), file, compression="zstd")


def table(recording: Recording, voted: Result) -> pl.DataFrame:
    """Return the columns of OUTPUT, ``time_s`` first; votes in the unit of the signal."""
    return _frame(_columns(recording, voted))


def _frame(columns: dict[str, Column]) -> pl.DataFrame:
    return pl.DataFrame(
        {
            name: pl.Series(values).cat.to(pl.Enum(names)) if names else pl.Series(values)
            for name, (values, names) in columns.items()
        }
    )


def _arrow(columns: dict[str, Column]) -> pa.Table:
    """Return the table for Arrow, without a copy of its columns."""
    schema = _frame({name: (values[:0], names) for name, (values, names) in columns.items()}).to_arrow().schema
    arrays = [
        pa.DictionaryArray.from_arrays(pa.array(values), pa.array(names, pa.large_string()), ordered=True)
        if names
        else pa.array(values)
        for values, names in columns.values()
    ]
    return pa.table(arrays, schema)


def _columns(recording: Recording, voted: Result) -> dict[str, Column]:
    columns: dict[str, Column] = {TIME: (recording.time_s, ())}
    for name, signal in voted.signals.items():
        shown = room(signal.voted.shape)
        shown[:] = signal.settings.shown(signal.voted)
        columns[f"{name}.voted"] = shown, ()
        columns[f"{name}.level"] = signal.level, ()
        columns[f"{name}.pattern"] = signal.pattern, PATTERNS
        columns[f"{name}.decided_by"] = signal.decided_by, TIE_BREAKS
        columns |= {f"{name}.state.{c}": (state, STATES) for c, state in enumerate(signal.state, 1)}
        columns[f"{name}.trend.high"] = signal.trend_high, ()
        columns[f"{name}.trend.low"] = signal.trend_low, ()
        others = recording.signals[name].others
        columns |= {f"{name}.not_voted.{c}": (signal.settings.shown(x), ()) for c, x in others.items()}
    for name, discrete in voted.discretes.items():
        columns[f"{name}.voted"] = discrete.voted, ()
        columns[f"{name}.level"] = discrete.level, ()
        columns |= {f"{name}.state.{c}": (state, STATES) for c, state in enumerate(discrete.state, 1)}
    return columns


def _mcap(path: Path, recording: Recording, voted: Result) -> None:
    if recording.time_s[0] < 0:
        raise BadInput(f"time begins at {recording.time_s[0]:g} s, but an MCAP file has no time before 0")
    times = np.rint(recording.time_s * 1e9).astype(np.uint64)
    same = np.flatnonzero(times[1:] == times[:-1])
    if len(same):
        rows = f"rows {recording.row(same[0])} and {recording.row(same[0] + 1)}"
        raise BadInput(f"{rows} have the same nanosecond, the unit of time in an MCAP file")
    signals = {name: _fields(recording, name, signal) for name, signal in voted.signals.items()}
    discretes = {name: _discrete_fields(recording, name, discrete) for name, discrete in voted.discretes.items()}
    topics = {
        **{f"/signal/{name}": ("rig.Signal", columns) for name, columns in signals.items()},
        **{f"/discrete/{name}": ("rig.Discrete", columns) for name, columns in discretes.items()},
    }
    # Of a flight's log: the fields that are not named are not the flight's, and not compared with it.
    write_topics(path, times, topics, {"rate_hz": repr(recording.rate_hz)}, name_fields=voted.of_flight)


def _fields(recording: Recording, name: str, signal: Voted) -> dict[str, Any]:
    """Yield fields of the frame for the log, without those that only a flight has."""
    samples = recording.signals[name]
    fields: dict[str, Any] = {
        "channels": samples.channels,
        "valid": samples.valid or [np.isfinite(column).astype(np.uint8) for column in samples.channels],
        "ilm": _filled(recording, samples.ilm or [], Ilm.ABSENT),
        "state": _filled(recording, signal.state, State.ABSENT),
        **{name: getattr(signal, name) for name in FIELDS},
    }
    fields |= signal.of_flight
    if signal.of_flight and samples.second_reference is not None:
        fields["second_reference"] = samples.second_reference
    return fields if samples.reference is None else {**fields, "reference": samples.reference}


def _discrete_fields(recording: Recording, name: str, discrete: VotedDiscrete) -> dict[str, Any]:
    """Yield fields of the frame for the log; an empty sample is an invalid 0."""
    samples = recording.discretes[name]
    usable = [np.isfinite(column) for column in samples.channels]
    if samples.valid:
        usable = [finite & (flag != 0) for finite, flag in zip(usable, samples.valid, strict=True)]
    return {
        "discrete_channels": [(column == 1).astype(np.uint8) for column in samples.channels],
        "discrete_valid": [flag.astype(np.uint8) for flag in usable],
        "discrete_ilm": _filled(recording, samples.ilm or [], Ilm.ABSENT),
        "discrete_state": _filled(recording, discrete.state, State.ABSENT),
        "discrete_voted": discrete.voted,
        "discrete_level": discrete.level,
        **({} if discrete.reset is None else {"discrete_reset": discrete.reset}),
    }


def _filled(recording: Recording, columns: list[Bytes], code: IntEnum) -> list[Bytes]:
    return columns + [np.full(len(recording.time_s), code, np.uint8)] * (CHANNELS - len(columns))
