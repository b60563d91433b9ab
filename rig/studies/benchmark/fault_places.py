"""Where in a history a tested fault stands: alone, after another, from the first frame, and so on.

A campaign names the place of a combination by the case of its group ``place`` or ``design``; without such a group it
follows from the faults of the combination.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.studies.campaign.plan import Plan
from rig.studies.reliability.drawn import Cell
from rig.world.faults.effects import Act

ALONE: Final = "alone"
AFTER, FIRST_FRAME, ALIKE, THIRD = "after another", "from the first frame", "two alike", "third"
BESIDE_DRIFT: Final = "beside a slow drift"
PLACES: Final = (ALONE, AFTER, FIRST_FRAME, ALIKE, THIRD, BESIDE_DRIFT)  # in the order of tables
_GROUPS: Final = ("place", "design")


def place_of(plan: Plan, number: int, made: Cell) -> str:
    """Return the place of the combination of run ``number``."""
    choice = plan.choices[number]
    named = next((str(choice[group]) for group in _GROUPS if group in choice), None)
    return by_faults(made) if named is None else named


def by_faults(made: Cell) -> str:
    """Return the place that the faults of a combination make."""
    faults, targets = made.scenario.faults, made.faults.targets
    of_test = [i for i in (made.tested, made.second) if i is not None]
    channels = len(np.unique(targets["column"][np.isin(targets["fault"], of_test)]))
    others = [faults[i] for i in made.earlier]
    if channels > 1:
        return ALIKE if channels == 2 and not others else f"{channels} channels, beside {len(others)} faults"
    if any(other.effect.act == Act.DRIFT for other in others):
        return BESIDE_DRIFT
    if others:
        return {1: AFTER, 2: THIRD}.get(len(others), f"after {len(others)} others")
    varied = (made.tested, "start_s") in made.varied
    return FIRST_FRAME if not varied and not faults[made.tested].start_s else ALONE


def kind_of(plan: Plan, number: int, kind: str) -> str:
    """Return the kind of a combination's tested fault: the case of the group ``kind``, such as slow for a drift."""
    return str(plan.choices[number].get("kind", kind))


def in_order(places: list[str]) -> dict[str, int]:
    """Return the rank of each place in a table: those that are known first, then others as they come."""
    known = [place for place in PLACES if place in places]
    return {place: i for i, place in enumerate([*known, *(each for each in places if each not in PLACES)])}
