"""Time stamps that repeat or step back: refused in one line, or dropped and counted on request."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import hostile_mcap as by_hand
import numpy as np
import polars as pl
import pytest

from rig.bench.vote_rows import vote
from rig.core.errors import BadInput
from rig.log.recordings.align import align
from rig.log.recordings.read import read
from rig.log.recordings.stamps import clock, late_rows
from rig.log.recordings.vote_config import VoteConfig

QUAD = Path(__file__).parents[2] / "shared" / "data" / "quad_imu_horizontal"
STEPS = [0.0, 0.1, 0.1, 0.2, 0.15, 0.2, 0.3, 0.4, 0.5]  # a repeat in row 3; row 4 is ahead of rows 5 and 6
KEPT = [0, 1, 4, 5, 6, 7, 8]


def table(path: Path, time_s: list[float] | None = None, name: str = "time_s") -> Path:
    """Channels whose value is the number of their row."""
    at = STEPS if time_s is None else time_s
    rows = np.arange(1.0, len(at) + 1)
    frame = pl.DataFrame({name: at, "x.1": rows, "x.2": rows, "x.3": rows})
    frame.write_parquet(path) if path.suffix == ".parquet" else frame.write_csv(path)
    return path


@pytest.mark.parametrize(
    ("time_s", "late"),
    [
        ([0.0, 1.0, 2.0], []),
        ([0.0, 0.0, 0.0, 1.0], [1, 2]),  # the first of equal stamps stays
        (STEPS, [2, 4, 5]),
        ([0.0, 5.0, 1.0, 2.0, 5.0, 6.0], [2, 3, 4]),  # until time exceeds the largest so far
        ([3.0], []),
    ],
)
def test_rows_that_do_not_exceed_all_before_are_late(time_s: list[float], late: list[int]):
    assert late_rows(np.array(time_s)).tolist() == late


def test_a_refusal_names_rows_count_and_the_option(tmp_path: Path):
    says = (
        "in.csv: row 3: time_s must rise, got 0.1 after 0.1; 2 rows are out of order (3, 4); --repair-time drops them"
    )
    with pytest.raises(BadInput) as refused:
        read(table(tmp_path / "in.csv"), VoteConfig())
    assert str(refused.value).endswith(says)
    with pytest.raises(BadInput, match=r"4 rows repeat or step back \(2, 4, 6, 8\); --repair-time drops them"):
        clock("a", np.repeat(np.arange(4.0), 2))
    with pytest.raises(BadInput, match=r"9 rows repeat or step back \(2, 3, 4, 5, 6, \.\.\.\); all rows have one time"):
        clock("a", np.zeros(10))
    with pytest.raises(
        BadInput, match=r"got 1700000000\.25 after 1700000000\.5; 1 row .* \(2\); --repair-time drops it"
    ):
        clock("a", np.array([1700000000.5, 1700000000.25, 1700000001.0]))


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_repaired_table_keeps_the_rows_whose_time_rises(ending: str, tmp_path: Path):
    recorded = read(table(tmp_path / f"in.{ending}"), VoteConfig(), repair=True)
    assert recorded.time_s.tolist() == [STEPS[k] for k in KEPT]
    assert [column.tolist() for column in recorded.signals["x"].channels] == [[k + 1.0 for k in KEPT]] * 3
    assert [recorded.row(k) for k in range(7)] == [k + 1 for k in KEPT]
    (repair,) = recorded.repairs
    assert (repair.rows, repair.dropped, repair.first) == (9, 2, [3, 4])


def test_each_recorder_is_repaired_by_its_own_clock(tmp_path: Path):
    table(tmp_path / "a.csv", [0.1 * k for k in range(9)])
    table(tmp_path / "b.csv")
    mapping = {"x.1": "a.csv:x.1", "x.2": "b.csv:x.1"}
    with pytest.raises(BadInput, match=r"b\.csv: row 3: .* 2 rows .*--repair-time"):
        read(tmp_path, VoteConfig(mapping=mapping))
    recorded = read(tmp_path, VoteConfig(mapping=mapping), repair=True)
    assert recorded.signals["x"].channels[0].tolist() == list(range(1, 10))
    at_tenths = [1.0, 2.0, 6.0, 7.0, 8.0, 9.0]  # its rows at 0, 0.1 .. 0.5 s
    assert recorded.signals["x"].channels[1][:6].tolist() == at_tenths
    assert [(repair.source.rsplit(": ")[1], repair.dropped) for repair in recorded.repairs] == [("b.csv", 2)]
    turned = {"x.1": "b.csv:x.1", "x.2": "a.csv:x.1"}  # now the rows are those of the one that is repaired
    recorded = read(tmp_path, VoteConfig(mapping=turned), repair=True)
    assert [recorded.row(k) for k in range(7)] == [k + 1 for k in KEPT]
    assert recorded.signals["x"].channels[1].tolist() == [1, 2, 2, 3, 4, 5, 6]


def test_messages_of_one_time_are_repaired(tmp_path: Path):
    bodies = b"".join(by_hand.record(by_hand.message(at, b'{"x": %d}' % k)) for k, at in enumerate([0, 1, 1, 3, 2, 4]))
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(bodies, len(bodies))])
    config = VoteConfig(mapping={"x.1": "/imu:x", "x.2": "/imu:x"})
    with pytest.raises(BadInput, match=r"/imu: row 3: .*1 row repeats or steps back \(3\)"):
        read(tmp_path / "a.mcap", config)
    recorded = read(tmp_path / "a.mcap", config, repair=True)
    assert recorded.time_s == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])  # messages are ordered by time first
    assert recorded.signals["x"].channels[0].tolist() == [0, 1, 4, 3, 5]


def test_rows_of_failures_are_those_of_the_input(tmp_path: Path):
    at = [0.0, 0.1, 0.1, 0.1, *(0.1 * k for k in range(2, 30))]
    pl.DataFrame({"time_s": at, "x.1": 0.0, "x.2": 0.0, "x.3": [9.0] * len(at)}).write_csv(tmp_path / "in.csv")
    config = VoteConfig(default={"threshold": 1.0, "persistence": 4})
    recorded = read(tmp_path / "in.csv", config, repair=True)
    (failure,) = vote(recorded, config.signals(["x"], ""), [])["x"].failures
    assert (failure.frame, failure.time_s) == (6, pytest.approx(0.3))  # the fourth row that was kept


@pytest.mark.parametrize(
    ("time_s", "says"),
    [
        ([3.0, 2.0, 1.0, 1.5, 0.5], "--repair-time would drop 3 of 5 rows, from row 1 on"),
        ([1.0, 1.0, 1.0], "all rows have one time"),
        ([0.0, np.nan], "row 2: time_s is not a number"),
        ([0.0, 1e10], "row 2: time_s is in seconds, up to 9e"),
        ([0.0, 1e-12, 2e-12], "time_s rises by 1e-12 s a row"),
        ([], "no rows"),
    ],
)
def test_no_repair_for_what_is_no_clock(time_s: list[float], says: str):
    with pytest.raises(BadInput, match=says):
        clock("a", np.array(time_s), repair=True)


def test_the_command_says_what_it_dropped(rig: Any, tmp_path: Path):
    table(tmp_path / "in.csv")
    (tmp_path / "c.toml").write_text("[default]\nthreshold = 1.0\n")
    command = ("in.csv", "--config", "c.toml", "--out", "o.csv")
    assert rig(*command)[0] == 2 and not Path("o.csv").exists()
    code, text, _ = rig(*command, "--repair-time")
    assert code == 0 and "dropped 2 of 9 rows of in.csv, whose time repeats or is out of order: 3, 4" in text
    assert pl.read_csv("o.csv")["time_s"].to_list() == [STEPS[k] for k in KEPT]
    found = json.loads(rig(*command, "--repair-time", "--json")[1])
    assert found["repaired"] == [{"source": "in.csv", "rows": 9, "dropped": 2, "first": [3, 4]}]
    table(Path("in.csv"), [0.1 * k for k in range(9)])
    assert json.loads(rig(*command, "--repair-time", "--json")[1])["repaired"] == []


@pytest.mark.skipif(not QUAD.is_dir(), reason="the recordings are not here")
@pytest.mark.parametrize(
    ("flight", "recorder", "dropped"),
    [("path_3", 4, [2211]), ("path_9", 2, [2252, 3211, 3364]), ("path_11", 2, [4685, 4703]), ("path_13", 1, [4805])],
)
def test_a_flight_with_repeated_stamps_is_repaired_and_aligned(flight: str, recorder: int, dropped: list[int]):
    mapping = {f"gyro_x.{c}": f"IMU_{c}.csv:Gyr_X" for c in range(1, 5)}
    config = VoteConfig(default={"threshold": 10.0}, mapping=mapping, time_column="time")
    with pytest.raises(BadInput, match=rf"IMU_{recorder}\.csv: row {dropped[0]}: .*--repair-time"):
        read(QUAD / flight, config)
    recorded = read(QUAD / flight, config, repair=True)
    (repair,) = recorded.repairs
    assert repair.source.endswith(f"IMU_{recorder}.csv") and repair.first == dropped and repair.dropped == len(dropped)
    moved, found = align(recorded, config.signals(recorded.signals, ""), end_s=6.0)
    assert all(correction.aligned for correction in found["gyro_x"])
    assert (np.diff(moved.time_s) > 0).all()
    if recorder == 1:  # the rows are those of its clock
        assert recorded.row(dropped[0] - 2) == dropped[0] - 1 and recorded.row(dropped[0] - 1) == dropped[0] + 1
