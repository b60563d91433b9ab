"""``rig vote``: what holds for all signals of CONFIG: a reference beside the trend, splits without an end, boxes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w
from conftest import constant

import rig
from rig.bench.inject import inject
from rig.bench.injection_score import added_up
from rig.bench.vote_rows import Result, vote
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import VoteConfig
from rig.verdict.words import Cause

FALLING = np.column_stack([-0.01 * np.arange(300.0), 5.0 - 0.01 * np.arange(300.0)])
SPLIT = constant(0.0, 0.1, 5.0, 5.1, frames=300)
TURNS = 0.1 * (np.arange(300) % 2)[:, None]  # up and down: no trend


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rig_command: Any) -> Any:
    """run(samples by signal, config) -> the JSON, or the error; 100 rows a second."""

    def voted(signals: dict[str, Any], config: dict[str, Any], **more: Any) -> Any:
        columns = {f"{s}.{c + 1}": x[:, c] for s, x in signals.items() for c in range(x.shape[1])}
        rows = len(next(iter(columns.values())))
        table = {"time_s": np.arange(rows) / 100, **columns, **more}
        pl.DataFrame(table).write_csv(tmp_path / "in.csv")
        (tmp_path / "c.toml").write_text(tomli_w.dumps({"default": {"threshold": 1.0}, **config}))
        monkeypatch.chdir(tmp_path)
        code, out, error = rig_command("vote", "in.csv", "--config", "c.toml", "--out", "o.csv", "--json")
        return json.loads(out) if code == 0 else (code, error)

    return voted


def why(found: dict[str, Any], signal: str) -> list[tuple[int, str] | None]:
    channels = found["signals"][signal]["channels"]
    return [(c["failed"][0]["frame"], c["failed"][0]["why"]) if c["failed"] else None for c in channels]


@pytest.mark.parametrize(("beside", "by"), [(False, "given_up"), (True, "trend")])
def test_the_trend_of_a_signal_with_a_reference_column_is_asked_on_demand_alone(beside: bool, by: str, run: Any):
    """The reference is NaN throughout, so that no rule but the trend could settle 1:1."""
    config = {"default": {"threshold": 1.0, "trend_beside_reference": beside}}
    found = run({"x": FALLING}, config, **{"x.ref": np.full(300, np.nan)})
    assert [reason for _, reason in filter(None, why(found, "x"))] == ([by, by] if by == "given_up" else [by])
    assert why(run({"x": FALLING}, config), "x") == [None, (10, "trend")]


@pytest.mark.parametrize(("wait_s", "rows"), [(None, 99), (0.2, 19), (0.0, 300)])
def test_a_split_that_no_rule_settles_is_counted_told_and_given_up_after_its_time(
    wait_s: float | None, rows: int, run: Any
):
    config = {} if wait_s is None else {"unresolved_s": wait_s}
    found = run({"x": SPLIT + TURNS}, config)
    x = found["signals"]["x"]
    assert (x["unresolved_rows"], x["unresolved_share"]) == (rows, pytest.approx(rows / 300))
    end = f"given up at {rows / 100:g} s" if rows < 300 else "never given up"
    share = f"{100 * rows / 300:.3g}"
    assert found["undecided"] == [f"x: split that no rule decided, in {rows} of 300 rows ({share} %), {end}"]
    assert why(found, "x") == [(rows + 1, "given_up") if rows < 300 else None] * 4


def test_a_wait_shorter_than_an_answer_must_stand_is_refused_and_the_default_gives_way(run: Any):
    code, error = run({"x": SPLIT}, {"unresolved_s": 0.05})
    said = "unresolved_s: 0.05 s are 5 frames, fewer than the 10 of split_persistence of x"
    assert code == 2 and said in error
    slow = {"threshold": 1.0, "split_persistence": 150, "tie_break": ["ilm"]}
    assert why(run({"x": SPLIT}, {"default": slow}), "x") == [(150, "given_up")] * 4


def test_a_signal_without_a_split_says_nothing(run: Any):
    found = run({"x": constant(0.0, 0.1, 0.2, 0.3)}, {})
    assert found["undecided"] == [] and found["signals"]["x"]["unresolved_rows"] == 0


def test_a_channel_off_on_most_signals_of_a_box_is_failed_on_all_of_it_and_on_no_other(run: Any):
    off, well = constant(0.0, 0.1, 0.2, 9.0), constant(0.0, 0.1, 0.2, 0.3)
    signals = {"a": off, "b": off, "c": well, "d": well, "e": well}
    boxes = {"gyro": ["a", "b", "c"], "rest": ["d", "e"]}
    found = run(signals, {"boxes": boxes})
    assert [why(found, s)[3] for s in "abcde"] == [(8, "comparison"), (8, "comparison"), (8, "box"), None, None]
    for fewer in ({"boxes": boxes, "box_signals": 0}, {}):
        assert [why(run(signals, fewer), s)[3] for s in "cde"] == [None] * 3
    assert why(run(signals, {"boxes": {"one": ["a", "d", "e"], "two": ["b", "c"]}}), "c")[3] is None


@pytest.mark.parametrize(
    ("boxes", "said"),
    [
        ({"one": ["a"]}, "boxes: b: in no box; each signal is in one of one"),
        ({"one": ["a", "b"], "two": ["b"]}, "boxes: b is in two boxes, one and two; each is in one"),
        ({"one": ["a", "b", "q"]}, "boxes: one: unknown signal 'q'"),
    ],
)
def test_boxes_that_do_not_hold_each_signal_once_are_refused(boxes: dict[str, list[str]], said: str, run: Any):
    samples = constant(0.0, 0.1, 0.2, 0.3)
    code, error = run({"a": samples, "b": samples}, {"boxes": boxes})
    assert code == 2 and said in error and error.count("\n") == 1


def test_votes_in_one_line_name_what_no_rule_decided(tmp_path: Path):
    columns = {f"x.{c + 1}": (SPLIT + TURNS)[:, c] for c in range(4)}
    pl.DataFrame({"time_s": np.arange(300) / 100, **columns}).write_csv(tmp_path / "in.csv")
    votes = rig.vote(tmp_path / "in.csv", {"default": {"threshold": 1.0}, "unresolved_s": 0.0})
    assert "isolated no channel; x: split that no rule decided, in 300 of 300 rows (100 %), never given up" in repr(
        votes
    )


@pytest.mark.parametrize(("mates", "cause"), [("abc", Cause.WITH_ITS_BOX), ("abcde", Cause.FALSE_ALARM)])
def test_injected_faults_are_scored_by_the_boxes_of_the_vote(mates: str, cause: Cause):
    """Two of three signals are more than half of their box; two of five are not, whatever failed the channel."""
    n = 100
    recording = Recording(np.arange(n) / 100, {s: Samples([np.zeros(n) for _ in range(4)]) for s in "abcde"})
    config = VoteConfig(default={"threshold": 1.0}, boxes={"one": list("abc"), "two": list("de")})
    chosen = config.signals(recording.signals, "c")
    faults = [{"kind": "offset", "signal": s, "channels": [4], "start_s": 0.2, "offset": 5.0} for s in "ab"]
    found = inject(recording, faults, chosen)
    voted = vote(found.recording, chosen, [], rules=config.rules)
    told = config.rules._replace(boxes={"one": list(mates), "two": [s for s in "abcde" if s not in mates]})
    failures = added_up(found, found.recording, Result(voted, rules=told), {}).failures
    assert [Cause(one["cause"]) for one in failures if one["signal"] == 2] == [cause]
