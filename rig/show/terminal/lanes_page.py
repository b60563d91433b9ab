"""Several computers on the page: health of the lanes and who leads, links by their senders, votes of commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from rich.console import RenderableType
from rich.text import Text

from rig.core.frame import COMPUTERS, LINKS, SURFACES, Health, LinkState, Pattern, Resolver, State
from rig.core.units.quantities import scale_shown, unit_of_name, unit_shown
from rig.flight.lane_events import test_name
from rig.show.terminal import cells

_NOBODY: Final = -1
_MOST_LINKS: Final = 2  # that are named
_STATES: Final = {  # of a lane as that of a channel
    Health.ABSENT: State.ABSENT,
    Health.ENGAGED: State.OK,
    Health.SUSPECT: State.SUSPECT,
    Health.FAILED: State.FAILED,
    Health.RESTARTING: State.FAILED,
    Health.OFF: State.FAILED,
}
_NOTES: Final = {Health.RESTARTING: "restarting", Health.OFF: "off by command"}


def computer_rows(lanes: Any) -> Iterator[list[RenderableType]]:
    """Yield the cells of the rows of several computers; lanes : (4,) COMPUTER."""
    leads = int(lanes["leads"].argmax()) if lanes["leads"].any() else _NOBODY
    states = [_STATES[Health(health)] for health in lanes["health"]]
    yield [
        cells.name("computers"),
        "",
        *(cells.channel(name, state, str) for name, state in zip(COMPUTERS, states, strict=True)),
        Text(COMPUTERS[leads]) if leads != _NOBODY else Text("none", style="bold red"),
        _engaged(states),
        Text("") if leads != _NOBODY else Text("back-up", style="bold red"),
        Text("; ".join(_whys(lanes)), style="yellow"),
    ]
    yield _links(lanes)
    for s, name in enumerate(SURFACES):
        yield _command(name, lanes, s, states, leads)


def _engaged(states: list[State]) -> Text:
    out, absent = states.count(State.FAILED), states.count(State.ABSENT)
    return cells.level(len(states) - absent - out, len(states) - absent)


def _whys(lanes: Any) -> Iterator[str]:
    """Yield the lanes that are out, and for what."""
    for name, lane in zip(COMPUTERS, lanes, strict=True):
        health = Health(lane["health"])
        if health == Health.FAILED:
            yield f"{name} {test_name(lane['failed_for'])}"
        elif health in _NOTES:
            yield f"{name} {_NOTES[health]}"


def _links(lanes: Any) -> list[RenderableType]:
    """Return how many of the others have each lane's message in this frame, and the links that have not."""
    links = lanes["link"]
    fitted = int((lanes["health"] != Health.ABSENT).sum())
    good = (links == LinkState.FRESH).sum(axis=0)
    states = [
        State.ABSENT if j >= fitted else State.FAILED if (links[:, j] == LinkState.FAILED).any()
        else State.OK if good[j] == fitted - 1 else State.SUSPECT
        for j in range(len(COMPUTERS))
    ]  # fmt: skip
    failed = [
        f"{COMPUTERS[sender]} to {COMPUTERS[receiver]} {LinkState(links[receiver, sender]).name.lower()}"
        for sender, receiver in LINKS
        if links[receiver, sender] > LinkState.FRESH
    ]
    more = f" and {len(failed) - _MOST_LINKS} more" if len(failed) > _MOST_LINKS else ""
    return [
        cells.name("messages, to others"),
        "",
        *(cells.channel(count, state, str) for count, state in zip(good, states, strict=True)),
        "",
        "",
        "",
        Text(", ".join(failed[:_MOST_LINKS]) + more, style="yellow"),
    ]


def _command(name: str, lanes: Any, s: int, states: list[State], leads: int) -> list[RenderableType]:
    """Return what each lane commands of a surface, and what the leading one puts out after its vote."""
    unit, whose = unit_of_name(name), lanes[max(leads, 0)]
    pattern, resolver = Pattern(whose["command_pattern"][s]), Resolver(whose["command_resolver"][s])
    scale, each = scale_shown(unit), zip(lanes, states, strict=True)
    quiet = pattern == Pattern.NORMAL or leads == _NOBODY
    return [
        cells.name(f"{name.removesuffix('_rad')} command"),
        unit_shown(unit),
        *(cells.channel(lane["surface"][s] * scale, state, cells.number) for lane, state in each),
        Text("" if leads == _NOBODY else cells.number(whose["output"][s] * scale)),
        _engaged(states),
        Text(pattern.label if leads != _NOBODY else "", style="dim" if quiet else "bold yellow"),
        Text(resolver.name.lower() if leads != _NOBODY and resolver != Resolver.NONE else "", style="yellow"),
    ]
