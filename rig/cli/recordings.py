"""``rig vote`` and ``rig thresholds``: vote recorded channels, and design thresholds from them."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from rig.cli.common import Align, AllowCode, Json, arg, comma_list, emit, flag, named, opt, takes_options, whole_numbers
from rig.cli.printing import line, table
from rig.cli.requirements_option import Requirements
from rig.cli.show_slow_tests import show_slow_tests
from rig.cli.working import working
from rig.core.column import KEPT, Column
from rig.core.errors import BadInput
from rig.core.files import write_text
from rig.core.outputs import require_apart, require_ending
from rig.core.text import quoted

if TYPE_CHECKING:
    from rig.studies.thresholds.design import Grid

MOST_FRAMES: Final = 10_000
LEAST_BUDGET: Final = 1e-12  # false isolations an hour
MOST_S: Final = 1e3  # of a filter
_MARKED: Final = 100.0  # extrapolations beyond this are marked


@dataclass(frozen=True, kw_only=True)
class VoteOptions:
    """The options of ``rig vote``."""

    recorded: Annotated[
        Path,
        arg("INPUT", "Recording: CSV, Parquet, MCAP, a log of PX4, ArduPilot, ROS 2 or MDF 4, a folder of tables."),
    ]
    out: Annotated[
        Path | None, opt("FILE", "File for the votes: .csv, .parquet or .mcap. Not needed with --write.")
    ] = None
    config: Annotated[
        Path | None,
        opt(
            "FILE",
            "Configuration with the settings of the signals, TOML.",
            show_default="as in the flight's log, or the preset",
        ),
    ] = None
    preset: Annotated[
        str | None,
        opt("NAME", "Preset for a log of another system: px4, ardupilot or ros2-imu.", show_default="by its format"),
    ] = None
    write: Annotated[
        Path | None, opt("FILE", "Write the configuration of the preset, TOML, to adapt and to use with --config.")
    ] = None
    align: Align
    inject: Annotated[
        str | None, opt("FILE", "Faults to inject into the channels, TOML; prints which are isolated.")
    ] = None
    repair_time: Annotated[
        bool, flag("--repair-time", "Drop rows whose time repeats or is out of order, and print their number.")
    ] = False
    requirements: Requirements = None
    allow_code: AllowCode = False
    as_json: Json = False


@takes_options
def vote(options: VoteOptions) -> None:
    """Vote recorded channels with the redundancy manager, and print which channels it isolates."""
    from rig.bench.vote_run import Options, run
    from rig.cli import show_vote

    if options.write is not None:
        _write_preset(options, options.write)
    if options.out is None:
        if options.write is None:
            raise BadInput("--out: missing; a file for the votes: .csv, .parquet or .mcap")
        return
    requirements = tuple(options.requirements or ())
    how = Options(
        options.align.options(), options.inject, options.repair_time, options.allow_code, requirements, options.preset
    )
    with working("reading", not options.as_json):
        summary = run(options.recorded, options.config, options.out, how)
    emit(options.as_json, summary, lambda: show_vote.vote(summary))


def _write_preset(options: VoteOptions, to: Path) -> None:
    """Write the CONFIG of a preset, and print it if nothing is voted.  BadInput: INPUT is no log of another system."""
    from rig.cli import show_contents
    from rig.log.recordings.formats.known import names, open_log
    from rig.log.recordings.formats.presets import config, text

    if options.config is not None:
        raise BadInput("--write, --config: only one of them")
    require_apart({"--write": to, "--out": options.out}, [options.recorded])
    require_ending("--write", to, "a configuration", ".toml")
    log = open_log(options.recorded)
    if log is None:
        raise BadInput(f"{options.recorded}: --write is for logs of {names()}")
    tables = config(log.contents, options.recorded, options.preset)
    write_text(to, text(tables, log.contents, options.recorded))
    if options.out is None:
        emit(options.as_json, {"written": str(to), **tables}, lambda: show_contents.compared(tables))
    if not options.as_json:
        line(f"written  {to}")


@dataclass(frozen=True, kw_only=True)
class ThresholdsOptions:
    """The options of ``rig thresholds``."""

    inputs: Annotated[
        list[Path], arg("INPUT...", "Healthy recordings, folders of recordings, logs, or the folder of a campaign.")
    ]
    budget: Annotated[float, opt("X", "Allowed false isolations per hour and signal.")]
    out: Annotated[Path, opt("FILE", "File for the configuration with the thresholds, TOML.")]
    config: Annotated[Path | None, opt("FILE", "Configuration, as for rig vote. Not needed for logs of rig fly.")] = (
        None
    )
    persistence: Annotated[str, opt("N,N...", "Persistences to try, frames.")] = "8,12,24,48"
    levels: Annotated[str, opt("N,N...", "Numbers of channels in use to design for.")] = "4,3,2"
    filters: Annotated[str, opt("S,S...", "Low-pass time constants of the comparison to try, s.", "--filter")] = "0,0.1"
    slow_faults: Annotated[str, opt("RULE,RULE...", "Slow-fault rules to try: slow, stale, or none.")] = "slow,stale"
    slow_tests: Annotated[
        bool, flag("--slow-tests", "Also design the slow-fault tests; CONFIG states the noise of a sample.")
    ] = False
    align: Align
    repair_time: Annotated[bool, flag("--repair-time", "Drop rows whose time repeats or is out of order.")] = False
    keep: Annotated[bool, flag("--keep", "Also use flights in which one channel deviates from the others.")] = False
    transients: Annotated[
        bool,
        flag("--transients", "Keep thresholds above single-frame noise, so that short transients isolate no channel."),
    ] = False
    keep_thresholds: Annotated[
        bool,
        flag("--keep-thresholds", "Keep thresholds, persistence and filter as given; design only the rest."),
    ] = False
    monitored: Annotated[
        list[Path] | None,
        opt(
            "FILE",
            "Recording on which the thresholds will be used; warns if it moves more than the design data. Repeatable.",
        ),
    ] = None
    plot: Annotated[Path | None, opt("FILE", "Page with the trade-off, .html.")] = None
    seed: Annotated[int, opt("N", "Seed of the bootstrap.", min=0)] = 0
    as_json: Json = False


@takes_options
def thresholds(options: ThresholdsOptions) -> None:
    """Design thresholds from healthy recordings, so that false isolations stay within an hourly rate."""
    from rig.studies.thresholds.design_run import Options, run

    grid, align = _grid(options), options.align.options()
    how = named(Options, options, page=options.plot, grid=grid, align=align, monitored=options.monitored or [])
    with working("reading", not options.as_json):
        summary = run(how)
    emit(options.as_json, summary, lambda: _show(summary))


def _grid(options: ThresholdsOptions) -> Grid:
    """Return the designs to try."""
    from rig.studies.thresholds.design import Grid

    if not (isfinite(options.budget) and options.budget >= LEAST_BUDGET):
        raise BadInput(f"--budget: must be {LEAST_BUDGET:g} or more false isolations per hour, got {options.budget}")
    frames = whole_numbers("--persistence", options.persistence, 1, MOST_FRAMES)
    counts = whole_numbers("--levels", options.levels, 2, 4)
    rules, kept = _rules(options.slow_faults), options.keep_thresholds
    if kept and not (rules or options.slow_tests):
        raise BadInput("--keep-thresholds: nothing is left to design; add --slow-tests, or rules to --slow-faults")
    allowed = f"seconds from 0 to {MOST_S:.0f}"
    filters = comma_list("--filter", options.filters, allowed, float, lambda value: 0.0 <= value <= MOST_S)
    return Grid(options.budget, frames, counts, sorted(set(filters)), options.seed, rules, options.transients, kept)


def _rules(text: str) -> list[Any]:
    """Return the slow-fault rules that ``text`` names."""
    from rig.studies.thresholds.slow_fault_limits import RULES

    if text.strip() == "none":
        return []
    named = {name.strip() for name in text.split(",")}
    if "bias" in named:
        raise BadInput("--slow-faults: the rule bias is gone: --slow-tests learns the biases of channels")
    if unknown := sorted(named.difference(RULES)):
        raise BadInput(f"--slow-faults: must be none alone, or of {', '.join(RULES)}, got {quoted(unknown[0])}")
    return [rule for rule in RULES if rule in named]


def _show(summary: dict[str, Any]) -> None:
    """Print the thresholds of each signal, the faults that they isolate, the hold-out check and the remarks."""
    signals = summary["signals"]
    hours, flights = f"{summary['hours']:.4g} h", f"{summary['flights']} recordings"
    line(f"{summary['budget_per_h']:g} false isolations per hour and signal, designed from {hours} in {flights}")
    for name, signal in signals.items():
        if signal["designs"]:
            line()
            line(f"{name}: threshold (95 % upper bound) and point estimate, {signal['unit'] or 'unit of the signal'}")
            table(_level_rows(signal), _LEVELS)
    _tradeoffs(signals)
    line(f"chosen (>): {summary['rule']}")
    held_out = [(name, level, count) for name, signal in signals.items() for level, count in signal["hold_out"].items()]
    if held_out:
        line()
        line("hold-out: one half designs, the other half counts false isolations, both ways")
        table(held_out, _HOLD_OUT)
    show_slow_tests(signals)
    line()
    line("motion of the data, 95 %: the thresholds are valid only for data that move no more than this")
    table(({"signal": name, **signal["motion"]} for name, signal in signals.items()), _MOTION)
    for note in summary["notes"]:
        line(f"note: {note}")
    line(", ".join(f"{stage} {taken:.2f} s" for stage, taken in summary["seconds"].items()))
    line(f"written  {summary['out']}")


def _chosen(signal: dict[str, Any], design: dict[str, Any]) -> str:
    chosen = signal["chosen"]
    keys = ("slow_limit",) if design["kept"] else ("persistence", "filter_s", "slow_limit")
    same = chosen is not None and all(chosen.get(key) == design[key] for key in keys)
    return ">" if same else ""


def _level_rows(signal: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a row for each design and level; the first row has the figures of the design."""
    rows = []
    for design in signal["designs"]:
        mark = "*" if design["extrapolation"] > _MARKED else ""
        once = {**design, "chosen": _chosen(signal, design), "beyond": f"{design['extrapolation']:.3g}{mark}"}
        for i, (level, of) in enumerate(design["levels"].items()):
            threshold = f"{of['upper']:.4g}{mark}"
            rows.append({**of, "level": level, "threshold": threshold, "design": {} if i else once})
    return rows


def _of_design(title: str, key: str, format: str = "", unit: str = "", worth: int = KEPT) -> Column:
    """Return a column of a figure that a design has once."""
    return Column(title, lambda row: row["design"].get(key), format, unit, worth=worth)


_LEVELS: Final = (
    *(_of_design("", "chosen"), _of_design("filter", "filter_s", "g", "s"), _of_design("frames", "persistence")),
    _of_design("sum", "slow_limit", ".3g", worth=8),
    *(Column("in use", "level"), Column("threshold"), Column("point", format=".4g")),
    *(Column("clusters", worth=6), Column("shape", format=".2f", worth=5)),
    _of_design("extrapolation", "beyond", worth=7),
)
_HOLD_OUT: Final = (
    *(Column("signal", 0), Column("in use", 1), Column("counted", lambda row: row[2]["counted"])),
    Column("budget allows", lambda row: row[2]["expected"], ".3g"),
    Column("", lambda row: "over" if row[2]["significantly_over"] else ""),
)
_MOTION: Final = (
    *(Column("signal"), Column("from its median", "value", ".4g"), Column("per second", "rate_per_s", ".4g")),
    *(Column("between channels", "noise", ".4g", worth=7), Column("", lambda row: "at rest" if row["still"] else "")),
)


def _tradeoffs(signals: dict[str, Any]) -> None:
    """Print how many faults injected into the same data each design isolates."""
    rows = [
        {"chosen": _chosen(signal, design), "signal": name, **design, **design["tradeoff"]}
        for name, signal in signals.items()
        for design in signal["designs"]
        if design["tradeoff"] is not None
    ]
    if not rows:
        return
    faults = (Column(kind, lambda row, kind=kind: _right(row["faults"][kind]), worth=5) for kind in rows[-1]["faults"])
    shown = (
        *(Column("", "chosen"), Column("signal"), Column("filter", "filter_s", "g", "s")),
        *(Column("frames", "persistence"), Column("sum", "slow_limit", ".3g")),
        *(Column("stale", "stale_frames", worth=8), Column("smallest offset", format=".3g", empty="none")),
        Column("delay at 2 T", "at_twice_the_threshold.delay_s", ".3g", "s", "none", worth=7),
        *(*faults, Column("share", "correctly_isolated", ".3f")),
    )
    line()
    line("faults injected into the same data: correctly isolated (offsets as fractions of the motion)")
    table(rows, shown)


def _right(fault: dict[str, Any]) -> str:
    of = fault["correct"] + fault["wrong"] + fault["missed"]
    return f"{fault['correct']}/{of}" + (f" -{fault['wrong']}" if fault["wrong"] else "")
