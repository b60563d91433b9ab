"""What ``rig vote`` reads and writes, and what it refuses: one line, exit code 2, no output."""

from __future__ import annotations

import json
import struct
import sys
from dataclasses import replace
from datetime import date
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomli_w
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.writer import Writer as ProtobufWriter

from rig.bench.vote_rows import Result, vote
from rig.bench.write_votes import output, write
from rig.core.errors import BadInput
from rig.core.frame import State
from rig.log import mcap_messages as limits
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.source_times import nearest_rows
from rig.log.recordings.vote_config import VoteConfig

ONE: dict[str, Any] = {"default": {"threshold": 1.0}}
HEAD = "time_s,x.1,x.2,x.3\n"


def config(**tables: Any) -> None:
    Path("c.toml").write_text(tomli_w.dumps(tables))


def recording(n: int = 40, names: tuple[str, ...] = ("x", "gyro.left")) -> Recording:
    rng = np.random.default_rng(0)
    signals = {name: Samples([rng.normal(0, 0.1, n) for _ in range(3 + i)]) for i, name in enumerate(names)}
    signals["x"].channels[1][5:] = np.nan
    return Recording(np.arange(n) / 50, signals)


def as_frame(recorded: Recording) -> pl.DataFrame:
    columns = {"time_s": recorded.time_s}
    for name, samples in recorded.signals.items():
        columns |= {f"{name}.{c}": column for c, column in enumerate(samples.channels, 1)}
    return pl.DataFrame(columns)


BAD_TABLES = {
    "a signal with one channel": ("time_s,x.1\n0,1\n", "signal 'x' has one channel; two to 4 are needed"),
    "a signal with five": ("time_s,x.1,x.2,x.3,x.4,x.5\n0,1,1,1,1,1\n", "column 'x.5': a signal has channels 1 to 4"),
    "a channel 0": ("time_s,x.0,x.1,x.2\n0,1,1,1\n", "column 'x.0': a signal has channels 1 to 4"),
    "a gap in the channels": ("time_s,x.1,x.3\n0,1,1\n", "signal 'x' has a channel 3 but no channel 2"),
    "no time": ("x.1,x.2\n1,1\n", "no column 'time_s'"),
    "unordered time": (HEAD + "0,1,1,1\n0.2,1,1,1\n0.1,1,1,1\n", "row 3: time_s must rise, got 0.1 after 0.2; 1 row"),
    "the same time twice": (HEAD + "0,1,1,1\n0,1,1,1\n", "row 2: time_s must rise, got 0 after 0; 1 row"),
    "a time that is no number": (HEAD + "0,1,1,1\n,1,1,1\n", "row 2: time_s is not a number"),
    "an unknown column": ("time_s,x.1,x.2,remark\n0,1,1,1\n", "unknown column 'remark'"),
    "a column of no signal": ("time_s,x.1,x.2,y.ref\n0,1,1,1\n", "unknown column 'y.ref'"),
    "a monitor of no channel": ("time_s,x.1,x.2,x.ilm.3\n0,1,1,1\n", "unknown column 'x.ilm.3'"),
    "a monitor that says two": ("time_s,x.1,x.2,x.ilm.1\n0,1,1,2\n", "row 1: x.ilm.1 must be 0, 1 or empty, got 2"),
    "a column twice": ("time_s,x.1,x.1\n0,1,1\n", "column 'x.1' is given twice"),
    "no signal": ("time_s\n0\n", "no signal"),
    "no rows": (HEAD, "no rows"),
    "nothing": ("", "no column 'time_s'"),
    "a short last row": (HEAD + "0,1,1,1\n0.1,1,1", "row 2 has 3 cells, the header 4; a cut file, or"),
    "a short row": (HEAD + "0,1,1,1\n0.1,1\n0.2,1,1,1\n", "row 2 has 2 cells, the header 4"),
    "a word for a number": (HEAD + "0,1,1,one\n", "row 1, column 'x.3': 'one' is not a number"),
    "bytes": ("\x00\x01PNG,\x00\n\x02", "row 1 has 1 cells, the header 2"),
}


@pytest.mark.parametrize("case", BAD_TABLES)
def test_a_bad_table_is_refused(case: str, rig: Any):
    text, says = BAD_TABLES[case]
    Path("in.csv").write_text(text)
    config(**ONE)
    refused(rig("in.csv", "--config", "c.toml", "--out", "o.csv"), "in.csv", says)


BAD_CONFIGS = {
    "unknown key": ({"signal": {"x": {"threshold": 1.0, "persistance": 8}}}, "signal.x.persistance: unknown key"),
    "unknown key of all": ({"default": {"treshold": 1.0}}, "default.treshold: unknown key"),
    "unknown table": ({"signals": {}}, "signals: unknown key"),
    "signal not in the input": ({"signal": {"y": {"threshold": 1.0}}}, "signal 'y' is not in the input; allowed: x"),
    "reset of no signal": ({**ONE, "resets": [{"at_s": 1.0, "signal": "y"}]}, "signal 'y' is not in the input"),
    "no threshold": ({"signal": {"x": {}}}, "signal.x: threshold: missing"),
    "threshold zero": ({"default": {"threshold": 0.0}}, "default: threshold: must be above 0, got 0.0"),
    "threshold negative": ({"signal": {"x": {"threshold": -1.0}}}, "signal.x: threshold: must be above 0"),
    "reference threshold": ({"default": {"threshold": 1.0, "reference_threshold": 0.0}}, "reference_threshold"),
    "trend frames 0": ({"default": {"threshold": 1.0, "trend_frames": 0}}, "trend_frames: must be"),
    "trend frames 9": ({"default": {"threshold": 1.0, "trend_frames": 9}}, "trend_frames: must be at most"),
    "decided_by": ({"default": {"threshold": 1.0, "tie_break": ["dice"]}}, "tie_break.0"),
    "manager": ({"default": {"threshold": 1.0, "manager": "dice"}}, "manager"),
    "range": ({"default": {"threshold": 1.0, "range": [1.0, -1.0]}}, "range: low must be below high"),
    "half a range": ({"default": {"threshold": 1.0, "range": [1.0]}}, "range"),
    "half a turn": (
        {"default": {"threshold": 1.0, "wraps": True, "range": [0.0, 180.0 / 57.3]}},
        "a whole turn in rad",
    ),
    "no signal": ({}, "no signal to vote"),
    "mapping of nothing": (
        {**ONE, "mapping": {"x.1": "a", "x.2": "b"}},
        "no column 'time_s', which CONFIG names (time_column, [mapping]); there are: t, x.1, x.2",
    ),
}


@pytest.mark.parametrize("case", BAD_CONFIGS)
def test_a_bad_configuration_is_refused(case: str, rig: Any):
    tables, says = BAD_CONFIGS[case]
    Path("in.csv").write_text("t,x.1,x.2\n0,1,1\n" if case == "mapping of nothing" else HEAD + "0,1,1,1\n")
    config(**tables)
    refused(rig("in.csv", "--config", "c.toml", "--out", "o.csv"), "", says)


def refused(ran: tuple[int, str, str], name: str, says: str) -> None:
    code, out, err = ran
    assert code == 2 and out == ""
    assert err.startswith(f"error: {name}") and err.count("\n") == 1 and says in err
    assert not [path for path in Path().iterdir() if path.name.startswith("o.")]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["none.csv", "--config", "c.toml", "--out", "o.csv"], "none.csv: no such file"),
        (["in.csv", "--config", "none.toml", "--out", "o.csv"], "none.toml: no such file"),
        (["in.txt", "--config", "c.toml", "--out", "o.csv"], "in.txt: unknown ending; allowed: .csv, .parquet, .mcap"),
        (["in.csv", "--config", "c.toml", "--out", "o.xls"], "o.xls: must end in one of .csv, .parquet, .mcap"),
        (["in.csv", "--config", "c.toml", "--out", "none/o.csv"], "no such folder: none"),
        (["in.csv", "--config", "c.toml", "--out", "in.csv"], "in.csv: is the input"),
        (["in.csv", "--config", "c.toml", "--out", "/proc/o.csv"], "/proc/o.csv: cannot be written"),
        ([".", "--config", "c.toml", "--out", "o.csv"], "a folder: CONFIG needs a [mapping]"),
        (["in.csv", "--config", "c.toml", "--out", "o.csv", "--align"], "1 rows"),
        (["in.csv", "--config", "c.toml", "--out", "o.csv", "--align-to", "3"], "need --align"),
    ],
)
def test_files_that_are_not_there_or_not_known_are_refused(arguments: list[str], says: str, rig: Any):
    Path("in.csv").write_text(HEAD + "0,1,1,1\n")
    Path("in.txt").write_text("x")
    config(**ONE)
    refused(rig(*arguments), "", says)


@pytest.mark.parametrize("ending", ["parquet", "mcap"])
@pytest.mark.parametrize("kept", [0, 30, 0.5, 0.999])
def test_a_file_that_was_cut_is_refused(ending: str, kept: float, rig: Any):
    config(**ONE)
    as_frame(recording()).write_csv("whole.csv")
    assert rig("whole.csv", "--config", "c.toml", "--out", "whole.mcap")[0] == 0
    as_frame(recording()).write_parquet("whole.parquet")
    data = Path(f"whole.{ending}").read_bytes()
    Path(f"in.{ending}").write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    refused(rig(f"in.{ending}", "--config", "c.toml", "--out", "o.csv"), f"in.{ending}", "")


def test_a_parquet_column_that_is_not_of_numbers_is_refused(rig: Any):
    config(**ONE)
    pl.DataFrame({"time_s": [0.0], "x.1": ["a"], "x.2": [1.0]}).write_parquet("in.parquet")
    refused(rig("in.parquet", "--config", "c.toml", "--out", "o.csv"), "in.parquet", "'x.1' must contain numbers")


def test_a_failure_leaves_the_output_of_before(rig: Any):
    config(**ONE)
    Path("o.csv").write_text("of before")
    Path("in.csv").write_text(HEAD)
    assert rig("in.csv", "--config", "c.toml", "--out", "o.csv")[0] == 2
    assert Path("o.csv").read_text() == "of before" and not list(Path().glob(".*.part"))


@pytest.mark.parametrize("ending", ["csv", "parquet", "mcap"])
def test_all_formats_hold_the_same(ending: str, rig: Any):
    config(**ONE)
    as_frame(recording()).write_csv("in.csv")
    as_frame(recording()).write_parquet("in.parquet")
    assert rig("in.csv", "--config", "c.toml", "--out", "in.mcap")[0] == 0
    found = json.loads(rig(f"in.{ending}", "--config", "c.toml", "--out", "o.csv", "--json")[1])
    table = pl.read_csv("o.csv")
    assert rig(f"in.{ending}", "--config", "c.toml", "--out", "o.parquet")[0] == 0
    assert table.equals(pl.read_parquet("o.parquet").cast(dict(table.schema)))  # pyright: ignore[reportArgumentType]
    expected = vote(recording(), VoteConfig(**ONE).signals(["x", "gyro.left"], ""), [])
    for name, signal in expected.items():
        assert table[f"{name}.voted"].to_numpy().tobytes() == signal.voted.tobytes()
        assert table[f"{name}.level"].to_list() == signal.level.tolist()
    assert table.columns[:5] == ["time_s", "x.voted", "x.level", "x.pattern", "x.decided_by"]
    assert list(found["signals"]) == ["x", "gyro.left"] and found["rows"] == 40
    assert found["signals"]["x"]["channels"][1]["failed"] == [
        {"frame": 13, "time_s": 0.24, "why": "invalid", "since_first_row_s": 0.24}
    ]


def test_a_row_number_a_time_and_a_reason_are_on_the_terminal(rig: Any):
    config(signal={"x": {"threshold": 1.0}})
    as_frame(recording()).write_csv("in.csv")
    code, said, _ = rig("in.csv", "--config", "c.toml", "--out", "o.csv")
    (line,) = [line for line in said.splitlines() if line.strip().startswith("x.2")]
    assert code == 0 and line.split() == ["x.2", "failed", "7", "(17.5", "%)", "13", "0.24", "s", "invalid", "35"]
    assert "not voted, because CONFIG does not name them: gyro.left" in said


@pytest.mark.parametrize("ending", ["csv", "parquet", "mcap"])
def test_a_table_of_votes_has_the_units_of_the_signals_that_have_one(rig: Any, ending: str):
    """In its columns, or where they have no place for it beside it; a log has them in its own metadata."""
    config(signal={"x": {"threshold": 1.0, "unit": "deg/s"}, "gyro.left": {"threshold": 1.0}})
    as_frame(recording()).write_csv("in.csv")
    assert rig("in.csv", "--config", "c.toml", "--out", f"o.{ending}")[0] == 0
    beside = Path(f"o.{ending}.units.json")
    assert beside.exists() == (ending == "csv")
    units = {"time_s": "s", "x.voted": "deg/s"}
    if ending == "csv":
        assert json.loads(beside.read_text()) == units
    if ending == "parquet":
        schema = pq.read_schema("o.parquet")
        assert {f.name: f.metadata[b"unit"].decode() for f in schema if b"unit" in (f.metadata or {})} == units


def test_the_mcap_opens_with_the_stock_reader(tmp_path: Path):
    recorded = recording(9000)
    voted = vote(recorded, VoteConfig(**ONE).signals(list(recorded.signals), ""), [])
    with output(tmp_path / "o.mcap") as part:
        write(part, Path("o.mcap"), recorded, Result(voted))
    with (tmp_path / "o.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 18000 and len(summary.chunk_indexes) > 1
        messages = [(m.log_time, p) for _, c, m, p in reader.iter_decoded_messages(["/signal/gyro.left"])]
    assert [time for time, _ in messages] == [20_000_000 * k for k in range(9000)]
    signal, samples = voted["gyro.left"], recorded.signals["gyro.left"]
    for k, (_, message) in list(enumerate(messages))[::1371]:
        assert np.isnan(message.truth) and np.isnan(message.reference)
        assert message.voted == signal.voted[k] and message.level == signal.level[k]
        assert [getattr(message, f"ch_{c + 1}") for c in range(4)] == [column[k] for column in samples.channels]
        assert message.st_1 == signal.state[0][k] and message.valid_1 == 1
    with (tmp_path / "o.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        three = [p for _, _, _, p in reader.iter_decoded_messages(["/signal/x"])][20]
    assert three.st_4 == State.ABSENT and np.isnan(three.ch_4) and three.valid_2 == 0 and three.st_2 == State.FAILED


def test_the_mcap_opens_in_rerun(tmp_path: Path):
    chunk = pytest.importorskip("rerun.chunk")
    recorded = recording(100)
    voted = vote(recorded, VoteConfig(**ONE).signals(list(recorded.signals), ""), [])
    write(tmp_path / "o.mcap", tmp_path / "o.mcap", recorded, Result(voted))
    messages: list[Any] = []
    for part in chunk.McapReader(tmp_path / "o.mcap", timeline_type="duration").stream():
        batch = part.to_record_batch()
        if str(part.entity_path) == "/signal/x" and "rig.Signal:message" in batch.schema.names:
            messages += batch.column("rig.Signal:message").to_pylist()
    assert [message["voted"] for (message,) in messages] == voted["x"].voted.tolist()
    assert messages[20][0]["st_2"]["name"] == "FAILED"


def test_a_foreign_log_is_read_by_its_mapping(tmp_path: Path):
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("imu", "jsonschema", b"{}")
        ids = [writer.register_channel(f"/imu{c}", "json", schema) for c in (1, 2)]
        for k in range(50):
            for c, channel in enumerate(ids):
                at = 10_000_000 * k + 2_000_000 * c
                body = {"angular_velocity": {"x": k + c}, "data": [0, -k if k else None]}
                writer.add_message(channel, at, json.dumps(body).encode(), at)
        writer.finish()
    mapping = {"gyro.1": "/imu1:angular_velocity.x", "gyro.2": "/imu2:angular_velocity.x", "gyro.ref": "/imu1:data.1"}
    recorded = read(tmp_path / "a.mcap", VoteConfig(mapping=mapping))
    samples = recorded.signals["gyro"]
    assert recorded.time_s == pytest.approx(np.arange(50) / 100)
    assert samples.channels[0].tolist() == list(range(50)) and samples.channels[1].tolist() == list(range(1, 51))
    assert samples.reference is not None and np.isnan(samples.reference[0]) and samples.reference[49] == -49
    for place, says in {
        "/imu3:x": "no topic '/imu3'; there are: /imu1, /imu2",
        "/imu1:angular_velocity.w": "no number 'angular_velocity.w'",
        "/imu1:angular_velocity": "no number 'angular_velocity'",
        "imu": "must be '<source>:<field>', got 'imu'",
    }.items():
        with pytest.raises(BadInput, match=says):
            read(tmp_path / "a.mcap", VoteConfig(mapping={**mapping, "gyro.2": place}))
    with pytest.raises(BadInput, match=r"not a log of this rig: .* of its topics: /imu1, /imu2"):
        read(tmp_path / "a.mcap", VoteConfig())


def test_a_foreign_log_of_protobuf_is_read_by_its_mapping(tmp_path: Path):
    with (tmp_path / "a.mcap").open("wb") as file, ProtobufWriter(file) as writer:
        for k in range(5):
            for c in (1, 2):
                stamp = Timestamp(seconds=k * c)
                writer.write_message(f"/clock{c}", stamp, 1_000_000_000 * (k + 1), 1_000_000_000 * (k + 1))
    recorded = read(tmp_path / "a.mcap", VoteConfig(mapping={"t.1": "/clock1:seconds", "t.2": "/clock2:seconds"}))
    assert recorded.time_s.tolist() == [1, 2, 3, 4, 5]
    assert recorded.signals["t"].channels[1].tolist() == [0, 2, 4, 6, 8]


def test_a_folder_of_recorders_becomes_one_recording(tmp_path: Path):
    at = np.arange(20) / 10
    pl.DataFrame({"time": at, "Gyr X": at}).write_csv(tmp_path / "IMU_1.csv")
    pl.DataFrame({"time": at + 1e-13, "Gyr X": 10 + at}).write_parquet(tmp_path / "IMU_2.parquet")
    gone = np.r_[at[:5], at[12:]]
    pl.DataFrame({"time": gone + 0.03, "Gyr X": 20 + gone, "note": ["a"] * len(gone)}).write_csv(tmp_path / "IMU_3.csv")
    mapping = {f"gyro.{c}": f"IMU_{c}.{'parquet' if c == 2 else 'csv'}:Gyr X" for c in (1, 2, 3)}
    recorded = read(tmp_path, VoteConfig(mapping=mapping, time_column="time"))
    first, second, third = recorded.signals["gyro"].channels
    assert recorded.time_s.tolist() == at.tolist() and first.tolist() == at.tolist()
    assert second == pytest.approx(10 + at)
    assert third[:5] == pytest.approx(20 + at[:5]) and third[12:] == pytest.approx(20 + at[12:])
    assert third[5] == pytest.approx(20.4) and np.isnan(third[6:11]).all()  # one interval away, and more
    with pytest.raises(BadInput, match=r"IMU_1\.csv: no column 'Gyr Z', which CONFIG names"):
        read(tmp_path, VoteConfig(mapping={**mapping, "gyro.1": "IMU_1.csv:Gyr Z"}, time_column="time"))
    with pytest.raises(BadInput, match=r"IMU_9\.csv: no such file"):
        read(tmp_path, VoteConfig(mapping={**mapping, "gyro.1": "IMU_9.csv:Gyr Z"}, time_column="time"))


def test_columns_of_a_single_table_are_renamed_by_the_mapping(tmp_path: Path):
    pl.DataFrame({"t": [0.0, 0.1], "left": [1.0, 2.0], "right": [3, None], "remark": ["a", "b"]}).write_csv(
        tmp_path / "in.csv"
    )
    recorded = read(tmp_path / "in.csv", VoteConfig(mapping={"x.1": "left", "x.2": "right"}, time_column="t"))
    assert recorded.signals["x"].channels[0].tolist() == [1.0, 2.0]
    assert recorded.signals["x"].channels[1][0] == 3.0 and np.isnan(recorded.signals["x"].channels[1][1])


def test_the_nearest_row_is_taken():
    rows, near = nearest_rows(np.array([-1.0, 0.4, 0.6, 1.5, 9.0]), np.array([0.0, 1.0, 2.0]))
    assert rows.tolist() == [0, 0, 1, 1, 2] and near.tolist() == [True, True, True, True, False]
    rows, near = nearest_rows(np.array([0.0, 5.0]), np.array([0.0]))
    assert rows.tolist() == [0, 0] and near.tolist() == [True, False]


def test_an_mcap_has_no_time_before_zero(rig: Any):
    config(**ONE)
    Path("in.csv").write_text(HEAD + "-1,1,1,1\n")
    refused(rig("in.csv", "--config", "c.toml", "--out", "o.mcap"), "", "time begins at -1 s")
    assert rig("in.csv", "--config", "c.toml", "--out", "o.csv")[0] == 0


def test_an_mcap_has_no_two_rows_of_one_nanosecond(rig: Any):
    config(**ONE)
    Path("in.csv").write_text(HEAD + "0,1,1,1\n1,1,1,1\n1.0000000001,1,1,1\n2,1,1,1\n")
    refused(rig("in.csv", "--config", "c.toml", "--out", "o.mcap"), "", "rows 2 and 3 have the same nanosecond")
    assert rig("in.csv", "--config", "c.toml", "--out", "o.csv")[0] == 0


def of_three(path: str, x: Any) -> None:
    """A Parquet file of three rows with ``x`` as the first of two channels."""
    pq.write_table(pa.table({"time_s": [0.0, 0.1, 0.2], "x.1": x, "x.2": [1.0, 1.0, 1.0]}), path)


NUMBERS = {
    "booleans": (pa.array([True, False, None]), [1, 0, None]),
    "decimals": (pa.array([Decimal("1.50")] * 3), [1.5] * 3),
    "a dictionary": (pa.array([1.0, 2.0, 1.0]).dictionary_encode(), [1, 2, 1]),
    "halves": (pa.array(np.array([1, 2, 3], np.float16)), [1, 2, 3]),
    "large integers": (pa.array([2**63 - 1, -(2**63), 0]), [2.0**63, -(2.0**63), 0]),
    "nothing": (pa.nulls(3), [None] * 3),
}
NO_NUMBERS = {
    "dates": pa.array([date(2020, 1, 1)] * 3),
    "lists": pa.array([[1.0]] * 3),
    "structs": pa.array([{"a": 1.0}] * 3),
    "a dictionary of words": pa.array(["a", "b", "a"]).dictionary_encode(),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_parquet_types_that_are_numbers_are_read(kind: str, tmp_path: Path):
    column, expected = NUMBERS[kind]
    of_three(str(tmp_path / "in.parquet"), column)
    found = read(tmp_path / "in.parquet", VoteConfig()).signals["x"].channels[0]
    assert [None if np.isnan(value) else value for value in found] == expected


@pytest.mark.parametrize("kind", NO_NUMBERS)
def test_parquet_types_that_are_no_numbers_are_refused(kind: str, rig: Any):
    config(**ONE)
    of_three("in.parquet", NO_NUMBERS[kind])
    refused(rig("in.parquet", "--config", "c.toml", "--out", "o.csv"), "in.parquet", "'x.1' must contain numbers, got")


def test_a_parquet_column_that_is_there_twice_is_refused(rig: Any):
    config(**ONE)
    one = pa.array([0.0, 0.1])
    pq.write_table(pa.Table.from_arrays([one] * 4, names=["time_s", "x.1", "x.1", "x.2"]), "in.parquet")
    refused(rig("in.parquet", "--config", "c.toml", "--out", "o.csv"), "in.parquet", "column 'x.1' is given twice")


def test_a_parquet_file_that_expands_beyond_its_limits_is_refused(rig: Any, monkeypatch: pytest.MonkeyPatch):
    config(**ONE)
    zeros = pa.array(np.zeros(500_000))
    pq.write_table(pa.table({"time_s": zeros, "x.1": zeros, "x.2": zeros}), "in.parquet")
    monkeypatch.setattr(limits, "CHUNK_LIMIT", 1 << 20)
    refused(rig("in.parquet", "--config", "c.toml", "--out", "o.csv"), "in.parquet", "expands to 12000000 bytes")


def test_columns_of_any_name_are_shown_as_they_are(rig: Any):
    config(**ONE)
    Path("in.csv").write_text("time_s,[/red].1,[/red].2,\x1b[2J.1,\x1b[2J.2\n0,1,1,1,1\n0.1,1,9,1,1\n")
    code, said, _ = rig("in.csv", "--config", "c.toml", "--out", "o.csv")
    assert code == 0 and "[/red].2" in said and "\\u001b[2J.1" in said and "\x1b" not in said
    assert "[/red].voted" in pl.read_csv("o.csv").columns


def test_names_that_no_file_can_have_are_refused(rig: Any):
    for name in ("a" * 300 + ".csv", "a\0.csv"):
        config(**ONE, mapping={"x.1": f"{name}:x", "x.2": f"{name}:y"})
        refused(rig(".", "--config", "c.toml", "--out", "o.csv"), "", "cannot be read")
    refused(rig("a" * 300 + ".csv", "--config", "c.toml", "--out", "o.csv"), "aaa", "read: File name too long")


@pytest.mark.parametrize("samples", ["", "inf", "1e308"])
def test_samples_that_are_no_samples_leave_no_vote_and_no_traceback(samples: str, rig: Any):
    config(default={"threshold": 1.0, "range": [-5.0, 5.0]})
    Path("in.csv").write_text(HEAD + "".join(f"{k},{samples},{samples},{samples}\n" for k in range(300)))
    for more in ([], ["--align"]):
        code, said, error = rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--json", *more)
        found = json.loads(said)["signals"]["x"]
        assert (code, error) == (0, "") and [c["invalid_samples"] for c in found["channels"]] == [300] * 3


@pytest.mark.parametrize("option", ["--align-from", "--align-to"])
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_stretch_is_of_finite_times(option: str, value: str, rig: Any):
    config(**ONE)
    Path("in.csv").write_text(HEAD + "0,1,1,1\n")
    refused(rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--align", option, value), option, "a finite number")


def test_signals_of_flight_have_the_range_and_the_turn_of_flight():
    chosen = VoteConfig(**ONE).signals(["heading", "pitch_rate", "x"], "c.toml")
    assert chosen["heading"].wraps and chosen["heading"].limits == (0.0, 2 * np.pi)
    assert not chosen["pitch_rate"].wraps and chosen["pitch_rate"].limits == (-1.5, 1.5)
    assert chosen["x"].limits == (-sys.float_info.max, sys.float_info.max)
    own = VoteConfig(default={"threshold": 1.0}, signal={"pitch_rate": {"range": [-90.0, 90.0]}})
    assert own.signals(["pitch_rate"], "")["pitch_rate"].limits == (-90.0, 90.0)


def test_a_damaged_chunk_is_noticed(tmp_path: Path):
    recorded = recording(300)
    voted = vote(recorded, VoteConfig(**ONE).signals(list(recorded.signals), ""), [])
    write(tmp_path / "o.mcap", tmp_path / "o.mcap", recorded, Result(voted))
    data = bytearray((tmp_path / "o.mcap").read_bytes())
    at = data.index(struct.pack("<I4s", 4, b"zstd")) + 200
    data[at] ^= 0xFF
    (tmp_path / "o.mcap").write_bytes(data)
    with pytest.raises(BadInput, match="damaged"):
        read(tmp_path / "o.mcap", VoteConfig())


def test_an_output_of_a_vote_with_codes_that_are_none_is_refused(tmp_path: Path):
    recorded = recording(30, ("x",))
    voted = vote(recorded, VoteConfig(**ONE).signals(["x"], ""), [])
    for signal, says in (
        (replace(voted["x"], state=[np.full(30, 7, np.uint8)] * 3), "st_1 is one of 0, 1, 2, 3, got 7"),
        (replace(voted["x"], state=[np.full(30, State.ABSENT, np.uint8)] * 3), "two to 4 are needed"),
    ):
        write(tmp_path / "o.mcap", tmp_path / "o.mcap", recorded, Result({"x": signal}))
        with pytest.raises(BadInput, match=says):
            read(tmp_path / "o.mcap", VoteConfig())
