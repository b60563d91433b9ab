"""Damaged logs of other systems: read as far as they go or refused in one line, within limits; nothing is printed."""

from __future__ import annotations

import gc
import shutil
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import PX4_LOGS, RosBag, gyros, imus

from rig.core.errors import BadInput
from rig.log.recordings.formats.known import open_log

COPIES = 100
MOST = 64 << 20  # bytes of memory


def bag(path: Path, mcap: bool) -> bytes:
    with RosBag(path / "bag", mcap) as made:
        for k in range(300):
            for i in (0, 1):
                made.imu(f"/imu{i}", 10**18 + 10**7 * k, [0.1 * k, i, 1, 2, 3, 4])
    return next((path / "bag").glob("bag.[dm]*")).read_bytes()


def mdf(path: Path) -> bytes:
    from asammdf import MDF, Signal

    time_s = np.arange(500) / 100
    with MDF() as file:
        file.append([Signal(np.sin(time_s + i), time_s, unit="rad/s", name=f"gyro_{i}") for i in range(3)])
        file.save(path / "x.mf4", overwrite=True)
    return (path / "x.mf4").read_bytes()


SOUND: dict[str, Callable[[Path], bytes]] = {
    "ulg": lambda _: gyros(rows=300),
    "BIN": lambda _: imus(rows=300),
    "db3": lambda path: bag(path, False),
    "mcap": lambda path: bag(path, True),
    "mf4": mdf,
}


def damaged(data: bytes, number: int) -> bytes:
    """Copy ``number``: cut, with flipped bytes, with a length that is too large, with a part missing or doubled."""
    rng = np.random.default_rng(number)
    made, place = bytearray(data), int(rng.integers(16, len(data)))
    match number % 5:
        case 0:
            return bytes(made[:place])
        case 1:
            for at in rng.integers(16, len(data), rng.integers(1, 200)):
                made[at] ^= 1 << int(rng.integers(8))
        case 2:
            made[place : place + 4] = b"\xff\xff\xff\x7f"
        case 3:
            del made[place : place + int(rng.integers(1, 3000))]
        case _:
            made[place:place] = made[place : place + int(rng.integers(1, 3000))]
    return bytes(made)


def outcome(path: Path) -> str:
    """Read all that can be read: "whole", "part" or "refused"."""
    try:
        log = open_log(path)
        if log is None:
            return "refused"
        for topic in log.contents.topics:
            source = log.source(topic, list(topic.units))
            assert all(len(values) == topic.rows for values in source.fields.values())
    except BadInput as error:
        assert "\n" not in str(error)
        assert str(error).startswith(str(path))
        return "refused"
    told = log.contents.damage or any("not whole" in remark for remark in log.contents.remarks)
    return "part" if told else "whole"


@pytest.mark.parametrize(
    ("ending", "copies"),
    [
        *((ending, COPIES // 5) for ending in ("ulg", "BIN", "mcap")),
        *(pytest.param(ending, COPIES, marks=pytest.mark.long) for ending in ("ulg", "BIN", "mcap", "db3", "mf4")),
    ],
)
def test_every_damaged_copy_is_read_in_part_or_refused_in_one_line(
    ending: str, copies: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    data = SOUND[ending](tmp_path)
    path = tmp_path / f"x.{ending}"
    path.write_bytes(data)
    assert outcome(path) == "whole"
    capfd.readouterr()
    tracemalloc.start()
    found = []
    for number in range(copies):
        path.write_bytes(damaged(data, number))
        found.append(outcome(path))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    gc.collect()
    assert peak < MOST
    assert capfd.readouterr() == ("", "")
    assert {"refused", "part"} & set(found)
    if ending in ("ulg", "BIN"):
        assert found.count("part") > 0.6 * copies


@pytest.mark.skipif(not PX4_LOGS.is_dir(), reason="the recorded PX4 logs are not here")
@pytest.mark.parametrize("copies", [COPIES // 5, pytest.param(COPIES, marks=pytest.mark.long)])
def test_damaged_copies_of_a_real_log_keep_most_of_their_rows(copies: int, tmp_path: Path):
    data = (PX4_LOGS / "motor_failure.ulg").read_bytes()
    path = tmp_path / "x.ulg"
    path.write_bytes(data)
    whole = open_log(path)
    assert whole is not None
    rows = sum(topic.rows for topic in whole.contents.topics)
    for number in range(1, copies, 5):
        path.write_bytes(data[:30_000] + damaged(data[30_000:], number))
        log = open_log(path)
        assert log is not None
        assert sum(topic.rows for topic in log.contents.topics) > 0.8 * rows


@pytest.mark.parametrize("megabytes", [2, pytest.param(8, marks=pytest.mark.long)])
@pytest.mark.parametrize("ending", ["ulg", "BIN"])
def test_megabytes_of_zeros_or_noise_are_passed(ending: str, megabytes: int, tmp_path: Path):
    data = SOUND[ending](tmp_path)
    place = len(data) // 2
    size = megabytes << 20
    noise = np.random.default_rng(0).integers(0, 256, size, np.uint8).tobytes()
    path = tmp_path / f"x.{ending}"
    for junk in (bytes(size), noise, b"\xa3\x95\x80" * (size >> 3), b"\x01\x00D" * (size >> 3)):
        path.write_bytes(data[:place] + junk + data[place:])
        log = open_log(path)
        assert log is not None
        assert sum(topic.rows for topic in log.contents.topics) >= 890
        assert log.contents.damage


def test_a_bag_whose_pages_are_damaged_keeps_the_rows_before_them(tmp_path: Path):
    data = bytearray(SOUND["db3"](tmp_path))
    shutil.rmtree(tmp_path / "bag")
    data[-40_000:-20_000] = bytes(20_000)
    (tmp_path / "x.db3").write_bytes(data)
    try:
        log = open_log(tmp_path / "x.db3")
    except BadInput as error:
        assert "damaged" in str(error)
        return
    assert log is not None
    assert log.contents.damage
