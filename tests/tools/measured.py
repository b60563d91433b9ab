"""Figures of a commit on a machine, measured at a release: what measures them is run, what it prints is kept.

    python tests/tools/measured.py [PAGE ...]     docs/results/measured/; without names: all, three hours on two cores
    python tests/tools/measured.py --show FIGURE [ARGUMENT ...]     one figure alone, printed

Each page has commands, commit, machine, seconds and what was printed: who doubts a figure runs it again.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
FOLDER: Final = ROOT / "docs" / "results" / "measured"
SHOW: Final = "python tests/tools/measured.py --show"
EXAMPLES: Final = "docs/examples"
FLOWN: Final = "logs/f16_pitch_rate_hardover_seed1.mcap"
QUADROTOR: Final = "../shared/data/quad_imu_horizontal"
QUADROTOR_FIGURES: Final = ("thresholds_quad", "quad_baselines", "quad_isolations", "quad_selection")
UNITS: Final = f"{EXAMPLES}/unit"
UNIT_FILES: Final = " ".join(f"{UNITS}/monitor{form}.toml" for form in ("", "_in_process", "_udp", "_fmu"))
UNITS_BUILT: Final = f"make -s -C {UNITS} all build/monitor.fmu RIG=../../../.venv/bin/rig"
MANAGERS: Final = ("cross-channel", "cross-voter", "median", "mean", "selection")
TRIALS: Final = {"cross-channel": 4_000_000, "cross-voter": 1_000_000, "median": 1_000_000}
CELLS: Final = (*MANAGERS, *(f"trials-{manager}" for manager in TRIALS))
SLOW: Final = ("slow-f16", "slow-b747", "slow-b737")
SLOW_CELLS: Final = ("cross-channel", "trials-cross-channel", "slow-f16", "trials-slow")
COST_ROWS: Final = (
    r"^ manager +channels +per|^ cross-channel +4 |^ cross-\S+ +3 +0\.001 +0|^ cross-voter +4 +0\.001"
    r"|^ \S+ +4 +0\.001 +0 %|^ \S+ +4 .*good [89]\d %|^\w+: prob"
)
LAWS: Final = r"^ hold|^ pitch +(F 0\.2|offset \+|.* over).* (plain|fault-tolerant)  |^ altitude .* over .* fault-t"
FIGURES: Final = {  # name: its module
    "offsets": "offsets",
    **dict.fromkeys(("quad_isolations", "quad_selection"), "quadrotor"),
    **dict.fromkeys(
        ("servo_response", "servo_picture", "servo_healthy", "servo_single", "servo_several", "servo_cost"),
        "actuators",
    ),
    **dict.fromkeys(
        ("lanes_single", "lanes_in_a_row", "lanes_software", "lanes_asymmetric", "lanes_pairs"),
        "lanes",
    ),
    **dict.fromkeys(
        (
            *("lanes_healthy", "lanes_flight_44", "lanes_picture"),
            *("lanes_cost", "lanes_compile", "lanes_log"),
        ),
        "lanes_whole",
    ),
    **dict.fromkeys(("thresholds_quad", "thresholds_synthetic", "thresholds_speed"), "thresholds"),
    **dict.fromkeys(("unit_identity", "unit_cost", "unit_stopped", "unit_paced"), "unit"),
    **{name: name for name in ("references", "tie_break", "throughput", "tolerant", "unit_failures", "quad_baselines")},
    "slow_drifts": "slow_drifts",
    **dict.fromkeys(("growth_workers", "growth_trials", "growth_size"), "growth"),
}


class Section(NamedTuple):
    """Commands, run in the checkout; of what they print, the lines that match ``keep``; {folder}: a scratch one."""

    title: str
    commands: Sequence[str]
    keep: str = ""


class Page(NamedTuple):
    """A page of docs/results/measured/."""

    title: str
    sections: Sequence[Section]


def folders(names: Sequence[str]) -> str:
    """Return the folders of these names."""
    return " ".join(f"{{folder}}/{name}" for name in names)


def per_hour(cells: Sequence[str], rates: str) -> list[str]:
    """Return what cells come to by bundled rates, a command for each signal."""
    command = f"rig reliability run {folders(cells)} --rates faults/rates/{rates}.toml --checks 1 --signal"
    return [f"{command} {name}" for name in ("pitch_rate", "normal_load_factor", "static_pressure")]


def reliability() -> list[Section]:
    """Return campaigns and trials, then what they come to for each signal; of slow drifts ours alone."""
    sets, run = "--set redundancy.manager=", "rig campaign run reliability"
    trials = "rig reliability trials reliability"
    flown = [f"{run} --out {{folder}}/{name} {sets}{name}" for name in MANAGERS]
    flown += [f"{trials} --out {{folder}}/trials-{name} --runs {n} {sets}{name}" for name, n in TRIALS.items()]
    slow = [f"{run}-slow --out {{folder}}/{name} --set aircraft={name.removeprefix('slow-')}" for name in SLOW]
    slow += [f"{trials}-slow --out {{folder}}/trials-slow --runs 100000"]
    return [
        Section("Flights and trials", flown, "^table|trials:"),
        Section("Results", per_hour(CELLS, "zhang2023"), COST_ROWS),
        Section("Slow drifts: flights and trials", slow, "^table|trials:"),
        Section("Slow drifts: what became of them", [f"{SHOW} slow_drifts {folders(SLOW)}"]),
        Section("Results with half of the drifts slow", per_hour(SLOW_CELLS, "slow_drift"), COST_ROWS),
    ]


PAGES: Final = {
    "cost": Page(
        "What a new user runs, bad input, and what a frame, a campaign and a unit cost",
        [
            Section(
                "The README's commands",
                [
                    *("make --no-print-directory fly", "rig fly", "rig fly --set redundancy.manager=mean"),
                    *(f"rig score {FLOWN}", f"rig report {FLOWN}"),
                    *(f"rig replay {FLOWN} --set redundancy.manager=median", f"rig fly {EXAMPLES}/mine.toml --seed 7"),
                    f"rig vote {EXAMPLES}/channels.csv --config {EXAMPLES}/vote.toml --out {{folder}}/voted.csv",
                    f"make -s -C {UNITS} build/libfirst_valid.so",
                    f"rig fly --unit {UNITS}/first_valid.toml",
                    f"rig campaign run {EXAMPLES}/campaign.toml --out {{folder}}/campaign",
                ],
                r"^(result|flight   |report   logs|written|runs )",
            ),
            Section("Bad input", ["python tests/tools/hostile.py --cases 1000"], r"^\| (kind|all) |^\|-|cases in"),
            Section("A frame", ["rig cost"] * 8, "^ratio"),
            Section("A campaign", [f"{SHOW} throughput"]),
            Section("A unit under test", [UNITS_BUILT, f"{SHOW} unit_cost {UNITS}/build"]),
        ],
    ),
    "growth": Page(
        "How the many grow: workers, trials, searches, large campaigns",
        [
            Section("Flights of 8 s by workers, no log kept", [f"{SHOW} growth_workers"]),
            Section("Open-loop trials and searches, the start of the command included", [f"{SHOW} growth_trials"]),
            Section("Campaigns of very short flights (0.2 s)", [f"{SHOW} growth_size"]),
        ],
    ),
    "evidence": Page(
        "What the monitor gets wrong, and what it cannot see",
        [
            Section("Counts", ["python tests/tools/evidence.py --counts"], r"^\||^- |^$"),
            Section(
                "Healthy flights",
                [
                    "rig campaign run false-alarm --out {folder}/healthy",
                    "rig campaign report {folder}/healthy",
                ],
                "^table|^false alarms",
            ),
            Section(
                "The smallest offset that is found, and what one of 0.9 thresholds does",
                [
                    "rig campaign run detectability --out {folder}/offsets",
                    f"{SHOW} offsets {{folder}}/offsets",
                ],
                r"^table|^\|",
            ),
        ],
    ),
    "actuators": Page(
        "Servo actuators: beside a lag, healthy, with every fault, and their cost",
        [
            Section(
                "Without a fault: beside a lag, full-stick doublets in severe turbulence, cost in pairs of flights",
                [f"{SHOW} servo_{name}" for name in ("response", "picture", "healthy", "cost")],
            ),
            Section(
                "Faults from 5 s on, later ones 3 s apart; at random",
                [
                    *(f"{SHOW} servo_{name}" for name in ("single", "several")),
                    "rig campaign run actuators --out {folder}/actuators",
                    "rig campaign report {folder}/actuators",
                ],
                r"^\||^table|^survival|^ +(fault of|coil_|leak|lvdt|osc|sov|spool)",
            ),
        ],
    ),
    "computers": Page(
        "Four computers: clocks, every fault, pairs, cost",
        [
            Section(
                "Without a fault",
                [
                    *(f"python tests/tools/equal_lanes.py{ahead}" for ahead in ("", " 0 0.05 0.2 0.1")),
                    *(f"{SHOW} lanes_{name}" for name in ("healthy", "picture", "log", "compile", "flight_44", "cost")),
                ],
                r"^(?!.* frames  equal$)",
            ),
            Section(
                "With faults, at random or one after the other",
                [
                    *(f"{SHOW} lanes_{name}" for name in ("asymmetric", "software", "single", "in_a_row")),
                    "rig campaign run computer-pairs --out {folder}/pairs",
                    *("rig campaign report {folder}/pairs", f"{SHOW} lanes_pairs {{folder}}/pairs"),
                ],
                r"^\||^table|^survival|^good|^f16|^lost",
            ),
        ],
    ),
    "patterns": Page(
        "Splits",
        [
            Section(
                "Who settles them",
                [
                    "rig campaign run tie_break --out {folder}/tie_break",
                    f"{SHOW} tie_break {{folder}}/tie_break",
                ],
                r"^table|^\||^Default|^$",
            ),
            Section("Flown", ["python tests/test_split_flights.py"]),
        ],
    ),
    "references": Page(
        "Measured errors of the references, and histories flown again",
        [
            Section("References of all aircraft", [f"{SHOW} references"]),
            Section("Histories", ["python tests/test_histories.py"]),
        ],
    ),
    "thresholds": Page(
        "Thresholds from a budget, and four recorders of one quadrotor",
        [
            Section(
                "Four recorders of one quadrotor",
                [f"{SHOW} {name} {QUADROTOR}" for name in QUADROTOR_FIGURES],
                r"^(?!\| aligned by 6 s, |\| .*matrix|\| (raw|aligned), 12)",
            ),
            Section(
                "Noise of known kinds; a million rows", [f"{SHOW} thresholds_{name}" for name in ("synthetic", "speed")]
            ),
        ],
    ),
    "reliability": Page("Five managers, per flight hour, and what decides", reliability()),
    "tolerant": Page(
        "The fault-tolerant law",
        [
            Section(
                "What it finds, and its false trips",
                [f"{SHOW} tolerant"],
                r"^(?!\| unit lost \| (offset|F |ramp, [25]))",
            ),
            Section("All four pitch-angle sensors fail, worst of twelve flights", ["rig study fault-tolerant"], LAWS),
            Section(
                "A common bias of rates, by both laws",
                ["rig study rate-bias", "rig study rate-bias --seeds 2 --drawn 300"],
                r"^ fault|^ all four pitch|^ all  ",
            ),
        ],
    ),
    "unit": Page(
        "A unit under test: the bits of our manager, how it fails, paced flights",
        [
            Section("Conformance", [UNITS_BUILT, f"rig unit check {UNITS}/monitor.toml"], "requirements, "),
            Section("Bits", [f"{SHOW} unit_identity {UNIT_FILES}"]),
            Section("Failures", [f"{SHOW} unit_failures"]),
            Section("Stopped", [f"{SHOW} unit_stopped {UNITS}/build"]),
            Section("Paced", [f"{SHOW} unit_paced {UNITS}/build/libmonitor.so"]),
        ],
    ),
}


class Run(NamedTuple):
    """One command that was run."""

    command: str
    seconds: float
    printed: str


def machine() -> str:
    """Return processor, cores and system."""
    cpu = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.+)", cpu.read_text(encoding="utf-8")) if cpu.is_file() else None
    processor = model[1] if model else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def run(command: str, folder: str) -> Run:
    """Run a command; SystemExit when it fails."""
    name, *rest = command.format(folder=folder).split()
    own = Path(sys.executable).with_name(name)
    program = [sys.executable] if name == "python" else [str(own) if own.is_file() else name]
    environment = {**os.environ, "COLUMNS": "250", "NO_COLOR": "1"}
    began = perf_counter()
    ended = subprocess.run([*program, *rest], cwd=ROOT, capture_output=True, text=True, env=environment, check=False)
    if ended.returncode:
        sys.exit(f"{command}: exit code {ended.returncode}: {ended.stderr.strip()[-500:]}")
    printed = ended.stdout.replace(folder, "FOLDER").replace(f"{ROOT}/", "").rstrip()
    return Run(command.format(folder="FOLDER"), perf_counter() - began, printed)


def written(section: Section, runs: Sequence[Run], measured: str) -> str:
    """Return a section: its commands, a single line beside its command, then Markdown as it is and the rest as text."""
    text = [f"## {section.title}", ""] + ([measured, ""] if measured else [])
    tables: list[str] = []
    lines: list[str] = []
    for each in runs:
        matching = [line.rstrip() for line in each.printed.splitlines() if re.search(section.keep, line)]
        kept = "\n".join(matching).strip("\n").splitlines()
        text.append(
            f"- `{each.command}` ({each.seconds:.1f} s)" + (f": {' '.join(kept[0].split())}" if len(kept) == 1 else "")
        )
        if len(kept) > 1:
            block = tables if any(line.startswith("|") for line in kept) else lines
            block += ["", *kept] if block else kept
    text += ["", *tables] if tables else []
    text += ["", "```", *lines, "```"] if lines else []
    return "\n".join(text)


def page(name: str) -> str:
    """Run the commands of a page; return it."""
    from rig.core.versions import versions

    numbers = versions()
    packages = ", ".join(
        f"{key.removeprefix('version ')} {number}" for key, number in numbers.items() if "version" in key
    )
    measured = f"Commit `{numbers.get('git commit', 'unknown')[:7]}`, {machine()}; {packages}."
    with TemporaryDirectory(prefix="rig") as folder:
        sections = [
            written(
                section, [run(command, folder) for command in section.commands], measured if i == 0 else "As above."
            )
            for i, section in enumerate(PAGES[name].sections)
        ]
    return "\n\n".join([f"# {PAGES[name].title}", head(name), *sections]) + "\n"


def head(name: str) -> str:
    """Return the first line of a page."""
    return f"Written by `make measured only={name}` at a release; do not edit."


def show(name: str, *arguments: str) -> None:
    """Print a figure."""
    sys.path.insert(0, str(ROOT / "tests"))
    figure: Callable[..., None] = getattr(import_module(f"figures.{FIGURES[name]}"), name)
    figure(*arguments)


def main(arguments: Sequence[str]) -> int:
    """Print a figure, or write pages."""
    names, allowed = (arguments[1:2], FIGURES) if arguments[:1] == ["--show"] else (arguments or list(PAGES), PAGES)
    unknown = [name for name in names if name not in allowed]
    if unknown or not names:
        print(
            f"{(__doc__ or '').strip()}\n\nnot {', '.join(unknown) or 'without a name'}: allowed: {', '.join(allowed)}"
        )
        return 2
    if allowed is FIGURES:
        show(*arguments[1:])
        return 0
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        (FOLDER / f"{name}.md").write_text(page(name), encoding="utf-8")
        print(f"docs/results/measured/{name}.md", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
