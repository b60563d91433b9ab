"""Notes on scenarios that can be flown and are hardly meant: points not designed, conditions decided before."""

import shutil
from pathlib import Path

import pytest

from rig.cli.fly import long_flight
from rig.core.errors import BadInput
from rig.flight.fly import fly
from rig.scenario import aircraft
from rig.scenario.scenario import load, names
from rig.scenario.scenario_notes import notes
from rig.verdict.requirements.requirement import load_requirements
from rig.verdict.requirements.requirement import names as sets
from rig.verdict.requirements.settled_comparisons import decided_in
from rig.verdict.requirements.settled_comparisons import notes as requirement_notes
from rig.world.faults.reach import never_holding


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(aircraft.folder("f16"), "own")
    path = tmp_path / "own" / "aircraft.toml"
    more = '{ name = "fast", altitude_m = 1000.0, mach = 1.1 }, { name = "mid", altitude_m = 6096.0, mach = 0.7 },'
    path.write_text(path.read_text().replace("flight_points = [", f"flight_points = [ {more}"))
    return path


def of_point(name: str) -> list[str]:
    return notes(load({"aircraft": "own", "flight_point": name}))


def test_a_point_that_was_not_designed_is_told_with_the_command(own: Path):
    [fast], [mid] = of_point("fast"), of_point("mid")
    assert fast.startswith("flight point fast was not designed (not in gains.toml and references.toml)")
    assert "held at those of 31.2 kPa, and it is at 76.1 kPa" in fast and fast.endswith("rig aircraft design own")
    assert "between those of 5.28 kPa and 31.2 kPa" in mid
    assert of_point("20000ft_m06") == []


def test_the_first_point_is_flown_where_none_is_named(own: Path):
    assert notes(load({"aircraft": "own"})) == of_point("fast")


def test_a_point_that_was_moved_after_the_design_is_told(own: Path):
    own.write_text(
        own.read_text().replace(
            '"20000ft_m06", altitude_m = 6096.0, mach = 0.6', '"20000ft_m06", altitude_m = 6096.0, mach = 0.63'
        )
    )
    [moved] = of_point("20000ft_m06")
    assert "at 12.9 kPa, was designed at 11.7 kPa in gains.toml and at 11.7 kPa in references.toml" in moved


def test_a_point_that_lacks_in_one_file_is_told(own: Path):
    path = own.with_name("references.toml")
    path.write_text(path.read_text().replace('name = "20000ft_m06"', 'name = "other"'))
    [lacking] = of_point("20000ft_m06")
    assert "(not in references.toml)" in lacking


def test_no_bundled_scenario_or_aircraft_has_a_note():
    flown = [load(name) for name in names()]
    points = [
        load({"aircraft": name, "flight_point": point.name})
        for name in aircraft.names()
        for point in load({"aircraft": name}).airframe.flight_points
    ]
    assert [notes(each) for each in (*flown, *points)] == [[]] * (len(flown) + len(points))
    assert requirement_notes(load_requirements(sets()), load("f16_stuck_together")) == []


@pytest.mark.parametrize(
    "condition",
    [
        "angle_of_attack > 10",
        "abs(angle_of_attack) > 10 or autopilot_engaged",
        "10 < angle_of_attack",
        "heading > 350",
        "true.pitch_rate >= 10 and true.mach > 0.2",
        "min(pitch_rate, roll_rate) > 6",
        "-angle_of_attack == 2",
        "autopilot_engaged > 1",
        "2 * stick_pitch - 1 > 1.5",
        "roll_angle / 2 < -1.6",
    ],
)
def test_a_comparison_beyond_the_range_of_its_signal_never_holds(condition: str):
    assert [each.holds for each in never_holding(condition)] == [False]


@pytest.mark.parametrize(
    "condition",
    [
        "angle_of_attack > 0.2",
        "angle_of_attack < 10",
        "dynamic_pressure / pitch_rate > 1e9",
        "true.altitude_m > 20000",
        "true.angle_of_attack > 1.3",
        "angle_of_attack != 0.1",
        "abs(roll_rate * 57.3) > 20",
        "max(pitch_rate, 7) > 6",
    ],
)
def test_a_condition_that_may_hold_is_no_note(condition: str):
    assert never_holding(condition) == []


def test_a_note_names_fault_range_and_unit():
    fault = {"kind": "dropout", "signal": "pitch_rate", "channels": [1], "when": "angle_of_attack > 10"}
    [note] = notes(load({"aircraft": "f16", "faults": [fault]}))
    assert note.startswith(
        "faults.0.when: angle_of_attack > 10 is never true: the range of angle_of_attack is -0.7 to 1.2 rad"
    )


@pytest.mark.parametrize(
    ("formula", "holds"),
    [
        ("always[0, 1] abs(truth.angle_of_attack) <= 10", [True]),
        ("eventually[0, 5] voted.pitch_rate > 20", [False]),
        ("abs(error.heading) <= 5 until[0, 2] level.pitch_rate > 4", [True, False]),
        ("1000 * level.pitch_rate < 500 or healthy.pitch_rate.1", []),
        ("not (departure < -2)", [False]),
    ],
)
def test_a_requirement_that_is_decided_before_the_flight_is_told(formula: str, holds: list[bool]):
    assert [each.holds for each in decided_in(formula)] == holds


@pytest.mark.parametrize(
    ("number", "message"),
    [
        ("10 deg", "10 deg is 0.174533 rad"),
        ("2deg/s", "2 deg/s is 0.0349066 rad/s"),
        ("10°", "0.174533 rad"),
        ("3 foo", "'3 foo'"),
    ],
)
def test_a_number_with_a_unit_is_refused_with_what_it_is(number: str, message: str):
    fault = {"kind": "dropout", "signal": "pitch_rate", "channels": [1], "when": f"angle_of_attack > {number}"}
    with pytest.raises(BadInput, match=r"give the number without a unit, in SI units") as refused:
        load({"aircraft": "f16", "faults": [fault]})
    assert message in str(refused.value)


def test_a_long_flight_tells_what_it_takes_before_it(tmp_path: Path):
    size = fly(overrides={"duration_s": 5.0}, out=tmp_path).log.stat().st_size
    [told, servos] = [
        long_flight(load({"aircraft": "f16", "duration_s": 500.0, "actuators": {"model": model}}))
        for model in ("lag", "servo")
    ]
    megabytes = [int(text.split("about ")[1].split(" MB")[0]) for text in (told, servos)]
    assert megabytes[0] == pytest.approx(100 * size / 1e6, rel=0.2) and megabytes[1] > megabytes[0]
    assert told.startswith("50000 frames (500 s of flight)") and long_flight(load({"aircraft": "f16"})) == ""
