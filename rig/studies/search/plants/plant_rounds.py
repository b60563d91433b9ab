"""The simulations of a search over a plant, round after round, in a folder that holds those that were run.

plant-search.json   what decides the search
rounds/N.json       the results of round N; choosing/N.json, confirming/N.json: of cluster N, simulated again
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SeedSequence

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.interrupt import Stop
from rig.core.outputs import PLANT_SEARCH
from rig.studies.campaign.study_folder import Study, write_whole
from rig.studies.search.plants.plant_call import Call, Outcome
from rig.studies.search.plants.plant_file import PlantPlan
from rig.studies.search.plants.plant_space import PlantSpace
from rig.studies.search.plants.plant_subject import NOT_DECIDED, PlantSubject
from rig.studies.search.plants.plant_workers import Runner
from rig.studies.search.rounds import Draw

_REMEDY: Final = "delete this file: the same command simulates its round again"
_RUNS: Final = 57  # spawn key of the seeds of simulations
STUDY: Final = Study(
    mark=PLANT_SEARCH,
    folder="the folder of a search over a plant",
    other="another search",
    busy="rig search is writing",
    remedy="choose another folder or delete it",
)


class Interrupted(Exception):
    """The command was asked to stop; the simulations of whole rounds are in the folder."""


class Simulated(NamedTuple):
    """The result of a draw; the least of its repeats."""

    robustness: float
    violating: tuple[str, ...] = ()  # ids of the violated requirements
    violations: int = 0  # of its repeats
    failed: str = ""  # why none of its repeats gave columns
    printed: str = ""

    @property
    def value(self) -> float:
        """Return the minimised number."""
        return self.robustness

    @property
    def violated(self) -> bool:
        """Return True if a requirement is violated."""
        return bool(self.violating)


def first_violation(results: Sequence[Simulated]) -> int | None:
    """Return the number of the first simulation that violates, from 1; None: none does."""
    return next((i + 1 for i, each in enumerate(results) if each.violated), None)


class PlantFolder:
    """The rounds of a search in a folder; without a folder nothing is kept."""

    def __init__(self, out: Path | None, about: dict[str, Any]) -> None:
        self.out, self._about = out, about
        self._identity = sealed.identity(STUDY.written(about))

    def require(self) -> None:
        """Raise BadInput unless the folder is new, or of the same search.  Writes nothing."""
        if self.out is not None:
            STUDY.require(self.out, self._about)

    def held(self) -> AbstractContextManager[None]:
        """Hold the folder alone."""
        return nullcontext() if self.out is None else STUDY.held(self.out, self._about)

    def read(self, name: str, asked: list[Any]) -> list[Simulated] | None:
        """Return the results of a round, None if it was not run.  BadInput: its file is damaged."""
        if self.out is None or not is_file(self.out / name):
            return None
        found = sealed.read_json(self.out / name, _REMEDY, self._place(name))
        if found.get("asked") != asked:
            raise BadInput(f"{self.out / name}: is of other points than this search draws; {_REMEDY}")
        return [Simulated(**{**row, "violating": tuple(row["violating"])}) for row in found["results"]]

    def write(self, name: str, asked: list[Any], results: Sequence[Simulated]) -> None:
        """Write the results of a round."""
        if self.out is not None:
            rows = [each._asdict() for each in results]
            write_whole(self.out / name, sealed.to_json({"asked": asked, "results": rows}, self._place(name)))

    def _place(self, name: str) -> str:
        return f"{self._identity}/{name}"


class Simulating:
    """Simulates draws, measures them, and keeps the rounds."""

    def __init__(
        self, space: PlantSpace, subject: PlantSubject, runner: Runner, folder: PlantFolder, stop: Stop
    ) -> None:
        self.space, self.subject, self._runner, self._folder, self._stop = space, subject, runner, folder, stop
        self.takes_seed, self.called = "seed" in runner.takes().names, runner.called

    def round(self, name: str, draws: Sequence[Draw], seeds: Sequence[Sequence[int]]) -> list[Simulated]:
        """Return the results of ``draws``, each with its ``seeds``.  Interrupted: asked to stop before all were run."""
        asked = [[draw.arm, draw.point.tolist(), list(of)] for draw, of in zip(draws, seeds, strict=True)]
        known = self._folder.read(name, asked)
        if known is not None:
            return known
        calls = [self.call(draw, seed) for draw, of in zip(draws, seeds, strict=True) for seed in of]
        outcomes = iter(self.outcomes(calls))
        results = [self._least([next(outcomes) for _ in of]) for of in seeds]
        self._folder.write(name, asked, results)
        return results

    def call(self, draw: Draw, seed: int, names: tuple[str, ...] | None = ()) -> Call:
        """Return the call of a draw; names: of columns, None all, () those of the requirements."""
        return call_of(self.space, draw, seed, self.subject.names if names == () else names)

    def outcomes(self, calls: Sequence[Call]) -> list[Outcome]:
        """Return the outcomes of all calls.  Interrupted: asked to stop."""
        outcomes = self._runner.run(calls, self._stop)
        if len(outcomes) < len(calls):
            raise Interrupted
        return outcomes

    def _least(self, outcomes: Sequence[Outcome]) -> Simulated:
        printed = next((each.printed for each in outcomes if each.printed), "")
        told = [self.subject.verdicts(each.columns) for each in outcomes if each.columns is not None]
        if not told:
            return Simulated(NOT_DECIDED, failed=outcomes[0].reason, printed=printed)
        violated = [[one.requirement for one in of if one.status == "violated"] for of in told]
        ids = tuple(dict.fromkeys(name for of in violated for name in of))
        least = min(one.robustness for of in told for one in of)
        return Simulated(least, ids, sum(map(bool, violated)), printed=printed)


def call_of(space: PlantSpace, draw: Draw, seed: int, names: tuple[str, ...] | None) -> Call:
    """Return the call of the plant at a draw."""
    plan: PlantPlan = space.plan
    shapes = {name: of.shape for name, of in plan.signals.items()}
    return Call(space.inputs(draw.arm, draw.point), shapes, plan.duration_s, plan.rate_hz, seed, names)


def seeds_of(seed: int, first: int, count: int) -> list[int]:
    """Return the seeds of the simulations ``first`` and the following ones of a search, 31 bits each."""
    states = (SeedSequence(seed, spawn_key=(_RUNS, first + i)).generate_state(1, np.uint32)[0] for i in range(count))
    return [int(state) >> 1 for state in states]
