"""The air of a flight: what is added to the steady wind, and turbulence of the stated size."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.core.frame import FLIGHT_INDEX, INDEX, Block, new_block
from rig.core.settings import build
from rig.world.plant import airframe, jsbsim, wind

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
STEP = wind.Step(start_s=1.0, end_s=3.0, north_m_s=4.0)
GUST = wind.Gust(start_s=5.0, duration_s=2.0, down_m_s=6.0)


def fly(air: wind.Config, frames: int, turbulence: wind.Turbulence = "none", seed: int = 1) -> Block:
    plane = airframe.read(AIRCRAFT / "b747" / "aircraft.toml")
    plant = jsbsim.Plant(plane, plane.point(), air, turbulence, 100.0, 1, seed)
    block = new_block(frames)
    block["surface_command"] = plant.trim
    for k in range(frames):
        plant.read(block, k)
        plant.step(block, k)
    return block


def test_a_step_lasts_from_start_to_end() -> None:
    air = wind.Config(steps=[STEP])
    assert [wind.added(air, t)[0] for t in (0.99, 1.0, 2.99, 3.0)] == [0.0, 4.0, 4.0, 0.0]


def test_a_step_without_end_lasts() -> None:
    assert wind.added(wind.Config(steps=[wind.Step(start_s=1.0, east_m_s=2.0)]), 1e5) == (0.0, 2.0, 0.0)


def test_a_gust_peaks_in_its_middle_and_is_half_at_the_quarters() -> None:
    air = wind.Config(gusts=[GUST])
    speeds = [wind.added(air, t)[2] for t in (4.9, 5.0, 5.5, 6.0, 6.5, 7.0, 7.1)]
    assert speeds == pytest.approx([0.0, 0.0, 3.0, 6.0, 3.0, 0.0, 0.0], abs=1e-12)


def test_steps_and_gusts_add_up() -> None:
    air = wind.Config(steps=[wind.Step(start_s=0.0, down_m_s=1.0)], gusts=[GUST], down_m_s=0.5)
    assert wind.added(air, 6.0) == pytest.approx((0.0, 0.0, 7.5))


@pytest.mark.parametrize(
    ("time_s", "expected"), [(0.0, 1.0), (1.0, 3.0), (3.0, 5.0), (5.0, 5.0), (6.9, 6.9), (7.5, inf)]
)
def test_the_next_change_is_known(time_s: float, expected: float) -> None:
    assert wind.next_change(wind.Config(steps=[STEP], gusts=[GUST]), time_s) == expected


def test_a_step_that_ends_before_it_starts_is_refused() -> None:
    data = {"steps": [{"start_s": 2.0, "end_s": 1.0}]}
    with pytest.raises(BadInput, match=r"wind: steps.0: end_s must be later than start_s"):
        build(wind.Config, data, "wind")


def test_a_wind_step_appears_in_the_truth_at_its_time() -> None:
    step = wind.Step(start_s=0.5, east_m_s=10.0)
    block = fly(wind.Config(steps=[step]), 60)
    east = block["flight"][:, FLIGHT_INDEX["wind_east_m_s"]]
    beta = block["truth"][:, INDEX["angle_of_sideslip"]]
    assert np.abs(east[:50]).max() < 1e-9
    assert east[50:] == pytest.approx(10.0)
    # Air that moves to the right past an aircraft heading north comes from its left: beta < 0.
    assert abs(beta[49]) < 1e-4
    speed = block["flight"][50, FLIGHT_INDEX["velocity_north_m_s"]]
    assert beta[50] == pytest.approx(-np.arctan(10.0 / speed), rel=0.01)


def test_an_updraught_raises_the_angle_of_attack_as_the_geometry_says() -> None:
    gust = wind.Gust(start_s=0.0, duration_s=0.04, down_m_s=-5.0)
    block = fly(wind.Config(gusts=[gust]), 3)  # its peak is in frame 2
    alpha = block["truth"][:, INDEX["angle_of_attack"]]
    speed = block["flight"][0, FLIGHT_INDEX["true_airspeed_m_s"]]
    assert alpha[2] - alpha[0] == pytest.approx(np.arctan(5.0 / speed), rel=0.02)


def test_the_trim_holds_in_steady_wind_with_the_same_airspeed() -> None:
    calm = fly(wind.Config(), 1)
    windy = fly(wind.Config(north_m_s=-20.0, east_m_s=15.0), 300)
    flow = [INDEX["angle_of_attack"], INDEX["angle_of_sideslip"], INDEX["dynamic_pressure"]]
    assert windy["truth"][0, flow] == pytest.approx(calm["truth"][0, flow], rel=2e-3, abs=1e-6)
    north, east = (FLIGHT_INDEX[f"velocity_{axis}_m_s"] for axis in ("north", "east"))
    change = windy["flight"][0] - calm["flight"][0]
    assert change[[north, east]] == pytest.approx([-20.0, 15.0], abs=1e-6)
    drift = windy["truth"][-1] - windy["truth"][0]
    assert np.abs(drift[flow[:2]]).max() < 1e-3


@pytest.mark.parametrize(("level", "low", "high"), [("light", 0.05, 0.3), ("moderate", 1.0, 2.2)])
def test_turbulence_has_the_stated_size(level: wind.Turbulence, low: float, high: float) -> None:
    block = fly(wind.Config(), 6000, level)
    down = block["flight"][:, FLIGHT_INDEX["wind_down_m_s"]]
    assert low < down.std() < high


def test_turbulence_is_repeated_by_its_seed_alone() -> None:
    first, again, other = (fly(wind.Config(), 200, "severe", seed) for seed in (7, 7, 8))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()
