"""A manager of the user's own, named ``module:name`` in ``redundancy.manager``: a class, or a compiled function.

A class is made with the (S,) config.PARAMS records and has ``step(bus, fcc, k)``; a function, which numba may have
compiled, is called as ``vote(bus, fcc, k, params, state)``.  Either may take one argument more, ``frame``.

bus, fcc : BUS and FCC records of a block of rows, which is used again and again; of row k both read ``channels``,
``valid``, ``ilm``, ``reset`` and ``reference``, and must write ``voted``, and may write ``level`` and ``state`` of
channels that they isolate, in every frame (docs/reference/sensors-and-redundancy.md has one of each);
assumed_states.py has what is assumed if they do not
state : (S,) records of the module's dtype ``STATE``, or of one number; zeros at first, kept from frame to frame
frame : number of the frame in the flight, from 0, where ``k`` is but a row of the block

Any error that they raise becomes one line, and so does a first frame without a vote.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.assumed_states import begin_answer, complete_answer
from rig.core.errors import BadInput, ManagerFailed
from rig.core.frame import Block, State, nested, new_block
from rig.core.interrupt import SIGNALLED
from rig.core.kernels import bind
from rig.core.trust import Trust

Step = Callable[[Any, Any, int, int], object]  # bus, fcc, row, frame
_PLAIN_STATE: Final = np.dtype([("value", "f8")])
_STEP: Final = ("bus", "fcc", "k")
_VOTE: Final = (*_STEP, "params", "state")
_FRAME: Final = "frame"  # the last argument of who wants it


class OwnManager:
    """A manager of the user's own, at its first frame."""

    def __init__(self, name: str, step: Step, fitted: NDArray[Any]) -> None:
        self.name = name
        self._step, self._fitted, self._began = step, fitted, False
        fcc = nested(new_block(2))["fcc"]
        self._begin = bind(begin_answer, fcc, 0, len(fitted))
        self._complete = bind(complete_answer, fcc, 0, fitted)

    def step(self, rows: Block, bus: Any, fcc: Any, k: int) -> None:
        """Vote and monitor every signal of row k of the parts of ``rows``; ManagerFailed names who, when and what."""
        frame = int(rows["frame"][k])
        self._begin(fcc, k, len(self._fitted))
        try:
            self._step(bus, fcc, k, frame)
        except SIGNALLED:
            raise
        except BaseException as error:
            raise self._failure(f"raised in frame {frame}: {_in_words(error)}", k, frame) from error
        votes = self._complete(fcc, k, self._fitted)
        if not self._began:
            self._began = True
            if votes == 0 and _is_answer_due(bus[k], fcc[k], self._fitted):
                raise self._failure(
                    f"wrote no vote in frame {frame}: of every signal it must write voted, and it may write level "
                    f"(channels in use) and state of the channels that it fails: docs/tutorials/own-voter.md",
                    k,
                    frame,
                )

    def _failure(self, what: str, k: int, frame: int) -> ManagerFailed:
        return ManagerFailed(f"redundancy.manager: {self.name!r} {what}", k, frame)


def _is_answer_due(bus: Any, fcc: Any, fitted: NDArray[Any]) -> bool:
    """Return True if channels are good and none was failed; fitted : (S,) channels."""
    signals, channels = len(fitted), np.arange(bus["valid"].shape[-1])
    of = channels < fitted[:, None]
    good = of & (bus["valid"][:signals] == 1) & np.isfinite(bus["channels"][:signals])
    return bool(good.any() and not (of & (fcc["state"][:signals] == State.FAILED)).any())


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
    except (*SIGNALLED, BadInput):
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises, SystemExit too
        raise BadInput(f"redundancy.manager: {name!r} cannot be made: {_in_words(error)}") from None
    return OwnManager(name, step, params["fitted"].copy())


def _of_class(name: str, manager: Any, params: NDArray[np.void]) -> Step:
    """Return the ``step`` of an instance."""
    step = getattr(manager(params), "step", None)
    if not callable(step):
        raise BadInput(f"redundancy.manager: {name!r} has no step(bus, fcc, k)")
    taken = list(inspect.signature(step).parameters)
    if _takes(taken, (*_STEP, _FRAME)):
        return step
    if len(taken) != len(_STEP):
        raise BadInput(f"redundancy.manager: {name!r} has step({', '.join(taken)}), expected step(bus, fcc, k)")
    return lambda bus, fcc, k, _: step(bus, fcc, k)


def _takes(taken: Sequence[str], names: Sequence[str]) -> bool:
    return len(taken) == len(names) and taken[-1] == names[-1]


def _of_function(name: str, manager: Any, module: ModuleType, params: NDArray[np.void]) -> Step:
    """Return a function with its own state; one that numba has compiled is bound to its arguments' types."""
    taken = list(inspect.signature(getattr(manager, "py_func", manager)).parameters) if callable(manager) else []
    wants_frame = _takes(taken, (*_VOTE, _FRAME))
    if len(taken) != len(_VOTE) and not wants_frame:
        raise BadInput(f"redundancy.manager: {name!r} is neither a class nor a function of {', '.join(_VOTE)}")
    state = np.zeros(len(params), getattr(module, "STATE", _PLAIN_STATE))
    rows = nested(new_block(2))  # one row alone would count as contiguous, which the parts of a block are not
    last = (0,) if wants_frame else ()
    vote = bind(manager, rows["bus"], rows["fcc"], 0, params, state, *last)
    if wants_frame:
        return lambda bus, fcc, k, frame: vote(bus, fcc, k, params, state, frame)
    return lambda bus, fcc, k, _: vote(bus, fcc, k, params, state)


def _in_words(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
