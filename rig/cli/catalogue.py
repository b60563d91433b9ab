"""``rig scenario``, ``rig faults``, ``rig signals``: scenarios, kinds of faults and signals, and the files' schemas."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from typer import Typer, echo

from rig.cli import complete
from rig.cli.common import GROUP, Json, ScenarioName, Sets, arg, emit, flag
from rig.cli.printing import line, table
from rig.core.column import Column, columns
from rig.core.text import plain

if TYPE_CHECKING:
    from rig.world.faults.fault_catalogue import Entry, Parameter

scenario_app = Typer(**GROUP)
faults_app = Typer(**GROUP)
_CHOSEN_BY: Final = "kind"  # entries of a list that are complete in themselves: faults, manoeuvres


@scenario_app.command("show")
def scenario_show(scenario: ScenarioName = None, sets: Sets = None, as_json: Json = False) -> None:
    """Print a scenario with all defaults, as TOML that rig fly reads."""
    from rig.scenario.scenario import load

    loaded = load(scenario, sets or ())
    emit(as_json, loaded.resolved, lambda: echo(plain(loaded.to_toml(), keep="\n"), nl=False))


@scenario_app.command("list")
def scenario_list(as_json: Json = False) -> None:
    """List the bundled scenarios with name, aircraft and title."""
    from rig.core.settings import read_toml
    from rig.scenario.scenario import find, names

    files = {name: read_toml(find(name)) for name in names()}
    titles = {name: str(file.get("title", "")) for name, file in files.items()}
    shown = (
        Column("scenario", 0),
        Column("aircraft", lambda item: str(item[1].get("aircraft", "f16"))),
        Column("title", lambda item: titles[item[0]]),
    )
    emit(as_json, titles, lambda: table(files.items(), shown))


@scenario_app.command("schema")
def scenario_schema() -> None:
    """Print the JSON schema of scenario files, for an editor."""
    echo(of_file("scenario"))


@scenario_app.command("check")
def scenario_check(scenario: ScenarioName = None, sets: Sets = None) -> None:
    """Check a scenario without flying it, and print notes on settings without effect."""
    from rig.scenario.scenario import find, load
    from rig.scenario.scenario_notes import notes
    from rig.verdict.requirements.measure import recorder_of
    from rig.verdict.requirements.requirement import load_requirements
    from rig.verdict.requirements.settled_comparisons import notes as requirement_notes

    loaded = load(scenario, sets or ())
    requirements = load_requirements(loaded.requirements or ())
    recorder_of(loaded, requirements, iter(()))  # refuses what the flight does not have
    manager = loaded.redundancy.manager
    code = (
        f"; the manager is the class {manager}: not imported here, rig fly needs --allow-code" if ":" in manager else ""
    )
    faults = len(loaded.faults)
    counts = f"{loaded.frames} frames of {loaded.aircraft}, {faults} {'fault' if faults == 1 else 'faults'}"
    echo(plain(f"{find(scenario)}: valid, {counts}{code}"))
    for note in (*notes(loaded), *requirement_notes(requirements, loaded)):
        line(f"note: {note}", style="yellow")


@faults_app.command("list")
def list_kinds(as_json: Json = False) -> None:
    """List the kinds of faults with effect, cause, place and keys."""
    from rig.world.faults.fault_catalogue import common, entries

    kinds = entries()
    everything = {"kinds": [entry.as_dict() for entry in kinds], "common": list(map(asdict, common()))}
    emit(as_json, everything, lambda: _kinds(kinds))


def _kinds(entries: list[Entry]) -> None:
    shown = (
        Column("kind"),
        Column("effect and cause", lambda entry: entry.what.splitlines()[0]),
        Column("on", lambda entry: ", ".join(entry.sites), worth=7),
        Column(
            "additional keys",
            lambda entry: ", ".join(p.name for p in entry.parameters if p.name not in ("signal", "channels")),
            worth=8,
        ),
    )
    table(entries, shown)
    line("rig faults show KIND prints the keys with their units, and an example")


@faults_app.command("show")
def show_kind(
    kind: Annotated[str, arg("KIND", "Kind of fault, as in rig faults list.", autocompletion=complete.kinds)],
    as_json: Json = False,
) -> None:
    """Print one kind of fault: cause, keys with units, an example in TOML and the scenario that flies it."""
    from rig.core.errors import BadInput
    from rig.core.renamed import VALUES, now_called
    from rig.world.faults.fault_catalogue import common, entry

    if new := VALUES["kind"].get(kind):
        raise BadInput(now_called(kind, new))
    shown, shared = entry(kind), common()
    emit(as_json, {**shown.as_dict(), "common": list(map(asdict, shared))}, lambda: _kind(shown, shared))


def _kind(entry: Entry, shared: list[Parameter]) -> None:
    line((entry.kind, "bold"), f"  on: {', '.join(entry.sites)}")
    for text in entry.what.splitlines():
        line(text)
    _parameters("keys of this kind", entry.parameters)
    _parameters("keys of every kind", shared)
    echo(f"\nexample, flown by  rig fly {entry.scenario}\n")
    echo(entry.example, nl=False)


def _parameters(title: str, parameters: Sequence[Parameter]) -> None:
    line()
    own = (
        Column("unit"),
        Column("default", _default, worth=7),
        Column("allowed", worth=8),
        Column("meaning"),
    )
    table(parameters, (Column(title, "name"), *own))


def _default(parameter: Parameter) -> str:
    return "required" if parameter.required else "" if parameter.default is None else json.dumps(parameter.default)


def signals(
    markdown: Annotated[bool, flag("--markdown", "Print the table in Markdown.")] = False,
    as_json: Json = False,
) -> None:
    """List the signals and discretes with symbol, unit, range and number of channels."""
    from rig.core.frame import DISCRETES, SIGNALS

    data = {"signals": list(map(asdict, SIGNALS)), "discretes": list(map(asdict, DISCRETES))}
    emit(as_json, data, _markdown if markdown else lambda: table(signal_rows(), SIGNAL_COLUMNS))


SIGNAL_COLUMNS: Final = columns(
    *("signal", "symbol", "unit", "range", "channels", "group", "topic"),
    worth={"topic": 4, "group": 5, "symbol": 6, "channels": 7},
)


def signal_rows() -> list[tuple[str, ...]]:
    """Return the table of the frame: one row per signal, discretes last."""
    from rig.core.frame import DISCRETES, SIGNALS

    rows = []
    for s in SIGNALS:
        span = f"{s.low:.6g} to {s.high:.6g}" + (", wraps" if s.wraps else "")
        rows.append((s.name, s.symbol, s.unit, span, str(s.channels), s.group, s.topic))
    for d in DISCRETES:
        rows.append((d.name, "", "0 or 1", f"fail-safe {d.fail_safe}", str(d.channels), "discretes", d.topic))
    return rows


def _markdown() -> None:
    for row in ([column.name for column in SIGNAL_COLUMNS], ["---"] * len(SIGNAL_COLUMNS), *signal_rows()):
        echo(f"| {' | '.join(row)} |")


def of_file(kind: Literal["scenario", "campaign", "unit"]) -> str:
    """Return the JSON schema of the files of a kind, for editors: names, types, ranges, choices.

    A scenario may leave out any key, because the aircraft supplies it: the schema requires none.  The models check
    the rest when a file is read.
    """
    schema = {"scenario": _scenario, "campaign": _campaign, "unit": _unit}[kind]()
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}, indent=1)


def _scenario() -> dict[str, Any]:
    from rig.scenario.scenario import Scenario

    schema = Scenario.model_json_schema()
    for model in (schema, *schema["$defs"].values()):
        if _CHOSEN_BY not in model.get("properties", {}):
            model.pop("required", None)
    return schema


def _campaign() -> dict[str, Any]:
    """Return the schema of a file: the base is a name; a key of ``vary`` holds a list, or tables for a dotted key."""
    from rig.studies.campaign.campaign_file import Campaign

    schema = Campaign.model_json_schema()
    schema["properties"]["base"] = {"title": "Base", "type": "string"}
    for model in (schema, *schema["$defs"].values()):
        if "vary" in model.get("properties", {}):
            written = {"anyOf": [{"type": "array"}, {"type": "object"}]}
            model["properties"]["vary"] = {"title": "Vary", "type": "object", "additionalProperties": written}
    return schema


def _unit() -> dict[str, Any]:
    from rig.unit.unit_file import Unit

    return Unit.model_json_schema()
