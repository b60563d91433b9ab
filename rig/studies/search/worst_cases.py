"""The worst case of each cluster: chosen and made small on seeds that are not told, then flown on seeds that are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Final, NamedTuple

from rig.core.progress import tell
from rig.studies.search import confirm_worst
from rig.studies.search.clusters import Cluster, apart
from rig.studies.search.confirm_worst import Confirmed, Fly, Table, confirm, counting, worst
from rig.studies.search.rounds import Draw
from rig.studies.search.shrink import SEEDS, UNDO_SEEDS, shrink, simplest

MOST: Final = 5  # clusters that are confirmed
CANDIDATES: Final = 5  # of a cluster


class Case(NamedTuple):
    """One cluster with what its worst case is on seeds that chose nothing."""

    cluster: Cluster
    place: int  # of the worst case among the draws
    found: Confirmed  # its scenario
    smallest: Confirmed  # the smallest scenario that still violates; ``found`` if none is smaller

    @property
    def kept(self) -> Confirmed:
        """Return what the scenario file has: the smallest scenario, unless it violates on no seed."""
        return self.smallest if self.smallest.violations else self.found


def worst_cases(
    clusters: Sequence[Cluster], draws: Sequence[Draw], table_of: Callable[[int], Table], seeds: Iterator[int], fly: Fly
) -> list[Case]:
    """Return the cases of the first MOST clusters, those that violate most often first, then the least robust.

    table_of : the scenario of a draw, without its seed
    seeds : that no flight has had
    """
    take = lambda count: tuple(islice(seeds, count))  # noqa: E731
    cases = []
    for number, cluster in enumerate(clusters[:MOST], 1):
        of = f"{number} of {min(len(clusters), MOST)}"
        tell(f"confirming cluster {of}")
        places = apart(draws, cluster.places, CANDIDATES)
        candidates = confirm([table_of(place) for place in places], take(SEEDS), fly)
        chosen = worst(candidates)
        tell(f"shrinking cluster {of}")
        smallest = simplest(shrink(chosen.table, take(SEEDS), fly), take(UNDO_SEEDS), counting(fly))
        told = [chosen.table] if smallest == chosen.table else [chosen.table, smallest]
        flown = confirm(told, take(confirm_worst.SEEDS), fly)
        cases.append(Case(cluster, places[candidates.index(chosen)], flown[0], flown[-1]))
    return sorted(cases, key=lambda each: (-each.found.violations, each.found.median_robustness))
