"""Logs of schema 2, flown and voted before the frame had parts, are read, replayed, scored, shown and exported.

tests/logs/flight_schema_2.mcap: the default scenario, seed 3, 0.6 s, the hardover at 0.2 s, flown by version 0.1.0;
vote_schema_2.mcap: its pitch rate through ``rig vote`` of that version, threshold 0.05.
flight_schema_4.mcap: the same flight for 0.4 s, by the last version that wrote a chunk frame by frame;
flight_schema_5.mcap: the default scenario, seed 3, 0.4 s, by the last version without the tie-break rules lane and
given_up; flight_schema_7.mcap: the same, by the last version without the rules of the slow-fault tests.
"""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from rig.bench.replay.before_after import rules_gone
from rig.bench.replay.vote_again import vote_again
from rig.cli import main as cli
from rig.core import renamed
from rig.core.errors import BadLog
from rig.core.frame import DISCRETES, INDEX, SIGNALS, Ilm, State, Trust, UnitStatus
from rig.log import read_log, recover, schema
from rig.log.columns import COLUMNS
from rig.log.recordings.flown_log import recorded
from rig.log.recordings.own_logs import read_ours

LOGS = Path(__file__).parent / "logs"
ROWWISE = LOGS / "flight_schema_4.mcap"
FLOWN, VOTED = LOGS / "flight_schema_2.mcap", LOGS / "vote_schema_2.mcap"
NEW = {"second_reference", "common_mode", "reset", "unit", "unit_age"}  # names in messages that schema 2 lacks
FORCES = {f"specific_force_{axis}_m_s2" for axis in ("forward", "right", "down")}


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    monkeypatch.chdir(tmp_path)

    def command(*arguments: Any) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["rig", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out, said.err

    return command


def told() -> dict[str, dict[int, Any]]:
    """Every message of the log by topic and frame, as mcap's own decoder reads it."""
    found: dict[str, dict[int, Any]] = {}
    with FLOWN.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found.setdefault(channel.topic, {})[message.sequence] = decoded
    return found


def test_every_number_is_the_one_that_any_reader_finds():
    rows, messages, compared = read_log(FLOWN).rows, told(), 0
    for column in COLUMNS:
        topic = next(topic for topic in messages if renamed.TOPICS.get(topic, topic).endswith(f"/{column.owner}"))
        values = column.of(rows)
        names = {renamed.field_now(name): name for name in messages[topic][0].DESCRIPTOR.fields_by_name}
        if column.name in names:
            theirs = [getattr(messages[topic][k], names[column.name]) for k in range(len(rows))]
            assert np.array_equal(values, theirs, equal_nan=True), column.path
            compared += 1
    assert compared == sum(len(message.DESCRIPTOR.fields) for topic, message in first(messages).items())


def first(messages: dict[str, dict[int, Any]]) -> dict[str, Any]:
    """One message of each topic of ours, but of the timing, which is no column."""
    named = {topic: frames[0] for topic, frames in messages.items() if frames and 0 in frames}
    return {t: m for t, m in named.items() if m.DESCRIPTOR.full_name.startswith("rig.") and t != "/timing"}


def test_what_it_does_not_say_is_no_number_and_a_discrete_without_a_monitor():
    log = read_log(FLOWN)
    rows = log.rows
    assert np.isnan(rows["second_reference"]).all() and np.isnan(rows["inertial"][:, 6:]).all()
    assert np.isnan(rows["flight"][:, -3:]).all() and np.isfinite(rows["flight"][:, :-3]).all()
    assert (rows["discrete_valid"] == 1).all() and (rows["discrete_ilm"] == Ilm.ABSENT).all()
    assert not rows["reset"].any() and (rows["unit"] == UnitStatus.NONE).all() and not rows["common_mode"].any()
    assert (log.timing["reply_us"] == 0).all() and (log.timing["frame_us"] > 0).all()


def test_it_is_replayed_to_the_same_votes():
    recording = recorded(FLOWN)
    rows = read_log(FLOWN).rows
    again = vote_again(rows, recording.scenario)
    for name in ("voted", "state", "level", "pattern", "decided_by", "trend_high", "source", "discrete_voted"):
        assert np.array_equal(again[name], rows[name]), name
    assert again["state"][-1, INDEX["pitch_rate"], 2] == State.FAILED


def test_the_commands_work_on_it(run: Any, tmp_path: Path):
    log = Path(shutil.copy(FLOWN, tmp_path))
    code, out, _ = run("info", log)
    assert code == 0 and "schema 2" in out and "whole, every checksum matches" in out
    code, out, _ = run("replay", log)
    assert code in (0, 1) and "10 different" in out  # references that version did not have, or had otherwise
    code, out, _ = run("score", log)
    assert code == 0 and "detected" in out
    assert run("report", log)[0] == 0 and "schema 2 (this rig writes 8)" in log.with_suffix(".html").read_text()
    assert run("export", log, "--to", "npz")[0] == 0
    assert run("view", log, "--save", tmp_path / "a.rrd")[0] == 0 and (tmp_path / "a.rrd").stat().st_size > 10_000
    assert run("replay", log, "--set", "redundancy.signals.pitch_rate.persistence=4")[0] in (0, 1)


def test_a_cut_one_is_said_to_be_mended_by_its_own_version(tmp_path: Path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(FLOWN.read_bytes()[:-100])
    with pytest.raises(BadLog, match="schema version 2; rig recover repairs logs from version 4 on"):
        recover(cut, tmp_path / "mended.mcap")
    assert not (tmp_path / "mended.mcap").exists()


def test_a_log_frame_by_frame_is_read_replayed_and_counted(run: Any, tmp_path: Path):
    log = Path(shutil.copy(ROWWISE, tmp_path))
    rows = read_log(log).rows
    assert rows["frame"].tolist() == list(range(40)) and rows["state"][-1, INDEX["pitch_rate"], 2] == State.FAILED
    with log.open("rb") as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages("/signal/pitch_rate")
        assert [message.voted for _, _, _, message in decoded] == rows["voted"][:, INDEX["pitch_rate"]].tolist()
    code, out, _ = run("replay", log)
    assert code == 1 and "no decision and no vote changed" in out  # references take the jump of a vote by now
    code, out, _ = run("info", log, "--json")
    topics = json.loads(out)["topics"]
    assert code == 0 and topics["/flight"] == topics["/pose"] == 40


@pytest.mark.parametrize("version", [5, 7])
def test_a_log_topic_by_topic_of_an_older_version_is_read_and_replayed(run: Any, tmp_path: Path, version: int):
    log = Path(shutil.copy(LOGS / f"flight_schema_{version}.mcap", tmp_path))
    rows = read_log(log).rows
    assert rows["frame"].tolist() == list(range(40)) and np.isfinite(rows["voted"]).all()
    assert run("score", log)[0] == 0
    code, out, _ = run("replay", log)
    assert code == 0 and out.count("which this version does not have") == 1
    assert (
        "the log was flown with isolation thresholds, which this version does not have: decisions can differ\n" in out
    )
    code, out, _ = run("replay", log, "--set", "redundancy.signals.pitch_rate.persistence=4")
    assert code == 0 and "the log was flown with isolation thresholds, which" in out
    code, out, _ = run("replay", log, "--json")
    assert any("flown with isolation thresholds" in note for note in json.loads(out)["notes"])


@pytest.mark.parametrize(
    ("manager", "signal", "says"),
    [
        ("cross-channel", {"outlier_threshold": 0.01}, "isolation thresholds, which"),
        ("cross-channel", {"outlier_threshold_triplex": 0.01}, "isolation thresholds, which"),
        ("cross-channel", {"outlier_threshold": None, "bias_bound": 0.1, "bias_s": 1.0}, "channel equalisation, which"),
        (
            *("mine:Class", {"outlier_threshold": 0.01, "equalise_bound": 0.1}),
            "isolation thresholds and channel equalisation, which",
        ),
        ("cross-channel", {"outlier_threshold": None, "equalise_bound": 0.0, "equalise_s": 10.0}, None),
        ("mean", {"outlier_threshold": 0.01}, None),
        ("cross-channel", {"threshold": 1.0}, None),
    ],
)
def test_rules_that_are_gone_are_told_where_they_were_on(manager: str, signal: dict[str, Any], says: str | None):
    metadata = {"scenario": json.dumps({"redundancy": {"manager": manager, "signals": {"heading": signal}}})}
    notes = rules_gone(metadata)
    assert [f"the log was flown with {says}" in note for note in notes] == ([] if says is None else [True])


def test_a_cut_log_frame_by_frame_is_mended(tmp_path: Path):
    (tmp_path / "cut.mcap").write_bytes(ROWWISE.read_bytes()[:-100])
    assert recover(tmp_path / "cut.mcap", tmp_path / "mended.mcap").frames == 40
    assert read_log(tmp_path / "mended.mcap").rows.tobytes() == read_log(ROWWISE).rows.tobytes()
    with (tmp_path / "mended.mcap").open("rb") as file:
        poses = list(make_reader(file, validate_crcs=True).iter_messages("/pose"))
    assert [message.sequence for _, _, message in poses] == list(range(40))


def test_what_rig_vote_wrote_is_voted_again():
    recording = read_ours(VOTED)
    assert list(recording.signals) == ["pitch_rate"] and len(recording.time_s) == 60
    rows = read_log(FLOWN).rows
    for c, samples in enumerate(recording.signals["pitch_rate"].channels):
        assert np.array_equal(samples, rows["channels"][:, INDEX["pitch_rate"], c])


CONTROL = schema.MESSAGES["rig.Control"]


def described(name: str = "rig.Control") -> FileDescriptorSet:
    return FileDescriptorSet.FromString(schema.descriptors(name).SerializeToString())


def test_an_older_message_may_lack_fields_and_members_but_not_differ():
    whole = described()
    del whole.file[0].message_type[0].field[-2:]  # unit, unit_age
    names = [field.name for field in schema.older(whole, CONTROL) or ()]
    assert names == [field.name for field in schema.MESSAGES["rig.Control"]][:-2]
    enums = next(e for e in whole.file[0].message_type[0].nested_type if e.name == "Trust").enum_type[0]
    del enums.value[-1]
    assert schema.older(whole, CONTROL) is not None
    enums.value[-1].number = Trust.WITHDRAWN + 5
    assert schema.older(whole, CONTROL) is None


@pytest.mark.parametrize(("attribute", "value"), [("name", "other"), ("number", 40), ("type", schema.DOUBLE + 4)])
def test_an_older_field_of_another_name_number_or_type_is_not_read(attribute: str, value: Any):
    whole = described("rig.AutopilotCommand")
    setattr(whole.file[0].message_type[0].field[1], attribute, value)
    assert schema.older(whole, schema.MESSAGES["rig.AutopilotCommand"]) is None


def test_old_fields_keep_their_numbers():
    """A viewer's layout and a mapping by number go on working: what is new is last."""
    with FLOWN.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    for record in summary.schemas.values():
        if record.name in schema.MESSAGES:
            (message,) = FileDescriptorSet.FromString(record.data).file[0].message_type
            ours = [field.name for field in schema.MESSAGES[record.name]]
            assert ours[: len(message.field)] == [renamed.field_now(field.name) for field in message.field]
            assert set(ours[len(message.field) :]) <= NEW | FORCES | {"reply_us"} | {
                f"{stem}_{c}" for stem in ("valid", "ilm") for c in range(1, 5)
            }
    assert {topic.name for topic in schema.TOPICS} >= {s.topic for s in (*SIGNALS, *DISCRETES)}
