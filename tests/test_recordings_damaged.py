"""Damaged recordings that are no logs of other systems: read as far as they go or refused in one line."""

from __future__ import annotations

import gc
import json
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow as pa
import pytest
from mcap.writer import Writer
from mcap_structure import Structure, write_again
from test_formats_damaged import COPIES, MOST, damaged
from test_log_writer import write

from rig.core.errors import BadInput
from rig.log.recordings.read import read
from rig.log.recordings.vote_config import VoteConfig

ROWS = 400


def table() -> pl.DataFrame:
    rng = np.random.default_rng(0)
    return pl.DataFrame({"time_s": np.arange(ROWS) / 50, **{f"x.{c}": rng.normal(size=ROWS) for c in (1, 2, 3)}})


def messages(path: Path, chunked: bool) -> bytes:
    with (path / "m").open("wb") as file:
        writer = Writer(file, chunk_size=2048, use_chunking=chunked)
        writer.start()
        ids = [writer.register_channel(f"/imu{c}", "json", 0) for c in (1, 2, 3)]
        for k in range(ROWS):
            for channel in ids:
                writer.add_message(channel, k * 10**7, json.dumps({"x": k * 0.1}).encode(), k * 10**7)
        writer.finish()
    return (path / "m").read_bytes()


def flight(path: Path) -> bytes:
    write(path / "f", 120)
    return (path / "f").read_bytes()


def again(path: Path) -> bytes:
    write(path / "f", 60)
    write_again(path / "f", path / "g", Structure(chunk_messages=300))
    return (path / "g").read_bytes()


def written(path: Path, ending: str) -> bytes:
    file = path / f"t.{ending}"
    table().write_csv(file) if ending == "csv" else table().write_parquet(file)
    return file.read_bytes()


def as_decoders_write(path: Path) -> bytes:
    head, *rows = written(path, "csv").decode().splitlines()
    lines = ["# a decoder", head, "s,m,m,m", *rows[:50], "# a remark", *rows[50:]]
    return (",\n".join(lines) + ",\n").replace(",", ", ").encode()


SOUND: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    "messages in chunks": ("mcap", lambda path: messages(path, True)),
    "messages beside chunks": ("mcap", lambda path: messages(path, False)),
    "a flight": ("mcap", flight),
    "a flight that was written again": ("mcap", again),
    "csv": ("csv", lambda path: written(path, "csv")),
    "csv of a decoder": ("csv", as_decoders_write),
    "parquet": ("parquet", lambda path: written(path, "parquet")),
}
LONG = ("a flight that was written again", "messages beside chunks", "parquet", "csv")
MAPPING = VoteConfig(mapping={f"x.{c}": f"/imu{c}:x" for c in (1, 2, 3)})


def outcome(path: Path, config: VoteConfig) -> str:
    """Read it: "whole", "part" or "refused"."""
    try:
        recorded = read(path, config)
    except BadInput as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 2000
        return "refused"
    assert all(len(each) == len(recorded.time_s) for of in recorded.signals.values() for each in of.channels)
    return "part" if recorded.warnings else "whole"


@pytest.mark.parametrize(
    ("name", "copies"),
    [
        *((name, COPIES // 10) for name in SOUND if name not in LONG),
        *(pytest.param(name, COPIES if name in LONG else COPIES // 4, marks=pytest.mark.long) for name in SOUND),
    ],
)
def test_every_damaged_copy_is_read_in_part_or_refused_in_one_line(
    name: str, copies: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    ending, make = SOUND[name]
    data, path = make(tmp_path), tmp_path / f"x.{ending}"
    config = MAPPING if name.startswith("messages") else VoteConfig()
    path.write_bytes(data)
    assert outcome(path, config) == "whole"
    capfd.readouterr()
    tracemalloc.start()
    before, found = pa.total_allocated_bytes(), []
    for number in range(copies):
        path.write_bytes(damaged(data, number))
        found.append(outcome(path, config))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    gc.collect()
    assert peak < MOST and pa.total_allocated_bytes() - before < MOST
    assert capfd.readouterr() == ("", "")
    assert {"refused", "part"} & set(found)
    if name == "messages in chunks":
        assert found.count("part") > 0.6 * copies
    if name.startswith("a flight"):
        assert "part" not in found


MDF = b"MDF     "  # its reader collects all garbage of the process
NOTHING = [b"", b"\n", b"\0" * 1000, b"#" * 1000, b"\xff" * 1000, b"\x89MCAP0\r\n", MDF]


@pytest.mark.parametrize(
    ("data", "ending"),
    [
        pytest.param(data, ending, marks=[pytest.mark.long] if data == MDF and ending != "mf4" else [])
        for data in NOTHING
        for ending in ("csv", "parquet", "mcap", "ulg", "BIN", "db3", "mf4")
    ],
)
def test_files_without_anything_are_refused_in_one_line(
    data: bytes, ending: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    path = tmp_path / f"x.{ending}"
    path.write_bytes(data)
    assert outcome(path, VoteConfig(mapping={"x.1": "/a:x", "x.2": "/a:y"})) == "refused"
    assert outcome(path, VoteConfig()) == "refused"
    assert capfd.readouterr() == ("", "")
