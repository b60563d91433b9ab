"""Times of several recorders: from a field of their messages, unrolled, and with a span in common."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.text import choices, quoted
from rig.core.units.conversion import conversion
from rig.log.foreign import Source
from rig.log.publishers import publishers
from rig.log.recordings.bursts import GAP, bursts, spread
from rig.log.recordings.formats.contents import LogContents, Topic
from rig.log.recordings.rollover import unrolled
from rig.log.recordings.stamps import Clock, Floats, span

ROS2: Final = "ROS 2"
STAMP: Final = "header.stamp"  # the time of ROS 2 messages that have one
_MOST_WITHOUT: Final = 0.5  # of the messages: if more have no stamp, none is used


class MessageTimes(NamedTuple):
    """Where the times of messages are: ``field`` of each topic, or in ``of`` by topic, numbers in ``unit``."""

    field: str = ""  # "": the log time
    of: Mapping[str, str] = {}
    unit: str = "s"

    def __call__(self, source: str) -> str:
        """Return the field of a source; "": the log time."""
        return self.of.get(source, self.field)

    @property
    def given(self) -> bool:
        """Return True if a field is named for any source."""
        return bool(self.field or self.of)


def with_fields(wanted: Mapping[str, set[str]], times: MessageTimes) -> dict[str, set[str]]:
    """Return the fields to read of each source, those of the time too."""
    refuse_unknown(wanted, times.of)
    return {name: fields | ({times(name)} - {""}) for name, fields in wanted.items()}


def refuse_unknown(sources: Collection[str], times: Mapping[str, str]) -> None:
    """Raise BadInput if ``[times]`` names a source that the mapping does not."""
    for name in times:
        if name not in sources:
            raise BadInput(f"[times] {quoted(name)}: not a source of [mapping]; {choices(name, sources)}")


def by_fields(path: Path, sources: Mapping[str, Source], times: MessageTimes, remarks: list[str]) -> dict[str, Source]:
    """Return the sources at the times of their fields; what is told of them is added to ``remarks``.

    BadInput: ``times`` names a source that there is not, two publishers of one source.
    """
    made: dict[str, Source] = {}
    for name, source in sources.items():
        where = f"{path}: {name}"
        of = _by_field(where, source, times(name), times.unit, remarks) if times(name) else source
        if len(of.time_s) and (both := publishers(np.sort(of.time_s))) and not _copies(of):
            raise BadInput(f"{where}: {both} on one topic, which cannot be told apart")
        made[name] = of
    return made


def log_field(where: str, contents: LogContents, topic: Topic, field: str) -> set[str]:
    """Return the field of a topic of a log that has its time, if it is not that of the format anyway.

    BadInput: the topic has no such field.
    """
    if not field or (contents.format == ROS2 and field == STAMP):
        return set()
    if field not in topic.units:
        known = [*topic.units, *([STAMP] if contents.format == ROS2 else [])]
        raise BadInput(f"{where}: time: no field {quoted(field)}; {choices(field, known)}")
    return {field}


def by_log_fields(
    path: Path, sources: Mapping[str, Source], times: MessageTimes, remarks: list[str]
) -> dict[str, Source]:
    """Return the sources of a log at the times of their fields, without roll-overs; as ``by_fields``."""
    made: dict[str, Source] = {}
    for name, source in sources.items():
        where = f"{path}: {name}"
        if times(name) in source.fields:
            made[name] = _by_field(where, source, times(name), times.unit, remarks)
        else:
            time_s, told = unrolled(where, source.time_s)
            remarks += told
            made[name] = source._replace(time_s=time_s)
    return made


def _copies(source: Source) -> bool:
    """Return True if messages of one time are copies, or a recorder has no times at all."""
    order = np.argsort(source.time_s, kind="stable")
    again = np.diff(source.time_s[order]) == 0
    if again.mean() <= 0.01:
        return False
    if again.all():
        return True
    columns = [values[order] for values in source.fields.values()]
    same = np.all([(v[1:] == v[:-1]) | (np.isnan(v[1:]) & np.isnan(v[:-1])) for v in columns], axis=0)
    return bool(same[again].all())


def _by_field(where: str, source: Source, field: str, unit: str, remarks: list[str]) -> Source:
    stamps = source.fields[field]
    without = ~np.isfinite(stamps) | ((stamps == 0) & ~_counts_on(stamps))
    if without.mean() >= _MOST_WITHOUT:
        remarks.append(f"{where}: {field} is 0 or missing: the time of the log is used")
        return source
    fields = source.fields
    if without.any():
        stamps, fields = stamps[~without], {name: values[~without] for name, values in fields.items()}
        remarks.append(f"{where}: {int(without.sum())} messages without {field} were left out")
    factor = conversion(unit, "s").factor
    time_s, told = unrolled(where, stamps * factor, factor, unit)
    remarks += told
    return Source(time_s, fields)


def _counts_on(stamps: Floats) -> NDArray[np.bool_]:
    """Return (n,) True for a stamp of 0 that the next one follows: a clock that begins there, no missing stamp."""
    steps = np.diff(stamps)
    forward = steps[steps > 0]
    follows = np.zeros(len(stamps), bool)
    if len(forward):
        follows[:-1] = (stamps[:-1] == 0) & (steps > 0) & (steps <= GAP * np.median(forward))
    return follows


def refuse_apart(path: Path, clocks: Mapping[str, Clock]) -> None:
    """Raise BadInput if a recorder has no time in common with the first one, within a usual step."""
    (first, rows), *others = clocks.items()
    for name, own in others:
        slack_s = usual_step_s(own.time_s)
        if own.time_s[0] - slack_s > rows.time_s[-1] or own.time_s[-1] + slack_s < rows.time_s[0]:
            spans = ", ".join(
                f"{n} {span(float(c.time_s[0]), float(c.time_s[-1]))}" for n, c in ((first, rows), (name, own))
            )
            raise BadInput(f"{path}: the sources have no time in common: {spans}")


def nearest_rows(
    time_s: Floats, own_s: Floats, slack_s: float | None = None
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return for each of ``time_s`` the nearest row of ``own_s`` (rising), and True if it is near enough.

    slack_s : how near that is; None: the usual step of ``own_s``
    """
    after = np.clip(np.searchsorted(own_s, time_s), 1, max(len(own_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(own_s) - 1)
    rows = np.where(time_s - own_s[before] <= own_s[after] - time_s, before, after)
    return rows, np.abs(own_s[rows] - time_s) <= (usual_step_s(own_s) if slack_s is None else slack_s)


def sampled_s(time_s: Floats) -> Floats:
    """Return the times (n,) at which samples were taken: rows of a burst are spread over the time since the last."""
    of = bursts(time_s)
    return time_s if of is None else spread(time_s, of)


def usual_step_s(time_s: Floats) -> float:
    """Return the median step of rising times, s, or the longest usual one of bursts; 0 of one row."""
    if len(time_s) < 2:
        return 0.0
    of = bursts(time_s)
    return float(np.median(np.diff(time_s))) if of is None else of.longest_s
