"""Events of several computers: lanes and links that failed, by which test, and why the back-up flies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.event import Event, Severity
from rig.core.frame import COMPUTERS, Health, LaneTest, LinkState, Table, stacked
from rig.core.units.quantities import duration

FAILED, DISENGAGED, RESTARTING = "lane failed", "lane disengaged", "lane restarting"  # names of events
READMITTED, REFUSED, LEADING = "lane readmitted", "lane not readmitted", "leading lane"
BACKUP, LINK_FAILED, LINK_BACK = "back-up engaged", "link failed", "link back"
NONE_ENGAGED, BY_COMMAND, UNRESOLVED = "no lane is engaged", "by command", "the vote of commands is unresolved"
ENGAGED: Final = (Health.ENGAGED, Health.SUSPECT)
BY_OTHERS: Final = (LaneTest.COMMANDS, LaneTest.LINK, LaneTest.CLOCK)
_NAMES: Final = {
    LaneTest.COMMANDS: "vote of commands",
    LaneTest.LINK: "link",
    LaneTest.CLOCK: "clock",
    LaneTest.WRAP_AROUND: "wrap-around",
    LaneTest.REFERENCE_VOLTAGE: "reference voltage",
    LaneTest.CHECKSUM: "checksum",
    LaneTest.WATCHDOG: "watchdog",
}


class Order(NamedTuple):
    """A command of the pilot to a lane, or for the back-up, which is none."""

    frame: int
    do: str  # readmit, disengage, backup
    lane: int | None


class LaneFailure(NamedTuple):
    """A lane that failed its own test, or that others voted out."""

    frame: int
    lane: int
    test: LaneTest
    accusers: tuple[int, ...]  # lanes; none: a test of its own


class LinkFailure(NamedTuple):
    """A link from one lane to another on which no valid message has arrived for too long."""

    frame: int
    sender: int
    receiver: int


def test_name(test: int) -> str:
    """Return the name of the test that a lane failed."""
    return _NAMES[LaneTest(test)]


def lane_names(lanes: Sequence[int]) -> str:
    """Return lanes as people list them: ``lanes A, C and D``."""
    *most, last = (COMPUTERS[lane] for lane in lanes)
    return f"lanes {', '.join(most)} and {last}" if most else f"lane {last}"


def failed_by(failure: LaneFailure) -> str:
    """Return what failed a lane: ``by its own watchdog``, ``by lanes A, C and D for its clock``."""
    what = test_name(failure.test)
    if not failure.accusers:
        return f"by its own {what} test" if failure.test != LaneTest.WATCHDOG else f"by its own {what}"
    if failure.test == LaneTest.COMMANDS:
        return f"by {lane_names(failure.accusers)} in the {what}"
    return f"by {lane_names(failure.accusers)} for its {what}"


def is_engaged(table: Table) -> NDArray[np.bool_]:
    """Return (n, 4): lanes that drive their servo channels."""
    return np.isin(table.lane["health"], ENGAGED)


class ComputerFinder:
    """Finds the events of a flight's lanes, block after block.

    orders : the pilot's;  places : the lanes that each fault of the scenario sits on, none of one elsewhere
    """

    def __init__(self, rate_hz: float, orders: Sequence[Order] = (), places: Sequence[tuple[int, ...]] = ()) -> None:
        self._rate_hz, self._orders, self._places = rate_hz, orders, places
        self._acted: dict[int, int] = {}  # first frame in which a fault acted on a lane
        self._last: Table | None = None
        self.failures: list[LaneFailure] = []
        self.links: list[LinkFailure] = []
        self.backup: tuple[int, str] | None = None  # frame, and why
        self.leading: list[tuple[int, int]] = []  # frame, and the lane that leads from it on
        self.readmitted: list[tuple[int, int]] = []  # frame and lane
        # By receiver and sender: the first frame of each block in which others told another word than came directly.
        self.outvoted: dict[tuple[int, int], list[int]] = {}

    def find(self, table: Table) -> list[Event]:
        """Return the events of frames, which follow those of the last call, in order of time."""
        if table.lane is None or not len(table):
            return []
        before, self._last = _before_the_first(table) if self._last is None else self._last, table[-1:].copy()
        both = stacked([Table(each.rows[["frame"]], each.beside) for each in (before, table)])  # all fields: 0.1 ms
        self._note_onsets(table)
        outvoted = table.lane["outvoted"] != 0
        for i, j in zip(*np.nonzero(outvoted.any(axis=0)), strict=True):
            self.outvoted.setdefault((int(i), int(j)), []).append(int(table["frame"][outvoted[:, i, j].argmax()]))
        found = [*self._healths(both), *self._refused(both), *self._leads(both), *self._links(both)]
        return sorted(found, key=lambda event: event.frame)

    @property
    def seen(self) -> bool:
        """Return whether there were rows of lanes."""
        return self._last is not None

    def failed_at(self) -> dict[str, float]:
        """Return the lanes that failed, and when first, s."""
        first: dict[str, float] = {}
        for failure in self.failures:
            first.setdefault(COMPUTERS[failure.lane], failure.frame / self._rate_hz)
        return first

    def _note_onsets(self, rows: Table) -> None:
        """Note when faults first acted on each lane."""
        if not any(self._places):
            return
        acting = np.unpackbits(rows["acting"], axis=1, count=len(self._places), bitorder="little")
        for places, acts in zip(self._places, acting.T, strict=True):
            if places and acts.any():
                for lane in places:
                    self._acted.setdefault(lane, int(rows["frame"][acts.argmax()]))

    def _healths(self, both: Table) -> Iterator[Event]:
        for k, i in _news(both.lane["health"]):
            old, new = (Health(int(both.lane["health"][row, i])) for row in (k, k + 1))
            frame, name = int(both["frame"][k + 1]), COMPUTERS[i]
            if new == Health.FAILED:
                yield self._failed(both, k, i)
            elif new == Health.OFF:
                yield Event(frame, "warning", DISENGAGED, f"{name}: by command")
            elif new == Health.RESTARTING:
                yield Event(frame, "info", RESTARTING, f"{name}: running again, not engaged")
            elif new in ENGAGED and old not in ENGAGED:
                self.readmitted.append((frame, i))
                yield Event(frame, "info", READMITTED, f"{name}: by command")

    def _failed(self, both: Table, k: int, i: int) -> Event:
        """Note the failure of lane ``i`` in the row behind ``k``; those who accused it did so in row ``k``."""
        frame, test = int(both["frame"][k + 1]), LaneTest(int(both.lane["failed_for"][k + 1, i]))
        accusers = np.flatnonzero(both.lane["accuses"][k, :, i]) if test in BY_OTHERS else ()
        failure = LaneFailure(frame, i, test, tuple(map(int, accusers)))
        self.failures.append(failure)
        onset = self._acted.get(i, frame + 1)
        after = f", {duration(frame - onset, self._rate_hz)} after the onset of its fault" if onset <= frame else ""
        return Event(frame, "error", FAILED, f"{COMPUTERS[i]}: {failed_by(failure)}{after}")

    def _refused(self, both: Table) -> Iterator[Event]:
        """Yield commands that readmitted no lane: it was not engaged in the row before, and is not."""
        engaged, first = is_engaged(both), int(both["frame"][1])
        for frame, do, lane in self._orders:
            k = frame - first
            if lane is None or do != "readmit" or not 0 <= k < len(both) - 1:
                continue
            if not engaged[k : k + 2, lane].any():
                text = f"{COMPUTERS[lane]}: it has not agreed with the leading lane for long enough"
                yield Event(frame, "warning", REFUSED, text)

    def _leads(self, both: Table) -> Iterator[Event]:
        leads = both.lane["leads"]
        leading = np.where(leads.any(axis=1), leads.argmax(axis=1), -1)
        for (k,) in _news(leading):
            frame, old, new = int(both["frame"][k + 1]), int(leading[k]), int(leading[k + 1])
            if new >= 0:
                self.leading.append((frame, new))
                yield Event(frame, "warning", LEADING, f"{COMPUTERS[new]}: leads instead of {COMPUTERS[old]}")
                continue
            self.backup = frame, self._why(both[k + 1 : k + 2])
            yield Event(frame, "error", BACKUP, self.backup[1])

    def _why(self, row: Table) -> str:
        """Return why the back-up flies from ``row`` (1,) on."""
        if any(order.do == "backup" and order.frame == row["frame"][0] for order in self._orders):
            return BY_COMMAND
        return UNRESOLVED if is_engaged(row).any() else NONE_ENGAGED

    def _links(self, both: Table) -> Iterator[Event]:
        """Yield an event for the links of a sender that fail, or come back, in one frame."""
        failed = both.lane["link"] == LinkState.FAILED
        found = sorted((k, j, bool(failed[k + 1, i, j]), i) for k, i, j in _news(failed))
        fitted = int((both.lane["health"][-1] != Health.ABSENT).sum())
        for (k, j, lost), group in groupby(found, key=lambda each: each[:3]):
            receivers, frame = [i for *_, i in group], int(both["frame"][k + 1])
            self.links += [LinkFailure(frame, j, i) for i in receivers] if lost else []
            to = "all others" if len(receivers) == fitted - 1 else lane_names(receivers)
            level: Severity = "error" if lost else "info"
            yield Event(frame, level, LINK_FAILED if lost else LINK_BACK, f"{COMPUTERS[j]}: to {to}")


def _before_the_first(table: Table) -> Table:
    """Return the row before a flight: as its first one, but every lane that is fitted is engaged, and A leads."""
    before = table[:1].copy()
    computer: Any = before.lane
    computer["health"] = np.where(computer["health"] == Health.ABSENT, Health.ABSENT, Health.ENGAGED)
    computer["accuses"], computer["leads"] = LaneTest.NONE, 0
    computer["leads"][:, 0] = 1
    computer["link"][computer["link"] == LinkState.FAILED] = LinkState.MISSING
    return before


def _news(values: NDArray[Any]) -> list[tuple[int, ...]]:
    """Return the places of the row before where the next row of ``values`` is another."""
    return [tuple(map(int, place)) for place in np.argwhere(values[1:] != values[:-1])]
