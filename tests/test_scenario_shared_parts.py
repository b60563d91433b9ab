"""Scenarios of one aircraft: equal to those made alone, and the same objects where no run changes anything."""

from typing import Any

import pytest

from rig.core.errors import BadInput
from rig.core.settings import build
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario
from rig.scenario.shared_parts import PARTS, build_shared

TABLES = aircraft.tables("f16")
OFFSET = {"kind": "offset", "signal": "pitch_rate", "channels": [2], "start_s": 1.0, "offset": 0.1}


def alone(data: dict[str, Any]) -> Scenario:
    return build(Scenario, aircraft.merge(TABLES, data), "alone")


@pytest.mark.parametrize(
    "data",
    [
        {"seed": 3},
        {"seed": 4, "faults": [OFFSET]},
        {"redundancy": {"common_mode": "report"}},
        {"redundancy": {"common_mode": "fail"}},
        {"sensors": {"pitch_rate": {"lag_s": 0.02}}},
        {"computers": {"count": 3}},
        {"computers": {"count": 2}},
        {"control": {"feedback": False}} if "feedback" in TABLES.get("control", {}) else {"duration_s": 3.0},
    ],
    ids=str,
)
def test_a_scenario_is_that_which_is_made_alone_after_any_other(data: dict[str, Any]):
    for before in ({}, {"computers": {"count": 3}}, {"redundancy": {"common_mode": "report"}}, data):
        build_shared(TABLES, before, "before")
        assert build_shared(TABLES, data, "shared").resolved() == alone(data).resolved()


def test_parts_that_no_run_changes_are_the_same_objects():
    one, other = (build_shared(TABLES, {"seed": seed, "faults": [OFFSET]}, "run") for seed in (1, 2))
    assert [name for name in PARTS if getattr(one, name) is not getattr(other, name)] == []
    assert one.faults is not other.faults


def test_a_part_that_a_run_changes_is_its_own():
    one = build_shared(TABLES, {}, "one")
    other = build_shared(TABLES, {"sensors": {"pitch_rate": {"lag_s": 0.03}}}, "other")
    assert one.sensors is not other.sensors and one.redundancy is other.redundancy


def test_three_computers_read_three_channels_of_sensors_that_four_had():
    four, three = (build_shared(TABLES, {"computers": {"count": count}}, "run") for count in (4, 3))
    fitted = [scenario.sensors.pitch_rate.channels for scenario in (four, three)]
    assert fitted == [4, 3]


def test_a_wrong_key_is_named_and_not_kept():
    for _ in range(2):
        with pytest.raises(BadInput, match=r"run 7: redundancy\.common_mod"):
            build_shared(TABLES, {"redundancy": {"common_mod": "fail"}}, "run 7")
