"""``rig benchmark``: managers at one false-isolation rate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from rig.cli.common import Json, Seed, Workers, arg, emit, flag, named, opt, resumes, takes_options
from rig.cli.printing import line, table
from rig.cli.working import working
from rig.core.column import Column, columns
from rig.core.errors import BadInput
from rig.core.outputs import require_apart, require_page

Row = dict[str, Any]
_MANAGERS: Final = (
    "cross-channel,cusum tuned,glr tuned,parity tuned,innovation tuned,selection tuned,window_median tuned,median"
)
_AT_ONCE: Final = 24  # losses that are printed


@dataclass(frozen=True, kw_only=True)
class BenchmarkOptions:
    """The options of ``rig benchmark``."""

    campaign: Annotated[str | None, arg("FILE|NAME", "Campaign of faults: file or bundled name.")] = None
    healthy: Annotated[
        Path | None, opt("HEALTHY", "Healthy flights for the calibration: a flown campaign with its logs.")
    ] = None
    out: Annotated[Path | None, resumes("benchmark")] = None
    managers: Annotated[str, opt("NAME,NAME...", "Managers to compare. The built-in one is always included.")] = (
        _MANAGERS
    )
    budget: Annotated[float, opt("RATE", "False isolations per hour and signal, equal for all managers.")] = 0.01
    second: Annotated[Path | None, opt("HEALTHY", "Second set of healthy flights, on which the rates are tested.")] = (
        None
    )
    trials: Annotated[int, opt("N", "Trials of each combination of fault and size.", min=1, max=10**6)] = 500
    flights: Annotated[int, opt("N", "Closed-loop flights of the same draws.", min=0)] = 0
    plot: Annotated[Path | None, opt("FILE", "Page with the pictures, .html.")] = None
    recordings: Annotated[
        list[Path] | None,
        opt("INPUT", "Healthy recordings instead of campaigns; each half calibrates, the other tests. Repeatable."),
    ] = None
    config: Annotated[Path | None, opt("CONFIG", "Settings of the recordings, as for rig vote.")] = None
    align: Annotated[bool, flag("--align", "Remove the constant delays and offsets of the recorded channels.")] = False
    repair_time: Annotated[bool, flag("--repair-time", "Drop rows whose time repeats or is out of order.")] = False
    seed: Seed = 0
    workers: Workers = 2
    as_json: Json = False


@takes_options
def benchmark(options: BenchmarkOptions) -> None:
    """Compare redundancy managers at one false-isolation rate and with the same faults."""
    given = {"CAMPAIGN": options.campaign, "--healthy": options.healthy, "--out": options.out}
    if options.recordings:
        refused = {**given, "--second": options.second, "--plot": options.plot}
        for name in (name for name, value in refused.items() if value is not None):
            raise BadInput(f"{name}: not with --recordings")
        for name in ("budget", "trials", "flights", "seed"):
            if getattr(options, name) != getattr(BenchmarkOptions, name):
                raise BadInput(f"--{name}: not with --recordings")
        _recordings(options.recordings, options)
        return
    for name in (name for name, value in given.items() if value is None):
        raise BadInput(
            f"{name}: missing; a benchmark needs CAMPAIGN, --healthy and --out, or --recordings with --config"
        )
    assert options.campaign is not None and options.healthy is not None and options.out is not None
    _flights(options.campaign, options.healthy, options.out, options)


def _flights(campaign: str, healthy: Path, out: Path, options: BenchmarkOptions) -> None:
    """Run a benchmark of a campaign, print it, and draw it."""
    from rig.studies.benchmark.entrants import entrants
    from rig.studies.benchmark.prepared import Asked
    from rig.studies.benchmark.run_benchmark import run
    from rig.studies.campaign.plan import read_plan

    asked = named(Asked, options, entrants=entrants(options.managers), budget_per_h=options.budget, healthy=healthy)
    plan = read_plan(campaign)
    require_apart({"--out": out, "--plot": options.plot}, [plan.source, healthy, options.second])
    require_page("--plot", options.plot)
    with working("the benchmark", not options.as_json, steps=True):
        result = run(plan, asked, out, options.workers)
        if options.plot is not None:
            from rig.studies.benchmark.benchmark_page import write

            write(options.plot, result)
    emit(options.as_json, result, lambda: _show(result))


def _recordings(inputs: list[Path], options: BenchmarkOptions) -> None:
    """Run a benchmark of recordings and print it."""
    if options.config is None:
        raise BadInput("--recordings: needs --config FILE, the settings as for rig vote")
    from rig.log.recordings.alignment import AlignOptions
    from rig.studies.benchmark.entrants import entrants
    from rig.studies.benchmark.on_recordings import benchmark as of_recordings
    from rig.studies.thresholds.data import load
    from rig.studies.thresholds.in_out import start

    settings, _ = start(options.config)
    baselines = entrants(options.managers)
    align = AlignOptions() if options.align else None
    with working("reading", not options.as_json):
        data = load(inputs, settings, str(options.config), options.repair_time, align)
        result = of_recordings(data, settings, baselines)
    emit(options.as_json, result, lambda: _show_recordings(result))


def _show_recordings(result: dict[str, Any]) -> None:
    """Print the false isolations, and the table of all kinds together and of each kind, by signal."""
    from rig.studies.benchmark.entrants import OURS
    from rig.studies.benchmark.outcome_table import DIFFERENCES, RECORDED

    _show_losses(result["losses"], "with --json")
    line(f"{result['hours']:.3g} h of data; each half calibrates to no false isolation, the other half tests")
    for note in result["notes"]:
        line(f"note: {note}")
    line(f"{result['recordings']} recordings; trials of one are alike, so the intervals are over recordings")
    false = Counter[str]()
    for row in result["levels"]:
        false[row["manager"]] += row["false"]
    table(false.items(), (Column("manager", 0), Column("false isolations in the test halves", 1)))
    if any(":" in name for name in false):
        line("your class is not made again after an isolation: each of its channels counts once a recording")
    for (signal,), rows in _grouped(result["table"], "signal"):
        _show_kinds(signal, rows, RECORDED, ending="")
    line()
    table([row for row in result["differences"] if (row["kind"], row["built_in"]) == ("all", OURS)], DIFFERENCES)


def _show(result: dict[str, Any]) -> None:
    """Print levels, the second campaign, the table by signal and state of the reference, costs, and the verdict."""
    from rig.studies.benchmark.calibration import LEVELS
    from rig.studies.benchmark.healthy_flights import SECOND
    from rig.studies.benchmark.outcome_table import LOSSES, OUTCOMES

    _show_losses(result["losses"])
    line(f"calibrated to {result['budget_per_h']:g} false isolations per hour and signal, on {result['hours']:.3g} h")
    table(result["levels"], LEVELS)
    for note in (note for row in result["levels"] for note in row["notes"]):
        line(f"  {note}")
    line()
    line("isolations caused by transients; each column: duration in frames x size in thresholds")
    if any(":" in row["manager"] for row in result["transients"]):
        line("your class is not made again after an isolation: each of its channels counts once a flight")
    _show_transients(result["transients"])
    if result["second"]:
        line()
        line(f"second campaign, {result['second'][0]['hours']:.3g} h of flight")
        table(result["second"], SECOND)
    for (signal, state), rows in _grouped(result["table"], "signal", "reference"):
        _show_kinds(f"{signal}, reference {state}", rows, OUTCOMES, "" if state == "as flown" else "all")
    for (signal,), rows in _grouped(result["flights"], "signal"):
        _show_kinds(f"{signal}, flown in closed loop", rows, LOSSES, "all")
    costs = ", ".join(f"{name} {microseconds:.2g}" for name, microseconds in result["microseconds"].items())
    line()
    line(f"microseconds per signal and frame on this machine: {costs}")
    line()
    for sentence in result["verdict"][len(result["losses"]) :]:
        line(sentence)


def _show_losses(losses: Sequence[str], rest: str = "in result.json, losses") -> None:
    """Print where the built-in manager loses, the largest first; rest : where those are that are not printed."""
    line("where the built-in manager loses, and by how much")
    for sentence in losses[:_AT_ONCE]:
        line(f"  {sentence}")
    if len(losses) > _AT_ONCE:
        line(f"  {len(losses) - _AT_ONCE} more {rest}")
    line()


def _grouped(rows: Iterable[Row], *keys: str) -> list[tuple[tuple[str, ...], list[Row]]]:
    """Return the rows grouped by the values of ``keys``, in their order of appearance."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return list(groups.items())


def _show_kinds(
    title: str, rows: list[Row], columns: Sequence[Column], only: str = "",
    ending: str = "; sizes and vote error in thresholds",
) -> None:  # fmt: skip
    """Print one table for each kind, or for the kind ``only``; "all": all kinds together."""
    for (kind,), of_kind in _grouped(rows, "kind"):
        if only in ("", kind):
            line()
            line(f"{title}, {'all kinds' if kind == 'all' else kind}{ending}")
            table(of_kind, columns)


def _show_transients(rows: list[Row]) -> None:
    """Print a row for each signal and entrant, a column for each burst."""
    bursts = dict.fromkeys(f"{row['frames']} x {row['thresholds']:g}" for row in rows)
    made = [
        (*pair, *(f"{r['failed']} of {r['bursts']}" for r in of)) for pair, of in _grouped(rows, "signal", "manager")
    ]
    table(made, columns("signal", "manager", *bursts))
