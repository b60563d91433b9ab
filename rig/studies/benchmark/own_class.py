"""The user's manager in a benchmark, named ``module:name``: in open loop it votes up to 16 pieces at once.

The manager gets each piece as one signal of a flight's rows, as in ``rig vote``, and votes every signal alone.  A class
with ``calibrate = "limit"`` names the number that a calibration chooses.  The benchmark sets other values of it, so the
class must read ``self.limit``, and a lower value must isolate channels sooner.  A class without ``calibrate`` is
compared by its vote error alone.
"""

from __future__ import annotations

import inspect
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import Stages, run
from rig.bench.rows_of_recording import blocks
from rig.bench.vote_rows import by_class
from rig.computer.redundancy.own import OwnManager, load_manager
from rig.core.errors import BadInput, ManagerFailed
from rig.core.frame import CHANNELS, D, S, State, rows
from rig.core.trust import Trust

Floats = NDArray[np.float64]
KEY: Final = "calibrate"  # of a class: the name of the number
_FLIGHT: Final = rows(S, D)
_one_at_a_time = threading.RLock()  # numbers of a class are the process's


def calibrated_number(name: str) -> tuple[str, float] | None:
    """Return the name and value of the number that a calibration chooses; None if the manager names none.

    BadInput: the manager cannot be imported, or ``calibrate`` names no number of the class.
    """
    own = _attribute(name)
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
    except (KeyboardInterrupt, BadInput):
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises
        raise BadInput(f"--managers: {name}: cannot be imported: {type(error).__name__}: {error}") from None


@contextmanager
def with_values(name: str, values: Mapping[str, float]) -> Iterator[None]:
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
        for key, values in read.items():
            some = np.moveaxis(values[:, part], 0, 1)
            block[key][:, :pieces], block[key][:, pieces:] = some, some[:, :1]
        nested = _FLIGHT.nested(block)
        run(nested, Stages(), decide=by_class(own, block, nested))
        failed[:, part] = np.moveaxis(block["state"][:, :pieces] == State.FAILED, 0, 1)
        votes[:, part] = block["voted"][:, :pieces].T
