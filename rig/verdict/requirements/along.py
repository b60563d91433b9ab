"""Requirements of a flight while it is flown and logged, and verdicts as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.event import Event
from rig.core.frame import Table
from rig.core.units.quantities import quantity
from rig.scenario.scenario import Scenario
from rig.unit.running_unit import UnitUnderTest
from rig.verdict.of_log import FlightConclusion, Scored
from rig.verdict.requirements.measure import check_log, recorder_of
from rig.verdict.requirements.requirement import Requirement, load_requirements
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder, Verdict
from rig.verdict.requirements.robustness import number_of, robustness_text

VIOLATED: Final = "requirement violated"  # name of an event


class MeasuredConclusion(FlightConclusion):
    """The conclusion of a flight, and its requirements beside it: an outcome of ``rig.flight.fly.fly``.

    A requirement that names the baseline is measured after the flight: two flights at once would share the process.
    """

    def __init__(self, names: Sequence[str | Path] = (), baseline: bool = False) -> None:
        """Names : of sets and files, before those that the scenario names; baseline : as of FlightConclusion."""
        super().__init__(baseline)
        self._names = tuple(names)
        self.requirements: tuple[Requirement, ...] = ()
        self._recorder: RequirementsRecorder | None = None

    def begin(self, scenario: Scenario, unit_lane: str | None = None, unit_votes: bool = True) -> None:
        """Take the scenario as it is flown.  BadInput: its requirements."""
        super().begin(scenario, unit_lane, unit_votes)
        self.requirements = load_requirements([*self._names, *(scenario.requirements or ())])
        if not self.requirements:
            return
        recorder_of(scenario, self.requirements, iter(()))  # refuses what the flight does not have, baseline or not
        if self._alone:
            self._recorder = recorder_of(scenario, self._alone, baseline=False)

    @property
    def needs_baseline(self) -> bool:
        """Return whether the baseline is flown when the flight is over."""
        return any(each.names_baseline for each in self.requirements)

    @property
    def _alone(self) -> list[Requirement]:
        return [each for each in self.requirements if not each.names_baseline]

    def add(self, table: Table) -> None:
        """Take the next frames, block by block as the conclusion does."""
        super().add(table)
        if self._recorder is not None:
            self._recorder.record(table)

    def verdicts(self, log: Path, unit: UnitUnderTest | None = None, allow_code: bool = False) -> tuple[Verdict, ...]:
        """Return the verdicts of the finished flight, in the order of the requirements.

        log : of the flight, beside which the baseline is flown where it is named; unit, allow_code : that fly it
        """
        late = [each for each in self.requirements if each.names_baseline]
        verdicts = [*(() if self._recorder is None else self._recorder.finish())]
        verdicts += check_log(log, late, unit, allow_code) if late else ()
        order = {each.id: i for i, each in enumerate(self.requirements)}
        return tuple(sorted(verdicts, key=lambda verdict: order[verdict.requirement]))


def measure_scored(
    scored: Scored, asked: Sequence[Requirement], baseline: bool, unit: UnitUnderTest | None, allow_code: bool
) -> tuple[tuple[Verdict, ...], str]:
    """Return the verdicts on a log that was scored, and why those of its scenario are not among them, if so.

    asked : measured in any case, BadInput otherwise; those of the scenario if its files are there
    baseline : it is flown where it is named
    """
    named, remark = (), ""
    try:
        asked_ids = {each.id for each in asked}
        own = load_requirements(scored.scenario.requirements or ())
        named = tuple(each for each in own if each.id not in asked_ids and (baseline or not each.names_baseline))
    except BadInput as error:
        remark = f"requirements of the scenario are not measured: {error}"
    every = [*asked, *named]
    return (check_log(scored.log, every, unit, allow_code, baseline) if every else ()), remark


def violated(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the verdicts that are violated, the least robustness first."""
    return sorted(
        (verdict for verdict in verdicts if verdict.status == "violated"), key=lambda verdict: verdict.robustness
    )


def events(verdicts: Sequence[Verdict], rate_hz: float) -> list[Event]:
    """Return an event where each violated verdict is decided, in order of time."""
    violations = []
    for verdict in violated(verdicts):
        there = ", ".join(f"{name} {quantity(value, unit)}" for name, (value, unit) in verdict.values.items())
        shown = robustness_text(verdict.robustness)
        robustness = f"robustness {shown}; " if shown else ""
        text = f"{f'{verdict.requirement} {verdict.signal}'.rstrip()}: {robustness}{there}"
        violations.append(Event(round(verdict.instant_s * rate_hz), "error", VIOLATED, text))
    return sorted(violations, key=lambda event: event.frame)


def plain(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as JSON has it: robustness null where it has no number, all null where not applicable."""
    numbers = {
        name: {"value": value if isfinite(value) else None, "unit": u} for name, (value, u) in verdict.values.items()
    }
    applies = isfinite(verdict.robustness)
    return {
        **verdict._asdict(),
        "robustness": number_of(verdict.robustness),
        "instant_s": verdict.instant_s if applies else None,
        "values": numbers,
    }
