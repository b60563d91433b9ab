"""What a person sees: the viewer is started without a display, asked what it shows, and its picture looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import outside
import pytest
from PIL import Image

from rig.core.errors import BadInput
from rig.core.frame import DISCRETES, SIGNALS, TIMING, Block, Pattern, State, Table, new_block
from rig.core.units.quantities import unit_shown
from rig.flight.events import Event
from rig.log.writer import LogWriter
from rig.show.viewer import viewer
from rig.show.viewer.opened import as_file, read, window
from rig.show.viewer.scene import TIMELINE
from rig.show.viewer.screenshot import headless, screenshot, wait_until_loaded
from rig.show.viewer.style import CHANNEL_COLORS, STATE_LOOKS, TRUTH, VOTED, plain

RATE_HZ = 100.0


def hardover(seconds: int = 20) -> Block:
    """Four noisy channels of slow sines; channel 2 of pitch rate runs away half-way and is failed 0.1 s later."""
    n, rng = int(seconds * RATE_HZ), np.random.default_rng(1)
    rows, bias = new_block(n), np.array([-1.5, -0.5, 0.5, 1.5])
    for i, signal in enumerate(SIGNALS):
        span = signal.high - signal.low
        rows["truth"][:, i] = (signal.high + signal.low) / 2 + 0.05 * span * np.sin(np.arange(n) / RATE_HZ)
        noise = rng.standard_normal((n, 4)) + 4 * bias
        rows["channels"][:, i] = rows["truth"][:, i, None] + 0.001 * span * noise
    half = n // 2
    rows["channels"][half:, 0, 1] = SIGNALS[0].high
    rows["state"][half : half + 10, 0, 1] = State.SUSPECT
    rows["pattern"][half : half + 10, 0] = Pattern.ISOLATED
    rows["state"][half + 10 :, 0, 1] = State.FAILED
    trusted = np.where(rows["state"] == State.OK, rows["channels"], np.nan)
    rows["voted"] = np.nanmedian(trusted, axis=2)
    rows["reference"] = np.nan
    rows["flight"][:, 11] = 1.0  # attitude: level, to the north
    return rows


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A log of a hardover, and a baseline of it without one."""
    folder = tmp_path_factory.mktemp("screenshot")
    rows, baseline = hardover(), hardover()
    baseline["channels"], baseline["state"], baseline["pattern"], baseline["acting"] = (
        rows["truth"][:, :, None],
        0,
        0,
        0,
    )
    told = [
        Event(1000, "info", "fault on", "hardover pitch_rate.2"),
        Event(1010, "warning", "channel failed", "it failed"),
    ]
    for name, block, events in (("faulted", rows, told), ("healthy", baseline, told[:1])):
        with LogWriter(folder / f"{name}.mcap", RATE_HZ, {}) as writer:
            writer.write(Table(block, timing=np.zeros(len(block), TIMING)), events)
    return folder / "faulted.mcap", folder / "healthy.mcap"


@outside.needs("vulkan")
@pytest.mark.long
def test_the_overview_of_a_log_shows_channels_vote_and_truth_apart(flights: tuple[Path, Path], tmp_path: Path) -> None:
    png = tmp_path / "overview.png"
    shot = screenshot(read([flights[0]]), png, 12.0)
    assert shot.complaints == ()
    assert {"pitch rate, deg/s", "events", "attitude", "faults, control law", "gear down"} <= set(shot.views)
    picture = np.asarray(Image.open(png).convert("RGB")).astype(int)
    assert picture.shape == (1080, 1920, 3)
    plots, cells = picture[190:690, 30:1430], picture[230:640, 1440:]
    for color in (*CHANNEL_COLORS, VOTED, TRUTH):
        assert _pixels_of(plots, color) > 100, color
    for name in ("OK", "FAILED"):
        assert _pixels_of(cells, STATE_LOOKS[name][1]) > 300, name
    assert _pixels_of(picture[700:1050, :720], STATE_LOOKS["FAILED"][1], tolerance=60) > 1000  # a lane


@pytest.mark.long
@outside.needs("vulkan")
@pytest.mark.parametrize("logs", [1, 2])
def test_every_view_of_the_layout_holds_data_of_every_flight(flights: tuple[Path, Path], logs: int) -> None:
    opened = read(flights[:logs])
    with as_file(opened) as rrd, headless() as connect:
        client = connect()
        client.open(str(rrd))
        wait_until_loaded(client)
        views = {view.view_id: view.name for view in client.get_state().views}
        [timeline] = client.get_recording_schema(paths_only=True).timelines
        held = {
            entity.entity_path: {component.component for component in entity.components}
            for entity in client.get_recording_schema(max_entities=10_000, paths_only=False).entities
        }
        layout: Any = client.get_blueprint().blueprint
    assert (timeline.name, timeline.end) == (TIMELINE, 19_990_000_000)
    wanted = {f"{plain(s.name)}, {unit_shown(s.unit)}".removesuffix(", ") for s in SIGNALS}
    wanted |= {plain(discrete.name) for discrete in DISCRETES}
    wanted |= {"events", "attitude", "track from above, north up, in m"}
    assert wanted <= set(views.values())
    assert {"elevator, deg", "throttle, 1"} <= {name.partition(":")[0] for name in views.values()}
    for view, name in views.items():
        shown = layout[f"/view/{view}/ViewContents"]["ViewContents"]["query"]
        shown = [shown] if isinstance(shown, str) else shown
        assert shown, name
        assert {path for path in shown if "/fault_" not in path} <= held.keys(), name  # none acted
        picks = [
            part["VisualizerInstruction"]
            for at, part in layout.items()
            if view in at and "VisualizerInstruction" in part
        ]
        for pick in picks:
            source = pick.get("component_map", {}).get("source_component")
            assert source is None or any(source in held[path] for path in shown), (name, source)
        if logs == 2 and name[:2] not in ("A ", "B ") and name not in ("flights", "legend", "margin"):
            assert {path[:3] for path in shown} == {"/A/", "/B/"}, name


@outside.needs("vulkan")
def test_a_window_is_a_viewer_with_the_flights_that_ends_with_us(flights: tuple[Path, Path]) -> None:
    with window(read([flights[0]]), "--headless", "--hide-welcome-screen") as process:
        assert process.poll() is None
        arguments: Any = process.args
        [recording] = viewer.connect(int(arguments[arguments.index("--port") + 1])).get_state().recordings
        assert [timeline.end for timeline in recording.timelines] == [19_990_000_000]
    assert process.poll() is not None


def _pixels_of(picture: np.ndarray, color: tuple[int, int, int], tolerance: int = 24) -> int:
    return int((np.abs(picture - np.array(color)).max(axis=-1) <= tolerance).sum())


def test_a_picture_that_cannot_be_written_is_refused(flights: tuple[Path, Path], tmp_path: Path) -> None:
    opened = read([flights[0]])
    with pytest.raises(BadInput, match=r"must end in \.png"):
        screenshot(opened, tmp_path / "picture.jpg")
    with pytest.raises(BadInput, match="no such folder"):
        screenshot(opened, tmp_path / "nowhere" / "picture.png")
