"""``rig scenario``: parse, call, print."""

from __future__ import annotations

import typer

from rig.cli.common import GROUP, Json, ScenarioName, Sets, emit
from rig.text import plain

scenario_app = typer.Typer(help="Look at scenario files.", **GROUP)


@scenario_app.command("show")
def scenario_show(scenario: ScenarioName = None, sets: Sets = None, as_json: Json = False) -> None:
    """Print a scenario with every default written out, as TOML that can be flown."""
    from rig.scenario import load

    loaded = load(scenario, sets or ())
    emit(as_json, loaded.resolved, lambda: typer.echo(plain(loaded.to_toml(), keep="\n"), nl=False))


@scenario_app.command("list")
def scenario_list(as_json: Json = False) -> None:
    """List the bundled scenarios: name, aircraft, title."""
    from rig.cli import show
    from rig.scenario import find, names
    from rig.settings import read_toml

    files = {name: read_toml(find(name)) for name in names()}
    found = {name: str(file.get("title", "")) for name, file in files.items()}
    rows = [(name, str(files[name].get("aircraft", "f16")), title) for name, title in found.items()]
    emit(as_json, found, lambda: show.scenarios(rows))


@scenario_app.command("schema")
def scenario_schema() -> None:
    """Print the JSON schema of scenario files, for editors."""
    from rig.cli.schema import of_file

    typer.echo(of_file("scenario"))


@scenario_app.command("check")
def scenario_check(scenario: ScenarioName = None, sets: Sets = None) -> None:
    """Check a scenario without flying it."""
    from rig.scenario import find, load

    loaded = load(scenario, sets or ())
    manager = loaded.redundancy.manager
    code = f"; the class {manager} votes: not imported here, rig fly needs --allow-code" if ":" in manager else ""
    counts = f"{loaded.frames} frames of {loaded.aircraft}, {len(loaded.faults)} faults"
    typer.echo(plain(f"{find(scenario)}: good, {counts}{code}"))
