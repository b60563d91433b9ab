"""The ``modelDescription.xml`` of the aircraft as an FMU, FMI 2.0 or 3.0."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version as installed
from typing import Final
from xml.sax.saxutils import quoteattr

from rig.flight.aircraft_fmu.aircraft_variables import TYPES, Kind, Variable
from rig.scenario.scenario import Scenario
from rig.unit.fmu_description import Version

IDENTIFIER: Final = "RigAircraft"  # of the library, and the class that it looks for
_UNITS: Final = {  # in base units of FMI
    "s": 's="1"',
    "m": 'm="1"',
    "m/s": 'm="1" s="-1"',
    "m/s2": 'm="1" s="-2"',
    "rad": 'rad="1"',
    "rad/s": 'rad="1" s="-1"',
    "Pa": 'kg="1" m="-1" s="-2"',
    "g": 'm="1" s="-2" factor="9.80665"',
    "1": "",
}
_FLAGS: Final[dict[Version, dict[str, str]]] = {
    "2": {
        "needsExecutionTool": "true",  # Python with this package
        "canHandleVariableCommunicationStepSize": "true",  # whole frames
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "false",
        "canSerializeFMUstate": "false",
    },
    "3": {
        "needsExecutionTool": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUState": "false",
        "canSerializeFMUState": "false",
    },
}


def description(name: str, scenario: Scenario, every: Sequence[Variable], version: Version, token: str) -> str:
    """Return the text of ``modelDescription.xml``."""
    step = repr(1.0 / scenario.rate_hz)
    head = {
        "fmiVersion": f"{version}.0",
        "modelName": name,
        "guid" if version == "2" else "instantiationToken": token,
        "description": scenario.title or f"{scenario.aircraft} with redundant sensors",
        "version": installed("jsbsim-rig"),
        "generationTool": f"jsbsim-rig {installed('jsbsim-rig')}",
        "variableNamingConvention": "structured",
    }
    flags = {"modelIdentifier": IDENTIFIER, **_FLAGS[version]}
    if version == "3":
        flags["fixedInternalStepSize"] = step
    experiment = {"startTime": "0", "stopTime": repr(scenario.duration_s), "stepSize": step}
    used = {variable.unit for variable in every} - {""}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<fmiModelDescription{_attributes(head)}>",
        f"  <CoSimulation{_attributes(flags)}/>",
        "  <UnitDefinitions>",
        *(f'    <Unit name="{unit}"><BaseUnit {base}/></Unit>' for unit, base in _UNITS.items() if unit in used),
        "  </UnitDefinitions>",
        '  <LogCategories><Category name="logStatusDiscard"/></LogCategories>',
        f"  <DefaultExperiment{_attributes(experiment)}/>",
        "  <ModelVariables>",
        *(f"    {_element(variable, version)}" for variable in every),
        "  </ModelVariables>",
        "  <ModelStructure>",
        *_structure(every, version),
        "  </ModelStructure>",
        "</fmiModelDescription>",
        "",
    ]
    return "\n".join(lines)


def _element(variable: Variable, version: Version) -> str:
    type_ = TYPES[version][variable.kind]
    places: dict[str, str] = {"name": variable.name, "valueReference": str(variable.reference)}
    places |= {"description": variable.about, "causality": variable.causality}
    if variable.causality != "independent":
        places["variability"] = "fixed" if variable.causality == "parameter" else "discrete"
    if variable.causality == "output":
        places["initial"] = "calculated"
    values: dict[str, str] = {"unit": variable.unit} if variable.unit and variable.kind is Kind.REAL else {}
    if variable.start is not None:
        values["start"] = repr(variable.start)
    if version == "2":
        return f"<ScalarVariable{_attributes(places)}><{type_}{_attributes(values)}/></ScalarVariable>"
    if not variable.count:
        return f"<{type_}{_attributes(places | values)}/>"
    return f'<{type_}{_attributes(places | values)}><Dimension start="{variable.count}"/></{type_}>'


def _structure(every: Sequence[Variable], version: Version) -> list[str]:
    """Return the outputs, which depend on no input at their time; at the beginning, on the parameters."""
    outputs = [i for i, variable in enumerate(every) if variable.causality == "output"]
    given = [i for i, variable in enumerate(every) if variable.causality == "parameter"]
    if version == "3":
        known = " ".join(str(every[i].reference) for i in given)
        return [
            f'    <{kind} valueReference="{every[i].reference}" dependencies="{on}"/>'
            for kind, on in (("Output", ""), ("InitialUnknown", known))
            for i in outputs
        ]
    known, lines = " ".join(str(i + 1) for i in given), list[str]()
    for kind, on in (("Outputs", ""), ("InitialUnknowns", known)):
        unknowns = [f'      <Unknown index="{i + 1}" dependencies="{on}"/>' for i in outputs]
        lines += [f"    <{kind}>", *unknowns, f"    </{kind}>"]
    return lines


def _attributes(values: dict[str, str]) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items())
