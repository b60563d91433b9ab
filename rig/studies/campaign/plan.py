"""The runs of a campaign: number, seed, varied values and scenario of each, and the version of rig that flies them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final

from rig.computer.redundancy.managers import DEFAULT
from rig.core.errors import BadInput
from rig.core.settings import build
from rig.core.trust import Trust
from rig.core.versions import versions
from rig.scenario import aircraft
from rig.scenario.overrides import named_manager, parse_set, set_key
from rig.scenario.scenario import Scenario
from rig.scenario.shared_parts import build_shared
from rig.studies.campaign.campaign_file import Campaign, Levels, find, read
from rig.studies.campaign.manager_source import sources, try_import
from rig.studies.campaign.sampling import Choice, choices, seed_of
from rig.verdict.requirements.measure import recorder_of
from rig.verdict.requirements.requirement import Requirement

SOURCES: Final = "sources"  # of an identity: the user's managers, file by file
CHECKED: Final = 5_000  # runs whose scenario is built before the first flight; beyond, one of each combination
# Files that read flights or hand them out do not change a flight.
ROOMS = ("bench", "cli", "design", "log/recordings", "show", "studies")
BESIDE = (*ROOMS, "__main__.py", "flight/cost.py", "scenario/make_fault.py", "world/faults/fault_catalogue.py")
FLIES = ("studies/campaign/flying.py", "studies/campaign/tables.py", "studies/campaign/worker.py")


@dataclass(frozen=True, slots=True)
class Run:
    """One flight of a campaign. ``data`` is the table of its scenario; the aircraft's tables come below it."""

    number: int
    choice: Choice
    data: dict[str, Any]
    trust: Trust

    @property
    def aircraft(self) -> str:
        """Return the aircraft's name. BadInput: it is not a name."""
        name = self.data.get("aircraft", "f16")
        if not isinstance(name, str):
            raise BadInput(f"run {self.number}: aircraft: must be a name, got {name!r}")
        return name

    def scenario(self, tables: dict[str, Any] | None = None) -> Scenario:
        """Build the scenario of the flight; ``tables``: the aircraft's, if they have been read already."""
        below = aircraft.tables(self.aircraft) if tables is None else tables
        return build_shared(below, self.data, f"run {self.number}").trusted(self.trust)


class Plan:
    """The runs of a campaign, each made when needed."""

    of_one_draw = 1  # runs that share a seed

    def __init__(self, campaign: Campaign, source: str, trust: Trust | None = None) -> None:
        """Raise BadInput, naming ``source``, for a ``[set]`` key that does not fit the base.

        trust : which manager classes may be run; none if not given
        """
        self.trust = trust or Trust(source)
        self.campaign = campaign
        self.source = source
        self._tables = cache(aircraft.tables)
        self._import = cache(self._find)
        self._base = campaign.base
        for key, value in campaign.set.items():
            self._base = set_key(self._base, key, value, f"{source}: set")
        self._cases = {
            (group, case.name): (case.set, f"{source}: cases.{group}.{case.name}")
            for group, cases in campaign.cases.items()
            for case in cases
        }

    def __len__(self) -> int:
        return len(self.choices)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how another process makes the plan; cached values stay here."""
        return type(self), (self.campaign, self.source, self.trust)

    @cached_property
    def requirements(self) -> tuple[Requirement, ...]:
        """Return the requirements of every run.  BadInput: one of the folder is no longer valid."""
        given = self.campaign.requirements or []
        made = tuple(build(Requirement, each, f"{self.source}: requirements") for each in given)
        for each in made:
            each.require_of_flights()
        return made

    def count(self, runs: int | None) -> int:
        """Return how many runs ``--runs`` asks for.  BadInput: the plan has fewer."""
        count = len(self) if runs is None else runs
        if not 1 <= count <= len(self):
            raise BadInput(f"--runs {count}: must be from 1 to {len(self)}, the runs of the campaign")
        return count

    @cached_property
    def choices(self) -> list[Choice]:
        """Return the varied values of each run."""
        return choices(self.campaign)

    def __getitem__(self, number: int) -> Run:
        data = {**self.data(number), "seed": self.seed(number)}
        return Run(number, self.choices[number], data, self.trust)

    def seed(self, number: int) -> int:
        """Return the seed of a run's flight."""
        return seed_of(self.campaign, number - number % self.of_one_draw)

    def value_types(self) -> dict[str, set[type]]:
        """Return the types of all values of each varied key."""
        types: dict[str, set[type]] = {}
        for choice in self.choices:
            for key, value in choice.items():
                types.setdefault(key, set()).add(type(value))
        return types

    def data(self, number: int) -> dict[str, Any]:
        """Return the table of a run's scenario, without its seed."""
        choice = self.choices[number]
        data = self._base
        for group in self.campaign.cases:
            together, source = self._cases[group, choice[group]]
            for key, value in together.items():
                data = set_key(data, key, value, source)
        for key, value in choice.items():
            if key not in self.campaign.cases:
                data = set_key(data, key, value, f"{self.source}: vary")
        return data

    def check(self) -> None:
        """Build the scenarios.  BadInput names the file, the first wrong run and its key."""
        for number in sorted({*range(min(CHECKED, len(self.choices))), *self._combinations}):
            self._check(self[number])

    def _check(self, run: Run) -> None:
        try:
            scenario = run.scenario(self._tables(run.aircraft))
            scenario.airframe.point(scenario.flight_point)
        except BadInput as error:
            reason = str(error).removeprefix(f"run {run.number}: ")
            raise BadInput(f"{self.source}: run {run.number}: {reason}") from None
        self.trust.require(scenario.redundancy.manager)
        try:
            self._import(scenario.redundancy.manager)
        except BadInput as error:
            raise BadInput(f"{self.source}: run {run.number}: {error}") from None
        if self.requirements and run.number in self._combinations:
            try:
                recorder_of(scenario, self.requirements, iter(()))
            except BadInput as error:
                raise BadInput(f"{self.source}: run {run.number}: {error}") from None

    def _find(self, manager: str) -> None:
        """Import the user's manager once, before the first flight.  BadInput: the import fails."""
        if ":" in manager:
            try_import(manager)

    def identity(self) -> dict[str, Any]:
        """Return everything that decides the table: campaign, tables of all its aircraft, and the user's code."""
        names = sorted({self[number].aircraft for number in self._combinations})
        texts = {name: json.dumps(self._tables(name), sort_keys=True) for name in names}
        hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
        own = self.sources
        return {"campaign": self.campaign.what(), "aircraft": hashes, **({SOURCES: own} if own else {})}

    @cached_property
    def sources(self) -> dict[str, dict[str, str]]:
        """Return the files of every manager of the user that is flown, with their hashes.  BadInput: one is missing."""
        return sources(map(self.manager, self._named))

    def manager(self, number: int) -> str:
        """Return the manager of a run."""
        of_aircraft = self._tables(self[number].aircraft).get("redundancy", {}).get("manager", DEFAULT)
        given = self.data(number).get("redundancy", {})
        return str(given.get("manager", of_aircraft) if isinstance(given, dict) else of_aircraft)

    @property
    def _named(self) -> list[int]:
        """Return runs that together have every manager."""
        return self._combinations

    @cached_property
    def _combinations(self) -> list[int]:
        """Return the first run of every combination of values that vary by name."""
        listed = {key for key, vary in self.campaign.varied() if isinstance(vary, Levels)} | {*self.campaign.cases}
        firsts: dict[Any, int] = {}
        for number, choice in enumerate(self.choices):
            names = tuple(value for key, value in choice.items() if key in listed and not isinstance(value, float))
            key = names if all(type(name) is str for name in names) else json.dumps(names, default=str)
            firsts.setdefault(key, number)
        return list(firsts.values())


def read_plan(name: str | Path, sets: Iterable[str] | None = None, allow_code: bool = False) -> Plan:
    """Return the plan of a campaign file or bundled name.  BadInput: a wrong key or value.

    sets : KEY=VALUE over the keys of the file; a manager class that they name may be run, others with ``allow_code``
    """
    given, source = dict(map(parse_set, sets or ())), str(find(name))
    return Plan(read(name, given), source, Trust(source, allow_code, named_manager(given.items())))


@cache
def rig_identity() -> str:
    """Return the versions, and a hash of the sources, that decide a row, as one line."""
    home = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(home.rglob("*.py")):
        name = path.relative_to(home).as_posix()
        if name in FLIES or not (name in BESIDE or name.startswith(tuple(f"{room}/" for room in ROOMS))):
            digest.update(f"{name}\0".encode() + path.read_bytes())
    packages = ", ".join(
        f"{name} {versions()[f'version {name}']}" for name in ("jsbsim-rig", "jsbsim", "numpy", "numba")
    )
    return f"{packages}, sources {digest.hexdigest()[:16]}"
