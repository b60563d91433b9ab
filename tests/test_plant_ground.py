"""Ground reactions that are off high above ground: all that a flight reads is as with them on, bit for bit."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest
from one_stage import fly, hold

from rig.core.frame import FLIGHT_INDEX, Block
from rig.world.plant import airframe, ground, jsbsim, wind

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
PLANES = {name: airframe.read(AIRCRAFT / name / "aircraft.toml") for name in ("f16", "b747", "b737")}
POINTS = [(name, point.name) for name, plane in PLANES.items() for point in plane.flight_points]


def plant(name: str, point: str | None = None) -> jsbsim.Plant:
    plane = PLANES[name]
    return jsbsim.Plant(plane, plane.point(point), wind.Config(), "none", 100.0, 1, 1)


def are_on(flying: jsbsim.Plant) -> bool:
    return flying._fdm[ground.ENABLED] == 1.0


def moved(flying: jsbsim.Plant, frames: int = 150) -> Block:
    """Fly with all four controls moved from frame to frame."""
    k = np.arange(frames)
    return fly(flying, hold(flying, frames) + 0.01 * np.stack([k % 9 - 4, k % 7 - 3, k % 5 - 2, k % 3 - 1], axis=1))


def dive(flying: jsbsim.Plant, frames: int = 3_500) -> Block:
    """Hold the nose down, to the ground and on."""
    command = hold(flying, frames)
    command[:, 0] += 0.2
    return fly(flying, command)


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_a_flight_high_above_ground_has_the_frames_of_one_with_them(
    name: str, point: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    off = plant(name, point)
    rows = moved(off).tobytes()
    assert not are_on(off)
    monkeypatch.setattr(ground, "HIGH_FT", inf)
    on = plant(name, point)
    assert moved(on).tobytes() == rows
    assert are_on(on)


def test_they_are_on_again_before_the_aircraft_touches_the_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    falling = plant("b737", "20000ft_m06")
    rows = dive(falling)
    height_m = rows["flight"][:, FLIGHT_INDEX["height_m"]]
    assert height_m[0] * 3.28 > ground.HIGH_FT > 0.0 > height_m.min()
    assert are_on(falling)
    monkeypatch.setattr(ground, "HIGH_FT", inf)
    assert dive(plant("b737", "20000ft_m06")).tobytes() == rows.tobytes()


def test_a_model_that_evaluates_functions_with_them_keeps_them(tmp_path: Path) -> None:
    assert ground._idle(model(tmp_path, "<ground_reactions><contact/></ground_reactions>"))
    assert not ground._idle(model(tmp_path, "<ground_reactions><contact><function/></contact></ground_reactions>"))
    assert not ground._idle(model(tmp_path, '<ground_reactions file="gear"/>'))
    assert not ground._idle(model(tmp_path, "<ground_reactions/>", "gear/unit[1]/AGL-ft"))


def model(tmp_path: Path, text: str, reads: str = "aero/qbar-psf") -> Path:
    """Return the folder of a model with these ground reactions, whose equations read a property."""
    folder = tmp_path / str(len(list(tmp_path.iterdir()))) / "plane"
    folder.mkdir(parents=True)
    (folder / "plane.xml").write_text(f"<fdm_config>{text}</fdm_config>")
    (folder.parent / "reads.txt").write_text(reads)
    return folder
