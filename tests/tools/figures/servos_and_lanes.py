"""Two pictures of results: steps of a servo beside the lags, and four lanes with free clocks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from figures.lanes_whole import APART_FLOOR, FREE, REVERSED_S, apart, computers, flight_44
from figures.svg import DASHES, Floats, Panel, line, svg, text
from rig.core.frame import COMPUTERS
from rig.studies.papers.servo_study import step_response

_STEPS: Final = ((0.02, 300.0, (0.0, 0.4, 0.8, 1.2)), (0.39, 800.0, (0.0, 10.0, 20.0)))  # rad, ms, ticks in deg
_POINT: Final = 20  # frames of a point
_THIN: Final = 4  # of the steps
_ROLE_DASHES: Final = {"onset": "", "c1": "7 4", "vote": "2 3"}


def servo() -> str:
    """Return the picture of a small and a large step of the F-16's elevator."""
    parts = [text(16, 26, "Steps of the F-16 elevator at 100 Hz: position in deg over time in ms", bold=True)]
    for i, (size, end_ms, ticks) in enumerate(_STEPS):
        found = step_response("f16", "elevator", 100.0, size, end_ms / 1000.0)
        panel = Panel(
            84, 262, (0.0, end_ms), (-0.05 * np.degrees(size), 1.15 * np.degrees(size)), 52 + 345 * i, 340 + 345 * i
        )
        parts.append(text(panel.left, 66, f"step of {np.degrees(size):.3g} deg", "soft"))
        parts += panel.axes([end_ms * k / 4 for k in range(5)], ticks, " ")
        for role, values in (
            ("onset", found.ram_rad),
            ("c1", found.lag_then_limit_rad),
            ("vote", found.limited_lag_rad),
        ):
            thinned = zip(found.time_s[::_THIN], values[::_THIN], strict=True)
            points = [panel.at(1e3 * x, np.degrees(y)) for x, y in thinned]
            parts.append(line(points, role, _dashed(_ROLE_DASHES[role], 2.0)))
    parts += _key(
        306,
        [
            ("onset", "", "servo model"),
            ("c1", "7 4", "lag, then rate limit (JSBSim)"),
            ("vote", "2 3", "lag with limited rate"),
        ],
    )
    described = (
        "Two plots of the elevator position after a command step of 1.15 and of 22.3 deg. The servo model follows a "
        "few frames after the first-order lag with limited rate, which has the same shape. The lag followed by a rate "
        "limit, as in JSBSim, is slower near the end of the large step."
    )
    return svg("servo", 326, "Steps of a servo beside two simpler models", described, parts)


def lanes() -> str:
    """Return the picture of flight 44: aileron commands where the stick is reversed, and the integrators apart."""
    free, alone, together = flight_44(True, *FREE), flight_44(False, *FREE), flight_44(True)
    parts = [text(16, 26, "Four lanes with clocks that run free", bold=True)]
    parts += _commands(computers(free)["surface"][:, :, 1], free.rows["frame"] / free.scenario.rate_hz)
    cases = (
        ("bad", "", "free, not equalised", apart(alone)[1]),
        ("c1", "7 4", "free, equalised", apart(free)[1]),
        ("vote", "2 3", "synchronised", apart(together)[1]),
    )
    parts += _integrators(cases, free.rows["frame"] / free.scenario.rate_hz)
    described = (
        "Left: the aileron commands of the lanes while the stick is reversed. They differ in the frame of the reversal "
        "and are equal one frame later. Right: the largest difference between the integrators of the lanes. Without "
        "equalisation it stays near 1 % of the stroke; with equalisation it returns below 0.01 %; with synchronised "
        "clocks it is 0.0001 % or less."
    )
    return svg("lanes", 350, "Commands and integrators of four lanes with free clocks", described, parts)


def _commands(told: Floats, time_s: Floats) -> Iterable[str]:
    part = slice(int((REVERSED_S - 0.04) * 100), int((REVERSED_S + 0.1) * 100))
    degrees, ms = np.degrees(told[part]), 1000.0 * (time_s[part] - REVERSED_S)
    low, high = float(degrees.min()), float(degrees.max())
    room = 0.08 * (high - low)
    panel = Panel(84, 262, (float(ms[0]), float(ms[-1])), (low - room, high + room), 52, 330)
    yield text(52, 66, "aileron command, deg; time in ms", "soft")
    yield from panel.axes((0, 30, 60, 90), [t for t in range(-30, 31, 5) if low <= t <= high], " ")
    for i in range(len(COMPUTERS)):
        more = _dashed(DASHES[i], 5.2 - 1.2 * i)  # the first is the widest: equal commands stay visible
        yield line(panel.steps(ms, degrees[:, i]), f"c{i + 1}", more)
    yield from _key(306, [(f"c{i + 1}", DASHES[i], f"lane {name}") for i, name in enumerate(COMPUTERS)])


def _integrators(cases: Sequence[tuple[str, str, str, Floats]], time_s: Floats) -> Iterable[str]:
    panel = Panel(84, 262, (0.0, float(time_s[-1])), (-4.2, 2.2), 420, 684)
    yield text(400, 66, "integrators apart, % of the stroke; time in s", "soft")
    for power in (-4, -2, 0, 2):
        yield line([panel.at(0, power), panel.at(panel.x[1], power)], "line", 'stroke-width="1"')
        yield text(panel.left - 8, panel.at(0, power)[1] + 4.5, f"{10.0**power:g}", "soft", anchor="end")
    for second in (0, 5, 10, 15, 20):
        yield text(panel.at(second, 0)[0], panel.bottom + 18, f"{second}", "soft", anchor="middle")
    for role, dashes, _, values in cases:
        largest = np.log10(np.maximum(values, APART_FLOOR).reshape(-1, _POINT).max(axis=1))
        points = [panel.at(float(x), float(y)) for x, y in zip(time_s[::_POINT], largest, strict=True)]
        yield line(points, role, _dashed(dashes, 2.0))
    for i, (role, dashes, word, _) in enumerate(cases):
        y = 306 + 17 * i
        yield line([(420, y - 4.5), (450, y - 4.5)], role, _dashed(dashes, 2.0))
        yield text(458, y, word)


def _dashed(dashes: str, width: float) -> str:
    return f'stroke-width="{width:g}"' + (f' stroke-dasharray="{dashes}"' if dashes else "")


def _key(y: float, entries: Sequence[tuple[str, str, str]]) -> Iterable[str]:
    """Yield samples of lines with their names, side by side."""
    x = 16.0
    for role, dashes, word in entries:
        yield line([(x, y - 4.5), (x + 28, y - 4.5)], role, _dashed(dashes, 2.2))
        yield text(x + 34, y, word)
        x += 54.0 + 7.2 * len(word)
