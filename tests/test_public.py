"""``rig`` for programs: scenarios and overrides as tables, faults, scores, reports and votes; the page of the docs."""

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import rig
from rig.core.errors import BadInput
from rig.log.info import info
from rig.scenario.overrides import override_texts, parse_set

ROOT = Path(__file__).parents[1]
CHANNELS = ROOT / "docs" / "examples" / "channels.csv"
OFFSET = {"signal": "pitch_rate", "channels": [3], "offset": 0.05, "start_s": 0.5}


def test_the_worked_example_of_the_page_runs_and_prints_what_it_says(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    said: list[str] = []
    space: dict[str, Any] = {"print": lambda *values: said.append(" ".join(map(str, values)))}
    page = (ROOT / "docs" / "reference" / "api.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    exec("\n".join(blocks), space)
    (printed,) = re.findall(r"^```\n\n```text\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert said[:5] == printed.splitlines() and said[1] == "detected 7"
    assert said[5] == "<Votes 1000 rows of pitch_rate: isolated no channel>"
    assert str(space["scored"]).startswith("SURVIVED") and "pitch rate, channel 3" in str(space["scored"])
    assert len(space["voted"]) == 600 and space["page"].is_file()
    assert "pitch_rate.state.1" in space["table"].columns


def test_a_scenario_is_a_table_a_loaded_one_or_a_file_and_flies_the_same(tmp_path: Path):
    keys = {"duration_s": 1.0, "seed": 3, "faults": [{"kind": "offset", **OFFSET}]}
    flown = rig.fly(keys, out=tmp_path)
    (tmp_path / "mine.toml").write_text(
        'duration_s = 1.0\nseed = 3\n[[faults]]\nkind = "offset"\nsignal = "pitch_rate"\nchannels = [3]\n'
        "offset = 0.05\nstart_s = 0.5\n"
    )
    others = [tmp_path / "mine.toml", rig.load(keys), {**keys, "faults": [rig.fault("offset", **OFFSET)]}]
    assert {rig.fly(other, out=tmp_path).digest for other in others} == {flown.digest}
    assert info(flown.log)["overrides"] == []  # its own table is in the log


def test_overrides_are_a_table_of_dotted_keys_and_reach_a_loaded_scenario_too(tmp_path: Path):
    overrides = {"duration_s": 2, "redundancy.manager": "mean", "faults": [rig.fault("offset", **OFFSET)]}
    made = rig.load(None, overrides)
    assert (made.duration_s, made.redundancy.manager, made.faults[0].kind) == (2.0, "mean", "offset")
    again = rig.load(made, {"faults.0.offset": np.float64(0.25)}, seed=9)
    assert again.faults[0].model_dump()["offset"] == 0.25 and again.seed == 9 and again.redundancy.manager == "mean"
    with pytest.raises(BadInput, match="aircraft: cannot be changed in a loaded scenario"):
        rig.load(made, {"aircraft": "b747"})


@pytest.mark.parametrize(
    "value", [1, 0.1, True, "mean", "3", "true", "a b", "[1]", 'say "x"', [1, "a"], {"a": {"b": [1.5]}}]
)
def test_a_value_of_a_table_is_the_same_when_it_is_read_as_text(value: object):
    (text,) = override_texts({"a.b": value})
    assert parse_set(text) == ("a.b", value)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"duration": 3}, r"^scenario: duration: unknown key; nearest: duration_s"),
        ({"faults": [{"kind": "hardovr"}]}, r"faults.0.kind: unknown kind 'hardovr'"),
        (
            {"wind": {"speed": object()}},
            r"^scenario.wind.speed: must be a number, a text, a list or a table, got <object",
        ),
    ],
)
def test_a_wrong_table_is_one_line_with_its_key(keys: dict[str, Any], says: str):
    with pytest.raises(BadInput, match=says):
        rig.load(keys)


def test_a_wrong_fault_or_limit_is_one_line_with_its_key():
    with pytest.raises(BadInput, match=r"^fault offset: chanels: unknown key; nearest: channels"):
        rig.fault("offset", signal="pitch_rate", chanels=[3], offset=0.1, start_s=1.0)
    with pytest.raises(BadInput, match=r"^fault: unknown kind 'ofset', nearest: offset"):
        rig.fault("ofset")
    with pytest.raises(BadInput, match=r"^score: window: unknown key; nearest: window_s"):
        rig.score("nowhere.mcap", window=1.0)
    with pytest.raises(BadInput, match=r"^config: signal.pitch_rate.treshold: unknown key; nearest: threshold"):
        rig.vote(CHANNELS, {"signal": {"pitch_rate": {"treshold": 1.0}}})


def test_a_scenario_by_itself_and_what_is_none_are_told_the_way(tmp_path: Path):
    keys: dict[str, Any] = {"aircraft": "f16"}
    with pytest.raises(BadInput, match=r"^make a Scenario with rig\.load: rig\.load\(\{'aircraft'"):
        rig.Scenario(**keys)
    given: Any = 3
    with pytest.raises(BadInput, match=r"^scenario: must be a file.s path, .* got 3"):
        rig.fly(given, out=tmp_path)


def test_a_flight_is_scored_with_the_class_that_flew_it(tmp_path: Path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs" / "examples" / "manager")
    flight = rig.fly(
        None, overrides={"duration_s": 1, "faults": [], "redundancy.manager": "mine:first_valid"}, out=tmp_path
    )
    scored = rig.score(flight)
    assert scored.voter == flight.voter == "manager mine:first_valid" and repr(scored) == "\n".join(scored.conclusion)
    with pytest.raises(BadInput, match="runs only with --allow-code"):
        rig.score(flight.log)


def test_votes_are_those_of_the_command(tmp_path: Path, rig_command):
    assert (
        rig_command("vote", str(CHANNELS), "--config", str(CHANNELS.with_name("vote.toml")), "--out", "v.parquet")[0]
        == 0
    )
    votes = rig.vote(CHANNELS, CHANNELS.with_name("vote.toml"), out=tmp_path / "mine.parquet")
    assert votes.to_polars().equals(pl.read_parquet(tmp_path / "v.parquet"))
    assert (tmp_path / "mine.parquet").read_bytes() == (tmp_path / "v.parquet").read_bytes()


def test_the_report_is_a_function_with_its_signature():
    assert list(inspect.signature(rig.report).parameters) == ["flight", "out", "requirements"]
    assert inspect.isfunction(rig.report) and "Write the report of a flight" in (inspect.getdoc(rig.report) or "")


@pytest.mark.parametrize("called", [rig.fly, rig.load])
def test_a_program_hears_of_overrides_and_not_of_options(called: Any):
    for overrides, message in (
        ({"faults.0.offset": 1}, r"overrides: faults\.0\.offset=1: '0' is an index into an empty list, faults"),
        ({"faultss": 1}, "scenario with overrides: faultss: unknown key"),
        ({"aircraft": 3}, "with overrides: aircraft: must be a name"),
    ):
        with pytest.raises(BadInput, match=message) as refused:
            called({"aircraft": "f16"}, overrides=overrides)
        assert "--set" not in str(refused.value)
    with pytest.raises(BadInput, match="with --set: faultss"):
        called({"aircraft": "f16"}, overrides=["faultss=1"])


def test_load_and_fly_take_their_arguments_in_one_order():
    for called in (rig.load, rig.fly):
        names = [name for name in inspect.signature(called).parameters if name in ("overrides", "seed")]
        assert names == ["overrides", "seed"]
