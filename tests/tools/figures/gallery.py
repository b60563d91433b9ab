"""Twelve scenarios to begin with: a small picture of each from its flight, and the table of the gallery page."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import rig
from figures.svg import DASHES, line, svg, text
from rig.core.frame import INDEX, SIGNALS, Health, State
from rig.core.units.quantities import scale_shown, unit_shown

WIDTH, HEIGHT = 360, 190
LEFT, RIGHT, TOP, BOTTOM = 54.0, 348.0, 40.0, 158.0
Floats = NDArray[np.floating[Any]]


class Case(NamedTuple):
    """A scenario of the gallery: its picture's question and seconds, and what it shows.

    shows : a signal, of which channels and the voted value are drawn; "lanes" or a servo's "current"
    """

    name: str
    title: str
    line: str
    shows: str
    start_s: float
    stop_s: float


CASES: Final = (
    Case(
        "f16_pitch_rate_hardover",
        "A gyro runs to its stop",
        "One channel goes hard over; comparison isolates it and the voted value stays.",
        *("pitch_rate", 19.8, 20.4),
    ),
    Case(
        "f16_split_2_2_level",
        "Two against two",
        "Two channels are off alike: no majority, and the reference decides.",
        *("pitch_rate", 9.8, 10.4),
    ),
    Case(
        "f16_split_1_1_1_1",
        "No two agree",
        "Three channels leave in three directions; one is near the reference.",
        *("pitch_rate", 9.8, 10.4),
    ),
    Case(
        "f16_stuck_together",
        "Two channels stuck together",
        "Two gyros freeze alike, a third fails, then the aircraft manoeuvres.",
        *("pitch_rate", 1.5, 12.0),
    ),
    Case(
        "b747_static_pressure_drift",
        "A slow drift",
        "A drift stays below the threshold for seconds before the comparison detects it.",
        *("static_pressure", 15.0, 90.0),
    ),
    Case(
        "f16_lost_pitch_rate",
        "A signal is lost",
        "All four channels fail one after another; a substitute flies the aircraft.",
        *("pitch_rate", 8.0, 32.0),
    ),
    Case(
        "b747_pitch_sensor_half",
        "All channels read half",
        "All pitch-angle channels lose half their gain; the fault-tolerant law corrects it.",
        *("pitch_angle", 26.0, 70.0),
    ),
    Case(
        "f16_computer_stop",
        "A computer stops",
        "Computer A stops with its sensors; B leads, and A is readmitted by command.",
        *("lanes", 3.0, 16.0),
    ),
    Case(
        "f16_link_byzantine",
        "A Byzantine data link",
        "Computer B transmits different values to each receiver; the other three vote it out.",
        *("lanes", 4.0, 6.0),
    ),
    Case(
        "f16_elevator_coil_hardover",
        "A servo coil goes hard over",
        "One of four elevator coils takes full current; a monitor shuts its channel off.",
        *("current", 4.8, 5.6),
    ),
    Case(
        "history_qf72",
        "Spikes of an angle-of-attack vane",
        "The A330 incident of 2008: one vane transmits 50 degrees twice.",
        *("angle_of_attack", 9.0, 14.0),
    ),
    Case(
        "history_blocked_pitot",
        "A wrong majority",
        "Ice closes three of four pitot lines: the good channel is isolated by mistake.",
        *("dynamic_pressure", 8.0, 45.0),
    ),
)


def ticks(low: float, high: float) -> list[float]:
    """Return two to five round numbers between ``low`` and ``high``."""
    for step in sorted(base * 10.0**power for base in (1, 2, 5) for power in range(-3, 6)):
        first, last = int(np.ceil(low / step)), int(np.floor(high / step))
        if last - first < 5:
            return [round(k * step, 6) for k in range(first, last + 1)]
    return []


class Axes(NamedTuple):
    """The ranges of the picture's plot."""

    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of a point, px."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (min(max(y, self.y[0]), self.y[1]) - self.y[0]) / (self.y[1] - self.y[0])
        return LEFT + across * (RIGHT - LEFT), BOTTOM - up * (BOTTOM - TOP)


def thumbnail(case: Case, parts: Iterable[str]) -> str:
    """Return the file of a case."""
    return svg(case.name, HEIGHT, case.title, case.line, [text(12, 22, case.title, bold=True), *parts], WIDTH)


def _thinned(xs: Floats, ys: Floats) -> list[tuple[float, float]]:
    """Return at most some 300 points: of each stretch its first, least and largest, so that no spike is lost."""
    step = max(1, len(xs) // 100)
    kept = {
        i + int(k) for i in range(0, len(xs), step) for k in (0, ys[i : i + step].argmin(), ys[i : i + step].argmax())
    }
    return [(float(xs[i]), float(ys[i])) for i in sorted(kept)]


def _curve(axes: Axes, xs: Floats, ys: Floats, role: str, more: str = "") -> Iterable[str]:
    """Yield a line for each stretch of finite samples."""
    good = np.flatnonzero(np.isfinite(ys))
    for piece in np.split(good, np.flatnonzero(np.diff(good) > 1) + 1):
        if len(piece) > 1:
            yield line([axes.at(*point) for point in _thinned(xs[piece], ys[piece])], role, more)


def _dash(channel: int) -> str:
    return f'stroke-dasharray="{DASHES[channel]}"' if DASHES[channel] else ""


def _frame(axes: Axes, ys: Sequence[float], unit: str) -> Iterable[str]:
    for y in ys:
        yield line([axes.at(axes.x[0], y), axes.at(axes.x[1], y)], "line", 'stroke-width="1"')
        yield text(LEFT - 6, axes.at(0, y)[1] + 4, f"{y:g}", "soft", anchor="end")
    for x in axes.x:
        yield text(axes.at(x, 0)[0], BOTTOM + 20, f"{x:g} s", "soft", anchor="start" if x == axes.x[0] else "end")
    yield text((LEFT + RIGHT) / 2, BOTTOM + 20, unit, "soft", anchor="middle")


def _of_signal(case: Case, log: rig.Log) -> Iterable[str]:
    """Yield channels, voted value and the moments of isolation of a signal."""
    s = INDEX[case.shows]
    unit, factor = unit_shown(SIGNALS[s].unit), scale_shown(SIGNALS[s].unit)
    rows = log.rows[(log.time_s >= case.start_s) & (log.time_s < case.stop_s)]
    time = rows["frame"] / log.rate_hz
    channels, voted = rows["channels"][:, s] * factor, rows["voted"][:, s] * factor
    truth = rows["truth"][:, s] * factor
    low, high = (float(bound(bound(voted), bound(truth))) for bound in (min, max))
    room = max(high - low, 0.02 * abs(high), 2.0 if unit.startswith("deg") else 0.0)
    axes = Axes((case.start_s, case.stop_s), (low - 0.8 * room, high + 0.8 * room))
    labels = ticks(*axes.y)
    yield from _frame(axes, labels, f"{case.shows.replace('_', ' ')}, {unit}")
    for c in range(channels.shape[1]):
        if log.rows["state"][0, s, c] != State.ABSENT:
            yield from _curve(
                axes, time, np.where(rows["valid"][:, s, c] != 0, channels[:, c], np.nan), f"c{c + 1}", _dash(c)
            )
    yield from _curve(axes, time, voted, "vote", 'stroke-width="3"')
    if (np.abs(voted - truth) > 0.2 * room).any():  # elsewhere it would be hidden behind the voted value
        yield from _curve(axes, time, truth, "onset", 'stroke-width="2" stroke-dasharray="2 3"')
        yield text(RIGHT, TOP - 18, "dotted: true value", "soft", anchor="end")
    state = rows["state"][:, s] == State.FAILED
    for k in np.flatnonzero((state[1:] & ~state[:-1]).any(axis=1)):
        x = axes.at(float(time[k + 1]), 0)[0]
        yield line([(x, TOP - 6), (x, BOTTOM)], "bad", 'stroke-dasharray="5 4"')


def _bars(
    case: Case, log: rig.Log, names: Sequence[str], codes: NDArray[np.uint8], good: Sequence[int]
) -> Iterable[str]:
    """Yield a bar a name: a thick line while its code is good, a thin dashed one while it is not."""
    axes = Axes((case.start_s, case.stop_s), (0.0, 1.0))
    chosen = (log.time_s >= case.start_s) & (log.time_s < case.stop_s)
    time, codes = log.time_s[chosen], codes[chosen]
    for i, name in enumerate(names):
        y = TOP + (i + 0.5) * (BOTTOM - TOP) / len(names)
        yield text(LEFT - 8, y + 4, name, "ink", anchor="end")
        well = np.isin(codes[:, i], good)
        edges = [0, *(np.flatnonzero(np.diff(well)) + 1).tolist(), len(well) - 1]
        for k, later in pairwise(edges):
            ends = [(axes.at(float(time[j]), 0)[0], y) for j in (k, later)]
            look = ("vote", 'stroke-width="9"') if well[k] else ("bad", 'stroke-width="4" stroke-dasharray="4 3"')
            yield line(ends, *look)
    yield from _frame(axes, (), "computers in control")


def _of_servo(case: Case, log: rig.Log) -> Iterable[str]:
    """Yield the currents of the elevator's four coils, and when a channel is shut off."""
    chosen = (log.time_s >= case.start_s) & (log.time_s < case.stop_s)
    assert log.parts is not None
    time, servo = log.time_s[chosen], log.parts["servo"][chosen]
    axes = Axes((case.start_s, case.stop_s), (-1.1, 1.1))
    yield from _frame(axes, (-1, 0, 1), "current of the elevator's coils")
    for c in range(4):
        yield from _curve(
            axes, time, servo["current"][:, 0, c].astype(float), f"c{c + 1}", f'stroke-width="2" {_dash(c)}'
        )
    for k in np.flatnonzero(np.diff(servo["valve"][:, 0].max(axis=1)) > 0):
        x = axes.at(float(time[k + 1]), 0)[0]
        yield line([(x, TOP - 6), (x, BOTTOM)], "bad", 'stroke-dasharray="5 4"')


def drawn(case: Case, folder: Path) -> str:
    """Fly a case into ``folder`` and return its picture."""
    flight = rig.fly(case.name, out=folder)
    log = rig.read_log(flight.log)
    if case.shows == "current":
        parts = _of_servo(case, log)
    elif case.shows == "lanes" and log.parts is not None:
        parts = _bars(case, log, "ABCD", log.parts["computer"]["health"], (Health.ENGAGED, Health.SUSPECT))
    else:
        parts = _of_signal(case, log)
    return thumbnail(case, parts)


def table() -> str:
    """Return the gallery's cards, as docs/reference/gallery.md has them."""
    cells = [
        f"[![{case.title}](../pictures/gallery/{case.name}.svg)](../pictures/gallery/{case.name}.svg)<br>"
        f"{case.line}<br>`rig fly {case.name}`"
        for case in CASES
    ]
    rows = [f"| {left} | {right} |" for left, right in zip(cells[::2], cells[1::2], strict=True)]
    return "\n".join(["| | |", "|---|---|", *rows])


def gallery() -> dict[str, str]:
    """Fly all cases and return the text of each picture by its name below docs/pictures/."""
    with tempfile.TemporaryDirectory() as folder:
        return {f"gallery/{case.name}.svg": drawn(case, Path(folder)) for case in CASES}
