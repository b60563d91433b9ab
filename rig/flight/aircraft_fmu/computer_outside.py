"""Scenarios that fly without a flight computer inside: nothing of them may need votes, references or lanes."""

from __future__ import annotations

from rig.computer.redundancy.managers import DEFAULT
from rig.core.errors import BadInput
from rig.scenario.scenario import Scenario
from rig.world.faults import Fault
from rig.world.faults.expression import parse, reads_votes
from rig.world.faults.places import site


def without_computer(scenario: Scenario, name: str) -> Scenario:
    """Return the scenario without the settings that only the flight computer, an operator or an assessment reads.

    So no FMU names code or files of the user.  BadInput names ``name`` and the first key that needs a flight computer.
    """
    if reason := needs_computer(scenario):
        raise BadInput(f"{name}: {reason}")
    redundancy = scenario.redundancy.model_copy(update={"manager": DEFAULT})
    return scenario.model_copy(update={"redundancy": redundancy, "live": [], "requirements": None})


def needs_computer(scenario: Scenario) -> str:
    """Return the first key that needs the flight computer, and why; "" if there is none."""
    if scenario.computers.count > 1:
        return (
            f"computers.count: is {scenario.computers.count}, must be 1 for an FMU: the flight computer is outside it, "
            "and reads all channels"
        )
    found = (f"faults.{i}.{reason}" for i, fault in enumerate(scenario.faults) if (reason := _needs(fault)))
    return next(found, "")


def _needs(fault: Fault) -> str:
    if fault.on is not None:
        return "on: waits for a vote or a state of the flight computer, which is outside an FMU; allowed: start_s, when"
    if fault.when is not None and reads_votes(parse(fault.when)):
        return "when: reads voted values, which are outside an FMU; allowed: names that begin with true."
    references = (point.place for point in fault.points if site(point.place) == "reference")
    found = next(references, "")
    return f"signal: {found} is computed by the flight computer, which is outside an FMU" if found else ""
