"""A log of the rig that another program wrote again is read bit for bit, in every structure that the format allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Message
from mcap_structure import STRUCTURES, Structure, held, write_again
from test_log_writer import write

from rig.core.errors import BadLog
from rig.flight.events import Event
from rig.flight.fly import fly
from rig.log import LogFile, read_log
from rig.log.info import info
from rig.log.recordings.read import read
from rig.log.recordings.vote_config import VoteConfig
from rig.log.scan import contents, recover

LOGS = Path(__file__).parent / "logs"
EVENTS = (Event(3, "info", "fault on", "stuck"), Event(90, "warning", "größer", ""), Event(90, "error", "c", "d"))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flown") / "a.mcap"
    write(path, 120, EVENTS, result={"survived": "true", "digest": "00ff"})
    return path


def assert_equal(path: Path, whole: Path) -> None:
    log, of = read_log(path), read_log(whole)
    assert log.rows.tobytes() == of.rows.tobytes()
    assert log.timing.tobytes() == of.timing.tobytes()
    assert (log.parts is None) == (of.parts is None)
    if log.parts is not None and of.parts is not None:
        assert np.asarray(log.parts).tobytes() == np.asarray(of.parts).tobytes()
    assert sorted(log.events, key=str) == sorted(of.events, key=str)  # of one time in any order
    assert [event.frame for event in log.events] == [event.frame for event in of.events]
    assert (log.metadata, log.result, log.attachments) == (
        of.metadata,
        of.result,
        of.attachments,
    )
    counted, before = contents(path), contents(whole)
    assert counted.messages == before.messages and counted.events == before.events
    assert LogFile.open(path).complete == LogFile.open(whole).complete


QUICK = ("no summary", "lz4", "messages beside chunks", "out of order", "channels renumbered", "with checksums")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.long]) for name in STRUCTURES]
)
def test_every_structure_holds_the_same_flight(name: str, flown: Path, tmp_path: Path):
    write_again(flown, tmp_path / "b.mcap", STRUCTURES[name])
    assert_equal(tmp_path / "b.mcap", flown)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 6))])
def test_structures_drawn_by_lot_hold_the_same_flight(seed: int, flown: Path, tmp_path: Path):
    rng = np.random.default_rng(seed)

    def one_of(*values: Any) -> Any:
        return values[rng.integers(len(values))]

    how = Structure(
        compression=one_of("", "lz4", "zstd"),
        chunk_messages=one_of(0, 4, 13, 500, 10**6),
        beside=one_of(0.0, 0.2),
        shuffled=one_of(True, False),
        numbered=one_of(1, 40),
        declared=one_of("top", "chunk", "both"),
        about_last=one_of(True, False),
        unknown=one_of(True, False),
        crcs=one_of(True, False),
        summary=one_of("all", "none", "bare", "index", "statistics"),
        indexes=one_of(True, False),
    )
    write_again(flown, tmp_path / "b.mcap", how, seed)
    assert_equal(tmp_path / "b.mcap", flown)


@pytest.mark.parametrize("log", sorted(LOGS.glob("flight_*.mcap")), ids=lambda path: path.stem)
def test_logs_of_older_versions_are_read_too(log: Path, tmp_path: Path):
    write_again(log, tmp_path / "b.mcap", Structure(shuffled=True, chunk_messages=50, declared="chunk", numbered=7))
    assert_equal(tmp_path / "b.mcap", log)


def test_info_says_that_another_program_wrote_it_and_whether_all_bytes_have_a_checksum(flown: Path, tmp_path: Path):
    for crcs, says in ((True, "again; whole, every checksum matches"), (False, "without a checksum of all")):
        write_again(flown, tmp_path / "b.mcap", Structure(crcs=crcs))
        about = info(tmp_path / "b.mcap")
        assert says in about["health"] and about["damage"] is None and about["frames"] == 120


@pytest.mark.parametrize("how", [Structure(chunk_messages=0), Structure(chunk_messages=40), Structure(summary="none")])
def test_a_cut_is_told_and_the_frames_before_it_are_recovered(how: Structure, flown: Path, tmp_path: Path):
    path = tmp_path / "b.mcap"
    write_again(flown, path, how)
    data = path.read_bytes()
    path.write_bytes(data[: 6 * len(data) // 10])
    with pytest.raises(BadLog, match=r"truncated at byte .*; rig recover saves the frames before it"):
        read_log(path)
    found = recover(path, tmp_path / "c.mcap")
    log, whole = read_log(tmp_path / "c.mcap"), read_log(flown)
    assert not found.complete and 0 < found.frames == log.frames < 120
    assert log.rows.tobytes() == whole.rows[: log.frames].tobytes()
    assert "truncated" in info(tmp_path / "c.mcap")["health"]


@pytest.mark.parametrize("how", [Structure(crcs=True), Structure(crcs=True, chunk_messages=0)])
@pytest.mark.parametrize("number", [0, 3, *(pytest.param(number, marks=pytest.mark.long) for number in (1, 2, 4))])
def test_with_checksums_any_flipped_bit_is_noticed(number: int, how: Structure, flown: Path, tmp_path: Path):
    path = tmp_path / "b.mcap"
    write_again(flown, path, how)
    data = bytearray(path.read_bytes())
    data[len(data) * (2 * number + 1) // 20] ^= 1 << number
    path.write_bytes(data)
    with pytest.raises(BadLog):
        read_log(path)


def changed(flown: Path, path: Path, change: Any) -> None:
    """Write the log again with other messages."""
    import mcap_structure

    found = held(flown)
    kept = found._replace(messages=change(found))
    original = mcap_structure.held
    try:
        mcap_structure.held = lambda _: kept
        write_again(flown, path, Structure())
    finally:
        mcap_structure.held = original


def of_topic(found: Any, topic: str) -> int:
    return next(number for number, channel in found.channels.items() if channel.topic == topic)


CHANGES: dict[str, tuple[Any, str]] = {
    "one is lacking": (
        lambda found: [m for m in found.messages if (m.channel_id, m.sequence) != (of_topic(found, "/flight"), 100)],
        "the frame at 1 s has no message of /flight",
    ),
    "one is there twice": (
        lambda found: [*found.messages, next(m for m in found.messages if m.channel_id == of_topic(found, "/flight"))],
        "two messages of /flight at 0 ns",
    ),
    "one is of another program": (
        lambda found: [
            Message(**{**vars(m), "data": m.data[:-1]}) if m.channel_id == of_topic(found, "/control") else m
            for m in found.messages
        ],
        "a message of /control is not as the rig writes it",
    ),
    "one is at another time": (
        lambda found: [
            Message(**{**vars(m), "log_time": m.log_time + 1}) if m.sequence == 20 else m for m in found.messages
        ],
        "the time of a message is that of no frame",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_messages_that_make_no_frame_are_refused(name: str, flown: Path, tmp_path: Path):
    change, says = CHANGES[name]
    changed(flown, tmp_path / "b.mcap", change)
    with pytest.raises(BadLog, match=says):
        read_log(tmp_path / "b.mcap")


def test_a_log_without_one_of_its_topics_is_refused_by_its_name(flown: Path, tmp_path: Path):
    import mcap_structure

    found = held(flown)
    flight = of_topic(found, "/flight")
    kept = found._replace(
        messages=[m for m in found.messages if m.channel_id != flight],
        channels={n: c for n, c in found.channels.items() if n != flight},
    )
    mcap_structure.held, original = lambda _: kept, mcap_structure.held
    try:
        write_again(flown, tmp_path / "b.mcap", Structure())
    finally:
        mcap_structure.held = original
    with pytest.raises(BadLog, match="/flight is missing"):
        read_log(tmp_path / "b.mcap")


def test_commands_read_it_as_the_log_of_the_flight(flown: Path, tmp_path: Path, rig_command: Any):
    write_again(LOGS / "flight_schema_6.mcap", tmp_path / "b.mcap", Structure(compression="lz4", declared="chunk"))
    for name, command in {
        "info": ("info", "--json"),
        "score": ("score", "--json"),
        "export": ("export", "--out", "x.csv"),
    }.items():
        said = []
        for log in (LOGS / "flight_schema_6.mcap", tmp_path / "b.mcap"):
            code, out, error = rig_command(command[0], str(log), *command[1:])
            said.append((code, error.replace(str(log), ""), Path("x.csv").read_bytes() if name == "export" else out))
        if name == "info":
            before, after = (json.loads(out) for _, _, out in said)
            for key in ("log", "bytes", "health"):
                del before[key], after[key]
            assert before == after
        elif name == "score":
            before, after = (json.loads(out) for _, _, out in said)
            assert {**before, "log": ""} == {**after, "log": ""}
        else:
            assert said[0] == said[1]


def test_servos_and_computers_come_back_too(tmp_path: Path):
    from test_verdict_actuators import HARDOVER, given

    log = fly(None, overrides=[*given((HARDOVER,), seconds=1.0), "computers.count=4"], out=tmp_path / "logs").log
    assert read_log(log).parts is not None
    write_again(log, tmp_path / "b.mcap", Structure(shuffled=True, declared="chunk", compression="lz4"))
    assert_equal(tmp_path / "b.mcap", log)


@pytest.mark.parametrize("name", ["no summary", "messages beside chunks", "channels renumbered", "lz4"])
def test_an_output_of_a_vote_is_read_in_another_structure_too(name: str, tmp_path: Path):
    write_again(LOGS / "vote_schema_2.mcap", tmp_path / "b.mcap", STRUCTURES[name])
    whole, found = (read(path, VoteConfig()) for path in (LOGS / "vote_schema_2.mcap", tmp_path / "b.mcap"))
    assert found.time_s.tolist() == whole.time_s.tolist()
    for signal, samples in whole.signals.items():
        for ours, theirs in zip(samples.channels, found.signals[signal].channels, strict=True):
            assert ours.tobytes() == theirs.tobytes()
