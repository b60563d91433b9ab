"""Sensitivity of a result: known functions, another implementation, a constructed campaign, and what has no answer."""

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from SALib.analyze import pawn as salib
from test_campaign_report import made

from rig.core.errors import BadInput
from rig.studies.campaign import pawn
from rig.studies.campaign.drivers import outputs, sensitivity
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.pawn import DUMMY, distances, indices, slices
from rig.studies.campaign.sensitivity_page import bars

RANGE = np.pi


def ishigami(x: Any) -> Any:
    """Ishigami and Homma (1990), a = 7, b = 0.1; x (..., 3), each uniform within +-pi."""
    return np.sin(x[..., 0]) + 7.0 * np.sin(x[..., 1]) ** 2 + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])


def exact(axis: int, count: int = 100, groups: int = 10) -> float:
    """The index of an input of Ishigami's function by a grid: no random number, no code of the rig."""
    at = (np.arange(count) + 0.5) / count * 2.0 * RANGE - RANGE
    y = np.moveaxis(ishigami(np.stack(np.meshgrid(at, at, at, indexing="ij"), axis=-1)), axis, 0)
    levels = np.linspace(y.min(), y.max(), 2001)
    whole = np.searchsorted(np.sort(y, axis=None), levels) / y.size
    parts = y.reshape(groups, -1)
    return float(np.median([abs(np.searchsorted(np.sort(p), levels) / p.size - whole).max() for p in parts]))


@pytest.fixture(scope="module")
def drawn() -> tuple[Any, Any]:
    x = np.random.default_rng(57).uniform(-RANGE, RANGE, (4000, 4))
    return x, ishigami(x)


def test_the_indices_of_ishigami_are_in_their_known_order_and_the_dummy_is_at_the_floor(
    drawn: Any, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(pawn, "RESAMPLES", 100)
    monkeypatch.setattr(pawn, "SHUFFLES", 100)
    x, y = drawn
    found = indices({f"x{i + 1}": slices(x[:, i]) for i in range(4)}, y)
    assert [each.name for each in found[:3]] == ["x2", "x1", "x3"]
    rest = {each.name: each for each in found}
    assert all(rest[name].is_above_floor for name in ("x1", "x2", "x3"))
    assert not rest["x4"].is_above_floor and not rest[DUMMY].is_above_floor
    for axis, name in enumerate(("x1", "x2", "x3")):
        # A distance between samples of 400 and 4,000 is larger by noise: about 0.03 where there is none.
        assert rest[name].index == pytest.approx(exact(axis), abs=0.035)
        assert rest[name].low < rest[name].index < rest[name].high < rest[name].low + 0.12


def test_the_distances_are_those_of_salib(drawn: Any):
    x, y = drawn
    problem = {"num_vars": 4, "names": ["x1", "x2", "x3", "x4"], "bounds": [[-RANGE, RANGE]] * 4}
    theirs = salib.analyze(problem, x, y, S=10)  # without the largest value of an input
    for i in range(4):
        apart = distances(slices(x[:, i]), y)
        assert np.median(apart) == pytest.approx(theirs["median"][i], abs=0.002)
        assert apart.max() == pytest.approx(theirs["maximum"][i], abs=0.002)


def test_equal_outputs_and_names_are_counted_exactly():
    """Of two groups of 2 and 6 rows: all true in one, 2 of 6 in the other; 4 of 8 in all."""
    codes, y = np.array([0, 0, 1, 1, 1, 1, 1, 1]), np.array([1, 1, 1, 1, 0, 0, 0, 0], float)
    assert distances(codes, y) == pytest.approx([1 / 2, 1 / 2 - 1 / 3])
    assert distances(np.zeros(8, int), y) == pytest.approx([0.0])


def test_the_floor_is_exceeded_by_noise_in_about_a_twentieth_of_the_cases(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pawn, "RESAMPLES", 2)  # of the interval, which is not the floor
    rng, above = np.random.default_rng(1), 0
    for seed in range(20):
        names = rng.integers(0, 3, 200)
        found = indices({"names": names}, rng.random(200), seed)
        above += sum(each.is_above_floor for each in found)
    assert above <= 7  # of 40, binomial: more in 0.07 % of the cases


def test_the_same_seed_gives_the_same_figures_and_another_does_not():
    x = np.random.default_rng(2).random((200, 1))
    given = {"x": slices(x[:, 0])}, x[:, 0] ** 2
    assert indices(*given) == indices(*given) != indices(*given, seed=1)


def test_few_numbers_are_levels_and_many_are_slices():
    assert slices(np.array([3.0, 1.0, np.nan, 3.0])).tolist() == [1, 0, -1, 1]
    codes = slices(np.arange(1000.0))
    assert np.bincount(codes).tolist() == [100] * 10
    assert len(np.unique(slices(np.arange(100.0)))) == 5  # 20 rows each
    assert len(np.unique(slices(np.array([0.0] * 900 + [*range(100)])))) < 10  # equal numbers stay together


def campaign(path: Path, delays: Any = None, runs: int = 40, **what: Any) -> Folder:
    """Runs of two turbulences and a list of winds; the delay follows the turbulence alone."""
    vary = {"turbulence": ["none", "light"], "wind.speed": [1.0, 2.0], **what}
    pairs = list(product(["none", "light"], [1.0, 2.0]))
    times = [0.1 + 0.001 * (run % 7) + 0.2 * (pairs[run % 4][0] == "light") for run in range(runs)]
    own = {"outcome": "flown", "aircraft": "f16", "flight_point": "20000ft_m06", "manager": "cross-channel"}
    flights = [{"run": run, "seed": run, "survived": True, "frames": 100, **own} for run in range(runs)]
    fault = {
        "fault": 0,
        "signal": "pitch_rate",
        "channel": 1,
        "kind": "offset",
        "magnitude": 0.1,
        "outcome": "detected",
    }
    faults = [
        {"run": run, **fault, "delay_from_onset_s": time}
        for run, time in enumerate(times if delays is None else delays)
    ]
    rows = {"runs": flights, "faults": faults, "alarms": [], "episodes": []}
    return made(path, rows, vary=vary, sampling="grid", runs=max(runs, 4))


def test_what_a_campaign_varied_is_ranked(tmp_path: Path, rig_command: Any):
    folder = campaign(tmp_path / "c", runs=60)
    found = sensitivity(folder, "delay_s")
    assert found["inputs"][0]["name"] == "turbulence"
    assert {row["name"]: row["verdict"] for row in found["inputs"]} == {
        "turbulence": "yes",
        "wind.speed": "no",
        "dummy": "",
    }
    assert found["inputs"][0]["index"] == pytest.approx(0.5)  # two halves that do not overlap
    assert found == sensitivity(folder, "delay_from_onset_s") | {"of": "delay_s"}
    assert {trace["name"] for trace in bars(found).to_dict()["data"]} == {"index with 95 % interval", "noise floor"}
    code, out, _ = rig_command("campaign", "sensitivity", str(folder.path), "--of", "delay_s", "--json")
    page = folder.path / "sensitivity.html"
    assert (
        code == 0 and json.loads(out) == {"report": str(page), **found} and "Sensitivity of delay_s" in page.read_text()
    )


def test_flights_without_the_output_are_left_out_and_counted(tmp_path: Path, rig_command: Any):
    folder = campaign(tmp_path / "c", [None if run < 9 else 0.1 + 0.001 * run for run in range(60)], runs=60)
    found = sensitivity(folder, "delay_s")
    assert (found["flights"], found["rows"], found["left_out"]) == (60, 51, 9)
    _, out, _ = rig_command("campaign", "sensitivity", str(folder.path), "--of", "delay_s")
    assert "51 of 60 flights" in out and "left out: 9 flights without delay_s" in out


def test_what_has_no_answer_is_one_line(tmp_path: Path):
    folder = campaign(tmp_path / "c", runs=60)
    with pytest.raises(BadInput, match=r"--of delai_s: no flight has this column; nearest: delay_s"):
        sensitivity(folder, "delai_s")
    with pytest.raises(BadInput, match=r"survived: is 1 in all 60 flights"):
        sensitivity(folder, "survived")
    few = campaign(tmp_path / "few", runs=39)
    with pytest.raises(BadInput, match=r"delay_s: 39 of 39 flights have it; 40 are needed"):
        sensitivity(few, "delay_s")
    assert not {"run", "seed", "turbulence", "wind.speed"} & {*outputs(folder.plan)}


def test_a_campaign_that_varies_nothing_is_refused(tmp_path: Path):
    folder = campaign(tmp_path / "c", runs=60, turbulence=["none"], **{"wind.speed": [1.0]})
    with pytest.raises(BadInput, match="varies nothing that could drive delay_s"):
        sensitivity(folder, "delay_s")
