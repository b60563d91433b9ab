"""Figures of this commit on this machine: run what measures them, and keep what it prints in docs/measured/.

    python tests/tools/measured.py [bench resolvers ...]     without names: all of them, three hours on two cores

Each page has the commands, the commit, the versions, the machine and the output: who doubts a figure runs it again.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Final, NamedTuple

from rig.util.versions import versions

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = ROOT / "docs" / "measured"
TOOLS: Final = "python tests/tools"


class Figures(NamedTuple):
    """One page: what it shows, and the commands that print it, run in the checkout; ``{folder}`` is a scratch one."""

    title: str
    commands: Sequence[str]


UNITS_BUILT: Final = "make -s -C docs/examples/unit all build/monitor.fmu RIG=../../../.venv/bin/rig"
UNITS: Final = ("monitor", "monitor_in_process", "monitor_udp", "monitor_fmu")
MANAGER: Final = "redundancy.manager"
MANAGERS: Final = ("cross-channel", "cross-voter", "median", "mean", "selection")
TRIALS: Final = {"cross-channel": 4_000_000, "cross-voter": 1_000_000, "median": 1_000_000}
FLOWN: Final = "logs/f16_pitch_rate_hardover_seed1.mcap"
EXAMPLES: Final = "docs/examples"
MEASURED: Final = {
    "first-minutes": Figures(
        "The first ten minutes of a new user: the README's commands, what they print, how long they take",
        [
            "make --no-print-directory fly",
            "rig fly",
            "rig fly --set redundancy.manager=mean",
            "rig fly f16_singular_2_2_level",
            f"rig score {FLOWN}",
            f"rig report {FLOWN}",
            f"rig view {FLOWN} --save {{folder}}/flight.rrd",
            f"rig replay {FLOWN}",
            f"rig replay {FLOWN} --set redundancy.manager=median",
            f"rig fly {EXAMPLES}/mine.toml --seed 7",
            f"rig vote {EXAMPLES}/channels.csv --config {EXAMPLES}/vote.toml --out {{folder}}/voted.csv",
            "make -s -C docs/examples/unit build/libfirst_valid.so",
            f"rig fly --unit {EXAMPLES}/unit/first_valid.toml",
            f"rig campaign plan {EXAMPLES}/campaign.toml",
            f"rig campaign run {EXAMPLES}/campaign.toml --out {{folder}}/campaign",
            "rig campaign report {folder}/campaign",
            f"rig reliability chain {EXAMPLES}/chain.toml",
        ],
    ),
    "bench": Figures("What a frame costs", ["rig bench"] * 8),
    "evidence": Figures("What the monitor gets wrong", [f"{TOOLS}/evidence.py"]),
    "resolvers": Figures(
        "Who settles a pattern without a majority",
        ["rig campaign run resolvers --out {folder}/resolvers", f"{TOOLS}/resolver_table.py {{folder}}/resolvers"],
    ),
    "references": Figures("Measured errors of the references", [f"{TOOLS}/references_table.py"]),
    "singular": Figures("Patterns without a majority, flown", ["python tests/test_singular_flights.py"]),
    "histories": Figures("What happened to aircraft, flown again", ["python tests/test_histories.py"]),
    "tolerant": Figures("What the fault-tolerant law finds, and its false trips", [f"{TOOLS}/tolerant.py"]),
    "rate-bias": Figures(
        "A common bias of rates and attitudes, by both laws",
        ["rig study rate-bias", "rig study rate-bias --seeds 2 --drawn 300"],
    ),
    "fault-tolerant": Figures(
        "All four pitch-angle sensors fail together: each law, worst of twelve flights", ["rig study fault-tolerant"]
    ),
    "false-alarm": Figures(
        "Healthy flights: channels and signals failed without a fault",
        [
            "rig campaign run false-alarm --set redundancy.common_mode=fail --out {folder}/healthy",
            "rig campaign report {folder}/healthy",
        ],
    ),
    "unit": Figures(
        "A unit under test: the bits of our manager, how it fails, paced flights",
        [
            UNITS_BUILT,
            "rig unit check docs/examples/unit/monitor.toml",
            f"{TOOLS}/unit_identity.py " + " ".join(f"docs/examples/unit/{name}.toml" for name in UNITS),
            f"{TOOLS}/unit_crashes.py",
            f"{TOOLS}/unit_stopped.py docs/examples/unit/build",
            f"{TOOLS}/unit_paced.py docs/examples/unit/build/libmonitor.so",
        ],
    ),
    "unit-cost": Figures(
        "What a unit under test costs", [UNITS_BUILT, *[f"{TOOLS}/unit_bench.py docs/examples/unit/build"] * 5]
    ),
    "thresholds": Figures(
        "Thresholds from a budget: real flights that did not design them, noise of known kinds, a million rows",
        [
            f"{TOOLS}/thresholds_quad.py ../shared/data/quad_imu_horizontal",
            f"{TOOLS}/thresholds_synthetic.py",
            f"{TOOLS}/thresholds_speed.py",
        ],
    ),
    "detectability": Figures(
        "Thresholds of the bundled aircraft: the smallest offset that is found, and what one that is not found does",
        [
            "rig campaign run detectability --out {folder}/detectability",
            f"{TOOLS}/detectability.py {{folder}}/detectability",
            f"{TOOLS}/undetected.py",
        ],
    ),
    "recorders": Figures(
        "Healthy channels failed on four recorders of one quadrotor, and the manager selection on them",
        [
            f"{TOOLS}/quad_isolations.py ../shared/data/quad_imu_horizontal",
            f"{TOOLS}/quad_selection.py ../shared/data/quad_imu_horizontal",
        ],
    ),
    "reliability": Figures(
        "Five managers, one to four channels: per flight hour, and what decides",
        [
            *[f"rig campaign run reliability --out {{folder}}/{m} --set {MANAGER}={m}" for m in MANAGERS],
            *[
                f"rig reliability trials reliability --out {{folder}}/trials-{m} --runs {runs} --set {MANAGER}={m}"
                for m, runs in TRIALS.items()
            ],
            *[
                f"rig reliability run {{folder}}/{' {folder}/'.join([*MANAGERS, *(f'trials-{m}' for m in TRIALS)])} "
                f"--rates faults/rates/zhang2023.toml --checks 1 --signal {signal}"
                for signal in ("pitch_rate", "normal_load_factor", "static_pressure")
            ],
        ],
    ),
    "throughput": Figures("Flights a second of a campaign", [f"{TOOLS}/campaign_throughput.py"]),
    "hostile": Figures("Bad input", [f"{TOOLS}/hostile.py --cases 1000"]),
}


def machine() -> str:
    """Processor, cores and system."""
    cpu = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", cpu.read_text(encoding="utf-8")) if cpu.is_file() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def printed(command: str, folder: str) -> str:
    """What a command prints, without its progress; SystemExit when it fails."""
    name, *rest = command.format(folder=folder).split()
    own = Path(sys.executable).with_name(name)
    program = [sys.executable] if name == "python" else [str(own) if own.is_file() else name]
    environment = {**os.environ, "COLUMNS": "140", "NO_COLOR": "1"}
    done = subprocess.run([*program, *rest], cwd=ROOT, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        sys.exit(f"{command}: exit code {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout.replace(folder, "FOLDER").replace(f"{ROOT}/", "").rstrip()


def timed(command: str, folder: str) -> tuple[str, float]:
    """What a command prints, and the seconds it takes."""
    began = perf_counter()
    return printed(command, folder), perf_counter() - began


def page(name: str, figures: Figures, known: dict[str, str]) -> str:
    """The page of one set of figures; ``known``: versions before any page was written."""
    with TemporaryDirectory(prefix="rig") as folder:
        outputs = [(command, *timed(command, folder)) for command in figures.commands]
        minutes = sum(seconds for *_, seconds in outputs) / 60.0
    packages = ", ".join(f"{key.removeprefix('version ')} {value}" for key, value in known.items() if "version" in key)
    head = [
        f"# {figures.title}",
        f"Written by `make measured only={name}`; do not edit.",
        f"- commit: {known.get('git commit', 'unknown')}",
        f"- versions: {packages}",
        f"- machine: {machine()}; {minutes:.1f} minutes",
    ]
    blocks = [
        f"{seconds:.1f} s:\n\n```\n$ {command.format(folder='FOLDER')}\n{output}\n```"
        for command, output, seconds in outputs
    ]
    return "\n\n".join([head[0], head[1], "\n".join(head[2:]), *blocks]) + "\n"


def main() -> int:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MEASURED))
    names = parser.parse_args().names or list(MEASURED)
    unknown = [name for name in names if name not in MEASURED]
    if unknown:
        parser.error(f"{unknown[0]}: allowed: {', '.join(MEASURED)}")
    PAGES.mkdir(parents=True, exist_ok=True)
    known = versions()
    for name in names:
        (PAGES / f"{name}.md").write_text(page(name, MEASURED[name], known), encoding="utf-8")
        print(f"docs/measured/{name}.md", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
