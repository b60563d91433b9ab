"""The aircraft as an FMU: which scenarios can be one, its frames beside those of a flight, errors of a master."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
import zipfile
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmu_master import INPUTS, OUTPUTS, Master, differing, flown, needs_fmpy

import rig
from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.core.frame import Block, End
from rig.flight.aircraft_fmu import aircraft_archive as archive
from rig.flight.aircraft_fmu.computer_outside import needs_computer, without_computer
from rig.flight.aircraft_fmu.stepped import SteppedAircraft
from rig.flight.loop import fly_rows
from rig.scenario.scenario import Scenario, load, names

VERSIONS = ("2", "3")
SHORT = ("duration_s=3", "faults.0.start_s=1")
SCENARIOS = {  # a sensor, a servo's coil, a surface in another aircraft
    "f16_altitude_step_turbulence": ("duration_s=3",),
    "f16_elevator_coil_hardover": SHORT,
    "b737_rudder_oscillation": SHORT,
}


def reason(scenario: dict[str, Any]) -> str | None:
    """The key that needs the flight computer inside, read from the file's text alone."""
    if scenario.get("computers", {}).get("count", 1) > 1:
        return "computers.count"
    for i, fault in enumerate(scenario.get("faults", [])):
        if "on" in fault:
            return f"faults.{i}.on"
        words = re.findall(r"[a-z_][a-z_.]*", fault.get("when", ""))
        if any("." not in word and word not in ("and", "or", "not", "abs") for word in words):
            return f"faults.{i}.when"
        if fault.get("signal", "").startswith("reference."):
            return f"faults.{i}.signal"
    return None


def key_of_bundled(name: str) -> str | None:
    return reason(tomllib.loads((bundled("faults") / f"{name}.toml").read_text()))


def test_a_bundled_scenario_is_refused_where_it_needs_its_flight_computer_and_nowhere_else():
    expected = {name: key_of_bundled(name) for name in names()}
    found = {name: needs_computer(load(name)) for name in names()}
    assert {name: text.partition(": ")[0] or None for name, text in found.items()} == expected
    assert {key and re.sub(r"\d+", "N", key) for key in expected.values()} == {
        *(None, "computers.count", "faults.N.on", "faults.N.when", "faults.N.signal"),
    }
    assert sum(key is None for key in expected.values()) >= 80


def stepped(scenario: Scenario, rows: Block) -> list[tuple[int, str]]:
    """The first fields that differ from the flight's when its surfaces are fed back, without FMI."""
    aircraft = SteppedAircraft(without_computer(scenario, "it"))
    fields = sorted({field for field, _ in OUTPUTS.values()})
    for k in range(len(rows)):
        wrong = [(k, name) for name in fields if aircraft.rows[name][aircraft.row].tobytes() != rows[name][k].tobytes()]
        if wrong:
            return wrong
        if k < len(rows) - 1 and not aircraft.step(rows["surface"][k].tolist()):
            return [(k, "step")]
    assert (aircraft.end == End.FLYING) == (rows["end"][-1] == End.FLYING)
    return []


@pytest.mark.parametrize("name", SCENARIOS)
def test_fed_with_the_surfaces_of_a_flight_it_flies_the_same_bits(name: str):
    scenario = load(name, SCENARIOS[name])
    assert stepped(scenario, fly_rows(scenario)) == []


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in names() if key_of_bundled(name) is None])
def test_every_bundled_scenario_that_can_be_an_fmu_flies_the_same_bits(name: str):
    scenario = load(name)
    assert stepped(scenario, fly_rows(scenario, 3500)) == []


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """fmu(scenario, version, overrides) -> its FMU, built once for all tests of this module."""
    folder, made = tmp_path_factory.mktemp("fmus"), dict[tuple[Any, ...], Path]()

    def build(name: str = "b737_rudder_oscillation", version: Any = "2", sets: tuple[str, ...] = SHORT) -> Path:
        key = (name, version, sets)
        if key not in made:
            made[key] = folder / f"x{len(made)}.fmu"
            archive.build(name, made[key], version, sets)
        return made[key]

    return build


# The quick tests: each of FMI 3, and one flight of FMI 2.
BOTH = [pytest.param("2", marks=pytest.mark.long), "3"]
QUICK = {("b737_rudder_oscillation", "3"), ("f16_elevator_coil_hardover", "2")}


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_fmpy_finds_no_fault_with_the_fmu(fmu: Callable[..., Path], version: str):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu(version=version))) == []


@needs_fmpy
@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param(name, version, marks=[pytest.mark.long] if (name, version) not in QUICK else [])
        for name in SCENARIOS
        for version in VERSIONS
    ],
)
def test_every_output_in_fmpy_has_the_bits_of_the_log(
    fmu: Callable[..., Path], tmp_path: Path, name: str, version: str
):
    flight = rig.fly(name, overrides=SCENARIOS[name], out=tmp_path)
    master = Master(fmu(name, version, SCENARIOS[name]), tmp_path)
    assert flown(master, flight.rows) == []
    master.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_an_input_that_is_never_set_stays_in_trim(fmu: Callable[..., Path], tmp_path: Path, version: str):
    name = "f16_altitude_step_turbulence"
    sets = ("duration_s=1", "turbulence=none", "faults=[]", "pilot.manoeuvres=[]")
    trim = SteppedAircraft(load(name, sets)).trim
    master = Master(fmu(name, version, sets), tmp_path)
    assert tuple(master.get(INPUTS)) == trim
    before = master.row()["flight.altitude_m"]
    for _ in range(100):
        master.step()
    assert abs(master.row()["flight.altitude_m"] - before) < 1.0
    master.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_parameters_fly_as_the_same_overrides_of_the_scenario(fmu: Callable[..., Path], tmp_path: Path, version: str):
    """Onset, size and seed; what is read before the first step is already of them."""
    file = fmu(version=version)
    given = {"seed": 11, "fault[1].start_s": 0.5, "fault[1].amplitude": 0.02}
    rows = fly_rows(load("b737_rudder_oscillation", [*SHORT, "faults.0.start_s=0.5", "faults.0.amplitude=0.02"], 11))
    plain = fly_rows(load("b737_rudder_oscillation", SHORT))
    assert rows["channels"].tobytes() != plain["channels"].tobytes()
    master = Master(file, tmp_path, **given)
    assert [float(master.get([name])[0]) for name in given] == list(given.values())
    assert flown(master, rows, every=10) == []
    master.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_a_parameter_that_is_not_allowed_ends_the_start_with_the_reason(
    fmu: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], version: str
):
    with pytest.raises(Exception, match="xit"):
        Master(fmu(version=version), tmp_path, **{"fault[1].start_s": -1.0})
    assert "faults.0.start_s" in capsys.readouterr().out


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_after_a_reset_it_flies_the_same_flight_again_with_the_first_parameters(
    fmu: Callable[..., Path], tmp_path: Path, version: str
):
    rows = fly_rows(load("b737_rudder_oscillation", SHORT), 120)
    master = Master(fmu(version=version), tmp_path, seed=5)
    for _ in range(50):
        master.step()
    master.fmu.reset()
    master.begin({})
    assert flown(master, rows, every=10) == []
    master.close()


@needs_fmpy
def test_instances_in_one_process_do_not_disturb_each_other(fmu: Callable[..., Path], tmp_path: Path):
    """Two of one FMU with different seeds, one of the other version, and one of another aircraft, in turns."""
    name = "b737_rudder_oscillation"
    others = ("f16_elevator_coil_hardover", SHORT)
    flights = [
        (Master(fmu(), tmp_path), fly_rows(load(name, SHORT), 150)),
        (Master(fmu(), tmp_path, seed=9), fly_rows(load(name, SHORT, 9), 150)),
        (Master(fmu(version="3"), tmp_path), fly_rows(load(name, SHORT), 150)),
        (Master(fmu(others[0], "2", others[1]), tmp_path), fly_rows(load(*others), 150)),
    ]
    for k in range(149):
        for master, rows in flights:
            if k % 10 == 0:
                assert differing(master.row(), rows, k) == []
            master.put(INPUTS, rows["surface"][k].tolist())
            master.step()
    for master, rows in flights:
        assert differing(master.row(), rows, 149) == []
        master.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_what_cannot_be_flown_is_discarded_with_the_reason_and_the_flight_continues(
    fmu: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], version: str
):
    from fmpy.fmi1 import FMICallException

    rows = fly_rows(load("b737_rudder_oscillation", SHORT), 60)
    master = Master(fmu(version=version), tmp_path)
    odd = [(master.time_s + 0.2, length) for length in (0.005, 0.015, 0.0, -0.01, float("nan"))]
    for k in range(59):
        good = rows["surface"][k].tolist()
        if k == 20:
            for time_s, length in odd:
                with pytest.raises(FMICallException, match="status 2"):
                    master.fmu.doStep(time_s, length)
                assert f"length is {length} s, must be a whole number of frames of 0.01 s" in capsys.readouterr().out
            with pytest.raises(FMICallException, match="status 2"):
                master.fmu.doStep(7.0, 0.01)
            assert "it begins at 7.0 s, the flight is at 0.2 s" in capsys.readouterr().out
            for bad in (float("nan"), float("inf")):
                master.put(INPUTS, [*good[:1], bad, *good[2:]])
                with pytest.raises(FMICallException, match="status 2"):
                    master.step()
                assert f"surface.aileron_rad is {bad}" in capsys.readouterr().out
            master.put(["fault[1].amplitude"], [0.5])
            with pytest.raises(FMICallException, match="status 2"):
                master.step()
            assert "fault[1].amplitude was set in flight" in capsys.readouterr().out
        assert differing(master.row(), rows, k) == []
        master.put(INPUTS, good)
        master.step()
    master.close()


@needs_fmpy
def test_a_step_of_several_frames_holds_the_surfaces(fmu: Callable[..., Path], tmp_path: Path):
    one, five = Master(fmu(), tmp_path), Master(fmu(), tmp_path)
    for _ in range(20):
        for _ in range(5):
            one.step()
        five.step(0.05)
    ours, theirs = one.row(), five.row()
    assert all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)
    one.close()
    five.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_a_master_may_begin_at_another_time(fmu: Callable[..., Path], tmp_path: Path, version: str):
    """The flight is the same; onsets count from its begin."""
    rows = fly_rows(load("b737_rudder_oscillation", SHORT), 130)
    master = Master(fmu(version=version), tmp_path, 2.0)
    assert flown(master, rows, every=10) == []
    if version == "3":
        assert master.get(["time"])[0] == pytest.approx(2.0 + 1.29, abs=1e-9)
    master.close()


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
def test_after_the_loss_of_the_aircraft_no_step_is_flown(
    fmu: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], version: str
):
    from fmpy.fmi1 import FMICallException

    master = Master(fmu("f16_altitude_step_turbulence", version, ("duration_s=3",)), tmp_path)
    master.put(INPUTS[:1], [-0.4])  # full nose up, and held
    answer: Any = None
    for _ in range(1000):
        answer = master.step()
        if master.row()["end"] != End.FLYING:
            break
    last = master.row()
    assert last["end"] != End.FLYING
    assert answer is None if version == "2" else answer[1]  # terminateSimulation
    with pytest.raises(FMICallException, match="status 2"):
        master.step()
    assert f"the flight is over since {master.time_s:g} s: " in capsys.readouterr().out
    assert all(master.row()[name].tobytes() == last[name].tobytes() for name in last)
    master.close()


def changed(file: Path, target: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """The FMU with another ``rig.json``."""
    with zipfile.ZipFile(file) as given, zipfile.ZipFile(target, "w") as made:
        for entry in given.namelist():
            data = given.read(entry)
            if entry == "resources/rig.json":
                built = json.loads(data)
                change(built)
                data = json.dumps(built).encode()
            made.writestr(entry, data)
    return target


@needs_fmpy
@pytest.mark.parametrize("version", BOTH)
@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            lambda built: built["packages"].update({"jsbsim-rig": "0.0.1"}),
            r"this FMU was built with jsbsim-rig 0\.0\.1, Python in \S+ has \S+: build it again",
        ),
        (
            lambda built: built["packages"].update(jsbsim="1.0"),
            r"with jsbsim 1\.0, Python in \S+ has \S+: build it again",
        ),
        (
            lambda built: built["packages"].update(nothing="1.0"),
            r"with nothing 1\.0, Python in \S+ has none: build it again",
        ),
        (lambda built: built.update(variables="0"), r"other variables than the installed jsbsim-rig: build it again"),
    ],
    ids=["package", "jsbsim", "absent", "variables"],
)
def test_another_version_of_the_package_is_refused_in_one_line(
    fmu: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    version: str,
    change: Callable[[dict[str, Any]], None],
    text: str,
):
    file = changed(fmu(version=version), tmp_path / "other.fmu", change)
    with pytest.raises(Exception, match="Failed to instantiate"):
        Master(file, tmp_path)
    found = [line for line in capsys.readouterr().out.splitlines() if re.search(text, line)]
    assert len(found) == 1


def test_the_same_scenario_is_built_to_the_same_bytes(fmu: Callable[..., Path], tmp_path: Path):
    for version in VERSIONS:
        again = tmp_path / f"{version}.fmu"
        archive.build("b737_rudder_oscillation", again, version, SHORT)
        assert again.read_bytes() == fmu(version=version).read_bytes()


def test_the_code_and_the_files_that_a_scenario_names_do_not_go_into_the_fmu(tmp_path: Path):
    """No manager class, no set of requirements, no fault that a key begins."""
    (tmp_path / "mine.toml").write_text(
        'aircraft = "f16"\nduration_s = 1\nrequirements = ["redundancy"]\n[redundancy]\nmanager = "absent:Mine"\n'
        '[[live]]\nkey = "a"\nfault = { kind = "offset", signal = "pitch_rate", channels = [1], offset = 0.1 }\n'
    )
    archive.build(str(tmp_path / "mine.toml"), tmp_path / "mine.fmu", "2")
    with zipfile.ZipFile(tmp_path / "mine.fmu") as made:
        text = made.read("resources/scenario.toml").decode()
    assert "absent" not in text and "requirements" not in text and tomllib.loads(text)["live"] == []


@needs_fmpy
def test_a_noise_file_goes_with_the_fmu(tmp_path: Path):
    noise = tmp_path / "noise.csv"
    np.savetxt(noise, np.random.default_rng(3).normal(0, 0.01, (200, 4)), delimiter=",")
    sets = [
        f'sensors.pitch_rate.noise_file="{noise}"',
        "sensors.pitch_rate.noise_rate_hz=50",
        "duration_s=1",
        "faults=[]",
    ]
    rows = fly_rows(load("f16_pitch_rate_hardover", sets), 50)
    archive.build("f16_pitch_rate_hardover", tmp_path / "x.fmu", "2", sets)
    noise.unlink()
    master = Master(tmp_path / "x.fmu", tmp_path)
    assert flown(master, rows, every=7) == []
    master.close()


def test_an_aircraft_flies_without_faults_and_a_folder_is_one_too(
    rig_command: Callable[..., tuple[int, str, str]], tmp_path: Path
):
    shutil.copytree(bundled("aircraft") / "b737", tmp_path / "own")
    shutil.copy(bundled("aircraft") / "defaults.toml", tmp_path)
    for name in ("b747", "own"):
        code, out, err = rig_command("fmu", "build", name, "--out", f"{name}.fmu", "--json", "--seed", 4)
        assert (code, err) == (0, "")
        assert json.loads(out) == {
            **{"file": f"{name}.fmu", "version": "2", "inputs": 4, "outputs": 306, "parameters": {"seed": 4}},
        }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["f16_computer_stop", "--out", "x.fmu"],
            "f16_computer_stop: computers.count: is 4, must be 1 for an FMU: the flight computer is outside it, "
            "and reads all channels",
        ),
        (
            ["f16_fault_in_the_split", "--out", "x.fmu"],
            "f16_fault_in_the_split: faults.1.on: waits for a vote or a state of the flight computer, which is outside "
            "an FMU; allowed: start_s, when",
        ),
        (
            ["f16_fault_in_the_turn", "--out", "x.fmu", "--version", "3"],
            "f16_fault_in_the_turn: faults.0.when: reads voted values, which are outside an FMU; allowed: names that "
            "begin with true.",
        ),
        (
            ["f16_reference_drift", "--out", "x.fmu"],
            "f16_reference_drift: faults.0.signal: reference.pitch_rate is computed by the flight computer, which is "
            "outside an FMU",
        ),
        (["b737", "--out", "there.fmu"], "--out there.fmu: exists already; choose another name, or delete it"),
        (["b737", "--out", "x.zip"], "--out x.zip: must end with .fmu, as an FMU"),
        (["b737", "--out", "no/x.fmu"], "no/x.fmu: no such folder: no"),
        (
            ["b737", "--out", "x.fmu", "--seed", "2147483648"],
            "b737: seed: 2147483648 is no Integer of FMI 2.0; at most 2147483647, or --version 3",
        ),
        (
            ["b737", "--out", "x.fmu", "--set", "duration_s=no"],
            "scenario with --set: duration_s: must be a number, got 'no'",
        ),
    ],
)
def test_what_cannot_be_an_fmu_is_refused_in_one_line_and_nothing_is_written(
    rig_command: Callable[..., tuple[int, str, str]], tmp_path: Path, arguments: list[str], message: str
):
    (tmp_path / "there.fmu").write_text("old")
    code, out, err = rig_command("fmu", "build", *arguments)
    assert (code, out, err) == (2, "", f"error: {message}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["there.fmu"] and (tmp_path / "there.fmu").read_text() == "old"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["b737", "--out", "x.fmu", "--version", "1"], "'1' is not one of '2', '3'"),
        (["b777", "--out", "x.fmu"], "b777: no such file; nearest bundled: "),
        (["b737"], "--out"),
    ],
)
def test_a_wrong_call_is_refused_in_one_line(
    rig_command: Callable[..., tuple[int, str, str]], tmp_path: Path, arguments: list[str], text: str
):
    code, out, err = rig_command("fmu", "build", *arguments)
    assert code == 2 and out == "" and err.startswith("error: ") and text in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_without_the_package_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    def absent(name: str) -> Any:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(archive, "distribution", absent)
    for version, package in archive.PACKAGES.items():
        with pytest.raises(BadInput, match=rf"^--version {version}: needs {package}: pip install 'jsbsim-rig\[fmu\]'$"):
            archive.build("b737", tmp_path / "x.fmu", version)
