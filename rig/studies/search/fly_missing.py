"""Fly the missing flights of a growing plan, and read the others from its folder.

Before a search, one flight of each arm is flown without its faults, also with the override of ``--against``, in a
temporary folder.  A requirement that these flights violate needs no fault; the search is refused and writes nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rig.core.confined import scratch_folder
from rig.core.errors import BadInput, RigError
from rig.core.interrupt import GOES_ON, Stop
from rig.core.progress import tell
from rig.scenario.overrides import parse_set, set_key
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.pool import Pool
from rig.studies.campaign.run_campaign import Batch, Flying, Progress, orders_of
from rig.studies.campaign.tables import Rows
from rig.studies.campaign.worker import fly_batch
from rig.studies.search.confirm_worst import new_seeds
from rig.studies.search.search_plan import ConfirmPlan, SearchPlan
from rig.unit.unit_file import Unit
from rig.verdict.requirements.robustness import robustness_text

OF_HEALTHY: Final = 1  # seeds after those of the search, of the flights without faults


class Interrupted(Exception):
    """The command was asked to stop; the flown flights are in the folder."""


class _Kept(Folder):
    """A folder that keeps the rows of its runs in memory."""

    runs: dict[int, dict[str, Any]]

    def write(self, rows: Rows) -> None:
        """Write one part, and keep its runs."""
        super().write(rows)
        self.runs |= {row["run"]: row for row in rows["runs"]}


class Flown:
    """The rows of ``runs`` by number, flown if the folder does not contain them."""

    def __init__(self, plan: Plan, folder: _Kept, pool: Pool, stop: Stop, batch: Batch) -> None:
        self.plan, self.folder, self._pool, self._stop, self._batch = plan, folder, pool, stop, batch
        folder.runs = {row["run"]: row for row in folder.tables["runs"].iter_rows(named=True)}
        del folder.tables  # it grows

    def rows(self, numbers: Sequence[int]) -> list[dict[str, Any]]:
        """Return the rows of runs of the plan.  Interrupted: asked to stop before all were flown."""
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


def require_known(plan: Plan, out: Path, unit: Unit | None = None) -> None:
    """Raise BadInput unless ``out`` is a new folder, or of the same plan with complete parts.  Writes nothing."""
    folder = Folder.of(out, plan, unit)
    if folder.is_begun:
        folder.done()


@contextmanager
def flown(
    plan: Plan, out: Path, pool: Pool, stop: Stop, unit: Unit | None = None, batch: Batch = fly_batch
) -> Iterator[Flown]:
    """Hold a plan's folder, new or existing.  BadInput as ``Folder.of``; RigError, with the way to resume.

    unit : under test, which flies
    """
    folder = _Kept.of(out, plan, unit)
    assert isinstance(folder, _Kept)
    with folder.held():
        made = Flown(plan, folder, pool, stop, batch)
        try:
            yield made
        except BadInput as error:
            raise BadInput(f"{error}; {len(folder.runs)} flights done") from None
        except RigError as error:
            raise RigError(f"{error}; {len(folder.runs)} flights done, {GOES_ON}") from None


def refuse_violated(plan: SearchPlan, out: Path, pool: Pool, stop: Stop, unit: Unit | None = None) -> None:
    """Raise BadInput for a requirement that a flight without faults violates, with its arm and robustness.

    An existing folder has passed.  Interrupted: asked to stop; RigError: such a flight cannot be flown.
    """
    if Folder.of(out, plan, unit).is_begun:  # another's is refused before anything is flown
        return
    tell("flying without faults")
    cases = list(_cases(plan))
    confirming = ConfirmPlan(plan)
    numbers = confirming.add([table for _, table in cases])
    with (
        scratch_folder() as folder,
        flown(confirming, folder / "healthy", pool, stop, unit) as flights,
    ):
        rows = flights.rows(numbers)
    for (name, _), row in zip(cases, rows, strict=True):
        if row["outcome"] != "flown":
            raise RigError(f"{name} without faults: {row['outcome']}: {row['reason']}")
        told = json.loads(row.get("requirements") or "[]")
        violated = [
            one for one in told if one["status"] == "violated" and one["requirement"] in plan.asked.requirements
        ]
        if violated:
            least = min(violated, key=lambda one: one["robustness"])
            which = ", ".join(dict.fromkeys(one["requirement"] for one in violated))
            shown = robustness_text(least["robustness"])
            robustness = f", robustness {shown}" if shown else ""
            raise BadInput(
                f"--requirement {which}: violated without any fault{robustness} at {least['instant_s']:.2f} s "
                f"({name}); change the requirement or leave it out"
            )


def _cases(plan: SearchPlan) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and scenario of each arm's first draw without its faults, all with one new seed."""
    seed = new_seeds(plan.campaign, len(plan), OF_HEALTHY)[0]
    there: set[str] = set()
    arms: set[int] = set()
    for i, draw in enumerate(plan.draws):
        if draw.arm in arms:
            continue
        arms.add(draw.arm)
        of_arm = [(plan.arms[draw.arm].name or plan.source, plan.data(i * plan.of_one_draw))]
        if plan.asked.against is not None:
            key, value = parse_set(plan.asked.against)
            of_arm.append((f"with {plan.asked.against}", set_key(of_arm[0][1], key, value, "--against")))
        for name, table in of_arm:
            healthy = {**table, "faults": [], "seed": seed}
            text = json.dumps(healthy, sort_keys=True)
            if text not in there:
                there.add(text)
                yield name, healthy
