"""Votes in the viewer: an output of ``rig vote`` or a recording, read back from the .rrd by Rerun's own reader."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import foreign_logs
import numpy as np
import outside
import polars as pl
import pytest
from rerun.chunk import RrdReader
from test_viewer_columns import components

import rig
from rig.core.errors import BadInput
from rig.core.frame import State
from rig.show.viewer.opened import save
from rig.show.viewer.opened_votes import of_signals
from rig.show.viewer.vote_columns import NAMES
from rig.show.viewer.vote_layout import OVERVIEW, tabs
from rig.show.votes.vote_file import is_votes, read_votes

EPOCH_S, RATE_HZ, STEP_ROW, ISOLATED_ROW = 1_700_000_000.0, 100.0, 100, 107
CONFIG = '[signal."a b/c.d"]\nthreshold = 0.1\nunit = "deg/s"\n[discrete.down]\nfail_safe = 1\n'
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def voted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with times of the calendar, its configuration, and its votes in all formats."""
    folder = tmp_path_factory.mktemp("votes")
    channels = np.tile([0.0, 0.0, 0.02], (200, 1))
    channels[STEP_ROW:, 2] += 0.5
    columns = {f"a b/c.d.{c + 1}": channels[:, c] for c in range(3)} | {f"down.{c}": np.ones(200) for c in (1, 2)}
    pl.DataFrame({"time_s": EPOCH_S + np.arange(200) / RATE_HZ, **columns}).write_csv(folder / "in.csv")
    (folder / "vote.toml").write_text(CONFIG)
    for ending in ("mcap", "parquet", "csv"):
        rig.vote(folder / "in.csv", folder / "vote.toml", out=folder / f"v.{ending}")
    return folder


def numbers(rrd: Path, signal: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times, ns, and numbers by name of a signal in a saved recording."""
    times, values = components(RrdReader(rrd).stream())[f"/signal/{signal}", "rig.Vote:values"]
    rows = np.array([list(row) for row in values.to_pylist()])
    return np.array([int(t) for t in times.cast("int64").to_pylist()]), dict(zip(NAMES, rows.T, strict=True))


def test_an_output_of_rig_vote_in_the_viewer_has_channels_vote_and_differences(voted: Path, tmp_path: Path) -> None:
    save(of_signals(voted / "v.mcap", read_votes(voted / "v.mcap")), tmp_path / "v.rrd")
    times, of = numbers(tmp_path / "v.rrd", r"a\ b\/c.d")
    assert times == pytest.approx(np.arange(200) * 10_000_000, abs=1000)
    si = np.radians(0.52)  # an MCAP output is in SI
    assert of["voted"] == pytest.approx(0.0) and of["ch_3"][-1] == pytest.approx(si)
    assert of["apart_3"][-1] == pytest.approx(si) and np.isnan(of["ch_4"]).all() and np.isnan(of["apart_high"]).all()
    strips = components(RrdReader(tmp_path / "v.rrd").stream())
    at, states = strips[r"/a\ b\/c.d/channel_3", "StateChange:state"]
    assert [row[0] for row in states.to_pylist()] == ["OK", "SUSPECT", "FAILED"]
    assert at.cast("int64").to_pylist() == pytest.approx([0, STEP_ROW * 1e7, ISOLATED_ROW * 1e7], abs=1000)
    _, told = strips["/events", "TextLog:text"]
    assert told.to_pylist() == [["a b/c.d, channel 3: isolated"]]


def test_a_recording_that_is_voted_first_has_differences_in_thresholds(voted: Path, tmp_path: Path, run: Run) -> None:
    rrd = tmp_path / "v.rrd"
    code, out, _ = run("view", voted / "in.csv", "--config", voted / "vote.toml", "--save", rrd, "--json")
    assert code == 0 and json.loads(out)["frames"] == 200
    _, of = numbers(rrd, r"a\ b\/c.d")
    assert of["ch_3"][0] == pytest.approx(0.02) and of["apart_3"][0] == pytest.approx(0.2)
    assert of["apart_3"][-1] == 1.5  # clipped
    assert of["high"][:STEP_ROW] == pytest.approx(0.1) and of["apart_low"][:STEP_ROW] == pytest.approx(-1.0)
    assert of["high"][-1] == pytest.approx(0.05) and of["apart_low"][-1] == pytest.approx(-0.5)  # two in use


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_table_has_votes_states_and_units_but_no_channels(voted: Path, ending: str) -> None:
    of_mcap, table = read_votes(voted / "v.mcap"), read_votes(voted / f"v.{ending}")
    assert [shown.name for shown in table] == ["a b/c.d", "down"] == [shown.name for shown in of_mcap]
    assert (table[0].unit, table[1].unit) == ("deg/s", "") and table[1].discrete
    for a, b in zip(of_mcap, table, strict=True):
        assert b.time_s == pytest.approx(np.arange(200) / RATE_HZ, abs=1e-6) and not b.channels
        assert all(np.array_equal(x, y) for x, y in zip(a.states, b.states, strict=True))
        assert np.array_equal(a.level, b.level)
    about = of_signals(voted / f"v.{ending}", table).about
    assert "a table has no channels" in about.text and "a b/c.d, channel 3: isolated at 1.07 s" in about.text


def test_an_output_without_thresholds_says_so(voted: Path) -> None:
    about = of_signals(voted / "v.mcap", read_votes(voted / "v.mcap")).about
    assert "the file has no thresholds" in about.text and read_votes(voted / "v.mcap")[0].measure == "SI unit"


def test_a_signal_of_the_rig_is_shown_in_its_unit(tmp_path: Path) -> None:
    time_s, values = np.arange(20) / RATE_HZ, np.full(20, 0.1)
    table = {"time_s": time_s, "pitch_rate.1": values, "pitch_rate.2": values}
    pl.DataFrame(table).write_parquet(tmp_path / "in.parquet")
    rig.vote(tmp_path / "in.parquet", {"signal": {"pitch_rate": {"threshold": 0.1}}}, out=tmp_path / "v.mcap")
    (shown,) = read_votes(tmp_path / "v.mcap")
    assert shown.unit == "deg/s" and shown.voted == pytest.approx(np.degrees(0.1))


def test_a_log_of_another_system_is_voted_by_its_preset(tmp_path: Path, run: Run) -> None:
    (tmp_path / "log.ulg").write_bytes(foreign_logs.gyros())
    assert run("view", tmp_path / "log.ulg", "--save", tmp_path / "v.rrd")[0] == 0
    _, of = numbers(tmp_path / "v.rrd", "gyro_x")
    assert of["apart_high"] == pytest.approx(1.0) and np.isfinite(of["ch_3"]).all()


def test_every_signal_has_a_tab_beside_the_overview(voted: Path) -> None:
    shown = read_votes(voted / "v.mcap")
    assert list(tabs(shown)) == [OVERVIEW, "a b/c.d to down"] and list(tabs(shown[:1])) == [OVERVIEW, "a b/c.d"]


@pytest.fixture
def run(rig_command: Run) -> Run:
    return rig_command


REFUSED: dict[str, tuple[list[str], str]] = {
    "two files": (["v.mcap", "v.csv"], "2 files: the votes on one recording can be shown"),
    "an input": (["in.csv"], "in.csv: no output of rig vote, which has time_s and NAME.voted; there are: time_s, "),
    "a tab": (["v.mcap", "--tab", "rates"], "no tab 'rates'; allowed: overview, a b/c.d to down"),
    "a map": (["v.mcap", "--map"], "v.mcap: --map is for logs of flights, not for votes on a recording"),
    "requirements": (["v.csv", "--requirements", "handling"], "v.csv: --requirements is for logs of flights"),
    "no config": (["in.csv", "--config", "none.toml"], "none.toml: no such file"),
    "a preset": (["in.csv", "--preset", "px4"], "in.csv: --preset is for logs of PX4"),
    "no file": (["none.csv"], "none.csv: no such file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_writes_nothing(
    voted: Path, tmp_path: Path, run: Run, case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(voted)
    words, said = REFUSED[case]
    code, _, err = run("view", *words, "--save", tmp_path / "x.rrd")
    assert code == 2 and err.strip().splitlines() == [err.strip()] and said in err
    assert not (tmp_path / "x.rrd").exists()


def damaged(voted: Path, tmp_path: Path, old: str, new: str) -> Path:
    """A copy of the votes in CSV with other text."""
    text = (voted / "v.csv").read_text()
    assert old in text
    (tmp_path / "v.csv").write_text(text.replace(old, new))
    return tmp_path / "v.csv"


DAMAGED: dict[str, tuple[str, str, str]] = {
    "state": (",ok,", ",fine,", "column 'a b/c.d.state.1': one of ok, suspect, failed, absent, got 'fine'"),
    "time": ("1700000000.5,", "nan,", "row 51"),
    "level": (",3,normal", ",9,normal", "level is one of 0 to 4, got 9"),
    "number": (",3,normal", ",x,normal", "'x' is not a number"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_table_is_refused_with_what_is_wrong(voted: Path, tmp_path: Path, case: str) -> None:
    old, new, said = DAMAGED[case]
    with pytest.raises(BadInput) as error:
        read_votes(damaged(voted, tmp_path, old, new))
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1}', "[" * 100_000])
def test_units_beside_a_table_that_are_no_units_are_refused(voted: Path, tmp_path: Path, text: str) -> None:
    path = damaged(voted, tmp_path, "time_s", "time_s")
    assert read_votes(path)[0].unit == ""
    (tmp_path / "v.csv.units.json").write_text(text)
    with pytest.raises(BadInput, match=r"v\.csv\.units\.json: must be units by column"):
        read_votes(path)


def test_the_log_of_a_flight_is_no_votes(tmp_path: Path) -> None:
    flight = rig.fly(overrides=["duration_s=0.5"], out=tmp_path)
    assert not is_votes(flight.log)
    rig.vote(flight.log, out=tmp_path / "again.mcap")
    shown = {each.name: each for each in read_votes(tmp_path / "again.mcap")}
    assert is_votes(tmp_path / "again.mcap") and shown["pitch_rate"].unit == "deg/s" and shown["gear_down"].discrete
    assert all((states == State.OK).all() for states in shown["pitch_rate"].states)


@outside.needs("vulkan")
@pytest.mark.long
def test_the_picture_of_a_vote_has_its_views_without_complaints(voted: Path, tmp_path: Path, run: Run) -> None:
    words: list[Any] = ["--config", voted / "vote.toml", "--screenshot", tmp_path / "v.png", "--json"]
    code, out, _ = run("view", voted / "in.csv", *words)
    told = json.loads(out)
    assert code == 0 and told["complaints"] == []
    views = set(told["views"])
    assert {"a b/c.d, deg/s", "a b/c.d minus vote, in thresholds (clipped at 1.5)", "events"} <= views
    assert any(view.startswith("zoom 0.1 to 2.0 s: ") for view in views)
