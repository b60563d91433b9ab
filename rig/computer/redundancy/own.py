"""A manager of the user's own, named ``module:name`` in ``redundancy.manager``: a class, or a compiled function.

A class is made with the (S,) config.PARAMS records and has ``step(bus, fcc, k)``; a function, which numba may have
compiled, is called as ``vote(bus, fcc, k, params, state)``.

bus, fcc : BUS and FCC records of a block; of row k both read ``channels``, ``valid``, ``ilm``, ``reset`` and
``reference``, and write ``voted``, ``state``, ``level`` and what else they can say (docs/redundancy.md has one of each)
state : (S,) records of the module's dtype ``STATE``, or of one number; zeros at first, kept from frame to frame

Whatever they raise becomes one line.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput, ManagerFailed
from rig.frame import Block, nested, new_block
from rig.kernels import bind
from rig.util.trust import Trust

Step = Callable[[Any, Any, int], object]
_PLAIN_STATE: Final = np.dtype([("value", "f8")])
_STEP: Final = ("bus", "fcc", "k")
_VOTE: Final = (*_STEP, "params", "state")


class OwnManager:
    """A manager of the user's own, at its first frame."""

    def __init__(self, name: str, step: Step) -> None:
        self.name = name
        self._step = step

    def step(self, rows: Block, bus: Any, fcc: Any, k: int) -> None:
        """Vote and monitor every signal of row k of the parts of ``rows``; ManagerFailed names who, when and what."""
        try:
            self._step(bus, fcc, k)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            frame = int(rows["frame"][k])
            message = f"redundancy.manager: {self.name!r} raised in frame {frame}: {_in_words(error)}"
            raise ManagerFailed(message, k, frame) from error


def load_manager(name: str, params: NDArray[np.void], trust: Trust) -> OwnManager:
    """Import ``module:name``, and make it if it is a class; the only place where code named in settings is run.

    BadInput when ``trust`` does not permit it, when it cannot be imported, made or compiled, or has another form.
    """
    trust.require(name)
    module_name, _, attribute = name.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # the folder in which the command was given
    try:
        module = import_module(module_name)
        manager = getattr(module, attribute)
        step = (
            _of_class(name, manager, params)
            if inspect.isclass(manager)
            else _of_function(name, manager, module, params)
        )
    except (KeyboardInterrupt, BadInput):
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises, SystemExit too
        raise BadInput(f"redundancy.manager: {name!r} cannot be made: {_in_words(error)}") from None
    return OwnManager(name, step)


def _of_class(name: str, manager: Any, params: NDArray[np.void]) -> Step:
    """Return the ``step`` of an instance."""
    step = getattr(manager(params), "step", None)
    if not callable(step):
        raise BadInput(f"redundancy.manager: {name!r} has no step(bus, fcc, k)")
    taken = list(inspect.signature(step).parameters)
    if len(taken) != len(_STEP):
        raise BadInput(f"redundancy.manager: {name!r} has step({', '.join(taken)}), now it is step(bus, fcc, k)")
    return step


def _of_function(name: str, manager: Any, module: ModuleType, params: NDArray[np.void]) -> Step:
    """Return a function with its own state; one that numba has compiled is bound to its arguments' types."""
    if not callable(manager) or len(inspect.signature(getattr(manager, "py_func", manager)).parameters) != len(_VOTE):
        raise BadInput(f"redundancy.manager: {name!r} is neither a class nor a function of {', '.join(_VOTE)}")
    state = np.zeros(len(params), getattr(module, "STATE", _PLAIN_STATE))
    rows = nested(new_block(2))  # one row alone would count as contiguous, which the parts of a block are not
    vote = bind(manager, rows["bus"], rows["fcc"], 0, params, state)
    return lambda bus, fcc, k: vote(bus, fcc, k, params, state)


def _in_words(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
