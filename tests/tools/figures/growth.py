"""How the many grow: flights a second by workers, trials and searches a second, and what a large campaign takes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from math import floor, log10
from pathlib import Path
from statistics import median
from typing import Any, Final, NamedTuple

from distributed import LocalCluster

from figures import table
from figures.svg import Panel, line, svg, text

PICTURE: Final = Path(__file__).parents[3] / "docs" / "pictures" / "growth.svg"
CAMPAIGN: Final = """
title = "Growth"
base = "f16_pitch_rate_hardover"
sampling = "random"
runs = {runs}
seed = 1
set = {{ duration_s = {seconds}, "faults.0.start_s" = {start} }}
vary = {{ "faults.0.channels.0" = [1, 2, 3, 4] }}
run = {{ logs = "none" }}
"""
LATER: Final = (100_000, 1_000_000)
HEADS: Final = ("flights", "parent, MB", "on disk, MB", "report, s", "status, s", "")
CURVES: Final = {  # field of a size: label, colour
    "parent_mb": ("memory of the parent, MB", "c1"),
    "disk_mb": ("on disk, MB", "c2"),
    "report_s": ("report, s", "c3"),
    "status_s": ("status, s", "c4"),
}
LABEL_PX: Final = 16.0


class Size(NamedTuple):
    """What a campaign of so many flights takes."""

    flights: int
    parent_mb: float
    disk_mb: float
    report_s: float
    status_s: float


def _campaign(folder: str, runs: int, seconds: float, *by: str) -> tuple[dict[str, Any], float]:
    """Fly a campaign into ``folder``/out; return what it prints and the most memory of its parent process, MB.

    by : --workers or --scheduler
    """
    file = Path(folder, "growth.toml")
    file.write_text(CAMPAIGN.format(runs=runs, seconds=seconds, start=seconds / 2.0))
    asked = ["campaign", "run", str(file), "--out", f"{folder}/out", *by, "--json"]
    process = subprocess.Popen([sys.executable, "-m", "rig", *asked], stdout=subprocess.PIPE, text=True)
    most = 0.0
    while process.poll() is None:  # the system forgets it when the process ends
        most = max(most, _peak_mb(process.pid))
        time.sleep(0.05)
    printed = process.communicate()[0]
    if process.returncode:
        raise SystemExit(f"rig campaign run: exit code {process.returncode}")
    return json.loads(printed), most


def _peak_mb(pid: int) -> float:
    """Return the most memory that a process has had, MB; 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return next((float(each.split()[1]) / 1024.0 for each in lines if each.startswith("VmHWM")), 0.0)


def counts() -> list[int]:
    """Return 1, 2, 4 and so on, up to the cores of the machine, and the cores."""
    cores = os.cpu_count() or 1
    return sorted({*(2**k for k in range(cores.bit_length()) if 2**k <= cores), cores})


def busy() -> str:
    """Return a sentence on the other work of the machine, which decides what workers gain."""
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    said = "other work had the machine too, so these figures are no limits" if load > 0.5 else "the machine was quiet"
    return f"Load average before: {load:.1f} on {cores} cores; {said}."


@contextmanager
def _cluster(workers: int) -> Iterator[str]:
    """Run a Dask scheduler and its workers on this machine; yield its address."""
    made: Any = LocalCluster  # its types know neither a context nor a cluster without a dashboard
    with made(n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def growth_workers(runs: str = "400", rounds: str = "3") -> None:
    """Print flights a second, of 8 s each, by workers; the largest rate of some rounds in turn.

    The workers are processes of the command, then those of a Dask cluster.
    """
    load = busy()
    table(("workers", "flights/s", "efficiency", "tables"), _by_workers(int(runs), int(rounds)))
    print(f"\n{load}")


def _by_workers(runs: int, rounds: int) -> Iterator[list[str]]:
    rates: dict[tuple[str, int], list[float]] = {(kind, count): [] for kind in ("", " of Dask") for count in counts()}
    hashes = set[str]()
    for _ in range(rounds):
        for (kind, workers), found in rates.items():
            with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
                local = ("--workers", str(workers))
                by = ("--scheduler", stack.enter_context(_cluster(workers))) if kind else local
                flown, _ = _campaign(folder, runs, 8.0, *by)
            found.append(flown["flights_per_s"])
            hashes.add(flown["table_sha256"])
    alone = max(rates["", 1])
    for (kind, workers), found in rates.items():
        share = max(found) / (workers * alone)
        yield [f"{workers}{kind}", f"{max(found):.1f}", f"{share:.0%}", "equal" if len(hashes) == 1 else "DIFFERENT"]


def growth_trials(trials: str = "40000", flights: str = "200") -> None:
    """Print open-loop trials and flights of a search a second, by workers; the command's whole time, start included."""
    heads = ("workers", "trials/s", "flights of a search/s")
    table(heads, ([str(n), *_trials_and_search(n, int(trials), int(flights))] for n in counts()))


def _trials_and_search(workers: int, trials: int, flights: int) -> Iterator[str]:
    commands = {
        "trials": ("reliability", "trials", "reliability", "--runs", str(trials)),
        "flights": ("search", "worst-pitch-rate", "--requirement", "vote", "--flights", str(flights)),
    }
    for counted, command in commands.items():
        with tempfile.TemporaryDirectory() as folder:
            rest = ("--out", f"{folder}/out", "--workers", str(workers), "--json")
            began = time.perf_counter()
            printed = _rig(*command, *rest)
            wall_s = time.perf_counter() - began
        yield f"{printed[counted] / wall_s:,.0f}"


def _rig(*arguments: str) -> dict[str, Any]:
    """Return what a command prints with --json; SystemExit where it fails."""
    ended = subprocess.run([sys.executable, "-m", "rig", *arguments], capture_output=True, text=True, check=False)
    if ended.returncode:
        raise SystemExit(f"rig {' '.join(arguments)}: exit code {ended.returncode}: {ended.stderr.strip()[-300:]}")
    return json.loads(ended.stdout)


def growth_size(*flights: str) -> None:
    """Print what campaigns of very short flights take, then what larger ones would; draw both."""
    sizes = [_size(int(count)) for count in flights or ("1000", "10000", "100000")]
    later = [extrapolated(sizes, count) for count in LATER if count > sizes[-1].flights]
    rows = [_row(size, "measured") for size in sizes] + [_row(size, "extrapolated, not flown") for size in later]
    table(HEADS, rows)
    PICTURE.write_text(drawn(sizes, later), encoding="utf-8")
    print("\n![Memory, disk space, report and status by the number of flights](../../pictures/growth.svg)")


def _size(count: int) -> Size:
    """Fly a campaign of flights of 20 frames, as many rows of its tables as longer ones have."""
    with tempfile.TemporaryDirectory() as folder:
        _, parent_mb = _campaign(folder, count, 0.2, "--workers", str(os.cpu_count() or 1))
        disk = sum(path.stat().st_size for path in Path(folder, "out").rglob("*") if path.is_file())
        seconds = (_seconds(name, f"{folder}/out") for name in ("report", "status"))
        return Size(count, parent_mb, disk / 1e6, *seconds)


def _seconds(command: str, folder: str) -> float:
    """Return how long a command on a campaign takes, s, the median of three."""
    taken: list[float] = []
    for _ in range(3):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-m", "rig", "campaign", command, folder], capture_output=True, check=True)
        taken.append(time.perf_counter() - began)
    return median(taken)


def extrapolated(sizes: Sequence[Size], flights: int) -> Size:
    """Return what a campaign would take that grows on as between the last two of ``sizes``, or not at all."""
    before, last = sizes[-2:]
    share = (flights - last.flights) / (last.flights - before.flights)
    return Size(flights, *(b + share * max(0.0, b - a) for a, b in zip(before[1:], last[1:], strict=True)))


def _row(size: Size, how: str) -> list[str]:
    return [f"{size.flights:,}", *(_two_digits(value) for value in size[1:]), how]


def _two_digits(value: float) -> str:
    """Return a number with two significant digits."""
    if value <= 0.0:
        return "0"
    digits = 1 - floor(log10(value))
    return f"{round(value, digits):,.{max(digits, 0)}f}"


def drawn(sizes: Sequence[Size], later: Sequence[Size]) -> str:
    """Return the picture: powers of ten over powers of ten, dashed where nothing was flown."""
    panel = Panel(64.0, 292.0, (2.5, 6.5), (-1.0, 5.0))
    parts = [text(16, 26, "A large campaign", bold=True), text(16, 46, "powers of ten; dashed: extrapolated", "soft")]
    parts += panel.axes(range(-1, 6), range(3, 7), "flights")
    all_sizes, lowest = [*sizes, *later], panel.bottom + LABEL_PX
    for name in sorted(CURVES, key=lambda name: getattr(all_sizes[-1], name)):
        words, role = CURVES[name]
        points = [panel.at(log10(size.flights), log10(max(getattr(size, name), 0.1))) for size in all_sizes]
        lowest = min(points[-1][1], lowest - LABEL_PX)  # labels stand one above the other
        parts += _curve(points, len(sizes), role)
        parts.append(text(points[-1][0] + 8, lowest + 4.5, words, role))
    described = "Memory of the parent process, disk space, and the time of report and status, by the number of flights."
    return svg("growth", 330, "How a campaign grows", described, parts)


def _curve(points: Sequence[tuple[float, float]], flown: int, role: str) -> Iterable[str]:
    yield line(points[:flown], role, 'stroke-width="2"')
    yield line(points[flown - 1 :], role, 'stroke-width="2" stroke-dasharray="5 4"')
