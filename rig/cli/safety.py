"""``rig reliability tree``, ``cutsets``, ``fmea``, ``confirm`` and ``report``: the safety case."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from rig.cli.common import (
    AllowCode,
    Json,
    Seed,
    Sets,
    Workers,
    arg,
    comma_list,
    emit,
    flag,
    named,
    names,
    opt,
    require_ended,
    resumes,
    takes_options,
)
from rig.cli.printing import line, table
from rig.cli.reliability import RatesFile, SignalName, reliability_app
from rig.cli.working import working
from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.outputs import CUTSETS, SETS, require_apart, require_page
from rig.core.progress import tell
from rig.core.trust import Trust

if TYPE_CHECKING:
    from rig.studies.campaign.run_campaign import Result
    from rig.studies.safety.cutset_plan import Asked
    from rig.studies.safety.cutsets import Counts, CutSet
    from rig.studies.safety.tree_result import TreeResult

MOST_HOURS: Final = 1e5
MOST_ORDER: Final = 3
HOURS: Final = "1,10,100,1000"
CONDITIONS: Final = "manoeuvre-settled,manoeuvre-near,level-settled,level-then-manoeuvre-settled"


@reliability_app.command()
def tree(
    folders: Annotated[
        list[Path], arg("DIR...", "Folders of flown campaigns or trials of one manager, or one folder of cut sets.")
    ],
    rates: RatesFile,
    out: Annotated[Path, opt("FILE", "File for the fault tree, Open-PSA XML.")],
    channels: Annotated[int, opt("N", "Number of channels of the signal.", min=1, max=4)] = 4,
    hours: Annotated[str, opt("H,H...", "Durations of a flight, h.")] = HOURS,
    signal: SignalName = None,
    chain: Annotated[Path | None, opt("FILE", "File for the same model as a Markov chain, TOML.")] = None,
    svg: Annotated[Path | None, opt("FILE", "File for a picture of the tree, .svg.")] = None,
    as_json: Json = False,
) -> None:
    """Write the loss of a signal as a fault tree, and print its probability beside that of the Markov chain."""
    from rig.studies.reliability.rates_file import read_rates
    from rig.studies.safety.tree_result import write

    require_apart({"--out": out, "--chain": chain, "--svg": svg}, [*folders, rates])
    name, _ = read_rates(rates).of(signal, str(rates))
    with working("building the tree", not as_json):
        result = _tree(folders, rates, name, channels, hours)
    write(result, out, chain, svg)
    emit(as_json, {"out": str(out), "signal": name, "channels": channels, **result.as_dict()}, lambda: _show(result))


def _tree(folders: Sequence[Path], rates: Path, signal: str, channels: int, hours: str) -> TreeResult:
    """Return the tree of a signal and its chain; ``hours``: the text of the option."""
    from rig.core.files import is_file
    from rig.studies.reliability.rates_file import read_rates
    from rig.studies.safety.mode_tree import mode_chain, mode_tree, read_mode_model
    from rig.studies.safety.signal_chain import transitions
    from rig.studies.safety.signal_tree import signal_tree
    from rig.studies.safety.tree_input import read_model
    from rig.studies.safety.tree_result import solve

    allowed = f"hours above 0 and at most {MOST_HOURS:g}"
    flights = comma_list("--hours", hours, allowed, float, lambda h: isfinite(h) and 0.0 < h <= MOST_HOURS)
    if len(folders) == 1 and is_file(folders[0] / CUTSETS):
        given = read_rates(rates).signals[signal]
        sets = read_mode_model(folders[0], given, signal, channels, min(flights), str(rates))
        named = {", ".join(modes): chance for modes, chance in sets.sets().items()}
        return solve(mode_tree(sets), mode_chain(sets), flights, named)
    model = read_model(folders, read_rates(rates), signal, channels, min(flights), str(rates))
    not_correct = {f"{good} good": model.next_fault(good) for good in range(channels, 0, -1)}
    return solve(signal_tree(model), transitions(model), flights, not_correct)


def _show(result: TreeResult) -> None:
    """Print both probabilities, the difference of the tree from the chain, and the chances in the tree."""
    from rig.studies.safety.tree_result import AT

    table(result.at, AT)
    most = max((abs(each.differs) for each in result.at), default=0.0)
    line(f"static tree: {result.static}, differs from the chain by at most {100 * most:.2g} %")
    line("not correct: " + "; ".join(f"{good} {chance:.3g}" for good, chance in result.not_correct.items()))


@dataclass(frozen=True, kw_only=True)
class CutsetOptions:
    """The options of ``rig reliability cutsets``."""

    out: Annotated[Path, resumes("enumeration")]
    signal: Annotated[str, opt("SIGNAL", "Signal, as in rig signals.")] = "pitch_rate"
    aircraft: Annotated[str, opt("NAME", "Aircraft, as in rig aircraft list.")] = "f16"
    order: Annotated[int, opt("N", "Largest number of faults in a sequence, 1 to 3.")] = 3
    flights: Annotated[int, opt("N", "Flights of each sequence in each condition.", min=1, max=10000)] = 20
    conditions: Annotated[str, opt("NAME,NAME...", "Flight conditions and gaps between the faults.")] = CONDITIONS
    seed: Seed = 0
    workers: Workers = 2
    sets: Sets = None
    as_json: Json = False


def cutsets(options: CutsetOptions) -> None:
    """Fly all sequences of up to three faults of a signal, and print the minimal sets that lose it."""
    from rig.scenario.overrides import named_manager
    from rig.studies.safety.confirm_sets import write_sets
    from rig.studies.safety.cutset_plan import fly
    from rig.studies.safety.cutsets import minimal, of_folder

    asked = _asked(options)
    trust = Trust("cutsets", named=named_manager(asked.set.items()))
    with working("flying the sequences", not options.as_json, steps=True):
        results = fly(asked, options.out, options.workers, trust)
    _require_flown(results)
    _, counted = of_folder(options.out)
    cut_sets = minimal(asked, counted)
    flown = {name: {"sequences": len(of), "flights": sum(c.flown for c in of.values())} for name, of in counted.items()}
    whole = {**asked.as_dict(), "flown": flown, "sets": [each.as_dict() for each in cut_sets]}
    write_sets(options.out, whole)
    emit(options.as_json, {"out": str(options.out), **whole}, lambda: _show_sets(counted, cut_sets))


reliability_app.command()(takes_options(cutsets))  # report calls it too, with other options


def _asked(options: CutsetOptions) -> Asked:
    """Return the enumeration that the options name.  BadInput: an option that names none."""
    from rig.scenario.overrides import parse_set
    from rig.studies.safety.cutset_plan import Asked, require

    if not 1 <= options.order <= MOST_ORDER:
        raise BadInput(f"--order {options.order}: must be from 1 to {MOST_ORDER}")
    conditions, keys = tuple(names("--conditions", options.conditions)), dict(map(parse_set, options.sets or ()))
    asked = named(Asked, options, conditions=conditions, set=keys)
    require(asked)
    return asked


@reliability_app.command()
def confirm(
    folder: Annotated[Path, arg("DIR", "Output folder of rig reliability cutsets.")],
    aircraft: Annotated[
        str | None, opt("NAME,NAME...", "Aircraft that fly the sets.", show_default="as in the folder")
    ] = None,
    points: Annotated[str, opt("NAME,NAME...", "Their flight points.", show_default="default of each")] = "",
    flights: Annotated[int, opt("N", "Flights of each sequence.", min=1, max=10000)] = 20,
    seed: Annotated[int, opt("N", "Seed; must differ from that of cutsets.", min=0, max=2**63 - 1)] = 1,
    workers: Workers = 2,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Fly every order and subset of the minimal cut sets with new seeds, and print disagreements first."""
    from rig.studies.safety import confirm_sets as again
    from rig.studies.safety.cutset_plan import read_asked

    asked, cut_sets = read_asked(folder), again.claims(folder)
    if not cut_sets:
        raise BadInput(f"{folder}: has no minimal cut set to confirm")
    made = again.plans(
        asked,
        cut_sets,
        names("--aircraft", aircraft or asked.aircraft),
        names("--points", points) if points else [],
        flights,
        seed,
        Trust(str(folder / CUTSETS), allow_code),
    )
    with working("flying the sets again", not as_json, steps=True):
        results = again.fly(folder, made, workers)
    _require_flown(results)
    compared = again.rows(folder, asked.signal, cut_sets, made)
    again.write_rows(folder, compared)
    told, agree = [row.as_dict() for row in compared], sum(row.agrees for row in compared)
    data = {"folder": str(folder), "rows": told, "agree": agree, "disagree": len(told) - agree}
    emit(as_json, data, lambda: _show_confirmed(told, agree))


def _show_confirmed(rows: Sequence[dict[str, Any]], agree: int) -> None:
    """Print the rows, and how many agree."""
    from rig.studies.safety.confirm_sets import CONFIRMED_ROWS

    table(rows, CONFIRMED_ROWS)
    counts = f"{agree} agree, {len(rows) - agree} disagree"
    line(f"{len(rows)} rows: {counts} (Fisher's exact test, 0.01 / rows)")


@reliability_app.command()
def fmea(
    folders: Annotated[list[Path], arg("DIR...", "Folders of flown campaigns with single faults.")],
    rates: RatesFile,
    out: Annotated[Path, opt("FILE", "Table, .csv, or page, .html.")],
    as_json: Json = False,
) -> None:
    """Write the failure modes and effects of all items, and the flights that show each of them."""
    from rig.studies.reliability.rates_file import read_rates
    from rig.studies.safety.fmea import lines, require_ending, shown, write

    require_apart({"--out": out}, [*folders, rates])
    require_ending(out)
    with working("gathering the lines", not as_json):
        made = lines(folders, read_rates(rates), str(rates))
    write(made, out)
    emit(as_json, {"out": str(out), "lines": made}, lambda: line(f"{shown(made)}: {out}"))


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """The options of ``rig reliability report``."""

    folder: Annotated[Path, arg("DIR", "Output folder of rig reliability cutsets.")]
    cells: Annotated[list[Path], opt("DIR", "Folder of the flown campaign reliability, or of trials. Repeatable.")]
    faults: Annotated[list[Path], opt("DIR", "Folder of a flown campaign of single faults. Repeatable.")]
    rates: RatesFile
    out: Annotated[Path, opt("FILE", "Page to write, .html.")]
    channels: Annotated[int, opt("N", "Number of channels of the signal.", min=1, max=4)] = 4
    hours: Annotated[str, opt("H,H...", "Durations of a flight, h.")] = HOURS
    signal: SignalName = None
    fly: Annotated[bool, flag("--fly", "Fly the missing flights first, and confirm the sets.")] = False
    flights: Annotated[int, opt("N", "With --fly: flights of each sequence.", min=1, max=10000)] = 20
    conditions: Annotated[str, opt("NAME,NAME...", "With --fly: flight conditions and gaps between the faults.")] = (
        CONDITIONS
    )
    sets: Sets = None
    workers: Workers = 2


@reliability_app.command()
@takes_options
def report(options: ReportOptions) -> None:
    """Write the safety case as one page: cut sets, fault tree, Markov chain, FMEA and confirmation."""
    from rig.studies.reliability.rates_file import read_rates
    from rig.studies.safety.case_page import read_flown, write_case
    from rig.studies.safety.fmea import lines
    from rig.studies.safety.tree_input import assumptions

    file, out = str(options.rates), options.out
    require_apart({"--out": out}, [options.folder, *options.cells, *options.faults, file])
    require_page("--out", out)
    rates = read_rates(options.rates)
    name, _ = rates.of(options.signal, file)
    if options.fly:
        _fly_missing(options, name)
    with working("writing the safety case", enabled=True):
        flown, fmea_lines = read_flown(options.folder, name), lines(options.faults, rates, file)
        result = _tree(options.cells, options.rates, name, options.channels, options.hours)  # last: it takes a while
        write_case(flown, result, fmea_lines, assumptions(rates, name, result), out)
    line(f"safety case: {out}")


def _fly_missing(options: ReportOptions, signal: str) -> None:
    """Fly the missing flights of the campaigns and of the sets, and confirm the sets."""
    for campaign, folder in (("reliability", options.cells[0]), ("fmea", options.faults[0])):
        _fly_campaign(campaign, folder, options.sets, options.workers)
    cutsets(named(CutsetOptions, options, out=options.folder, signal=signal))
    if json.loads((options.folder / SETS).read_text())["sets"]:
        confirm(options.folder, flights=options.flights, workers=options.workers, allow_code=True)  # of these --set


def _fly_campaign(name: str, out: Path, sets: list[str] | None, workers: int) -> None:
    """Fly the missing flights of a bundled campaign."""
    from rig.studies.campaign.plan import read_plan
    from rig.studies.campaign.run_campaign import run

    plan = read_plan(name, sets)
    with working(f"flying {name}", enabled=True, steps=True):
        _require_flown([run(plan, out, workers=workers, report=lambda p: tell(f"flights of {name}", p.done, p.runs))])


def _require_flown(results: Sequence[Result]) -> None:
    for each in (results[-1], *results):  # only the last can be interrupted
        require_ended(each, f"{each.done} of {each.runs} flights of {each.out.name}")


_SETS = (
    *(Column("condition"), Column("gap"), Column("modes by onset", lambda s: ", ".join(s.modes))),
    Column("lost", lambda s: f"{s.whole.lost} of {s.whole.flown}"),
    Column("95 %", lambda s: "{:.3f} to {:.3f}".format(*s.as_dict()["interval"])),
    Column("wrong vote first", "whole.wrong_vote", worth=7),
    Column("aircraft lost", "whole.aircraft_lost", worth=8),
    Column("orders that never lose", lambda s: sum(c.lost == 0 for c in s.orders.values()) or "", worth=6),
)


def _show_sets(counted: Mapping[str, Counts], cut_sets: Sequence[CutSet]) -> None:
    """Print the numbers of flights, and the minimal sets."""
    for name, of in counted.items():
        lost, flown = (sum(getattr(each, what) for each in of.values()) for what in ("lost", "flown"))
        line(f"{name}: {len(of)} sequences, {lost} of {flown} flights lose the signal")
    line()
    table(cut_sets, _SETS)
    line("a set is minimal if the lower end of its interval is above the upper ends of all its proper subsets")
