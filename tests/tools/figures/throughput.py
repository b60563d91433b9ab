"""How many flights a second a campaign flies: flights of 20 s at 100 Hz with every log kept."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean, median
from typing import Any, Final

from figures import table

FRAMES: Final = 2000
HEADS: Final = (
    *("frame us", "bare us", "flights/s: one", "two", "one of allowed", "a core of two", "two to one", "tables"),
)
FORMATS: Final = (".2f", ".2f", ".2f", ".2f", ".0%", ".0%", ".2f")
CAMPAIGN: Final = """
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
    """Return what a command prints with --json."""
    command = [sys.executable, "-m", "rig", *arguments, "--json"]
    return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def campaign(runs: int, workers: int) -> dict[str, Any]:
    """Fly the campaign in a folder that is thrown away."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "throughput.toml")
        file.write_text(CAMPAIGN.format(runs=runs))
        return rig("campaign", "run", str(file), "--out", f"{folder}/out", "--workers", str(workers))


def rounds(runs: int, count: int) -> Iterator[list[str]]:
    """Yield a row a round, one worker first and two first in turn, then the medians.

    The bench before and after, and the mean of both: it is the machine of the minutes between them.
    """
    numbers: list[tuple[float, ...]] = []
    for k in range(count):
        before = rig("cost", "--repeats", "3")
        flown = {workers: campaign(runs, workers) for workers in ((1, 2) if k % 2 == 0 else (2, 1))}
        after = rig("cost", "--repeats", "3")
        frame_us, bare_us = (fmean((before[name], after[name])) for name in ("frame_us", "bare_us"))
        allowed = 1e6 / (frame_us * FRAMES)
        one, two = (flown[workers]["flights_per_s"] for workers in (1, 2))
        numbers.append((frame_us, bare_us, one, two, one / allowed, two / 2.0 / allowed, two / one))
        equal = flown[1]["table_sha256"] == flown[2]["table_sha256"]
        yield [*map(format, numbers[-1], FORMATS), "equal" if equal else "DIFFERENT"]
    yield [*map(format, map(median, zip(*numbers, strict=True)), FORMATS), "(medians)"]


def throughput(runs: str = "1000", count: str = "4") -> None:
    """Print flights a second of one worker and of two, beside what a worker could do if a flight were only frames."""
    table(HEADS, rounds(int(runs), int(count)))
