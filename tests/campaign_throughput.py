"""How many flights a second a campaign flies; not a test, run it by hand on an idle machine:

    python tests/campaign_throughput.py [RUNS [ROUNDS]]

Flights of 20 s at 100 Hz with every log kept, by one worker and by two, beside what ``rig bench`` says of a frame in
the same minutes: what a worker could do if a flight were nothing but its frames, log included, and the share of time
that bare JSBSim would take.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import fmean, median
from typing import Any

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
    said = subprocess.run([sys.executable, "-m", "rig.cli", *arguments, "--json"], capture_output=True, check=True)
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


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3] or ["1000"]))
