"""``rig faults``: the kinds of faults, for people and as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli import complete
from rig.cli.common import GROUP, Json, emit

if TYPE_CHECKING:
    from rig.faults.catalogue import Entry, Parameter
    from rig.util.console import Screen

faults_app = typer.Typer(help="Look at the kinds of faults.", **GROUP)


@faults_app.command("list")
def list_kinds(as_json: Json = False) -> None:
    """List every kind of fault: what it does and why, where it can sit, its own keys."""
    from rig.faults.catalogue import common, entries

    found = entries()
    everything = {"kinds": [entry.as_dict() for entry in found], "common": list(map(asdict, common()))}
    emit(as_json, everything, lambda: _kinds(found))


def _kinds(found: list[Entry]) -> None:
    from rig.util.console import console

    rows = []
    for entry in found:
        keys = ", ".join(p.name for p in entry.parameters if p.name not in ("signal", "channels"))
        rows.append((entry.kind, entry.what.splitlines()[0], ", ".join(entry.sites), keys))
    screen = console()
    screen.table(("kind", "what and why", "on", "keys of its own"), rows)
    screen.print("rig faults show KIND has the keys with their units and an example")


@faults_app.command("show")
def show_kind(
    kind: Annotated[str, typer.Argument(metavar="KIND", show_default=False, autocompletion=complete.kinds)],
    as_json: Json = False,
) -> None:
    """Show one kind: cause, keys with units, an example as TOML and the scenario that flies it."""
    from rig.faults.catalogue import common, entry

    found, shared = entry(kind), common()
    emit(as_json, {**found.as_dict(), "common": list(map(asdict, shared))}, lambda: _kind(found, shared))


def _kind(found: Entry, shared: list[Parameter]) -> None:
    from rig.util.console import console, styled

    screen = console()
    screen.print(styled((found.kind, "bold"), f"  on: {', '.join(found.sites)}"))
    for line in found.what.splitlines():
        screen.print(line)
    _table(screen, "its keys", found.parameters)
    _table(screen, "keys of every kind", shared)
    typer.echo(f"\nexample, flown by  rig fly {found.scenario}\n")
    typer.echo(found.example, nl=False)


def _table(screen: Screen, title: str, parameters: list[Parameter]) -> None:
    rows = []
    for p in parameters:
        default = "required" if p.required else "" if p.default is None else json.dumps(p.default)
        rows.append((p.name, p.unit, default, p.allowed, p.meaning))
    screen.print()
    screen.table((title, "unit", "default", "allowed", "meaning"), rows)
