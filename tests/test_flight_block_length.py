"""Blocks are as long as a flight's use allows, and a killed flight loses two of them at most."""

from __future__ import annotations

import mmap
import os
import signal
import sys
import time
from pathlib import Path
from struct import pack_into, unpack_from

import pytest

from rig.flight.block_length import ALONE_FRAMES, Use, block_frames
from rig.flight.fly import fly
from rig.log import read_log, recover
from rig.scenario.scenario import Scenario, load
from rig.world.plant.jsbsim import Plant

UNPACED, PACED = None, 40.0


def flight(rate_hz: float = 100.0, seconds: float = 60.0) -> Scenario:
    return load(None, [f"duration_s={seconds}", f"rate_hz={rate_hz}", "faults=[]"])


@pytest.mark.parametrize(
    ("use", "rate_hz", "frames"),
    [
        *(("paced", 100.0, 50), ("watched", 100.0, 100), ("alone", 100.0, ALONE_FRAMES), ("memory", 100.0, 1000)),
        *(("alone", 50.0, 200), ("alone", 200.0, ALONE_FRAMES), ("alone", 1000.0, 1000), ("paced", 10.0, 5)),
    ],
)
def test_a_block_has_the_seconds_of_its_use(use: Use, rate_hz: float, frames: int) -> None:
    assert block_frames(flight(rate_hz), use) == frames


def blocks(**given: object) -> list[int]:
    """Return the last frame of every block of a flight of 9 s."""
    ends: list[int] = []
    fly(flight(seconds=9.0), progress=lambda done, total: ends.append(done), **given)  # pyright: ignore[reportArgumentType]
    return ends


def test_only_who_waits_for_a_block_makes_it_short(tmp_path: Path) -> None:
    assert blocks(out=tmp_path) == [400, 800, 900]
    assert blocks(out=tmp_path, watch=lambda *block: None) == [100 * k for k in range(1, 10)]
    assert blocks(out=tmp_path, realtime_factor=1e6) == [50 * k for k in range(1, 19)]


def fly_and_count(scenario: Scenario, folder: Path, factor: float | None, count: mmap.mmap) -> None:
    """Fly in a forked process; the frames that were begun are counted in memory that its parent reads."""
    step = Plant.step

    def counted(self: Plant, block: object, k: int) -> None:
        pack_into("q", count, 0, unpack_from("q", count, 0)[0] + 1)
        step(self, block, k)  # pyright: ignore[reportArgumentType]

    Plant.step = counted
    fly(scenario, out=folder, realtime_factor=factor)


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.parametrize(("factor", "use"), [(UNPACED, "alone"), (PACED, "paced")])
def test_a_flight_killed_at_any_moment_loses_two_blocks_at_most(factor: float | None, use: Use, tmp_path: Path) -> None:
    scenario, lost = flight(seconds=600.0), list[int]()
    fly(flight(seconds=1.0), out=tmp_path)  # loads the kernels, which the children then have
    for moment in range(20):
        folder, count = tmp_path / f"{moment}", mmap.mmap(-1, 8)
        if (child := os.fork()) == 0:
            fly_and_count(scenario, folder, factor, count)
            os._exit(0)
        while unpack_from("q", count, 0)[0] == 0:
            time.sleep(0.001)
        time.sleep(0.03 + 0.0137 * moment)
        os.kill(child, signal.SIGKILL)
        assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL  # it was still flying
        begun = unpack_from("q", count, 0)[0]
        (path,) = folder.glob("*.mcap")
        saved = recover(path, folder / "saved.mcap").frames
        assert len(read_log(folder / "saved.mcap").rows) == saved if saved else True
        lost.append(begun - saved)
    assert min(lost) >= 0 and max(lost) <= 2 * block_frames(scenario, use)
