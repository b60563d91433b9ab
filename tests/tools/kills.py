"""Kill each study in its first second, many times, and compare what it goes on to with an uninterrupted run.

python tests/tools/kills.py FOLDER [--kills 20] [--seed 1] [--only campaign,search,benchmark,trials,cutsets] [--chains
2]

Each kill is of a new run: SIGKILL to all its processes, at a time drawn from the second after its folder appears; every
fourth at once.  Then the same command runs to its end.  With --chains instead so many runs of a study, each ended up to
six times by any signal, at times drawn from the whole that it takes, and gone on with.  Prints a line a study; exit
code 1 where one differs.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from itertools import takewhile
from pathlib import Path
from typing import Final

import polars as pl

from rig.studies.campaign import tables as table
from rig.studies.campaign.tables import TABLES

ROOT: Final = Path(__file__).parents[2]
RIG: Final = (sys.executable, "-m", "rig")
PATIENCE_S: Final = 600.0
CAMPAIGN: Final = """
base = "scenario.toml"
sampling = "random"
runs = 6
[vary]
"faults.0.offset" = { low = 0.03, high = 0.3 }
[run]
batch = 1
"""
SCENARIO: Final = """
aircraft = "f16"
duration_s = 2.0
redundancy = { manager = "median" }
faults = [{ kind = "offset", signal = "pitch_rate", channels = [1], start_s = 0.5, offset = 0.1 }]
"""
EXAMPLES: Final = ROOT / "docs" / "examples"
STUDIES: Final[dict[str, tuple[str, ...]]] = {
    "campaign": ("campaign", "run", "../campaign.toml", "--workers", "2"),
    "search": ("search", "../campaign.toml", "--requirement", "vote", "--flights", "32", "--workers", "2"),
    "benchmark": (
        *("benchmark", str(EXAMPLES / "benchmark_small.toml"), "--managers", "cusum,median", "--budget", "20"),
        *("--healthy", "../healthy", "--trials", "4", "--workers", "2"),
    ),
    "trials": ("reliability", "trials", "reliability", "--runs", "2000", "--good-before", "4", "--workers", "2"),
    "cutsets": (
        *("reliability", "cutsets", "--order", "1", "--flights", "1", "--conditions", "manoeuvre-near"),
        *("--workers", "2"),
    ),
}


SIGNALS: Final = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
LINKS: Final = 6  # kills of a chain


def run(command: tuple[str, ...], where: Path) -> float:
    """Run a study to its end in the folder ``where``; return how long it took, s."""
    began = time.monotonic()
    done = subprocess.run([*RIG, *command, "--out", "out"], cwd=where, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{where}: exit code {done.returncode}: {done.stderr.strip()}")
    return time.monotonic() - began


def kill(command: tuple[str, ...], where: Path, delay_s: float, number: signal.Signals = signal.SIGKILL) -> bool:
    """Begin a study and end it ``delay_s`` after its folder appears; return False where it had ended before."""
    process = subprocess.Popen(
        [*RIG, *command, "--out", "out"],
        cwd=where,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    began = time.monotonic()
    while process.poll() is None and not (where / "out").exists() and time.monotonic() - began < PATIENCE_S:
        time.sleep(0.0005)
    time.sleep(delay_s)
    ended = process.poll() is not None
    if not ended:
        os.killpg(process.pid, number)
        process.wait(PATIENCE_S)
    return not ended


def tables(folder: Path) -> dict[str, pl.DataFrame]:
    """Read the tables of any campaign's folder, a search's too; a part without its ``runs`` does not count."""
    parts = sorted(path.name for path in (folder / "runs").glob("*.parquet"))
    return {
        name: table.joined(name, [pl.read_parquet((folder / name / part).read_bytes()) for part in parts])
        for name in TABLES
    }


def content(out: Path) -> str:
    """Return a hash of a study's files; of a campaign that of its tables, which leaves out the wall clock."""
    digest = hashlib.sha256()
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        if path.name == "campaign.json":
            digest.update(f"{name} {table.sha256(tables(path.parent))}\n".encode())
        elif path.is_file() and path.parent.name not in TABLES and path.name != "lock" and path.suffix != ".html":
            digest.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def study(name: str, folder: Path, runs: int, chains: bool, rng: random.Random) -> bool:
    """Run a study whole and killed; print and return whether all are the same."""
    whole, killed, differ = folder / f"{name}_whole", 0, []
    whole.mkdir()
    took_s = run(STUDIES[name], whole)
    expected = content(whole / "out")
    for number in range(runs):
        where, delay_s = folder / f"{name}_{number:02d}", 0.0 if number % 4 == 0 else rng.random()
        where.mkdir()
        ends = [(delay_s, signal.SIGKILL)]
        if chains:
            ends = [(took_s * rng.random(), rng.choice(SIGNALS)) for _ in range(LINKS)]
        links = list(takewhile(bool, (kill(STUDIES[name], where, *end) for end in ends)))
        killed += len(links)
        left = sorted(path.relative_to(where).as_posix() for path in (where / "out").rglob("*"))
        if len(links) == len(ends):  # else it has ended
            run(STUDIES[name], where)
        if content(where / "out") != expected or any(where.rglob("*.part")):
            differ.append(f"killed after {delay_s:.3f} s, with {left}")
        else:
            shutil.rmtree(where)
    print(f"{name}: {runs} runs, {killed} killed, {len(differ)} differ, hash {expected[:16]}", flush=True)
    print("\n".join(differ), end="\n" if differ else "", flush=True)
    return not differ


def main() -> None:
    """Run the studies that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--chains", type=int, metavar="N", help="chains of kills instead of single ones")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(STUDIES))
    given = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGHUP):  # in the background they are ignored from the first
        signal.signal(number, signal.default_int_handler)
    folder, runs = given.folder.resolve(), given.chains or given.kills
    folder.mkdir(parents=True)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "scenario.toml").write_text(SCENARIO)
    names = given.only.split(",")
    if "benchmark" in names:
        healthy = (
            *RIG,
            "campaign",
            "run",
            str(EXAMPLES / "benchmark_healthy.toml"),
            "--out",
            "healthy",
            "--runs",
            "12",
        )
        subprocess.run([*healthy, "--set", "duration_s=20"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    same = [study(name, folder, runs, bool(given.chains), random.Random(f"{given.seed} {name}")) for name in names]
    sys.exit(0 if all(same) else 1)


if __name__ == "__main__":
    main()
