"""``rig search PLAN.toml --plant FILE.py:function``: the search over a Python function.  JSBSim is not loaded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer import echo

from rig.cli.common import emit, end_interrupted
from rig.cli.printing import field, robustness_told, share_told
from rig.cli.working import working
from rig.core.errors import BadInput
from rig.core.outputs import require_apart

if TYPE_CHECKING:
    from rig.studies.search.plants.plant_file import PlantPlan

_OF_FLIGHTS = ("against", "requirements", "bench", "trials_first", "unit", "scheduler", "sets", "allow_code")
_WIDTH = 11


def search_a_plant(options: Any, plant: str) -> None:
    """Search over the function that ``--plant`` names.  BadInput: an option of flights, and as ``rig.search``.

    options : of ``rig search``
    """
    for name in _OF_FLIGHTS:
        if getattr(options, name):
            option = "--set" if name == "sets" else f"--{name.replace('_', '-')}"
            raise BadInput(f"{option}: is for flights, not with --plant")
    from rig.studies.search.plants.plant_api import search
    from rig.studies.search.plants.plant_file import read_plan
    from rig.studies.search.plants.plant_workers import split_reference

    plan = read_plan(Path(options.campaign))
    require_apart({"--out": options.out}, [options.campaign, split_reference(plant)[0]])
    with working("the search", not options.as_json, steps=True, compiles=False):
        found = search(
            plant,
            plan,
            simulations=options.flights,
            requirements=options.requirement or (),
            method=options.method,
            seed=options.seed,
            out=options.out,
            workers=options.workers,
        )
    for warning in found.warnings:
        echo(f"warning: {warning}", err=True)
    if found.interrupted:
        end_interrupted(found.signal, f"{found.simulations} of {options.flights} simulations")
    emit(options.as_json, found.figures, lambda: _show(found.figures, plan, options.out, found.wall_s))


def _show(f: dict[str, Any], plan: PlantPlan, out: Path, took_s: float) -> None:
    """Print how much violates, the clusters, and what failed."""
    from rig.studies.search.plants.plant_words import values_told

    found = "" if f["first_violation"] is None else f", the first is number {f['first_violation']}"
    lowest = f"lowest robustness {robustness_told(f['robustness'])}"
    field("searched", f"{f['simulations']} simulations, {f['violated']} violate{found}; {lowest}", width=_WIDTH)
    if len(f["violating"]) > 1:
        counts = ", ".join(f"{name} in {count}" for name, count in f["violating"].items())
        field("violated", counts, width=_WIDTH)
    more = f"; {f['clusters_found']} clusters, {len(f['clusters'])} of them below"
    first = f"{f['first']['violated']} of {f['first']['simulations']} evenly spread inputs violate"
    field("first", first + (more if f["clusters_found"] > len(f["clusters"]) else ""), width=_WIDTH)
    for number, cluster in enumerate(f["clusters"], 1):
        _show_cluster(f"cluster {number}", cluster, plan)
    if f["failed"]:
        failed = f["first_failed"]
        count = f"{f['failed']} simulation{'s' if f['failed'] > 1 else ''}, no violation"
        field("failed", f"{count}; the first is number {failed['number']}: {failed['reason']}", width=_WIDTH)
        field("", f"with {'; '.join(values_told(failed['inputs'], plan))}", width=_WIDTH)
    if f["printed"]:
        field("printed", " ".join(f["printed"].split()), width=_WIDTH)
    field("ended", f["ended"], width=_WIDTH)
    field("folder", f"{out}, {took_s:.1f} s", width=_WIDTH)


def _show_cluster(label: str, cluster: dict[str, Any], plan: PlantPlan) -> None:
    """Print a cluster: how many, how sure, the narrow ranges of its numbers, the smallest input, its trace."""
    from rig.studies.search.plants.plant_words import narrow, values_told

    count, smallest = cluster["simulations"], cluster["smallest"]
    of_smallest = (
        share_told(smallest, smallest["confirmed_on"])
        if "confirmed" in smallest
        else f"robustness {robustness_told(smallest['robustness'])}"
    )
    texts = [
        f"{count} simulation{'s' if count > 1 else ''}, lowest robustness {robustness_told(cluster['robustness'])}; "
        f"{share_told(cluster, cluster['confirmed_on'])}",
        *([f"with {cluster['arm']}"] if cluster["arm"] != "all" else []),
        "; ".join(narrow(cluster["ranges"], plan)) or "its inputs are anywhere",
        f"smallest: {'; '.join(values_told(smallest['inputs'], plan))}: {of_smallest}",
        f"number {cluster['number']}: {cluster['trace']}",
    ]
    for text in texts:
        field(label, text, width=_WIDTH)
        label = ""
