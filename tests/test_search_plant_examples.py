"""The plants of docs/examples: the automatic transmission, the recovery of the F-16, the tank of the page."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from rig.studies.search.plants.plant_call import Call, imported, simulate
from rig.studies.search.plants.plant_file import read_plan
from rig.studies.search.plants.plant_subject import PlantSubject

ROOT = Path(__file__).parents[1]
PLANTS = ROOT / "docs/examples/plants"


@pytest.fixture
def plant(monkeypatch):
    """Import the function of an example; its folder leaves the path with the test."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    return lambda name, function: imported(str(PLANTS / f"{name}.py"), function)


def driven(transmission, throttle, brake):
    """The columns and the verdicts by id of a drive with constant pieces."""
    plan = read_plan(PLANTS / "automatic_transmission.toml")
    inputs = {"throttle": np.array(throttle, float), "brake": np.array(brake, float)}
    call = Call(inputs, dict.fromkeys(inputs, "constant"), plan.duration_s, plan.rate_hz, 0)
    columns = simulate(transmission, call).columns
    assert columns is not None
    subject = PlantSubject(plan.requirements, columns, plan.rate_hz, plan.duration_s)
    return columns, {each.requirement: each for each in subject.verdicts(columns)}


def test_the_transmission_shifts_up_through_all_gears_at_full_throttle(plant):
    columns, told = driven(plant("automatic_transmission", "transmission"), [100.0], [0.0])
    gear, speed = columns["gear"], columns["speed"]
    assert gear[0] == 1 and gear[-1] == 4 and set(np.diff(gear)) == {0.0, 1.0}
    assert (np.diff(speed) > 0.0).all() and told["AT1"].status == told["AT2"].status == "violated"
    assert told["AT1"].robustness == pytest.approx((120.0 - speed[:501].max()) / 120.0)
    shifts = [speed[np.argmax(gear == g)] for g in (2, 3, 4)]
    assert np.all(np.array(shifts) >= [40.0, 70.0, 100.0]) and np.all(np.array(shifts) < [46.0, 74.0, 103.0])


def test_the_transmission_without_throttle_meets_all_that_needs_speed(plant):
    columns, told = driven(plant("automatic_transmission", "transmission"), [0.0], [325.0])
    assert abs(columns["speed"]).max() < 35.0 and columns["gear"].max() == 1
    assert {name for name, each in told.items() if each.status == "violated"} == set()


def test_robustness_of_at6_is_the_larger_side(plant):
    """(max rpm - 3000) / 5000 of the condition, which is negated, or (35 - max speed) / 120."""
    columns, told = driven(plant("automatic_transmission", "transmission"), [30.0, 10.0], [0.0, 100.0])
    sides = (columns["rpm"][:751].max() - 3000.0) / 5000.0, (35.0 - columns["speed"][:101].max()) / 120.0
    assert told["AT6a"].robustness == pytest.approx(max(sides))


def test_the_recovery_loses_more_height_with_faults_than_without(plant):
    recovery = plant("recovery", "recovery")
    lost = []
    for drift in (1e-4, 0.2):
        times, columns = recovery(0.3, 0.25, drift, drift, drift, 2.0, 1, 20.0)
        assert len(times) == len(columns["bank"]) > 300
        lost.append(columns["altitude_lost"].max())
        assert (abs(columns["vote_error"]).max() > 0.05) == (drift == 0.2)
    assert lost[1] > 1.2 * lost[0]


@pytest.mark.parametrize("name", ["automatic_transmission", "recovery", "tank"])
def test_the_plan_of_an_example_fits_its_function(plant, name):
    function = plant(name, {"automatic_transmission": "transmission"}.get(name, name))
    plan = read_plan(PLANTS / f"{name}.toml")
    assert {*plan.parameters, *plan.signals} <= set(function.__code__.co_varnames[: function.__code__.co_argcount])


def test_the_tank_of_the_page_is_that_of_the_examples():
    page = (ROOT / "docs/how-to/search-any-plant.md").read_text()
    code = re.search(r'title="tank.py"\n(.*?)```', page, re.DOTALL)
    assert code and code[1].strip() in (PLANTS / "tank.py").read_text()
