"""OUTPUT of ``rig vote``: one table, or an MCAP file with the messages of a flight's log.

Written beside and renamed: OUTPUT is there only when it is whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from rig.errors import BadInput, RigError
from rig.files import replaced
from rig.frame import CHANNELS, Ilm, Pattern, Resolver, State
from rig.log.signals import write_signals
from rig.recorded.clock import TIME
from rig.recorded.record import Bytes, Recording
from rig.recorded.vote import Voted

STATES: Final = ("ok", "suspect", "failed")
PATTERNS: Final = tuple(pattern.label for pattern in Pattern)
RESOLVERS: Final = tuple(resolver.name.lower() for resolver in Resolver)


@contextmanager
def output(path: Path, recorded: Path | None = None) -> Iterator[Path]:
    """A file beside ``path`` to write to, which becomes ``path`` at the end, or nothing when that is not reached.

    BadInput before anything is done: an unknown ending, a folder that is not there or not writable, the input itself.
    RigError when it cannot be renamed.
    """
    if path.suffix not in WRITERS:
        raise BadInput(f"{path}: unknown ending; allowed: {', '.join(WRITERS)}")
    with replaced(path) as part:
        if recorded is not None and path.exists() and recorded.exists() and path.samefile(recorded):
            raise BadInput(f"{path}: is the input")
        yield part


def write(part: Path, path: Path, recording: Recording, voted: dict[str, Voted]) -> None:
    """Write ``voted`` to ``part``, the draft of ``path``, as its ending says. RigError: the disk."""
    try:
        WRITERS[path.suffix](part, recording, voted)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise RigError(f"{path}: cannot be written: {' '.join(str(error).split())[:200]}") from None


def table(recording: Recording, voted: dict[str, Voted]) -> pl.DataFrame:
    """The columns of OUTPUT, ``time_s`` first."""
    columns: dict[str, Any] = {TIME: recording.time_s}
    for name, signal in voted.items():
        columns[f"{name}.voted"] = signal.voted
        columns[f"{name}.level"] = signal.level
        columns[f"{name}.pattern"] = _named(signal.pattern, PATTERNS)
        columns[f"{name}.resolver"] = _named(signal.resolver, RESOLVERS)
        for c, state in enumerate(signal.state, 1):
            columns[f"{name}.state.{c}"] = _named(state, STATES)
        columns[f"{name}.trend.high"] = signal.trend_high
        columns[f"{name}.trend.low"] = signal.trend_low
    return pl.DataFrame(columns)


def _named(codes: Bytes, names: tuple[str, ...]) -> pl.Series:
    return pl.Series(codes).cat.to(pl.Enum(names))


def _csv(path: Path, recording: Recording, voted: dict[str, Voted]) -> None:
    table(recording, voted).write_csv(path)


def _parquet(path: Path, recording: Recording, voted: dict[str, Voted]) -> None:
    table(recording, voted).write_parquet(path)


def _mcap(path: Path, recording: Recording, voted: dict[str, Voted]) -> None:
    if recording.time_s[0] < 0:
        raise BadInput(f"time begins at {recording.time_s[0]:g} s: an MCAP file has no time before 0")
    times = np.rint(recording.time_s * 1e9).astype(np.uint64)
    same = np.flatnonzero(times[1:] == times[:-1])
    if len(same):
        rows = f"rows {recording.row(same[0])} and {recording.row(same[0] + 1)}"
        raise BadInput(f"{rows}: the same nanosecond, the unit of time in an MCAP file")
    signals = {name: _fields(recording, name, signal) for name, signal in voted.items()}
    write_signals(path, times, signals, {"rate_hz": repr(recording.rate_hz)})


def _fields(recording: Recording, name: str, signal: Voted) -> dict[str, Any]:
    """Fields of the frame, for the log; what only a flight has is left out."""
    samples = recording.signals[name]
    n = len(recording.time_s)
    valid = samples.valid or [np.isfinite(column).astype(np.uint8) for column in samples.channels]

    def filled(columns: list[Bytes], code: IntEnum) -> list[Bytes]:
        return columns + [np.full(n, code, np.uint8)] * (CHANNELS - len(columns))

    fields: dict[str, Any] = {
        "channels": samples.channels,
        "valid": valid,
        "ilm": filled(samples.ilm or [], Ilm.ABSENT),
        "state": filled(signal.state, State.ABSENT),
        "voted": signal.voted,
        "level": signal.level,
        "pattern": signal.pattern,
        "resolver": signal.resolver,
        "trend_high": signal.trend_high,
        "trend_low": signal.trend_low,
        "reference_usable": signal.reference_usable,
    }
    return fields if samples.reference is None else {**fields, "reference": samples.reference}


WRITERS: Final[dict[str, Callable[[Path, Recording, dict[str, Voted]], None]]] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".mcap": _mcap,
}
