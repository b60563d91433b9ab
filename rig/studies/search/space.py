"""The space of a search: each combination of cases and listed values is an arm; its ranges are a unit cube."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import Campaign, Case, Levels, Vary
from rig.studies.campaign.sampling import Choice, Valuer, valuer
from rig.studies.search.rounds import Point

MOST_ARMS: Final = 10_000
_BELOW_ONE: Final = float(np.nextafter(1.0, 0.0))  # a share excludes 1


@dataclass(frozen=True, slots=True)
class Arm:
    """One combination: its fixed values, and the keys of its unit cube with the value for a share."""

    fixed: Choice
    valuers: Mapping[str, Valuer]

    @property
    def dimensions(self) -> int:
        """Return the number of varied numbers."""
        return len(self.valuers)

    @property
    def name(self) -> str:
        """Return the fixed cases and values as one text; "all" if there are none."""
        return ", ".join(map(str, self.fixed.values())) or "all"

    def choice(self, point: Point) -> Choice:
        """Return the varied values of a flight at ``point``."""
        shares = np.clip(point, 0.0, _BELOW_ONE).tolist()
        drawn = {key: value(share) for (key, value), share in zip(self.valuers.items(), shares, strict=True)}
        return {**self.fixed, **drawn}


def arms(campaign: Campaign, source: str) -> list[Arm]:
    """Return the arms of a campaign, the last group of cases fastest.  BadInput: one without a number, or too many."""
    count = _count(campaign)
    if count > MOST_ARMS:
        raise BadInput(f"{source}: {count} combinations of cases and listed values; at most {MOST_ARMS} are allowed")
    combinations = product(*campaign.cases.values())
    made = [arm for chosen in combinations for arm in _arm(campaign, dict(zip(campaign.cases, chosen, strict=True)))]
    for arm in made:
        if not arm.dimensions:
            where = f" with {arm.name}" if arm.fixed else ""
            raise BadInput(f"{source}: vary: no number varies{where}; a search needs a range (low, high)")
    return made


def _count(campaign: Campaign) -> int:
    listed = lambda vary: int(np.prod([len(v.values) for v in vary.values() if isinstance(v, Levels)], dtype=object))  # noqa: E731
    groups = [sum(listed(case.vary) for case in cases) for cases in campaign.cases.values()]
    return int(np.prod([*groups, listed(campaign.vary)], dtype=object))


def _arm(campaign: Campaign, chosen: Mapping[str, Case]) -> list[Arm]:
    """Return the arms of one combination of cases: one for each combination of listed values."""
    varied: dict[str, Vary] = {}
    for case in chosen.values():
        varied |= case.vary
    varied |= campaign.vary
    listed = {key: vary.values for key, vary in varied.items() if isinstance(vary, Levels)}
    numbers = {key: valuer(vary) for key, vary in varied.items() if not isinstance(vary, Levels)}
    names = {group: case.name for group, case in chosen.items()}
    return [Arm({**names, **dict(zip(listed, values, strict=True))}, numbers) for values in product(*listed.values())]
