"""Fly each pattern and draw it: samples, voted value and reference over the states of the channels."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

import rig
from figures.svg import DASHES, Floats, Panel, line, svg, text
from rig.core.frame import INDEX, Block, Pattern, State
from rig.core.runs import runs
from rig.show.pages.flight_figures import reference
from rig.show.viewer.series import Series, limits, series

WIDTH: Final = 480
BOX: Final = {  # five of the nine signals of the inertial box, and the healthy heading
    **{"pitch_rate": 0.2, "roll_rate": 0.2, "yaw_rate": 0.2},
    **{"normal_load_factor": 1.0, "lateral_load_factor": 1.0, "heading": 0.0},
}
_LEFT, _RIGHT, _TOP, _BOTTOM = 116.0, 366.0, 70.0, 216.0  # px of the plot
_APART: Final = 15.0  # px of two labels
_ROW: Final = 21.0  # px of a row of states
_NAMES: Final = {"normal_load_factor": "normal load", "lateral_load_factor": "lateral load"}


class Picture(NamedTuple):
    """A flight, and 0.25 s of one signal; ``rows``: signal and channel of the states below the plot."""

    title: str
    scenario: str
    begin_s: float
    description: str
    overrides: Sequence[str] = ()
    signal: str = "pitch_rate"
    rows: Sequence[tuple[str, int]] = ()


def _faults(*faults: str) -> str:
    return f"faults=[{', '.join(faults)}]"


def _fault(kind: str, channels: str, more: str = "", signal: str = "pitch_rate") -> str:
    return f"{{kind='{kind}', signal='{signal}', channels=[{channels}], start_s=10.0{more}}}"


LEVEL: Final = "f16_split_2_2_level"
OFFSETS: Final = [_fault("offset", "2", f", offset={size}", name) for name, size in BOX.items() if size]
PICTURES: Final = {
    "isolated": Picture(
        "Isolated: one channel differs",
        LEVEL,
        9.95,
        "Channel 3 agrees with no other channel. After 8 frames the manager isolates it by comparison.",
        [_faults(_fault("offset", "3", ", offset=0.1"))],
    ),
    "2_2": Picture(
        "2:2: two pairs",
        LEVEL,
        9.95,
        "Two pairs of channels differ. The reference agrees with channels 1 and 2. After 10 frames the manager "
        "isolates channels 3 and 4.",
    ),
    "1_1": Picture(
        "1:1: two channels are left and differ",
        "f16_split_1_1",
        14.95,
        "Channels 3 and 4 are isolated before. The reference agrees with channel 1, and the manager isolates "
        "channel 2.",
    ),
    "1_1_1_1": Picture(
        "1:1:1:1: no two channels agree",
        "f16_split_1_1_1_1",
        9.95,
        "No two channels agree. Only channel 1 is near the reference, and the manager isolates the other three.",
    ),
    "1_1_1": Picture(
        "1:1:1: three channels are left and differ",
        "f16_split_1_1_1",
        14.95,
        "Channel 4 is isolated before. Only channel 1 is near the reference, and the manager isolates channels 2 "
        "and 3.",
    ),
    "box": Picture(
        "LRU failure: channel 2 of the inertial box",
        LEVEL,
        9.95,
        "Channel 2 differs on five signals of the inertial box. The manager isolates it on all signals of the box, "
        "on the healthy heading as well.",
        [_faults(*OFFSETS)],
        rows=[(name, 2) for name in BOX],
    ),
    "common": Picture(
        "Common mode: all channels change together",
        LEVEL,
        9.95,
        "All channels agree, and two references contradict them. After 10 frames the manager isolates all channels "
        "and holds the last voted value.",
        [_faults(_fault("offset", "1, 2, 3, 4", ", offset=0.5")), "redundancy.common_mode='fail'"],
    ),
}


@cache
def patterns() -> dict[str, str]:
    """Fly and draw all patterns; return the text of each file by its name."""
    return {f"pattern_{name}.svg": _flown(f"pattern_{name}", picture) for name, picture in PICTURES.items()}


def _flown(name: str, picture: Picture) -> str:
    end_s = picture.begin_s + 0.25
    overrides = [f"duration_s={end_s + 0.1:g}", *picture.overrides]
    with tempfile.TemporaryDirectory() as logs:
        log = rig.read_log(rig.fly(picture.scenario, overrides=overrides, out=Path(logs)).log)
    time_s = log.rows["frame"] / log.rate_hz
    rows = log.rows[(time_s >= picture.begin_s) & (time_s <= end_s)]
    signal = rig.load(picture.scenario, overrides=overrides).resolved()["redundancy"]["signals"][picture.signal]
    return drawn(name, rows, log.rate_hz, picture, signal["threshold"])


def drawn(name: str, rows: Block, rate_hz: float, picture: Picture, threshold: float) -> str:
    """Return the picture of ``rows``; threshold : isolation threshold, SI."""
    shown = series(rows, rate_hz, picture.signal)
    ms = 1000.0 * (shown.time_s - picture.begin_s) - 50.0
    span, low_high = (float(ms[0]), float(ms[-1])), limits(shown, threshold)
    panel = Panel(_TOP, _BOTTOM, span, low_high, _LEFT, _RIGHT)
    off = threshold * shown.scale
    listed = picture.rows or [(picture.signal, c) for c in (1, 2, 3, 4)]
    top = _BOTTOM + 26.0
    height = round(top + _ROW * (len(listed) + 1) + 30.0)
    parts = [
        text(14, 24, picture.title, bold=True),
        text(14, 44, f"{picture.signal.replace('_', ' ')}, {shown.unit}; time in ms after onset", "soft"),
        *_band(panel, ms, shown.voted, off),
        *panel.axes([], _ticks(*low_high)),
        *_samples(panel, ms, shown, reference(rows, picture.signal) * shown.scale),
        *_labels(panel, shown, reference(rows, picture.signal) * shown.scale),
        *_states(name, Panel(top, top, span, (0.0, 1.0), _LEFT, _RIGHT), rows, ms, listed, picture.signal),
    ]
    for x in (0, 50, 100, 150, 200):
        parts.append(text(panel.at(x, 0)[0], height - 12.0, f"{x}", "soft", anchor="middle"))
    parts.append(
        line([(panel.at(0, 0)[0], _TOP), (panel.at(0, 0)[0], height - 28.0)], "onset", 'stroke-dasharray="2 3"')
    )
    return svg(name, height, picture.title, picture.description, parts, WIDTH)


def _band(panel: Panel, ms: Floats, voted: Floats, off: float) -> Iterable[str]:
    edges = [*panel.steps(ms, voted + off), *reversed(panel.steps(ms, voted - off))]
    yield f'<path class="f-band" d="M{"L".join(f"{x:.1f} {y:.1f}" for x, y in edges)}z"/>'


def _ticks(low: float, high: float) -> list[float]:
    """Return three to five round numbers within an axis."""
    step = next(size for size in (0.5, 1, 2, 5, 10, 20, 50, 100) if (high - low) / size < 5)
    return [float(step * k) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _samples(panel: Panel, ms: Floats, shown: Series, values: Floats) -> Iterable[str]:
    low, high = panel.y
    for c, samples in enumerate(np.clip(shown.channels, low, high).T):
        dashes = f'stroke-dasharray="{DASHES[c]}"' if DASHES[c] else ""
        yield line(panel.steps(ms, samples), f"c{c + 1}", f'{dashes} stroke-width="1.8"'.strip())
    if np.isfinite(values).all():
        yield line(panel.steps(ms, np.clip(values, low, high)), "reference", 'stroke-width="1"')
    yield line(panel.steps(ms, np.clip(shown.voted, low, high)), "vote", 'stroke-width="3"')


def _labels(panel: Panel, shown: Series, values: Floats) -> Iterable[str]:
    """Yield the names of the lines at their right ends; lines close together have one label."""
    low, high = panel.y
    last = [(float(np.median(of[-5:])), role, word) for of, role, word in _lines(shown, values)]
    placed = sorted((panel.at(0, min(max(y, low), high))[1], role, word) for y, role, word in last if np.isfinite(y))
    groups: list[list[tuple[float, str, str]]] = []
    for one in placed:
        if groups and one[0] - groups[-1][-1][0] < _APART:
            groups[-1].append(one)
        else:
            groups.append([one])
    below = 0.0
    for group in groups:
        at = max(sum(y for y, _, _ in group) / len(group) + 4.5 - 8.0 * (len(_rows_of(group)) - 1), below)
        for words in _rows_of(group):
            spans = "".join(f'<tspan class="f-{role}">{word}</tspan> ' for role, word in words)
            yield f'<text x="{_RIGHT + 8:.1f}" y="{at:.1f}">{spans.strip()}</text>'
            at += 16.0
        below = at


def _lines(shown: Series, values: Floats) -> Iterable[tuple[Floats, str, str]]:
    yield from ((of, f"c{c + 1}", str(c + 1)) for c, of in enumerate(shown.channels.T))
    yield values, "reference", "reference"
    yield shown.voted, "vote", "voted"


def _rows_of(group: Sequence[tuple[float, str, str]]) -> list[list[tuple[str, str]]]:
    """Return the words of a label in rows: channels, then the voted value and the reference."""
    numbers = sorted((word, role) for _, role, word in group if word.isdigit())
    rows = [[("soft", "channel" if len(numbers) == 1 else "channels"), *((role, word) for word, role in numbers)]]
    return [*(rows if numbers else []), *([(role, word)] for _, role, word in group if not word.isdigit())]


def _states(
    name: str, panel: Panel, rows: Block, ms: Floats, listed: Sequence[tuple[str, int]], signal: str
) -> Iterable[str]:
    """Yield a row of states for each channel, and one of the pattern of the signal."""
    step = float(ms[1] - ms[0])
    one = len({of for of, _ in listed}) == 1
    fills = {State.OK: "f-quiet", State.SUSPECT: f"url(#{name}-suspect-hatch)", State.FAILED: f"url(#{name}-bad-hatch)"}
    words = {State.OK: ("ok", "soft"), State.SUSPECT: ("suspect", "mark"), State.FAILED: ("isolated", "on")}
    for i, (of, channel) in enumerate(listed):
        label = f"channel {channel}" if one else f"{_NAMES.get(of, of.replace('_', ' '))} {channel}"
        states = rows["state"][:, INDEX[of], channel - 1]
        looks = [(begin, end, fills[State(states[begin])], *words[State(states[begin])]) for begin, end in runs(states)]
        yield from _row(panel, ms, step, panel.top + _ROW * i, label, looks)
    patterns = rows["pattern"][:, INDEX[signal]]
    looks = [
        (begin, end, "f-quiet" if patterns[begin] == Pattern.NORMAL else "f-pattern", Pattern(patterns[begin]).label)
        + (("soft",) if patterns[begin] == Pattern.NORMAL else ("on",))
        for begin, end in runs(patterns)
    ]
    yield from _row(panel, ms, step, panel.top + _ROW * len(listed), "pattern", looks)


def _row(
    panel: Panel, ms: Floats, step: float, y: float, label: str, looks: Iterable[tuple[int, int, str, str, str]]
) -> Iterable[str]:
    yield text(_LEFT - 8, y + 13.0, label, "soft", anchor="end")
    for begin, end, fill, word, role in looks:
        left, right = (
            panel.at(float(ms[begin]), 0)[0],
            panel.at(min(float(ms[begin]) + step * (end - begin), panel.x[1]), 0)[0],
        )
        look = f'class="{fill}"' if fill.startswith("f-") else f'fill="{fill}"'
        yield f'<rect {look} x="{left:.1f}" y="{y:.1f}" width="{right - left:.1f}" height="{_ROW - 4:.1f}"/>'
        if right - left > 7.6 * len(word) + 6.0:
            middle, half = (left + right) / 2, 3.9 * len(word) + 2.0
            if not fill.startswith("f-"):  # no hatch behind the word
                plain = "suspect" if "suspect" in fill else "bad"
                size = f'width="{2 * half:.1f}" height="{_ROW - 4:.1f}"'
                yield f'<rect class="f-{plain}" x="{middle - half:.1f}" y="{y:.1f}" {size}/>'
            yield text(middle, y + 13.0, word, role, anchor="middle", bold=role == "on")
