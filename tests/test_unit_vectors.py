"""The conformance vectors: made by the independent reading, met by both of our monitors, by none with a defect."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unit_vectors
from numpy.typing import NDArray
from one_stage import step_stage
from unit_defects import DEFECTS, Defect
from unit_defects_rules import OLD_RULES
from unit_defects_slow import SLOW_DEFECTS
from unit_files import SOURCES as EXAMPLES
from unit_files import compiled, needs_a_compiler

from rig.computer.redundancy.discrete import DiscreteVoter
from rig.computer.redundancy.managers import Manager
from rig.core.frame import FLAT, DecidedBy, Pattern, State, new_block
from rig.unit.session import box_rule, settings_of
from rig.unit.unit_records import CONFIG, INPUT, OUTPUT, members
from rig.unit.vectors import Case, differences, load

SOURCES = (
    *(
        "monitor.c",
        "compare.c",
        "trend.c",
        "slow_faults.c",
        "slow_tests.c",
        "slow_halves.c",
        "slow_noise.c",
        "tie_break.c",
    ),
    *("references.c", "persistence.c", "boxes.c", "rules.c", "discretes.c"),
)
FILES = [*(EXAMPLES / name for name in SOURCES), EXAMPLES / "monitor.h"]
OWN = f"-I{EXAMPLES}"
CASES = load()
OF_TESTS = (DecidedBy.SLOW_MEANS, DecidedBy.SLOW_SQUARES, DecidedBy.SLOW_HALVES)
REACHED = {"pattern": Pattern, "decided_by": DecidedBy, "state": State, "discrete_state": State}


def found(case: Case, said: NDArray[Any]) -> list[str]:
    return [f"{case.requirement}: {line}" for line in differences(case, said)]


def by_our_manager(case: Case) -> NDArray[Any]:
    """What our own manager says, in OUTPUT records."""
    rows = new_block(len(case.inputs))
    for name in set(INPUT.names or ()) & set(FLAT.names or ()):
        rows[name] = case.inputs[name]
    records, discretes = settings_of(case.config)
    manager = Manager("cross-channel", records, **box_rule(case.config))
    voter = DiscreteVoter(discretes)
    with np.errstate(invalid="ignore"):  # of an infinite angle, when the kernels are not compiled
        for k in range(len(rows)):
            step_stage(manager, rows, k)
            step_stage(voter, rows, k)
    said = np.zeros(len(rows), OUTPUT)
    for name in set(OUTPUT.names or ()) & set(FLAT.names or ()):
        said[name] = rows[name]
    said["said"], said["frame"] = case.expected["said"], case.inputs["frame"]
    return said


class Library:
    """A unit's three functions, called in this process."""

    def __init__(self, path: Path) -> None:
        self.functions = ctypes.CDLL(str(path))

    def said(self, case: Case) -> NDArray[Any]:
        config, said = case.config.astype(CONFIG), np.zeros(len(case.inputs), OUTPUT)
        inputs = np.ascontiguousarray(case.inputs)
        said["frame"] = inputs["frame"]
        assert self.functions.rig_unit_open(ctypes.c_void_p(config.ctypes.data)) == 0
        for k in range(len(inputs)):
            read = ctypes.c_void_p(inputs.ctypes.data + k * INPUT.itemsize)
            write = ctypes.c_void_p(said.ctypes.data + k * OUTPUT.itemsize)
            assert self.functions.rig_unit_step(read, write) == 0
        self.functions.rig_unit_close()
        return said


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The monitor's files, each compiled."""
    folder = tmp_path_factory.mktemp("objects")
    return {name: compiled([EXAMPLES / name], folder / f"{name}.o", "-O0", OWN, "-c") for name in SOURCES}


def with_defect(defect: Defect, objects: dict[str, Path], folder: Path) -> Library:
    """The monitor with one text replaced; what includes it is compiled again."""
    where = [path for path in FILES if defect.old in path.read_text()]
    assert [path.read_text().count(defect.old) for path in where] == [1]
    for path in FILES:
        shutil.copy(path, folder)
    changed = folder / where[0].name
    changed.write_text(changed.read_text().replace(defect.old, defect.new))
    again = SOURCES if changed.suffix == ".h" else (changed.name,)
    sources = [folder / name if name in again else objects[name] for name in SOURCES]
    return Library(compiled(sources, folder / "libdefect.so", "-O0"))


@pytest.mark.long
def test_the_vectors_are_those_of_the_independent_reading():
    made = unit_vectors.cases()
    assert [case.requirement for case in made] == [case.requirement for case in CASES]
    for ours, kept in zip(made, CASES, strict=True):
        for name in ("config", "inputs", "expected"):
            assert getattr(ours, name).tobytes() == getattr(kept, name).tobytes(), (kept.requirement, name)


def expected_of(enum: Any) -> list[Any]:
    """All members; a unit has no lanes to ask."""
    return [one for one in members(enum) if one is not DecidedBy.LANE]


def test_the_vectors_reach_every_pattern_rule_and_state():
    expected = {name: np.concatenate([case.expected[name].ravel() for case in CASES]) for name in REACHED}
    for name, enum in REACHED.items():
        seen = {
            enum(value): int(count) for value, count in zip(*np.unique(expected[name], return_counts=True), strict=True)
        }
        least = {one: 4 if one in OF_TESTS else 20 for one in expected_of(enum)}
        assert {one: seen.get(one, 0) for one, few in least.items() if seen.get(one, 0) < few} == {}, name


@pytest.mark.parametrize("case", CASES, ids=[case.requirement for case in CASES])
def test_our_own_manager_says_what_the_requirement_says(case: Case):
    assert found(case, by_our_manager(case)) == []


@needs_a_compiler
def test_so_does_the_monitor_in_c(objects: dict[str, Path], tmp_path: Path):
    monitor = Library(compiled([*objects.values()], tmp_path / "libmonitor.so"))
    assert [line for case in CASES for line in found(case, monitor.said(case))] == []


def is_found(defect: Defect, objects: dict[str, Path], folder: Path) -> bool:
    monitor = with_defect(defect, objects, folder)
    return any(found(case, monitor.said(case)) for case in CASES)


@needs_a_compiler
@pytest.mark.parametrize("defect", [*DEFECTS, *SLOW_DEFECTS], ids=lambda defect: defect.name)
def test_the_vectors_find_a_monitor_with_a_defect(defect: Defect, objects: dict[str, Path], tmp_path: Path):
    assert is_found(defect, objects, tmp_path)


@pytest.mark.long
@needs_a_compiler
@pytest.mark.parametrize("defect", OLD_RULES, ids=lambda defect: defect.name)
def test_and_one_with_a_rule_of_before(defect: Defect, objects: dict[str, Path], tmp_path: Path):
    assert is_found(defect, objects, tmp_path)
