"""Units that were built for older versions of the records: they are flown, and refused what they cannot be told."""

from __future__ import annotations

import re
import shutil
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_unit_fmu import archived, needs_fmpy
from unit_files import HERE, KEPT, SOURCES, library, listening, needs_a_compiler, of_sources, written

import rig
from rig.bench.unit_check import check
from rig.bench.unit_long import FRAMES, TITLES
from rig.core.errors import UnitRefused
from rig.core.frame import SIGNALS, S
from rig.flight.stages import redundancy
from rig.flight.unit_loop import config_of
from rig.scenario import scenario
from rig.unit.fmu_description import TOKEN, TOKENS, description
from rig.unit.older_versions import asked_since, config_for, unasked
from rig.unit.unit_records import (
    CONFIG,
    INPUT,
    INTERFACE,
    LAYOUT,
    MORE_THAN_HALF,
    OLD_INTERFACES,
    OUTPUT,
    SINCE,
    Role,
    described,
    place,
)
from rig.unit.vectors import load

FOLDER = KEPT / f"{LAYOUT:016x}-versions"
SHORT = ("duration_s=2", "faults.0.start_s=1")
VERSIONS = [1, 2, 3, 4]
OLD = {interface.version: interface for interface in OLD_INTERFACES}
RECORDS = {"config": CONFIG, "input": INPUT, "output": OUTPUT}
OFF = {  # what CONFIG has none of is off
    **{1: ("slow_faults_off.c", "rules_off.c"), 2: ("slow_faults.c", "rules_off.c")},
    **dict.fromkeys((3, 4), ("slow_faults.c", "rules.c")),
}
# What the examples of now need of a header that has no control law.
NO_LAW = """
#define rig_law_input rig_input
#define RIG_ROLE_CONTROL_LAW (-1)
int rig_unit_law(const struct rig_input *input, struct rig_output *output);
"""


def test_the_layouts_of_older_versions_are_those_that_units_were_built_with():
    """The hash of each is in its header, of the commit that had it; it is made of the records of now."""
    assert {version: interface.layout for version, interface in OLD.items()} == {
        1: 0xBAEC0C917FEBB05E,
        2: 0x4D75E2CCA0F8866C,
        3: 0x0A5A1850E6B4B34B,
        4: 0x89D5486002180868,
    }
    for version in VERSIONS:
        assert f"RIG_UNIT_LAYOUT UINT64_C(0x{OLD[version].layout:016x})" in header_of(version)
    assert len({described(version) for version in (1, 2, 3, 4, 5)}) == 5 and INTERFACE.layout == LAYOUT


@pytest.mark.parametrize("version", VERSIONS)
def test_a_version_is_the_beginning_of_the_next(version: int):
    sizes = OLD[version].config_bytes, OLD[version].input_bytes, OLD[version].output_bytes
    for (record, dtype), size in zip(RECORDS.items(), sizes, strict=True):
        offsets = re.findall(rf"offsetof\(struct rig_{record}, (\w+)\) == (\d+)", header_of(version))
        fields = {name: int(at) for name, at in offsets if name not in ("length", "crc") and not name.startswith("pad")}
        assert all(place(dtype, name)[1] == at for name, at in fields.items())
        own = {name for name in dtype.names or () if not name.startswith("pad") and name not in ("length", "crc")}
        assert own - set(fields) == {name for name in own if SINCE.get(name, 1) > version}
        assert f"sizeof(struct rig_{record}) == {size})" in header_of(version)


def header_of(version: int) -> str:
    return (HERE / f"rig_unit_{version}.h").read_text()


# Flights -----------------------------------------------------------------------------------------------------


def sources(version: int, *names: str) -> list[Path]:
    """Examples beside the header of a version."""
    folder = FOLDER / str(version)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig_unit.h").write_text(
        header_of(version).replace("#ifdef __cplusplus\n}", f"{NO_LAW * (version < 4)}#ifdef __cplusplus\n}}")
    )
    for name in ("fmu.h", "monitor.h", *names):
        shutil.copy(HERE / name if name.endswith("_off.c") else SOURCES / name, folder)
    return [folder / name for name in names]


def monitor(version: int) -> tuple[str, ...]:
    names = ("monitor.c", "compare.c", "trend.c", "tie_break.c", "references.c", "persistence.c", "boxes.c")
    return (*names, "discretes.c", "slow_tests_off.c", *OFF[version])


def built(version: int, target: str, *names: str, flags: tuple[str, ...] = ()) -> Path:
    files = sources(version, *names, *monitor(version))
    return of_sources(target, files, f"-I{FOLDER / str(version)}", *flags)


@cache
def old_library(version: int) -> Path:
    return built(version, "libold.so")


@cache
def old_process(version: int) -> Path:
    return built(version, "old_udp", "udp_main.c", flags=("-fPIE", "-pie"))


@cache
def old_fmu(version: int, fmi: Any) -> Path:
    """As `rig unit header --fmu` of a version of the records described it."""
    made = built(version, f"old{fmi}.so", f"fmi{fmi}.c", "fmu.c", flags=(f"-DFMI={fmi}",))
    token = next(token for token, interface in TOKENS.items() if interface.version == version)
    later = "|".join(name for name, since in SINCE.items() if since > version)
    lines = description(fmi).replace(TOKEN, token).splitlines()
    text = "\n".join(line for line in lines if not re.search(rf'name="({later})\b', line))
    return archived(fmi, text, made)


TRANSPORTS = ["library", "in process", "udp"]


def some(quick: list[Any], *each: list[Any]) -> list[Any]:
    """All combinations; those that are not ``quick`` are long."""
    return [pytest.param(*one, marks=[] if one in quick else pytest.mark.long) for one in product(*each)]


def keys_of(version: int, transport: str) -> dict[str, Any]:
    if transport == "udp":
        return {"transport": "udp", "command": [str(old_process(version)), "--rig", "{address}"]}
    return {"path": str(old_library(version)), "isolate": transport == "library"}


@needs_a_compiler
@pytest.mark.parametrize(
    ("transport", "version"),
    some([("library", 1), ("library", 4), ("in process", 2), ("udp", 1), ("udp", 3)], TRANSPORTS, VERSIONS),
)
def test_an_older_unit_flies_the_bits_of_our_own_manager(tmp_path: Path, version: int, transport: str):
    """Of a flight without a split, a failed LRU or a sensor that sticks, of which it is not told."""
    digests = set()
    for keys in ({"path": str(library("monitor"))}, keys_of(version, transport)):
        flight = rig.fly(overrides=SHORT, out=tmp_path, unit=written(tmp_path, {"name": "u", **keys}))
        assert flight.unit is not None and flight.unit["status"] == "ready" and flight.unit["discarded"] == 0
        digests.add(flight.digest)
    assert len(digests) == 1


@needs_a_compiler
@pytest.mark.parametrize("version", VERSIONS)
def test_an_older_box_at_an_address_is_greeted_in_its_own_version(tmp_path: Path, version: int):
    with listening(old_process(version)) as address:
        tested = written(tmp_path, {"name": "u", "transport": "udp", "address": address})
        for _ in range(2):
            assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).survived


@needs_a_compiler
@needs_fmpy
@pytest.mark.parametrize(("fmi", "version"), some([("2", 1), ("3", 2), ("2", 3), ("3", 4)], ["2", "3"], VERSIONS))
def test_an_older_fmu_flies(tmp_path: Path, version: int, fmi: str):
    tested = written(tmp_path, {"name": "u", "transport": "fmu", "path": str(old_fmu(version, fmi))})
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).failed == {SIGNALS[0].name: [3]}


# What it cannot be told --------------------------------------------------------------------------------------

SIGNAL = "redundancy.signals.yaw_rate"
SLOW_FAULTS = {
    f"{SIGNAL}.slow_limit": [f"{SIGNAL}.slow_limit=1.0", f"{SIGNAL}.slow_allowance=0.01"],
    f"{SIGNAL}.stale_frames": [f"{SIGNAL}.stale_frames=20"],
}
RULES = {
    f"{SIGNAL}.count_down": [f"{SIGNAL}.count_down=0.5", f"{SIGNAL}.persistence=8"],
    f"{SIGNAL}.trend_small": [f"{SIGNAL}.trend_small=0.0"],
    f"{SIGNAL}.trend_window": [f"{SIGNAL}.trend_window=tumbling"],
    f"{SIGNAL}.trend_beside_reference": [f"{SIGNAL}.trend_beside_reference=true"],
    "redundancy.unresolved_s": ["redundancy.unresolved_s=2.0"],
    "redundancy.boxes": ["redundancy.boxes.sticks=['stick_pitch']", "redundancy.boxes.others=['stick_roll','pedal']"],
}
TESTS = {f"{SIGNAL}.slow_tests": [f"{SIGNAL}.slow_tests.factor=1.2"]}
CAME_IN = {**dict.fromkeys(SLOW_FAULTS, 2), **dict.fromkeys(RULES, 3), **dict.fromkeys(TESTS, 5)}


def configured(*overrides: str) -> NDArray[Any]:
    """CONFIG of the first bundled scenario."""
    loaded = scenario.load(None, list(overrides))
    return config_of(loaded, redundancy(loaded), np.zeros(4), Role.REDUNDANCY)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("key", CAME_IN)
def test_a_setting_that_is_on_is_refused_by_name_where_the_version_has_no_field(version: int, key: str):
    config = configured(*(SLOW_FAULTS | RULES | TESTS)[key])
    refused = key if version < CAME_IN[key] else ""
    assert asked_since(OLD[version], config, unasked(config)) == refused


def test_what_was_not_asked_for_is_not():
    config = configured()
    on = [config["rules"]["unresolved_frames"], config["rules"]["referred"], config["rules"]["sources"]]
    assert all(numbers.any() for numbers in on) and len(set(config["rules"]["box"][0].tolist())) > 1
    assert config["box_signals"] == MORE_THAN_HALF and config["slow_faults"]["stale_frames"].any()
    for interface in OLD_INTERFACES:
        assert asked_since(interface, config, unasked(config)) == ""
        assert (asked_since(interface, config) != "") == (interface.version < 5)


@pytest.mark.parametrize(
    ("boxes", "signals", "told"),
    [([1] * S, 3, 3), ([1] * S, 0, 0), ([1] * S, MORE_THAN_HALF, S // 2 + 1), (None, MORE_THAN_HALF, 0), (None, 0, 0)],
)
def test_a_unit_to_which_all_is_one_box_is_told_how_many_signals_accuse_a_channel(
    boxes: list[int] | None, signals: int, told: int
):
    """Boxes of several sets, None those of all aircraft: to it no channel dies as a box."""
    config = configured()
    config["box_signals"] = signals
    if boxes is not None:
        config["rules"]["box"] = boxes
    if boxes is not None and signals == MORE_THAN_HALF:
        assert asked_since(OLD[2], config, unasked(config)) == ""
    sent = config_for(OLD[2], config.copy())
    at = place(CONFIG, "box_signals")[1]
    assert int.from_bytes(sent[at : at + 8].tobytes(), "little", signed=True) == told
    assert len(sent) == OLD[2].config_bytes
    assert int(config["box_signals"][0]) == signals, "ours stays as it is"


@needs_a_compiler
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_flight_is_refused_in_one_line(tmp_path: Path, transport: str):
    tested = written(tmp_path, {"name": "u", **keys_of(2, transport)})
    keys = [f"{SIGNAL}.count_down=0.5", f"{SIGNAL}.persistence=8"]
    with pytest.raises(UnitRefused) as refused:
        rig.fly(overrides=[*SHORT, *keys], out=tmp_path, unit=tested)
    said = str(refused.value)
    assert f"built for version 2 of the records, which has no {SIGNAL}.count_down: " in said and "\n" not in said


@needs_a_compiler
@pytest.mark.parametrize(("isolate", "version"), some([(True, 1), (False, 2), (True, 3)], [True, False], VERSIONS[:3]))
def test_a_control_law_of_an_older_version_is_refused_in_one_line(tmp_path: Path, version: int, isolate: bool):
    sources(version)
    path = tmp_path / "law.c"
    path.write_text(OLD_LAW)
    made = of_sources("libold_law.so", [path], f"-I{FOLDER / str(version)}")
    tested = written(tmp_path, {"name": "u", "role": "control-law", "path": str(made), "isolate": isolate})
    with pytest.raises(UnitRefused) as refused:
        rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    said = str(refused.value)
    assert f"built for version {version} of the records, which has no role control-law: " in said and "\n" not in said


OLD_LAW = """
#include "rig_unit.h"
int rig_unit_open(const struct rig_config *config) { return config == 0; }
int rig_unit_law(const struct rig_input *in, struct rig_output *out) { return in == 0 || out == 0; }
void rig_unit_close(void) { }
"""


# The conformance test ----------------------------------------------------------------------------------------


@needs_a_compiler
@pytest.mark.parametrize("version", [1, 3, *(pytest.param(version, marks=pytest.mark.long) for version in (2, 4))])
def test_an_older_unit_meets_the_interface(tmp_path: Path, version: int):
    written(tmp_path, {"name": "u", **keys_of(version, "udp")})
    assert [one for one in check(tmp_path / "unit.toml", interface_only=True).requirements if not one.passed] == []


SHARE = {"a quarter": (4, 300), "all": (1, FRAMES)}  # every fourth case, and the frames of a long session


@needs_a_compiler
@pytest.mark.parametrize(
    ("version", "share"),
    [
        *((version, "a quarter") for version in (2, 4)),
        *(pytest.param(version, "all", marks=pytest.mark.long) for version in VERSIONS),
    ],
)
def test_it_is_asked_for_what_its_version_has_fields_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: int, share: str
):
    every, frames = SHARE[share]
    cases = load()[::every]
    monkeypatch.setattr("rig.bench.unit_check.load", lambda: cases)
    monkeypatch.setattr("rig.bench.unit_check.FRAMES", frames)
    written(tmp_path, {"name": "u", **keys_of(version, "library")})
    found, interface = check(tmp_path / "unit.toml"), OLD[version]
    asked = {case.requirement for case in cases if not asked_since(interface, case.config)}
    assert found.passed and found.grade == "bits"
    assert {one.name for one in found.requirements if one.part == "decisions"} == asked | set(
        TITLES[:-1] if version > 2 else TITLES[:1]
    )
    assert len(asked) > (50 if share == "all" else 12)
