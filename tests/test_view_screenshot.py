"""What a person sees: the viewer is started without a display and its picture looked at."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rig.errors import BadInput
from rig.events import Event
from rig.frame import SIGNALS, TIMING, Block, Pattern, State, new_block
from rig.log import LogWriter
from rig.view.blueprint import CHANNEL_COLORS, STATE_LOOKS, TRUTH, VOTED
from rig.view.screenshot import screenshot

RATE_HZ = 100.0
DRIVERS = [Path(folder) / "vulkan/icd.d" for folder in ("/usr/share", "/usr/local/share", "/etc")]
HAVE_VULKAN = bool(os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")) or any(
    folder.glob("*.json") for folder in DRIVERS if folder.is_dir()
)
needs_vulkan = pytest.mark.skipif(
    sys.platform != "linux" or not HAVE_VULKAN, reason="no Vulkan driver (Debian: mesa-vulkan-drivers)"
)


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


@needs_vulkan
def test_the_overview_of_a_log_shows_channels_vote_and_truth_apart(tmp_path: Path) -> None:
    rows, log, png = hardover(), tmp_path / "log.mcap", tmp_path / "overview.png"
    with LogWriter(log, RATE_HZ, {}) as writer:
        writer.write(rows, np.zeros(len(rows), TIMING), [Event(1000, "warning", "channel failed", "it failed")])
    shot = screenshot(log, png, 12.0)
    assert shot.complaints == ()
    assert {"pitch_rate, rad/s", "events", "attitude", "control law", "gear_down"} <= set(shot.views)
    picture = np.asarray(Image.open(png).convert("RGB")).astype(int)
    assert picture.shape == (1080, 1920, 3)
    plots, lanes = picture[90:740, 130:1200], picture[800:1050, :1200]
    for color in (*CHANNEL_COLORS, VOTED, TRUTH):
        assert _pixels_of(plots, color) > 100, color
    for name in ("OK", "FAILED"):
        assert _pixels_of(lanes, STATE_LOOKS[name][1], tolerance=60) > 1000, name


def _pixels_of(picture: np.ndarray, color: tuple[int, int, int], tolerance: int = 24) -> int:
    return int((np.abs(picture - np.array(color)).max(axis=-1) <= tolerance).sum())


def test_a_picture_of_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        screenshot(tmp_path / "none.mcap", tmp_path / "none.png", 0.0)
