"""Read a log back into the rows that were flown, and its columns by signal as arrays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from rig.core.blocks import cuts
from rig.core.errors import BadInput, BadLog
from rig.core.event import Event
from rig.core.frame import DISCRETE_INDEX, FLAT, INDEX, TIMING, Block, Table, links, second_rows
from rig.core.renamed import ATTRIBUTES, data_now, now_called
from rig.core.text import choices, quoted
from rig.log.scan import About, iter_parts

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, slots=True)
class SignalArrays:
    """One signal over a flight, in its unit; views of the rows, not copies. Enums are in ``rig.core.frame``."""

    time_s: NDArray[np.float64]  # (frames,) simulation time, s
    channels: NDArray[np.float64]  # (frames, 4) samples, NaN: not fitted
    voted: NDArray[np.float64]  # (frames,) voted value
    truth: NDArray[np.float64]  # (frames,) true value
    reference: NDArray[np.float64]  # (frames,) reference, NaN: there is none
    valid: NDArray[np.uint8]  # (frames, 4) 0: the sensor flags the sample
    ilm: NDArray[np.uint8]  # (frames, 4) in-line monitor, enum Ilm
    state: NDArray[np.uint8]  # (frames, 4) enum State
    level: NDArray[np.uint8]  # (frames,) channels in use
    pattern: NDArray[np.uint8]  # (frames,) enum Pattern
    decided_by: NDArray[np.uint8]  # (frames,) tie-break rule, enum DecidedBy
    reference_usable: NDArray[np.uint8]  # (frames,) 1: the reference may decide
    source: NDArray[np.uint8]  # (frames,) source of the control law's value, enum Source


@dataclass(frozen=True, slots=True)
class DiscreteArrays:
    """One discrete over a flight; views of the rows, not copies."""

    time_s: NDArray[np.float64]  # (frames,) simulation time, s
    channels: NDArray[np.uint8]  # (frames, 4) samples, 0: not fitted
    voted: NDArray[np.uint8]  # (frames,) voted value
    truth: NDArray[np.uint8]  # (frames,) true value
    valid: NDArray[np.uint8]  # (frames, 4) 0: the sensor flags the sample
    ilm: NDArray[np.uint8]  # (frames, 4) in-line monitor, enum Ilm
    state: NDArray[np.uint8]  # (frames, 4) enum State
    level: NDArray[np.uint8]  # (frames,) channels in use


class Parts(np.ndarray[Any, np.dtype[Any]]):
    """Second rows with ``link``, (n, 4, 4) of LINK: the messages of each computer at each other computer."""

    def __getitem__(self, key: Any) -> Any:
        """Return what any array has; ``link`` is made of the computers' records."""
        if not isinstance(key, str):
            return super().__getitem__(key)
        if key == "link" and "computer" in (self.dtype.names or ()):
            return links(self["computer"])
        return super().__getitem__(key).view(np.ndarray)


@dataclass(slots=True, repr=False)
class Log:
    """The log of a whole flight in memory."""

    rate_hz: float  # frames per second
    rows: Block  # (frames,) rows; ``rows["voted"]`` is (frames, 16). Fields: ``rig/core/frame/fields.py``
    timing: NDArray[Any]  # (frames,) wall clock: ``frame_us``, ``late_us``, ``reply_us``
    events: list[Event]  # events in order of time
    metadata: dict[str, str]  # scenario, seed, versions, commit
    result: dict[str, str] | None  # end of the flight; None: it has no regular end
    attachments: dict[str, bytes]  # attached files by name; the first is the scenario
    # (frames,) rows of servos, ``servo`` (3,), and of computers, ``computer`` (4,), ``link`` (4, 4) receiver by sender.
    parts: NDArray[Any] | None = None

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read the flight at ``path``, as ``rig.read_log``."""
        about = About()
        chunks = [(part.rows, part.timing, part.events, part.beside) for part in iter_parts(Path(path), about)]
        rows, timing = _joined([chunk[0] for chunk in chunks], FLAT), _joined([chunk[1] for chunk in chunks], TIMING)
        events = [event for chunk in chunks for event in chunk[2]]
        second = [chunk[3] for chunk in chunks if chunk[3] is not None]
        parts = _joined(second, second_rows(0, about.parts).dtype).view(Parts) if about.parts else None
        return cls(about.rate_hz, rows, timing, events, about.metadata, about.result, about.attachments, parts)

    if not TYPE_CHECKING:  # to which any name would be known

        def __getattr__(self, name: str) -> Any:
            """Raise AttributeError; of an old name its line is the present one."""
            if name in ATTRIBUTES:
                raise AttributeError(now_called(f"Log.{name}", f"Log.{ATTRIBUTES[name]}"))
            return object.__getattribute__(self, name)

    @property
    def scenario_text(self) -> str | None:
        """The attached scenario file; None: there is none."""
        first = next(iter(self.attachments.values()), None)
        return None if first is None else first.decode("utf-8")

    @property
    def table(self) -> Table:
        """All frames with the rows of servos and computers."""
        return Table(self.rows, self.parts, self.timing)

    @property
    def frames(self) -> int:
        """Frames flown."""
        return len(self.rows)

    def blocks(self) -> Iterator[Table]:
        """Yield all frames in blocks; views, not copies."""
        for part in cuts(self.frames):
            yield self.table[part]

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(frames,) simulation time, s."""
        return self.rows["frame"] / self.rate_hz

    def signal(self, name: str) -> SignalArrays:
        """Return the arrays of one signal; BadInput: unknown signal."""
        return SignalArrays(self.time_s, *self._columns(SignalArrays, "", _place(INDEX, name, "signal")))

    def discrete(self, name: str) -> DiscreteArrays:
        """Return the arrays of one discrete; BadInput: unknown discrete."""
        place = _place(DISCRETE_INDEX, name, "discrete")
        return DiscreteArrays(self.time_s, *self._columns(DiscreteArrays, "discrete_", place))

    def _columns(self, arrays: Any, prefix: str, place: int) -> list[NDArray[Any]]:
        """Return the fields of FRAME of the same names, in their order; time is not one of them."""
        return [self.rows[prefix + field.name][:, place] for field in fields(arrays)[1:]]

    def to_polars(self, *owners: str) -> pl.DataFrame:
        """Return a table with a row for each frame and the columns of ``rig export``; SI units, enums as words.

        owners : signals, discretes, topics (``control``, ``flight``), ``actuator.elevator``, ``computer.A``, ``ccdl``;
                 none given: all
        BadInput: an unknown owner.
        """
        from rig.log.columns import dataframe

        return dataframe(self.table, self.time_s, owners)


def _place(index: dict[str, int], name: str, kind: str) -> int:
    if name not in index:
        raise BadInput(f"unknown {kind} {quoted(name)}, {choices(name, index, 'rig signals')}")
    return index[name]


def read_log(path: Path | str) -> Log:
    """Read the flight at ``path``; BadLog, one line: the file is missing, cut, damaged or no log of the rig.

    A frame needs 2 kB of memory, and 4 kB while it is read; ``LogFile`` and ``iter_chunks`` read long logs.
    """
    return Log.read(path)


def scenario_of(metadata: Mapping[str, str], where: object) -> dict[str, Any]:
    """Return the scenario in a log's metadata as plain data, {} when there is none; BadLog, of ``where``: damaged."""
    try:
        scenario = json.loads(metadata.get("scenario") or "{}")
    except (ValueError, RecursionError):
        scenario = None
    if not isinstance(scenario, dict):
        raise BadLog(f"{where}: the scenario in its metadata is damaged")
    return data_now(scenario)


def unit_of(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return the log's data of the unit under test that flew it (settings.Unit.about); empty without one."""
    try:
        unit = json.loads(metadata.get("unit", "{}"))
    except (ValueError, RecursionError):
        unit = None
    return unit if isinstance(unit, dict) else {}


def _joined(parts: list[NDArray[Any]], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Concatenate the bytes: np.concatenate of structured arrays goes field by field and promises no padding."""
    joined = np.empty(sum(map(len, parts)), dtype)
    if parts:
        np.concatenate([part.view(np.uint8) for part in parts], out=joined.view(np.uint8))
    return joined


def iter_chunks(path: Path | str) -> Iterator[tuple[Block, NDArray[Any], list[Event]]]:
    """Yield rows, timing and events of each chunk, about a second: bounded memory.

    Damage is reported when it is reached, after the chunks before it have been given.
    """
    for part in iter_parts(Path(path), About()):
        yield part.rows, part.timing, part.events
