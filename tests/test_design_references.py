"""The design of the references: coefficients against flight mechanics, thresholds against flights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from figures import references as table_of_references

from rig.computer.analytic import reference_sources
from rig.computer.analytic.designed import Designed, Error
from rig.computer.analytic.reference_sources import PARTNERS
from rig.computer.control import gains_file as control_gains
from rig.core.errors import BadInput, PointFault, RigError
from rig.core.frame import INDEX, INERTIAL, SIGNALS, new_block
from rig.core.settings import build, read_toml
from rig.design import design_references as reference_design
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario
from rig.world.plant.airframe import read as read_airframe
from rig.world.plant.linearise import Linear, Trim, linearise

G = 9.80665
NAMES = aircraft.names()
DESIGNED = {
    name: build(Designed, read_toml(aircraft.folder(name) / "references.toml"), f"{name}/references.toml")
    for name in NAMES
}


def linear(tail_s: float = 0.0, fin_s: float = 0.0) -> Linear:
    """An aircraft of 100 m/s whose wing gives 8 g and whose fin takes 3 g for a radian; M_elevator = N_rudder = 1."""
    trim = Trim(100.0, 6000.0, 0.1, 0.1, 0.0, 0.0, 0.0, 0.5)
    a, b = np.zeros((4, 4)), np.zeros((4, 2))
    a[1, 1], a[1, 2], a[2, 1], a[2, 2] = -8.0 * G / 100.0, 1.0, -2.0, -0.5
    b[1, 0], b[2, 0] = tail_s, 1.0
    lateral_a, lateral_b = np.zeros((4, 4)), np.zeros((4, 2))
    lateral_a[0, 0], lateral_a[2, 0] = -3.0 * G / 100.0, 4.0
    lateral_b[0, 1], lateral_b[1, 0], lateral_b[2, 1] = fin_s, 1.0, 1.0
    return Linear(trim, a, b, lateral_a, lateral_b)


def test_without_tail_forces_the_slopes_are_those_of_wing_and_fin():
    found = reference_design.coefficients(linear())
    assert found["lift_slope_1_pa"] * 6000.0 == pytest.approx(8.0, rel=1e-5)
    assert found["side_slope_1_pa"] * 6000.0 == pytest.approx(-3.0, rel=1e-5)
    assert (found["pitch_rate_gain"], found["elevator_arm_m"], found["yaw_arm_m"]) == (1.0, 0.0, 0.0)


def test_level_flight_lifts_the_weight():
    found = reference_design.coefficients(linear(tail_s=0.02))
    lift = 6000.0 * found["lift_slope_1_pa"] * (0.1 - found["zero_lift_alpha_rad"])
    assert lift == pytest.approx(1.0, rel=1e-4)


def test_the_tail_takes_what_trims_the_moments():
    """Steady: elevator = -(M_alpha alpha + M_q q) / M_elevator, which lifts Z_elevator times as much."""
    found = reference_design.coefficients(linear(tail_s=0.02, fin_s=0.03))
    assert found["lift_slope_1_pa"] * 6000.0 == pytest.approx(8.0 - 2.0 * 0.02 * 100.0 / G, rel=1e-5)
    assert found["pitch_rate_gain"] == pytest.approx(1.0 + 0.02 * 0.5)
    assert found["elevator_arm_m"] == pytest.approx(2.0)
    assert found["side_slope_1_pa"] * 6000.0 == pytest.approx(-3.0 - 4.0 * 0.03 * 100.0 / G, rel=1e-5)
    assert found["yaw_arm_m"] == pytest.approx(3.0)


@pytest.mark.parametrize("name", NAMES)
def test_the_coefficients_in_the_file_are_those_of_the_aircraft(name: str):
    airframe = read_airframe(aircraft.folder(name) / "aircraft.toml")
    here = airframe.flight_points[0]
    point = next(point for point in DESIGNED[name].points if point.name == here.name)
    fresh = reference_design.coefficients(linearise(airframe, here))
    assert {key: getattr(point, key) for key in fresh} == fresh


@pytest.mark.parametrize("name", NAMES)
def test_every_source_was_measured_and_its_threshold_is_the_worst_error_with_the_reserve(name: str):
    errors = DESIGNED[name].errors
    assert {(signal, source) for signal, sources in errors.items() for source in sources} == set(PARTNERS)
    for sources in errors.values():
        for e in sources.values():
            assert 0.0 < e.rms < e.quantile_999 < e.worst
            assert e.threshold == float(f"{reference_design.RESERVE * e.worst:.3g}")


@pytest.mark.long
@pytest.mark.requirement("references", "thresholds from the measurement")
@pytest.mark.parametrize("name", NAMES)
def test_the_errors_in_the_file_are_those_of_the_flights(name: str):
    """Every flight that the file names as a worst one leaves that error today, to the last digit that is kept.

    What moves a healthy flight, another draw of noise too, moves these.  That no other flight is worse and no
    other filter better is for a whole design to say: `make designs`.
    """
    known, tables = DESIGNED[name], {**aircraft.tables(name), "aircraft": name}
    airframe = read_airframe(aircraft.folder(name) / "aircraft.toml")
    kept_errors = {(s, chosen): e for s, sources in known.errors.items() for chosen, e in sources.items()}
    for key, airspeed_name in reference_design.AS_AIRSPEED.items():
        kept_errors[key[0], airspeed_name] = known.airspeed_errors[key[0]][key[1]]
    wanted = {e.worst_in: e for e in kept_errors.values()}
    flown = 0
    for point in known.points:
        alone = known.model_copy(update={"points": [point], "errors": {}, "airspeed_errors": {}})
        for case in reference_design.cases():
            where = reference_design.label(point.name, case)
            if where not in wanted:
                continue
            flown += 1
            rows = reference_design.fly(tables, airframe.point(point.name), alone, case)
            for key, off in reference_design.all_errors(rows, alone).items():
                kept, worst = kept_errors[key], float(f"{np.abs(off).max():.3g}")
                assert worst == kept.worst if kept.worst_in == where else worst <= kept.worst, key
    assert flown == len(wanted) > 0


def test_the_files_are_what_a_design_writes():
    for name in NAMES:
        assert reference_design.render(DESIGNED[name]) == (aircraft.folder(name) / "references.toml").read_text()


def test_of_pitch_rate_filters_that_serve_nearly_alike_the_quickest_is_taken_of_the_others_the_best():
    """Worst errors by filter, and the tenth within which they count as equal."""

    def tried(worst: tuple[float, ...]) -> list[list[reference_design.Errors]]:
        keys = [key for served in reference_design._SERVES.values() for key in served]
        return [[{key: np.array([0.0, -w], np.float32) for key in keys}] for w in worst]

    monitors = {name: {"threshold": 0.05} for name in INDEX}
    expected = {"alpha_filter_s": 1, "attitude_filter_s": 3, "acceleration_filter_s": 3, "unit_filter_s": 3}
    assert reference_design._choose(tried((0.4, 0.208, 0.2, 0.19, 0.21)), monitors) == expected
    assert reference_design._choose(tried((0.4, 0.21, 0.2, 0.19, 0.21)), monitors)["alpha_filter_s"] == 2


def test_every_source_is_measured_in_one_round_and_the_rounds_are_few():
    asked = [(s, reference_sources.source(config, s)) for config in reference_design.rounds() for s, _ in PARTNERS]
    asked = [key for key in asked if key[1] != "none"]
    assert set(asked) == set(PARTNERS) and len(reference_design.rounds()) == 3
    one = reference_design.rounds([("heading", "inertial")])
    assert [reference_sources.source(one[0], s) for s, _ in PARTNERS if s != "heading"] == ["none"] * (
        len(PARTNERS) - 1
    )


def test_a_reference_that_remembers_its_signal_is_measured_against_the_farthest_channel():
    rows = new_block(200)
    rows["level"], rows["voted"][:, INDEX["static_pressure"]] = 4, 80_000.0
    rows["channels"][:, INDEX["static_pressure"]] = 80_000.0 + np.array([-20.0, 10.0, 45.0, 0.0])
    found = reference_design.all_errors(rows, DESIGNED["f16"], [("static_pressure", "inertial")])
    assert list(found) == [("static_pressure", "inertial")]
    assert found["static_pressure", "inertial"] == pytest.approx(np.full(150, -45.0))


def test_the_worst_error_is_that_of_the_flight_that_left_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(reference_design, "SEEDS", (1, 2))
    monkeypatch.setattr(reference_design, "TURBULENCE", ("none",))
    key, point = ("pitch_rate", "inertial"), DESIGNED["f16"].points[0]
    flown = [{key: np.full(4, worst, np.float32)} for worst in (0.1, 0.2, -0.4, 0.3, 0.2, 0.1)]
    (found,) = reference_design._summary([reference_design.Measured(point, flown)])["pitch_rate"].values()
    assert (found.worst, found.threshold) == (0.4, 0.48)
    assert found.worst_in == f"{point.name}, roll and yaw, turbulence none, seed 1"


def test_an_aircraft_of_the_users_own_is_measured_in_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """One flight point, one seed: twice the same, and filters that were tried."""
    monkeypatch.setattr(reference_design, "SEEDS", (1,))
    monkeypatch.setattr(reference_design, "TURBULENCE", ("light",))
    own = tmp_path / "mine"
    own.mkdir()
    text = (aircraft.folder("b747") / "aircraft.toml").read_text()
    first = text.index("    { name")
    second = text.index("    { name", first + 1)
    (own / "aircraft.toml").write_text(text[:second] + text[text.index("]\n", second) :])
    gains = control_gains.read(aircraft.folder("b747") / "gains.toml")
    one, two = (reference_design.design(str(own), gains) for _ in range(2))
    assert one == two and len(one.points) == 1
    assert one.points[0].alpha_filter_s in reference_design.FILTERS_S
    assert set(one.errors) == {name for name, _ in PARTNERS}


def test_without_the_file_the_user_is_told_what_to_do(tmp_path: Path):
    own = tmp_path / "mine"
    own.mkdir()
    for name in ("aircraft.toml", "gains.toml"):
        (own / name).write_bytes((aircraft.folder("f16") / name).read_bytes())
    with pytest.raises(BadInput, match=r"references.toml: no such file; write it with: rig aircraft design"):
        aircraft.tables(str(own))


def test_an_aircraft_that_is_lost_in_a_healthy_flight_cannot_be_measured(monkeypatch: pytest.MonkeyPatch):
    tables = {**aircraft.tables("f16"), "aircraft": "f16"}
    tables["airframe"] = {**tables["airframe"], "limits": {**tables["airframe"]["limits"], "load_factor_max": 1.2}}
    airframe = read_airframe(aircraft.folder("f16") / "aircraft.toml")
    with pytest.raises(RigError, match="lost in the healthy flight 'pitch'"):
        reference_design.fly(tables, airframe.point(), DESIGNED["f16"], ("pitch", "none", 1))


def test_references_that_are_not_measured_yet_fail_no_channel_of_a_design_flight(monkeypatch: pytest.MonkeyPatch):
    """Of some models (T37, DHC6, c182) two of them agree and are wrong: then all vanes would be failed in common."""
    flown: list[Scenario] = []
    fly_rows = reference_design.fly_rows
    monkeypatch.setattr(reference_design, "fly_rows", lambda scenario: flown.append(scenario) or fly_rows(scenario))
    point = read_airframe(aircraft.folder("f16") / "aircraft.toml").point()
    tables = {**aircraft.tables("f16"), "aircraft": "f16"}
    reference_design.fly(tables, point, DESIGNED["f16"], ("pitch", "none", 1))
    assert [scenario.redundancy.common_mode for scenario in flown] == ["report"]


def test_a_reference_without_a_value_is_told_with_its_flight():
    point = read_airframe(aircraft.folder("f16") / "aircraft.toml").point()
    errors = {("pitch_rate", "attitude"): np.array([0.1, np.nan], np.float32)}
    with pytest.raises(PointFault, match="roll and yaw, turbulence light, seed 4 the reference of pitch_rate from att"):
        reference_design._refuse_gaps(errors, point, ("roll and yaw", "light", 4))


@pytest.mark.requirement("references", "settles a 2:2")
@pytest.mark.requirement("references", "thresholds from the measurement")
def test_the_table_of_the_page_is_that_of_the_files():
    page = (Path(__file__).parent.parent / "docs" / "results" / "measured" / "references.md").read_text()
    rows = list(table_of_references.rows())
    assert [row for row in rows if f"| {' | '.join(row)} |" not in page] == []
    assert {tuple(row[:2]) for row in rows} == {
        (s, source) for s, of in DESIGNED["f16"].errors.items() for source in of
    }


@pytest.mark.parametrize(("worst", "settled"), [(0.4, "always"), (0.7, "never wrong"), (1.1, "large ones")])
def test_a_split_is_settled_for_certain_when_it_exceeds_threshold_and_worst_error(worst: float, settled: str):
    assert table_of_references.settles(Error(rms=0.1, quantile_999=0.2, worst=worst, threshold=0.5), 1.0) == settled


def test_an_error_of_dynamic_pressure_is_kept_as_equivalent_airspeed_too():
    """Off by 664 Pa where the reference is 5 kPa: 6 m/s."""
    rows = new_block(200)
    rows["level"], rows["voted"][:, INDEX["static_pressure"]] = 4, 101_325.0
    rows["inertial"][:, INERTIAL.index("velocity_north_m_s")] = 90.35079  # m/s: 5 kPa at sea level
    rows["voted"][:, INDEX["dynamic_pressure"]] = 5_000.0 - 664.08
    found = reference_design.all_errors(rows, DESIGNED["f16"], [("dynamic_pressure", "inertial")])
    of = {key[1]: off[-1] for key, off in found.items()}
    assert of == pytest.approx({"inertial": 664.08, "inertial, equivalent airspeed": 6.0}, rel=1e-3)


def test_a_table_out_of_order_is_refused():
    data = DESIGNED["f16"].model_dump()
    data["points"].reverse()
    with pytest.raises(BadInput, match="rising dynamic pressure"):
        build(Designed, data, "references.toml")


def test_thresholds_are_those_of_the_chosen_source():
    error = Error(rms=0.1, quantile_999=0.2, worst=0.3, threshold=0.36)
    one = DESIGNED["f16"].model_copy(update={"errors": {"pitch_rate": {"inertial": error}}})
    assert one.error("pitch_rate", "inertial") == error
    assert one.error("pitch_rate", "angle_of_attack") is None and one.error("heading", "none") is None
    assert all(signal in INDEX for signal in DESIGNED["f16"].errors) and len(SIGNALS) == 16
