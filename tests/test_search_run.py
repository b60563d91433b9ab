"""One search: the same table for any workers and after any interruption; every find is flown from its file."""

import base64
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from rig.core.errors import BadInput
from rig.core.outputs import BESIDE_RUNS
from rig.core.progress import listening
from rig.scenario.scenario import load
from rig.studies.campaign import tables as table
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.run_campaign import again
from rig.studies.search import confirm_worst as confirming
from rig.studies.search import shrink as shrinking
from rig.studies.search import worst_cases as cases
from rig.studies.search.objective import chosen
from rig.studies.search.run_search import Ended, run
from rig.studies.search.search_plan import Asked, SearchPlan
from rig.verdict.requirements.requirement import Requirement

BASE = {
    "title": "Two offsets",
    "aircraft": "f16",
    "duration_s": 3.0,
    "redundancy": {"manager": "median"},
    "faults": [
        {"kind": "offset", "signal": "pitch_rate", "channels": [c], "start_s": 0.5, "offset": 0.1} for c in (1, 2)
    ],
}
VARY = {
    "faults.0.offset": {"low": 0.03, "high": 0.3, "log": True},
    "faults.1.start_s": {"low": 0.5, "high": 1.5},
}
SIGNS = [{"name": "alike", "set": {"faults.1.offset": 0.15}}, {"name": "apart", "set": {"faults.1.offset": -0.15}}]


def plan(flights: int = 44, formula: str = "", **asked: Any) -> SearchPlan:
    data = {"base": BASE, "sampling": "random", "runs": 1, "vary": VARY, "cases": {"signs": SIGNS}}
    requirements = [Requirement(id="x", formula=formula)] if formula else chosen(["vote"])
    ids = tuple(each.id for each in requirements)
    return SearchPlan(from_what(data, "c.toml"), "c.toml", Asked(ids, flights, **asked), requirements)


@pytest.fixture(autouse=True, scope="module")
def _few_confirming() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(confirming, "SEEDS", 3)
        patch.setattr(shrinking, "TRIES", 4)
        patch.setattr(cases, "UNDO_SEEDS", 3)
        patch.setattr(cases, "MOST", 2)
        yield


@pytest.fixture(scope="module")
def whole(once: Any) -> tuple[Path, Ended]:
    return once("search", lambda place: (place / "whole", run(plan(), place / "whole", workers=1)))


def robustness(told: str) -> float:
    return next(one["robustness"] for one in json.loads(told) if one["requirement"] == "vote")


def cut(whole: Path, out: Path, parts: int) -> Path:
    """The folder as a kill leaves it after so many parts, the next one half written."""
    shutil.copytree(whole, out)
    shutil.rmtree(out / "confirmed")
    for path in sorted((out / "runs").iterdir())[parts:]:
        path.unlink()
    for name in BESIDE_RUNS:
        (out / name).unlink(missing_ok=True)
    return out


def content(out: Path) -> tuple[Any, ...]:
    figures = json.loads((out / "search.json").read_text())
    confirmed = sorted(path.name for path in (out / "confirmed" / "runs").iterdir())
    clusters = [{**each, "scenario": Path(each["scenario"]).name} for each in figures["clusters"]]
    texts = [path.read_text() for path in sorted(out.glob("worst*.toml"))]
    return {**figures, "clusters": clusters}, texts, len(confirmed) > 0


def test_a_search_tells_what_it_found(whole: tuple[Path, Ended]):
    figures, at_random = whole[1].figures, whole[1].figures["random"]
    assert set(figures) == {
        *("flights", "violated", "random", "robustness", "clusters_found", "clusters", "left_out", "ended")
    }
    assert 24 < figures["flights"] == whole[1].flights <= 44 and at_random["flights"] == 24
    assert figures["violated"] >= at_random["violated"] and figures["robustness"] < 0.0
    runs = open_folder(whole[0]).tables["runs"]
    told = [{one["requirement"]: one["status"] for one in json.loads(each)} for each in runs["requirements"]]
    assert figures["violated"] == sum(of_flight["vote"] == "violated" for of_flight in told) > 0
    assert figures["robustness"] == min(map(robustness, runs["requirements"]))


def test_a_cluster_has_its_faults_its_ranges_and_its_share(whole: tuple[Path, Ended]):
    figures, runs = whole[1].figures, open_folder(whole[0]).tables["runs"]
    first, told = figures["clusters"][0], figures["clusters"]
    assert 1 <= len(told) <= 2 <= figures["clusters_found"] + 1 and sum(each["flights"] for each in told) > 2
    assert first["arm"] == "alike" and first["confirmed"][0] >= 2 and first["confirmed"][1] == 3
    assert first["faults"] == [f"offset: pitch_rate, channel {c}" for c in (1, 2)]
    low, high = first["interval"]
    share = first["confirmed"][0] / 3
    assert 0.0 < low < share <= high
    assert set(first["ranges"]) == set(VARY)
    worst = runs.filter(pl.col("run") == first["run"]).to_dicts()[0]
    for key, (least, most) in first["ranges"].items():
        assert VARY[key]["low"] <= least <= worst[key] <= most <= VARY[key]["high"]
    assert first["scenario"] == str(whole[0] / "worst.toml") and first["smallest"]["confirmed"][1] == 3


def test_the_page_of_a_search_shows_the_worst_flight(whole: tuple[Path, Ended]):
    text = (whole[0] / "search.html").read_text()
    drawn = json.loads(text.split('id="figures">')[1].split("</script>")[0])
    clusters = whole[1].figures["clusters"]
    assert list(drawn)[:3] == ["robustness", "1-moment-pitch_rate", "1-votes"] and "Plotly.react" in text
    assert all(f"{i}-votes" in drawn and f"Cluster {i}: " in text for i in range(1, len(clusters) + 1))
    number = clusters[0]["run"]
    (note,) = [each for each in drawn["robustness"]["layout"]["annotations"] if each["text"] == "1"]
    least = robustness(open_folder(whole[0]).tables["runs"].filter(pl.col("run") == number)["requirements"][0])
    assert (note["x"], note["y"]) == (number + 1, pytest.approx(least))
    assert f"rig fly {clusters[0]['scenario']}</code>" in text and "The search ended because" in text
    (error,) = [each for each in drawn["1-votes"]["data"] if each["name"].startswith("pitch_rate")]
    off = np.frombuffer(base64.b64decode(error["y"]["bdata"]), error["y"]["dtype"])
    assert np.abs(off).max() > 1.0  # the vote is wrong, which is what was searched


@pytest.mark.parametrize(("workers", "parts"), [(2, 1), pytest.param(3, 4, marks=pytest.mark.long)])
def test_any_workers_and_interruption_give_the_same(
    whole: tuple[Path, Ended], tmp_path: Path, workers: int, parts: int
):
    out = cut(whole[0], tmp_path / "cut", parts)
    ended = run(plan(), out, workers=workers)
    assert ended.table_sha256 == whole[1].table_sha256 and content(out) == content(whole[0])
    sums = [table.sha256(_confirmed(folder)) for folder in (out, whole[0])]
    assert sums[0] == sums[1]


def _confirmed(folder: Path) -> dict[str, Any]:
    from rig.studies.search.search_plan import ConfirmPlan

    return Folder(folder / "confirmed", ConfirmPlan(plan())).tables


@pytest.mark.long
def test_an_interruption_while_it_confirms_costs_no_flight(whole: tuple[Path, Ended], tmp_path: Path):
    def interrupt(what: str, done: int, total: int) -> None:
        if what.startswith("shrinking"):
            raise KeyboardInterrupt

    out = tmp_path / "cut"
    with pytest.raises(KeyboardInterrupt), listening(interrupt):
        run(plan(), out, workers=1)
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
    assert any("confirmed" in path.parts for path in before) and not (out / "worst.toml").exists()
    assert run(plan(), out, workers=1).table_sha256 == whole[1].table_sha256
    assert before == {path: path.stat().st_mtime_ns for path in before} and content(out) == content(whole[0])


def test_the_find_violates_when_it_is_flown_from_its_file(whole: tuple[Path, Ended]):
    from rig.verdict.requirements.measure import fly_requirements

    scenario = load(whole[0] / "worst.toml")
    verdict = fly_requirements(scenario, chosen(["vote"]))[0]
    assert verdict.status == "violated" and scenario.requirements == ["redundancy"]
    confirmed = whole[1].figures["clusters"][0]["smallest"]["confirmed"]
    assert f"vote violated in {confirmed[0]} of 3 seeds" in scenario.title


def test_the_runs_of_a_search_are_flown_again_as_those_of_a_campaign(whole: tuple[Path, Ended], tmp_path: Path):
    folder = open_folder(whole[0])
    number = whole[1].figures["clusters"][0]["run"]
    flight, digest = again(folder, number, tmp_path)
    assert flight.digest == digest and number > 0
    assert folder.status()["done"] == whole[1].flights and folder.status()["table_sha256"] == whole[1].table_sha256
    with pytest.raises(BadInput, match="confirming flights"):
        open_folder(whole[0] / "confirmed")


def test_the_confirmed_seeds_are_those_of_no_flight_of_the_search(whole: tuple[Path, Ended]):
    searched, confirmed = open_folder(whole[0]).tables["runs"]["seed"], _confirmed(whole[0])["runs"]["seed"]
    assert not set(searched) & set(confirmed)


def test_a_folder_of_another_search_is_refused(whole: tuple[Path, Ended]):
    with pytest.raises(BadInput, match=r"contains runs of another campaign: .*seed was 0, is 1"):
        run(plan(seed=1), whole[0], workers=1)


@pytest.mark.long
def test_against_another_setting_both_flights_are_of_one_draw(tmp_path: Path):
    ended = run(plan(70, against="redundancy.manager=cross-channel"), tmp_path / "s", workers=1)
    runs = open_folder(tmp_path / "s").tables["runs"]
    assert runs["manager"].to_list() == ["median", "cross-channel"] * (ended.flights // 2)
    assert runs["seed"][::2].to_list() == runs["seed"][1::2].to_list() and runs["seed"].n_unique() == len(runs) // 2
    least_of = [robustness(told) for told in runs["requirements"]]
    least = min(ours - theirs for ours, theirs in zip(least_of[::2], least_of[1::2], strict=True))
    assert ended.figures["robustness"] == pytest.approx(least)
    assert ended.figures["random"]["flights"] == 24 and again(open_folder(tmp_path / "s"), 1, tmp_path)[1]


def test_a_key_of_against_that_is_none_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match=r"^--against redundancy.managr=median: redundancy.managr: .*manager"):
        run(plan(70, against="redundancy.managr=median"), tmp_path / "s", workers=1)
    with pytest.raises(BadInput, match=r"^--against faults.0.offset: varies in the campaign"):
        plan(70, against="faults.0.offset=0.1")
    assert not (tmp_path / "s").exists()


@pytest.mark.long
def test_open_loop_trials_find_what_flies(tmp_path: Path):
    ended = run(plan(bench=True), tmp_path / "s", workers=1)
    first = ended.figures["clusters"][0]
    assert ended.figures["robustness"] < 0.0 and first["arm"] == "alike"
    assert first["confirmed"][0] >= 2  # of flights
    with pytest.raises(BadInput, match="open-loop trials"):
        open_folder(tmp_path / "s")


def test_what_open_loop_trials_do_not_have_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match=r"^--bench: .*x: formula: column 1: 'departure': an open-loop trial has no"):
        run(plan(bench=True, formula="departure >= 0.2"), tmp_path / "s", workers=1)


TRIALS_FIRST = {"flights": 32, "trials_first": True}


@pytest.fixture(scope="module")
def after_trials(once: Any) -> tuple[Path, Ended]:
    return once("after-trials", lambda place: (place / "s", run(plan(**TRIALS_FIRST), place / "s", workers=1)))


@pytest.mark.long
def test_trials_before_the_flights_say_where_the_flights_begin(after_trials: tuple[Path, Ended]):
    folder, ended = after_trials
    trials = ended.figures["trials"]
    assert trials["trials"] == 320 and trials["violated"] > 160 and trials["flights"] == 8
    assert trials["agree"] >= 6 and ended.flights == 32
    runs = open_folder(folder).tables["runs"]
    least = [robustness(told) for told in runs["requirements"]]
    assert np.median(least[24:32]) < np.median(least[:24])


@pytest.mark.long
def test_a_cut_search_makes_the_trials_before_its_flights_again(after_trials: tuple[Path, Ended], tmp_path: Path):
    folder, ended = after_trials
    again_ended = run(plan(**TRIALS_FIRST), cut(folder, tmp_path / "cut", 1), workers=2)
    assert again_ended.table_sha256 == ended.table_sha256 and again_ended.figures["trials"] == ended.figures["trials"]


def test_a_search_of_another_version_of_the_forest_is_refused(
    whole: tuple[Path, Ended], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("rig.studies.search.methods.forest_version", lambda: "scikit-learn 99.0")
    with pytest.raises(
        BadInput, match=r"contains runs of another campaign: search.forest was .*scikit-learn 99.0"
    ) as e:
        run(plan(), whole[0], workers=1)
    assert "\n" not in str(e.value)


def test_a_requirement_that_no_fault_is_needed_to_violate_is_refused_before_anything_is_written(tmp_path: Path):
    with pytest.raises(BadInput, match=r"^--requirement x: violated without any fault at 0.00 s"):
        run(plan(formula="true.altitude_m >= 20000"), tmp_path / "s", workers=1)
    assert not list(tmp_path.iterdir())


def test_against_a_set_that_violates_without_faults_is_refused(tmp_path: Path):
    formula = "level.pitch_rate >= 4"
    with pytest.raises(BadInput, match=r"x: violated without any fault.*with sensors.pitch_rate.channels=3"):
        run(plan(70, formula=formula, against="sensors.pitch_rate.channels=3"), tmp_path / "s", workers=1)


@pytest.mark.long
def test_a_requirement_that_every_flight_violates_does_not_hide_another(tmp_path: Path):
    always = Requirement(id="always", formula="always[0, 2.9] abs(error.pitch_rate.1) <= 0.025")
    never = Requirement(id="never", formula="voted.pitch_rate < 100")
    data = {"base": BASE, "sampling": "random", "runs": 1, "vary": VARY, "cases": {"signs": SIGNS}}
    asked = [always, *chosen(["vote"]), never]
    searched = SearchPlan(from_what(data, "c.toml"), "c.toml", Asked(tuple(e.id for e in asked), 30), asked)
    figures = run(searched, tmp_path / "s", workers=1).figures
    assert figures["left_out"] == ["always"] and figures["violated"] < figures["flights"]
    smallest = figures["clusters"][0]["smallest"]
    assert smallest["violating"] == {"vote": smallest["confirmed"][0]}
    text = (tmp_path / "s" / "worst.toml").read_text()
    assert f"vote violated in {smallest['confirmed'][0]} of 3 seeds" in text and "always" not in text.split("\n")[3]
    assert "always:" not in text and "never" not in text


@pytest.mark.parametrize("damage", ["a loop", "deep", "another's", "a bit"])
def test_what_could_not_be_written_at_the_end_is_refused_before_the_first_flight(
    whole: tuple[Path, Ended], tmp_path: Path, damage: str
):
    out = cut(whole[0], tmp_path / "out", 1)
    (out / "confirmed").mkdir(exist_ok=True)
    if damage == "a loop":
        (out / "search.json").unlink(missing_ok=True)
        (out / "search.json").symlink_to("search.json")
    elif damage == "deep":
        (out / "confirmed" / "campaign.json").write_text("[" * 100_000)
    elif damage == "another's":
        (out / "confirmed" / "campaign.json").unlink(missing_ok=True)
        (out / "confirmed" / "notes.txt").write_text("mine")
    else:
        part = sorted((whole[0] / "confirmed" / "faults").iterdir())[0]
        for path in (whole[0] / "confirmed").rglob("*"):
            if path.is_file():
                to = out / "confirmed" / path.relative_to(whole[0] / "confirmed")
                to.parent.mkdir(exist_ok=True)
                to.write_bytes(path.read_bytes())
        flipped = bytearray(part.read_bytes())
        flipped[len(flipped) // 2] ^= 8
        (out / "confirmed" / "faults" / part.name).write_bytes(bytes(flipped))
    before = len(list((out / "runs").iterdir()))
    with pytest.raises(BadInput, match=r"search\.json|confirmed") as error:
        run(plan(), out, workers=1)
    assert "\n" not in str(error.value) and len(list((out / "runs").iterdir())) == before
