"""``rig league``: managers at one price."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from typer import Argument, Option

from rig.cli.common import Json, Seed, Workers, emit, takes_options
from rig.cli.table import Column, line, table
from rig.cli.working import working
from rig.errors import BadInput
from rig.util.outputs import require_apart, require_page

_MANAGERS: Final = "cross-channel,cusum,glr,parity,innovation,selection,median"
_LEVELS: Final = (
    *(Column("signal", "signal"), Column("manager", "entrant")),
    Column("told", lambda row: ", ".join(f"{name} {value:.4g}" for name, value in row["shown"].items())),
    *(Column("events", "clusters", worth=7), Column("extrapolated", "extrapolation", ".3g", "times", worth=8)),
    Column("seen", "seen", worth=6),
)
_SECOND: Final = (
    *(Column("signal", "signal"), Column("manager", "entrant"), Column("false isolations", "counted")),
    *(
        Column("budget", "expected", ".2g"),
        Column("an hour, 95 %", lambda r: f"{r['low_per_h']:.2g} to {r['high_per_h']:.2g}"),
        Column("flights over the level of three", lambda r: _of_three(r, "three", "flights"), worth=7),
        Column("of it, calibration", lambda r: _of_three(r, "three_before", "of"), worth=6),
    ),
)
_OUTCOMES: Final = (
    *(Column("faults", "faults"), Column("manager", "entrant")),
    *(
        Column(word, lambda row, word=word: 100 * row[word] / row["trials"], ".1f", "%")
        for word in ("isolated", "wrong channel", "missed")
    ),
    Column("before", lambda row: 100 * row["prior"] / row["trials"], ".1f", "%", worth=8),
    *(Column("delay", "delay_median_s", ".2f", "s"), Column("95 %", "delay_95_s", ".2f", "s", worth=7)),
    *(
        Column("50 %", lambda row: _size(row, 0), ".2f", worth=7),
        Column("95 %", lambda row: _size(row, 1), ".2f", worth=7),
    ),
    *(Column("vote off", "peak_median", ".2f", worth=6), Column("most", "peak_largest", ".3g", worth=5)),
)
_LOST: Final = Column("aircraft lost", "lost")


def _of_three(row: dict[str, Any], count: str, flights: str) -> str | None:
    return None if row[count] is None else f"{row[count]} of {row[flights]}"


def _size(row: dict[str, Any], place: int) -> float | None:
    return None if row["sizes"] is None else row["sizes"][place]["value"]


@dataclass(frozen=True, kw_only=True)
class LeagueOptions:
    """The options of ``rig league``."""

    campaign: Annotated[
        str | None,
        Argument(metavar="FILE|NAME", help="A campaign of faults: file or bundled name.", show_default=False),
    ] = None
    healthy: Annotated[
        Path | None,
        Option(metavar="HEALTHY", help="Healthy flights: a flown campaign with its logs.", show_default=False),
    ] = None
    out: Annotated[
        Path | None, Option(metavar="DIR", help="Folder of the league; a begun one is continued.", show_default=False)
    ] = None
    managers: Annotated[str, Option(metavar="NAME,NAME...", help="Who takes part; ours always does.")] = _MANAGERS
    budget: Annotated[float, Option(metavar="RATE", help="False isolations an hour and signal.")] = 0.01
    second: Annotated[
        Path | None,
        Option(metavar="HEALTHY", help="Other healthy flights, to test the budget on.", show_default=False),
    ] = None
    trials: Annotated[int, Option(metavar="N", help="Trials of each combination.", min=1, max=10**6)] = 500
    flights: Annotated[int, Option(metavar="N", help="Flights in closed loop, of the same draws.", min=0)] = 0
    plot: Annotated[Path | None, Option(metavar="FILE", help="The pictures as a page: .html.", show_default=False)] = (
        None
    )
    recordings: Annotated[
        list[Path] | None,
        Option(metavar="INPUT", help="In place of all that: healthy recordings, a half each.", show_default=False),
    ] = None
    config: Annotated[
        Path | None, Option(metavar="CONFIG", help="Their settings, as for rig vote.", show_default=False)
    ] = None
    align: Annotated[bool, Option("--align", help="Take constant delays and offsets off their channels.")] = False
    repair_time: Annotated[bool, Option("--repair-time", help="Drop rows whose time repeats.")] = False
    seed: Seed = 0
    workers: Workers = 2
    as_json: Json = False


@takes_options
def league(options: LeagueOptions) -> None:
    """Calibrate managers to one budget of false isolations, and give all of them the same faults."""
    given = {"CAMPAIGN": options.campaign, "--healthy": options.healthy, "--out": options.out}
    if options.recordings:
        refused = {**given, "--second": options.second, "--plot": options.plot}
        for name in (name for name, value in refused.items() if value is not None):
            raise BadInput(f"--recordings: a league of recordings has no {name}")
        _recordings(options.recordings, options)
        return
    for name in (name for name, value in given.items() if value is None):
        raise BadInput(f"rig league: {name} is needed, or --recordings with --config")
    assert options.campaign is not None and options.healthy is not None and options.out is not None
    _flights(options.campaign, options.healthy, options.out, options)


def _flights(campaign: str, healthy: Path, out: Path, options: LeagueOptions) -> None:
    """Run a league of a campaign, print it, and draw it."""
    from rig.campaign.config import find, read
    from rig.campaign.plan import Plan
    from rig.league.entrants import entrants
    from rig.league.prepared import Asked
    from rig.league.run import run

    asked = Asked(
        entrants=entrants(options.managers),
        budget_per_h=options.budget,
        healthy=healthy,
        second=options.second,
        trials=options.trials,
        seed=options.seed,
        flights=options.flights,
    )
    plan = Plan(read(campaign, {}), str(find(campaign)))
    require_apart({"--out": out, "--plot": options.plot}, [find(campaign), healthy, options.second])
    require_page("--plot", options.plot)
    with working("the league", not options.as_json, steps=True):
        result = run(plan, asked, out, options.workers)
        if options.plot is not None:
            from rig.league.league_page import write

            write(options.plot, result)
    emit(options.as_json, result, lambda: _show(result))


def _recordings(inputs: list[Path], options: LeagueOptions) -> None:
    """Run a league of recordings and print it."""
    if options.config is None:
        raise BadInput("--recordings: needs --config, the settings of rig vote")
    from rig.league.entrants import entrants
    from rig.league.recorded import league as of_recordings
    from rig.recordings.alignment import AlignOptions
    from rig.thresholds.config import start
    from rig.thresholds.data import load

    settings, _ = start(options.config)
    rivals = entrants(options.managers)
    align = AlignOptions() if options.align else None
    with working("reading", not options.as_json):
        data = load(inputs, settings, str(options.config), options.repair_time, align)
        result = of_recordings(data, settings, rivals)
    emit(options.as_json, result, lambda: _show_recordings(result))


def _show_recordings(result: dict[str, Any]) -> None:
    """Print false isolations, and the table of all kinds and of each, by signal."""
    from rig.league.entrants import OURS

    line(f"{result['hours']:.3g} h; each half calibrates to no false isolation, and is tested by the other")
    names = dict.fromkeys(row["entrant"] for row in result["levels"])
    false = [
        {"entrant": name, "false": sum(row["false"] for row in result["levels"] if row["entrant"] == name)}
        for name in names
    ]
    table(false, (Column("manager", "entrant"), Column("false isolations in the tested halves", "false")))
    for signal in dict.fromkeys(row["signal"] for row in result["table"]):
        rows = [row for row in result["table"] if row["signal"] == signal]
        _show_kinds(signal, rows, _OUTCOMES[:7], all_kinds=True, ending="")
    line()
    differ = [row for row in result["differences"] if row["kind"] == "all" and row["ours"] == OURS]
    table(
        differ,
        (
            *(Column("signal", "signal"), Column("manager", "entrant"), Column("trials", "trials")),
            Column("isolated, less ours", lambda row: 100 * row["value"], "+.1f", "points"),
            Column("95 %", lambda row: f"{100 * row['low']:.1f} to {100 * row['high']:.1f}"),
        ),
    )


def _show(result: dict[str, Any]) -> None:
    """Print levels, the second campaign, the table by signal and state of the reference, costs, and the verdict."""
    line(f"calibrated to {result['budget_per_h']:g} false isolations an hour and signal, on {result['hours']:.3g} h")
    table(result["levels"], _LEVELS)
    for note in (note for row in result["levels"] for note in row["notes"]):
        line(f"  {note}")
    line()
    line("bursts that make somebody be failed, by their frames and thresholds")
    _show_transients(result["transients"])
    if result["second"]:
        line()
        line(f"a second campaign of {result['second'][0]['hours']:.3g} h")
        table(result["second"], _SECOND)
    for signal, state in dict.fromkeys((row["signal"], row["reference"]) for row in result["table"]):
        rows = [row for row in result["table"] if (row["signal"], row["reference"]) == (signal, state)]
        _show_kinds(f"{signal}, reference {state}", rows, _OUTCOMES, all_kinds=state == "as flown")
    for signal in dict.fromkeys(row["signal"] for row in result["flights"]):
        rows = [row for row in result["flights"] if row["signal"] == signal and row["kind"] == "all"]
        _show_kinds(f"{signal}, flown in closed loop", rows, (*_OUTCOMES, _LOST), all_kinds=False)
    line()
    costs = ", ".join(f"{name} {microseconds:.2g}" for name, microseconds in result["microseconds"].items())
    line(f"microseconds a signal and frame, here: {costs}")
    line()
    for sentence in result["verdict"]:
        line(sentence)


def _show_kinds(
    title: str,
    rows: list[dict[str, Any]],
    columns: Sequence[Column],
    all_kinds: bool,
    ending: str = "; sizes and vote error in thresholds",
) -> None:
    """Print one table for each kind, or of all kinds together alone."""
    for kind in dict.fromkeys(row["kind"] for row in rows):
        if all_kinds or kind == "all":
            line()
            line(f"{title}, {'all kinds' if kind == 'all' else kind}{ending}")
            table([row for row in rows if row["kind"] == kind], columns)


def _show_transients(rows: list[dict[str, Any]]) -> None:
    """Print a row for each signal and entrant, a column for each burst."""
    by_pair: dict[tuple[str, str], dict[str, Any]] = {}
    for row in rows:
        pair = by_pair.setdefault((row["signal"], row["entrant"]), {})
        pair[f"{row['frames']} x {row['thresholds']:g}"] = f"{row['failed']} of {row['bursts']}"
    made = [{"signal": signal, "entrant": name, **cells} for (signal, name), cells in by_pair.items()]
    bursts = [name for name in (made[0] if made else {}) if name not in ("signal", "entrant")]
    table(made, (Column("signal", "signal"), Column("manager", "entrant"), *(_burst(name) for name in bursts)))


def _burst(name: str) -> Column:
    return Column(name, lambda row: row[name])
