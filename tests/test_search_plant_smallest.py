"""The smallest input of a plant that still violates, its picture, and why the search ended."""

import json

import numpy as np
import pytest

import rig
from rig.studies.search import shrink
from rig.studies.search.plants.plant_file import read_plan
from rig.studies.search.plants.plant_smallest import smaller
from rig.studies.search.plants.plant_space import space_of
from rig.studies.search.plants.plant_words import narrow, values_told
from rig.studies.search.rounds import Draw

LOW = {"id": "low", "formula": "always[0, 10] x < 0.9"}
NORMAL = {"distribution": "norm", "parameters": {"scale": 1.0}, "low": -3.0, "high": 3.0}
SPACE = space_of(
    read_plan(
        {
            "duration_s": 10.0,
            "rate_hz": 10.0,
            "parameters": {
                "size": {"low": 1.0, "high": 100.0, "log": True},
                "count": {"low": 2, "high": 9, "whole": True},
                "drawn": NORMAL,
                "mode": ["a", "b"],
            },
            "signals": {
                "u": {"low": 0.0, "high": 2.0, "pieces": 8},
                "v": {"low": -4.0, "high": 1.0, "pieces": 4},
            },
            "requirements": [LOW],
        }
    )
)
POINT = np.array([0.9, 0.9, 0.8, *np.linspace(0.4, 0.95, 8), 0.1, 0.2, 0.3, 0.4])


def inputs(draw):
    return SPACE.inputs(draw.arm, draw.point)


def test_the_smallest_input_is_one_level_just_large_enough_and_all_else_is_near_zero():
    kept = smaller(SPACE, Draw(1, POINT), lambda draw: inputs(draw)["u"].mean() > 1.2)
    found = inputs(kept[-1])
    assert len(set(found["u"].tolist())) == 1 and 1.2 < found["u"][0] < 1.2 / 0.9 + 0.01
    assert float(f"{found['u'][0]:.2g}") == pytest.approx(found["u"][0])
    assert found["size"] == pytest.approx(1.0) and found["count"] == 2 and found["mode"] == "b"
    assert found["v"].tolist() == pytest.approx([0.0] * 4)  # zero is within its range
    assert found["drawn"] == inputs(kept[0])["drawn"]  # the number of a distribution stays


def test_a_signal_has_as_many_parts_as_it_takes():
    rises = lambda draw: inputs(draw)["u"][4:].mean() - inputs(draw)["u"][:4].mean() > 0.4  # noqa: E731
    u = inputs(smaller(SPACE, Draw(0, POINT), rises)[-1])["u"]
    assert len(set(u.tolist())) == 2 and u[0] == pytest.approx(0.0) and 0.4 < u[-1] < 0.5


def test_no_more_is_tried_than_allowed_and_nothing_is_kept_that_does_not_violate():
    tried: list[Draw] = []
    never = lambda draw: tried.append(draw)  # noqa: E731 # None: it does not violate
    assert smaller(SPACE, Draw(0, POINT), never)[1:] == [] and 8 < len(tried) <= shrink.TRIES  # pyright: ignore
    assert all(((draw.point >= 0.0) & (draw.point <= 1.0)).all() for draw in tried)


def test_inputs_are_told_in_words():
    given = {"size": 12.3456, "mode": "a", "u": [0.5] * 4 + [1.0] * 4, "v": [0.0] * 4}
    told = list(values_told(given, SPACE.plan))
    assert told == ["size 12.3", "mode a", "u 0.5 at 0 to 5 s", "u 1 at 5 to 10 s", "v 0 at 0 to 10 s"]
    assert list(narrow({"u": [[0.0, 2.0]] * 4 + [[0.1, 0.2]] * 4}, SPACE.plan)) == ["u 0.1 to 0.2 at 5 to 10 s"]


def plan(**changes):
    parameters = {"a": {"low": 0.0, "high": 1.0}, "b": {"low": -1.0, "high": 1.0}}
    return {"duration_s": 10.0, "rate_hz": 10.0, "parameters": parameters, "requirements": [LOW], **changes}


def alike(a, b):
    """Return ``a``; ``b`` has no use."""
    return [0.0, 10.0], {"x": [a, a], "up": [False, True]}


def noisy(a, b, seed):
    x = a + 0.05 * np.random.default_rng(seed).standard_normal()
    return [0.0, 10.0], {"x": [x, x]}


def test_a_cluster_has_its_smallest_input_with_what_it_is_worth():
    cluster = rig.search(alike, plan(), simulations=64).figures["clusters"][0]
    smallest = cluster["smallest"]
    assert 0.9 <= smallest["inputs"]["a"] <= cluster["inputs"]["a"] and smallest["inputs"]["b"] == pytest.approx(0.0)
    assert smallest["robustness"] == pytest.approx(0.9 - smallest["inputs"]["a"], abs=1e-9)


def test_with_a_seed_the_smallest_input_is_told_on_seeds_that_did_not_choose_it():
    cluster = rig.search(noisy, plan(), simulations=64).figures["clusters"][0]
    smallest = cluster["smallest"]
    assert smallest["confirmed_on"] == "new seeds" and smallest["confirmed"][1] == 20
    assert smallest["confirmed"][0] <= cluster["confirmed"][0] and smallest["inputs"]["b"] == pytest.approx(0.0)


def test_the_page_shows_each_cluster_over_time_and_why_the_search_ended(tmp_path):
    signals = {"u": {"low": 0.0, "high": 1.0, "pieces": 4}}
    function = lambda a, b, u: ([0.0, 4.0, 8.0], {"x": [a, a, a], "speed": [1.0, 2.0, 3.0], "up": [True] * 3})  # noqa: E731
    found = rig.search(function, plan(signals=signals, title="<b>"), simulations=40, out=tmp_path / "o").figures
    page = (tmp_path / "o/search.html").read_text()
    drawn = json.loads(page.split('id="figures">')[1].split("</script>")[0])
    assert set(drawn) == {"robustness", *(f"cluster-{i + 1}" for i in range(len(found["clusters"])))}
    axes = [of["title"]["text"] for key, of in drawn["cluster-1"]["layout"].items() if key.startswith("yaxis")]
    assert axes == ["u", "x", "speed", "up"]  # the signal, the requirement's column, the others; no parameter
    assert drawn["cluster-1"]["layout"]["title"]["text"] == "low is violated, most at 0 s"
    assert {trace["name"] for trace in drawn["cluster-1"]["data"]} == {"worst case", "smallest input"}
    assert "&lt;b&gt;: violations" in page and found["ended"] in page
    assert found["ended"].startswith("all 40 simulations are run; regions: ")


def test_of_several_seeds_of_a_point_the_one_that_violates_is_drawn(tmp_path):
    """With repeats the lowest robustness counts, so the table and the picture are of that seed."""
    wide = lambda a, b, seed: ([0.0, 10.0], {"x": [a + 0.5 * (seed % 2)] * 2})  # noqa: E731
    figures = rig.search(wide, plan(repeats=5), simulations=24, out=tmp_path / "o").figures
    for cluster in figures["clusters"]:
        rows = (tmp_path / "o" / f"cluster_{figures['clusters'].index(cluster) + 1}.csv").read_text().splitlines()
        x = dict(zip(rows[0].split(","), rows[1].split(","), strict=True))["x"]
        assert float(x) >= 0.9


def test_without_a_violation_there_is_a_page_without_a_cluster(tmp_path):
    small = {"a": {"low": 0.0, "high": 0.5}, "b": {"low": 0.0, "high": 1.0}}
    found = rig.search(alike, plan(parameters=small), simulations=30, out=tmp_path / "o").figures
    assert found["clusters"] == [] and "No simulation violates" in (tmp_path / "o/search.html").read_text()
