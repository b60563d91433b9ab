"""``rig search PLAN.toml --plant FILE.py:function``: the search over a Python function.  JSBSim is not loaded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer import echo

from rig.cli.common import emit, require_ended
from rig.cli.printing import field
from rig.cli.working import working
from rig.core.errors import BadInput
from rig.core.outputs import require_apart

if TYPE_CHECKING:
    from rig.cli.search import SearchOptions

_OF_FLIGHTS = ("against", "requirements", "bench", "unit", "scheduler", "sets", "allow_code")
_WIDTH = 11


def search_a_plant(options: SearchOptions, plant: str) -> None:
    """Search over the function that ``--plant`` names.  BadInput: an option of flights, and as ``rig.search``."""
    for name in _OF_FLIGHTS:
        if getattr(options, name):
            option = "--set" if name == "sets" else f"--{name.replace('_', '-')}"
            raise BadInput(f"{option}: is of flights, and not with --plant")
    from rig.studies.search.plants.plant_api import search
    from rig.studies.search.plants.plant_workers import split_reference

    require_apart({"--out": options.out}, [options.campaign, split_reference(plant)[0]])
    with working("the search", not options.as_json, steps=True, compiles=False):
        found = search(
            plant,
            Path(options.campaign),
            simulations=options.flights,
            requirements=options.requirement or (),
            method=options.method,
            seed=options.seed,
            out=options.out,
            workers=options.workers,
        )
    for warning in found.warnings:
        echo(f"warning: {warning}", err=True)
    if not found.interrupted:
        emit(options.as_json, found.figures, lambda: _show(found.figures, options.out, found.wall_s))
    require_ended(found, f"{found.simulations} of {options.flights} simulations")


def _show(f: dict[str, Any], out: Path, took_s: float) -> None:
    """Print how much violates, the clusters, and what failed."""
    first, robustness = f["first"], "none" if f["robustness"] is None else f"{f['robustness']:.4g}"
    found = "" if f["first_violation"] is None else f", the first is number {f['first_violation']}"
    lines = [
        ("searched", f"{f['simulations']} simulations, {f['violated']} violate{found}; least robustness {robustness}"),
        (
            "first",
            f"{first['violated']} of {first['simulations']} evenly spread points violate; violation rate at most "
            f"{100 * first['upper_95']:.3g} % (95 % upper bound)",
        ),
        *[("violated", ", ".join(f"{name} in {count}" for name, count in f["violating"].items()))][: len(f["violating"]) - 1],
        *[("failed", f"{f['failed']} simulations, no violations; the first: {f['first_reason']}")][: f["failed"]],
        *(("printed", " ".join(text.split())) for text in [f["printed"]] if text),
        *((f"cluster {number}", cluster["text"]) for number, cluster in enumerate(f["clusters"], 1)),
        ("folder", f"{out}, {took_s:.1f} s"),
    ]
    for label, text in lines:
        field(label, text, width=_WIDTH)
