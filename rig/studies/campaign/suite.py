"""A suite file: scenarios, logs and campaigns with the requirements that each must meet, and their reference decisions.

The decisions (which channel was isolated, when, by which rule) are in a file beside: ``NAME.decisions.toml``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Final

import tomli_w
from pydantic import Field, PrivateAttr, model_validator

from rig.core.errors import BadInput
from rig.core.files import bundled, is_file, write_text
from rig.core.settings import Settings, build, read_toml
from rig.scenario.scenario import find as find_scenario
from rig.studies.campaign import campaign_file as config
from rig.unit.unit_facts import differences
from rig.unit.unit_file import Unit
from rig.verdict.requirements.requirement import Requirement, load_requirements

MOST: Final = 1000  # cases
UNIT: Final = "unit under test"  # in the file of reference decisions: what it reads; no name of a case
READ: Final = ("environment", "read_sha256")
_KINDS: Final = ("scenario", "log", "campaign")


class Case(Settings):
    """One flight, log or campaign of a suite."""

    name: str = Field(default="", max_length=80)  # if not given, that of its file
    scenario: str | None = None  # a file, also from the suite's folder, or a bundled name; of all three
    log: str | None = None
    campaign: str | None = None
    runs: int | None = Field(default=None, ge=1)  # of a campaign; all if not given
    set: dict[str, Any] = {}  # dotted keys laid over the scenario or campaign
    seed: int | None = Field(default=None, ge=0, lt=2**63)  # of a scenario
    requirements: list[str] | None = None  # if not given, those of the suite
    without: list[str] = []  # ids that are not measured here
    may_not_act: bool = False  # a fault that does not act is no failure
    _path: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _one(self) -> Case:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError("a case needs exactly one of scenario, log, campaign")
        for key, kinds in (("runs", ("campaign",)), ("seed", ("scenario",)), ("set", ("scenario", "campaign"))):
            if getattr(self, key) not in (None, {}) and given[0] not in kinds:
                raise ValueError(f"{key}: is allowed only for {' and '.join(kinds)}")
        return self

    @property
    def kind(self) -> str:
        """Return the kind of the case: scenario, log or campaign."""
        return next(kind for kind in _KINDS if getattr(self, kind) is not None)

    @property
    def path(self) -> Path:
        """Return the file of the case."""
        return self._path

    @property
    def called(self) -> str:
        """Return the name of the case."""
        return self.name or self._path.stem


class _File(Settings):
    keys_are_in: ClassVar[str] = "docs/how-to/requirements-and-ci.md"

    title: str = ""
    requirements: list[str] = []
    cases: list[Case] = Field(min_length=1, max_length=MOST)


class Suite:
    """A suite: its cases, the requirements of each, and the reference decisions beside it."""

    def __init__(self, path: Path, file: _File) -> None:
        """Raise BadInput if a file of a case is missing, or two cases have one name."""
        self.path, self.title, self.cases = path, file.title or path.stem, file.cases
        self._shared = file.requirements
        for case in self.cases:
            case._path = self._find(case)
        names = [case.called for case in self.cases]
        if UNIT in names:
            raise BadInput(f"{path}: cases: {UNIT}: no case may have this name; rename it")
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise BadInput(f"{path}: cases: {twice[0]}: two cases have this name; rename one")
        self.requirements = {case.called: self._requirements(case) for case in self.cases}

    @property
    def decisions_file(self) -> Path:
        """Return the file of reference decisions."""
        return self.path.with_suffix(".decisions.toml")

    @property
    def inputs(self) -> list[Path]:
        """Return all files of the suite."""
        asked = dict.fromkeys(name for case in self.cases for name in self.names_of(case))
        return [self.path, self.decisions_file, *(case.path for case in self.cases), *map(Path, asked)]

    def names_of(self, case: Case) -> list[str]:
        """Return the sets and files of requirements of a case."""
        names = self._shared if case.requirements is None else case.requirements
        beside = [self.path.parent / name for name in names]
        return [str(b) if is_file(b) and not is_file(Path(n)) else n for n, b in zip(names, beside, strict=True)]

    def _requirements(self, case: Case) -> tuple[Requirement, ...]:
        loaded = load_requirements(self.names_of(case))
        ids = {each.id for each in loaded}
        if strange := [id_ for id_ in case.without if id_ not in ids]:
            raise BadInput(f"{self.path}: {case.called}: without: the case has no requirement {strange[0]!r}")
        return tuple(each for each in loaded if each.id not in case.without)

    def _find(self, case: Case) -> Path:
        name = getattr(case, case.kind)
        beside = self.path.parent / name
        if is_file(beside):
            return beside
        find = {"scenario": find_scenario, "campaign": config.find, "log": _find_log}[case.kind]
        try:
            return find(name)
        except BadInput as error:
            raise BadInput(f"{self.path}: cases: {case.kind}: {error}") from None

    def decisions(self) -> dict[str, list[str]] | None:
        """Return the reference decisions by case; None if there is no file."""
        if not is_file(self.decisions_file):
            return None
        tables = read_toml(self.decisions_file)
        tables.pop(UNIT, None)
        for name, lines in tables.items():
            if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
                raise BadInput(f"{self.decisions_file}: {name}: must be a list of decisions; write it with --update")
        return tables

    def keep(self, decisions: dict[str, list[str]], unit: Unit | None = None) -> None:
        """Write the reference decisions, with what the ``unit`` that decided reads."""
        about = {} if unit is None else {UNIT: {key: unit.about()[key] for key in READ}}
        write_text(self.decisions_file, tomli_w.dumps({**decisions, **about}))

    def of_another_unit(self, unit: Unit | None) -> list[str]:
        """Return what ``unit`` reads otherwise than the unit that made the reference decisions, a line each."""
        was = read_toml(self.decisions_file).get(UNIT) if is_file(self.decisions_file) else None
        if not isinstance(was, dict):  # of a manager
            return []
        return ["a unit made the reference, now a manager votes"] if unit is None else differences(was, unit.about())


def _find_log(name: str) -> Path:
    if not is_file(Path(name)):
        raise BadInput(f"{name}: no such log")
    return Path(name)


def read_suite(name: Path | str) -> Suite:
    """Return the suite of a file or of a bundled name.  BadInput: it is missing or wrong."""
    wanted, home = Path(name), bundled("faults") / "suites"
    for path in (wanted, home / f"{wanted.name}.toml"):
        if is_file(path):
            return Suite(path, build(_File, read_toml(path), str(path)))
    names = sorted(path.stem for path in home.glob("*.toml") if not path.stem.endswith(".decisions"))
    raise BadInput(f"{wanted}: no such suite; bundled: {', '.join(names)}")
