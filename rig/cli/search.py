"""``rig search``: the worst case that a campaign's space holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Argument, Exit, Option, echo

from rig.cli import complete
from rig.cli.common import AllowCodeOrSet, Json, Seed, Sets, Workers, emit
from rig.cli.table import field, line
from rig.cli.working import working
from rig.errors import BadInput
from rig.util.interrupt import CODE

if TYPE_CHECKING:
    from rig.search.plan import SearchPlan
    from rig.search.run import Ended

_METHODS: Final = ("cma", "random")
_WIDTH: Final = 11


Space = Annotated[
    str,
    Argument(
        metavar="FILE|NAME",
        help="A campaign: its ranges within each combination of cases are searched.",
        show_default=False,
        autocompletion=complete.campaigns,
    ),
]
Ids = Annotated[
    list[str], Option(metavar="ID", help="What is to be violated; repeatable: any of them.", show_default=False)
]
Flights = Annotated[int, Option(metavar="N", help="Flights of the search, a tenth at random.", min=1, max=10**6)]
Out = Annotated[Path, Option(metavar="DIR", help="Folder of the search; a begun one is continued.", show_default=False)]
Method = Annotated[str, Option(metavar="cma|random", help="How flights are chosen after the random ones.")]
Against = Annotated[
    str | None,
    Option(metavar="KEY=VALUE", help="Find what violates and, with this set too, does not.", show_default=False),
]
Sources = Annotated[
    list[str] | None,
    Option(metavar="NAME|FILE", help="Where the ids are; repeatable.", show_default="all bundled sets"),
]
Bench = Annotated[bool, Option("--bench", help="Search open loop: one signal over the truth of a healthy flight.")]
Scheduler = Annotated[
    str | None,
    Option(metavar="URL", help="A Dask scheduler, tcp://HOST:PORT, in place of processes.", show_default=False),
]


def search(
    campaign: Space,
    requirement: Ids,
    flights: Flights,
    out: Out,
    method: Method = "cma",
    against: Against = None,
    requirements: Sources = None,
    bench: Bench = False,
    scheduler: Scheduler = None,
    seed: Seed = 0,
    workers: Workers = 2,
    sets: Sets = None,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """Search for the worst case: the flight that violates a requirement by most, confirmed and made simple."""
    from rig.campaign.pool import get_ready

    if scheduler is None:
        get_ready()  # beside what follows, which takes a second to be imported and read
    from rig.search.plan import Asked
    from rig.search.run import run

    if method not in _METHODS:
        raise BadInput(f"--method {method}: must be one of {', '.join(_METHODS)}")
    asked = Asked(tuple(dict.fromkeys(requirement)), flights, method, against, seed, bench)  # type: ignore[arg-type]
    plan = _plan(campaign, asked, requirements or [], sets or [], allow_code)
    with working("the search", not as_json, steps=True):
        ended = run(plan, out, workers=workers, scheduler=scheduler)
    if ended.interrupted:
        echo(f"stopped: {ended.flights} of {flights} flights; the same command goes on", err=True)
        raise Exit(CODE + ended.signal)
    emit(as_json, ended.figures, lambda: _show(ended, out))


def _plan(campaign: str, asked: Any, files: list[str], sets: list[str], allow_code: bool) -> SearchPlan:
    from rig.campaign.config import find, read
    from rig.overrides import named_manager, parse_set
    from rig.search.objective import chosen
    from rig.search.plan import SearchPlan, parse_against
    from rig.util.trust import Trust

    given = dict(map(parse_set, sets))
    source, read_from = str(find(campaign)), read(campaign, given)
    named = named_manager([*given.items(), *([] if asked.against is None else [parse_against(asked.against)])])
    requirements = chosen(asked.requirements, files, read_from.requirements or [])
    return SearchPlan(read_from, source, asked, requirements, Trust(source, allow_code, named))


def _show(ended: Ended, out: Path) -> None:
    """Print what was found, how sure it is, and where it is."""
    found = ended.figures
    at_random, worst, confirmed = found["random"], found["worst"], found["confirmed"]
    field(
        "flights",
        f"{found['flights']}, {found['violated']} violate; least margin {found['least_margin']:.4g}",
        width=_WIDTH,
    )
    bound = f"at most {100 * at_random['upper_95']:.3g} % (95 %)"
    field("at random", f"{at_random['violated']} of {at_random['flights']} draws violate: {bound}", width=_WIDTH)
    again = f"{worst['confirmed'][0]} of {worst['confirmed'][1]} new seeds violate"
    field(
        "worst",
        f"run {worst['run']}, {worst['arm']}: {again}, median margin {worst['median_margin']:.4g}",
        width=_WIDTH,
    )
    if found["scenario"]:
        field("simplest", f"{found['scenario']}: {confirmed[0]} of {confirmed[1]} other seeds violate", width=_WIDTH)
    else:
        line("no new seed violates: no scenario was written")
    field("folder", f"{out}, table {ended.table_sha256}, {ended.wall_s:.1f} s", width=_WIDTH)
