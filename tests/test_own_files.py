"""A file of the rig's own, or of JSBSim's package, that cannot be read is named in one line; exit code 1."""

import shutil
from pathlib import Path
from typing import Any

import jsbsim
import pytest

from rig.cli import main as cli
from rig.core import files
from rig.core.errors import BadInput, RigError
from rig.scenario import aircraft
from rig.scenario.scenario import find, load
from rig.show.pages import page
from rig.unit import vectors
from rig.world.plant import actuated, loading

RUBBISH = b"\xff\xfe\x00\x81 no text"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the bundled folders, as an installed package has them."""
    for kind in ("aircraft", "faults"):
        shutil.copytree(files.bundled(kind), tmp_path / "rig" / "bundled" / kind)
    monkeypatch.setattr(files, "__file__", str(tmp_path / "rig" / "util" / "files.py"))
    return tmp_path / "rig" / "bundled"


@pytest.mark.parametrize("broken", ["gone", "folder", "rubbish"])
@pytest.mark.parametrize("name", ["aircraft/defaults.toml", "aircraft/sensor_classes.toml"])
def test_settings_that_all_aircraft_share_are_named(installed: Path, name: str, broken: str, rig_command: Any):
    path = installed / name
    path.unlink()
    if broken == "folder":
        path.mkdir()
    elif broken == "rubbish":
        path.write_bytes(RUBBISH)
    classed = ["--set", "sensors.pitch_rate.class=tactical"]
    code, _, err = rig_command("scenario", "check", *classed)
    assert code == 1 and err.startswith(f"failed: {path}: ") and err.count("\n") == 1


@pytest.mark.parametrize(
    "name", ["faults/f16_pitch_rate_hardover.toml", "aircraft/f16/aircraft.toml", "faults", "aircraft"]
)
def test_a_file_that_is_flown_by_default_is_named_when_it_is_gone(installed: Path, name: str, rig_command: Any):
    path = installed / name
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    code, _, err = rig_command("scenario", "check")
    assert (
        code == 1
        and err.startswith(f"failed: {path}: cannot be read: the installation of the rig is incomplete")
        and err.count("\n") == 1
    )


def test_who_names_something_that_is_not_there_still_hears_what_there_is(installed: Path):
    with pytest.raises(BadInput, match="unknown aircraft 'f17'"):
        aircraft.folder("f17")
    with pytest.raises(BadInput, match="nearest bundled"):
        find("f16_pitch_rate_hardovr")


def test_a_scenario_that_is_no_text_is_refused_by_name(tmp_path: Path, rig_command: Any):
    path = tmp_path / "s.toml"
    path.write_bytes(RUBBISH)
    for command in (["fly", str(path), "--out", str(tmp_path / "logs")], ["scenario", "check", str(path)]):
        code, _, err = rig_command(*command)
        assert code == 2 and err.startswith(f"error: {path}: not valid TOML") and err.count("\n") == 1
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize("template", ["base.html", "thresholds.html"])
@pytest.mark.parametrize("rubbish", [False, True])
def test_a_template_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, template: str, rubbish: bool):
    for path in Path(page.__file__).parent.glob("*.html"):
        shutil.copy(path, tmp_path)
    (tmp_path / template).unlink()
    if rubbish:
        (tmp_path / template).write_bytes(RUBBISH)
    monkeypatch.setattr(page, "__file__", str(tmp_path / "page.py"))
    with pytest.raises(RigError, match=rf"{template}: cannot be read: the installation of the rig") as failed:
        page.write_page(tmp_path / "out.html", "thresholds.html", {}, {})
    assert not isinstance(failed.value, BadInput) and not (tmp_path / "out.html").exists()


@pytest.mark.parametrize("content", [None, RUBBISH, b"PK\x03\x04 cut"])
def test_the_vectors_of_the_interface_test_are_named(tmp_path: Path, content: bytes | None):
    path = tmp_path / "vectors.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RigError, match=r"vectors.npz: cannot be read: the installation of the rig"):
        vectors.load(path)


def test_jsbsim_without_its_data_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(jsbsim, "get_default_root_dir", lambda: str(tmp_path))
    scenario = load(None)
    with pytest.raises(
        RigError, match="aircraft: a file of JSBSim's package, which is not installed as a whole"
    ) as failed:
        loading.load(scenario.airframe, scenario.airframe.point(), 0.01)
    assert not isinstance(failed.value, BadInput)


def test_a_model_of_jsbsim_that_is_a_folder_or_is_gone_is_named(tmp_path: Path):
    (tmp_path / "f16.xml").mkdir()
    for name in ("f16.xml", "gone.xml"):
        with pytest.raises(RigError, match=rf"{name}: a file of JSBSim's package"):
            actuated.parsed(tmp_path / name)


def test_a_file_that_the_system_refuses_is_one_line_wherever_it_is_read(
    monkeypatch: pytest.MonkeyPatch, rig_command: Any
):
    def refuse(arguments: list[str]) -> int:
        raise PermissionError(13, "Permission denied", "/somewhere/a file")

    monkeypatch.setattr(cli, "run", refuse)
    code, _, err = rig_command()
    assert (code, err) == (1, "failed: /somewhere/a file: Permission denied\n")
