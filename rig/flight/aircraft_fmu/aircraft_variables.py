"""The variables of the aircraft as an FMU: surfaces in; channels, truth and commands out; faults as parameters.

An output's value reference is the byte of the frame's row at which it begins, so that reading many is one gather.
FMI 2.0 has a scalar for each channel, ``pitch_rate.channel[1]``; FMI 3.0 has arrays, ``pitch_rate.channel``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from enum import IntEnum
from hashlib import sha256
from typing import Final, Literal

import numpy as np

from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, SURFACES, End, Ilm
from rig.core.frame.fields import BASES, FIELD
from rig.core.frame.row import offset
from rig.core.units.quantities import unit_of_name
from rig.scenario.scenario import Scenario
from rig.unit.fmu_description import Version
from rig.world.faults.fault_settings import in_thresholds

Causality = Literal["independent", "input", "output", "parameter"]
TIME, INPUT, PARAMETER = 1 << 22, 1 << 23, 1 << 24  # value references; those of outputs are below


class Kind(IntEnum):
    """The type of a variable."""

    REAL = 0
    WHOLE = 1
    FLAG = 2
    LONG = 3  # whole numbers of 64 bits, where FMI has them


TYPES: Final[dict[Version, dict[Kind, str]]] = {
    "2": {Kind.REAL: "Real", Kind.WHOLE: "Integer", Kind.FLAG: "Boolean", Kind.LONG: "Integer"},
    "3": {Kind.REAL: "Float64", Kind.WHOLE: "Int32", Kind.FLAG: "Boolean", Kind.LONG: "Int64"},
}
MOST_INTEGER: Final = 2**31 - 1  # of FMI 2.0


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable; ``count`` is the extent of an array, 0: a scalar; ``key`` of a parameter is what it overrides."""

    name: str
    causality: Causality
    kind: Kind
    reference: int
    about: str
    unit: str = ""
    count: int = 0
    start: float | None = None
    key: str = ""

    def scalars(self) -> Iterator[Variable]:
        """Yield its elements; an index counts from 1."""
        width = np.dtype("f8").itemsize if self.kind is Kind.REAL else 1
        for i in range(self.count):
            yield replace(self, name=f"{self.name}[{i + 1}]", reference=self.reference + i * width, count=0)
        if not self.count:
            yield self


def variables(scenario: Scenario, trim: Sequence[float], version: Version) -> list[Variable]:
    """Return all variables of a scenario; an input starts in ``trim``, (4,)."""
    every = [*_inputs(trim), *_outputs(), *_parameters(scenario)]
    if version == "3":
        time = Variable("time", "independent", Kind.REAL, TIME, "time of the frame", "s")
        return [time, *every]
    return [scalar for variable in every for scalar in variable.scalars()]


def digest(every: Sequence[Variable]) -> str:
    """Return 16 hexadecimal digits that no other table of variables has."""
    return sha256(repr([astuple(variable) for variable in every]).encode()).hexdigest()[:16]


def _inputs(trim: Sequence[float]) -> Iterator[Variable]:
    for i, (name, start) in enumerate(zip(SURFACES, trim, strict=True)):
        unit = unit_of_name(name)
        about = "commanded position, from 0 to 1" if not unit else "commanded position, signs as JSBSim's fcs/*-pos-rad"
        yield Variable(f"surface.{name}", "input", Kind.REAL, INPUT + i, about, unit or "1", start=start)


def _outputs() -> Iterator[Variable]:
    for i, signal in enumerate(SIGNALS):
        name = signal.name
        yield _of(f"{name}.channel", "channels", i, "samples of the four channels", signal.unit, CHANNELS)
        yield _of(f"{name}.valid", "valid", i, "validity flag of each sample", count=CHANNELS)
        yield _of(f"{name}.monitor", "ilm", i, f"in-line monitors: {_meaning(Ilm)}", count=CHANNELS)
        yield _of(f"{name}.truth", "truth", i, "true value", signal.unit)
        yield _of(f"{name}.reset", "reset", i, "channels to readmit by command: bit 0 is channel 1")
    for i, discrete in enumerate(DISCRETES):
        name = discrete.name
        yield _of(f"{name}.channel", "discrete_channels", i, "samples of the four channels", count=CHANNELS)
        yield _of(f"{name}.valid", "discrete_valid", i, "validity flag of each sample", count=CHANNELS)
        yield _of(f"{name}.monitor", "discrete_ilm", i, f"in-line monitors: {_meaning(Ilm)}", count=CHANNELS)
        yield _of(f"{name}.truth", "discrete_truth", i, "true value")
        yield _of(f"{name}.reset", "discrete_reset", i, "channels to readmit by command: bit 0 is channel 1")
    for field, about in (
        ("flight", "true flight condition"),
        ("inertial", "inertial unit"),
        ("autopilot_command", "command, as a change from the value at engagement"),
    ):
        for i, element in enumerate(FIELD[field].elements):
            yield _of(f"{field}.{element}", field, i, about, unit_of_name(element) or "1")
    yield _of("end", "end", 0, f"end of the flight: {_meaning(End)}")


def _of(name: str, field: str, i: int, about: str, unit: str = "", count: int = 0) -> Variable:
    """Return an output: element or row ``i`` of a field of the frame."""
    base = np.dtype(BASES[FIELD[field].kind])
    flag = FIELD[field].kind == "flag"
    kind = Kind.REAL if base.kind == "f" else Kind.FLAG if flag else Kind.WHOLE
    return Variable(name, "output", kind, offset(field) + i * max(count, 1) * base.itemsize, about, unit, count)


def _meaning(values: type[IntEnum]) -> str:
    return ", ".join(f"{value.value} {value.name.lower().replace('_', ' ')}" for value in values)


def _parameters(scenario: Scenario) -> Iterator[Variable]:
    """Yield the seed, and onset and size of each fault, as far as the scenario gives them."""
    yield Variable(
        "seed", "parameter", Kind.LONG, PARAMETER, "seed of all random draws", start=scenario.seed, key="seed"
    )
    found = [
        (i, key, value)
        for i, fault in enumerate(scenario.faults)
        for key in ("start_s", *(name for size in type(fault).sizes for name in (size, in_thresholds(size))))
        if isinstance(value := getattr(fault, key, None), float)
    ]
    for n, (i, key, value) in enumerate(found, 1):
        name, about = f"fault[{i + 1}].{key}", f"{'onset' if key == 'start_s' else 'size'}: {scenario.faults[i].label}"
        unit = "s" if key == "start_s" else ""
        yield Variable(name, "parameter", Kind.REAL, PARAMETER + n, about, unit, start=value, key=f"faults.{i}.{key}")
