"""Fly each pattern and draw it for docs/redundancy.md: samples, vote and reference, and the states of the channels.

python tests/tools/figures/patterns.py [FOLDER]    # a minute; FOLDER is docs/patterns by default
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import rig
from rig.core.frame import INDEX, Block, State
from rig.core.palette import QUIET, RED, REFERENCE, YELLOW
from rig.core.runs import runs
from rig.show.notebook.log_shown import lines
from rig.show.pages.flight_figures import reference
from rig.show.viewer.series import limits, series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FOLDER: Final = Path(__file__).parents[3] / "docs/patterns"
STATES: Final = {State.OK: QUIET, State.SUSPECT: YELLOW, State.FAILED: RED}
BOX: Final = {  # five of the nine signals of the inertial box, and the healthy heading
    **{"pitch_rate": 0.2, "roll_rate": 0.2, "yaw_rate": 0.2},
    **{"normal_load_factor": 1.0, "lateral_load_factor": 1.0, "heading": 0.0},
}
SMALL: Final[Any] = {"svg.fonttype": "none", "svg.hashsalt": "rig", "font.size": 9.0, "font.family": "sans-serif"}


class Picture(NamedTuple):
    """A flight, and which 0.25 s of which signal are drawn; ``lanes``: signal and channel of the states below it."""

    scenario: str
    begin_s: float
    overrides: Sequence[str] = ()
    signal: str = "pitch_rate"
    lanes: Sequence[tuple[str, int]] = ()


def _faults(*faults: str) -> str:
    return f"faults=[{', '.join(faults)}]"


def _fault(kind: str, channels: str, more: str = "", signal: str = "pitch_rate") -> str:
    return f"{{kind='{kind}', signal='{signal}', channels=[{channels}], start_s=10.0{more}}}"


LEVEL: Final = "f16_split_2_2_level"
OFFSETS: Final = [_fault("offset", "2", f", offset={size}", name) for name, size in BOX.items() if size]
PICTURES: Final = {
    "isolated": Picture(LEVEL, 9.95, [_faults(_fault("offset", "3", ", offset=0.1"))]),
    "2_2": Picture(LEVEL, 9.95),
    "1_1": Picture("f16_split_1_1", 14.95),
    "1_1_1_1": Picture("f16_split_1_1_1_1", 9.95),
    "1_1_1": Picture("f16_split_1_1_1", 14.95),
    "box": Picture(LEVEL, 9.95, [_faults(*OFFSETS)], lanes=[(name, 2) for name in BOX]),
    "common": Picture(
        LEVEL,
        9.95,
        [_faults(_fault("offset", "1, 2, 3, 4", ", offset=0.5")), "redundancy.common_mode='fail'"],
    ),
}


def drawn(rows: Block, rate_hz: float, picture: Picture, threshold: float) -> Figure:
    """Return the signal of ``rows`` with its references over the states of the channels; threshold : SI."""
    shown = series(rows, rate_hz, picture.signal)
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.0, 1.4])
    lines(above, shown, threshold)
    above.plot(shown.time_s, reference(rows, picture.signal) * shown.scale, color=REFERENCE, lw=1.1, label="reference")
    above.set_ylim(*limits(shown, threshold))
    above.set_ylabel(f"{picture.signal}, {shown.unit}")
    above.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8.0)
    _lanes(below, rows, rate_hz, picture.lanes or [(picture.signal, c) for c in (1, 2, 3, 4)])
    below.set_xlabel("time, s")
    looks = [Patch(color=colour, label=state.name.lower()) for state, colour in STATES.items()]
    below.legend(handles=looks, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8.0)
    below.set_xlim(shown.time_s[0], shown.time_s[-1])
    return figure


def _lanes(axes: Axes, rows: Block, rate_hz: float, lanes: Sequence[tuple[str, int]]) -> None:
    for y, (name, channel) in enumerate(lanes):
        states = rows["state"][:, INDEX[name], channel - 1]
        for begin, end in runs(states):
            span = float(rows["frame"][begin]) / rate_hz, int(end - begin) / rate_hz
            axes.broken_barh([span], (y - 0.4, 0.8), color=STATES[State(states[begin])])
    one = len({name for name, _ in lanes}) == 1
    axes.set_yticks(range(len(lanes)), [f"channel {c}" if one else f"{name} {c}" for name, c in lanes])
    axes.invert_yaxis()


def main(folder: Path) -> None:
    """Fly and draw all of them into ``folder``."""
    folder.mkdir(exist_ok=True)
    for name, picture in PICTURES.items():
        end_s = picture.begin_s + 0.25
        with tempfile.TemporaryDirectory() as logs:
            overrides = [f"duration_s={end_s + 0.1:g}", *picture.overrides]
            log = rig.read_log(rig.fly(picture.scenario, overrides=overrides, out=Path(logs)).log)
        time_s = log.rows["frame"] / log.rate_hz
        rows = log.rows[(time_s >= picture.begin_s) & (time_s <= end_s)]
        settings = rig.load(picture.scenario, overrides=overrides).resolved()["redundancy"]["signals"]
        with mpl.rc_context(SMALL):
            figure = drawn(rows, log.rate_hz, picture, settings[picture.signal]["threshold"])
            metadata: dict[str, Any] = {"Date": None, "Creator": None, "Title": f"Pattern {name.replace('_', ':')}"}
            figure.savefig(folder / f"{name}.svg", metadata=metadata)
        failed = "; ".join(event.text for event in log.events if event.name == "channel failed")
        print(f"{name}.svg: {(folder / f'{name}.svg').stat().st_size} B; {failed}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
