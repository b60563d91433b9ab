"""Shares of clusters, each confirmed on 20 new seeds, beside their shares of many more flights.

    python tests/tools/cluster_shares.py --space f16 --bound 1.057 [--seeds 3 6] [--flights 240] [--no-trials-first]

The spaces are those of search_table.py.  Of each search the first five clusters: the worst of five candidates is chosen
on seeds that are not told, and its share told on 20 new seeds with the exact interval.  Then it flies on ``--flights``
others.  Printed: how many of these shares are in their interval.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import count, islice

from search_table import ID, SPACES, Job, plan_of, results_of, row

from rig.studies.campaign.plan import Run
from rig.studies.campaign.sampling import seed_of
from rig.studies.search.clusters import apart, clusters
from rig.studies.search.confirm_worst import SEEDS, Table, confirm, worst
from rig.studies.search.objective import Measured, measured
from rig.studies.search.search_plan import SearchPlan
from rig.studies.search.shrink import SEEDS as CHOOSE
from rig.studies.search.worst_cases import CANDIDATES, MOST


def shares(plan: SearchPlan, flights: int) -> list[tuple[int, int, bool]]:
    """Return of each cluster its violations on the seeds that are told, on the others, and if the interval holds."""
    found = results_of(plan).results
    groups = clusters(plan.draws, [each.value for each in found], [each.violated for each in found])
    seeds = (seed_of(plan.campaign, number) for number in count(len(plan) + 1))

    def fly(tables: Sequence[Table]) -> list[Measured]:
        return [measured([row(Run(0, {}, table, plan.trust), plan)], [ID]) for table in tables]

    out = []
    for cluster in groups[:MOST]:
        tables = [plan.data(place) for place in apart(plan.draws, cluster.places, CANDIDATES)]
        table = worst(confirm(tables, tuple(islice(seeds, CHOOSE)), fly)).table
        told = confirm([table], tuple(islice(seeds, SEEDS)), fly)[0]
        many = confirm([table], tuple(islice(seeds, flights)), fly)[0].violations
        low, high = told.share.low, told.share.high
        assert low is not None and high is not None
        out.append((told.violations, many, low <= many / flights <= high))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--space", choices=SPACES, required=True)
    parser.add_argument("--bound", type=float, required=True, help="in thresholds")
    parser.add_argument("--seeds", type=int, nargs=2, default=(3, 6))
    parser.add_argument("--search", type=int, default=240, help="flights of a search")
    parser.add_argument("--flights", type=int, default=240, help="flights of a cluster")
    parser.add_argument("--trials-first", action=argparse.BooleanOptionalAction, default=True)
    given = parser.parse_args()
    every = []
    for seed in range(*given.seeds):
        plan = plan_of(Job(given.space, 1, "regions", seed, given.search, False, given.bound, given.trials_first))
        every += (new := shares(plan, given.flights))
        text = ", ".join(f"{told} of {SEEDS} and {many}{'' if held else ' (outside)'}" for told, many, held in new)
        print(f"{given.space}, seed {seed}: {text}", flush=True)
    print(
        f"{given.space}: {sum(held for *_, held in every)} of {len(every)} clusters within their interval", flush=True
    )


if __name__ == "__main__":
    main()
