"""A unit as an FMU: its description, a flight of the same bits as the library's, whatever goes wrong with it."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
import zipfile
from functools import cache
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from unit_files import HERE, SOURCES, build, compiled, kept, needs_a_compiler, of_sources, unit, written

import rig
from rig.bench.unit_check import check
from rig.core.errors import BadInput, RigError
from rig.core.frame import UnitStatus
from rig.core.renamed import names_of_variable
from rig.studies.campaign.worker import flown_with
from rig.unit import fmu as fmu_transport
from rig.unit.fmu_description import TOKEN, Version, description, variables
from rig.unit.unit_file import Unit
from rig.unit.unit_records import CONFIG, HELLO, INPUT, LAW_INPUT, OF_LAW, OUTPUT

needs_fmpy = pytest.mark.skipif(find_spec("fmpy") is None, reason="no FMPy: pip install 'jsbsim-rig[fmi]'")
VERSIONS = get_args(Version)
FOLDERS = {"2": "linux64", "3": f"{os.uname().machine}-linux"}
SHORT = ("duration_s=2", "faults.0.start_s=0.5")


@pytest.fixture(autouse=True)
def _nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """No folder into which an FMU was unpacked, and none of a unit's own."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    yield
    assert [*tmp_path.glob("rig-fmu-*"), *tmp_path.glob("rig-unit-*")] == []


@cache
def fmu(version: Version, name: str = "monitor") -> Path:
    """An example as the Makefile packs it."""
    target = f"{name}.fmu" if version == "2" else f"{name}_fmi3.fmu"
    return build(target, RIG=str(Path(sys.executable).with_name("rig")), PYTHON=sys.executable)


@cache
def packed(version: Version, *sources: Path) -> Path:
    """Other C files as an FMU."""
    library = of_sources("rig_unit.so", [*sources, SOURCES / "fmu.c"], f"-DFMI={version}", f"-I{SOURCES}")
    return archived(version, description(version), library)


def archived(version: Version, text: str, library: Path) -> Path:
    """A description and a library as an FMU."""

    def make(folder: Path) -> Path:
        with zipfile.ZipFile(folder / "unit.fmu", "w") as archive:
            archive.writestr("modelDescription.xml", text)
            archive.write(library, f"binaries/{FOLDERS[version]}/rig_unit.so")
        return folder / "unit.fmu"

    return kept("unit.fmu", [version, text, library.read_bytes()], make)


def faulty(version: Version) -> Path:
    return packed(version, HERE / "fmi_faulty.c", SOURCES / "first_valid.c")


def unit_of(folder: Path, path: Path, **keys: Any) -> Unit:
    return written(folder, {"name": "u", "transport": "fmu", "path": str(path), **keys})


def fly(out: Path, tested: Unit, **more: Any) -> rig.Flight:
    return rig.fly(overrides=SHORT, out=out, unit=tested, **more)


def changed(whole: Path, folder: Path, pattern: str, text: str) -> Path:
    """An FMU with another description."""
    target = folder / "changed.fmu"
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(target, "w") as archive:
        for name in source.namelist():
            data = source.read(name)
            if name == "modelDescription.xml":
                data = re.sub(pattern, text, data.decode(), flags=re.DOTALL).encode()
            archive.writestr(name, data)
    return target


# The description ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", VERSIONS)
def test_the_description_has_every_field_of_the_records_and_nothing_else(version: Version):
    found = {re.split(r"[\[.]", variable.name)[0] for variable in variables(version)}
    heads = set(HELLO.names or ())
    assert found == {
        name
        for dtype in (CONFIG, INPUT, OUTPUT)
        for name in set(dtype.names or ()) - heads
        if not name.startswith("pad_")
    } | {"law_input"}
    of_law = {re.split(r"[\[.]", one.name)[1] for one in variables(version) if one.name.startswith("law_input.")}
    assert of_law == set(OF_LAW)
    for record, dtype in enumerate((CONFIG, INPUT, OUTPUT, LAW_INPUT)):
        known = [variable for variable in variables(version) if variable.record == record]
        covered = np.zeros(dtype.itemsize, int)
        for variable in known:
            covered[variable.first : variable.first + variable.count * variable.width] += 1
        assert set(covered) == {0, 1}, "no byte twice"
        assert len({variable.reference for variable in known}) == len(known)
    assert max(variable.first for variable in variables(version)) < 1 << 14, "a value reference has room for it"


@needs_fmpy
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_finds_no_fault_with_the_description(tmp_path: Path, version: Version):
    from fmpy import read_model_description
    from fmpy.validation import validate_model_description

    path = tmp_path / "modelDescription.xml"
    path.write_text(description(version))
    found = read_model_description(str(path), validate=True, validate_model_structure=True)
    named = {variable.name: variable for variable in found.modelVariables}
    assert found.guid == TOKEN and found.coSimulation is not None
    assert len(named) == len(variables(version)) + (version == "3")
    channel = "channels[1,3]" if version == "2" else "channels"
    assert named[channel].causality == "input" and named["said"].causality == "output"
    assert named["aircraft"].type == "String" and named["rate_hz"].variability == "fixed"
    shapes = {re.sub(r"\d+", "1", variable.name): variable for variable in found.modelVariables}  # a parse takes 5 ms
    found.modelVariables = list(shapes.values())
    assert len(shapes) > 50 and validate_model_description(found, validate_variable_names=True) == []


@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize(
    ("version", "described"),
    [
        ("2", "before 1.0"),
        ("3", "with settings that are gone"),
        pytest.param("2", "with settings that are gone", marks=pytest.mark.long),
        pytest.param("3", "before 1.0", marks=pytest.mark.long),
    ],
)
def test_an_fmu_with_the_names_of_an_earlier_description_flies_the_same(
    tmp_path: Path, version: Version, described: str
):
    """Settings that are gone are 0 there."""
    at = {"with settings that are gone": 1, "before 1.0": 2}[described]
    lines = re.sub(r'(?<= name=")[^"]+', lambda name: names_of_variable(name[0])[at], description(version))
    old = {1: ("signal[1].outlier_threshold", "slow_faults[1].equalise_gain"), 2: ("lasting[1].bias_bound",)}[at]
    assert all(f'name="{name}"' in lines for name in old) and "reserved" not in lines
    with zipfile.ZipFile(fmu(version)) as archive:
        archive.extract(f"binaries/{FOLDERS[version]}/rig_unit.so", tmp_path)
    earlier = archived(version, lines, tmp_path / "binaries" / FOLDERS[version] / "rig_unit.so")
    assert len({fly(tmp_path, unit_of(tmp_path, one)).digest for one in (fmu(version), earlier)}) == 1


def test_rig_unit_header_prints_the_description(rig_command):
    for version in VERSIONS:
        code, out, _ = rig_command("unit", "header", "--fmu", version)
        assert code == 0 and out == description(version)
    code, _, err = rig_command("unit", "header", "--fmu", "1")
    assert code == 2 and "'1' is not one of '2', '3'" in err


# In flight ---------------------------------------------------------------------------------------------------


@needs_fmpy
@needs_a_compiler
def test_the_monitor_as_an_fmu_flies_the_bits_of_the_library(tmp_path: Path):
    flights = [fly(tmp_path, unit(tmp_path, "monitor"))]
    flights += [fly(tmp_path, unit_of(tmp_path, fmu(version))) for version in VERSIONS]
    assert len({flight.digest for flight in flights}) == 1
    for flight, said in zip(flights, ("library", "FMI 2.0", "FMI 3.0"), strict=True):
        assert (flight.rows["unit"] == UnitStatus.ANSWERED).all() and flight.failed == {"pitch_rate": [3]}
        assert flight.unit is not None and flight.unit["said"] == said and flight.unit["reproducible"]


@pytest.mark.long
@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize("version", VERSIONS)
def test_it_meets_every_requirement_of_the_conformance_test_to_the_bit(tmp_path: Path, version: Version):
    """A session after another begins as the first, among others."""
    unit_of(tmp_path, fmu(version))
    found = check(tmp_path / "unit.toml")
    assert [one for one in found.requirements if not one.passed] == []
    assert found.grade == "bits"


@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize("version", ["2", pytest.param("3", marks=pytest.mark.long)])
def test_a_discarded_step_is_refused_and_the_last_answer_flown(tmp_path: Path, version: Version):
    flight = fly(tmp_path, unit_of(tmp_path, faulty(version), timeout_s=60, environment={"FAULT": "discard"}))
    rows = flight.rows
    assert np.flatnonzero(rows["unit"] != UnitStatus.ANSWERED).tolist() == [50]
    assert rows["unit"][50] == UnitStatus.REFUSED and rows["unit_age"][50] == 1
    assert np.array_equal(rows["voted"][50], rows["voted"][49])
    assert flight.unit is not None and flight.unit["refused"] == 1


STEP = {"2": "fmi2DoStep", "3": "fmi3DoStep"}
DEATHS = {
    "error": "failed: {} returned error",
    "fatal": "failed: {} returned fatal",
    "end": "failed: {}: the FMU requests the end of the simulation",
}


@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize(
    ("fault", "version"),
    [
        *(("error", "2"), ("fatal", "3"), ("end", "3")),
        *(pytest.param(*one, marks=pytest.mark.long) for one in (("error", "3"), ("fatal", "2"), ("end", "2"))),
    ],
)
def test_an_fmu_that_fails_ends_the_flight_in_one_line(tmp_path: Path, fault: str, version: Version):
    with pytest.raises(RigError) as said:
        fly(tmp_path, unit_of(tmp_path, faulty(version), environment={"FAULT": fault}))
    text, _, log = str(said.value).partition("; the log is complete up to there: ")
    assert text == f"{tmp_path}/unit.toml: u, frame 50: {DEATHS[fault].format(STEP[version])}"
    assert len(rig.read_log(log).rows) == 50


LOGGED = {
    "open": r"refuses the flight: fmi2ExitInit.* returned error; it printed: \[ERROR\] rig_unit_open returned 7",
    "error": r"frame 50: failed: fmi2DoStep returned error; it printed: \[ERROR\] rig_unit_step returned 5",
    "segv": r"frame 50: killed by signal 11 \(SIGSEGV\)",
}


@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize("fault", ["open", "error", pytest.param("segv", marks=pytest.mark.long)])
def test_what_an_fmu_has_logged_is_in_the_line(tmp_path: Path, fault: str):
    fmu = packed("2", SOURCES / "fmi2.c", HERE / "faulty.c")
    with pytest.raises(RigError, match=LOGGED[fault]):
        fly(tmp_path, unit_of(tmp_path, fmu, environment={"FAULT": fault}))


@needs_fmpy
@needs_a_compiler
def test_an_fmu_that_dies_is_started_again(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(packed("2", SOURCES / "fmi2.c", HERE / "faulty.c"), tmp_path / "unit.fmu")
    tested = unit_of(tmp_path, Path("unit.fmu"), on_dead="restart", environment={"FAULT": "segv once"})
    flight = fly(tmp_path, tested)
    assert np.flatnonzero(flight.rows["unit"] == UnitStatus.RESTARTED).tolist() == [50]
    assert flight.unit is not None and flight.unit["restarts"] == 1 and flight.survived


# What cannot be flown ----------------------------------------------------------------------------------------


def _nothing(folder: Path) -> Path:
    path = folder / "text.fmu"
    path.write_text("not an archive")
    return path


def _empty(folder: Path) -> Path:
    path = folder / "empty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "nothing here")
    return path


def _cut(folder: Path) -> Path:
    path = folder / "cut.fmu"
    data = bytearray(fmu("2").read_bytes())
    data[2000:3000] = bytes(1000)
    path.write_bytes(data)
    return path


def _elsewhere(folder: Path) -> Path:
    path = folder / "elsewhere.fmu"
    with zipfile.ZipFile(fmu("2")) as source, zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", source.read("modelDescription.xml"))
        archive.writestr("binaries/win64/rig_unit.dll", b"")
    return path


def _library(folder: Path, library: Path) -> Path:
    path = folder / "library.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description("2"))
        archive.write(library, "binaries/linux64/rig_unit.so")
    return path


OTHER = "rig-unit-0000000000000001"
REFUSED = {
    "no archive": (_nothing, "text.fmu is not an FMU: File is not a zip file"),
    "no description": (_empty, "empty.fmu is not an FMU: it has no modelDescription.xml"),
    "damaged": (_cut, "cut.fmu is not an FMU: "),
    "no xml": (lambda folder: changed(fmu("2"), folder, ".*", "<fmi"), "its modelDescription.xml cannot be read: "),
    "another version": (
        lambda folder: changed(fmu("2"), folder, 'fmiVersion="2.0"', 'fmiVersion="1.0"'),
        "has FMI version 1.0; must be 2.0 or 3.0",
    ),
    "no co-simulation": (
        lambda folder: changed(fmu("2"), folder, "<CoSimulation", "<ModelExchange"),
        "has no co-simulation",
    ),
    "another layout": (
        lambda folder: changed(fmu("2"), folder, TOKEN, OTHER),
        f"was built for layout '{OTHER}', this rig has '{TOKEN}': write its modelDescription.xml again"
        " ('rig unit header --fmu 2') and rebuild",
    ),
    "another layout, FMI 3.0": (lambda folder: changed(fmu("3"), folder, TOKEN, OTHER), "'rig unit header --fmu 3'"),
    "a variable less": (
        lambda folder: changed(fmu("2"), folder, r'name="voted\[3\]"', 'name="vote"'),
        "has no variable voted[3] of type Real",
    ),
    "no library": (_elsewhere, "the FMU has no library for this machine: binaries/linux64/rig_unit.so"),
    "no library at all": (
        lambda folder: _library(folder, HERE / "faulty.c"),
        "the FMU's library cannot be loaded: /binaries/linux64/rig_unit.so: ",
    ),
    "no function": (lambda folder: _library(folder, next(Path("/lib").rglob("libm.so.6"))), "undefined symbol: fmi2"),
}


@needs_fmpy
@needs_a_compiler
@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_flown_is_refused_in_one_line(tmp_path: Path, case: str):
    made, said = REFUSED[case]
    with pytest.raises(BadInput) as error:
        fly(tmp_path, unit_of(tmp_path, made(tmp_path)))
    text = str(error.value)
    assert text.startswith(f"{tmp_path}/unit.toml: u") and said in text and "\n" not in text
    assert list(tmp_path.glob("*.mcap")) == []


@needs_fmpy
@needs_a_compiler
def test_a_library_of_another_layout_than_its_description_is_refused(tmp_path: Path):
    """The description is ours, the library was built with an older header."""
    text = (SOURCES / "rig_unit.h").read_text()
    for name in ("fmi2.c", "fmu.c", "fmu.h", "first_valid.c"):
        shutil.copy(SOURCES / name, tmp_path)
    (tmp_path / "old").mkdir()
    (tmp_path / "rig_unit.h").write_text(re.sub(r"LAYOUT UINT64_C\(0x\w+\)", "LAYOUT UINT64_C(0x1)", text))
    sources = [tmp_path / name for name in ("fmi2.c", "fmu.c", "first_valid.c")]
    old = compiled(sources, tmp_path / "old" / "old.so")
    with pytest.raises(
        BadInput, match=r"u refuses the flight: the FMU was not instantiated; its library may have another layout"
    ):
        fly(tmp_path, unit_of(tmp_path, _library(tmp_path, old)))


def test_without_fmpy_one_line_says_what_to_install(tmp_path: Path, rig_command, monkeypatch):
    monkeypatch.setattr("rig.unit.fmu.find_spec", lambda name: None)
    unit_of(tmp_path, _nothing(tmp_path))
    code, _, err = rig_command("fly", "--unit", "unit.toml")
    assert code == 2
    assert err == "error: unit.toml: u: transport fmu needs FMPy: pip install 'jsbsim-rig[fmi]'\n"


@needs_fmpy
def test_the_command_says_it_with_exit_code_2(tmp_path: Path, rig_command):
    unit_of(tmp_path, _nothing(tmp_path))
    code, _, err = rig_command("fly", "--unit", "unit.toml")
    assert code == 2 and err == f"error: unit.toml: u: {tmp_path}/text.fmu is not an FMU: File is not a zip file\n"


def held_by_a_worker(tested: Unit) -> None:
    with flown_with(tested) as held:
        assert held is not None and held.link.process is not None  # it runs
        assert list(Path(tempfile.gettempdir()).glob("rig-fmu-*"))


def test_a_worker_that_ends_leaves_no_folder(tmp_path: Path):
    worker = get_context("fork").Process(target=held_by_a_worker, args=(unit_of(tmp_path, fmu("2")),))
    worker.start()
    worker.join(120.0)
    assert worker.exitcode == 0 and list(tmp_path.glob("rig-fmu-*")) == []


def _archive(path: Path, *entries: tuple[str | zipfile.ZipInfo, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return path


def _link() -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo("resources/passwd")
    entry.external_attr = 0o120777 << 16
    return entry


BEYOND: dict[str, tuple[list[tuple[str | zipfile.ZipInfo, bytes]], str]] = {
    "large": ([(f"{i}", bytes(64 << 20)) for i in range(8)], "it unpacks to 512 MiB, at most 500 are allowed"),
    "many": ([(f"{i}", b"") for i in range(10_001)], "it has 10001 files, at most 10000 are allowed"),
    "outside": ([("../outside", b"")], "'../outside' is a path outside the archive"),
    "absolute": ([("/etc/outside", b"")], "'/etc/outside' is a path outside the archive"),
    "link": ([(_link(), b"/etc/passwd")], "'resources/passwd' is a link"),
}


@pytest.mark.parametrize("name", BEYOND)
def test_an_archive_beyond_the_limits_is_not_unpacked(tmp_path: Path, name: str):
    entries, said = BEYOND[name]
    _archive(tmp_path / "u.fmu", *entries)
    tested = written(tmp_path, {"name": "u", "transport": "fmu", "path": "u.fmu"})
    with pytest.raises(BadInput, match=re.escape(f"u.fmu is not unpacked: {said}")):
        fmu_transport.child(tested, 0)
