"""Modes that discretes ask for: weight on wheels holds, gear down narrows the limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_control_autopilot import ENGAGED, fly, level_flight

from rig.computer.control.autopilot import Config
from rig.computer.control.modes import LATERAL, LAWS, SPEED, VERTICAL, Mode
from rig.core.frame import AUTOPILOT_COMMANDS, COMMANDS, DISCRETE_INDEX, INDEX, Block
from rig.core.units.constants import GRAVITY

ROOT = Path(__file__).parents[1]
WHEELS, GEAR = DISCRETE_INDEX["weight_on_wheels"], DISCRETE_INDEX["gear_down"]
INTEGRALS = [f"{name}_integral" for name in ("elevator", "aileron", "rudder", "throttle", "altitude")]


def command(block: Block, name: str) -> np.ndarray:
    return block["command"][:, COMMANDS.index(name)]


def disturbed(frames: int = 100, **voted: Any) -> Block:
    """Level flight in which every loop has an error that does not go away, from frame 10 on."""
    block = level_flight(frames)
    for name, error in {"pitch_rate": 0.02, "roll_rate": 0.03, "angle_of_sideslip": 0.01, **voted}.items():
        block["voted"][10:, INDEX[name]] += error
    block["autopilot_command"][10:, AUTOPILOT_COMMANDS.index("airspeed_m_s")] = 5.0
    return block


def integrals(block: Block) -> np.ndarray:
    state = fly(block).state[0]
    return np.array([state[name] for name in INTEGRALS])


def test_on_the_ground_every_integrator_stands_still():
    flown, landed, before = disturbed(), disturbed(), disturbed(20)
    landed["discrete_voted"][20:, WHEELS] = 1
    still, moving = integrals(landed), integrals(flown)
    assert (still == integrals(before)).all()
    assert (moving != still).all()


def test_on_the_ground_damping_stays():
    """A step of the pitch rate moves the elevator in its frame by as much as in the air but for the integral."""
    block = level_flight(60)
    block["discrete_voted"][20:, WHEELS] = 1
    block["voted"][40:, INDEX["pitch_rate"]] += 0.02
    fly(block)
    steps = np.diff(block["surface"][:, 0])
    assert steps[39] != 0.0 and (steps[40:] == 0.0).all()


def test_on_the_ground_the_outer_loops_hold_their_attitudes():
    block = level_flight(200)
    block["voted"][:, INDEX["roll_angle"]] = 0.1
    block["discrete_voted"][50:150, WHEELS] = 1
    block["autopilot_command"][60:, AUTOPILOT_COMMANDS.index("altitude_m")] = 200.0
    block["autopilot_command"][60:, AUTOPILOT_COMMANDS.index("heading_rad")] = 0.5
    fly(block)
    pitch, roll = command(block, "pitch_angle_rad"), command(block, "roll_angle_rad")
    assert (pitch[50:150] == pitch[49]).all() and (roll[50:150] == roll[49]).all()
    assert pitch[199] > pitch[49] + 0.005 and roll[199] > roll[49] + 0.1  # in the air both autopilot commands are flown


def test_leaving_the_ground_begins_the_path_where_the_aircraft_is():
    """200 m higher than it was held, pitched up: the altitude loop goes on from there without a jump."""
    block, off = level_flight(1_700), 1_500  # by then the estimate of the climb rate has forgotten the jump
    block["discrete_voted"][20:off, WHEELS] = 1
    block["voted"][20:, INDEX["static_pressure"]] -= 1_800.0
    block["voted"][20:, INDEX["pitch_angle"]] += 0.03
    block["voted"][20:, INDEX["angle_of_attack"]] += 0.03
    fly(block)
    assert command(block, "pitch_angle_rad")[off] == pytest.approx(0.08, abs=0.005)
    assert command(block, "pitch_angle_rad")[-1] < 0.0  # down to what is still asked


def test_an_engagement_on_the_ground_holds_the_attitude_of_that_moment():
    block = level_flight(60)
    block["discrete_voted"][:, WHEELS] = 1
    block["discrete_voted"][:30, ENGAGED] = 0
    block["voted"][20:, INDEX["pitch_angle"]] = 0.09
    fly(block)
    assert (command(block, "pitch_angle_rad")[30:] == 0.09).all()


def test_the_first_frame_on_the_ground_is_at_trim_and_holds_the_present_attitude():
    block = level_flight(30)
    block["discrete_voted"][:, WHEELS] = 1
    fly(block)
    assert (block["surface"] == block["surface"][0]).all()
    assert (
        command(block, "pitch_angle_rad")[-1] == command(block, "pitch_angle_rad")[0] == pytest.approx(0.05, abs=1e-3)
    )


@pytest.mark.parametrize(("down", "most"), [(0, 0.5236), (1, 0.4363)])
def test_with_the_gear_down_the_heading_is_flown_with_less_bank(down: int, most: float):
    block = level_flight(40)
    block["discrete_voted"][:, GEAR] = down
    block["autopilot_command"][10:, AUTOPILOT_COMMANDS.index("heading_rad")] = 2.0
    fly(block)
    assert command(block, "roll_angle_rad")[-1] == pytest.approx(most)
    fly(block, Config(max_bank_rad=0.2))
    assert command(block, "roll_angle_rad")[-1] == pytest.approx(0.2)


@pytest.mark.parametrize(("down", "most"), [(0, 1.0), (1, 0.4363)])
def test_with_the_gear_down_a_bank_that_is_asked_is_limited_too(down: int, most: float):
    for sign in (1.0, -1.0):
        block = level_flight(40)
        block["discrete_voted"][:, GEAR] = down
        block["autopilot_command"][10:, AUTOPILOT_COMMANDS.index("roll_angle_rad")] = sign
        fly(block, Config(lateral="roll"))
        assert command(block, "roll_angle_rad")[-1] == pytest.approx(sign * most)


@pytest.mark.parametrize(("stick", "load"), [(1.0, 2.0), (-1.0, 0.0)])
def test_with_the_gear_down_the_stick_asks_no_more_than_its_load_factors(stick: float, load: float):
    asked = {}
    for down in (0, 1):
        block = level_flight(30)
        block["discrete_voted"][:, ENGAGED], block["discrete_voted"][:, GEAR] = 0, down
        block["voted"][:, INDEX["stick_pitch"]] = stick
        state = fly(block).state[0]
        asked[down] = command(block, "pitch_rate_rad_s")[-1] * state["airspeed"] / GRAVITY + 1.0
    assert asked[1] == pytest.approx(load, abs=1e-6)
    assert abs(asked[0] - 1.0) > abs(load - 1.0) + 0.5


def test_the_backup_laws_integrator_stands_still_too():
    """Without a pitch rate and its substitutes the elevator flies on the load factor, which asks for more here."""
    moved = []
    for wheels in (0, 1):
        block = disturbed(200, normal_load_factor=0.2)
        for name in ("pitch_rate", "pitch_angle"):
            block["level"][50:, INDEX[name]] = 0
        block["reference"] = np.nan
        block["discrete_voted"][100:, WHEELS] = wheels
        shorter = block[:100].copy()
        moved.append(integrals(block)[0] - integrals(shorter)[0])
    assert moved[0] != 0.0 and moved[1] == 0.0


@pytest.mark.parametrize(
    ("key", "modes"), [("vertical", VERTICAL), ("lateral", LATERAL), ("speed", SPEED), ("law", LAWS)]
)
def test_every_mode_can_be_chosen_is_bounded_by_settings_and_stands_in_the_docs(key: str, modes: tuple[Mode, ...]):
    page = (ROOT / "docs" / "reference" / "control.md").read_text()
    for mode in modes:
        assert getattr(Config.model_validate({key: mode.name}), key) == mode.name
        assert set(mode.limits) <= Config.model_fields.keys()
        limits = ", ".join(f"`{limit}`" for limit in mode.limits)
        assert f'| `{key} = "{mode.name}"` | {mode.description} | {limits} |' in page
    with pytest.raises(ValueError, match=" or ".join(repr(mode.name) for mode in modes[-2:])):
        Config.model_validate({key: "level"})
