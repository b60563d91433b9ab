"""``rig faults``: the kinds of faults, for people and as JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from rig.faults.catalogue import Parameter

faults_app = typer.Typer(
    help="Look at the kinds of faults.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@faults_app.command("list")
def list_kinds(as_json: Json = False) -> None:
    """List every kind of fault: what it does and why, where it can sit, its own keys."""
    from rich.table import Table

    from rig.console import console
    from rig.faults.catalogue import common, entries

    found = entries()
    if as_json:
        _print({"kinds": [entry.as_dict() for entry in found], "common": _plain(common())})
        return
    table = Table("kind", "what and why", "on", "keys of its own", box=None)
    for entry in found:
        keys = ", ".join(
            parameter.name for parameter in entry.parameters if parameter.name not in ("signal", "channels")
        )
        table.add_row(entry.kind, entry.what.splitlines()[0], ", ".join(entry.sites), keys)
    screen = console()
    screen.print(table)
    screen.print("rig faults show KIND has the keys with their units and an example")


@faults_app.command("show")
def show_kind(kind: Annotated[str, typer.Argument(show_default=False)], as_json: Json = False) -> None:
    """Show one kind: cause, keys with units, an example as TOML and the scenario that flies it."""
    from rig.console import console, styled
    from rig.faults.catalogue import common, entry

    found = entry(kind)
    if as_json:
        _print({**found.as_dict(), "common": _plain(common())})
        return
    screen = console()
    screen.print(styled((found.kind, "bold"), f"  on: {', '.join(found.sites)}"))
    for line in found.what.splitlines():
        screen.print(line)
    _table(screen, "its keys", found.parameters)
    _table(screen, "keys of every kind", common())
    typer.echo(f"\nexample, flown by  rig fly {found.scenario}\n")
    typer.echo(found.example, nl=False)


def _table(screen: Console, title: str, parameters: list[Parameter]) -> None:
    from rich.table import Table

    table = Table(title, "unit", "default", "allowed", "meaning", box=None)
    for p in parameters:
        default = "required" if p.required else "" if p.default is None else json.dumps(p.default)
        table.add_row(p.name, p.unit, default, p.allowed, p.meaning)
    screen.print()
    screen.print(table)


def _plain(parameters: list[Parameter]) -> list[dict[str, Any]]:
    from dataclasses import asdict

    return [asdict(parameter) for parameter in parameters]


def _print(data: dict[str, Any]) -> None:
    typer.echo(json.dumps(data, allow_nan=False))
