"""One step of the inertial unit's attitude against rotations: begin, turn, correct, the angles and what flows past."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from test_analytic_references import level_flight, ref, run

from rig.computer.analytic import inertial_unit as unit
from rig.computer.analytic import strapdown
from rig.computer.analytic.reference_sources import Config
from rig.computer.analytic.strapdown import LEVEL_S, LONG_S, level_gain, slope_gain
from rig.core.frame import INDEX, S
from rig.core.units.constants import TWO_PI

G, RATE = 9.80665, 100.0
SEEDS = range(5)
PHI, THETA, PSI = (INDEX[name] for name in ("roll_angle", "pitch_angle", "heading"))
LEVEL = 1 << PHI | 1 << THETA
Vector = NDArray[np.float64]


def state(turned: Rotation, frames: int = 5000, drift: Any = 0.0) -> Any:
    """A STATE record that has this attitude, body to north-east-down."""
    e = np.zeros(1, strapdown.STATE)[0]
    e["q"], e["frames"], e["drift"], e["oriented"] = np.roll(turned.as_quat(), 1), frames, drift, 1
    return e


def attitude_of(e: Any) -> Rotation:
    return Rotation.from_quat(np.roll(e["q"], -1))


def drawn(seed: int) -> tuple[np.random.Generator, Rotation, Vector]:
    """Any attitude, and what the unit says: rates, velocity, specific force."""
    rng = np.random.default_rng(seed)
    phi, theta, psi = rng.uniform(-1.2, 1.2, 3)
    said = np.concatenate([rng.uniform(-0.8, 0.8, 3), rng.uniform(-90.0, 90.0, 3), rng.uniform(-15.0, 15.0, 3)])
    return rng, Rotation.from_euler("ZYX", [psi, theta, phi]), said


@pytest.mark.parametrize("seed", SEEDS)
def test_it_begins_with_the_agreed_attitude(seed: int):
    _, turned, said = drawn(seed)
    psi, theta, phi = turned.as_euler("ZYX")
    votes = np.zeros(S)
    votes[[PHI, THETA, PSI]] = phi, theta, psi
    e = state(Rotation.identity(), frames=0, drift=0.003)
    strapdown.begin(said, votes, LEVEL | 1 << PSI, RATE, e)
    assert (attitude_of(e).inv() * turned).magnitude() < 1e-9
    assert (e["drift"] == 0.0).all() and e["frames"] == 5.0 * RATE and e["oriented"] == 1


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("agreed", [0, 1 << PHI, 1 << THETA])
def test_else_it_begins_level_by_its_accelerometers_without_a_heading(seed: int, agreed: int):
    _, turned, said = drawn(seed)
    _, theta, phi = turned.as_euler("ZYX")
    said[6:] = turned.inv().apply([0.0, 0.0, -G])
    e = state(Rotation.identity(), frames=0)
    strapdown.begin(said, np.full(S, 0.3), agreed, RATE, e)
    assert attitude_of(e).as_euler("ZYX") == pytest.approx([0.0, theta, phi])
    assert e["oriented"] == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_it_turns_by_the_mean_rates_of_two_frames_less_the_drift(seed: int):
    rng, turned, said = drawn(seed)
    last, drift = said + rng.uniform(-0.2, 0.2, 9), rng.uniform(-0.005, 0.005, 3)
    e = state(turned, drift=drift)
    strapdown.turn(said, last, RATE, e)
    expected = turned * Rotation.from_rotvec((0.5 * (said + last)[:3] - drift) / RATE)
    assert (attitude_of(e).inv() * expected).magnitude() < 1e-6
    assert np.linalg.norm(e["q"]) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("frames", "force"), [(501, 1.0), (3000, 0.1), (5999, 1.0), (40_000, 1.0)])
def test_it_is_corrected_by_the_small_rotation_between_the_two_forces(seed: int, frames: int, force: float):
    """The level part of f x s and the heading's part, in north-east-down, each with its own memory."""
    rng, turned, said = drawn(seed)
    said[6:] *= force
    around, pull = rng.uniform(-0.05, 0.05), rng.uniform(-5.0, 5.0, 3)
    last = said.copy()
    last[3:6] -= pull / RATE
    e = state(turned, frames=frames)
    strapdown.correct(said, last, around, RATE, e)
    measured, asked = turned.apply(said[6:]), pull - np.array([0.0, 0.0, G])
    off = np.cross(measured, asked) / max(said[6:] @ said[6:], G * G) * np.array([1.0, 1.0, 0.0])
    level, long = min(frames, LEVEL_S * RATE), min(frames - 480.0, LONG_S * RATE)
    by = level_gain(level) * off + np.array([0.0, 0.0, level_gain(long) * around])
    w, x, y, z = np.roll(turned.as_quat(), 1)
    turn = 0.5 * np.array([-by @ [x, y, z], *(w * by + np.cross(by, [x, y, z]))])
    assert e["q"] == pytest.approx(np.array([w, x, y, z]) + turn, abs=1e-12)
    of_level = turned.inv().apply(slope_gain(level) * RATE * off) * np.array([1.0, 1.0, 0.0])
    of_heading = turned.inv().apply([0.0, 0.0, slope_gain(long) * RATE * around])
    assert e["drift"] == pytest.approx(np.clip(-of_level - of_heading, -0.005, 0.005), abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_its_angles_are_those_of_its_attitude_led_at_the_present_rates(seed: int):
    rng, turned, said = drawn(seed)
    drift, lead_s, out = rng.uniform(-0.005, 0.005, 3), 1e-4, np.zeros(3)
    e = state(turned, drift=drift)
    strapdown.angles(said, lead_s, e, out)
    psi, theta, phi = turned.as_euler("ZYX")
    assert e["angles"] == pytest.approx([phi, theta, psi])
    ahead = turned * Rotation.from_rotvec((said[:3] - drift) * lead_s)
    psi, theta, phi = ahead.as_euler("ZYX")
    assert out == pytest.approx([phi, theta, psi % TWO_PI], abs=1e-7)


def test_looking_straight_up_its_lead_is_bounded():
    out = np.zeros(3)
    e = state(Rotation.from_euler("ZYX", [0.0, 0.5 * math.pi, 0.0]))
    strapdown.angles(np.array([0.0, 0.3, 0.4, *[0.0] * 6]), 0.01, e, out)
    assert e["angles"][1] == pytest.approx(0.5 * math.pi, abs=1e-6) and np.isfinite(out).all()
    assert abs(out[1] - e["angles"][1]) < 0.01


@pytest.mark.parametrize(("off", "counted"), [(0.19, 0.19), (-0.19, -0.19), (0.21, 0.0), (-0.21, 0.0)])
def test_a_heading_is_learned_from_within_a_fifth_of_a_radian_the_short_way_round(off: float, counted: float):
    e, votes = state(Rotation.identity()), np.zeros(S)
    e["angles"][2], votes[PSI] = 0.05, (0.05 + off) % TWO_PI
    assert strapdown.heading_off(votes, 1 << PSI, e) == pytest.approx(counted)
    assert strapdown.heading_off(votes, LEVEL, e) == 0.0


@pytest.mark.parametrize("angle", [0, 1, 2])
def test_half_a_minute_far_from_an_agreed_vote_the_memory_begins_again(angle: int):
    e, votes = state(Rotation.identity()), np.zeros(S)
    votes[(PHI, THETA, PSI)[angle]] = 0.21
    lost = [strapdown.lost_its_way(votes, LEVEL | 1 << PSI, RATE, e) for _ in range(3000)]
    assert not any(lost[:-1]) and lost[-1]
    assert not strapdown.lost_its_way(votes, 0, RATE, e) and e["astray"] == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_what_flows_past_is_the_velocity_in_body_axes(seed: int):
    _, turned, said = drawn(seed)
    psi, theta, phi = turned.as_euler("ZYX")
    forward, right, down = turned.inv().apply(said[3:6])
    out = np.zeros(2)
    unit.flow_angles(said, np.array([phi, theta, psi]), out)
    assert out == pytest.approx([math.atan2(down, forward), math.asin(right / np.linalg.norm(said[3:6]))])


@pytest.mark.parametrize("chosen", ["pitch_angle", "angle_of_attack"])
def test_its_attitude_and_flow_become_the_references_of_the_signals_that_choose_it(chosen: str):
    """One signal that has it is enough."""
    turned = Rotation.from_euler("ZYX", [1.0, 0.1, 0.2])
    block = level_flight(20, roll_angle=0.2, pitch_angle=0.1, heading=1.0)
    block["inertial"] = np.concatenate([np.zeros(3), [100.0, 80.0, 5.0], turned.inv().apply([0.0, 0.0, -G])])
    flow = turned.inv().apply([100.0, 80.0, 5.0])
    expected = {"pitch_angle": 0.1, "angle_of_attack": math.atan2(flow[2], flow[0])}[chosen]
    none: dict[str, Any] = dict.fromkeys(
        ("pitch_angle", "roll_angle", "heading", "angle_of_attack", "angle_of_sideslip"), "none"
    )
    said = run(block, Config(**{**none, chosen: "inertial", "inertial_lead_s": 0.0}))
    assert ref(said, chosen) == pytest.approx(np.full(20, expected), abs=1e-9)
