"""MCAP files of any legal structure, cut and damaged ones, and fields of any name, by the formats' own writers."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.message_factory import GetMessages
from mcap.writer import CompressionType, Writer
from mcap_structure import STRUCTURES, Structure, write_again

from rig.core.errors import BadInput, BadLog
from rig.log import foreign
from rig.log.recordings.read import read
from rig.log.recordings.vote_config import VoteConfig

N = 300
VALUES = {topic: np.round(np.random.default_rng(i).normal(size=N), 9) for i, topic in enumerate(("/imu/1", "/imu/2"))}
TIMES_NS = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(N)


def write_json(path: Path, body: Callable[[str, int], Any], schema: Any = None, topics: Any = VALUES) -> None:
    """Messages of each topic, one a row; ``body``: of topic and row; ``schema`` None: there is none."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4096, compression=CompressionType.NONE)
        writer.start()
        number = 0 if schema is None else writer.register_schema("x", "jsonschema", json.dumps(schema).encode())
        channels = {topic: writer.register_channel(topic, "json", number) for topic in topics}
        for k, at in enumerate(TIMES_NS.tolist()):
            for topic, channel in channels.items():
                if (made := body(topic, k)) is not None:
                    writer.add_message(channel, at, json.dumps(made).encode(), at)
        writer.finish()


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    write_json(tmp_path / "plain.mcap", lambda topic, k: {"x": VALUES[topic][k]}, {})
    return tmp_path / "plain.mcap"


def assert_whole(path: Path, damage: list[str] | None = None) -> None:
    found = foreign.read(path, {topic: {"x"} for topic in VALUES}, damage)
    for topic, source in found.items():
        assert source.fields["x"].tolist() == VALUES[topic].tolist()
        assert source.time_s.tolist() == (TIMES_NS / 1e9).tolist()


@pytest.mark.parametrize("name", STRUCTURES)
def test_every_structure_holds_the_same_messages(name: str, plain: Path, tmp_path: Path):
    path = tmp_path / "b.mcap"
    write_again(plain, path, STRUCTURES[name])
    assert set(foreign.topics(path)) == set(VALUES)
    assert_whole(path)
    told: list[str] = []
    assert_whole(path, told)
    assert told == []


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("share", [0.7, *(pytest.param(share, marks=pytest.mark.long) for share in (0.3, 0.97))])
def test_a_cut_file_is_read_as_far_as_it_goes_and_what_is_left_out_is_told(
    share: float, name: str, plain: Path, tmp_path: Path
):
    path = tmp_path / "b.mcap"
    how = STRUCTURES[name]._replace(shuffled=False, about_last=False)
    write_again(plain, path, how)
    whole, path = path.read_bytes(), tmp_path / "c.mcap"
    path.write_bytes(whole[: int(share * whole.rindex(b"\x0f\x04\0\0\0\0\0\0\0"))])  # within the data section
    with pytest.raises(BadLog, match="truncated at byte"):
        foreign.read(path, {topic: {"x"} for topic in VALUES})
    told: list[str] = []
    try:
        found = foreign.read(path, {topic: {"x"} for topic in VALUES}, told)
    except BadInput as error:
        assert "no topic" in str(error)  # in one chunk that is compressed, its beginning may hold none
        return
    for topic, source in found.items():
        of = np.searchsorted(TIMES_NS / 1e9, source.time_s)  # with messages beside chunks it is no beginning
        assert source.fields["x"].tolist() == VALUES[topic][of].tolist()
        assert len(of) > (0.8 * share * N if how.chunk_messages < 1000 and how.compression != "lz4" else 0) - 60
    assert len(told) == 1 and "are no whole record" in told[0]


def test_the_vote_of_a_cut_file_warns_with_its_name(plain: Path, tmp_path: Path):
    data = plain.read_bytes()
    (tmp_path / "c.mcap").write_bytes(data[: len(data) // 2])
    mapping = {f"x.{c}": f"{topic}:x" for c, topic in enumerate(VALUES, 1)}
    recorded = read(tmp_path / "c.mcap", VoteConfig(mapping=mapping))
    assert 50 < len(recorded.time_s) < N
    assert f"{tmp_path / 'c.mcap'}: truncated at byte {len(data) // 2}" in recorded.warnings[0]


def test_a_damaged_chunk_is_left_out_and_told(plain: Path, tmp_path: Path):
    write_again(plain, tmp_path / "b.mcap", Structure(crcs=True, chunk_messages=50))
    data = bytearray((tmp_path / "b.mcap").read_bytes())
    at = data.index(b"zstd", len(data) // 3) + 40
    data[at] ^= 0xFF
    (tmp_path / "b.mcap").write_bytes(data)
    told: list[str] = []
    found = foreign.read(tmp_path / "b.mcap", {topic: {"x"} for topic in VALUES}, told)
    assert sum(len(source.time_s) for source in found.values()) == 2 * N - 50
    assert len(told) == 1 and told[0].startswith("damaged: ")
    with pytest.raises(BadLog):
        foreign.read(tmp_path / "b.mcap", {topic: {"x"} for topic in VALUES})


def test_behind_a_length_that_is_wrong_the_index_names_the_next_chunk(plain: Path, tmp_path: Path):
    write_again(plain, tmp_path / "b.mcap", Structure(chunk_messages=50))
    data = bytearray((tmp_path / "b.mcap").read_bytes())
    at = data.index(b"zstd", len(data) // 3) - 32 - 9 + 5
    data[at] ^= 0xFF
    (tmp_path / "b.mcap").write_bytes(data)
    told: list[str] = []
    found = foreign.read(tmp_path / "b.mcap", {topic: {"x"} for topic in VALUES}, told)
    assert sum(len(source.time_s) for source in found.values()) == 2 * N - 50
    assert len(told) == 1 and "bytes are no whole record" in told[0]


SCHEMAS: dict[str, Any] = {
    "of the field": {"properties": {"w": {"properties": {"x": {"type": "number", "default": 0}}}}},
    "of what holds it": {"properties": {"w": {"default": {"x": 0}}}},
    "by reference": {
        "properties": {"w": {"$ref": "#/definitions/vector"}},
        "definitions": {"vector": {"properties": {"x": {"default": 0.0}}}},
    },
    "of one of several": {"allOf": [{}, {"properties": {"w": {"properties": {"x": {"default": 0}}}}}]},
}


@pytest.mark.parametrize("whole_group", [False, True])
@pytest.mark.parametrize("name", SCHEMAS)
def test_a_field_that_is_left_out_has_the_default_of_its_schema(name: str, whole_group: bool, tmp_path: Path):
    def body(topic: str, k: int) -> Any:
        return ({} if whole_group else {"w": {}}) if k % 50 == 7 else {"w": {"x": VALUES[topic][k]}}

    write_json(tmp_path / "a.mcap", body, SCHEMAS[name])
    found = foreign.read(tmp_path / "a.mcap", {"/imu/1": {"w.x"}})["/imu/1"].fields["w.x"]
    expected = VALUES["/imu/1"].copy()
    expected[7::50] = 0.0
    assert found.tolist() == expected.tolist()


@pytest.mark.parametrize("schema", [None, {}, {"properties": {"w": {"properties": {"x": {"type": "number"}}}}}])
def test_without_a_default_the_line_says_which_message_lacks_it_and_how_many(schema: Any, tmp_path: Path):
    write_json(tmp_path / "a.mcap", lambda t, k: {"w": {} if k % 50 == 7 else {"x": VALUES[t][k]}}, schema)
    with pytest.raises(BadInput, match=r"6 of 300 messages lack 'w.x', .*; the first is message 8, at 0.07 s"):
        foreign.read(tmp_path / "a.mcap", {"/imu/1": {"w.x"}})


def test_a_field_that_no_message_has_is_refused_with_those_there_are(tmp_path: Path):
    write_json(tmp_path / "a.mcap", lambda t, k: {"gyro": 1, "accel": 2}, {})
    with pytest.raises(BadInput, match="no number 'gyr' in its messages; allowed: gyro, accel"):
        foreign.read(tmp_path / "a.mcap", {"/imu/1": {"gyr"}})


def protobuf_type() -> tuple[Any, bytes]:
    """A message with a number, a nested one, a list, and a map of names to numbers."""
    field, of = FieldDescriptorProto, FieldDescriptorProto
    inner = DescriptorProto(name="V", field=[field(name="x", number=1, type=of.TYPE_DOUBLE, label=of.LABEL_OPTIONAL)])
    entry = DescriptorProto(name="NamedEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=of.TYPE_STRING, label=of.LABEL_OPTIONAL)
    entry.field.add(name="value", number=2, type=of.TYPE_DOUBLE, label=of.LABEL_OPTIONAL)
    outer = DescriptorProto(name="Imu", nested_type=[inner, entry])
    outer.field.add(name="n", number=1, type=of.TYPE_SINT32, label=of.LABEL_OPTIONAL)
    outer.field.add(name="w", number=2, type=of.TYPE_MESSAGE, type_name=".t.Imu.V", label=of.LABEL_OPTIONAL)
    outer.field.add(name="data", number=3, type=of.TYPE_FLOAT, label=of.LABEL_REPEATED)
    outer.field.add(
        name="named", number=4, type=of.TYPE_MESSAGE, type_name=".t.Imu.NamedEntry", label=of.LABEL_REPEATED
    )
    file = FileDescriptorProto(name="t.proto", package="t", syntax="proto3", message_type=[outer])
    return GetMessages([file])["t.Imu"], FileDescriptorSet(file=[file]).SerializeToString()


def test_values_of_protobuf_are_those_that_were_written_and_zeros_that_it_leaves_out(tmp_path: Path):
    kind, schema = protobuf_type()
    x, n = VALUES["/imu/1"].copy(), np.arange(N) - 100
    x[::10] = 0.0
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/a:b", "protobuf", writer.register_schema("t.Imu", "protobuf", schema))
        for k, at in enumerate(TIMES_NS.tolist()):
            message = kind(n=int(n[k]), data=[0.5, k], named={"gyro.x": float(k)})
            if x[k]:
                message.w.x = x[k]  # with a zero the whole group is left out
            writer.add_message(channel, at, message.SerializeToString(), at)
        writer.finish()
    wanted = {"n", "w.x", "data.1", "named.gyro.x"}
    found = foreign.read(tmp_path / "a.mcap", {"/a:b": wanted})["/a:b"].fields
    assert found["w.x"].tolist() == x.tolist()
    assert found["n"].tolist() == n.tolist()
    assert found["data.1"].tolist() == found["named.gyro.x"].tolist() == list(range(N))


NAMES: dict[str, tuple[Any, str, float]] = {
    "nested": ({"gyro": {"x": 1}}, "gyro.x", 1),
    "a key with a dot": ({"gyro.x": 2}, "gyro.x", 2),
    "both: the key": ({"gyro.x": 2, "gyro": {"x": 1}}, "gyro.x", 2),
    "both: the nested one in quotes": ({"gyro.x": 2, "gyro": {"x": 1}}, '"gyro"."x"', 1),
    "both: the key in quotes": ({"gyro.x": 2, "gyro": {"x": 1}}, '"gyro.x"', 2),
    "a key with a dot that is nested": ({"a": {"b.c": {"d": 3}}}, "a.b.c.d", 3),
    "the longest that leads to it": ({"a.b": {"z": 1}, "a": {"b": {"c": 4}}}, "a.b.c", 4),
    "a colon": ({"gyro:x": 5}, "gyro:x", 5),
    "slashes": ({"gyro/x": {"/y": 6}}, "gyro/x./y", 6),
    "an element": ({"data": [{"v.w": 7}]}, "data.0.v.w", 7),
    "blanks and units": ({"gyro x [rad/s]": 8}, "gyro x [rad/s]", 8),
    "dots at the ends": ({".x.": 9}, ".x.", 9),
    "quotes in the name": ({'a"b': 10}, 'a"b', 10),
    "a list at the top": ([0, 11], "1", 11),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "topic", ["/imu", "a:b:c", *(pytest.param(topic, marks=pytest.mark.long) for topic in ("imu:left", "/x.y", '"q"'))]
)
def test_fields_and_topics_of_any_name_are_named(topic: str, name: str, tmp_path: Path):
    body, field, value = NAMES[name]
    write_json(tmp_path / "a.mcap", lambda *_: body, {}, [topic, "imu"])
    for place in (f"{topic}:{field}", f'"{topic}":{field}'):
        recorded = read(tmp_path / "a.mcap", VoteConfig(mapping={"x.1": place, "x.2": place}))
        assert set(recorded.signals["x"].channels[0].tolist()) == {value}


def test_a_topic_that_is_not_there_is_refused_with_those_there_are(plain: Path):
    with pytest.raises(BadInput, match="no topic '/imu/3'; there are: /imu/1, /imu/2"):
        read(plain, VoteConfig(mapping={"x.1": "/imu/3:x", "x.2": "/imu/1:x"}))


def test_several_messages_of_one_time_keep_the_order_of_the_file(tmp_path: Path):
    def written(values: Mapping[int, list[float]]) -> list[float]:
        with (tmp_path / "a.mcap").open("wb") as file:
            writer = Writer(file)
            writer.start()
            channel = writer.register_channel("/a", "json", 0)
            for at, of in values.items():
                for value in of:
                    writer.add_message(channel, at, json.dumps({"x": value}).encode(), at)
            writer.finish()
        return foreign.read(tmp_path / "a.mcap", {"/a": {"x"}})["/a"].fields["x"].tolist()

    assert written({20: [3, 4], 10: [1, 2], 30: [5]}) == [1, 2, 3, 4, 5]
