"""Signals lost for good: where control takes them from, that the switch is smooth, that the aircraft flies on."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from interpreted import printed
from test_control_flight import AIRCRAFT, DEGREE, NOISE, RATE_HZ, flight, sizes, truth

from rig.computer.control import backup_law as backup
from rig.computer.control import gains_file as gains
from rig.computer.control.autopilot import PARAM, Config, Control
from rig.computer.control.law_state import STATE
from rig.computer.control.source import put
from rig.core.frame import CHANNELS, DISCRETE_INDEX, INDEX, SIGNALS, Block, Law, S, Source, new_block
from rig.world.plant import airframe, wind
from rig.world.plant.jsbsim import Plant

ATTITUDE = ("pitch_angle", "roll_angle", "heading")
RATES = ("pitch_rate", "roll_rate", "yaw_rate")
LOSS = 500  # the frame
Q, PSI = INDEX["pitch_rate"], INDEX["heading"]


def fly(
    name: str,
    lost: tuple[str, ...],
    *,
    point: str | None = None,
    seconds: float = 25.0,
    bank: float = 0.0,
    reference: bool = False,
    poison: bool = False,
    config: Config | None = None,
    turbulence: wind.Turbulence = "light",
) -> Block:
    """Flown frames; ``lost`` signals have no channel from LOSS on, nor a reference unless ``reference``."""
    frame = airframe.read(AIRCRAFT / name / "aircraft.toml")
    plant = Plant(frame, frame.point(point), wind.Config(), turbulence, RATE_HZ, 1, 3)
    config = config or Config()
    control = Control(config, gains.read(AIRCRAFT / name / "gains.toml"), RATE_HZ, frame.surface_limits)
    control.reset(plant.trim)
    n = int(seconds * RATE_HZ)
    block, rng = new_block(n), np.random.default_rng(1)
    noise = 0.5 * sizes(NOISE) * rng.standard_normal((n, S))
    columns = [INDEX[signal] for signal in lost]
    block["level"] = CHANNELS
    block["level"][LOSS:, columns] = 0
    block["discrete_voted"][:, DISCRETE_INDEX["autopilot_engaged"]] = 1
    block["autopilot_command"][100:, 1] = bank
    for k in range(n):
        assert plant.read(block, k) == 0, f"departed {(k - LOSS) / RATE_HZ} s after the loss"
        row = block[k]
        row["voted"][:] = row["truth"] + noise[k]
        row["reference"][:] = row["voted"] if reference else np.nan
        row["reference_usable"][:] = reference
        if k >= LOSS:
            row["voted"][columns] = np.nan if poison else block["voted"][LOSS - 1, columns]
        kept = row["truth"].copy(), row["flight"].copy()
        if poison:
            row["truth"][:], row["flight"][:], row["channels"][:] = np.nan, np.nan, np.nan
        control.step(block, k)
        block["surface_command"][k] = block["surface"][k]
        row["truth"][:], row["flight"][:] = kept
        plant.step(block, k)
    return block


def held(block: Block) -> float:
    """The farthest from the altitude at the loss, m."""
    altitude = flight(block, "altitude_m")[LOSS:]
    return float(np.max(np.abs(altitude - altitude[0])))


@pytest.mark.parametrize(
    ("level", "usable", "reference", "expected"),
    [
        (4, 1, 0.2, Source.VOTED),
        (1, 0, np.nan, Source.VOTED),
        (0, 1, 0.2, Source.REFERENCE),
        (0, 0, 0.2, Source.DEGRADED),
        (0, 1, np.nan, Source.DEGRADED),
    ],
)
@pytest.mark.parametrize("signal", [signal.name for signal in SIGNALS])
def test_vote_then_reference_then_degraded_mode(
    signal: str, level: int, usable: int, reference: float, expected: Source
) -> None:
    block = trimmed(3)
    block["level"][1:, INDEX[signal]] = level
    block["reference"][1:, INDEX[signal]], block["reference_usable"][1:, INDEX[signal]] = reference, usable
    step_all(block)
    assert block["source"][1, INDEX[signal]] == expected
    assert (np.delete(block["source"][1], INDEX[signal]) == Source.VOTED).all()
    assert np.isfinite(block["surface"]).all() and np.isfinite(block["command"]).all()


@pytest.mark.parametrize(
    ("lost", "law"),
    [
        (("pitch_rate",), Law.AUTOPILOT),
        (ATTITUDE, Law.AUTOPILOT),
        (("pitch_rate", "heading"), Law.AUTOPILOT),
        (("pitch_rate", "pitch_angle"), Law.BACKUP),
        (("pitch_rate", "roll_angle"), Law.BACKUP),
    ],
)
def test_the_back_up_law_flies_when_no_pitch_rate_can_be_had(lost: tuple[str, ...], law: Law) -> None:
    block = trimmed(5)
    block["level"][2:, [INDEX[name] for name in lost]] = 0
    step_all(block)
    assert block["law"].tolist() == [Law.AUTOPILOT, Law.AUTOPILOT, law, law, law]


def test_the_back_up_law_hands_back_without_a_jump_when_the_signal_returns() -> None:
    block = trimmed(60)
    block["level"][10:40, [INDEX["pitch_rate"], INDEX["pitch_angle"]]] = 0
    block["voted"][:, Q] = 0.01
    step_all(block)
    assert block["law"][[9, 10, 39, 40]].tolist() == [Law.AUTOPILOT, Law.BACKUP, Law.BACKUP, Law.AUTOPILOT]
    elevator = block["surface"][:, 0]
    assert elevator[10] == elevator[9] and elevator[40] == elevator[39]


def test_a_jump_between_two_sources_is_taken_out_over_the_fade_the_short_way_round() -> None:
    param, state = np.zeros(1, PARAM), np.zeros(1, STATE)
    param["fade_frames"] = 50
    state["measured"][0, PSI] = 6.2
    out = []
    for _ in range(60):
        put(PSI, 0.1, int(Source.REFERENCE), param, state)
        out.append(float(state["measured"][0, PSI]))
    jump = 0.1 + 2 * np.pi - 6.2
    moved = (np.array(out) - 6.2) % (2 * np.pi)
    assert moved[0] == pytest.approx(0.0, abs=1e-12)
    assert moved[50:] == pytest.approx(jump)
    assert np.diff(moved)[:50] == pytest.approx(jump / 50)


@pytest.mark.parametrize("lost", [(signal.name,) for signal in SIGNALS] + [ATTITUDE, (*ATTITUDE, "pitch_rate")])
def test_no_surface_jumps_at_the_switch(lost: tuple[str, ...]) -> None:
    """In a turn with noise: the switch moves surfaces no more than the frames before it, or half a degree."""
    config = Config(lateral="roll")
    block = fly("f16", lost, seconds=5.1, bank=0.4, config=config)
    step = np.abs(np.diff(block["surface"][:, :3], axis=0))
    before = step[LOSS - 100 : LOSS - 1].max(axis=0)
    assert (step[LOSS - 1] <= np.maximum(1.5 * before, 0.5 * DEGREE)).all()


# Signals lost together, the law that then flies, and how far the altitude may go in 20 s of light turbulence.
FLOWN = [
    *(((signal.name,), Law.AUTOPILOT, 20.0) for signal in SIGNALS),
    (RATES, Law.AUTOPILOT, 20.0),
    (ATTITUDE, Law.AUTOPILOT, 20.0),
    (("static_pressure", "dynamic_pressure"), Law.AUTOPILOT, 20.0),
    (("angle_of_attack", "normal_load_factor"), Law.AUTOPILOT, 20.0),
    (("pitch_rate", *ATTITUDE), Law.BACKUP, 20.0),
    (("pitch_rate", *ATTITUDE, "normal_load_factor"), Law.BACKUP, 20.0),
    (("pitch_rate", *ATTITUDE, "angle_of_attack"), Law.BACKUP, 20.0),
    (("roll_rate", *ATTITUDE), Law.AUTOPILOT, 30.0),
]


# One loss of each kind and law is flown by the quick tests.
QUICK = (RATES, ATTITUDE, ("static_pressure", "dynamic_pressure"), ("pitch_rate", *ATTITUDE))


@pytest.mark.parametrize("name", ["f16", "b747"])
@pytest.mark.parametrize(
    ("lost", "law", "altitude"),
    [pytest.param(*case, marks=[] if case[0] in QUICK else [pytest.mark.long]) for case in FLOWN],
    ids=lambda x: "+".join(x) if isinstance(x, tuple) else "",
)
def test_the_aircraft_flies_on_without(name: str, lost: tuple[str, ...], law: Law, altitude: float) -> None:
    block = fly(name, lost)
    assert block["law"][-1] == law
    assert (block["source"][LOSS:, [INDEX[signal] for signal in lost]] == Source.DEGRADED).all()
    assert held(block) < altitude
    assert np.max(np.abs(truth(block, "normal_load_factor")[LOSS:] - 1.0)) < 0.5
    assert np.max(np.abs(truth(block, "roll_angle")[LOSS:])) < 15.0 * DEGREE


@pytest.mark.parametrize(
    "point", ["30000ft_m05", *(pytest.param(p, marks=pytest.mark.long) for p in ("20000ft_m08", "10000ft_m08"))]
)
@pytest.mark.parametrize(
    "lost", [("pitch_rate",), ("pitch_rate", *ATTITUDE), ("pitch_rate", *ATTITUDE, "normal_load_factor")]
)
def test_the_unstable_fighter_flies_on_without_pitch_rate_everywhere(point: str, lost: tuple[str, ...]) -> None:
    block = fly("f16", lost, point=point)
    assert held(block) < 25.0
    assert np.max(np.abs(truth(block, "pitch_angle")[LOSS:] - truth(block, "pitch_angle")[0])) < 4.0 * DEGREE


def test_the_back_up_law_carries_on_in_a_turn() -> None:
    config = Config(lateral="roll", rates_from_attitude=False)
    block = fly("f16", ("pitch_rate",), bank=0.5, config=config)
    assert block["law"][-1] == Law.BACKUP
    assert truth(block, "roll_angle")[LOSS:] == pytest.approx(0.5, abs=6.0 * DEGREE)
    assert held(block) < 20.0


def test_blind_in_pitch_the_unstable_fighter_departs_and_the_stable_airliner_does_not() -> None:
    lost = ("pitch_rate", *ATTITUDE, "normal_load_factor", "angle_of_attack")
    with pytest.raises(AssertionError, match="departed"):
        fly("f16", lost)
    assert fly("b747", lost)["law"][-1] == Law.BACKUP


def test_with_a_reference_the_law_stays_and_the_rate_is_taken_from_it() -> None:
    block = fly("f16", ("pitch_rate",), reference=True)
    assert (block["source"][LOSS:, Q] == Source.REFERENCE).all()
    assert (block["law"] == Law.AUTOPILOT).all()
    assert held(block) < 20.0


@pytest.mark.parametrize("lost", [("pitch_rate",), ("pitch_rate", *ATTITUDE), ("static_pressure", *RATES)])
def test_neither_truth_nor_the_held_vote_of_a_lost_signal_is_read(lost: tuple[str, ...]) -> None:
    clean, blind = fly("f16", lost, seconds=7.0), fly("f16", lost, seconds=7.0, poison=True)
    assert clean["surface"].tobytes() == blind["surface"].tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_any_losses_at_any_time_give_finite_surfaces_within_their_stops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    block = trimmed(600)
    block["voted"] += 0.02 * rng.standard_normal((600, S))
    for start in range(0, 600, 30):
        block["level"][start : start + 30] = np.where(rng.random(S) < 0.4, 0, CHANNELS)
    block["reference"] = np.where(rng.random((600, S)) < 0.3, np.nan, block["voted"])
    block["reference_usable"] = rng.random((600, S)) < 0.7
    block["discrete_voted"][200:400] = 0
    step_all(block)
    assert np.isfinite(block["surface"]).all() and np.isfinite(block["command"]).all()
    assert (np.abs(block["surface"]) <= 1.0).all()


def test_what_the_back_up_law_flies_on() -> None:
    param = np.zeros(1, PARAM)
    param["rates_from_attitude"] = 1
    source = np.zeros(S, np.uint8)
    found = []
    for name in ("heading", "pitch_rate", "pitch_angle", "normal_load_factor", "angle_of_attack"):
        source[INDEX[name]] = Source.DEGRADED
        found.append(backup.needed(source, param))
    assert found == [backup.NOT_NEEDED, backup.NOT_NEEDED, backup.LOAD, backup.ALPHA, backup.BLIND]


def trimmed(frames: int) -> Block:
    """Frames of level flight at 6000 m and Mach 0.6, autopilot engaged, all signals known."""
    block = new_block(frames)
    block["level"] = CHANNELS
    block["reference"] = np.nan
    voted = block["voted"]
    voted[:, INDEX["static_pressure"]], voted[:, INDEX["dynamic_pressure"]] = 47_181.0, 11_890.0
    voted[:, INDEX["angle_of_attack"]] = voted[:, INDEX["pitch_angle"]] = 0.05
    voted[:, INDEX["normal_load_factor"]], voted[:, PSI] = 1.0, 1.0
    block["discrete_voted"][:, DISCRETE_INDEX["autopilot_engaged"]] = 1
    return block


def step_all(block: Block) -> None:
    limits = [(-0.4, 0.4), (-0.35, 0.35), (-0.5, 0.5), (0.0, 1.0)]
    control = Control(Config(), gains.read(AIRCRAFT / "f16" / "gains.toml"), 100.0, limits)
    control.reset([0.01, -0.002, 0.003, 0.3])
    for k in range(len(block)):
        control.step(block, k)
        block["surface_command"][k] = block["surface"][k]


def digest() -> str:
    """Of a flight through every kind of loss."""
    rng = np.random.default_rng(7)
    block = trimmed(900)
    block["voted"] += 0.01 * rng.standard_normal((900, S))
    for i, lost in enumerate([*FLOWN[:: len(FLOWN) // 8], *FLOWN[-6:]]):
        block["level"][60 * i + 30 : 60 * i + 60, [INDEX[name] for name in lost[0]]] = 0
    block["reference"][:, ::2], block["reference_usable"] = 0.01, 1
    step_all(block)
    return hashlib.sha256(
        block["surface"].tobytes() + block["command"].tobytes() + block["source"].tobytes()
    ).hexdigest()


def test_compiled_and_plain_python_agree_bit_for_bit_when_signals_are_lost() -> None:
    program = "from test_control_lost import digest; print(digest())"
    assert printed(program, interpreted=True) == digest()
