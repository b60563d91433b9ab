"""A manager class of the user's own, named ``module:Class`` in ``redundancy.manager``.

It is made with the (S,) config.PARAMS records and has ``step(block, k)``, which reads ``channels``, ``valid``,
``ilm`` and ``reference`` of row k and writes ``voted``, ``state``, ``level`` and what else it can say
(docs/redundancy.md has one).  Whatever it raises becomes one line.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput, ManagerFailed
from rig.frame import Block
from rig.trust import Trust


class ManagerLike(Protocol):
    """What the loop needs of a manager."""

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor every signal of row k."""


class OwnManager:
    """A class of the user's own, at its first frame."""

    def __init__(self, name: str, made: ManagerLike) -> None:
        self.name = name
        self.made = made

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor every signal of row k; ManagerFailed names class, frame and exception when it raises."""
        try:
            self.made.step(block, k)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            frame = int(block["frame"][k])
            said = f"redundancy.manager: {self.name!r} raised in frame {frame}: {_said(error)}"
            raise ManagerFailed(said, k, frame) from error


def load_manager(name: str, params: NDArray[np.void], trust: Trust) -> OwnManager:
    """Import and make the class ``module:Class``; the only place where code named in settings is run.

    BadInput when ``trust`` does not permit it, when it cannot be imported or made, or has no ``step``.
    """
    trust.require(name)
    module, _, attribute = name.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # the folder in which the command was given
    try:
        made = getattr(import_module(module), attribute)(params)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 # whatever the user's module raises, SystemExit too
        raise BadInput(f"redundancy.manager: {name!r} cannot be made: {_said(error)}") from None
    if not callable(getattr(made, "step", None)):
        raise BadInput(f"redundancy.manager: {name!r} has no step(block, k)")
    return OwnManager(name, made)


def _said(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
