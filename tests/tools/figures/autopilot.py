"""The picture of a stock autopilot that flies on four voters while one and two gyros run to their stop."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final, NamedTuple
from unittest import mock

import numpy as np
import outside

import rig
from figures.svg import DASHES, Floats, Panel, line, svg, text

EXAMPLES: Final = Path(__file__).parents[3] / "docs/examples"
ONSET_S: Final = 10.0
_SHOWN_S: Final = (8.0, 30.0)
_THIN: Final = 5  # frames of a point
_VOTERS: Final = (  # manager, its words, its colour, its dashes
    ("cross-channel", "built-in manager", "vote", ""),
    ("median", "median", "c1", DASHES[1]),
    ("mean", "mean", "bad", DASHES[2]),
    ("mine:first_valid", "one channel", "onset", DASHES[3]),
)
_ROWS: Final = (  # signal, its words, its factor, its span, its ticks
    ("pitch_angle", "pitch angle, deg", 180.0 / np.pi, (-36.0, 14.0), (-30, -15, 0)),
    ("normal_load_factor", "load factor, g", 1.0, (-4.5, 4.5), (-4, 0, 4)),
)


class Flown(NamedTuple):
    """A flight by one voter."""

    time_s: Floats
    truth: Mapping[str, Floats]
    survived: bool


def example(folder: Path) -> Path:
    """Copy the example into ``folder`` and build it; return its unit file of the F-16.  SystemExit: no firmware."""
    firmware = outside.betaflight()
    if firmware is None:
        raise SystemExit("needs Betaflight's firmware: make test-all builds it")
    for name in ("unit", "autopilot"):
        shutil.copytree(EXAMPLES / name, folder / name, ignore=shutil.ignore_patterns("build"))
    subprocess.run(["make", "-C", str(folder / "autopilot"), f"FIRMWARE={firmware}"], check=True, capture_output=True)
    return folder / "autopilot/f16.toml"


def flown(folder: Path) -> dict[tuple[int, str], Flown]:
    """Fly one and two faulty gyros by each voter; the single channel is the faulty one."""
    unit, flights = example(folder), {}
    with mock.patch.object(sys, "path", [str(EXAMPLES / "manager"), *sys.path]):
        for gyros, scenario in ((1, "stock_one_gyro"), (2, "stock_two_gyros")):
            for manager, *_ in _VOTERS:
                overrides = [f"duration_s={_SHOWN_S[1]:g}", f"redundancy.manager={manager}"]
                if ":" in manager:
                    overrides.append(f"faults.0.channels={[1, 2][:gyros]}")
                flight = rig.fly(scenario, overrides=overrides, out=folder / "logs", unit=unit)
                truth = {name: np.asarray(flight.signal(name).truth) * factor for name, _, factor, *_ in _ROWS}
                time_s = np.arange(flight.frames) / flight.scenario.rate_hz
                flights[gyros, manager] = Flown(time_s, truth, flight.survived)
    return flights


def autopilot() -> str:
    """Return the picture.  SystemExit: there is no firmware."""
    with tempfile.TemporaryDirectory() as folder:
        flights = flown(Path(folder))
    title = "Betaflight flies an F-16 on voted values: pitch gyros run to their stop at 10 s"
    parts = [text(16, 26, title, bold=True)]
    for column, gyros in enumerate((1, 2)):
        left = 64.0 + 342 * column
        parts.append(text(left, 54, ("one gyro", "two gyros")[column], bold=True))
        parts.append(text(left + 276, 54, _lost(flights, gyros), "bad", anchor="end"))
        for row in range(len(_ROWS)):
            parts += _panel(flights, gyros, row, left)
    x = 16.0
    for _, words, role, dashes in _VOTERS:
        parts += [line([(x, 441.5), (x + 28, 441.5)], role, _dashed(dashes)), text(x + 34, 446, words)]
        x += 62.0 + 7.4 * len(words)
    parts += [*_cross(x + 6, 441.5, "ink"), text(x + 18, 446, "aircraft lost")]
    return svg("autopilot", 462, "A stock autopilot by four voters", _described(flights), parts)


def _panel(flights: dict[tuple[int, str], Flown], gyros: int, row: int, left: float) -> Iterable[str]:
    name, words, _, span, ticks = _ROWS[row]
    panel = Panel(86.0 + 172 * row, 210.0 + 172 * row, _SHOWN_S, span, left, left + 276)
    yield text(left, panel.top - 10, words + ("; time in s" if row else ""), "soft")
    yield from panel.axes((10, 15, 20, 25, 30), ticks, " ")
    yield line([panel.at(ONSET_S, span[0]), panel.at(ONSET_S, span[1])], "onset", 'stroke-dasharray="2 3"')
    for manager, _, role, dashes in _VOTERS:
        flight = flights[gyros, manager]
        chosen = flight.time_s >= _SHOWN_S[0]
        values = np.clip(flight.truth[name][chosen], *span)
        points = list(zip(flight.time_s[chosen][::_THIN], values[::_THIN], strict=True))
        yield line([panel.at(*point) for point in points], role, _dashed(dashes) if dashes else 'stroke-width="3.6"')
        if not flight.survived:
            yield from _cross(*panel.at(*points[-1]), role)


def _lost(flights: dict[tuple[int, str], Flown], gyros: int) -> str:
    """Return the voters that lose the aircraft, in words that fit beside the heading."""
    lost = [words for manager, words, *_ in _VOTERS if not flights[gyros, manager].survived]
    others = [words for _, words, *_ in _VOTERS[1:]]
    return "lost with all other voters" if lost == others else f"lost with {', '.join(lost)}"


def _cross(x: float, y: float, role: str) -> Iterable[str]:
    for up in (-5, 5):
        yield line([(x - 5, y - up), (x + 5, y + up)], role, 'stroke-width="2.5"')


def _dashed(dashes: str) -> str:
    return 'stroke-width="2.2"' + (f' stroke-dasharray="{dashes}"' if dashes else "")


def _described(flights: dict[tuple[int, str], Flown]) -> str:
    def outcome(gyros: int) -> str:
        words = []
        for manager, name, *_ in _VOTERS:
            flight = flights[gyros, manager]
            end = "flies on" if flight.survived else f"is lost at {flight.time_s[-1]:.1f} s"
            words.append(f"with the voter '{name}' the aircraft {end}")
        return "; ".join(words)

    return (
        "Pitch angle and load factor of an F-16 with Betaflight as its control law. One gyro at its stop: "
        f"{outcome(1)}. Two gyros at their stop: {outcome(2)}."
    )
