"""Requirements on a flight that is flown for them, on a log, and on rows in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rig.core.blocks import cuts
from rig.core.errors import BadInput
from rig.core.frame import Block, Table
from rig.core.trust import Trust
from rig.flight import loop
from rig.flight.unit_loop import UnitComputer
from rig.log import LogFile, scenario_of, unit_of
from rig.scenario.pressed_keys import pressed
from rig.scenario.scenario import Scenario, from_resolved
from rig.unit.running_unit import UnitUnderTest
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder, Verdict
from rig.verdict.requirements.subject import Subject, of_flight
from rig.verdict.transients import baseline_blocks


def names_baseline(requirements: Sequence[Requirement]) -> bool:
    """Return True if a formula names the baseline, which must then be flown."""
    return any(each.names_baseline for each in requirements)


def recorder_of(
    scenario: Scenario,
    requirements: Sequence[Requirement],
    baseline: Iterator[Block] | Block | bool | None = None,
    unit: UnitUnderTest | None = None,
    lines: bool = False,
) -> RequirementsRecorder:
    """Return what measures requirements on a flight of ``scenario``.

    baseline : its rows, in blocks or whole; True or None: flown where a formula names it; False: there is none
    lines : as of RequirementsRecorder
    """
    blocks: Iterator[Block] | None = None
    if isinstance(baseline, bool) or baseline is None:
        if baseline is not False and names_baseline(requirements):
            blocks = _late(scenario, unit)
    else:
        blocks = baseline if isinstance(baseline, Iterator) else (baseline[part] for part in cuts(len(baseline)))
    return RequirementsRecorder(requirements, of_flight(scenario), blocks, lines)


def _late(scenario: Scenario, unit: UnitUnderTest | None) -> Iterator[Block]:
    """Fly the baseline when its first rows are asked for."""
    yield from baseline_blocks(scenario, scenario.frames, unit)


def fly_requirements(
    scenario: Scenario,
    requirements: Sequence[Requirement],
    baseline: Iterator[Block] | Block | bool | None = None,
    unit: UnitUnderTest | None = None,
) -> tuple[Verdict, ...]:
    """Fly a scenario without a log, and its baseline where a formula names it; return the verdicts.

    baseline : as of ``recorder_of``; unit : under test, that flies it.  BadInput before the first frame.
    """
    recorder = recorder_of(scenario, requirements, baseline, unit)
    loop.fly(loop.Rig(scenario, None if unit is None else UnitComputer(unit)), [recorder])
    return recorder.finish()


def check_rows(
    rows: Block,
    subject: Scenario | Subject,
    requirements: Sequence[Requirement],
    baseline: Block | bool | None = None,
    unit: UnitUnderTest | None = None,
) -> tuple[Verdict, ...]:
    """Measure requirements on all rows of a flight, a recording or a bench; return the verdicts.

    subject : the scenario of a flight, or what a recording has; baseline, unit : as of ``recorder_of``
    """
    if isinstance(subject, Scenario):
        recorder = recorder_of(subject, requirements, baseline, unit)
    else:
        recorder = RequirementsRecorder(requirements, subject)
    for part in cuts(len(rows)):
        recorder.record(Table(rows[part]))
    return recorder.finish()


def check_log(
    path: Path | str,
    requirements: Sequence[Requirement],
    unit: UnitUnderTest | None = None,
    allow_code: bool = False,
    baseline: bool = True,
) -> tuple[Verdict, ...]:
    """Measure requirements on the flight in a log, block by block; return the verdicts.  BadInput names the log.

    baseline : False: it is not flown, whatever names it; unit : under test, that flew it and flies the baseline
    allow_code : a manager class that the log names may be run
    """
    path = Path(path)
    log = LogFile.open(path)
    resolved = scenario_of(log.metadata, path)
    if not resolved:
        raise BadInput(f"{path}: no scenario, so no requirement can be measured; only logs of rig fly have one")
    scenario = pressed(
        from_resolved(resolved, f"{path}: scenario", Trust(str(path), allow_code)), log.result, str(path)
    )
    if baseline and names_baseline(requirements):
        scenario.trust.require(scenario.redundancy.manager)
        if "unit" in log.metadata and unit is None:
            raise BadInput(f"{path}: a unit under test flew it; give --unit FILE to fly the baseline")
    if unit is not None:
        unit.fly_as(unit_of(log.metadata))
    try:
        recorder = recorder_of(scenario, requirements, baseline, unit)
        for block in log.blocks():
            recorder.record(block)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    return recorder.finish()
