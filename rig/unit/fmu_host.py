"""The child process that steps an FMU: from messages of a socket to functions of FMI, and back.

    python -I guard.py PARENT fmu_host.py FD FOLDER BLANK NAME=SIZE ...   (processes.py starts it)

FOLDER has the unpacked FMU and the plan that fmu.py has written.  The host makes arrays of value references and values
once per session and passes them to FMPy's raw functions, several times as fast as FMPy's methods with lists.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Terminated
from fmpy.fmi3 import FMU3Slave

if __name__ == "__main__" and (_root := str(Path(__file__).parents[2])) not in sys.path:
    sys.path.insert(0, _root)  # python -I looks for the rig only where it is installed, and that may be another
from rig.core.decimals import slack
from rig.unit.fmu_moves import NAMES, TYPES, Call, Views, moving, views_of
from rig.unit.host import REFUSED, Host, Refused, ReplyChannel, serve

DISCARD, FATAL = 2, 4
STATUS: Final = ("ok", "warning", "discard", "error", "fatal", "pending")
CONFIG, INPUT, OUTPUT = range(3)  # records of a run; a control law has another in place of INPUT: plan["asked"]
_INT: Final = np.iinfo(np.intc)
_NO_BYTE: Final = 255  # in no enum: what an integer becomes that no byte can hold
_TYPES_2: Final = {"Real": ("Real", ctypes.c_double), "Boolean": ("Boolean", ctypes.c_int)}  # all others: Integer
_TYPES_3: Final = {
    **{f"{sign}Int{n}": f"c_{sign.lower()}int{n}" for sign in ("", "U") for n in (8, 16, 32, 64)},
    **{"Float64": "c_double", "Float32": "c_float", "Boolean": "c_bool"},
}  # by name in FMI the type in ctypes; Enumeration: Int64
_SAME_STEP: Final = 1e-6  # of a frame


class Fmu(ABC):
    """An FMU with the functions that the host calls: ``open``, ``step``, ``close``."""

    kind: str  # its text about itself
    machine: str  # how its standard calls the folder of this machine's libraries
    prefix: str  # of its functions
    slave: Any  # FMPy's class

    def __init__(self, folder: Path, plan: dict[str, Any], layout: int) -> None:
        """Refused: no library for this machine, or one that lacks functions."""
        self._plan, self._runs, self._fatal, self.layout = plan, False, False, layout
        path = folder / "binaries" / self.machine / (plan["identifier"] + fmpy.sharedLibraryExtension)
        if not os.path.isfile(path):  # noqa: PTH113 # Path.is_file raises for a name that is too long
            raise Refused(f"the FMU has no library for this machine: {path.relative_to(folder)}")
        try:
            ctypes.CDLL(str(path))
            names = {"guid": plan["token"], "modelIdentifier": plan["identifier"]}
            self.fmu = self.slave(**names, unzipDirectory=str(folder))
        except (OSError, AttributeError) as error:
            raise Refused(f"the FMU's library cannot be loaded: {str(error).replace(str(folder), '')}") from None

    def _function(self, name: str) -> Callable[..., Any]:
        return getattr(self.fmu, self.prefix + name)

    @abstractmethod
    def _call(self, run: dict[str, Any], address: int, verb: str) -> Call:
        """Return a function that sets or gets the variables of ``run`` in the record at ``address``."""

    @abstractmethod
    def _raw(self, kind: str, count: int, verb: str, references: Any) -> tuple[Call, Any]:
        """Return a function that sets or gets ``count`` values of the FMI type ``kind``, and their ctypes array."""

    @abstractmethod
    def _do_step(self, time_s: float) -> None:
        """Make one step from ``time_s`` on."""

    def _wants_to_end(self) -> bool:
        """Return True if a step was discarded because the unit requests its end."""
        return False

    def bind(self, source: int, target: int) -> None:
        """Store the addresses of the input and output records of all frames."""
        self._input, self._output = source, target
        self._time = ctypes.c_double.from_address(source + self._plan["time_s"])
        self._said = ctypes.c_uint8.from_address(target + self._plan["said"])

    def open(self, config: int) -> None:
        """Start a session with the record at the address ``config``.  Refused: the unit refuses.

        Each session has a new instance, because not every FMU that declares a reset can be reset.
        """
        self.close()
        if self._fatal:
            raise Refused("the FMU has had a fatal error")
        rate_hz = ctypes.c_double.from_address(config + self._plan["rate_hz"]).value
        self._step_s = 1.0 / rate_hz
        self._require_step(rate_hz)
        try:
            self.fmu.instantiate(loggingOn=True)
        except Exception as error:  # noqa: BLE001 # FMPy's own
            raise Refused(f"the FMU was not instantiated; its library may have another layout: {error}") from None
        try:
            self._initialize(config)
        except FMICallException as error:
            raise Refused(self._failed(error)) from None
        asked = self._plan["asked"]
        self._puts, self._gets = self._calls(asked, self._input, "Set"), self._calls(OUTPUT, self._output, "Get")
        self._runs = True

    def _require_step(self, rate_hz: float) -> None:
        """Refused: its steps do not make a frame."""
        inner, only, frame = self._plan["inner_step_s"], self._plan["only_step_s"], f"a frame has {self._step_s:.9g} s"
        if float(only) > 0.0 and not makes_a_frame(only, 1, rate_hz):
            why = "canHandleVariableCommunicationStepSize is false"
            raise Refused(f"the FMU accepts only steps of {float(only):.9g} s ({why}), {frame}")
        if (inner_s := float(inner)) > 0.0 and not makes_a_frame(inner, max(1, round(self._step_s / inner_s)), rate_hz):
            raise Refused(f"the FMU makes steps of {inner_s:.9g} s (fixedInternalStepSize), {frame}, no multiple of it")

    def _initialize(self, config: int) -> None:
        """Set the parameters of a new instance by CONFIG at ``config``, and bring it to its first step."""
        mapped = "runs" not in self._plan
        for put in self._once("parameter", config) if mapped else self._calls(CONFIG, config, "Set"):
            put()
        self.fmu.enterInitializationMode()
        for put in self._once("input", config) if mapped else ():
            put()
        self.fmu.exitInitializationMode()

    def close(self) -> None:
        """End the instance; the library stays."""
        instance, self.fmu.component = self.fmu.component, None
        if instance is None or self._fatal:
            return
        if self._runs:
            with suppress(FMICallException):
                self._function("Terminate")(instance)
        self._runs = False
        self._function("FreeInstance")(instance)

    def step(self, source: int, target: int) -> int:
        """Fly one frame; a discarded step leaves an answer without any group.  Refused: the unit has failed."""
        try:
            for put in self._puts:
                put()
            self._do_step(self._time.value)
            for get in self._gets:
                get()
        except FMICallException as error:
            if error.status != DISCARD or self._wants_to_end():
                raise Refused(self._failed(error)) from None
            self._said.value = 0
        return 0

    def _failed(self, error: FMICallException) -> str:
        self._runs, self._fatal = False, error.status == FATAL
        if error.status == DISCARD and self._wants_to_end():
            return f"{error.function}: the FMU requests the end of the simulation"
        return f"{error.function} returned {STATUS[error.status] if error.status < len(STATUS) else error.status}"

    def _calls(self, record: int, address: int, verb: str) -> list[Call]:
        if "runs" not in self._plan:
            return self._mapped(record, address, verb)
        return [self._call(run, address, verb) for run in self._plan["runs"] if run["record"] == record]

    def _mapped(self, record: int, address: int, verb: str) -> list[Call]:
        """Return the calls of a mapping (fmu_mapping.py); the last one fills OUTPUT without variables."""
        views = views_of(address, self._plan["bytes"][str(record)])
        calls = [self._mapped_call(run, views, verb) for run in self._plan["outputs" if record == OUTPUT else "inputs"]]
        if record != OUTPUT:
            return calls
        at, values = (np.array(column) for column in zip(*self._plan["filled in"], strict=True))
        return [*calls, partial(views["BYTE"].__setitem__, at, values)]

    def _mapped_call(self, run: dict[str, Any], views: Views, verb: str) -> Call:
        references = (ctypes.c_uint * len(run["references"]))(*run["references"])
        return moving(run, views, *self._raw(run["type"], len(run["start"]), verb, references), verb)

    def _once(self, causality: str, config: int) -> list[Call]:
        """Return the calls of a mapping that set variables of a ``causality`` by CONFIG at ``config``, or constants."""
        views = views_of(config, self._plan["bytes"][str(CONFIG)])
        return [self._mapped_call(run, views, "Set once") for run in self._plan.get(f"{causality}s once", ())]

    def _text(self, run: dict[str, Any], address: int) -> Any:
        """Return the texts of a run, which have equal lengths."""
        count = len(run["references"])
        room = (run["end"] - run["first"]) // count
        return (ctypes.c_char_p * count)(*(ctypes.string_at(address + run["first"] + i * room) for i in range(count)))


class Fmi2(Fmu):
    """An FMU of FMI 2.0: scalars, and one type of integers."""

    kind, machine, prefix, slave = "FMI 2.0", fmpy.platform, "fmi2", FMU2Slave

    def _initialize(self, config: int) -> None:
        self.fmu.setupExperiment(startTime=0.0)
        super()._initialize(config)

    def _call(self, run: dict[str, Any], address: int, verb: str) -> Call:
        count, kind = len(run["references"]), run["kind"]
        references = (ctypes.c_uint * count)(*run["references"])
        name = {"REAL": "Real", "text": "String"}.get(kind, "Integer")
        call = partial(self._function(verb + name), self.fmu.component, references, count)
        if kind == "text":
            return partial(call, self._text(run, address))
        values = (TYPES[kind] * count).from_address(address + run["first"])
        if kind == "REAL":
            return partial(call, values)
        return self._integers(call, np.ctypeslib.as_array(values), verb)

    @staticmethod
    def _integers(call: Callable[..., Any], field: Any, verb: str) -> Call:
        """Return ``call`` with conversion to integers of FMI 2.0, which have 32 bits."""
        held = (ctypes.c_int * len(field))()
        wide = np.ctypeslib.as_array(held)

        def put() -> None:
            if field.dtype == np.uint8:
                wide[:] = field
            else:
                np.clip(field, _INT.min, _INT.max, out=wide, casting="unsafe")
            call(held)

        def get() -> None:
            call(held)
            if field.dtype == np.uint8:
                np.minimum(wide.view(np.uintc), _NO_BYTE, out=field, casting="unsafe")
            else:
                field[:] = wide

        return put if verb == "Set" else get

    def _raw(self, kind: str, count: int, verb: str, references: Any) -> tuple[Call, Any]:
        name, held = _TYPES_2.get(kind, ("Integer", ctypes.c_int))
        values = (held * count)()
        function = self._function(verb[:3] + name)
        return partial(function, self.fmu.component, references, len(references), values), values

    def _do_step(self, time_s: float) -> None:
        self.fmu.fmi2DoStep(self.fmu.component, time_s, self._step_s, 1)

    def _wants_to_end(self) -> bool:
        try:
            return self.fmu.getBooleanStatus(fmi2Terminated)
        except FMICallException:  # it need not have this status
            return False


class Fmi3(Fmu):
    """An FMU of FMI 3.0: arrays, set and read in place in the records."""

    kind, machine, prefix, slave = "FMI 3.0", fmpy.platform_tuple, "fmi3", FMU3Slave

    def __init__(self, folder: Path, plan: dict[str, Any], layout: int) -> None:
        super().__init__(folder, plan, layout)
        self._flags = [ctypes.c_bool() for _ in ("event", "end", "early return")]
        self._reached = ctypes.c_double()

    def _call(self, run: dict[str, Any], address: int, verb: str) -> Call:
        count, kind = len(run["references"]), run["kind"]
        references = (ctypes.c_uint * count)(*run["references"])
        if kind == "text":
            values = self._text(run, address)
        else:
            width = ctypes.sizeof(TYPES[kind])
            values = (TYPES[kind] * ((run["end"] - run["first"]) // width)).from_address(address + run["first"])
        function = self._function(verb + NAMES.get(kind, "String"))
        return partial(function, self.fmu.component, references, count, values, len(values))

    def _raw(self, kind: str, count: int, verb: str, references: Any) -> tuple[Call, Any]:
        name = kind if kind in _TYPES_3 else "Int64"
        values = (getattr(ctypes, _TYPES_3[name]) * count)()
        function = self._function(verb[:3] + name)
        return partial(function, self.fmu.component, references, len(references), values, count), values

    def _do_step(self, time_s: float) -> None:
        event, end, early = self._flags
        where = event, end, early, self._reached
        self.fmu.fmi3DoStep(self.fmu.component, time_s, self._step_s, True, *map(ctypes.byref, where))
        if end.value:
            raise Refused("fmi3DoStep: the FMU requests the end of the simulation")


def makes_a_frame(step_s: str, count: int, rate_hz: float) -> bool:
    """Return True if ``count`` steps are a frame, within the digits of step and rate: 0.0166667 is 1/60."""
    steps = 1.0 / (rate_hz * float(step_s))
    rounded = slack(step_s, steps / float(step_s)) + slack(rate_hz, steps / rate_hz)
    return abs(count - steps) <= max(_SAME_STEP * steps, rounded)


class FmuHost(Host):
    """A host that answers the messages of the rig by calls of an FMU."""

    def __init__(self, channel: ReplyChannel, library: Any) -> None:
        super().__init__(channel, library)
        library.bind(self._from, self._to)

    def _step(self, message: memoryview) -> None:
        try:
            super()._step(message)
        except Refused as reason:
            self._channel.reply(REFUSED, message, str(reason))


def load(folder: str, layouts: Sequence[int], _: str) -> Any:
    """Load the FMU that was unpacked into ``folder``; fmu.py has compared its token.  Refused."""
    plan = json.loads(Path(folder, "rig-unit.json").read_text())
    return (Fmi2 if plan["version"] == "2" else Fmi3)(Path(folder), plan, layouts[0])


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr] # the FMU's log is there when it dies
    serve(sys.argv[1:], load, FmuHost)
