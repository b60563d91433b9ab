"""The user's manager in a benchmark, named ``module:name``: in open loop it votes up to 16 pieces at once.

The manager gets each piece as one signal of a flight's rows, as in ``rig vote``, and votes every signal alone.  A class
with ``calibrate = "limit"`` names the number that a calibration chooses.  The benchmark sets other values of it, so the
class must read ``self.limit``, and a lower value must isolate channels sooner.  A class with a class method
``design(healthy)`` gets the healthy flights of the calibration, one signal at a time, and returns its settings; with
both, ``design`` comes first.  A class with neither is compared by its vote error alone.
"""

from __future__ import annotations

import inspect
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from math import isfinite
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import Stages, run
from rig.bench.rows_of_recording import blocks, repeat_first
from rig.bench.vote_rows import by_class
from rig.computer.redundancy.own import OwnManager, load_manager
from rig.core.errors import BadInput, ManagerFailed
from rig.core.frame import CHANNELS, D, S, State, rows
from rig.core.interrupt import SIGNALLED
from rig.core.threads import heed
from rig.core.trust import Trust

Floats = NDArray[np.float64]
KEY: Final = "calibrate"  # of a class: the name of the number
DESIGN: Final = "design"  # its method that gets the healthy data
MOST: Final = 10_000  # numbers that it may return
_FLIGHT: Final = rows(S, D)
_one_at_a_time = threading.RLock()  # numbers of a class are the process's


def calibrated_number(name: str) -> tuple[str, float] | None:
    """Return the name and value of the number that a calibration chooses; None if the manager names none.

    BadInput: it cannot be imported, is a class without ``step``, or ``calibrate`` names no number of the class.
    """
    own = _attribute(name)
    if inspect.isclass(own) and not callable(getattr(own, "step", None)):
        raise BadInput(f"--managers: {name}: the class has no step(bus, fcc, k)")
    key = getattr(getattr(own, "py_func", own), KEY, None)
    if key is None:
        return None
    value = getattr(own, key, None) if isinstance(key, str) else None
    if not inspect.isclass(own) or isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise BadInput(f"--managers: {name}: {KEY} = {key!r}: the class has no number above 0 of this name")
    return str(key), float(value)


def _attribute(name: str) -> Any:
    module, _, attribute = name.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # the folder in which the command was given
    try:
        return getattr(import_module(module), attribute)
    except (*SIGNALLED, BadInput):
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises
        raise BadInput(f"--managers: {name}: cannot be imported: {type(error).__name__}: {error}") from None


class HealthyData(NamedTuple):
    """Hold the argument of ``design``: one signal of the calibrating flights, SI, arrays that cannot be written."""

    signal: str
    channels: Sequence[Floats]  # of each flight (n, C), NaN where a sample is not comparable
    references: Sequence[Floats]  # (n, 2), NaN where there is none
    rate_hz: float
    threshold: float  # the unit of amounts
    wraps: bool  # an angle, rad
    budget_per_h: float  # false isolations; 0: none, on recordings


def asks_for_data(name: str) -> bool:
    """Return True if the manager has a method ``design``."""
    return callable(getattr(_attribute(name), DESIGN, None))


def designed(name: str, healthy: HealthyData) -> dict[str, Any]:
    """Return the settings that a class makes of healthy data, by the names of its attributes; empty without ``design``.

    BadInput: it raises an error, or returns something else than numbers, or lists of numbers, by known names
    """
    if not asks_for_data(name):
        return {}
    own = _attribute(name)
    with _one_at_a_time:
        try:
            found = getattr(own, DESIGN)(healthy)
        except (*SIGNALLED, BadInput):
            raise
        except BaseException as error:  # noqa: BLE001 # whatever the user's method raises
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise BadInput(f"--managers: {name}: {DESIGN}: {healthy.signal}: raised {said}") from None
    if not isinstance(found, Mapping):
        raise BadInput(f"--managers: {name}: {DESIGN}: returned {type(found).__name__}, must be a dict of settings")
    return {str(key): _settings_of(name, own, key, value) for key, value in found.items()}


def _settings_of(name: str, own: Any, key: object, value: Any) -> Any:
    """Return one setting as a number or a list of numbers.  BadInput: it is none of these."""
    if not isinstance(key, str) or not hasattr(own, key):
        raise BadInput(f"--managers: {name}: {DESIGN}: {key!r}: the class has no attribute of this name")
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    numbers = list(plain) if isinstance(plain, list | tuple) else [plain]
    if len(numbers) > MOST or not all(isinstance(x, int | float) and isfinite(x) for x in numbers):
        raise BadInput(f"--managers: {name}: {DESIGN}: {key}: must be a finite number or a list of at most {MOST:,}")
    return numbers if isinstance(plain, list | tuple) else plain


@contextmanager
def with_values(name: str, values: Mapping[str, Any]) -> Iterator[None]:
    """Set ``values`` in the class ``name`` meanwhile; one thread at a time."""
    with _one_at_a_time:
        own = _attribute(name)
        before = {key: getattr(own, key) for key in values}
        for key, value in values.items():
            setattr(own, key, value)
        try:
            yield
        finally:
            for key, value in before.items():
                setattr(own, key, value)


def voted(
    name: str, values: Mapping[str, float], params: NDArray[np.void], read: Mapping[str, NDArray[Any]]
) -> tuple[NDArray[np.bool_], Floats]:
    """Run a manager over pieces; return the isolated channels in each frame, (T, n, 4), and the votes, (T, n).

    params : (1,) config.PARAMS of the signal
    read : ``channels``, and if given ``valid`` and ``ilm``, (T, n, 4); ``reference``, ``second_reference``, (T, n)
    BadInput: the manager raises an error in a frame, or cannot be made
    """
    pieces, frames = read["channels"].shape[:2]
    failed, votes = np.zeros((pieces, frames, CHANNELS), np.bool_), np.zeros((pieces, frames))
    with with_values(name, values):
        for first in range(0, pieces, S):
            part = slice(first, min(first + S, pieces))
            own = load_manager(name, np.repeat(params, S), Trust(named=name))
            try:
                _vote(own, {key: each[part] for key, each in read.items()}, failed[part], votes[part])
            except ManagerFailed as error:
                raise BadInput(f"--managers: {error}") from None
    return failed, votes


def _vote(own: OwnManager, read: Mapping[str, NDArray[Any]], failed: NDArray[np.bool_], votes: Floats) -> None:
    """Vote the pieces as signals of a flight's rows, and keep the votes.

    Signals beyond the number of pieces repeat the first piece.
    """
    pieces, frames = votes.shape
    for part, block in blocks(_FLIGHT, frames):
        heed()
        for key, values in read.items():
            block[key][:, :pieces] = np.moveaxis(values[:, part], 0, 1)
        repeat_first(block, pieces)
        nested = _FLIGHT.nested(block)
        run(nested, Stages(), decide=by_class(own, block, nested))
        failed[:, part] = np.moveaxis(block["state"][:, :pieces] == State.FAILED, 0, 1)
        votes[:, part] = block["voted"][:, :pieces].T
