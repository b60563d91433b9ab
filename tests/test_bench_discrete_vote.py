"""Discretes in ``rig vote``: the rule of the flight, row by row, and what is read, written and refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w
from one_stage import step_stage

from rig.bench.vote_rows import VotedDiscrete, vote_discretes
from rig.computer.redundancy.discrete import DiscreteVoter
from rig.computer.redundancy.discrete_config import DiscreteConfigs, discrete_parameters
from rig.core.errors import BadInput
from rig.core.frame import DISCRETES, TIMING, Ilm, State, Table, new_block
from rig.log.recordings.align import align
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedDiscrete, Reset, VoteConfig, read_config
from rig.log.writer import LogWriter

OK, SUSPECT, FAILED = int(State.OK), int(State.SUSPECT), int(State.FAILED)
DOOR = {"door": {"fail_safe": 1, "persistence": 3}}


def voted(
    columns: list[Any],
    ilm: list[Any] | None = None,
    fail_safe: int = 0,
    persistence: int = 3,
    readmit_frames: int = 100,
    resets: Sequence[Reset] = (),
) -> VotedDiscrete:
    """One discrete of channels given row by row, ten a second; None is an empty cell."""
    channels = [np.array([np.nan if x is None else x for x in column], float) for column in columns]
    flags = None if ilm is None else [np.array(column, np.uint8) for column in ilm]
    recording = Recording(np.arange(len(channels[0])) / 10, {}, discretes={"door": Samples(channels, flags)})
    settings = RecordedDiscrete(fail_safe=fail_safe, persistence=persistence, readmit_frames=readmit_frames)
    return vote_discretes(recording, {"door": settings}, list(resets))["door"]


def test_the_majority_is_voted_and_a_channel_off_it_is_failed_for_good():
    found = voted([[1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0], [1, 0, 0, 0, 0, 0]])
    assert found.voted.tolist() == [1, 1, 1, 1, 0, 0]
    assert found.state[2].tolist() == [OK, SUSPECT, SUSPECT, FAILED, FAILED, FAILED]
    assert found.level.tolist() == [3, 3, 3, 2, 2, 2]
    assert found.failures == [(3, 4, pytest.approx(0.3), "comparison")]


@pytest.mark.parametrize("fail_safe", [0, 1])
@pytest.mark.parametrize("channels", [2, 4])
def test_a_tie_is_the_fail_safe_value(fail_safe: int, channels: int):
    half = channels // 2
    found = voted([[1, 1]] * half + [[0, 0]] * half, fail_safe=fail_safe)
    assert found.voted.tolist() == [fail_safe] * 2 and found.level.tolist() == [channels] * 2


def test_channels_that_are_not_fitted_have_no_vote():
    assert voted([[1], [1], [0]]).voted.tolist() == [1]
    assert voted([[1], [1]]).voted.tolist() == [1] and voted([[1], [1]]).level.tolist() == [2]


def test_an_empty_sample_is_not_voted_and_counts_as_off_the_vote():
    found = voted([[1, 1, 1, 1, 1], [1, None, None, 1, 1], [0, 0, 1, 1, 1]], fail_safe=0, persistence=4)
    assert found.voted.tolist() == [1, 0, 1, 1, 1]  # in the second row it is 1:1
    assert found.state[1].tolist() == [OK, SUSPECT, SUSPECT, OK, OK]
    assert found.invalid == [0, 2, 0]
    found = voted([[0] * 5, [0] * 5, [None] * 5])
    assert found.state[2].tolist() == [SUSPECT, SUSPECT, FAILED, FAILED, FAILED]


def test_a_channel_whose_monitor_says_bad_is_not_voted():
    good, bad, absent = int(Ilm.GOOD), int(Ilm.BAD), int(Ilm.ABSENT)
    found = voted([[1] * 4, [0] * 4, [0] * 4], ilm=[[absent] * 4, [good] * 4, [bad] * 4], fail_safe=1)
    assert found.voted.tolist() == [1, 1, 1, 1]  # 1:1 of those that are left
    assert found.state[2].tolist() == [SUSPECT, SUSPECT, FAILED, FAILED] and found.invalid == [0, 0, 0]


def test_a_command_readmits_a_channel_that_has_agreed_long_enough():
    third = [0, 0, 0, 0, 0, 1, 1, 1, 1, 1]
    early, late = (Reset(at_s=at_s, signal="door", channels=[3]) for at_s in (0.7, 0.8))
    columns = [[1] * 10, [1] * 10, third]
    assert voted(columns, readmit_frames=3, resets=[early]).level.tolist() == [3, 3] + [2] * 8
    found = voted(columns, readmit_frames=3, resets=[early, late])
    assert found.state[2].tolist() == [SUSPECT] * 2 + [FAILED] * 6 + [OK] * 2


def expected(values: Any, usable: Any, fail_safe: int, persistence: int) -> tuple[list[int], list[list[int]]]:
    """The rule once more, in plain Python: votes and states of every row."""
    count, failed = [0] * values.shape[1], [False] * values.shape[1]
    votes, states = [], []
    for row, good in zip(values, usable, strict=True):
        ones = [bool(x) for x, g, out in zip(row, good, failed, strict=True) if g and not out]
        vote = fail_safe if 2 * sum(ones) == len(ones) else int(2 * sum(ones) > len(ones))
        agrees = [bool(g) and bool(x) == bool(vote) for x, g in zip(row, good, strict=True)]
        count = [0 if a else n + 1 for a, n in zip(agrees, count, strict=True)]
        failed = [out or n >= persistence for out, n in zip(failed, count, strict=True)]
        votes.append(vote)
        states.append([FAILED if out else OK if a else SUSPECT for out, a in zip(failed, agrees, strict=True)])
    return votes, states


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_every_row_is_that_of_the_rule(channels: int):
    rng = np.random.default_rng(channels)
    for case in range(40):
        values = np.where(rng.random((300, channels)) < 0.06, 1, 0) ^ (np.arange(300)[:, None] // 40 % 2)
        values[150:, 0] = case % 2  # a channel that is stuck
        usable = rng.random((300, channels)) > 0.1 * (case % 3)
        columns = [np.where(usable[:, c], values[:, c], np.nan) for c in range(channels)]
        found = voted(columns, fail_safe=case % 2, persistence=1 + case % 7)
        votes, states = expected(values, usable, case % 2, 1 + case % 7)
        assert found.voted.tolist() == votes and np.array(found.state).T.tolist() == states
        assert found.level.tolist() == [sum(state != FAILED for state in row) for row in states]


def test_the_discretes_of_a_log_vote_as_in_flight(tmp_path: Path):
    rng = np.random.default_rng(3)
    block = new_block(600)
    flags = np.arange(600)[:, None, None] // 100 % 2 ^ (rng.random((600, len(DISCRETES), 4)) < 0.05)
    flags[200:, :, 0] = 1  # stuck
    flags[400:, 1, 1] = 1 - flags[400:, 1, 2]
    block["frame"], block["discrete_channels"] = np.arange(600), flags
    block["discrete_valid"], block["discrete_ilm"] = rng.random((600, len(DISCRETES), 4)) > 0.02, Ilm.ABSENT
    block["discrete_ilm"][300:320, 1, 2] = Ilm.BAD
    fitted = np.full(len(DISCRETES), 4)
    voter = DiscreteVoter(discrete_parameters(DiscreteConfigs(), fitted, 8, 100.0))
    for k in range(600):
        step_stage(voter, block, k)
    with LogWriter(tmp_path / "log.mcap", 100.0, {}) as writer:
        writer.write(Table(block, timing=np.zeros(600, TIMING)))
    config = VoteConfig(discrete={discrete.name: RecordedDiscrete() for discrete in DISCRETES})
    recording = read(tmp_path / "log.mcap", config)
    found = vote_discretes(recording, config.discretes(recording.discretes, ""), [])
    assert (block["discrete_state"] == FAILED).any()
    for d, discrete in enumerate(DISCRETES):
        assert found[discrete.name].settings.fail_safe == discrete.fail_safe
        assert found[discrete.name].voted.tolist() == block["discrete_voted"][:, d].tolist()
        assert found[discrete.name].level.tolist() == block["discrete_level"][:, d].tolist()
        assert np.array(found[discrete.name].state).T.tolist() == block["discrete_state"][:, d].tolist()


def config(**tables: Any) -> None:
    Path("c.toml").write_text(tomli_w.dumps(tables))


def table(n: int = 40) -> pl.DataFrame:
    """Channel 3 of the door says 0 from row 11 on; the signal x is beside it."""
    off = [1] * 10 + [0] * (n - 10)
    return pl.DataFrame(
        {"time_s": np.arange(n) / 10, "door.1": [1] * n, "door.2": [1] * n, "door.3": off, "x.1": 0.0, "x.2": 0.0}
    )


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_columns_of_a_discrete_are_written_beside_those_of_the_signals(ending: str, rig: Any):
    table().write_csv("in.csv")
    config(default={"threshold": 1.0}, discrete=DOOR)
    code, said, _ = rig("in.csv", "--config", "c.toml", "--out", f"o.{ending}")
    assert code == 0 and "door.3" in said and "100 %" in said
    written = pl.read_csv("o.csv") if ending == "csv" else pl.read_parquet("o.parquet")
    names = ["door.voted", "door.level", "door.state.1", "door.state.2", "door.state.3"]
    assert [name for name in written.columns if name.startswith("door")] == names and "x.voted" in written.columns
    assert written["door.voted"].to_list() == [1] * 40
    assert written["door.state.3"].to_list() == ["ok"] * 10 + ["suspect"] * 2 + ["failed"] * 28
    found = json.loads(rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--json")[1])
    door = found["discretes"]["door"]
    assert (door["fail_safe"], door["level"], door["ones_share"], door["changes"]) == (1, 2, 1.0, 0)
    assert door["channels"][2]["failed"] == [
        {"frame": 13, "time_s": 1.2, "why": "comparison", "since_first_row_s": 1.2}
    ]
    assert list(found["signals"]) == ["x"] and found["not_voted"] == []


def test_a_discrete_alone_is_enough_and_its_mcap_votes_again(rig: Any):
    gaps = pl.Series("door.2", [1, None] * 20)  # must come back as missing, not as 0
    table().drop("x.1", "x.2").with_columns(gaps).write_csv("in.csv")
    config(discrete=DOOR)
    assert rig("in.csv", "--config", "c.toml", "--out", "o.mcap")[0] == 0
    assert rig("in.csv", "--config", "c.toml", "--out", "a.csv")[0] == 0
    assert rig("o.mcap", "--config", "c.toml", "--out", "b.csv")[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_signals_and_discretes_of_one_mcap_vote_again(rig: Any):
    table().write_csv("in.csv")
    config(default={"threshold": 1.0}, discrete=DOOR)
    assert rig("in.csv", "--config", "c.toml", "--out", "o.mcap")[0] == 0
    assert rig("in.csv", "--config", "c.toml", "--out", "a.csv")[0] == 0
    assert rig("o.mcap", "--config", "c.toml", "--out", "b.csv")[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_alignment_leaves_discretes_on_their_rows():
    rng = np.random.default_rng(1)
    shape = np.cumsum(rng.normal(size=1000))
    late: list[Floats] = [shape[k : k + 800].astype(np.float64) for k in (40, 37, 40)]
    x = Samples(late)  # the second is three rows late
    door = Samples([(np.arange(800) % 2.0).astype(np.float64)] * 2)
    recording = Recording(np.arange(800) / 100, {"x": x}, discretes={"door": door})
    moved, _ = align(recording, VoteConfig(default={"threshold": 1.0}).signals(["x"], ""))
    assert len(moved.time_s) == 797
    row = moved.row(0) - 1
    assert moved.discretes["door"].channels[0].tolist() == door.channels[0][row : row + 797].tolist()


REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "a value that is neither": (DOOR, "0,1,1\n0.1,1,2\n", "in.csv: row 2: door.2 is a discrete: 0, 1 or empty, got 2"),
    "no fail-safe value": ({"door": {}}, "0,1,1\n", "discrete.door: fail_safe: field required, 0 or 1"),
    "another fail-safe value": ({"door": {"fail_safe": 2}}, "0,1,1\n", "discrete.door.fail_safe: must be at most 1"),
    "a word": ({"door": {"fail_safe": "open"}}, "0,1,1\n", "discrete.door.fail_safe"),
    "an unknown key": ({"door": {"fail_safe": 1, "threshold": 1.0}}, "0,1,1\n", "discrete.door.threshold: unknown key"),
    "no persistence": ({"door": {"fail_safe": 1, "persistence": 0}}, "0,1,1\n", "discrete.door.persistence"),
    "a persistence beyond all": (
        {"door": {"fail_safe": 1, "persistence": 2**62}},
        "0,1,1\n",
        "discrete.door: persistence: must be at most",
    ),
    "a discrete that is not there": ({"flap": {"fail_safe": 0}}, "0,1,1\n", "discrete 'flap' is not in the input"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_discretes_are_refused_in_one_line(case: str, rig: Any):
    discrete, rows, says = REFUSED[case]
    Path("in.csv").write_text("time_s,door.1,door.2\n" + rows)
    config(default={"threshold": 1.0}, discrete=discrete)
    code, out, error = rig("in.csv", "--config", "c.toml", "--out", "o.csv")
    assert (code, out) == (2, "") and error.count("\n") == 1 and says in error
    assert not list(Path().glob("o.*"))


def test_a_name_is_a_signal_or_a_discrete(tmp_path: Path):
    (tmp_path / "c.toml").write_text(tomli_w.dumps({"signal": {"door": {"threshold": 1.0}}, "discrete": DOOR}))
    with pytest.raises(BadInput, match="'door' is a signal and a discrete"):
        read_config(tmp_path / "c.toml")


def test_a_discrete_has_no_reference(tmp_path: Path):
    table(11).with_columns(pl.lit(1).alias("door.ref")).write_csv(tmp_path / "in.csv")
    with pytest.raises(BadInput, match=r"column 'door\.ref': a discrete has no reference"):
        read(tmp_path / "in.csv", VoteConfig(discrete={"door": RecordedDiscrete(fail_safe=0)}))
