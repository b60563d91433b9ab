"""The transport ``python`` of a control law: a class of the user's own in this process, ``law = "module:name"``.

    class Law:
        def __init__(self, config): ...     # CONFIG of the flight: rate_hz, trim_surface, surface_low, surface_high ...
        def step(self, asked): ...          # rig_law_input of the frame; returns the four surfaces

A function that takes ``config`` and returns ``step`` does as well.  ``asked`` is used again in the next frame.
A session makes a new object.  The module is looked for beside the unit file, then in the folder of the command.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import SURFACES
from rig.core.interrupt import SIGNALLED
from rig.unit.host import Refused
from rig.unit.transport import Environment, LibraryLink
from rig.unit.unit_file import Unit
from rig.unit.unit_records import INTERFACE, LAW_INPUT, OUTPUT, Said

Step = Callable[[np.void], Any]
_FUNCTION: Final = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)  # rig_unit_law
_SHAPE: Final = (len(SURFACES),)


class PythonLaw(LibraryLink):
    """A law in Python, called as a library of this process is."""

    def __init__(self, unit: Unit) -> None:
        """Import the law.  BadInput: it cannot be imported."""
        self._name, self._failed = str(unit.law), ""
        self._make = _imported(self._name, unit)
        self.environment, self.interface = Environment(), INTERFACE
        self._law: Step | None = None
        self._interruption: BaseException | None = None
        self._records: dict[tuple[int, int], tuple[np.void, np.void]] = {}  # by their addresses
        self.step = _FUNCTION(self._step)

    def open(self, config: NDArray[Any]) -> None:
        """Make a new law.  Refused: it cannot be made."""
        self._records.clear()
        self._interruption = None
        try:
            made = self._make(config.copy()[0])
        except SIGNALLED:
            raise
        except BaseException as error:  # noqa: BLE001 # whatever the user's class raises
            raise Refused(f"cannot fly: {self._name!r} cannot be made: {_in_words(error)}") from None
        self._law = getattr(made, "step", made)
        if not callable(self._law):
            raise Refused(f"cannot fly: {self._name!r} has no step(asked)")

    def failure(self, code: int) -> str:
        """Return the reason of the last step's failure; raise the signal that interrupted it, if one did."""
        if self._interruption is not None:
            raise self._interruption
        return f"{self._name!r} {self._failed}"

    def close(self) -> str:
        """Forget the law."""
        self._law = None
        return ""

    def _step(self, source: int, target: int) -> int:
        """Answer a frame; a function of C cannot raise, so an interruption is left to ``failure``."""
        try:
            asked, answer = self._records.get((source, target)) or self._at(source, target)
            assert self._law is not None
            surface = np.asarray(self._law(asked), float)
            if surface.shape != _SHAPE:
                self._failed = f"returned {surface.shape} numbers, must be {_SHAPE}: {', '.join(SURFACES)}"
                return 1
            answer["surface"], answer["said"] = surface, Said.SURFACE
        except SIGNALLED as interruption:
            self._interruption = interruption
            return 1
        except BaseException as error:  # noqa: BLE001 # whatever the user's class raises
            self._failed = f"raised {_in_words(error)}"
            return 1
        return 0

    def _at(self, source: int, target: int) -> tuple[np.void, np.void]:
        """Return the records at two addresses: one to read, one to write."""
        asked, answer = (
            np.ctypeslib.as_array((ctypes.c_uint8 * dtype.itemsize).from_address(address)).view(dtype)
            for address, dtype in ((source, LAW_INPUT), (target, OUTPUT))
        )
        asked.flags.writeable = False
        self._records[source, target] = asked[0], answer[0]
        return self._records[source, target]


def _imported(name: str, unit: Unit) -> Callable[..., Any]:
    """Import ``module:name``, beside the unit file or in the folder of the command.  BadInput."""
    module, _, attribute = name.partition(":")
    for folder in ("", str(unit.folder)):
        if folder not in sys.path:
            sys.path.insert(0, folder)
    try:
        made = getattr(import_module(module), attribute)
    except SIGNALLED:
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises, SystemExit too
        raise BadInput(f"{unit.source}: law: {name!r} cannot be imported: {_in_words(error)}") from None
    if not callable(made):
        raise BadInput(f"{unit.source}: law: {name!r} is neither a class nor a function")
    return made


def _in_words(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
