"""Scenarios on new seeds: how many violate, with the exact interval.

The flight with the least robustness is often chance: it violates on 4 to 20 of 20 new seeds.  A share is unbiased only
on seeds that chose nothing; those that chose one of several scenarios overstate it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from rig.studies.campaign.sampling import seed_of
from rig.studies.campaign.statistics import Rate, proportion
from rig.studies.search.objective import Measured

SEEDS: Final = 20  # of a share that is told
Table = dict[str, Any]
Fly = Callable[[Sequence[Table]], list[Measured]]  # of scenario tables with their seeds


@dataclass(frozen=True, slots=True)
class Confirmed:
    """A scenario flown on new seeds."""

    table: Table  # without its seed
    seeds: tuple[int, ...]
    results: tuple[Measured, ...]

    @property
    def violations(self) -> int:
        """Return the number of seeds on which the scenario violates."""
        return sum(result.violated for result in self.results)

    @property
    def share(self) -> Rate:
        """Return the probability of a violation with its 95 % interval."""
        return proportion(self.violations, len(self.seeds))

    @property
    def violating(self) -> dict[str, int]:
        """Return the number of violating seeds by the id of the requirement."""
        ids = [each for result in self.results for each in result.violating]
        return {each: ids.count(each) for each in dict.fromkeys(ids)}

    @property
    def median_robustness(self) -> float:
        """Return the median robustness over the seeds."""
        return float(median(result.robustness for result in self.results))

    @property
    def seed(self) -> int:
        """Return the seed of the least robustness, of a violation if there is one."""
        ranked = [(not r.violated, r.robustness, i) for i, r in enumerate(self.results)]
        return self.seeds[min(ranked)[2]]


def new_seeds(campaign: Any, first: int, count: int) -> tuple[int, ...]:
    """Return seeds that no flight of the search has, those of the run numbers from ``first`` on."""
    return tuple(seed_of(campaign, number) for number in range(first, first + count))


def confirm(tables: Sequence[Table], seeds: Sequence[int], fly: Fly) -> list[Confirmed]:
    """Fly each scenario on all ``seeds``."""
    results = fly([{**table, "seed": seed} for table in tables for seed in seeds])
    count = len(seeds)
    return [
        Confirmed(table, tuple(seeds), tuple(results[i * count : (i + 1) * count])) for i, table in enumerate(tables)
    ]


def counting(fly: Fly) -> Callable[[Table, Sequence[int]], int]:
    """Return the function that counts the violations of a scenario on seeds."""
    return lambda table, seeds: confirm([table], seeds, fly)[0].violations


def worst(confirmed: Sequence[Confirmed]) -> Confirmed:
    """Return the scenario with the most violations, then with the least median robustness."""
    return min(confirmed, key=lambda each: (-each.violations, each.median_robustness))
