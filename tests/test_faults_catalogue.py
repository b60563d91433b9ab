"""rig faults: every kind, its keys with units, an example that parses and flies."""

import json
import tomllib
from pathlib import Path

import pytest
from pydantic import TypeAdapter
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core.errors import BadInput
from rig.scenario import scenario
from rig.world.faults import KINDS, Fault
from rig.world.faults import fault_catalogue as catalogue

PARSE: TypeAdapter[Fault] = TypeAdapter(Fault)
RUN = CliRunner()
ENTRIES = catalogue.entries()


def test_the_catalogue_has_every_kind_once():
    assert [entry.kind for entry in ENTRIES] == list(KINDS) == list(catalogue.EXAMPLES)


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.kind)
def test_an_entry_has_a_cause_meanings_and_an_example_of_its_kind(entry):
    assert len(entry.what) > 30 and ". " in entry.what.splitlines()[0]
    assert all(parameter.meaning for parameter in (*entry.parameters, *catalogue.common()))
    (example,) = tomllib.loads(entry.example)["faults"]
    assert PARSE.validate_python(example).kind == entry.kind
    assert any(fault.kind == entry.kind for fault in scenario.load(entry.scenario).faults)


def test_every_number_has_its_unit():
    for entry in ENTRIES:
        for parameter in entry.parameters:
            annotation = str(KINDS[entry.kind].model_fields[parameter.name].annotation)
            assert ("float" in annotation) == bool(parameter.unit), (entry.kind, parameter.name)
            if parameter.name.endswith("_s") and "per" not in parameter.name and "pa_s" not in parameter.name:
                assert parameter.unit == "s"


def test_required_keys_are_those_without_which_it_is_refused():
    scale = {parameter.name: parameter for parameter in catalogue.entry("scale").parameters}
    assert scale["factor"].required and not scale["ramp_s"].required and scale["ramp_s"].default == 0.0
    assert scale["ramp_s"].allowed == ">= 0"
    ilm = {parameter.name: parameter for parameter in catalogue.entry("ilm").parameters}
    assert "blind" in ilm["says"].allowed


def test_the_list_and_every_page_are_printed():
    listed = RUN.invoke(app, ["faults", "list"]).output
    assert all(kind in listed for kind in KINDS)
    for entry in ENTRIES:
        shown = RUN.invoke(app, ["faults", "show", entry.kind]).output
        assert entry.example in shown and entry.scenario in shown


def test_json_is_one_object_that_holds_the_same():
    data = json.loads(RUN.invoke(app, ["faults", "list", "--json"]).output)
    assert [entry["kind"] for entry in data["kinds"]] == list(KINDS)
    assert {key["name"] for key in data["common"]} >= {"start_s", "when", "on", "after", "rate_per_hour", "repeats"}
    spikes = json.loads(RUN.invoke(app, ["faults", "show", "spikes", "--json"]).output)
    assert spikes["kind"] == "spikes" and spikes["sites"] == ["channel", "inertial", "reference"]


def test_an_unknown_kind_is_refused_with_what_there_is():
    with pytest.raises(BadInput, match=r"unknown kind of fault, nearest: rate_loss, .*43 allowed, see rig faults list"):
        catalogue.entry("explode")


def test_the_page_of_the_docs_has_every_kind_and_key():
    page = (Path(__file__).parent.parent / "docs" / "reference" / "faults-and-signals.md").read_text()
    keys = {p.name for entry in ENTRIES for p in entry.parameters} | {p.name for p in catalogue.common()}
    assert [name for name in (*KINDS, *keys) if f"`{name}" not in page and f"`{name}`" not in page] == []
