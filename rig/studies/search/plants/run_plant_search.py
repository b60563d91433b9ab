"""The search over a plant: first simulations, rounds of a method, clusters, and their confirmation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.interrupt import Stop, interruptible
from rig.core.progress import tell
from rig.core.text import choices, quoted
from rig.studies.campaign.study_folder import FORMAT
from rig.studies.search.methods import METHODS, decides, require_method
from rig.studies.search.plants.plant_call import Columns, Takes
from rig.studies.search.plants.plant_file import PlantPlan
from rig.studies.search.plants.plant_result import figures_of
from rig.studies.search.plants.plant_rounds import (
    Interrupted,
    PlantFolder,
    Simulated,
    Simulating,
    call_of,
    seeds_of,
)
from rig.studies.search.plants.plant_space import PlantSpace, space_of
from rig.studies.search.plants.plant_subject import PlantSubject
from rig.studies.search.plants.plant_workers import Runner
from rig.studies.search.rounds import Draw, drive
from rig.verdict.requirements.robustness import robustness_text

_TRIED: Final = 8  # points at which a plant may fail before it is refused
_PART: Final = 64  # simulations that are written together


@dataclass(frozen=True, slots=True)
class PlantAsked:
    """The options that decide a search, beside its plan."""

    simulations: int = 300
    requirements: tuple[str, ...] = ()  # ids; all of the plan if there are none
    method: str = "regions"
    seed: int = 0

    def __post_init__(self) -> None:
        require_method(self.method)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSearched:
    """The end of a search."""

    figures: dict[str, Any]  # figures, as ``--json`` prints them; empty when interrupted
    warnings: tuple[str, ...] = ()  # warnings, such as of a missing scale
    simulations: int = 0  # simulations in the folder
    wall_s: float = 0.0  # time taken, s
    interrupted: bool = False  # True: it was asked to stop
    signal: int = 0  # signal that interrupted it
    draws: list[Draw] = field(default_factory=list, repr=False)  # inputs of each simulation, in the unit cube
    results: list[Simulated] = field(default_factory=list, repr=False)  # result of each


def identity(plan: PlantPlan, asked: PlantAsked, sources: dict[str, str]) -> dict[str, Any]:
    """Return everything that decides the results; sources: of the plant, SHA-256 by file."""
    what = plan.model_dump(mode="json", exclude={"timeout_s"}, exclude_none=True)
    return {"format": FORMAT, "plan": what, **asdict(asked), "requirements": list(asked.requirements),
            "plant": sources, **decides(asked.method)}  # fmt: skip


def search_plant(
    plan: PlantPlan, asked: PlantAsked, runner: Runner, out: Path | None = None, sources: dict[str, str] | None = None
) -> PlantSearched:
    """Search for inputs of a plant that violate its requirements, into the folder ``out`` or resuming there.

    BadInput before anything is written: the plan does not fit the plant, or the plant fails everywhere.
    """
    began, space = perf_counter(), space_of(plan)
    folder = PlantFolder(out, identity(plan, asked, sources or {}))
    requirements = plan.chosen(asked.requirements)
    folder.require()
    require_arguments(plan, runner.takes(), runner.called)
    with interruptible(again=True) as stop:
        draws: list[Draw] = []
        results: list[Simulated] = []
        warnings: tuple[str, ...] = ()
        try:
            columns = first_columns(space, runner, asked.seed, stop)
            subject = PlantSubject(requirements, columns, plan.rate_hz, plan.duration_s)
            warnings = tuple(filter(None, [subject.unlike(columns)]))
            with folder.held():
                simulating = Simulating(space, subject, runner, folder, stop)

                def told(new: Sequence[Draw], found: Sequence[Simulated]) -> None:
                    draws.extend(new)
                    results.extend(found)

                standing = simulate_all(simulating, asked, told)
                figures = figures_of(simulating, draws, results, asked.seed, standing, out)
        except Interrupted:
            ended: dict[str, Any] = {"figures": {}, "interrupted": True, "signal": stop.signal}
        else:
            ended = {"figures": figures}
    took_s = perf_counter() - began
    return PlantSearched(
        **ended, warnings=warnings, simulations=len(results), wall_s=took_s, draws=draws, results=results
    )


def require_arguments(plan: PlantPlan, takes: Takes, called: str) -> None:
    """Raise BadInput unless a plant takes what the plan varies, and the plan has what it needs."""
    if takes.wrong:
        raise BadInput(f"{called}: {takes.wrong}")
    given = [*plan.parameters, *plan.signals]
    for name in given:
        if name not in takes.names and not takes.others:
            raise BadInput(
                f"{called}: takes no argument {quoted(name)}, {choices(name, takes.names) or 'it takes none'}"
            )
    missing = [name for name in takes.needed if name not in (*given, "seed", "duration_s")]
    if missing:
        raise BadInput(f"{called}: needs the argument {missing[0]}; add it to [parameters] or [signals]")
    if plan.repeats > 1 and "seed" not in takes.names:
        raise BadInput(f"repeats = {plan.repeats}: {called} takes no seed, so that all repeats would be equal")


def first_columns(space: PlantSpace, runner: Runner, seed: int, stop: Stop) -> Columns:
    """Return the columns of the plant at the centre of its ranges, or where it does not fail.

    BadInput: it fails at all of a few points.  Interrupted: asked to stop.
    """
    reason = ""
    for i in range(_TRIED):
        arm = i % len(space.arms)
        count = space.arms[arm].dimensions
        point = np.full(count, 0.5) if i == 0 else np.random.default_rng([seed, i]).random(count)
        outcomes = runner.run([call_of(space, Draw(arm, point), seeds_of(seed, i, 1)[0], None)], stop)
        if not outcomes:
            raise Interrupted
        if outcomes[0].columns is not None:
            return outcomes[0].columns
        reason = reason or outcomes[0].reason
    raise BadInput(f"{runner.called}: failed at {_TRIED} of {_TRIED} points; at the centre of the ranges: {reason}")


def simulate_all(
    simulating: Simulating, asked: PlantAsked, told: Callable[[Sequence[Draw], Sequence[Simulated]], None]
) -> str:
    """Simulate the draws of the method to its end; return how it stands there.

    told : gets each part of a round, the draws and their results
    """
    repeats, done, number, least = simulating.space.plan.repeats, 0, 0, np.inf

    def results_of(draws: list[Draw]) -> list[Simulated]:
        nonlocal done, number, least
        results: list[Simulated] = []
        for first in range(0, len(draws), _PART):
            part = draws[first : first + _PART]
            seeds = [seeds_of(asked.seed, (done + i) * repeats, repeats) for i in range(len(part))]
            found = simulating.round(f"rounds/{number:05}.json", part, seeds)
            results, done, number = [*results, *found], done + len(part), number + 1
            least = min(least, *(each.robustness for each in found))
            if done * 10 // asked.simulations > (done - len(part)) * 10 // asked.simulations:  # a line each tenth
                shown = robustness_text(least) or "none yet"
                tell(f"{done} simulations, least robustness {shown}", done - 1, asked.simulations)
            told(part, found)
        return results

    space, more = simulating.space, {"pieces": simulating.space.pieces} if asked.method == "regions" else {}
    return drive(METHODS[asked.method](space.arms, asked.simulations, asked.seed, **more), results_of)
