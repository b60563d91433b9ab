"""States as strips against time: one entity per strip, one entry per change.

    /pitch_rate                           the channels of a signal together
    /pitch_rate/channel_1 .. channel_4    each of them; and pattern, decided_by, source
    /gear_down/channel_1 .. channel_4     of a discrete
    /control_law
    /fault_1 ..                           while a fault of the scenario acts

The viewer writes the path of a strip above it, so people read these paths; it would write a space as "\\ ".
The strips of a flight that ends before the picture show the reason of the loss, or the end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import (
    CHANNELS,
    DISCRETES,
    SIGNALS,
    Block,
    DecidedBy,
    Discrete,
    End,
    Law,
    Pattern,
    RowPart,
    Signal,
    Source,
    State,
    Table,
)
from rig.core.frame.fields import FIELD
from rig.log.schema import Topic
from rig.show.viewer.style import ACTING, ALL_FAILED, ENDED, OVER, STATE_LOOKS, SUSPECT, Color, Looks, attention, plain

# A channel is suspect for a few frames, with room for one letter.
_SHORT_LOOKS: Final[Looks] = {**STATE_LOOKS, "SUSPECT": ("?", SUSPECT)}


class Strip(NamedTuple):
    """One strip: its path in the viewer, its field of FRAME, its states by their codes, their looks."""

    path: str
    field: str
    at: tuple[int, ...]
    states: dict[int, str]
    looks: Looks


class Changes(NamedTuple):
    """States of a strip: (n,) rows of the block, and their names; empty: the strip is blank from there on."""

    path: str
    rows: NDArray[np.intp]
    states: list[str]


def _strip(path: str, field: str, at: tuple[int, ...], looks: Looks) -> Strip:
    return Strip(path, field, at, {int(member): member.name for member in FIELD[field].enum or ()}, looks)


def _channels(home: str, field: str, index: int, channels: int) -> list[Strip]:
    return [_strip(f"{home}/channel_{c + 1}", field, (index, c), _SHORT_LOOKS) for c in range(channels)]


def of_signal(signal: Signal) -> list[Strip]:
    """Return the strips of one signal: its channels, its pattern, the deciding rule, the source of the control law."""
    s, home = SIGNALS.index(signal), f"/{signal.name}"
    return [
        *_channels(home, "state", s, signal.channels),
        _strip(f"{home}/pattern", "pattern", (s,), attention(Pattern, Pattern.NORMAL)),
        _strip(f"{home}/decided_by", "decided_by", (s,), attention(DecidedBy, DecidedBy.NONE)),
        _strip(f"{home}/source", "source", (s,), attention(Source, Source.VOTED)),
    ]


def of_discrete(discrete: Discrete) -> list[Strip]:
    """Return the strips of one discrete: its channels."""
    return _channels(f"/{discrete.name}", "discrete_state", DISCRETES.index(discrete), discrete.channels)


def status(signal: Signal) -> Strip:
    """Return the strip of all channels of one signal together."""
    s = SIGNALS.index(signal)
    return Strip(f"/{signal.name}", "state", (s,), dict(enumerate(_together())), _together())


@cache
def _together() -> Looks:
    """Return label and colour of four states together, in the order of their code in base four."""
    looks: Looks = {}
    for states in product(State, repeat=CHANNELS):
        looks["".join(str(int(state)) for state in states)] = _label_of(states)
    return looks


def _label_of(states: Sequence[State]) -> tuple[str, tuple[int, int, int]]:
    """Return the numbers of the channels that are not ok, and the colour of the worst of them."""
    fitted = [state for state in states if state != State.ABSENT]
    texts = []
    for state in (State.FAILED, State.SUSPECT):
        which = [str(c + 1) for c, each in enumerate(states) if each == state]
        if which:
            all_of = len(which) == len(fitted)
            texts.append(f"{'all' if all_of else 'channel ' + ', '.join(which)} {state.name.lower()}")
    worst = max(fitted, default=State.OK)
    color = ALL_FAILED if fitted and min(fitted) == State.FAILED else STATE_LOOKS[worst.name][1]
    return "; ".join(texts) or "ok", color


LAW: Final = _strip("/control_law", "law", (), attention(Law, Law.AUTOPILOT))
STRIPS: Final = tuple(
    strip for strips in (*map(of_signal, SIGNALS), *map(of_discrete, DISCRETES), [LAW]) for strip in strips
)
STATUS: Final = tuple(map(status, SIGNALS))
_BY_FIELD: Final = {
    field: [strip for strip in STRIPS if strip.field == field] for field in {each.field: 0 for each in STRIPS}
}
ENDS: Final[Looks] = {
    **{end.name: (f"lost: {end.cause}", ENDED) for end in End if end != End.FLYING},
    OVER: ("flight over", ENDED),
}


def title(signal: Signal) -> str:
    """Return the title of the strips of a signal."""
    return f"{plain(signal.name)}: faults, channels (?: suspect), pattern, decided by, source"


def fault_path(number: int) -> str:
    """Return the path of fault ``number`` of a scenario, which counts from 0; the screen counts from 1."""
    return f"/fault_{number + 1}"


def acting(rows: Block, faults: int) -> NDArray[np.uint8]:
    """Return (n, faults) 1 where each of the first ``faults`` faults acts, 0 where it does not."""
    return np.unpackbits(rows["acting"], axis=1, count=faults, bitorder="little")


def codes(states: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return four states each as one number: (n, S, 4) to (n, S)."""
    a, b, c, d = np.moveaxis(states, 2, 0)
    return a << 6 | b << 4 | c << 2 | d


def changes(rows: Block, before: Block | None, faults: Sequence[Any]) -> Iterator[Changes]:
    """Yield the changes in ``rows`` of any strip, after the row ``before`` (1,); None: all strips begin here."""
    for field, strips in _BY_FIELD.items():
        values, last = rows[field], None if before is None else before[field]
        if last is not None and (values == last).all():
            continue  # nearly always, and at once for all its strips
        for strip in strips:
            place = (slice(None), *strip.at)
            yield from changed(strip.path, strip.states, values[place], None if last is None else last[place])
        if field == "state":
            together, before_them = codes(values), None if last is None else codes(last)
            for s, strip in enumerate(STATUS):
                last_of = None if before_them is None else before_them[:, s]
                yield from changed(strip.path, strip.states, together[:, s], last_of)
    acts, last_acts = acting(rows, len(faults)), None if before is None else acting(before, len(faults))
    for i in range(len(faults)):
        last = np.zeros(1, np.uint8) if last_acts is None else last_acts[:, i]
        yield from changed(fault_path(i), {0: "", 1: ACTING}, acts[:, i], last)


def changed(path: str, states: dict[int, str], values: NDArray[Any], last: NDArray[Any] | None) -> Iterator[Changes]:
    """Yield the changes in ``values`` (n,) of one strip after ``last`` (1,), if there are any."""
    where = moved(values, last)
    if len(where):
        yield Changes(path, where, [states.get(int(value), "?") for value in values[where]])


def ends(how: str, faults: Sequence[Any]) -> Iterator[tuple[str, str]]:
    """Yield the last state of every strip of a flight that ends before the picture; ``how`` of ENDS."""
    yield from ((strip.path, how) for strip in (*STRIPS, *STATUS))
    yield from ((fault_path(i), "") for i in range(len(faults)))


def moved(values: NDArray[Any], last: NDArray[Any] | None) -> NDArray[np.intp]:
    """Return the rows with a changed value; without ``last`` (1,) the first row counts as changed."""
    first = True if last is None else bool((values[0] != last[0]).any())
    differs = (values[1:] != values[:-1]).any(axis=tuple(range(1, values.ndim)))
    return np.flatnonzero(np.concatenate([[first], differs]))


class Entity(NamedTuple):
    """The data of an entity in every row: one list of numbers, and the message of the log if it is sent too."""

    path: str
    archetype: str  # of the list
    values: NDArray[np.float64]  # (n, m)
    topic: Topic | None = None


class Beside(NamedTuple):
    """A part of the second row, and the functions that draw it."""

    part: RowPart
    legend: str  # entity
    legend_lines: Sequence[tuple[str, Color]]
    strips: Sequence[Strip]
    codes: Callable[[Table, Strip], NDArray[Any]]  # the state of a strip in each row
    entities: Callable[[Table], Iterator[Entity]]

    def changes(self, rows: Table, before: Table | None) -> Iterator[Changes]:
        """Yield the changes in ``rows`` of any strip, after the row ``before`` (1,); None: all strips begin here."""
        for strip in self.strips:
            last = None if before is None else self.codes(before, strip)
            yield from changed(strip.path, strip.states, self.codes(rows, strip), last)
