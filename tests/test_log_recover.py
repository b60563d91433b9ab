"""A cut log gives back every whole second before the cut, as a log that any reader opens."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from test_log_writer import random_block, random_timing, summary_of, write

from rig.core.errors import BadLog, RigError
from rig.core.frame import FLAT, Table
from rig.flight.events import Event
from rig.log import read_log, recover
from rig.log.writer import LogWriter

FRAMES = 33
RATE = 10.0  # a chunk has 10 frames
EVENTS = [Event(3, "info", "a", "b"), Event(25, "error", "c", "")]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A whole log, its block, and where each of its chunks begins and ends (with the message indexes)."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    block, _ = write(path, FRAMES, EVENTS, rate=RATE, result={"survived": "true"})
    indexes = summary_of(path).chunk_indexes
    ends = [index.chunk_start_offset + index.chunk_length for index in indexes]
    return path.read_bytes(), block, ends, indexes[0].chunk_start_offset


@given(data=st.data())
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_whole_chunk_before_any_cut_is_saved(tmp_path, flown, data):
    whole, block, ends, first = flown
    cut = data.draw(st.one_of(st.sampled_from([*ends, first]), st.integers(first, len(whole) - 1)))
    check(tmp_path, whole, block, ends, cut)


def test_cuts_at_the_edges_of_records(tmp_path, flown):
    whole, block, ends, first = flown
    for cut in (first, first + 5, ends[0] - 1, ends[0], ends[0] + 1, len(whole) - 9, len(whole) - 1):
        check(tmp_path, whole, block, ends, cut)


def check(tmp_path, whole, block, ends, cut):
    path, out = tmp_path / "a.mcap", tmp_path / "b.mcap"
    path.write_bytes(whole[:cut])
    frames = min(FRAMES, 10 * sum(end <= cut for end in ends))
    saved = recover(path, out)
    assert (saved.frames, saved.complete) == (frames, False)
    assert saved.last_time_s == (frames - 1) / 10 if frames else saved.last_time_s == 0
    assert "truncated" in saved.damage
    log = read_log(out)
    assert log.rows.tobytes() == block[:frames].tobytes()
    assert [e.frame for e in log.events] == [e.frame for e in EVENTS if e.frame < frames]
    assert log.scenario_text == "duration_s = 1\n"
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        counted = sum(1 for _ in reader.iter_messages("/flight"))
        assert counted == frames
        assert "recovered" in {m.name for m in reader.iter_metadata()}
    assert not list(tmp_path.glob(".*.part"))


def test_the_bytes_that_are_lost_are_counted_from_the_last_whole_record(tmp_path, flown):
    whole, _, _, first = flown
    (tmp_path / "a.mcap").write_bytes(whole[: first + 321])
    assert recover(tmp_path / "a.mcap", tmp_path / "b.mcap").lost_bytes == 321


def test_a_log_that_is_whole_is_said_to_be_whole_and_nothing_is_written(tmp_path):
    write(tmp_path / "a.mcap", 120)
    saved = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert (saved.frames, saved.last_time_s, saved.complete, saved.damage) == (120, 1.19, True, "")
    assert saved.lost_bytes == 0
    assert not (tmp_path / "b.mcap").exists()


def test_a_recovered_log_is_whole(tmp_path, flown):
    whole, _, ends, _ = flown
    (tmp_path / "a.mcap").write_bytes(whole[: ends[1]])
    recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert recover(tmp_path / "b.mcap", tmp_path / "c.mcap").complete


def test_a_log_can_be_mended_in_its_place(tmp_path, flown):
    whole, block, ends, _ = flown
    path = tmp_path / "a.mcap"
    path.write_bytes(whole[: ends[1]])
    recover(path, path)
    assert read_log(path).rows.tobytes() == block[:20].tobytes()


def test_a_result_before_the_cut_is_kept(tmp_path, flown):
    whole, *_ = flown
    (tmp_path / "a.mcap").write_bytes(whole[:-20])
    recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert read_log(tmp_path / "b.mcap").result == {"survived": "true"}


def test_damage_in_the_middle_keeps_what_is_before_it(tmp_path, flown):
    whole, block, ends, _ = flown
    damaged = bytearray(whole)
    damaged[ends[1] - 500] ^= 1
    (tmp_path / "a.mcap").write_bytes(damaged)
    saved = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert (saved.frames, saved.complete) == (10, False)
    assert "damaged" in saved.damage
    assert read_log(tmp_path / "b.mcap").rows.tobytes() == block[:10].tobytes()


def test_an_aborted_log_is_mended(tmp_path):
    log = LogWriter(tmp_path / "a.mcap", 100.0, {})
    log.write(Table(random_block(100), timing=random_timing(100)))
    log.abort()
    assert recover(tmp_path / "a.mcap", tmp_path / "b.mcap").frames == 100


def test_what_is_no_log_is_refused(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"no log at all, and quite long enough to be one")
    with pytest.raises(BadLog, match="not an MCAP"):
        recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with pytest.raises(BadLog, match="no such file"):
        recover(tmp_path / "missing.mcap", tmp_path / "b.mcap")


def test_a_cut_before_the_metadata_leaves_nothing(tmp_path, flown):
    (tmp_path / "a.mcap").write_bytes(flown[0][:60])
    with pytest.raises(BadLog, match="nothing can be recovered"):
        recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()


def test_an_output_that_cannot_be_written_is_said_in_one_line(tmp_path, flown):
    (tmp_path / "a.mcap").write_bytes(flown[0][:-10])
    with pytest.raises(RigError, match="no such folder"):
        recover(tmp_path / "a.mcap", tmp_path / "missing" / "b.mcap")


def test_the_rows_of_a_recovered_log_have_the_dtype_of_a_frame(tmp_path, flown):
    (tmp_path / "a.mcap").write_bytes(flown[0][:-10])
    recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert read_log(tmp_path / "b.mcap").rows.dtype == FLAT
