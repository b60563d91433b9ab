"""How many flights a second a campaign flies; not a test, run it by hand on an idle machine:

    python tests/tools/campaign_throughput.py [RUNS [ROUNDS]]
    python tests/tools/campaign_throughput.py --paired [FLIGHTS]

Flights of 20 s at 100 Hz with every log kept, by one worker and by two, beside what ``rig bench`` says of a frame in
the same minutes: what a worker could do if a flight were nothing but its frames, log included, and the share of time
that bare JSBSim would take.

A campaign takes half a minute, in which the speed of a shared machine changes.  So, as the bench does, --paired takes
turns within one process tree: a flight as the bench flies it and one as a worker flies it; ten flights by one worker
and twenty by two, less the start of the campaign and the writing of its tables.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median, quantiles
from typing import Any

from rig.campaign.config import read
from rig.campaign.plan import Plan, Run, rig_identity
from rig.campaign.pool import Local
from rig.campaign.worker import Orders, fly_batch, fly_run
from rig.flight.assembly import fly

FRAMES = 2000
LINE = "{:8.2f} {:8.2f} {:15.2f} {:6.2f} {:14.0%} {:14.0%} {:13.0%} {:11.2f}   {}"
CAMPAIGN = """
title = "Throughput"
base = "f16_pitch_rate_hardover"
sampling = "random"
runs = {runs}
seed = 1
set = {{ duration_s = 20.0, "faults.0.start_s" = 5.0 }}
vary = {{ "faults.0.channels.0" = [1, 2, 3, 4] }}
run = {{ batch = 10, logs = "all" }}
"""


def rig(*arguments: str) -> dict[str, Any]:
    """What a command prints with --json."""
    said = subprocess.run([sys.executable, "-m", "rig.cli.main", *arguments, "--json"], capture_output=True, check=True)
    return json.loads(said.stdout)


def campaign(runs: int, workers: int) -> dict[str, Any]:
    """Fly the campaign in a folder that is thrown away."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "throughput.toml")
        file.write_text(CAMPAIGN.format(runs=runs))
        said = rig("campaign", "run", str(file), "--out", f"{folder}/out", "--workers", str(workers))
    assert said["done"] == runs
    return said


def measured(runs: int, order: tuple[int, int]) -> tuple[float, float, float, float, bool]:
    """Microseconds of a frame and of bare JSBSim, flights a second of one worker and two, whether tables are equal.

    The bench before and after and the mean of both: it is the machine of the minutes between them.
    """
    before = rig("bench", "--repeats", "3")
    flown = {workers: campaign(runs, workers) for workers in order}
    after = rig("bench", "--repeats", "3")
    frame_us, bare_us = (fmean((before[name], after[name])) for name in ("frame_us", "bare_us"))
    equal = flown[1]["table_sha256"] == flown[2]["table_sha256"]
    return frame_us, bare_us, flown[1]["flights_per_s"], flown[2]["flights_per_s"], equal


def main(runs: int, rounds: int = 4) -> None:
    """Some rounds, one worker first and two first in turn; the medians in the end."""
    lines = []
    print("frame us  bare us   flights/s: one  two    one of allowed  a core of two  bare's share  two to one  tables")
    for k in range(rounds):
        frame_us, bare_us, one, two, equal = measured(runs, (1, 2) if k % 2 == 0 else (2, 1))
        allowed = 1e6 / (frame_us * FRAMES)
        shares = (one / allowed, two / 2.0 / allowed, one * FRAMES * bare_us / 1e6, two / one)
        lines.append((frame_us, bare_us, one, two, *shares))
        print(LINE.format(*lines[-1], "equal" if equal else "DIFFERENT"), flush=True)
    print(LINE.format(*map(median, zip(*lines, strict=True)), "(medians)"))


def paired(flights: int = 80) -> None:
    """Print the medians and quartiles over pairs; see above."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "throughput.toml")
        file.write_text(CAMPAIGN.format(runs=flights))
        plan = Plan(read(str(file)), "throughput")
        orders = Orders("all", flights, f"{folder}/logs", 60.0, twin=False, rig=rig_identity())
        runs = [plan[k] for k in range(flights)]
        workers = Local(2)
        try:
            warm_up = [workers.submit(fly_batch, runs[:10], orders) for _ in range(2)]
            assert all(future.result() for future in warm_up)
            shares = [workers.submit(_share, run, orders, folder).result() for run in runs]
            gains = [_gain(workers, runs[k : k + 10], orders) for k in range(0, flights - 9, 10) for _ in range(3)]
        finally:
            workers.close()
    for what, found in (("one worker, of what the bench's frame allows", shares), ("two workers to one", gains)):
        low, middle, high = quantiles(found, n=4)
        print(f"{what}: {middle:.2f}, quartiles {low:.2f} and {high:.2f}, {len(found)} pairs")


def _share(run: Run, orders: Orders, folder: str) -> float:
    """The time of the frames of a flight as the bench flies it, over that of all of it as a worker flies it."""
    flight = fly(run.scenario(), out=folder)
    flight.log.unlink()
    began = time.perf_counter()
    fly_run(run, orders)
    return flight.wall_s / (time.perf_counter() - began)


def _gain(workers: Local, runs: Sequence[Run], orders: Orders) -> float:
    """The flights a second of two workers over those of one, both measured within two seconds.

    A few flights more follow, so that neither of the two ends in peace.
    """
    alone_s = workers.submit(_timed, runs, orders).result()
    more = [[replace(run, number=run.number + k * len(runs)) for run in runs] for k in range(4)]  # a log each
    both = [workers.submit(_timed, some, orders) for some in (more[0], more[1], more[2][:3], more[3][:3])]
    return sum(alone_s / future.result() for future in both[:2])


def _timed(runs: Sequence[Run], orders: Orders) -> float:
    began = time.perf_counter()
    fly_batch(runs, orders)
    return time.perf_counter() - began


if __name__ == "__main__":
    if "--paired" in sys.argv:
        paired(*map(int, sys.argv[2:3]))
    else:
        main(*map(int, sys.argv[1:3] or ["1000"]))
