"""The search over a Python function: its plan, its inputs, its requirements, its folder, and what it may do wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rig
from rig.core.errors import BadInput
from rig.core.interrupt import Stop
from rig.studies.search.plants.plant_call import Call, simulate
from rig.studies.search.plants.plant_file import read_plan
from rig.studies.search.plants.plant_rounds import seeds_of
from rig.studies.search.plants.plant_signal import Signal
from rig.studies.search.plants.plant_space import space_of
from rig.studies.search.plants.plant_subject import PlantSubject
from rig.studies.search.plants.plant_workers import Here, processes

PLANTS = Path(__file__).parents[1] / "docs/examples/plants"
LOW = {"id": "low", "formula": "always[0, 10] x < 0.9"}
PLAN = {"duration_s": 10.0, "rate_hz": 10.0, "parameters": {"a": {"low": 0.0, "high": 1.0}}, "requirements": [LOW]}


def constant(a, duration_s):
    """Return what it is given."""
    times = np.linspace(0.0, duration_s, 11)
    return times, {"x": np.full(11, a)}


def plan(**changes):
    return {**PLAN, **changes}


def test_a_function_is_searched_and_its_violations_are_where_they_are():
    """The share above 0.9 is a tenth; the search finds it, and nothing else."""
    found = rig.search(constant, PLAN, simulations=64, seed=1)
    for draw, result in zip(found.draws, found.results, strict=True):
        assert result.robustness == pytest.approx(0.9 - draw.point[0], abs=1e-9)
        assert result.violated == (draw.point[0] >= 0.9)
    cluster = found.figures["clusters"][0]
    assert found.figures["violated"] > 5 and cluster["inputs"]["a"] > 0.9
    assert cluster["ranges"]["a"][0] >= 0.9 and found.figures["robustness"] == pytest.approx(-0.1, abs=0.02)


def test_signals_are_equal_pieces_constant_or_linear():
    held = Signal([1.0, 2.0, 4.0], 6.0)
    assert [held(t) for t in (-1.0, 0.0, 1.999, 2.0, 3.9, 4.0, 6.0, 9.0)] == [1, 1, 1, 2, 2, 4, 4, 4]
    assert held(np.array([0.3, 0.1 + 0.2, 5.0])).tolist() == [1, 1, 4]
    assert Signal([0.0, 1.0, 0.0], 2.0, "linear")(np.array([0.5, 1.0, 1.5])).tolist() == [0.5, 1.0, 0.5]
    tenths = Signal(np.arange(10), 1.0)
    assert [tenths(k * 0.1) for k in range(10)] == list(range(10))  # 0.3 is 3 * 0.1 rounded up


def test_a_space_has_a_number_for_each_piece_and_an_arm_for_each_listed_value():
    of = space_of(
        read_plan(
            plan(
                parameters={"a": {"low": 1.0, "high": 100.0, "log": True}, "mode": ["x", "y"]},
                signals={
                    "u": {"low": -1.0, "high": 1.0, "pieces": 4},
                    "v": {"low": 0.0, "high": 2.0, "pieces": 2, "shape": "linear"},
                },
            )
        )
    )
    assert [arm.dimensions for arm in of.arms] == [8, 8] and of.pieces == [[1, 2, 3, 4], [5, 6, 7]]
    given = of.inputs(1, np.array([0.5, 0.0, 0.25, 0.5, 0.75, 0.0, 0.5, 0.25]))
    assert given["a"] == pytest.approx(10.0) and given["mode"] == "y"
    assert given["u"].tolist() == [-1.0, -0.5, 0.0, 0.5] and given["v"].tolist() == [0.0, 1.0, 0.5]


def test_signals_are_first_drawn_in_few_parts_and_corners_are_reached():
    signals = {name: {"low": 0.0, "high": 1.0, "pieces": pieces} for name, pieces in (("u", 3), ("v", 8))}
    ends = {"id": "ends", "formula": "always[0, 10] u < 0.99999"}  # violated at the bound alone
    found = rig.search(
        lambda u, v, duration_s: (np.linspace(0.0, 10.0, 101), {}),
        plan(parameters={}, signals=signals, requirements=[ends]),
        simulations=100,
    )
    parts = {len(np.unique(draw.point[3:])) for draw in found.draws[:24]}
    assert parts == {1, 2, 4, 8} and found.figures["violated"] > 0


def test_requirements_are_over_columns_inputs_and_yes_or_no():
    columns = {"x": np.linspace(0.0, 10.0, 101), "on": np.arange(101) > 50}
    asked = [
        {"id": "whole", "formula": "always[0, 10] x <= 12", "scale": 4.0},
        {"id": "given", "formula": "always[0, 10] (on implies x > 5)", "scale": 0.1},
        {"id": "late", "formula": "eventually[8, 9] not on"},
    ]
    of = PlantSubject(read_plan(plan(requirements=asked)).requirements, columns, 10.0, 10.0)
    told = {each.requirement: each for each in of.verdicts(columns)}
    assert told["whole"][1:] == ("met", pytest.approx(0.5), pytest.approx(10.0))
    assert told["given"][1:] == ("met", pytest.approx(1.0), pytest.approx(0.0))  # -1 where it is off: not on is 1
    assert told["late"].status == "violated" and told["late"].robustness == -1.0


def test_a_trace_that_ends_early_is_judged_on_what_there_is():
    frames = simulate(lambda a: ([0.0, 0.35], {"x": [1.0, 2.0]}), Call({"a": 0.0}, {}, 10.0, 10.0, 0)).columns
    assert frames is not None and frames["x"].tolist() == [1.0, 1.0, 1.0, 1.0] and len(frames["a"]) == 4


def test_sides_of_very_different_size_without_a_scale_are_told():
    both = {"id": "both", "formula": "always[0, 9] rpm < 3000 implies always[0, 4] x < 35"}
    columns = {"rpm": np.full(101, 900.0), "x": np.full(101, 0.1)}
    asked = read_plan(plan(requirements=[{**both, "formula": both["formula"].replace("35", "3.5")}])).requirements
    assert "rpm are up to 3e+03, of both: x 3.5" in PlantSubject(asked, columns, 10.0, 10.0).unlike(columns)
    for quiet in (both, {**both, "formula": both["formula"].replace("35", "3.5"), "scale": [1e3, 1.0]}):
        asked = read_plan(plan(requirements=[quiet])).requirements
        assert PlantSubject(asked, columns, 10.0, 10.0).unlike(columns) == ""


BAD_PLANS = [
    (plan(parameters={"a": {"low": 1.0, "high": 1.0}}), r"plan: parameters\.a: low \(1\) must be below high"),
    (plan(signals={"u": {"low": 2.0, "high": 1.0, "pieces": 2}}), r"signals\.u: low \(2\) must be below high"),
    (plan(signals={"u": {"low": 0.0, "high": 1.0, "pieces": 0}}), r"signals\.u\.pieces: must be 1 or more"),
    (plan(signals={"u": {"low": 0.0, "high": 1.0, "pieces": 2, "shape": "cubic"}}), r"signals\.u\.shape"),
    (plan(signals={"a": {"low": 0.0, "high": 1.0, "pieces": 2}}), r"signals\.a: is a parameter too"),
    (plan(parameters={}), "nothing varies; a search needs a range"),
    (plan(parameters={"a": [1, 2]}), "nothing varies; a search needs a range"),
    (plan(parameters={"seed": {"low": 0.0, "high": 1.0}}), "'seed': must be the name of an argument"),
    (plan(parameters={"a.b": {"low": 0.0, "high": 1.0}}), "'a.b': must be the name of an argument"),
    (plan(duration_s=1e6), "at most 1000000 frames"),
    (plan(requirements=[]), "requirements"),
    (plan(requirements=[LOW, LOW]), r"requirements\.1\.id: low is already used"),
    (plan(requirements=[{**LOW, "at": "each onset"}]), "at, signals and {signal} are of flights"),
    (plan(requirements=[{**LOW, "formula": "always[0, 1] x <"}]), r"requirements\.0\.formula: column"),
    (plan(repeat=3), "repeat: unknown key; nearest: repeats"),
]


@pytest.mark.parametrize(("given", "says"), BAD_PLANS)
def test_a_plan_that_makes_no_sense_is_one_line(given, says):
    with pytest.raises(BadInput, match=says) as refused:
        rig.search(constant, given, simulations=4)
    assert "\n" not in str(refused.value)


BAD_REQUIREMENTS = [
    ({"formula": "always[0, 1] height < 1"}, "column 14: the plant has no column 'height', allowed: a, speed, yes"),
    ({"formula": "speed"}, "column 1: 'speed' is not a condition"),
    ({"formula": "yes < 1"}, "'yes' is a yes or no, not a number"),
    ({"formula": "always[0, 11] speed < 1"}, "windows of 11 s, at most 10 s are allowed"),
    ({"formula": "always[0.01, 0.02] speed < 1"}, "contains no frame at 10 frames a second"),
    ({"formula": "1 < 2"}, "names no column"),
    ({"formula": "speed < 1", "scale": [1.0, 2.0]}, "scale: 2 values for 1 comparisons"),
]


@pytest.mark.parametrize(("keys", "says"), BAD_REQUIREMENTS)
def test_a_requirement_that_the_plant_cannot_be_measured_by_is_one_line(keys, says):
    plant = lambda a: ([0.0, 10.0], {"speed": [1.0, 2.0], "yes": [True, False]})  # noqa: E731
    with pytest.raises(BadInput, match=says) as refused:
        rig.search(plant, plan(requirements=[{**LOW, **keys}]), simulations=4)
    assert "\n" not in str(refused.value) and "requirement low" in str(refused.value)


BAD_FUNCTIONS = [
    (lambda b: None, "takes no argument 'a', allowed: b"),
    (lambda a, b: None, "needs the argument b; add it to"),
    (lambda a, /: None, "its argument a cannot be given by name"),
    ("docs", "--plant docs: must be FILE.py:function"),
    (3, "is not a function, but int"),
]


@pytest.mark.parametrize(("function", "says"), BAD_FUNCTIONS)
def test_a_function_that_does_not_take_the_plan_is_one_line(function, says):
    with pytest.raises(BadInput, match=says):
        rig.search(function, PLAN, simulations=4)


def test_repeats_need_a_seed():
    with pytest.raises(BadInput, match="takes no seed, so that all repeats would be equal"):
        rig.search(constant, plan(repeats=3), simulations=4)


RETURNS = [
    ("1 / 0", "ZeroDivisionError: division by zero"),
    ("exit(3)", "SystemExit: 3"),
    ("3", "it must return two things"),
    ("[0, 1], [1, 2]", "its columns must be a table by name"),
    ("[0, 1], {'x': [1]}", "column 'x' has 1 values; there are 2 times"),
    ("[0, 1], {'x': [[1], [2]]}", r"column 'x' has \(2, 1\)"),
    ("[0, 1], {'x': [1, float('nan')]}", "column 'x' is nan at 1 s"),
    ("[0, 1], {'x': ['a', 'b']}", "column 'x' must be numbers"),
    ("[0, 1], {'y': [1, 2]}", "this time it returned no column 'x'"),
    ("[1, 2], {'x': [1, 2]}", "must begin at 0 s"),
    ("[1, 0], {'x': [1, 2]}", "finite and in order"),
    ("[], {'x': []}", "one time or more"),
    ("'ab', {'x': [1]}", "its times must be numbers"),
]


@pytest.mark.parametrize(("returns", "says"), RETURNS)
def test_what_a_plant_does_wrong_is_a_failed_row_and_no_violation(returns, says):
    """It fails above 0.5; the centre of its ranges is not tried alone."""

    def plant(a):
        if a > 0.5:
            return eval(returns)  # of this test
        return [0.0, 10.0], {"x": [0.0, 0.0]}

    found = rig.search(plant, PLAN, simulations=16)
    failed = [result.failed for result in found.results if result.failed]
    assert 4 < len(failed) == found.figures["failed"] < 16 and found.figures["violated"] == 0
    first = found.figures["first_failed"]
    assert found.results[first["number"] - 1].failed and first["inputs"]["a"] > 0.5
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(found.figures["first_failed"]["reason"])


def test_a_plant_that_always_fails_is_refused_with_its_reason():
    with pytest.raises(BadInput, match=r"failed at 8 of 8 points; at the centre of the ranges: KeyError: 'mass'"):
        rig.search(lambda a: {}["mass"], PLAN, simulations=4)


def written(tmp_path, body, name="plant.py"):
    path = tmp_path / name
    path.write_text("import os, time\nimport numpy as np\n" + body)
    return path


def simulated(path, values, timeout_s=5.0, workers=1):
    calls = [Call({"a": value}, {}, 10.0, 10.0, 0) for value in values]
    with processes(f"{path}:plant", timeout_s, workers) as runner:
        return runner.run(calls, Stop())


ENDS = "def plant(a):\n    if a > 0.5:\n        {}\n    return [0.0, 10.0], {{'x': [a, a]}}\n"


@pytest.mark.parametrize(
    ("does", "says"),
    [
        ("time.sleep(60)", "it took longer than timeout_s = 1 s"),
        ("while True: pass", "it took longer than timeout_s = 1 s"),
        ("os._exit(7)", "its process ended with exit code 7"),
        ("os.kill(os.getpid(), 9)", "its process was killed by signal 9"),
    ],
)
def test_a_simulation_that_never_ends_or_ends_its_process_fails_alone(tmp_path, does, says):
    outcomes = simulated(written(tmp_path, ENDS.format(does)), (0.1, 0.9, 0.2), timeout_s=1.0)
    assert says in outcomes[1].reason and outcomes[1].columns is None
    assert [(outcome.columns or {})["x"][0] for outcome in outcomes[::2]] == [0.1, 0.2]


def test_a_function_of_this_process_is_limited_too():
    took = time.monotonic()
    outcome = Here(lambda a: time.sleep(60), 0.3).run([Call({"a": 0.0}, {}, 10.0, 10.0, 0)], Stop())[0]
    assert outcome.reason == "it took longer than timeout_s = 0.3 s" and time.monotonic() - took < 10.0


def test_prints_are_kept_apart_and_told(tmp_path, capfd):
    path = written(
        tmp_path, "def plant(a):\n    print('hello')\n    os.write(1, b'raw')\n    return [0.0], {'x': [a]}\n"
    )
    assert [outcome.printed for outcome in simulated(path, (0.1, 0.2), workers=2)] == ["hello\n", "hello\n"]
    here = Here(lambda a: sys.stdout.write("x" * 10**6), 5.0)
    assert here.run([Call({"a": 0.0}, {}, 1.0, 1.0, 0)], Stop())[0].printed == "x" * 300
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("def other(a): pass\n", "has no function 'plant'"),
        ("def plant(:\n", "cannot be imported: SyntaxError"),
        ("import nothing_of_this_name\n", "cannot be imported: ModuleNotFoundError"),
        ("os._exit(3)\n", "its import ended a process"),
        ("plant = 3\n", "is not a function, but int"),
    ],
)
def test_a_file_that_has_no_such_function_is_one_line(tmp_path, text, says):
    path = written(tmp_path, text)
    with pytest.raises(BadInput, match=says):
        rig.search(f"{path}:plant", PLAN, simulations=4)


def test_a_seed_decides_noise_and_a_cluster_is_confirmed_on_seeds_that_did_not_choose_it(tmp_path):
    path = written(
        tmp_path,
        "def plant(a, seed):\n    x = a + 0.3 * np.random.default_rng(seed).standard_normal()\n"
        "    return [0.0, 10.0], {'x': [x, x]}\n",
    )
    found = rig.search(f"{path}:plant", plan(repeats=2), simulations=32, workers=2)
    cluster = found.figures["clusters"][0]
    assert cluster["confirmed_on"] == "new seeds" and cluster["confirmed"][1] == 20
    low, high = cluster["interval"]
    assert low <= cluster["confirmed"][0] / 20 <= high
    every = seeds_of(0, 0, 200) + seeds_of(0, 1 << 31, 200)
    assert len(set(every)) == len(every) and max(every) < 2**31


def table_of(folder):
    """What decides a search: the files of its rounds."""
    return {path.name: path.read_bytes() for path in sorted((folder / "rounds").glob("*.json"))}


@pytest.mark.long
def test_the_same_search_for_any_workers_and_interruption(tmp_path, rig_command):
    path = written(tmp_path, "def plant(a):\n    time.sleep(0.02)\n    return [0.0, 10.0], {'x': [a, a]}\n")
    (tmp_path / "plan.toml").write_text(
        "duration_s = 10.0\nrate_hz = 10.0\n[parameters]\na = { low = 0.0, high = 1.0 }\n"
        "[[requirements]]\nid = 'low'\nformula = 'always[0, 10] x < 0.9'\n"
    )
    for workers in (1, 2):
        rig.search(
            f"{path}:plant", tmp_path / "plan.toml", simulations=44, out=tmp_path / f"o{workers}", workers=workers
        )
    command = ["search", "plan.toml", "--plant", "plant.py:plant", "--flights", "44", "--out", "killed", "--json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "rig", *command], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 60.0
    while not (tmp_path / "killed/rounds/00001.json").exists() and time.monotonic() < until:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    code, out, _ = rig_command(*command)
    first = table_of(tmp_path / "o1")
    assert len(first) > 3 and first == table_of(tmp_path / "o2")
    names = [json.loads(data)["results"] for data in first.values()]
    assert names == [json.loads(data)["results"] for data in table_of(tmp_path / "killed").values()]
    assert code == 0 and json.loads(out)["simulations"] == 44


@pytest.mark.long
def test_a_second_interruption_ends_a_simulation_that_runs(tmp_path):
    begun = tmp_path / "begun"
    path = written(tmp_path, f"def plant(a):\n    open({str(begun)!r}, 'w').close()\n    time.sleep(60)\n")
    (tmp_path / "plan.toml").write_text(
        "duration_s = 10.0\ntimeout_s = 50.0\n[parameters]\na = { low = 0.0, high = 1.0 }\n"
        "[[requirements]]\nid = 'low'\nformula = 'always[0, 10] x < 0.9'\n"
    )
    command = [sys.executable, "-m", "rig", "search", "plan.toml", "--plant", f"{path}:plant", "--flights", "30"]
    process = subprocess.Popen([*command, "--out", "o"], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60.0
    while not begun.exists() and time.monotonic() < until:
        time.sleep(0.05)
    asked = time.monotonic()
    for _ in range(2):
        process.send_signal(signal.SIGINT)
        time.sleep(1.0)
    error = process.communicate(timeout=40.0)[1]
    assert process.returncode == 130 and "stopped: 0 of 30 simulations" in error
    assert time.monotonic() - asked < 40.0 and not (tmp_path / "o").exists()


def test_a_folder_of_another_search_or_plant_is_refused(tmp_path):
    path = written(tmp_path, "def plant(a):\n    return [0.0, 10.0], {'x': [a, a]}\n")
    rig.search(f"{path}:plant", PLAN, simulations=30, out=tmp_path / "o")
    with pytest.raises(BadInput, match="contains another search"):
        rig.search(f"{path}:plant", PLAN, simulations=31, out=tmp_path / "o")
    (tmp_path / "o/rounds/00000.json").write_text("{}")
    with pytest.raises(BadInput, match=r"00000\.json: is damaged.*delete this file: the same command simulates"):
        rig.search(f"{path}:plant", PLAN, simulations=30, out=tmp_path / "o")
    (tmp_path / "o/rounds/00000.json").unlink()
    assert rig.search(f"{path}:plant", PLAN, simulations=30, out=tmp_path / "o").simulations == 30
    written(tmp_path, "def plant(a):\n    return [0.0, 10.0], {'x': [a, a + 1]}\n")
    with pytest.raises(BadInput, match="contains another search"):
        rig.search(f"{path}:plant", PLAN, simulations=30, out=tmp_path / "o")


def test_an_agent_runs_no_code(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.studies.search.plants.plant_workers.may_run_code", lambda: False)
    with pytest.raises(BadInput, match="is code, and rig mcp runs no code"):
        rig.search(f"{written(tmp_path, '')}:plant", PLAN, simulations=4)


@pytest.mark.long
def test_jsbsim_is_not_loaded(tmp_path):
    """Neither by rig.search, nor by the command."""
    code = (
        "import sys, rig\n"
        "from rig.cli.main import main\n"
        "found = rig.search('tank.py:tank', 'tank.toml', simulations=24)\n"
        "assert found.figures['simulations'] == 24 and not found.figures['failed']\n"
        "sys.argv = ['rig', *'search tank.toml --plant tank.py:tank --flights 8'.split(), '--out', sys.argv[1]]\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end\n"
        "assert 'jsbsim' not in sys.modules\nprint('done')"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "o")], cwd=PLANTS, capture_output=True, text=True, env=os.environ
    )
    assert ended.returncode == 0 and ended.stdout.endswith("done\n"), ended.stderr


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--plant tank.py:tank --bench", "--bench: is for flights, not with --plant"),
        ("--plant tank.py:tank --set a=1", "--set: is for flights, not with --plant"),
        ("--plant tank.py:tank --requirement over", "--requirement 'over': unknown, allowed: overflow"),
        ("--plant tank.py:tank --method best", "--method 'best': must be one of regions, cma, random"),
        ("--plant tank.py", "--plant tank.py: must be FILE.py:function"),
        ("--plant no.py:tank", "no.py: no such file"),
        ("", "--requirement: is needed, except with --plant"),
    ],
)
def test_options_that_make_no_sense_are_one_line(rig_command, monkeypatch, tmp_path, options, says):
    monkeypatch.chdir(PLANTS)
    code, out, err = rig_command(
        "search", "tank.toml", *options.split(), "--flights", "8", "--out", str(tmp_path / "o")
    )
    assert (code, out, err.count("\n")) == (2, "", 1) and says in err and not (tmp_path / "o").exists()
