"""The unit under test of a worker: started with its first flight, kept from one to the next."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.util import Finalize

from rig.errors import BadInput, RigError
from rig.unit.settings import Unit
from rig.unit.unit import UnitUnderTest

_running: dict[str, UnitUnderTest] = {}  # of this process
_ends: list[Finalize] = []  # what ends them with it


@contextmanager
def flown_with(unit: Unit | None) -> Iterator[UnitUnderTest | None]:
    """The unit for one flight; one that died, or that is not to be used again, is ended with it."""
    if unit is None:
        yield None
        return
    key = unit.model_dump_json()
    if not any(one.still_active() for one in _ends):  # one of the parent's is not
        _ends[:] = [Finalize(None, _end_all, exitpriority=1)]  # a worker runs no atexit
    if key not in _running:
        _running[key] = UnitUnderTest(unit, crowded=True)
    tested, fit = _running[key], False
    try:
        yield tested
        fit = unit.reuse and not tested.dead
    finally:
        if not fit:
            del _running[key]
            tested.close()


def _end_all() -> None:
    """End the units of this process, with their folders."""
    while _running:
        _running.popitem()[1].close()


def check(unit: Unit | None, sha256: str) -> None:
    """RigError when this worker would fly another build than the campaign."""
    if unit is not None and unit.sha256() != sha256:
        raise RigError(f"{unit.source}: a worker has another build of it than this one; install the same everywhere")


def fits(unit: Unit | None, workers: int | None) -> int | None:
    """How many workers may fly: a box at an address is one.  BadInput: more are asked for; a class is no unit here."""
    if unit is None:
        return workers
    if unit.carrier == "python":
        raise BadInput(f"{unit.source}: in a campaign a class is named by --set redundancy.manager={unit.manager}")
    if unit.address is None:
        return workers
    if workers is not None and workers > 1:
        raise BadInput(f"--workers {workers}: the unit at {unit.address} is one, and flies one flight at a time")
    return 1
