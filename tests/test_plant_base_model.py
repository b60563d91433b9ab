"""What a model of the installed JSBSim tells of itself, against its file read by hand."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import jsbsim
import pytest

from rig.core.errors import BadInput
from rig.world.plant import actuated, airframe, base_model, loading
from rig.world.plant.airframe import Config, FlightPoint
from rig.world.plant.model_root import model_root

POINT = FlightPoint(name="any", altitude_m=1500.0, mach=0.16)


def light(held: dict[str, float] | None = None, aileron: str = "fcs/effective-aileron-pos") -> Config:
    """The c172x as it would be written by hand."""
    positions = {"elevator": "fcs/elevator-pos-rad", "aileron": aileron, "rudder": "fcs/rudder-pos-rad"}
    actuator = {"lag_s": 0.1, "rate_limit_rad_s": 1.0, "min_rad": -0.3, "max_rad": 0.3}
    table = {
        "base_model": "c172x",
        "flight_points": [POINT.model_dump()],
        **{name: {**actuator, "position": position} for name, position in positions.items()},
        "throttle": {"lag_s": 0.2, "rate_limit_1_s": 0.5},
        "accelerometer": {"x_m": 0.5, "y_m": 0.0, "z_m": 0.0},
        "limits": {
            "angle_of_attack_min_rad": -0.3,
            "angle_of_attack_max_rad": 0.35,
            "sideslip_max_rad": 0.35,
            "load_factor_min": -2.0,
            "load_factor_max": 5.0,
            "body_rate_max_rad_s": 1.5,
        },
        "held": held or {},
    }
    made = airframe.parse(table, "test")
    assert isinstance(made, Config)
    return made


def test_the_effective_aileron_is_found_with_the_reach_of_its_sides():
    """c172x: the equations read no left aileron; its sides reach -0.350 to 0.260 rad."""
    found = base_model.read("c172x")
    assert found.positions["aileron"] == "fcs/effective-aileron-pos"
    assert found.stops["aileron"] == pytest.approx((-0.305, 0.305))
    assert (found.engine, found.engines, found.blade_angles_deg) == ("piston", 1, (22.0, 22.0))


def test_stops_are_range_times_gain():
    """A320: -25 to 35 by 0.018 for the elevator, -20 to 15 by 0.02 for the left aileron."""
    found = base_model.read("A320")
    assert found.stops["elevator"] == pytest.approx((-0.45, 0.63))
    assert found.stops["aileron"] == pytest.approx((-0.40, 0.30))
    assert (found.engine, found.engines, found.blade_angles_deg) == ("turbine", 2, None)
    assert found.wing_area_m2 == pytest.approx(1317 * 0.3048**2)


def test_a_normalised_position_is_taken_where_no_other_is_read():
    assert base_model.read("T38").positions["elevator"] == "fcs/elevator-pos-norm"


def test_rad_comes_before_other_units_and_left_before_right():
    reads = ["fcs/aileron-pos-norm", "fcs/right-aileron-pos-rad", "fcs/left-aileron-pos-rad", "fcs/mag-aileron-pos-rad"]
    assert base_model.position("x", "aileron", reads) == "fcs/left-aileron-pos-rad"


def test_aircraft_up_to_the_commuter_limit_are_light():
    assert base_model.read("c310").kind(8618.0) == "light"
    assert base_model.read("c310").kind(8619.0) == "transport"
    assert base_model.read("t6texan2").kind(3000.0) == "light"


def test_afterburners_make_a_fighter_but_for_a_bombers_mass():
    assert base_model.read("f16").kind(9000.0) == "fighter"
    assert base_model.read("Concorde").kind(100_000.0) == "transport"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("c172y", "JSBSim has no aircraft 'c172y'; nearest: c172x"),
        ("SGS", "SGS has no engine"),
        ("Submarine_Scout", "reads no elevator position; of fcs/ it reads: fcs/elevator-pos-deg"),
    ],
)
def test_a_model_that_the_rig_cannot_fly_is_refused(name: str, says: str):
    with pytest.raises(BadInput, match=says.replace("(", "\\(")):
        base_model.read(name)


def test_a_position_that_is_not_read_names_those_that_are():
    with pytest.raises(BadInput, match=r"does not read 'fcs/left-aileron-pos-rad'; .*fcs/effective-aileron-pos"):
        loading.load(light(aileron="fcs/left-aileron-pos-rad"), POINT, 0.01)


def test_what_is_held_stays_through_the_trim():
    fdm = loading.load(light({"fcs/mixture-cmd-norm[0]": 0.7}), POINT, 0.01)
    assert fdm["fcs/mixture-pos-norm"] == pytest.approx(0.7)


def test_a_held_property_that_is_not_there_is_refused_with_the_nearest():
    with pytest.raises(
        BadInput, match=r"airframe.held: c172x has no property 'fcs/mixture-cmd-nrm'; .*mixture-cmd-norm"
    ):
        loading.load(light({"fcs/mixture-cmd-nrm": 0.7}), POINT, 0.01)


@pytest.mark.parametrize(
    "text", [b"", b"junk", b"<a><b></a>", b"<a>\xe9</a>", b'<?xml version="1.0" encoding="none-such"?><a/>']
)
def test_a_model_that_is_no_xml_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: bytes):
    model = tmp_path / "aircraft" / "own" / "own.xml"
    model.parent.mkdir(parents=True)
    model.write_bytes(text)
    monkeypatch.setattr(base_model, "model_root", lambda: tmp_path)
    with pytest.raises(BadInput, match=r"airframe\.base_model: .*own\.xml cannot be read: ") as error:
        base_model.read("own")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("unit", "x"), [("PARSEC", "1.0"), ("IN", "far")])
def test_a_centre_of_gravity_that_is_no_place_is_one_line(unit: str, x: str):
    tree = ET.fromstring(f'<a><mass_balance><location name="CG" unit="{unit}"><x>{x}</x></location></mass_balance></a>')
    with pytest.raises(BadInput, match="the CG location of its mass balance cannot be read: "):
        actuated._shift_cg(tree, 0.0)


def test_the_models_are_found_beside_the_package_where_the_environment_hides_them(monkeypatch: pytest.MonkeyPatch):
    """In a host that starts Python itself JSBSim looks in an environment that is not its own."""
    found = model_root()
    assert (found / "aircraft" / "f16" / "f16.xml").is_file()

    def lost() -> str:
        raise OSError("Can't find the default root directory")

    monkeypatch.setattr(jsbsim, "get_default_root_dir", lost)
    assert model_root().samefile(found)
