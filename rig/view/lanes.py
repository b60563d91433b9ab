"""States as lanes against time: one entity a lane, one entry a change.

    /lane/<signal>/ch_1 .. ch_4, pattern, resolver, source
    /lane/<discrete>/ch_1 .. ch_4
    /lane/control/law
    /fault/<number>                       while fault <number> of the scenario acts

The viewer writes a lane's entity above it, so these paths are read by people.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.frame import DISCRETES, SIGNALS, Block, Discrete, Law, Pattern, Resolver, Signal, Source
from rig.frame.fields import FIELD
from rig.view.style import ACTING, STATE_LOOKS, Looks, attention


class Lane(NamedTuple):
    """One lane: where the viewer finds it, what it shows of FRAME, how its states look."""

    path: str
    field: str
    at: tuple[int, ...]
    looks: Looks


class Changes(NamedTuple):
    """States that a lane takes: (n,) rows of the block, and their names; None: the lane ends there."""

    path: str
    rows: NDArray[np.intp]
    states: list[Any]  # str or None


def of_signal(signal: Signal) -> list[Lane]:
    """The lanes of one signal: its channels, its pattern, who resolved it, where control takes it from."""
    s, home = SIGNALS.index(signal), f"/lane/{signal.name}"
    return [
        *(Lane(f"{home}/ch_{c + 1}", "state", (s, c), STATE_LOOKS) for c in range(signal.channels)),
        Lane(f"{home}/pattern", "pattern", (s,), attention(Pattern, Pattern.NORMAL)),
        Lane(f"{home}/resolver", "resolver", (s,), attention(Resolver, Resolver.NONE)),
        Lane(f"{home}/source", "source", (s,), attention(Source, Source.VOTED)),
    ]


def of_discrete(discrete: Discrete) -> list[Lane]:
    """The lanes of one discrete: its channels."""
    d = DISCRETES.index(discrete)
    return [
        Lane(f"/lane/{discrete.name}/ch_{c + 1}", "discrete_state", (d, c), STATE_LOOKS)
        for c in range(discrete.channels)
    ]


LAW: Final = Lane("/lane/control/law", "law", (), attention(Law, Law.AUTOPILOT))
LANES: Final = tuple(
    lane for lanes in (*map(of_signal, SIGNALS), *map(of_discrete, DISCRETES), [LAW]) for lane in lanes
)


def fault_path(number: int) -> str:
    """The lane of fault ``number`` of a scenario, which counts from 0 as everywhere but on the screen."""
    return f"/fault/{number + 1}"


def acting(rows: Block, faults: int) -> NDArray[np.uint8]:
    """Whether each of the first ``faults`` faults acts in each row: (n, faults), 0 or 1."""
    return np.unpackbits(rows["acting"], axis=1, count=faults, bitorder="little")


def changes(rows: Block, before: Block | None, faults: Sequence[Any]) -> Iterator[Changes]:
    """What changes in ``rows`` on any lane, after the row ``before`` (1,); None: all lanes begin here."""
    for lane in LANES:
        values = rows[lane.field][(slice(None), *lane.at)]
        last = None if before is None else before[lane.field][(slice(None), *lane.at)]
        where = _where(values, last)
        if len(where):
            known = {int(member): member.name for member in FIELD[lane.field].enum or ()}
            yield Changes(lane.path, where, [known.get(int(v)) for v in values[where]])
    acts, last_acts = acting(rows, len(faults)), None if before is None else acting(before, len(faults))
    for i in range(len(faults)):
        where = _where(acts[:, i], np.zeros(1, np.uint8) if last_acts is None else last_acts[:, i])
        if len(where):
            yield Changes(fault_path(i), where, [ACTING if value else None for value in acts[where, i]])


def _where(values: NDArray[Any], last: NDArray[Any] | None) -> NDArray[np.intp]:
    """The rows whose value is not the one before; with no ``last`` (1,) the first row is such a one."""
    moved = np.empty(len(values), bool)
    moved[0] = last is None or values[0] != last[0]
    np.not_equal(values[1:], values[:-1], out=moved[1:])
    return np.flatnonzero(moved)
