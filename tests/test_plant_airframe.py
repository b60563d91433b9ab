"""The aircraft's settings and its actuated copy of the base model."""

from __future__ import annotations

import gc
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from rig.core.errors import BadInput, RigError
from rig.core.frame import SURFACES
from rig.core.settings import build, read_toml
from rig.world.plant import actuated, airframe, loading

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
NAMES = ("f16", "b747", "b737")


def table(name: str = "f16", **changes: Any) -> dict[str, Any]:
    return read_toml(AIRCRAFT / name / "aircraft.toml")["airframe"] | changes


def config(name: str = "f16", **changes: Any) -> airframe.Config:
    return build(airframe.Config, table(name, **changes), "test")


def load(plane: airframe.Config) -> None:
    loading.load(plane, plane.point(), 0.01)


@pytest.mark.parametrize("name", NAMES)
def test_the_first_flight_point_is_the_default(name: str) -> None:
    plane = airframe.read(AIRCRAFT / name / "aircraft.toml")
    assert plane.point() == plane.flight_points[0] == plane.point(plane.flight_points[0].name)


def test_surface_limits_are_in_the_order_of_the_frame() -> None:
    assert dict(zip(SURFACES, config("b747").surface_limits, strict=True)) == {
        "elevator_rad": (-0.35, 0.175),
        "aileron_rad": (-0.35, 0.35),
        "rudder_rad": (-0.35, 0.35),
        "throttle": (0.0, 1.0),
    }


def test_an_unknown_flight_point_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadInput, match=r"'moon'.*20000ft_m06, 30000ft_m05"):
        config().point("moon")


def test_two_flight_points_of_one_name_are_refused() -> None:
    point = {"name": "a", "altitude_m": 1000.0, "mach": 0.5}
    with pytest.raises(BadInput, match="different names"):
        config(flight_points=[point, point])


def test_an_aircraft_file_without_airframe_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "aircraft.toml"
    path.write_text("[sensors]\n")
    with pytest.raises(BadInput, match="airframe: table is missing"):
        airframe.read(path)


def test_an_unknown_base_model_is_refused() -> None:
    with pytest.raises(BadInput, match="no aircraft 'f1600'"):
        load(config(base_model="f1600"))


@pytest.mark.long
def test_an_undeclared_property_is_refused_and_the_process_lives_on() -> None:
    with pytest.raises(BadInput, match="f16 reads 'fcs/flaperon-mix-rad', which is missing"):
        load(config(properties={"fcs/lef-pos-rad": 0.0}))
    gc.collect()  # JSBSim would abort here
    load(config())


def test_a_property_of_jsbsim_cannot_be_declared() -> None:
    with pytest.raises(BadInput, match="'aero/alpha-rad' is JSBSim's own"):
        load(config(properties={"aero/alpha-rad": 0.0}))


def test_a_surface_that_the_aerodynamics_does_not_read_is_refused() -> None:
    rudder = table()["rudder"] | {"position": "fcs/ruder-pos-rad"}
    with pytest.raises(BadInput, match=r"airframe.rudder.position: f16 does not read 'fcs/ruder-pos-rad'"):
        load(config(rudder=rudder))


def test_a_point_that_cannot_be_trimmed_is_refused() -> None:
    plane = config()
    slow = airframe.FlightPoint(name="slow", altitude_m=15_000.0, mach=0.2)
    with pytest.raises(BadInput, match=r"no level trim at 'slow' \(15000 m, Mach 0.2\)"):
        loading.load(plane, slow, 0.01)


def test_the_centre_of_gravity_moves_aft_by_the_stated_length() -> None:
    as_shipped = loading.load(config(cg_x_shift_m=0.0), config().point(), 0.01)
    moved = loading.load(config(cg_x_shift_m=0.1), config().point(), 0.01)
    # Fuel and pilot stay where they are, so the whole moves by the share of the empty weight.
    share = as_shipped["inertia/empty-weight-lbs"] / as_shipped["inertia/weight-lbs"]
    travel_in = moved["inertia/cg-x-in"] - as_shipped["inertia/cg-x-in"]
    assert travel_in * 0.0254 == pytest.approx(0.1 * share, rel=1e-6)


def test_the_copy_keeps_no_shipped_control_and_no_ports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_CACHE_DIR", str(tmp_path))
    load(config("b737"))
    (path,) = tmp_path.glob("airframes/*/737/737.xml")
    tree = ET.parse(path).getroot()
    assert not {child.tag for child in tree} & {"autopilot", "system", "input", "output"}
    assert [child.get("name") for child in tree if child.tag == "flight_control"] == ["rig actuators"]


def test_a_lost_cache_is_made_again_and_changed_settings_get_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_CACHE_DIR", str(tmp_path / "first"))
    load(config())
    monkeypatch.setenv("RIG_CACHE_DIR", str(tmp_path / "second"))
    load(config())
    load(config(cg_x_shift_m=0.17))
    assert len(list((tmp_path / "second" / "airframes").iterdir())) == 2


@pytest.mark.parametrize("name", ["f16/f16.xml", "reads.txt", "sha256.txt"])
@pytest.mark.parametrize("damage", ["cut", "empty", "zeros", "edited", "missing"])
def test_a_damaged_copy_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, damage: str) -> None:
    monkeypatch.setenv("RIG_CACHE_DIR", str(tmp_path))
    load(config())
    (copy,) = (tmp_path / "airframes").iterdir()
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}
    path = copy / name
    whole = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        of = {"cut": whole[:-20], "empty": b"", "zeros": bytes(len(whole)), "edited": bytes([whole[0] ^ 1]) + whole[1:]}
        path.write_bytes(of[damage])
    monkeypatch.setattr(actuated, "_whole", set())  # as another process
    load(config())
    assert {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()} == before
    assert list((tmp_path / "airframes").iterdir()) == [copy]


def test_a_cache_that_cannot_be_written_is_one_line_with_the_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("RIG_CACHE_DIR", str(tmp_path / "file" / "below"))
    with pytest.raises(RigError, match="cannot be written: Not a directory; RIG_CACHE_DIR or XDG_CACHE_HOME"):
        load(config())


def test_a_slower_process_leaves_the_copy_of_the_faster_one(tmp_path: Path) -> None:
    source, target = tmp_path / "plane", tmp_path / "cache" / "key"
    source.mkdir()
    (source / "plane.xml").write_text("<old/>")
    actuated._publish(ET.Element("first"), [], source, target)
    actuated._publish(ET.Element("second"), [], source, target)
    assert (target / "plane" / "plane.xml").read_bytes().endswith(b"<first />")
    assert list(target.parent.iterdir()) == [target]
