"""Flights of a plan that grows: those that its folder lacks are flown, all others read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rig.core.errors import RigError
from rig.core.files import is_file
from rig.core.interrupt import Stop
from rig.core.outputs import CAMPAIGN
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.pool import Pool
from rig.studies.campaign.run_campaign import Batch, Flying, Progress, orders_of
from rig.studies.campaign.tables import Rows
from rig.studies.campaign.worker import fly_batch


class Interrupted(Exception):
    """The command was asked to stop; what is flown is in the folder."""


class _Kept(Folder):
    """A folder that keeps the rows of its runs at hand."""

    runs: dict[int, dict[str, Any]]

    def write(self, rows: Rows) -> None:
        """Write one part, and keep its runs."""
        super().write(rows)
        self.runs |= {row["run"]: row for row in rows["runs"]}


class Flown:
    """Rows of ``runs`` by number, flown where the folder does not hold them."""

    def __init__(self, plan: Plan, folder: _Kept, pool: Pool, stop: Stop, batch: Batch) -> None:
        self.plan, self.folder, self._pool, self._stop, self._batch = plan, folder, pool, stop, batch
        folder.runs = {row["run"]: row for row in folder.tables["runs"].iter_rows(named=True)}
        del folder.tables  # it grows

    def rows(self, numbers: Sequence[int]) -> list[dict[str, Any]]:
        """Return the rows of runs of the plan.  Interrupted: asked to stop before all are there."""
        kept = self.folder.runs
        missing = [number for number in numbers if number not in kept]
        if missing:
            progress = Progress(len(numbers), len(numbers) - len(missing))
            flying = Flying(self.plan, self._pool, self.folder, orders_of(self.folder), progress, batch=self._batch)
            size = max(1, -(-len(missing) // self._pool.size))
            flying.fly(missing, size, self._stop, None)
        if any(number not in kept for number in numbers):
            raise Interrupted
        return [kept[number] for number in numbers]


def require_known(plan: Plan, out: Path) -> None:
    """Raise BadInput unless ``out`` is a new folder, or one of the same plan whose parts are whole.  Writes nothing."""
    folder = Folder.of(out, plan)
    if is_file(out / CAMPAIGN):
        folder.done()


@contextmanager
def flown(plan: Plan, out: Path, pool: Pool, stop: Stop, batch: Batch = fly_batch) -> Iterator[Flown]:
    """Hold a plan's folder, new or begun.  BadInput as ``Folder.of``; RigError says that the command goes on."""
    folder = _Kept.of(out, plan)
    assert isinstance(folder, _Kept)
    with folder.held():
        made = Flown(plan, folder, pool, stop, batch)
        try:
            yield made
        except RigError as error:
            raise RigError(f"{error}; {len(folder.runs)} flights done, the same command goes on") from None
