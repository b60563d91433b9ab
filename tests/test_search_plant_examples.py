"""The plants of docs/examples: the automatic transmission, the two recoveries of an F-16, the tank of the page."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import rig
from rig.core.errors import BadInput
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


AUTOPILOT = """
class GcasAutopilot:
    def __init__(self, init_mode="standby", gain_str="old", stdout=False):
        self.mode, self.gains = init_mode, gain_str
"""
SIMULATION = """
import numpy as np
seen = []
def run_f16_sim(initial_state, tmax, ap, step=1 / 30):
    seen.append((initial_state, ap, step))
    times = [k * step for k in range(round(tmax / step) + 1)]
    states = np.zeros((len(times), 16))
    states[:, :13] = initial_state
    states[:, 11] -= 180.0 * initial_state[3] * np.array(times)
    return {"status": "finished", "times": times, "states": states,
            "modes": [ap.mode if t < 5.0 else "pull" if t < 10.0 else "standby" for t in times]}
"""
GROUND = 2330.0 / (180.0 * 15.0)  # the roll angle with which the stub of ``aerobench`` is at 0 ft after 15 s


@pytest.fixture
def aerobench(tmp_path, monkeypatch):
    """A package with the interface of the benchmark's code: the aircraft descends at 180 ft/s a radian of roll."""
    for name, text in (("examples/gcas/gcas_autopilot", AUTOPILOT), ("run_f16_sim", SIMULATION)):
        path = tmp_path / "aerobench" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    ours = [name for name in sys.modules if name.split(".")[0] == "aerobench"]
    for name in ours:
        monkeypatch.delitem(sys.modules, name)
    yield
    for name in [name for name in sys.modules if name.split(".")[0] == "aerobench"]:
        del sys.modules[name]


def test_the_benchmark_f16_gets_feet_and_radians_and_returns_them_by_name(aerobench, plant):
    times, columns = plant("f16_gcas", "gcas")(0.7, -1.2, -0.5, 15.0)
    state, autopilot, step = sys.modules["aerobench.run_f16_sim"].seen[-1]
    speed, alpha = 540.0, 2.1215 * np.pi / 180.0
    assert state == pytest.approx([speed, alpha, 0.0, 0.7, -1.2, -0.5, 0, 0, 0, 0, 0, 2330.0, 9.0])
    assert autopilot.mode == "roll" and step == pytest.approx(1.0 / 30.0)
    assert len(times) == 451 and times[-1] == pytest.approx(15.0)
    for name, value in {"speed": speed, "roll_angle": 0.7, "pitch_angle": -1.2, "yaw_angle": -0.5}.items():
        assert columns[name] == pytest.approx(np.full(451, value))
    assert columns["altitude"][[0, -1]] == pytest.approx([2330.0, 2330.0 - 180.0 * 0.7 * 15.0])
    assert np.array(times)[columns["pulls"]][[0, -1]] == pytest.approx([5.0, 10.0], abs=0.04)
    assert plant("f16_gcas", "gcas")(0.7, -1.2, -0.5, 1.0, 2338.0)[1]["altitude"][0] == 2338.0


def test_a_search_of_the_benchmark_f16_finds_what_its_package_violates(aerobench, plant):
    """The lowest altitude is that of 15 s: 2330 - 2700 roll."""
    found = rig.search(plant("f16_gcas", "gcas"), PLANTS / "f16_gcas.toml", simulations=64, seed=1)
    low, high = 0.2 * np.pi, 17.0 / 60.0 * np.pi
    for draw, result in zip(found.draws, found.results, strict=True):
        roll = low + draw.point[0] * (high - low)
        assert result.robustness == pytest.approx(2330.0 - 2700.0 * roll, abs=1e-6)
        assert result.violated == (roll >= GROUND)
    assert found.figures["violated"] > 5 and found.figures["clusters"][0]["ranges"]["roll"][0] >= GROUND


def test_the_benchmark_f16_without_its_package_is_one_line(plant, monkeypatch):
    monkeypatch.setitem(sys.modules, "aerobench", None)
    with pytest.raises(BadInput, match=r"aerobench.*this plant needs the folder 'code' of github\.com/") as refused:
        rig.search(plant("f16_gcas", "gcas"), PLANTS / "f16_gcas.toml", simulations=64)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["automatic_transmission", "f16_gcas", "recovery", "tank"])
def test_the_plan_of_an_example_fits_its_function(plant, name):
    function = plant(name, {"automatic_transmission": "transmission", "f16_gcas": "gcas"}.get(name, name))
    plan = read_plan(PLANTS / f"{name}.toml")
    assert {*plan.parameters, *plan.signals} <= set(function.__code__.co_varnames[: function.__code__.co_argcount])


def test_the_tank_of_the_page_is_that_of_the_examples():
    page = (ROOT / "docs/how-to/search-any-plant.md").read_text()
    code = re.search(r'title="tank.py"\n(.*?)```', page, re.DOTALL)
    assert code and code[1].strip() in (PLANTS / "tank.py").read_text()
