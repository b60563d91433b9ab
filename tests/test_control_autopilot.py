"""The stage: what it reads, how it starts, how it changes over, what it does at the stops."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from interpreted import printed

from rig.computer.control import gains_file as gains
from rig.computer.control.autopilot import Config, Control
from rig.core.frame import (
    AUTOPILOT_COMMANDS,
    CHANNELS,
    COMMANDS,
    DISCRETE_INDEX,
    INDEX,
    SIGNALS,
    SURFACES,
    Block,
    Law,
    S,
    new_block,
)

AIRCRAFT = Path(__file__).parent.parent / "aircraft"
LIMITS = [(-0.4, 0.4), (-0.35, 0.35), (-0.5, 0.5), (0.0, 1.0)]
TRIM = np.array([0.01, -0.002, 0.003, 0.3])
ENGAGED = DISCRETE_INDEX["autopilot_engaged"]


def level_flight(frames: int, noise: float = 0.0, seed: int = 0) -> Block:
    """Frames of level flight at 6000 m and Mach 0.6, autopilot engaged."""
    block = new_block(frames)
    block["level"] = CHANNELS
    voted = block["voted"]
    voted[:, INDEX["static_pressure"]] = 47_181.0
    voted[:, INDEX["dynamic_pressure"]] = 11_890.0
    voted[:, INDEX["angle_of_attack"]] = voted[:, INDEX["pitch_angle"]] = 0.05
    voted[:, INDEX["normal_load_factor"]] = 1.0
    voted[:, INDEX["heading"]] = 1.0
    voted += noise * np.random.default_rng(seed).standard_normal((frames, S))
    block["discrete_voted"][:, ENGAGED] = 1
    return block


def fly(block: Block, config: Config | None = None) -> Control:
    control = Control(config or Config(), gains.read(AIRCRAFT / "f16" / "gains.toml"), 100.0, LIMITS)
    control.reset(TRIM)
    for k in range(len(block)):
        control.step(block, k)
    return control


@pytest.mark.parametrize("engaged", [0, 1])
def test_the_first_output_is_the_trim(engaged: int) -> None:
    block = level_flight(1, noise=0.01)
    block["discrete_voted"][:, ENGAGED] = engaged
    fly(block)
    assert (block["surface"][0] == TRIM).all()
    assert block["law"][0] == (Law.AUTOPILOT if engaged else Law.STICK)


def test_engaging_and_disengaging_do_not_move_the_surfaces() -> None:
    block = level_flight(300, noise=0.002)
    block["voted"][:, INDEX["roll_angle"]] += 0.4  # banked, so that the two laws disagree
    block["discrete_voted"][:100, ENGAGED] = block["discrete_voted"][200:, ENGAGED] = 0
    fly(block)
    for k in (100, 200):
        assert (block["surface"][k] == block["surface"][k - 1]).all()
        assert block["law"][k] != block["law"][k - 1]


def test_what_is_held_is_what_was_flown_at_engagement_plus_the_command() -> None:
    block = level_flight(50)
    block["discrete_voted"][:20, ENGAGED] = 0
    block["voted"][:20, INDEX["heading"]] = 6.2
    block["voted"][20:, INDEX["heading"]] = 6.25
    block["autopilot_command"][30:, AUTOPILOT_COMMANDS.index("heading_rad")] = 0.1
    block["autopilot_command"][30:, AUTOPILOT_COMMANDS.index("altitude_m")] = 100.0
    fly(block)
    heading, altitude = (block["command"][:, COMMANDS.index(name)] for name in ("heading_rad", "altitude_m"))
    assert heading[25] == 6.25
    assert heading[40] == pytest.approx(6.35 - 2 * np.pi)
    assert altitude[40] - altitude[25] == pytest.approx(100.0)
    bank = block["command"][40, COMMANDS.index("roll_angle_rad")]
    assert 0.0 < bank < 0.6  # to the right, through north


def test_neither_truth_nor_the_flight_condition_is_read() -> None:
    clean, poisoned = level_flight(200, noise=0.01), level_flight(200, noise=0.01)
    for field in ("truth", "flight", "channels", "reference"):
        poisoned[field] = np.nan
    poisoned["discrete_truth"] = 1
    fly(clean)
    fly(poisoned)
    for field in ("surface", "command", "law"):
        assert (clean[field] == poisoned[field]).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_signal_that_is_no_number_keeps_its_last_value(value: float) -> None:
    broken, held = level_flight(100, noise=0.005), level_flight(100, noise=0.005)
    column = INDEX["pitch_rate"]
    broken["voted"][50:, column] = value
    held["voted"][50:, column] = held["voted"][49, column]
    fly(broken)
    fly(held)
    assert (broken["surface"] == held["surface"]).all()


def test_without_any_number_the_surfaces_stay_at_trim() -> None:
    block = level_flight(20)
    block["voted"] = np.nan
    block["autopilot_command"] = np.nan
    fly(block)
    assert (block["surface"] == TRIM).all()
    assert np.isfinite(block["command"]).all()


@pytest.mark.parametrize("seed", range(4))
def test_any_signals_within_and_beyond_their_ranges_give_surfaces_within_their_stops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    block = level_flight(400)
    span = np.array([max(-signal.low, signal.high) for signal in SIGNALS])
    block["voted"] = rng.normal(size=(400, S)) * span
    block["voted"][rng.random((400, S)) < 0.1] = rng.choice([np.nan, np.inf, 1e300, -1e300])
    block["autopilot_command"] = rng.normal(size=(400, len(AUTOPILOT_COMMANDS))) * 1e3
    block["discrete_voted"][:, ENGAGED] = rng.random(400) < 0.5
    fly(block)
    low, high = np.array(LIMITS).T
    assert np.isfinite(block["surface"]).all() and np.isfinite(block["command"]).all()
    assert (block["surface"] >= low).all() and (block["surface"] <= high).all()


def test_after_minutes_at_the_stop_the_elevator_comes_back_within_a_second() -> None:
    block = level_flight(12_100)
    block["discrete_voted"][:, ENGAGED] = 0
    block["voted"][:12_000, INDEX["pitch_rate"]] = -0.5  # a nose that drops whatever the elevator does
    block["voted"][12_000:, INDEX["pitch_rate"]] = 0.5
    fly(block)
    elevator = block["surface"][:, SURFACES.index("elevator_rad")]
    assert elevator[11_999] == LIMITS[0][0]
    assert elevator[12_099] > elevator[11_999] + 0.3


def test_sticks_command_rates_with_the_signs_of_the_pilot() -> None:
    block = level_flight(3)
    block["discrete_voted"][:, ENGAGED] = 0
    for name in ("stick_pitch", "stick_roll", "pedal"):
        block["voted"][:, INDEX[name]] = 0.5
    fly(block)
    pitch, roll, sideslip = block["command"][2, :3]
    assert pitch > 0 and roll > 0 and sideslip < 0
    most = gains.read(AIRCRAFT / "f16" / "gains.toml").max_load_factor
    assert pitch == pytest.approx(0.5 * (most - 1.0) * 9.80665 / 189.7, rel=0.02)


def test_the_stick_cannot_pull_beyond_the_alpha_limit() -> None:
    block = level_flight(3)
    block["discrete_voted"][:, ENGAGED] = 0
    block["voted"][:, INDEX["stick_pitch"]] = 1.0
    limit = gains.read(AIRCRAFT / "f16" / "gains.toml").max_alpha_rad
    block["voted"][:, INDEX["angle_of_attack"]] = limit + 0.01
    fly(block)
    assert block["command"][2, 0] < 0.0


def test_a_copy_of_the_state_flies_on_alike() -> None:
    block = level_flight(200, noise=0.01)
    control = fly(block[:100])
    baseline = Control(Config(), gains.read(AIRCRAFT / "f16" / "gains.toml"), 100.0, LIMITS)
    baseline.state[:] = control.state
    again = block.copy()
    for k in range(100, 200):
        control.step(block, k)
        baseline.step(again, k)
    assert (block["surface"] == again["surface"]).all()


def digest() -> str:
    """Of all outputs of a rough flight through both laws."""
    block = level_flight(600, noise=0.02, seed=5)
    block["voted"][:, INDEX["static_pressure"]] -= np.linspace(0.0, 30_000.0, 600)  # through the tropopause
    block["discrete_voted"][200:400, ENGAGED] = 0
    fly(block)
    return hashlib.sha256(block["surface"].tobytes() + block["command"].tobytes()).hexdigest()


def test_compiled_and_plain_python_agree_bit_for_bit() -> None:
    program = "from test_control_autopilot import digest; print(digest())"
    assert printed(program, interpreted=True) == digest()
