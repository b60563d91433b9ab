"""An aircraft of one's own: flight points, the written file, what a check says, and c172x from command to flight."""

from __future__ import annotations

import re
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from test_plant_base_model import POINT, light

import rig
from rig.cli import aircraft as aircraft_commands
from rig.cli import main as cli
from rig.cli import show_aircraft
from rig.computer.analytic import designed as designed_references
from rig.computer.control import gains_file
from rig.computer.control.gains_file import Gains, Margin
from rig.core.errors import BadInput, PointFault, RigError
from rig.core.units.atmosphere import density, speed_of_sound
from rig.core.units.constants import GRAVITY
from rig.design import backup_design as backup
from rig.design import design_gains, first_design, new_aircraft, propose
from rig.design import design_references as references
from rig.design import loop_requirements as requirements
from rig.design.aircraft_check import check
from rig.design.loop_requirements import Requirements, short_of
from rig.scenario import aircraft
from rig.world.plant import airframe, base_model, linearise
from rig.world.plant.airframe import FlightPoint, flight_point_at
from rig.world.plant.level import evaluate
from rig.world.plant.loading import load, mass_kg

BUNDLED = Path(__file__).parents[1] / "aircraft"


@pytest.fixture(scope="module")
def proposed() -> new_aircraft.NewAircraft:
    return new_aircraft.propose("mine", "c172x", new_aircraft.Answers(), [], 2)


def command(*words: str) -> int:
    """Exit code of a command, run in this process."""
    old, sys.argv = sys.argv, ["rig", *words]
    try:
        with pytest.raises(SystemExit) as done:
            cli.main()
    finally:
        sys.argv = old
    return int(done.value.code or 0)


def test_the_proposed_points_trim_with_a_reserve_and_lie_apart(proposed: new_aircraft.NewAircraft):
    cruise, slow = proposed.found
    assert slow.trim.dynamic_pressure_pa < 0.9 * cruise.trim.dynamic_pressure_pa
    for one in proposed.found:
        assert 0.1 < one.trim.throttle < 0.9
        fdm = load(proposed.airframe, one.point, 0.01)
        assert abs(fdm["accelerations/udot-ft_sec2"]) < 0.01
        assert abs(fdm["accelerations/qdot-rad_sec2"]) < 0.001


def test_a_name_has_altitude_and_mach_as_the_bundled_ones():
    assert flight_point_at(6096.0, 0.6).name == "20000ft_m06"
    assert flight_point_at(3048.0, 0.42).name == "10000ft_m042"


def test_what_the_replaced_flight_control_moved_is_declared():
    table, kind = propose.airframe_table(base_model.read("f16"))
    assert table["properties"] == {"fcs/flaperon-mix-rad": 0.0, "fcs/lef-pos-rad": 0.0}
    assert (kind, table["throttle"]["full_position"]) == ("fighter", 2.0)


def test_a_governed_propeller_turns_at_seven_tenths_of_its_way_from_least_to_most():
    """p51d: 756 to 1260 a minute."""
    made = new_aircraft.propose("mine", "p51d", new_aircraft.Answers(), [(2438.4, 0.3)], 1)
    fdm = load(made.airframe, made.found[0].point, 0.01)
    assert fdm["propulsion/engine/propeller-rpm"] == pytest.approx(756 + 0.7 * (1260 - 756), rel=1e-6)


# A trainer, a warbird, a tail-dragger, thrust vectoring, an airliner with afterburners, turboprops, two jets.
FLOWN = [
    *("c172p", "f22", "T38"),
    *(
        pytest.param(base, marks=pytest.mark.long)
        for base in ("pa28", "p51d", "dr1", "Concorde", "pc7", "pogo-jsbsim", "t6texan2")
    ),
]


@pytest.mark.parametrize("base", FLOWN)
def test_a_model_of_every_kind_trims_by_default_and_flies_level_hands_off(base: str):
    made = new_aircraft.propose("mine", base, new_aircraft.Answers(), [], 1)
    fdm = load(made.airframe, made.found[0].point, 0.01)
    speed, height = fdm["velocities/vt-fps"], fdm["position/h-sl-ft"]
    for _ in range(300):
        fdm.run()
    assert fdm["velocities/vt-fps"] == pytest.approx(speed, abs=0.1)
    assert fdm["position/h-sl-ft"] == pytest.approx(height, abs=0.3)


@pytest.mark.parametrize(
    ("base", "says"),
    [
        ("X15", r"throttle at its stop in (\d+) of \1 points \(.*Mach .*\); try .* --point ALTITUDE_M:MACH"),
        pytest.param("C130", r"throttle at its stop in (\d+) of \1 points", marks=pytest.mark.long),
        ("x24b", r"stall: angle of attack at its limit in \d+ of \d+ points"),
    ],
)
def test_a_model_that_trims_nowhere_says_what_stands_in_the_way_and_what_to_try(base: str, says: str):
    with pytest.raises(BadInput, match=says):
        new_aircraft.propose("mine", base, new_aircraft.Answers(), [], 2)


def test_a_point_of_ones_own_that_does_not_trim_says_how_much_thrust_is_there():
    with pytest.raises(
        BadInput, match=r"Mach 0.23\): throttle at its stop: full throttle gives \d\d% of the required thrust"
    ):
        new_aircraft.propose("mine", "c172p", new_aircraft.Answers(), [(1500.0, 0.23)], 2)


def test_points_leave_room_for_the_pull_up_of_the_healthy_flights():
    """A fighter pulls 1 + 0.21 x 9 g: at most a lift coefficient of 1.25 there."""
    made = new_aircraft.propose("mine", "f22", new_aircraft.Answers(), [], 2)
    weight = mass_kg(made.airframe, made.found[0].point) * GRAVITY
    lifts = [weight / (each.trim.dynamic_pressure_pa * made.base.wing_area_m2) for each in made.found]
    assert max(lifts) * (1 + 0.21 * 9) < 1.3


@pytest.fixture
def quick_gains(monkeypatch: pytest.MonkeyPatch) -> Gains:
    """The gains of a bundled aircraft in place of every design, and its references."""
    gains = gains_file.read(BUNDLED / "f16" / "gains.toml")

    def design(plane: airframe.Config) -> Gains:
        at = plane.flight_points[0]
        pressure = 0.5 * density(at.altitude_m) * (at.mach * speed_of_sound(at.altitude_m)) ** 2
        point = gains.points[0].model_copy(update={"name": at.name, "dynamic_pressure_pa": pressure})
        return gains.model_copy(update={"points": [point]})

    monkeypatch.setattr(first_design, "design", design)
    monkeypatch.setattr(first_design.references, "design", lambda *_: None)
    return gains


@pytest.mark.usefixtures("quick_gains")
def test_a_point_at_which_the_aircraft_is_lost_gives_way_to_another(
    proposed: new_aircraft.NewAircraft, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "mine").mkdir()
    first = proposed.found[0].point.name

    def try_out(name: str, gains: Gains, point: FlightPoint) -> None:
        if point.name == first:
            raise PointFault("mine: lost", first)

    monkeypatch.setattr(first_design.references, "try_out", try_out)
    made, *_ = first_design.designed(proposed, tmp_path / "mine")
    assert made.found and first not in [each.point.name for each in made.found]
    assert [fault.point for fault in made.left_out] == [first]
    assert airframe.read(tmp_path / "mine" / "aircraft.toml") == made.airframe


@pytest.mark.usefixtures("quick_gains")
def test_a_second_point_for_which_nothing_serves_is_done_without(
    proposed: new_aircraft.NewAircraft, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "mine").mkdir()
    first = proposed.found[0].point.name

    def try_out(name: str, gains: Gains, point: FlightPoint) -> None:
        if point.name != first:
            raise PointFault("mine: lost", point.name)

    monkeypatch.setattr(first_design.references, "try_out", try_out)
    made, gains, _ = first_design.designed(proposed, tmp_path / "mine")
    assert [each.point.name for each in made.found] == [first] and len(gains.points) == 1


@pytest.mark.usefixtures("quick_gains")
def test_a_point_that_is_lost_while_the_references_are_measured_gives_way_too(
    proposed: new_aircraft.NewAircraft, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "mine").mkdir()
    last = proposed.found[-1].point.name

    def measure(name: str, gains: Gains) -> None:
        if last in (tmp_path / "mine" / "aircraft.toml").read_text():
            raise PointFault("mine: lost", last)

    monkeypatch.setattr(first_design.references, "try_out", lambda *_: None)
    monkeypatch.setattr(first_design.references, "design", measure)
    made, *_ = first_design.designed(proposed, tmp_path / "mine")
    assert made.found and last not in [each.point.name for each in made.found]


def test_the_angle_of_attack_is_limited_where_full_elevator_no_longer_pitches_down():
    """f22, its nozzles fixed: by its tables from 0.49 rad; 35 deg is what a fighter is assumed to have."""
    made = new_aircraft.propose("mine", "f22", new_aircraft.Answers(), [(9144.0, 0.69)], 1)
    limit = made.airframe.limits.angle_of_attack_max_rad
    fdm = load(made.airframe, made.found[0].point, 0.01)

    def pitches(alpha: float) -> float:
        fdm["ic/alpha-rad"], fdm["fcs/elevator-cmd-norm"] = alpha, made.airframe.elevator.max_rad
        evaluate(fdm)
        return fdm["accelerations/qdot-rad_sec2"]

    assert pitches(limit) < 0.0 < pitches(limit / 0.7 + 0.01)
    assert "from which full elevator no longer pitches" in " ".join(new_aircraft.render(made).replace("# ", "").split())
    other = new_aircraft.propose("mine", "f15", new_aircraft.Answers(), [(9144.0, 0.7)], 1)
    assert other.airframe.limits.angle_of_attack_max_rad == 0.61


def test_when_no_point_serves_each_is_named_with_its_fault(
    proposed: new_aircraft.NewAircraft, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def no_design(plane: airframe.Config) -> None:
        raise PointFault(f"lost at {plane.flight_points[0].name}", plane.flight_points[0].name)

    (tmp_path / "mine").mkdir()
    monkeypatch.setattr(first_design, "design", no_design)
    with pytest.raises(BadInput, match=r"no flight point is suitable: lost at 8000ft_m\w+; lost at .*--point"):
        first_design.designed(proposed, tmp_path / "mine")


@pytest.mark.parametrize("coefficient", ["side_slope_1_pa", "lift_slope_1_pa"])
def test_a_coefficient_that_references_cannot_work_with_is_named_with_its_flight_point(coefficient: str):
    fixed = dict.fromkeys(designed_references.COLUMNS[:7], 1.0) | {"dynamic_pressure_pa": 1e3, "side_slope_1_pa": -1.0}
    fixed[coefficient] *= -1.0
    with pytest.raises(PointFault, match=rf"references of any: {coefficient}: must be") as fault:
        references._point(POINT, fixed, 0.1)
    assert fault.value.point == "any"


def test_where_the_rudders_force_hides_the_sideslips_the_references_take_the_bodys():
    """pa28: with the rudder that holds it, sideslip pushes the other way; Y_beta V / (g q_bar) is left."""
    made = new_aircraft.propose("mine", "pa28", new_aircraft.Answers(), [(2438.4, 0.18)], 1)
    linear = linearise.linearise(made.airframe, made.found[0].point)
    found = references.coefficients(linear)
    body = linear.lateral_a[0, 0] * linear.trim.airspeed_m_s / GRAVITY / linear.trim.dynamic_pressure_pa
    assert found["side_slope_1_pa"] == pytest.approx(body, rel=1e-5)
    assert (found["roll_arm_m"], found["yaw_arm_m"]) == (0.0, 0.0)


def test_a_failed_design_leaves_no_folder_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def lost(*_: object) -> None:
        raise PointFault("mine 8000ft_m018: lost", "8000ft_m018")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(first_design, "designed", lost)
    assert command("aircraft", "new", "mine", "--base", "c172x", "--points", "1") == 2
    assert "mine 8000ft_m018: lost" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_scenario_and_so_its_log_are_named_by_the_aircraft(proposed: new_aircraft.NewAircraft, tmp_path: Path):
    new_aircraft.write(proposed, tmp_path / "mine")
    assert {path.name for path in (tmp_path / "mine").iterdir()} == {"aircraft.toml", "mine_hardover.toml"}


def test_a_normalised_position_is_told_in_norm_and_moves_by_the_assumed_rate():
    """T38 reads the elevator's share of full deflection, taken as 0.35 rad: 60 deg/s are 2.99 norm/s."""
    made = new_aircraft.propose("mine", "T38", new_aircraft.Answers(), [(6096.0, 0.6)], 1)
    assert made.airframe.elevator.rate_limit_rad_s == pytest.approx(1.047 / 0.35, abs=1e-3)
    text = new_aircraft.render(made)
    assert "norm and norm/s here" in text and re.search(r"elevator [+-]0\.\d{3} norm,", text)


def test_the_written_file_reads_back_as_what_was_proposed(proposed: new_aircraft.NewAircraft, tmp_path: Path):
    new_aircraft.write(proposed, tmp_path / "mine")
    assert airframe.read(tmp_path / "mine" / "aircraft.toml") == proposed.airframe


def test_every_figure_that_the_model_does_not_give_is_marked_assumed(proposed: new_aircraft.NewAircraft):
    blocks = new_aircraft.render(proposed).split("\n[airframe.")
    marked = {block.split("]")[0]: "assumed" in before for before, block in pairwise(blocks)}
    assert {name for name, yes in marked.items() if yes} >= {"elevator", "aileron", "rudder", "limits", "held"}


def test_a_given_figure_replaces_the_assumed_one():
    answers = new_aircraft.Answers(lag_s=0.05, rate_limit_rad_s=2.0, sensor_class="tactical-grade MEMS", channels=3)
    made = new_aircraft.propose("mine", "c172x", answers, [(1500.0, 0.16)], 2)
    data = tomllib.loads(new_aircraft.render(made))
    assert (data["airframe"]["elevator"]["lag_s"], data["airframe"]["rudder"]["rate_limit_rad_s"]) == (0.05, 2.0)
    assert data["sensors"]["pitch_rate"] == {"class": "tactical-grade MEMS", "channels": 3}
    assert data["sensors"]["heading"] == {"channels": 3}
    assert [point["mach"] for point in data["airframe"]["flight_points"]] == [0.16]


def test_the_throttle_of_a_propeller_is_differenced_with_its_revolutions_settled():
    """Against trims at two speeds, which settle them in JSBSim's own way."""
    plane = light({"fcs/mixture-cmd-norm[0]": 0.7})
    model = linearise.linearise(plane, POINT)
    faster = linearise.trimmed(plane, POINT.model_copy(update={"mach": 0.165}))
    change = np.array([faster.airspeed_m_s - model.trim.airspeed_m_s, faster.alpha_rad - model.trim.alpha_rad])
    drag = model.longitudinal_a[0, :2] @ change + model.longitudinal_a[0, 3] * change[1]
    drag += model.longitudinal_b[0, 0] * (faster.elevator_rad - model.trim.elevator_rad)
    assert model.longitudinal_b[0, 1] * (faster.throttle - model.trim.throttle) == pytest.approx(-drag, rel=0.1)


def test_differences_agree_with_jsbsims_own_linearisation():
    plane = airframe.read(BUNDLED / "b737" / "aircraft.toml")
    fdm = load(plane, plane.point(), 0.01)
    own = linearise._system(fdm)
    for ours, theirs in zip(linearise._differenced(load(plane, plane.point(), 0.01)), own, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-2, abs=2e-3)


def test_a_missed_margin_is_told_with_its_number():
    margin = Margin(gain_increase_db=20.0, gain_decrease_db=6.0, phase_deg=29.0, crossover_rad_s=1.0)
    assert short_of(margin, Requirements()) == ["gain down 6.0 of 6.5 dB", "phase 29.0 of 46 deg"]
    none = Margin(gain_increase_db=0.0, gain_decrease_db=0.0, phase_deg=0.0, crossover_rad_s=0.0)
    assert short_of(none, Requirements()) == ["loop unstable"]


def test_a_design_below_the_requirement_fails_with_numbers_or_is_accepted_and_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setattr(requirements, "LOSSES", {"longitudinal": (), "lateral": ()})
    few, slow = design_gains._candidates()[:2], backup.candidates()[:1]
    monkeypatch.setattr(design_gains, "_candidates", lambda: few)
    monkeypatch.setattr(design_gains.backup, "candidates", lambda: slow)
    plane, hard = airframe.read(BUNDLED / "b707" / "aircraft.toml"), Requirements(phase_margin_deg=100.0)
    with pytest.raises(RigError, match=r"autopilot elevator phase \d+\.\d of 100 deg.*rig aircraft check"):
        design_gains.design(plane, hard)
    found = check(plane, hard)
    assert found.below and all("of 100 deg" in line for line in found.below)
    assert {loop.law for loop in found.loops if loop.missed} == {"stick", "autopilot"}
    assert found.gains is not None
    gains_file.write(found.gains, tmp_path / "gains.toml")
    assert gains_file.read(tmp_path / "gains.toml").below == found.below


def test_a_check_names_what_the_model_does_not_read():
    found = check(light(aileron="fcs/left-aileron-pos-rad"))
    wrong = [one for one in found.properties if not one.read]
    assert [one.key for one in wrong] == ["airframe.aileron.position"]
    assert "fcs/effective-aileron-pos" in wrong[0].nearest
    assert found.gains is None


def test_a_check_tells_which_point_does_not_trim():
    plane = light().model_copy(update={"flight_points": [POINT.model_copy(update={"mach": 0.5})]})
    found = check(plane)
    assert found.gains is None
    assert "no level trim at 'any' (1500 m, Mach 0.5)" in found.trims[0].error


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("mine", "--base", "c172y"), "nearest: c172x"),
        (("mine", "--base", "SGS"), "no engine"),
        (("mine", "--base", "Submarine_Scout"), "no elevator"),
        (("there", "--base", "c172x"), "there: exists already"),
        (("f16", "--base", "c172x"), "a bundled aircraft has this name"),
        (("a/b", "--base", "c172x"), "allowed: letters"),
        (("mine", "--base", "c172x", "--point", "1500"), "must be ALTITUDE_M:MACH"),
        (("mine", "--base", "c172x", "--point", "1500:0.6"), "no level trim"),
        (("mine", "--base", "c172x", "--sensor-class", "x"), "unknown class 'x'"),
        (("mine", "--base", "c172x", "--out", "nowhere"), "nowhere: no such folder"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    words: tuple[str, ...],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path)
    assert command("aircraft", "new", *words) == 2
    shown = capsys.readouterr()
    assert says in shown.err and shown.err.count("\n") == 1 and shown.out == ""
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def test_c172x_is_made_accepted_and_flown_from_the_users_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The commands of a user, made short: fewer candidates, no margins of losses, references of one flight, not 72."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(requirements, "LOSSES", {"longitudinal": (), "lateral": ()})
    slow, later = backup.candidates()[:1], design_gains._candidates()[77:]
    monkeypatch.setattr(design_gains, "_candidates", lambda: later)
    monkeypatch.setattr(design_gains.backup, "candidates", lambda: slow)
    monkeypatch.setattr(references, "cases", lambda: [("pitch", "none", 1)])
    assert command("aircraft", "new", "mine", "--base", "c172x", "--points", "1", "--no-design") == 0
    assert command("aircraft", "check", "mine", "--accept") == 0
    assert aircraft.own_names() == ["mine"]
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    flight = rig.fly(tmp_path / "mine" / "mine_hardover.toml", overrides=["duration_s=25"], out=tmp_path / "logs")
    assert flight.survived and flight.failed == {"pitch_rate": [3]}
    assert "gains_below_requirement" not in flight.summary()


def test_enter_takes_the_assumed_figures_and_a_rate_is_asked_for_in_degrees(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(aircraft_commands.typer, "prompt", lambda text, default, type=str: default)
    assert aircraft_commands._ask(new_aircraft.Answers(), "light") == new_aircraft.Answers()
    typed = {"s": 0.05, "deg/s": 90.0, "sheet": "AHRS MEMS"}
    monkeypatch.setattr(aircraft_commands.typer, "prompt", lambda text, **_: typed[text.split()[-1]])
    own = aircraft_commands._ask(new_aircraft.Answers(), "light")
    assert own == new_aircraft.Answers(0.05, np.pi / 2, "AHRS MEMS", 4)


def test_a_folder_of_the_user_that_cannot_be_used_does_not_hide_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "aircraft.toml").write_text("[airframe]\n")
    assert aircraft.own_names() == ["broken"]
    assert "cannot be used: aircraft broken: airframe." in show_aircraft.listed("broken")[0]
    with pytest.raises(BadInput):
        show_aircraft.flight_points("broken")
