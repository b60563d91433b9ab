"""How often a search passes the bound that few random flights pass: 20 cells, open loop.

    python tests/tools/search_cells.py [--random 1000] [--flights 600] [--seeds 2] [--workers 2] [--free-signs]

For each cell and seed: the bound that 1 % (and 5 %) of ``--random`` random draws pass, and the share of the search's
draws after its random tenth that pass it, over 1 % (5 %).  Table and counts are printed.
"""

from __future__ import annotations

import argparse
from multiprocessing import Pool

import numpy as np
from search_here import plan_of, search_here, space

CELLS = [
    (manager, aircraft, signal, 2 + (i + j) % 2)
    for i, manager in enumerate(("cross-channel", "mean", "median", "selection", "cusum"))
    for j, (aircraft, signal) in enumerate(
        (("f16", "pitch_rate"), ("b747", "normal_load_factor"), ("b737", "static_pressure"), ("f16", "pitch_angle"))
    )
]
SHARES = (0.01, 0.05)


def cell(job: tuple[tuple[str, str, str, int], int, int, int, bool]) -> tuple[float, ...]:
    """Least robustness, share of random flights that violate, and the ratios of one cell and seed."""
    (manager, aircraft, signal, faults), many, flights, seed, free_signs = job
    campaign = space(manager, aircraft, signal, faults, free_signs)
    random = np.array([each.value for each in search_here(plan_of(campaign, many, "random", 100 + seed))])
    plan = plan_of(campaign, flights, "regions", seed)
    after = np.array([each.value for each in search_here(plan)])[plan.random :]
    ratios = [float((after < np.quantile(random, share)).mean()) / share for share in SHARES]
    return float(random.min()), float(after.min()), float((random < 0).mean()), *ratios


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("--random", 1000), ("--flights", 600), ("--seeds", 2), ("--workers", 2)):
        parser.add_argument(name, type=int, default=value)
    parser.add_argument("--free-signs", action="store_true")
    given = parser.parse_args()
    jobs = [
        (each, given.random, given.flights, seed, given.free_signs) for each in CELLS for seed in range(given.seeds)
    ]
    print(f"{'cell':52} seed  random  search  violated   1 %   5 %")
    ratios = []
    with Pool(given.workers) as pool:
        for (each, _, _, seed, _), row in zip(jobs, pool.imap(cell, jobs), strict=True):
            ratios.append(row[3:])
            named = ", ".join(map(str, each))
            print(
                f"{named:52} {seed:4d} {row[0]:7.2f} {row[1]:7.2f} {100 * row[2]:7.1f} % {row[3]:5.1f} {row[4]:5.1f}",
                flush=True,
            )
    table = np.array(ratios)
    for column, share, times in ((0, "1 %", 10), (1, "5 %", 5), (1, "5 %", 10)):
        at = table[:, column]
        print(f"{share}: median ratio {np.median(at):.1f}; at {times}x {int((at >= times).sum())} of {len(at)}")


if __name__ == "__main__":
    main()
