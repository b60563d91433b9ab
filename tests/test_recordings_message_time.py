"""Times of messages: from a field, in bursts, of two publishers, of recorders without common time."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import Writer
from mcap_protobuf.writer import Writer as ProtobufWriter

from rig.core.errors import BadInput
from rig.log.message_time import seconds
from rig.log.publishers import overlapping, publishers
from rig.log.recordings.bursts import bursts, spread
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import rows_a_second
from rig.log.recordings.vote_config import VoteConfig

N = 400
T: Any = 50.0 + np.arange(N) / 100
EPOCH_NS = 1_700_000_000_000_000_000
MAPPING = {"x.1": "/a:x", "x.2": "/b:x"}
Message = tuple[str, int, dict[str, Any]]


def write(messages: Iterable[Message], channels: Iterable[str] = ("/a", "/b"), path: str = "in.mcap") -> Path:
    """Write JSON messages: name of the channel, log time, body; '/a!' is a second channel of /a."""
    with Path(path).open("wb") as file:
        writer = Writer(file)
        writer.start()
        numbers = {name: writer.register_channel(name.rstrip("!"), "json", 0) for name in channels}
        for name, log_ns, body in messages:
            writer.add_message(numbers[name], log_ns, json.dumps(body).encode(), log_ns)
        writer.finish()
    return Path(path)


def both(stamp: Any, log_ns: Any = lambda k: EPOCH_NS + k * 10_000_000) -> list[Message]:
    """Messages of two topics; ``x`` counts them."""
    return [(topic, log_ns(k), {"x": float(k), **stamp(k)}) for k in range(N) for topic in ("/a", "/b")]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def at(path: Path, repair: bool = False, **settings: Any) -> Recording:
    return read(path, VoteConfig(mapping=settings.pop("mapping", MAPPING), **settings), repair)


def whole(time_s: float) -> dict[str, int]:
    return {"sec": int(time_s), "nanosec": round(time_s % 1 * 1e9)}


@pytest.mark.parametrize(
    ("unit", "stamp"),
    [
        ("s", lambda k: {"header": {"stamp": whole(T[k])}}),
        ("s", lambda k: {"header": {"stamp": {"secs": int(T[k]), "nsecs": round(T[k] % 1 * 1e9)}}}),
        ("s", lambda k: {"header": {"stamp": f"1970-01-01T00:00:{T[k]:.2f}Z"}}),
        ("s", lambda k: {"header": {"stamp": float(T[k])}}),
        ("us", lambda k: {"header": {"stamp": round(T[k] * 1e6)}}),
        ("ms", lambda k: {"header": {"stamp": str(round(T[k] * 1e3))}}),
    ],
)
def test_the_time_is_that_of_a_field(unit: str, stamp: Any):
    recorded = at(write(both(stamp)), time="header.stamp", time_unit=unit)
    assert recorded.time_s == pytest.approx(T) and recorded.rate_hz == pytest.approx(100.0)
    assert recorded.signals["x"].channels[0].tolist() == recorded.signals["x"].channels[1].tolist() == list(range(N))


def test_each_source_may_have_its_field_or_the_log_time():
    messages = both(lambda k: {"t": float(T[k])}, lambda k: int(T[k] * 1e9))
    recorded = at(write(messages), times={"/a": "t"})
    assert recorded.time_s == pytest.approx(T) and recorded.signals["x"].channels[1].tolist() == list(range(N))
    with pytest.raises(BadInput, match=r"\[times\] '/c': not a source of \[mapping\]; allowed: /a, /b"):
        at(Path("in.mcap"), times={"/c": "t"})
    with pytest.raises(BadInput, match=r"no number 'u'"):
        at(Path("in.mcap"), time="u")


def test_protobuf_stamps_are_seconds_and_nanoseconds():
    stamp = Timestamp(seconds=12, nanos=250_000_000)
    assert seconds(stamp) == 12.25 and seconds(None) is None and seconds("2023-11-14T22:13:20.5") == 1_700_000_000.5
    with Path("p.mcap").open("wb") as file, ProtobufWriter(file) as writer:
        for k in range(N):
            at_ns = round(T[k] * 1e9)
            message = Timestamp(seconds=at_ns // 10**9, nanos=at_ns % 10**9)
            writer.write_message("/a", message, EPOCH_NS + k, EPOCH_NS + k)
    with pytest.raises(BadInput, match="no number 'stamp'"):
        at(Path("p.mcap"), mapping={"x.1": "/a:nanos", "x.2": "/a:nanos"}, time="stamp")


def test_stamps_of_zero_fall_back_to_the_time_of_the_log():
    recorded = at(write(both(lambda k: {"t": 0.0})), time="t")
    assert recorded.time_s[0] == EPOCH_NS / 1e9
    assert [line.rsplit(": ", 1)[0] for line in recorded.remarks] == [
        f"in.mcap: {topic}: t is 0 or missing" for topic in ("/a", "/b")
    ]
    recorded = at(write(both(lambda k: {"t": 0.0 if k in (7, 8) else float(T[k])})), time="t")
    assert len(recorded.time_s) == N - 2 and "2 messages without t were left out" in recorded.remarks[0]
    recorded = at(write(both(lambda k: {"t": k / 100})), time="t")  # begins at 0: no missing stamp
    assert len(recorded.time_s) == N and not recorded.remarks


def test_messages_without_any_time_are_refused_with_the_key_that_helps():
    with pytest.raises(BadInput, match=r"/a: .*all rows have one time.*; time in CONFIG names a field of the messages"):
        at(write(both(lambda k: {"t": float(T[k])}, lambda k: 0)))
    assert at(Path("in.mcap"), time="t").time_s == pytest.approx(T)


def test_a_field_that_rolls_over_is_unrolled():
    recorded = at(write(both(lambda k: {"t": (2**32 - 1_000_000 + k * 10_000) % 2**32})), time="t", time_unit="us")
    assert recorded.time_s - recorded.time_s[0] == pytest.approx(T - T[0])
    assert recorded.remarks[0] == "in.mcap: /a: the time rolls over after 2^32 us (4294.967296 s) in row 101: unrolled"


def test_settings_of_messages_and_of_tables_are_not_mixed():
    Path("t.csv").write_text("time_s,x.1,x.2\n0,1,1\n1,1,1\n")
    with pytest.raises(BadInput, match="time: names a field of messages; the column of tables is time_column"):
        read(Path("t.csv"), VoteConfig(time="stamp"))
    write(both(lambda k: {}))
    with pytest.raises(
        BadInput, match=r'time_unit, separator and decimal are those of tables; .*time = "header.stamp"'
    ):
        at(Path("in.mcap"), time_unit="ms")


def bursty(offset_ns: int, rows: int = 10) -> Any:
    """Log times of samples every 10 ms that are written in bursts."""
    return lambda k: EPOCH_NS + offset_ns + (k // rows + 1) * rows * 10_000_000 + (k % rows) * 20_000


@pytest.mark.parametrize("rows", [5, 10, 40])
def test_channels_that_are_logged_in_bursts_are_joined_sample_by_sample(rows: int):
    a, b = bursty(0, rows), bursty(3_000_000, rows)
    messages = [m for k in range(N) for m in (("/a", a(k), {"x": float(k)}), ("/b", b(k), {"x": float(k)}))]
    recorded = at(write(messages))
    first, second = recorded.signals["x"].channels
    assert np.isfinite(second).all() and np.abs(second - first).max() <= 1.0
    assert recorded.rate_hz == pytest.approx(100.0, rel=0.01)
    assert f"times in bursts of {rows} rows every {rows / 100:g} s" in recorded.warnings[0]
    assert not any("rows a second" in line or "gap" in line for line in recorded.warnings)


def test_a_regular_recorder_and_one_with_pauses_have_no_bursts():
    rng = np.random.default_rng(3)
    assert bursts(T + rng.uniform(0, 0.004, N)) is None
    paused = T + np.cumsum(np.where(np.arange(N) % 100 == 50, rng.uniform(0.1, 9.0, N), 0.0))
    assert bursts(paused) is None and rows_a_second(T) == pytest.approx(100.0)
    stamps = np.array([bursty(0)(k) for k in range(N)]) / 1e9
    found = bursts(stamps)
    assert found is not None and np.diff(spread(stamps, found)) == pytest.approx(0.01, abs=1e-3)


def test_recorders_without_common_time_are_refused_with_both_spans():
    messages = [
        (topic, begin + k * 10_000_000, {"x": 0.0})
        for k in range(N)
        for topic, begin in (("/a", EPOCH_NS), ("/b", 5 * 10**9))
    ]
    with pytest.raises(BadInput) as refused:
        at(write(messages))
    dates = "2023-11-14 22:13:20.00 UTC to 2023-11-14 22:13:23.99 UTC"
    spans = f"/a 1700000000 to 1700000003.99 s ({dates}), /b 5 to 8.99 s"
    assert str(refused.value) == f"in.mcap: the sources have no time in common: {spans}"


def two(offset_ns: int, channel: str) -> list[Message]:
    return [
        (name, EPOCH_NS + k * 10_000_000 + ahead, {"x": k + shift})
        for k in range(N)
        for name, ahead, shift in (("/a", 0, 0.0), (channel, offset_ns, 1000.0), ("/b", 0, 0.0))
    ]


def test_two_publishers_with_channels_of_one_topic_are_told_apart():
    write(two(3_000_000, "/a!"), ("/a", "/a!", "/b"))
    with pytest.raises(
        BadInput, match=r"topic '/a': 2 publishers at a time; the mapping may name one of '/a#1', '/a#2'"
    ):
        at(Path("in.mcap"))
    recorded = at(Path("in.mcap"), mapping={"x.1": "/b:x", "x.2": "/a#1:x", "x.3": "/a#2:x"})
    assert [column[5] for column in recorded.signals["x"].channels] == [5.0, 5.0, 1005.0]


def test_a_topic_that_is_opened_again_is_one_publisher():
    messages = [("/a" if k < 200 else "/a!", EPOCH_NS + k * 10_000_000, {"x": float(k)}) for k in range(N)]
    messages += [("/b", EPOCH_NS + k * 10_000_000, {"x": float(k)}) for k in range(N)]
    recorded = at(write(messages, ("/a", "/a!", "/b")))
    assert recorded.signals["x"].channels[0].tolist() == list(range(N))
    assert overlapping([1, 1, 2, 2], np.array([0.0, 1.0, 1.5, 2.0])) == []


@pytest.mark.parametrize(
    ("offset_ns", "why"), [(3_000_000, "in turn: two publishers"), (0, "two values: two publishers")]
)
@pytest.mark.parametrize("repair", [False, True])
def test_two_publishers_that_share_a_channel_are_refused(offset_ns: int, why: str, repair: bool):
    with pytest.raises(BadInput, match=f"/a: .*{why} on one topic, which cannot be told apart"):
        at(write(two(offset_ns, "/a")), repair)


def test_stamps_of_whole_milliseconds_are_no_second_publisher():
    assert publishers(np.round(np.arange(1000) / 400, 3)) == ""  # steps of 2 and 3 ms in turn
    assert "two publishers" in publishers(np.sort(np.concatenate([T, T + 0.0031])))
