"""References against the equations of motion, their partners, and whole flights."""

from __future__ import annotations

import copy
import hashlib
import math
from typing import Any

import numpy as np
import pytest
from interpreted import printed
from one_stage import refer, remember

from rig.computer.analytic.designed import Designed, Error, Point
from rig.computer.analytic.reference_sources import FROM_UNIT, PARTNERS, REMEMBERED, Config, source
from rig.computer.analytic.references import STATE, References, look_back
from rig.computer.redundancy import measured_thresholds
from rig.computer.redundancy.manager_config import parameters
from rig.core.frame import INDEX, INERTIAL, SIGNALS, Block, DecidedBy, Pattern, State, new_block
from rig.core.units.atmosphere import air_density
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.world.sensors import channels, ranges

G, RATE = 9.80665, 100.0
DENSITY = 1.225
SPEED = 150.0
PRESSURE = 0.5 * DENSITY * SPEED**2
WING: dict[str, float] = {
    "dynamic_pressure_pa": PRESSURE,
    "lift_slope_1_pa": 1e-3,
    "zero_lift_alpha_rad": -0.02,
    "pitch_rate_gain": 1.0,
    "elevator_arm_m": 0.0,
    "side_slope_1_pa": -3e-4,
    "roll_arm_m": 0.0,
    "yaw_arm_m": 0.0,
    "alpha_filter_s": 0.1,
    "attitude_filter_s": 0.05,
    "acceleration_filter_s": 0.05,
    "unit_filter_s": 0.02,
}
LEVEL_ALPHA = 1.0 / (PRESSURE * 1e-3) - 0.02
BY_PARTNERS = Config(
    pitch_rate="angle_of_attack",
    roll_rate="attitude",
    normal_load_factor="angle_of_attack",
    lateral_load_factor="angle_of_sideslip",
    pitch_angle="kinematic",
)
BY_ATTITUDE = BY_PARTNERS.model_copy(update={"pitch_rate": "attitude"})
ALL_INERTIAL = Config(pitch_rate="inertial", roll_rate="inertial", yaw_rate="inertial", inertial_lead_s=0.0)


def designed(accelerometer: tuple[float, ...] = (0.0, 0.0, 0.0), errors: Any = None, **wing: float) -> Designed:
    x, y, z = accelerometer
    place = {"accelerometer_x_m": x, "accelerometer_y_m": y, "accelerometer_z_m": z}
    points = [Point(name="one", **{**WING, **wing})]
    return Designed.model_validate({"rate_hz": RATE, "points": points, "errors": errors or {}, **place})


def level_flight(n: int = 300, **votes: Any) -> Block:
    """Voted rows at sea level and 150 m/s; a value may be an array over the frames."""
    block = new_block(n)
    block["level"] = 4
    given = {"static_pressure": 101_325.0, "dynamic_pressure": PRESSURE, "angle_of_attack": LEVEL_ALPHA}
    for name, value in {**given, "normal_load_factor": 1.0, **votes}.items():
        block["voted"][:, INDEX[name]] = value
    return block


def run(block: Block, config: Config | None = None, **design: Any) -> Block:
    stage = References(config or BY_PARTNERS, designed(**design), RATE)
    for k in range(len(block)):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
    return block


def ref(block: Block, name: str) -> np.ndarray:
    return block["reference"][:, INDEX[name]]


def lifting(load: float) -> float:
    """The angle of attack that gives this load factor across the path."""
    return load / (PRESSURE * 1e-3) - 0.02


# Pitch rate from the angle of attack


@pytest.mark.requirement("references", "pitch rate by the lead filter: steady pull-up, turn, ramp")
@pytest.mark.parametrize("q", [-0.05, 0.0, 0.1])
def test_in_a_steady_pull_up_it_is_the_turning_of_the_path(q: float):
    """At the bottom the path is level: n_w = 1 + V q / g, and pitch attitude equals angle of attack."""
    alpha = lifting(1.0 + SPEED * q / G)
    out = ref(run(level_flight(angle_of_attack=alpha, pitch_angle=alpha)), "pitch_rate")
    assert out == pytest.approx(q, rel=1e-5, abs=1e-12)  # the density is that of the standard to six digits


@pytest.mark.requirement("references", "pitch rate by the lead filter: steady pull-up, turn, ramp")
@pytest.mark.parametrize("bank", [-1.0, 0.5, 1.2])
def test_in_a_level_turn_it_is_that_of_the_turn(bank: float):
    """n = 1 / cos(bank), q = g / V tan(bank) sin(bank); the wing is set so that alpha is zero there."""
    load = 1.0 / math.cos(bank)
    block = level_flight(angle_of_attack=0.0, roll_angle=bank, yaw_rate=G / SPEED * math.sin(bank))
    out = ref(run(block, zero_lift_alpha_rad=-load / (PRESSURE * 1e-3)), "pitch_rate")
    assert out == pytest.approx(G / SPEED * math.tan(bank) * math.sin(bank), rel=1e-5)


@pytest.mark.requirement("references", "pitch rate by the lead filter: steady pull-up, turn, ramp")
def test_a_ramp_in_alpha_is_a_pitch_rate_once_the_filter_has_settled():
    """Wings vertical and almost without lift, nothing but alpha_dot is left."""
    ramp = 0.1 * np.arange(300) / RATE
    block = level_flight(angle_of_attack=ramp, roll_angle=math.pi / 2)
    out = ref(run(block, lift_slope_1_pa=1e-12), "pitch_rate")
    assert out[-1] == pytest.approx(0.1, rel=1e-8)
    rise = 1.0 - np.exp(-(np.arange(300) - 1) / RATE / 0.1)  # the vote of frame k counts in frame k + 1
    assert np.allclose(out[1:], 0.1 * rise[1:], atol=1e-9)


def test_rolling_with_sideslip_is_taken_for_what_it_is():
    """alpha_dot = q - p tan(beta) at small alpha: with alpha held, q = p tan(beta)."""
    alpha = lifting(1.0)
    block = level_flight(angle_of_sideslip=0.1, roll_rate=1.0, pitch_angle=alpha)
    expected = math.cos(alpha) * math.tan(0.1)
    assert ref(run(block), "pitch_rate")[-1] == pytest.approx(expected, abs=1e-12)


def test_its_gain_divides_all_of_it():
    alpha = lifting(1.5)
    block = level_flight(angle_of_attack=alpha, pitch_angle=alpha)
    once, twice = (ref(run(block.copy(), pitch_rate_gain=k), "pitch_rate")[-1] for k in (1.0, 2.0))
    assert once == pytest.approx(2.0 * twice)


# Rates from attitude


@pytest.mark.requirement("references", "rates from attitude, the short way round")
def test_steady_rolling_is_the_roll_rate_also_through_inverted():
    phi = (0.8 * np.arange(1000) / RATE + math.pi) % (2 * math.pi) - math.pi
    out = ref(run(level_flight(1000, roll_angle=phi)), "roll_rate")
    assert np.allclose(out[100:], 0.8, atol=1e-6)


@pytest.mark.requirement("references", "rates from attitude, the short way round")
@pytest.mark.parametrize(("bank", "pitch"), [(0.0, 0.0), (0.6, 0.2), (-0.9, -0.3)])
def test_a_steady_turn_gives_all_three_rates_also_through_north(bank: float, pitch: float):
    psi = (6.0 + 0.1 * np.arange(1000) / RATE) % (2 * math.pi)
    block = run(level_flight(1000, heading=psi, roll_angle=bank, pitch_angle=pitch), BY_ATTITUDE)
    assert np.allclose(ref(block, "pitch_rate")[100:], 0.1 * math.cos(pitch) * math.sin(bank), atol=1e-9)
    assert np.allclose(ref(block, "roll_rate")[100:], -0.1 * math.sin(pitch), atol=1e-9)
    assert np.allclose(ref(block, "yaw_rate")[100:], 0.1 * math.cos(pitch) * math.cos(bank), atol=1e-9)


def test_pitching_in_a_bank_shows_as_pitch_and_yaw_rate():
    theta = 0.1 * np.arange(300) / RATE
    block = run(level_flight(pitch_angle=theta, roll_angle=0.5), BY_ATTITUDE)
    assert ref(block, "pitch_rate")[-1] == pytest.approx(0.1 * math.cos(0.5), abs=1e-9)
    assert ref(block, "yaw_rate")[-1] == pytest.approx(-0.1 * math.sin(0.5), abs=1e-9)


@pytest.mark.requirement("references", "rates from attitude, the short way round")
def test_a_loop_through_inverted_flight_is_a_steady_pitch_rate():
    """Over the top of a loop roll angle and heading jump by half a turn, the pitch angle turns back."""
    turned = 1.0 + 0.2 * np.arange(500) / RATE
    over = turned > math.pi / 2
    votes = {
        "pitch_angle": np.where(over, math.pi - turned, turned),
        "roll_angle": np.where(over, math.pi, 0.0),
        "heading": np.where(over, math.pi, 0.0),
    }
    out = ref(run(level_flight(500, **votes), BY_ATTITUDE), "pitch_rate")
    near = np.abs(turned - math.pi / 2) < math.pi / 2 - 1.25  # 0.05 rad on either side for the filter's lag
    assert np.isnan(out[np.abs(turned - math.pi / 2) < 0.2]).all()
    assert np.allclose(out[60:][~near[60:]], 0.2, atol=1e-4)


@pytest.mark.requirement("references", "pitch rate from attitude: gusts leave it alone, it settles a 2:2")
def test_a_gust_does_not_move_the_pitch_rate_from_attitude():
    gust = np.where(np.arange(300) < 100, LEVEL_ALPHA, LEVEL_ALPHA + 0.05)
    calm, moved = level_flight(), level_flight(angle_of_attack=gust)
    assert np.abs(ref(run(moved), "pitch_rate")).max() > 0.3  # the filter's first step: 0.05 rad over 0.1 s
    assert ref(run(moved, BY_ATTITUDE), "pitch_rate").tobytes() == ref(run(calm, BY_ATTITUDE), "pitch_rate").tobytes()


def test_near_the_vertical_attitude_says_nothing_and_the_others_go_on():
    block = run(level_flight(pitch_angle=1.4))
    assert np.isnan(ref(block, "roll_rate")[1:]).all() and np.isnan(ref(block, "yaw_rate")[1:]).all()
    assert np.isfinite(ref(block, "pitch_rate")).all()


@pytest.mark.parametrize(("pitch", "says"), [(1.29, True), (-1.29, True), (1.31, False), (-1.31, False)])
def test_attitude_says_nothing_from_75_degrees_on(pitch: float, says: bool):
    block = run(level_flight(pitch_angle=pitch), BY_ATTITUDE)
    for name in ("pitch_rate", "roll_rate", "yaw_rate"):
        assert np.isfinite(ref(block, name)[1:]).all() == says


def test_the_inertial_unit_speaks_in_any_attitude_and_from_the_first_frame_on():
    block = level_flight(pitch_angle=1.4)
    block["inertial"][:, :3] = (0.1, 0.2, 0.3)
    led = Config(pitch_rate="inertial", roll_rate="inertial", yaw_rate="inertial", inertial_lead_s=0.05)
    out = run(block, led)
    for name, rate in (("roll_rate", 0.1), ("pitch_rate", 0.2), ("yaw_rate", 0.3)):
        assert ref(out, name) == pytest.approx(np.full(300, rate))


def test_losing_one_signal_leaves_the_filters_of_the_others_as_they_are():
    block = level_flight(roll_angle=0.2 * np.arange(300) / RATE)
    block["level"][150:160, INDEX["angle_of_attack"]] = 0
    assert ref(run(block), "roll_rate")[100:] == pytest.approx(np.full(200, 0.2))


def test_a_dynamic_pressure_below_zero_is_a_slow_flight():
    block = run(level_flight(dynamic_pressure=-0.9))
    assert np.isfinite(ref(block, "pitch_rate")).all()


# Load factors and air data


@pytest.mark.requirement("references", "load factor, angle of attack, sideslip, at the accelerometers' place")
def test_alpha_and_load_factor_are_each_others_inverse():
    for alpha in (-0.1, 0.05, 0.25):
        block = run(level_flight(angle_of_attack=alpha, longitudinal_load_factor=0.2))
        load = ref(block, "normal_load_factor")[-1]
        across = load * math.cos(alpha) - 0.2 * math.sin(alpha)
        assert across == pytest.approx(PRESSURE * 1e-3 * (alpha + 0.02))
        back = run(level_flight(normal_load_factor=load, longitudinal_load_factor=0.2))
        assert ref(back, "angle_of_attack")[-1] == pytest.approx(alpha, abs=1e-9)


@pytest.mark.requirement("references", "load factor, angle of attack, sideslip, at the accelerometers' place")
def test_the_accelerometers_place_counts():
    """Five metres ahead, a pitch acceleration of 0.4 rad/s2 adds 0.4 * 5 / g."""
    q = 0.4 * np.arange(300) / RATE
    block = run(level_flight(pitch_rate=q), accelerometer=(5.0, 0.0, 0.0))
    here = run(level_flight(pitch_rate=q))
    assert (ref(block, "normal_load_factor") - ref(here, "normal_load_factor"))[-1] == pytest.approx(0.4 * 5.0 / G)
    less = 0.4 * 5.0 / G / (PRESSURE * 1e-3) * math.cos(LEVEL_ALPHA)
    assert (ref(here, "angle_of_attack") - ref(block, "angle_of_attack"))[-1] == pytest.approx(less, rel=1e-2)


def test_elevator_and_pitching_add_to_the_lift():
    q = 0.4 * np.arange(300) / RATE
    more = run(level_flight(pitch_rate=q), elevator_arm_m=3.0, pitch_rate_gain=0.9)
    plain = run(level_flight(pitch_rate=q))
    added = (SPEED * 0.1 * q[-2] - 3.0 * 0.4) / G / math.cos(LEVEL_ALPHA)
    assert (ref(more, "normal_load_factor") - ref(plain, "normal_load_factor"))[-1] == pytest.approx(added, rel=1e-6)


@pytest.mark.requirement("references", "load factor, angle of attack, sideslip, at the accelerometers' place")
def test_sideslip_is_the_side_force_at_the_centre_of_gravity():
    """n_y = q_bar slope beta, and 4 metres ahead a yaw acceleration on top; the rudder's arm takes part of it."""
    r = -0.3 * np.arange(300) / RATE
    n_y = PRESSURE * -3e-4 * 0.05 + (4.0 - 1.5) * -0.3 / G
    block = level_flight(lateral_load_factor=n_y, yaw_rate=r)
    out = ref(run(block, accelerometer=(4.0, 0.0, 0.0), yaw_arm_m=-1.5), "angle_of_sideslip")
    assert out[-1] == pytest.approx(0.05, abs=1e-6)


def test_dynamic_pressure_is_that_of_the_speed_over_ground():
    block = level_flight()
    block["inertial"][:, 3:6] = (90.0, 120.0, 0.0)
    assert ref(run(block), "dynamic_pressure") == pytest.approx(PRESSURE, rel=1e-4)


@pytest.mark.parametrize(
    ("pressure", "density"), [(101_325.0, 1.2250), (54_019.9, 0.73612), (22_632.0, 0.36391), (12_044.6, 0.19367)]
)
def test_density_is_that_of_the_standard_atmosphere(pressure: float, density: float):
    """0, 5, 11 and 15 km of the published tables (ISO 2533)."""
    assert air_density(pressure) == pytest.approx(density, rel=1e-4)


# The inertial unit


def test_the_units_rates_are_read_in_their_own_frame():
    block = level_flight()
    block["inertial"][:, 0], block["inertial"][:, 1], block["inertial"][:, 2] = 0.3, 0.1, -0.2
    run(block, ALL_INERTIAL)
    assert [ref(block, name)[-1] for name in ("roll_rate", "pitch_rate", "yaw_rate")] == [0.3, 0.1, -0.2]


def test_the_lead_makes_up_for_the_units_lag():
    block = level_flight()
    late = 0.5 * (np.arange(300) / RATE - 0.02)
    block["inertial"][:, INERTIAL.index("pitch_rate_rad_s")] = late
    run(block, Config(pitch_rate="inertial", inertial_lead_s=0.02))
    assert ref(block, "pitch_rate")[1:] == pytest.approx(0.5 * np.arange(1, 300) / RATE, abs=1e-12)


# What is read, and what is not

CHOICES = [BY_PARTNERS, BY_ATTITUDE, Config(pitch_rate="inertial", roll_rate="inertial", yaw_rate="inertial")]


def busy(n: int = 120) -> Block:
    """Rows in which everything moves."""
    t = np.arange(n) / RATE
    names = [signal.name for signal in SIGNALS if signal.name not in ("static_pressure", "dynamic_pressure")]
    votes = {name: 0.1 * np.sin((2.0 + 0.3 * i) * t + i) for i, name in enumerate(names)}
    pressures = {"dynamic_pressure": PRESSURE + 300.0 * np.sin(t), "static_pressure": 9e4 + 500.0 * np.cos(t)}
    block = level_flight(n, **{**votes, "heading": (6.2 + votes["heading"]) % (2 * math.pi), **pressures})
    block["inertial"][:, :3] = 0.2 * np.sin(3.0 * t)[:, None]
    block["inertial"][:, 3:6] = (150.0, 10.0, -3.0)
    block["inertial"][:, 6:] = (0.3, 0.1, -9.7) + np.sin(t)[:, None]
    return block


@pytest.mark.requirement("references", "never the truth, never the signal that it checks")
@pytest.mark.parametrize("config", CHOICES, ids=["partners", "attitude", "inertial"])
def test_no_reference_reads_truth_channels_or_the_signal_that_it_checks(config: Config):
    """Nor, of a signal that it remembers or was aligned with, a vote that its channels do not agree on."""
    plain = {}
    for signal in SIGNALS:
        known, blind = busy(), busy()
        for field in ("truth", "flight", "channels", "surface", "command", "autopilot_command"):
            blind[field] = np.nan
        own, aligned = (signal.name, source(config, signal.name)), ("pitch_angle", "roll_angle")
        remembers = own[0] in REMEMBERED.get(own, ()) or (own[0] in aligned and own[1] == "inertial")
        for block in (known, blind):
            block["pattern"][40 if remembers else 0 :, INDEX[signal.name]] = Pattern.ISOLATED
        blind["voted"][40 if remembers else 0 :, INDEX[signal.name]] = 1e6
        said = [ref(run(block, config, accelerometer=(4.0, 0.5, 1.0)), signal.name) for block in (known, blind)]
        assert said[0].tobytes() == said[1].tobytes()
        plain[signal.name] = said[0]
    assert {name for name, said in plain.items() if np.isfinite(said).any()} == {name for name, _ in PARTNERS}


@pytest.mark.requirement("references", "its partners and they alone; lost with them")
@pytest.mark.parametrize("config", CHOICES, ids=["partners", "attitude", "inertial"])
def test_each_reference_reads_its_partners_and_they_alone(config: Config):
    aircraft: dict[str, Any] = {"accelerometer": (4.0, 0.5, 1.0), "pitch_rate_gain": 0.95, "elevator_arm_m": 3.0}
    plain, after = run(busy(), config, **aircraft), {}
    for signal in SIGNALS:
        moved = busy()
        moved["voted"][60:, INDEX[signal.name]] += 0.01 if signal.unit != "Pa" else 50.0
        after[signal.name] = run(moved, config, **aircraft)
    for (name, chosen), partners in PARTNERS.items():
        if source(config, name) != chosen:
            continue
        read = {signal for signal, block in after.items() if ref(block, name).tobytes() != ref(plain, name).tobytes()}
        assert read == {*partners, *REMEMBERED.get((name, chosen), ())}, (name, chosen)


@pytest.mark.requirement("references", "its partners and they alone; lost with them")
@pytest.mark.parametrize("lost", [signal.name for signal in SIGNALS])
def test_a_lost_partner_makes_its_references_unusable_until_it_is_back(lost: str):
    block = busy()
    block["level"][40:80, INDEX[lost]] = 0
    run(block)
    for (name, chosen), partners in PARTNERS.items():
        if source(BY_PARTNERS, name) == chosen:
            gone = np.zeros(len(block), bool)
            gone[41:81] = lost in partners  # the vote of frame k counts in frame k + 1
            assert np.array_equal(np.isnan(ref(block, name)), gone), name


@pytest.mark.parametrize("torn", [signal.name for signal in SIGNALS])
@pytest.mark.parametrize(
    ("pattern", "decided_by"),
    [
        *((one, DecidedBy.NONE) for one in Pattern if one.is_split),
        (Pattern.NORMAL, DecidedBy.REFERENCE),
        (Pattern.NORMAL, DecidedBy.ILM),
    ],
)
def test_a_vote_without_majority_or_of_a_disputed_last_channel_leaves_no_trace(
    torn: str, pattern: Pattern, decided_by: DecidedBy
):
    """References that read a vote without majority are NaN; of a disputed last channel they read the vote before."""
    quiet, wild = busy(), busy()
    for block in (quiet, wild):
        block["pattern"][40:48, INDEX[torn]], block["decided_by"][40:48, INDEX[torn]] = pattern, decided_by
    wild["voted"][40:48, INDEX[torn]] += 1.0
    run(quiet)
    run(wild)
    for (name, chosen), partners in PARTNERS.items():
        if source(BY_PARTNERS, name) == chosen:
            gone = np.zeros(len(wild), bool)
            gone[41:49] = torn in partners and pattern.is_split
            assert np.array_equal(np.isnan(ref(wild, name)), gone), name
            assert ref(wild, name).tobytes() == ref(quiet, name).tobytes()


def test_the_manager_can_ask_which_signals_had_no_majority():
    block = busy(3)
    block["pattern"][2, INDEX["heading"]], block["level"][2, INDEX["pitch_rate"]] = Pattern.P1_1, 0
    block["pattern"][2, INDEX["roll_angle"]] = Pattern.ISOLATED
    stage = References(Config(), designed(), RATE)
    for k in range(3):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
    all_signals = (1 << len(SIGNALS)) - 1
    kept = stage.state[0]
    assert (kept["in_split"], kept["lost"]) == (1 << INDEX["heading"], 1 << INDEX["pitch_rate"])
    unsure = kept["in_split"] | kept["lost"] | 1 << INDEX["roll_angle"]
    assert kept["agreed"] == all_signals & ~unsure


def test_after_a_loss_the_filter_begins_anew():
    """The heading came back a radian further: that was no yaw rate."""
    block = level_flight(heading=np.where(np.arange(300) < 100, 1.0, 2.0))
    block["level"][80:120, INDEX["heading"]] = 0
    assert np.nanmax(np.abs(ref(run(block), "yaw_rate"))) == 0.0


def test_in_the_first_frame_they_begin_with_its_votes():
    block = run(busy())
    chosen = {name for name, one in PARTNERS if source(BY_PARTNERS, name) == one}
    first = {signal.name for signal in SIGNALS if np.isfinite(ref(block, signal.name)[0])}
    assert first == chosen
    assert (block["reference_usable"][0] == np.isfinite(block["reference"][0])).all()


def test_none_is_none():
    off: dict[str, Any] = dict.fromkeys((name for name, _ in PARTNERS), "none")
    assert np.isnan(run(busy(), Config(**off))["reference"]).all()


@pytest.mark.long
def test_compiled_and_interpreted_references_agree_bit_for_bit():
    program = "from test_analytic_references import digest; print(digest())"
    assert printed(program, interpreted=True) == printed(program, interpreted=False)


def digest() -> str:
    """Of the references of busy rows, from every source."""
    said = [run(busy(), config, accelerometer=(4.0, 0.5, 1.0))["reference"].tobytes() for config in CHOICES]
    return hashlib.sha256(b"".join(said)).hexdigest()


def test_a_copied_state_goes_on_alike():
    block = busy()
    stage = References(Config(), designed(), RATE)
    for k in range(60):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
    other = References(Config(), designed(), RATE)
    other.state = copy.deepcopy(stage.state)
    baseline = block.copy()
    for rows, one in ((block, stage), (baseline, other)):
        for k in range(60, len(rows)):
            refer(rows, k, one.data)
            remember(rows, k, one.data)
    for name in ("reference", "reference_usable"):  # fields: padding does not survive a copy
        assert block[name].tobytes() == baseline[name].tobytes()


def test_coefficients_go_straight_between_the_points():
    """At twice the dynamic pressure of a point and half that of the next, a third of the way in between."""
    low = Point(name="low", **WING)
    high = Point(name="high", **{**WING, "dynamic_pressure_pa": 4 * PRESSURE, "lift_slope_1_pa": 2.5e-3})
    place: dict[str, Any] = {"accelerometer_x_m": 0.0, "accelerometer_y_m": 0.0, "accelerometer_z_m": 0.0}
    stage = References(BY_PARTNERS, Designed(rate_hz=RATE, points=[low, high], **place), RATE)
    block = level_flight(angle_of_attack=0.0, dynamic_pressure=2 * PRESSURE)
    for k in range(len(block)):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
    assert ref(block, "normal_load_factor")[-1] == pytest.approx(2 * PRESSURE * 1.5e-3 * 0.02)


# Thresholds


@pytest.mark.requirement("references", "thresholds from the measurement")
def test_the_threshold_is_the_measured_one_unless_the_settings_give_one():
    error = Error(rms=0.01, quantile_999=0.05, worst=0.1, threshold=0.12)
    one = designed(errors={"pitch_rate": {"attitude": error}, "roll_rate": {"inertial": error}})
    which = scenario.load(None, ["redundancy.signals.roll_rate.reference_threshold=0.5"])
    config, suite = which.redundancy, which.sensors
    params = parameters(config.signals, ranges(suite), channels(suite), RATE)
    measured_thresholds(params, config, one)
    found = {name: params["reference_threshold"][INDEX[name]] for name in ("pitch_rate", "roll_rate", "heading")}
    assert found == {"pitch_rate": 0.12, "roll_rate": 0.5, "heading": config.signals.heading.threshold}


@pytest.mark.parametrize(("given", "expected"), [((), (900.0, 7.5)), ((600.0,), (600.0, 0.0))])
def test_the_threshold_of_dynamic_pressure_is_an_airspeed_unless_the_settings_give_pascals(
    given: tuple[float, ...], expected: tuple[float, float]
):
    error = Error(rms=100.0, quantile_999=500.0, worst=750.0, threshold=900.0)
    speed = Error(rms=1.0, quantile_999=5.0, worst=6.25, threshold=7.5)
    by_source = [{"dynamic_pressure": {"inertial": e}} for e in (error, speed)]
    one = designed(errors=by_source[0]).model_copy(update={"airspeed_errors": by_source[1]})
    which = scenario.load(None, [f"redundancy.signals.dynamic_pressure.reference_threshold={pa}" for pa in given])
    config, suite = which.redundancy, which.sensors
    params = parameters(config.signals, ranges(suite), channels(suite), RATE)
    measured_thresholds(params, config, one)
    row = params[INDEX["dynamic_pressure"]]
    assert (row["reference_threshold"], row["reference_airspeed_m_s"]) == expected
    assert (np.delete(params["reference_airspeed_m_s"], INDEX["dynamic_pressure"]) == 0.0).all()


# In flight


def flown(*sets: str, name: str = "f16_pitch_rate_hardover", seconds: float = 10.0, seed: int = 3) -> Block:
    which = scenario.load(name, [f"duration_s={seconds}", "faults=[]", *sets], seed)
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


@pytest.mark.requirement("references", "usable in a healthy flight")
@pytest.mark.parametrize("aircraft", ["f16", "b747", "b737"])
@pytest.mark.parametrize(
    "sources", ["{}", '{pitch_rate="attitude"}', '{pitch_rate="inertial",roll_rate="inertial",yaw_rate="inertial"}']
)
def test_a_healthy_flight_in_moderate_turbulence_keeps_every_reference_usable(aircraft: str, sources: str):
    sets = [f"aircraft={aircraft}", "turbulence=moderate", f"redundancy.references={sources}"]
    rows = flown(*sets, seconds=40.0, seed=77)
    expected = [INDEX[name] for name in sorted({name for name, _ in PARTNERS})]
    assert (rows["reference_usable"][:, expected] == 1).all()
    assert np.isfinite(rows["reference"][:, expected]).all()
    others = [i for i in range(len(SIGNALS)) if i not in expected]
    assert np.isnan(rows["reference"][:, others]).all() and not rows["reference_usable"][:, others].any()


@pytest.mark.requirement("references", "a fault on the inertial unit")
def test_a_fault_on_the_inertial_unit_moves_the_reference_and_only_it():
    sets = ['redundancy.references={pitch_rate="inertial"}', "turbulence=light"]
    fault = 'faults=[{kind="hardover",signal="inertial.pitch_rate_rad_s",start_s=2.0,end_s=4.0}]'
    healthy, faulty = flown(*sets, seconds=6.0), flown(*sets, fault, seconds=6.0)
    moved = {name for name in healthy.dtype.names or () if healthy[name].tobytes() != faulty[name].tobytes()}
    assert moved == {"inertial", "reference", "second_reference", "reference_usable", "acting"}
    q = INDEX["pitch_rate"]
    reading = [INDEX[name] for name, read in FROM_UNIT.items() if "pitch_rate_rad_s" in read]
    assert q in reading
    same = np.delete(np.arange(len(SIGNALS)), reading)
    assert healthy["reference"][:, same].tobytes() == faulty["reference"][:, same].tobytes()
    usable = faulty["reference_usable"][:, q].astype(bool)
    assert usable[:207].all() and not usable[207:407].any() and usable[409:].all()


def test_a_wind_makes_dynamic_pressure_by_speed_over_ground_unusable_and_nothing_else():
    rows = flown("wind.north_m_s=-40.0", seconds=2.0)
    unusable = (rows["reference_usable"][-1] == 0) & np.isfinite(rows["reference"][-1])
    assert np.flatnonzero(unusable).tolist() == [INDEX["dynamic_pressure"]]


def test_a_lost_pitch_rate_still_has_its_reference_and_takes_those_that_read_it_along():
    faults = 'faults=[{kind="dropout",signal="pitch_rate",channels=[1,2,3,4],start_s=1.0}]'
    rows = flown(faults, seconds=1.5)
    assert rows["level"][-1, INDEX["pitch_rate"]] == 0
    there = {signal.name for signal in SIGNALS if np.isfinite(rows["reference"][-1, INDEX[signal.name]])}
    reading = {name for (name, one), read in PARTNERS.items() if "pitch_rate" in read and source(Config(), name) == one}
    assert reading == {"lateral_load_factor", "angle_of_attack", "angle_of_sideslip"}
    assert there == {name for name, _ in PARTNERS} - reading


@pytest.mark.requirement("references", "pitch rate from attitude: gusts leave it alone, it settles a 2:2")
@pytest.mark.parametrize("aircraft", ["f16", "b747", "b737"])
@pytest.mark.parametrize("bad", [[1, 2], [3, 4]])
def test_by_attitude_a_split_over_threshold_and_worst_error_is_settled_rightly(aircraft: str, bad: list[int]):
    sets = [f"aircraft={aircraft}", 'redundancy.signals.pitch_rate.tie_break=["reference"]', "turbulence=moderate"]
    faults = f'faults=[{{kind="offset",signal="pitch_rate",channels={bad},start_s=1.0,offset=0.13}}]'
    rows = flown(faults, *sets, 'redundancy.references.pitch_rate="attitude"', seconds=4.0)
    failed = np.flatnonzero(rows["state"][-1, INDEX["pitch_rate"]] == State.FAILED) + 1
    assert failed.tolist() == bad


@pytest.mark.requirement("references", "settles a 2:2")
@pytest.mark.parametrize(("signal", "offset"), [("pitch_rate", 0.06), ("roll_rate", 0.13), ("yaw_rate", 0.06)])
@pytest.mark.parametrize("bad", [[1, 2], [3, 4]])
def test_by_the_inertial_unit_a_split_just_over_the_threshold_is_settled_rightly(signal, offset, bad):
    faults = f'faults=[{{kind="offset",signal="{signal}",channels={bad},start_s=1.0,offset={offset}}}]'
    asked = f'redundancy.signals.{signal}.tie_break=["reference"]'
    rows = flown(faults, asked, f'redundancy.references.{signal}="inertial"', "turbulence=moderate", seconds=4.0)
    failed = np.flatnonzero(rows["state"][-1, INDEX[signal]] == State.FAILED) + 1
    assert failed.tolist() == bad
    assert DecidedBy.REFERENCE in rows["decided_by"][:, INDEX[signal]]


@pytest.mark.parametrize(
    ("level", "pattern", "decided_by", "agreed"),
    [
        (4, Pattern.NORMAL, DecidedBy.NONE, True),
        (1, Pattern.NORMAL, DecidedBy.NONE, True),
        (1, Pattern.NORMAL, DecidedBy.REFERENCE, False),
        (1, Pattern.NORMAL, DecidedBy.ILM, False),
        (4, Pattern.ISOLATED, DecidedBy.NONE, False),
        (4, Pattern.P2_2, DecidedBy.TREND, False),
        (0, Pattern.LOST, DecidedBy.NONE, False),
    ],
)
def test_a_last_channel_feeds_what_is_remembered_unless_it_is_disputed(level, pattern, decided_by, agreed):
    state, block, s = np.zeros(1, STATE), new_block(1), INDEX["static_pressure"]
    block["level"], block["pattern"], block["decided_by"] = level, pattern, decided_by
    look_back(block[0], state[0])
    assert bool((int(state[0]["agreed"]) >> s) & 1) == agreed


def test_two_healthy_last_channels_that_are_references_of_each_other_stay_in_use():
    """At 2 s each signal is left with channel 2 alone, and the reference of the last yaw rate is off for some frames.

    Were the reference's yaw rate read, sideslip and lateral load factor would be off, and each voted by the other's.
    """
    read = [signal.name for signal in SIGNALS if not signal.name.startswith(("stick", "pedal"))]
    out = [("[3, 4]", 1.0), ("[1]", 2.0)]
    faults = ", ".join(
        f"{{kind='dropout', signal='{name}', channels={which}, start_s={at}}}" for name in read for which, at in out
    )
    faults += ", {kind='offset', signal='reference.yaw_rate', start_s=2.02, duration_s=0.05, offset=0.3}"
    given = scenario.load(None, ["duration_s=2.3", "turbulence='light'", f"faults=[{faults}]"])
    rows = np.concatenate([block.copy() for block, _ in frames(Rig(given), given)])
    assert DecidedBy.REFERENCE in rows["decided_by"][200:, INDEX["yaw_rate"]]  # else nothing was tried
    for name, near in (("lateral_load_factor", 0.1), ("angle_of_sideslip", 0.02)):
        s = INDEX[name]
        assert rows["level"][-1, s] == 1 and DecidedBy.REFERENCE not in rows["decided_by"][200:, s], name
        assert np.abs(rows["voted"] - rows["truth"])[200:, s].max() < near, name
