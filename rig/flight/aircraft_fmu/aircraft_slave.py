"""The aircraft as pythonfmu (FMI 2.0) and pythonfmu3 (FMI 3.0) call it; the class in the FMU is made of both.

An exception in a call ends all FMUs of the host's process, so only what a master does wrong before the first step
raises.  In flight a step is discarded, with the reason in the FMU's log.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import SURFACES, End
from rig.core.settings import read_toml
from rig.flight.aircraft_fmu.aircraft_variables import INPUT, PARAMETER, TIME, Kind, Variable, digest, variables
from rig.flight.aircraft_fmu.stepped import SteppedAircraft
from rig.scenario.scenario import Scenario, from_resolved, load
from rig.unit.fmu_description import Version

SCENARIO: Final = "scenario.toml"  # among the resources of an FMU: resolved
BUILT: Final = "rig.json"  # and how it was built
NOISE: Final = "noise"  # and the noise files of sensors, SENSOR.csv
DISCARD: Final = 2  # the same status in both versions of FMI
_CATEGORY: Final = "logStatusDiscard"
_WHOLE_FRAMES: Final = 1e-6  # of a frame, by which a step may miss whole frames: times are sums in some masters
_LATE_FRAMES: Final = 0.5  # by which the master's time may differ from the flight's


class StepResult(NamedTuple):
    """The answer to a step of FMI 3.0."""

    status: int = 0
    terminateSimulation: bool = False  # noqa: N815 # the library's name


class Slave:
    """The part that both versions of FMI share; the other base class has ``log``."""

    fmi: Version  # the other base class has a ``version``, of the model
    log: Callable[..., None]

    def begin(self, resources: str) -> None:
        """Read the scenario of the FMU.  BadInput: it was built by another state of the package."""
        folder = Path(resources)
        built = json.loads((folder / BUILT).read_text())
        self._scenario = _scenario(folder)
        every = variables(self._scenario, built["trim"], self.fmi)
        if digest(every) != built["variables"]:
            raise BadInput("this FMU has other variables than the installed jsbsim-rig: build it again (rig fmu build)")
        self._of = {variable.reference: variable for variable in every}
        self._surfaces: list[float] = list(built["trim"])
        self._given: dict[str, float] = {}  # overrides by key
        self._flight: SteppedAircraft | None = None
        self._begun, self._refused, self._begin_s = False, "", 0.0
        self._places: dict[tuple[int, ...], NDArray[np.intp] | None] = {}

    def setup_experiment(self, start_time: float, *_: float | None) -> None:
        """Take the time of the first frame."""
        self._begin_s = start_time

    def enter_initialization_mode(self) -> None:
        """Wait for the parameters."""

    def exit_initialization_mode(self) -> None:
        """Trim the aircraft with the parameters as they are.  BadInput: one is not allowed."""
        self._aircraft()
        self._begun = True

    def terminate(self) -> None:
        """Release JSBSim while Python is there."""
        self._flight = None

    def _aircraft(self) -> SteppedAircraft:
        """Return the flight, at its first frame if the parameters have changed."""
        if self._flight is None:
            given = dict(self._given)
            seed = given.pop("seed", None)
            self._flight = SteppedAircraft(load(self._scenario, given, None if seed is None else int(seed)))
        return self._flight

    def advance(self, current_time: float, step_size: float) -> str:
        """Fly the frames of a step; return why it is discarded, "" if it is not."""
        flight, rate_hz = self._aircraft(), self._scenario.rate_hz
        if flight.frame == 0 and isfinite(current_time):
            self._begin_s = current_time  # pythonfmu3 does not pass the start time on
        wrong, self._refused = self._refused or self._odd(flight, current_time, step_size), ""
        if not wrong:
            for _ in range(round(step_size * rate_hz)):
                if not flight.step(self._surfaces):
                    at = f"{self._begin_s + flight.frame / rate_hz:g} s"
                    wrong = f"the flight is over since {at}: {flight.end.name.lower().replace('_', ' ')}"
                    break
        if wrong:
            self.log(f"step discarded: {wrong}", DISCARD, _CATEGORY)
        return wrong

    def _odd(self, flight: SteppedAircraft, current_time: float, step_size: float) -> str:
        """Return what is wrong with a step or with the inputs."""
        rate_hz = self._scenario.rate_hz
        frames = step_size * rate_hz
        if not (isfinite(frames) and frames > _LATE_FRAMES and abs(frames - round(frames)) <= _WHOLE_FRAMES):
            return f"its length is {step_size!r} s, must be a whole number of frames of {1.0 / rate_hz!r} s"
        if not abs((current_time - self._begin_s) * rate_hz - flight.frame) < _LATE_FRAMES:
            return f"it begins at {current_time!r} s, the flight is at {self._begin_s + flight.frame / rate_hz!r} s"
        if not all(map(isfinite, self._surfaces)):
            name, value = next(
                (name, value) for name, value in zip(SURFACES, self._surfaces, strict=True) if not isfinite(value)
            )
            return f"surface.{name} is {value}, must be a finite number"
        return ""

    def _get_numbers(self, references: Sequence[int]) -> list[float]:
        flight, key = self._aircraft(), tuple(references)
        at = self._places[key] if key in self._places else self._gather(key, 8)
        return self._one_by_one(key) if at is None else flight.numbers[flight.row].take(at).tolist()

    def _get_wholes(self, references: Sequence[int]) -> list[int]:
        flight, key = self._aircraft(), tuple(references)
        at = self._places[key] if key in self._places else self._gather(key, 1)
        return self._one_by_one(key) if at is None else flight.raw[flight.row].take(at).tolist()

    def _gather(self, references: tuple[int, ...], width: int) -> NDArray[np.intp] | None:
        """Return where outputs stand in a row, in units of ``width`` bytes; None where one is no output."""
        outputs = [self._of[reference] for reference in references]
        places = [one.reference // width + i for one in outputs for i in range(max(one.count, 1))]
        is_row = all(one.causality == "output" for one in outputs)
        self._places[references] = np.array(places, np.intp) if is_row else None
        return self._places[references]

    def _one_by_one(self, references: Sequence[int]) -> list[Any]:
        return [value for reference in references for value in self._value(self._of[reference])]

    def _value(self, variable: Variable) -> list[Any]:
        if variable.causality == "output":
            get = self._get_numbers if variable.kind is Kind.REAL else self._get_wholes
            return list(get([variable.reference]))
        if variable.causality == "input":
            return [self._surfaces[variable.reference - INPUT]]
        if variable.reference == TIME:
            return [self._begin_s + self._aircraft().frame / self._scenario.rate_hz]
        return [self._given.get(variable.key, variable.start)]

    def _set(self, references: Sequence[int], values: Sequence[float]) -> None:
        for reference, value in zip(references, values, strict=True):
            if INPUT <= reference < PARAMETER:
                self._surfaces[reference - INPUT] = value
            elif self._begun:
                self._refused = f"{self._of[reference].name} was set in flight, but parameters are fixed then"
            else:
                self._given[self._of[reference].key] = value
                self._flight = None


class Slave2(Slave):
    """The calls of pythonfmu."""

    fmi = "2"

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Fly a step; False: it is discarded."""
        return not self.advance(current_time, step_size)

    get_real, get_integer, get_boolean = Slave._get_numbers, Slave._get_wholes, Slave._get_wholes
    set_real = set_integer = set_boolean = Slave._set


class Slave3(Slave):
    """The calls of pythonfmu3."""

    fmi = "3"

    def do_step(self, current_time: float, step_size: float) -> StepResult:
        """Fly a step."""
        wrong = self.advance(current_time, step_size)
        return StepResult(DISCARD if wrong else 0, self._aircraft().end != End.FLYING)

    get_float64, get_int32, get_int64 = Slave._get_numbers, Slave._get_wholes, Slave._get_wholes
    get_boolean = Slave._get_wholes
    set_float64 = set_int32 = set_int64 = set_boolean = Slave._set


def _scenario(folder: Path) -> Scenario:
    """Return the scenario of an FMU; the noise files are among its resources."""
    data = read_toml(folder / SCENARIO)
    for name, sensor in data["sensors"].items():
        if isinstance(sensor, dict) and "noise_file" in sensor:
            sensor["noise_file"] = str(folder / NOISE / f"{name}.csv")
    return from_resolved(data, "scenario of the FMU")
