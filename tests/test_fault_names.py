"""What a fault is called: the same whether a scenario's settings say it or what a log recorded of them."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rig.core import fault_names
from rig.core.files import bundled
from rig.log.of_flight import metadata
from rig.scenario.scenario import load
from rig.show.viewer.facts import UNKNOWN, of_log, of_resolved

SCENARIOS = sorted(path.stem for path in bundled("faults").glob("*.toml"))


@pytest.mark.parametrize(
    ("fault", "place", "label"),
    [
        ({"kind": "offset", "signal": "pitch_rate", "channels": [2, 3]}, "pitch_rate", "offset pitch_rate.2,3"),
        ({"kind": "drift", "signal": "heading", "channels": [1], "id": "creep"}, "heading", "creep"),
        ({"kind": "stuck", "signal": "surface.elevator", "channels": []}, "surface.elevator", "stuck surface.elevator"),
        ({"kind": "pitot_icing", "blocked": "pitot", "channels": [1, 2]}, "dynamic_pressure", "pitot_icing pitot.1,2"),
        (
            {"kind": "pitot_icing", "blocked": "both", "channels": [4]},
            "static_pressure+dynamic_pressure",
            "pitot_icing both.4",
        ),
        (
            {"kind": "vane_icing", "vanes": ["angle_of_attack", "angle_of_sideslip"], "channels": [1, 2]},
            "angle_of_attack+angle_of_sideslip",
            "vane_icing angle_of_attack+angle_of_sideslip.1,2",
        ),
    ],
)
def test_a_fault_is_named_by_its_id_or_by_its_kind_and_where_it_acts(fault: dict[str, Any], place: str, label: str):
    assert (fault_names.place(fault), fault_names.label(fault)) == (place, label)


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_log_tells_title_thresholds_and_faults_as_its_scenario_does(name: str):
    scenario = load(name)
    facts = of_log(metadata(scenario))
    signals: Any = scenario.redundancy.signals
    assert facts == of_resolved(scenario.resolved())
    assert facts.title == (scenario.title or scenario.aircraft)
    assert facts.thresholds == {name: getattr(signals, name).threshold for name in type(signals).model_fields}
    assert [fault.label for fault in facts.faults] == [fault.label for fault in scenario.faults]


@pytest.mark.parametrize("scenario", [None, "", "no JSON", "[]", "3", '{"aircraft": "f16"}', '{"redundancy": 1}'])
def test_a_log_whose_scenario_cannot_be_read_has_faults_with_numbers(scenario: str | None):
    assert of_log({} if scenario is None else {"scenario": scenario}) is UNKNOWN


def test_a_fault_without_what_its_name_needs_makes_the_scenario_unknown():
    data = json.loads(metadata(load("f16_pitch_rate_hardover"))["scenario"])
    del data["faults"][0]["signal"]
    assert of_log({"scenario": json.dumps(data)}) is UNKNOWN
