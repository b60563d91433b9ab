"""The flights of a search without their faults, flown before it: what they violate, no fault is needed for.

One flight for each arm whose scenario differs without faults, with the set of ``--against`` too, in a folder that is
removed: a search that is refused writes nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from rig.core.errors import BadInput, RigError
from rig.core.files import is_file
from rig.core.interrupt import Stop
from rig.core.outputs import CAMPAIGN
from rig.core.progress import tell
from rig.scenario.overrides import parse_set, set_key
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.pool import Pool
from rig.studies.search.confirm_worst import SEEDS, new_seeds
from rig.studies.search.fly_missing import flown
from rig.studies.search.search_plan import ConfirmPlan, SearchPlan
from rig.studies.search.shrink import SEEDS as SHRINK_SEEDS
from rig.verdict.requirements.shown import margin_text

_LATER: Final = 2 * SEEDS + SHRINK_SEEDS  # seeds that confirming and shrinking take


def refuse_violated(plan: SearchPlan, out: Path, pool: Pool, stop: Stop) -> None:
    """Raise BadInput for a requirement that a flight without faults violates; it names arm and margin.

    A folder that is begun has passed.  Interrupted: asked to stop; RigError: such a flight cannot be flown.
    """
    Folder.of(out, plan)  # refuses another's before anything is flown
    if is_file(out / CAMPAIGN):
        return
    tell("flying without faults")
    cases = list(_cases(plan))
    confirming = ConfirmPlan(plan)
    numbers = confirming.add([table for _, table in cases])
    with (
        TemporaryDirectory() as folder,
        flown(confirming, Path(folder) / "healthy", pool, stop) as flights,
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
            least = min(violated, key=lambda one: one["margin"])
            which = ", ".join(dict.fromkeys(one["requirement"] for one in violated))
            shown = margin_text(least["margin"])
            margin = f", margin {shown}" if shown else ""
            raise BadInput(
                f"--requirement {which}: violated without any fault{margin} at {least['instant_s']:.2f} s ({name}): "
                "there is nothing to search for; change the requirement or leave it out"
            )


def _cases(plan: SearchPlan) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and scenario of each arm's first draw without its faults, all with one seed that no flight has."""
    seed = new_seeds(plan.campaign, len(plan) + _LATER, 1)[0]
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
