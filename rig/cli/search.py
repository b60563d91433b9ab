"""``rig search``: the worst case in the ranges of a campaign."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from rig.cli import complete
from rig.cli.common import (
    AllowCodeOrSet,
    Json,
    Scheduler,
    Seed,
    Sets,
    UnitFile,
    Workers,
    arg,
    emit,
    flag,
    named,
    opt,
    require_ended,
    resumes,
    takes_options,
)
from rig.cli.printing import field, robustness_told, share_told
from rig.cli.search_plant import search_a_plant
from rig.cli.working import working
from rig.core.errors import BadInput

if TYPE_CHECKING:
    from rig.studies.search.run_search import Ended
    from rig.studies.search.search_plan import SearchPlan

_WIDTH: Final = 11


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """The options of ``rig search``."""

    campaign: Annotated[
        str,
        arg(
            "FILE|NAME",
            "Campaign whose ranges are searched, within each combination of its cases; with --plant a plan.",
            autocompletion=complete.campaigns,
        ),
    ]
    flights: Annotated[int, opt("N", "Number of flights, or simulations, of the search.", min=1, max=10**6)]
    out: Annotated[Path, resumes("search")]
    requirement: Annotated[
        list[str] | None,
        opt(
            "ID",
            "Requirement to violate. Repeat it to accept any of several.",
            show_default="with --plant all of the plan",
        ),
    ] = None
    plant: Annotated[
        str | None,
        opt("FILE.py:FUNCTION", "Search over a Python function instead of flights. Its code is run."),
    ] = None
    method: Annotated[str, opt("regions|cma|random", "Method that chooses the flights after the first ones.")] = (
        "regions"
    )
    against: Annotated[str | None, opt("KEY=VALUE", "Keep only flights that do not violate with this override.")] = None
    requirements: Annotated[
        list[str] | None,
        opt("NAME|FILE", "Files that define the requirement IDs. Repeatable.", show_default="all bundled sets"),
    ] = None
    bench: Annotated[
        bool, flag("--bench", "Search in open loop: one signal, on the true values of a healthy flight.")
    ] = False
    trials_first: Annotated[
        bool | None,
        flag(
            "--trials-first/--no-trials-first",
            "Search in open loop first, ten times as long; begin flights at what it found.",
            show_default="where --bench could search",
        ),
    ] = None
    unit: UnitFile = None
    scheduler: Scheduler = None
    seed: Seed = 0
    workers: Workers = 2
    sets: Sets = None
    allow_code: AllowCodeOrSet = False
    as_json: Json = False


@takes_options
def search(options: SearchOptions) -> None:
    """Find clusters of flights that violate a requirement, confirm them on new seeds, and minimise their scenarios."""
    if options.plant is not None:
        search_a_plant(options, options.plant)
        return
    from rig.studies.campaign.pool import get_ready

    if options.scheduler is None:
        get_ready()  # beside what follows, which takes a second to be imported and read
    from rig.studies.search.run_search import run
    from rig.unit.unit_file import read_unit

    plan, unit = _plan(options), options.unit and read_unit(options.unit)
    with working("the search", not options.as_json, steps=True):
        ended = run(plan, options.out, workers=options.workers, scheduler=options.scheduler, unit=unit)
    if not ended.interrupted:
        emit(options.as_json, ended.figures, lambda: _show(ended, options.out))
    require_ended(ended, f"{ended.flights} of {options.flights} flights", "they have no robustness")


def _plan(options: SearchOptions) -> SearchPlan:
    from rig.core.trust import Trust
    from rig.scenario.overrides import named_manager, parse_set
    from rig.studies.campaign.campaign_file import find, read
    from rig.studies.search.methods import require_method
    from rig.studies.search.objective import chosen
    from rig.studies.search.search_plan import Asked, SearchPlan, parse_against
    from rig.studies.search.trials_first import can_try

    require_method(options.method)
    if not options.requirement:
        raise BadInput("--requirement: is needed, except with --plant")
    requirement = tuple(dict.fromkeys(options.requirement))
    asked = named(Asked, options, requirements=requirement, trials_first=bool(options.trials_first))
    given = dict(map(parse_set, options.sets or []))
    source, campaign = str(find(options.campaign)), read(options.campaign, given)
    against = [] if options.against is None else [parse_against(options.against)]
    trust = Trust(source, options.allow_code, named_manager([*given.items(), *against]))
    requirements = chosen(asked.requirements, options.requirements or [], campaign.requirements or [])
    plan = SearchPlan(campaign, source, asked, requirements, trust)
    if options.trials_first is None and options.unit is None and can_try(plan):
        return SearchPlan(campaign, source, replace(asked, trials_first=True), requirements, trust)
    return plan


def _trials(f: dict[str, int]) -> str:
    """Return what the trials before the flights found."""
    alike = f"{f['agree']} of {f['flights']} flights at the best of their regions agree with the trial"
    return f"{f['violated']} of {f['trials']} open-loop trials violate; {alike}"


def _show(ended: Ended, out: Path) -> None:
    """Print the clusters with their confidence and files, then what random flights found."""
    f = ended.figures
    drawn, told = f["random"], len(f["clusters"])
    hides = "every random flight violates it, so that it would hide the others"
    several = f", in {f['clusters_found']} cluster{'s' if f['clusters_found'] > 1 else ''}" if told else ""
    more = f", {told} of them below" if f["clusters_found"] > told else ""
    lowest = f"lowest robustness {robustness_told(f['robustness'])}"
    field("flights", f"{f['flights']}, {f['violated']} violate{several}{more}; {lowest}", width=_WIDTH)
    for number, each in enumerate(f["clusters"], 1):
        _show_cluster(f"cluster {number}", each)
    lines = [
        (
            "at random",
            f"{drawn['violated']} of {drawn['flights']} flights violate; violation rate at most "
            f"{100 * drawn['upper_95']:.3g} % (95 % upper bound)",
        ),
        *([("trials", _trials(f["trials"]))] if "trials" in f else []),
        ("ended", f["ended"]),
        *(("left out", f"{name}: {hides}") for name in f["left_out"]),
        ("folder", f"{out}, table {ended.table_sha256}, {ended.wall_s:.1f} s"),
    ]
    for label, text in lines:
        field(label, text, width=_WIDTH)


def _show_cluster(label: str, each: dict[str, Any]) -> None:
    """Print a cluster: where, how sure, the ranges of its numbers, the smallest scenario and its file."""
    smallest = each["smallest"]
    faults, flights = "; ".join(smallest["faults"]) or "no fault", each["flights"]
    texts = [
        f"{each['arm']} ({'; '.join(each['faults']) or 'no fault'})",
        f"{flights} flight{'s' if flights > 1 else ''}, lowest robustness {robustness_told(each['robustness'])}; "
        f"run {each['run']}: {share_told(each, 'new seeds')}",
        "; ".join(f"{key} {text}" for key, text in each["ranges_shown"].items()),
        f"smallest: {faults}: {share_told(smallest, 'new seeds')}",
        each["scenario"] or "no new seed violates: no scenario is written",
    ]
    for text in texts:
        field(label, text, width=_WIDTH)
        label = ""
