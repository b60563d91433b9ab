"""Several computers in the viewer: health, leading lane, votes of commands, links.

/computer/A ..         the list of NAMES: commands in deg, throttle as a share, frames of the clock
/lane_A ..             engaged in the colour of its channel; suspect; failed, with the reason
/leading_lane          the lane whose votes and commands are those of the frame; the back-up
/lane_A/reported_by .. the lanes that report it as faulty
/vote_elevator ..      the vote of the leading lane on the commands of all lanes
/A_to_B ..             the message of A at B: fresh, old, missing, failed; outvoted by the relays
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import COMPUTERS, LINKS, SURFACES, DecidedBy, Health, LaneTest, LinkState, Pattern, Table
from rig.core.units.quantities import scale_shown, unit_of_name
from rig.flight.lane_events import test_name
from rig.show.viewer.charts import spanned
from rig.show.viewer.state_strips import Beside, Entity, Strip
from rig.show.viewer.style import (
    ALL_FAILED,
    CHANNEL_COLORS,
    ENDED,
    FAILED,
    PALETTE,
    QUIET,
    REFERENCE,
    SUSPECT,
    VOTED,
    Looks,
    attention,
)

VALUES: Final = "rig.Lane"
CLOCK: Final = "clock_lead"
NAMES: Final = (*SURFACES, CLOCK)
LEGEND: Final = "/legend/computers"
LEGEND_LINES: Final = (
    *((f"lane {name}", color) for name, color in zip(COMPUTERS, CHANNEL_COLORS, strict=True)),
    ("output to the surface", VOTED),
    ("suspect", SUSPECT),
    ("failed", FAILED),
)
BACKUP: Final = len(COMPUTERS)
_SCALES: Final = [scale_shown(unit_of_name(name)) for name in SURFACES]
_TEST_BITS: Final = 4  # below the health: the test that failed the lane
_OUTVOTED: Final = 8  # above the state of a link
_UNRESOLVED: Final = 16  # above the pattern of a vote
_NOT_FITTED: Final = ("not fitted", ENDED)


def topic(lane: int) -> str:
    """Return the entity of a computer."""
    return f"/computer/{COMPUTERS[lane]}"


def _health(lane: int) -> Strip:
    """Return the states of the health of a computer; the name of a state includes the test that failed it."""
    looks: Looks = {
        "ABSENT": _NOT_FITTED,
        "ENGAGED": ("engaged", CHANNEL_COLORS[lane]),
        "SUSPECT": ("?", SUSPECT),
        "RESTARTING": ("runs again, not engaged", PALETTE[6]),
        "OFF": ("off by command", PALETTE[7]),
    }
    states = {health << _TEST_BITS | test: Health(health).name for health in Health for test in LaneTest}
    for test in LaneTest:
        if LaneTest.NONE < test < LaneTest.COMMANDED:
            name = f"FAILED_{test.name}"
            looks[name], states[Health.FAILED << _TEST_BITS | test] = (f"failed: {test_name(test)}", FAILED), name
    return Strip(f"/lane_{COMPUTERS[lane]}", "health", (lane,), states, looks)


def _reported(lane: int) -> Strip:
    """Return the states of the reports on a computer: a bit for each lane that reports it."""
    looks: Looks = {"NONE": ("no lane", QUIET)}
    states = {0: "NONE"}
    for n in range(1, len(COMPUTERS) + 1):
        for reporters in combinations(range(len(COMPUTERS)), n):
            names = [COMPUTERS[i] for i in reporters]
            states[sum(1 << i for i in reporters)] = name = f"BY_{''.join(names)}"
            looks[name] = f"by {', '.join(names)}", SUSPECT
    return Strip(f"/lane_{COMPUTERS[lane]}/reported_by", "accuses", (lane,), states, looks)


def _leading() -> Strip:
    looks: Looks = {name: (name, CHANNEL_COLORS[i]) for i, name in enumerate(COMPUTERS)}
    looks["BACKUP"] = ("back-up", ALL_FAILED)
    return Strip("/leading_lane", "leads", (), dict(enumerate(looks)), looks)


def _vote(surface: int) -> Strip:
    """Return the states of the vote of commands of one of SURFACES."""
    looks = {**attention(Pattern, Pattern.NORMAL), "UNRESOLVED": ("unresolved", ALL_FAILED)}
    states = {int(pattern): pattern.name for pattern in Pattern}
    states |= {pattern | _UNRESOLVED: "UNRESOLVED" for pattern in Pattern}
    return Strip(f"/vote_{SURFACES[surface].removesuffix('_rad')}", "command_pattern", (surface,), states, looks)


_LINK_LOOKS: Final[Looks] = {
    "ABSENT": _NOT_FITTED,
    "FRESH": ("fresh", QUIET),
    "OLD": ("a frame old", PALETTE[6]),
    "MISSING": ("missing", SUSPECT),
    "FAILED": ("failed", FAILED),
    "OUTVOTED": ("outvoted", REFERENCE),
}


def _link(sender: int, receiver: int) -> Strip:
    states = {int(state): state.name for state in LinkState}
    states |= {state | _OUTVOTED: state.name if state == LinkState.FAILED else "OUTVOTED" for state in LinkState}
    path = f"/{COMPUTERS[sender]}_to_{COMPUTERS[receiver]}"
    return Strip(path, "link", (receiver, sender), states, _LINK_LOOKS)


LEADING: Final = _leading()
HEALTH: Final = tuple(map(_health, range(len(COMPUTERS))))
REPORTED: Final = tuple(map(_reported, range(len(COMPUTERS))))
VOTES: Final = tuple(map(_vote, range(len(SURFACES))))
OF_LINKS: Final = tuple(_link(sender, receiver) for sender, receiver in LINKS)
STRIPS: Final = (*HEALTH, LEADING, *REPORTED, *VOTES, *OF_LINKS)


def fitted(strips: tuple[Strip, ...], count: int) -> list[Strip]:
    """Return those of HEALTH, REPORTED or OF_LINKS that ``count`` computers have."""
    return [strip for strip in strips if max(strip.at) < count]


def leading(table: Table) -> NDArray[np.intp]:
    """Return the leading lane of each row (n,), BACKUP if none leads."""
    leads = table.lane["leads"]
    return np.where(leads.any(axis=1), leads.argmax(axis=1), BACKUP)


def codes(table: Table, strip: Strip) -> NDArray[Any]:
    """Return the code of a strip of STRIPS in each row (n,)."""
    rows = table.lane
    if strip.field == "leads":
        return leading(table)
    if strip.field == "health":
        return rows["health"][:, strip.at[0]] << _TEST_BITS | rows["failed_for"][:, strip.at[0]]
    if strip.field == "accuses":
        return np.packbits(rows["accuses"][:, :, strip.at[0]] != 0, axis=1, bitorder="little")[:, 0]
    if strip.field == "link":
        receiver, sender = strip.at
        outvoted = np.where(rows["outvoted"][:, receiver, sender] != 0, _OUTVOTED, 0)
        return rows["link"][:, receiver, sender] | outvoted
    whose = np.minimum(leading(table), len(COMPUTERS) - 1), strip.at[0]
    k = np.arange(len(rows))
    unresolved = rows["command_decided_by"][k, *whose] == DecidedBy.UNRESOLVED
    return rows["command_pattern"][k, *whose] | np.where(unresolved, _UNRESOLVED, 0)


def values(table: Table, i: int) -> NDArray[np.float64]:
    """Return the numbers of NAMES of computer ``i``: (n, m)."""
    rows = table.lane[:, i]
    return np.column_stack([rows["surface"] * _SCALES, rows[CLOCK]])


def ranges(table: Table, part: slice = slice(None)) -> dict[str, tuple[float, float]]:
    """Return the axes of NAMES: commands in a ``part`` of the rows, deg or share; clocks, frames."""
    fitted = [i for i in range(len(COMPUTERS)) if (table.lane["health"][:, i] != Health.ABSENT).any()]
    every = np.stack([values(table, i) for i in fitted]) if fitted else np.zeros((1, len(table), len(NAMES)))
    axes = {name: every[:, slice(None) if name == CLOCK else part, i].ravel() for i, name in enumerate(NAMES)}
    return {name: spanned(drawn, 2.0 if name.endswith("_rad") else 0.1) for name, drawn in axes.items()}


def entities(table: Table) -> Iterator[Entity]:
    """Yield the lists of all computers."""
    for i in range(len(COMPUTERS)):
        yield Entity(topic(i), VALUES, values(table, i))


SHOWN: Final = Beside("computer", LEGEND, LEGEND_LINES, STRIPS, codes, entities)
