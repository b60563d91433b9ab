"""One call of a plant: its arguments, what it returns on the frames of a plan, and why it failed.

    python -c "from rig.studies.search.plants.plant_call import serve; serve()" FILE.py FUNCTION

``serve`` is the process that imports and runs the code of the user, and nothing else of the rig than this and numpy.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.interrupt import Terminated
from rig.studies.search.plants.plant_signal import Signal

MOST_COLUMNS: Final = 1000
_KEPT: Final = 300  # characters of what a plant prints, and of a reason
_GIVEN: Final = ("seed", "duration_s")  # arguments that are no part of the plan
Columns = dict[str, NDArray[Any]]
Function = Callable[..., Any]


class Call(NamedTuple):
    """The arguments of a simulation, and which columns are asked for."""

    inputs: dict[str, Any]  # of a signal its values (count,)
    shapes: dict[str, str]  # of each signal
    duration_s: float
    rate_hz: float
    seed: int
    names: tuple[str, ...] | None = None  # None: all columns


class Outcome(NamedTuple):
    """Columns (n,) of the frames that were simulated, or why there are none."""

    columns: Columns | None
    reason: str = ""
    printed: str = ""


class Takes(NamedTuple):
    """The arguments of a function, or why it cannot be called."""

    names: tuple[str, ...]  # all
    needed: tuple[str, ...]  # without a default
    others: bool  # any other name too
    wrong: str = ""


def takes(function: Any) -> Takes:
    """Return the arguments of a function."""
    if not callable(function):
        return Takes((), (), False, f"is not a function, but {type(function).__name__}")
    try:
        listed = signature(function).parameters.values()
    except (TypeError, ValueError):
        return Takes((), (), False, "its arguments are not known")
    kinds = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
    named = [each for each in listed if each.kind in kinds]
    needed = tuple(each.name for each in named if each.default is Parameter.empty)
    if unnamed := [each.name for each in listed if each.kind is Parameter.POSITIONAL_ONLY]:
        return Takes((), (), False, f"its argument {unnamed[0]} cannot be given by name")
    others = any(each.kind is Parameter.VAR_KEYWORD for each in listed)
    return Takes(tuple(each.name for each in named), needed, others)


def simulate(function: Function, call: Call) -> Outcome:
    """Call a plant and return its columns on the frames; whatever it raises or returns instead is a reason."""
    printed = _Kept()
    try:
        with redirect_stdout(printed), redirect_stderr(printed), np.errstate(all="ignore"):
            returned = function(**_arguments(function, call))
        columns = on_frames(returned, call)
    except Wrong as error:
        return Outcome(None, str(error), printed.kept)
    except Terminated:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 # whatever a plant raises is its own failure
        return Outcome(None, _short(f"{type(error).__name__}: {error}"), printed.kept)
    return Outcome(columns, "", printed.kept)


def _arguments(function: Function, call: Call) -> dict[str, Any]:
    given = {"seed": call.seed, "duration_s": call.duration_s}
    known = takes(function)
    for name, value in call.inputs.items():
        is_signal = name in call.shapes
        given[name] = Signal(value, call.duration_s, call.shapes[name]) if is_signal else value
    return {name: value for name, value in given.items() if name not in _GIVEN or name in known.names}


class Wrong(ValueError):
    """A plant returned something else than times and columns, or its file has no such function."""


def on_frames(returned: Any, call: Call) -> Columns:
    """Return the columns of what a plant returned, each frame with the last values at or before it.

    Wrong: it is not times (n,) and a table of columns (n,) of numbers, or a number that is asked for is not finite.
    """
    try:
        times, table = returned
    except (TypeError, ValueError):
        raise Wrong("it must return two things: times, and a table of columns by name") from None
    if not isinstance(table, Mapping) or not all(isinstance(name, str) for name in table):
        raise Wrong(f"its columns must be a table by name, such as {{'speed': speed}}, not {type(table).__name__}")
    if len(table) > MOST_COLUMNS:
        raise Wrong(f"it returned {len(table)} columns; at most {MOST_COLUMNS} are allowed")
    time = _times(times)
    frames = np.arange(int(min(call.duration_s, time[-1]) * call.rate_hz * (1.0 + 1e-12) + 1e-9) + 1) / call.rate_hz
    at = np.searchsorted(time, frames + 1e-9 / call.rate_hz, side="right") - 1
    wanted = table if call.names is None else [name for name in call.names if name in table]
    columns = {name: _column(name, table[name], time)[at] for name in wanted}
    if missing := [name for name in call.names or () if name not in table and name not in call.inputs]:
        raise Wrong(f"this time it returned no column {missing[0]!r}")
    return columns | _own(call, columns, frames)


def _own(call: Call, columns: Columns, frames: NDArray[np.float64]) -> Columns:
    """Return the inputs as columns, where the plant returns none of that name."""
    out: Columns = {}
    for name, value in call.inputs.items():
        if name in columns or (call.names is not None and name not in call.names):
            continue
        if name in call.shapes:
            out[name] = Signal(value, call.duration_s, call.shapes[name])(frames)
        elif isinstance(value, bool | int | float):
            out[name] = np.full(len(frames), value)
    return out


def _times(times: Any) -> NDArray[np.float64]:
    try:
        time = np.asarray(times, float)
    except (TypeError, ValueError, OverflowError):
        raise Wrong("its times must be numbers, s") from None
    if time.ndim != 1 or not len(time):
        raise Wrong("its times must be a list of one time or more, s")
    if not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise Wrong("its times must be finite and in order, s")
    if time[0] > 1e-9:
        raise Wrong(f"its times must begin at 0 s, not at {time[0]:g} s")
    return time


def _column(name: str, given: Any, time: NDArray[np.float64]) -> NDArray[Any]:
    column = np.asarray(given)
    if column.ndim != 1 or len(column) != len(time):
        shape = f"{column.shape}" if column.ndim != 1 else f"{len(column)} values"
        raise Wrong(f"column {name!r} has {shape}; there are {len(time)} times")
    if column.dtype.kind == "b":
        return column
    if column.dtype.kind not in "iuf":
        raise Wrong(f"column {name!r} must be numbers, or true and false")
    column = column.astype(float)
    if not (finite := np.isfinite(column)).all():
        first = int(np.argmin(finite))
        raise Wrong(f"column {name!r} is {column[first]} at {time[first]:g} s")
    return column


class _Kept(io.TextIOBase):
    """A text file that keeps the first characters."""

    kept = ""

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self.kept += text[: _KEPT - len(self.kept)]
        return len(text)


def _short(text: str) -> str:
    return " ".join(text.split())[:_KEPT]


@contextmanager
def limited(timeout_s: float) -> Iterator[None]:
    """Raise Wrong in the block if it takes too long, where the system has such a timer; not inside compiled code."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: object) -> None:
        raise Wrong(took_longer(timeout_s))

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, timeout_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def took_longer(timeout_s: float) -> str:
    """Return the reason of a simulation that was ended."""
    return f"it took longer than timeout_s = {timeout_s:g} s"


def imported(path: str, name: str) -> Function:
    """Import FILE.py, with the modules beside it, and return its function.  Wrong: there is none of that name."""
    sys.path.insert(0, str(Path(path).absolute().parent))
    spec = spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None:
        raise Wrong("is not a Python file")
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    if not hasattr(module, name):
        raise Wrong(f"has no function {name!r}")
    return getattr(module, name)


def serve() -> None:
    """Import the function that the arguments name, tell what it takes, and answer calls until the parent is gone.

    Standard input and output are the pipes to the parent; the code of the user gets others.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent's to handle
    calls, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for file in (0, 1, 2):
        os.dup2(nowhere, file)
    printed = _Kept()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            function = imported(*sys.argv[1:3])
        _answer(answers, takes(function))
    except Wrong as error:
        _answer(answers, Takes((), (), False, str(error)))
        return
    except (Exception, SystemExit) as error:  # noqa: BLE001 # of the user's file
        _answer(answers, Takes((), (), False, f"cannot be imported: {_short(f'{type(error).__name__}: {error}')}"))
        return
    while True:
        try:
            call, timeout_s = pickle.load(calls)
        except EOFError:
            return
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, timeout_s + 1.0)  # if the parent is killed: the system ends this
        outcome = simulate(function, call)
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        _answer(answers, outcome)


def _answer(answers: Any, what: Any) -> None:
    pickle.dump(what, answers, pickle.HIGHEST_PROTOCOL)
    answers.flush()
