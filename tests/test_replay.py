"""A recorded flight says the same again; what does not, is named: decision, channel, frame, old and new."""

import json
from pathlib import Path

import numpy as np
import pytest

from rig.bench.replay.decisions import Moved, decisions
from rig.bench.replay.verify import verify
from rig.bench.replay.vote_again import vote_again
from rig.bench.replay.what_if import changed, what_if
from rig.core.errors import BadInput, BadLog
from rig.core.files import bundled
from rig.core.frame import FLAT, INDEX, TIMING, State, Table, new_block
from rig.flight.fly import fly
from rig.flight.summary import Verdict
from rig.log import read_log
from rig.log.columns import COLUMNS
from rig.log.of_flight import metadata
from rig.log.recordings.flown_log import recorded
from rig.log.writer import LogWriter
from rig.scenario import scenario
from rig.studies.campaign.flying import fly as fly_in_memory
from rig.studies.campaign.flying import write_log
from rig.verdict.scoring import score
from rig.verdict.unfaulted import MeasuredAgain
from rig.world.faults import Execution

Q = INDEX["pitch_rate"]
SHORT = ["duration_s=3", "faults.0.start_s=1"]
EACH_KIND = (  # one of each part of the rig that a fault or a setting reaches
    *("f16_pitch_rate_hardover", "f16_reference_drift", "f16_split_2_2_ilm", "f16_pitch_sensor_recovers"),
    *("f16_second_fault_at_worst_moment", "f16_lost_pitch_rate_backup", "f16_weight_on_wheels_wrong", "f16_adc"),
    *("f16_computer_stop", "f16_link_corrupt", "f16_elevator_coil_hardover", "f16_hydraulic_loss"),
    *("f16_stick_roll_cross_talk", "f16_data_sheet_gyros", "f16_pitch_rate_frame_skew", "b747_civil_air_data"),
    *("b747_elevator_oscillatory_failure", "b747_engagement_toggling", "b737_pitot_icing"),
    *("b737_wind_shear_healthy", "b707_pitch_angle_hardover", "history_xl888t"),
)
OTHERS = sorted({path.stem for path in bundled("faults").glob("*.toml")} - set(EACH_KIND))
SCENARIOS = [*EACH_KIND, *(pytest.param(name, marks=pytest.mark.long) for name in OTHERS)]


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    """Three seconds of the default scenario, its hardover after one."""
    return fly(overrides=SHORT, out=tmp_path_factory.mktemp("logs")).log


def rewrite(source: Path, target: Path, rows=None, changes=None) -> Path:
    """A log with other rows or other metadata."""
    log = read_log(source)
    with LogWriter(target, log.rate_hz, {**log.metadata, **(changes or {})}, log.attachments.items()) as writer:
        kept = log.rows if rows is None else rows
        writer.write(Table(kept, timing=log.timing[: len(kept)]))
    return target


def test_a_log_replays_to_the_bit(flown):
    found = verify(recorded(flown)).comparison
    assert found.identical and found.frames == 300
    signals, discretes = 16 * (14 + 1), 3 * (4 + 2)  # numbers that the stage writes of each, and the source
    assert len(found.fields) == signals + discretes + 8  # and who acted, 64 bits


def test_a_log_flown_again_is_the_same_flight_in_every_field(flown):
    found = verify(recorded(flown), fly=True).comparison
    assert found.identical and len(found.fields) == len(COLUMNS)


def long_enough_s(which: scenario.Scenario) -> float:
    """Five seconds after the first fault began, one after the last; all where one waits for something to happen."""
    starts = [fault.start_s for fault in which.faults] or [1.0]
    known = [start for start in starts if start is not None]
    seconds = max(11.0, min(known, default=0.0) + 5.0, max(known, default=0.0) + 1.0)
    return min(which.duration_s, seconds) if len(known) == len(starts) else which.duration_s


def left_by(events) -> set[str]:
    """The channels that are failed when all events have happened."""
    failed = set()
    for event in events:
        if event.name == "channel failed":
            failed.add(event.text.split()[0])
        elif event.name == "channel readmitted":
            failed.discard(event.text.split()[0])
    return failed


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_bundled_scenario_replays_flies_again_and_is_scored(name, tmp_path):
    """``make replay`` flies all of them to their ends."""
    which = scenario.load(name)
    flown = fly_in_memory(which.model_copy(update={"duration_s": long_enough_s(which)}))
    write_log(flown, tmp_path / "flight.mcap")
    recording = recorded(tmp_path / "flight.mcap")
    events, failed = recording.log.events, flown.verdict.failed
    assert events or not which.faults
    assert left_by(events) == {f"{signal}.{c}" for signal, channels in failed.items() for c in channels}
    for again in (False, True):
        found = verify(recording, again)
        assert found.comparison.identical, found.decisions.moved[:5]
    scored_by_the_clean_channels_that_the_flight_kept(flown.scenario, flown.table)


def scored_by_the_clean_channels_that_the_flight_kept(which: scenario.Scenario, table: Table) -> None:
    """Two ways to the same: a campaign keeps what the sensors said, a log's score runs the sensors again."""
    again = np.concatenate([part.clean.copy() for part in MeasuredAgain(which).of(Table(table.rows, table.beside))])
    for field in ("channels", "valid"):
        np.testing.assert_array_equal(table.clean[field], again[field])
    corrupted = any((table[field] != again[field]).any() for field in ("channels", "valid"))
    assert corrupted or not any(f.signal in INDEX and f.start_s is not None for f in which.faults)
    found = score(which, Table(table.rows, table.beside))
    assert found == score(which, Table(table.rows, table.beside, clean=table.clean))
    acted = [any(f.outcome != "not executed" for f in found.faults if f.index == i) for i in range(len(which.faults))]
    execution = Execution(which.faults)
    execution.add(table.rows)
    assert acted == execution.executed
    assert {fault.index for fault in found.faults} == set(range(len(which.faults)))
    json.dumps(found.as_dict(), allow_nan=False)


def test_a_replay_reads_no_truth(flown):
    rows = read_log(flown).rows
    blind = rows.copy()
    for name in ("truth", "discrete_truth", "flight", "autopilot_command", "command", "surface"):
        blind[name] = 77
    again = vote_again(blind, recorded(flown).scenario)
    assert again["voted"].tobytes() == rows["voted"].tobytes()
    assert again["state"].tobytes() == rows["state"].tobytes()


def test_a_reference_goes_wrong_again_in_a_replay(tmp_path):
    """The fault sits between the reference and its use; the log holds the faulted one alone."""
    recording = recorded(fly("f16_reference_drift", overrides=["duration_s=11"], out=tmp_path).log)
    assert verify(recording).comparison.identical
    sound = recording.scenario.model_copy(update={"faults": recording.scenario.faults[1:]})
    rows = read_log(recording.path).rows
    without = vote_again(rows, sound)
    off = np.abs(rows["reference"][:, Q] - without["reference"][:, Q])
    assert np.nanmax(off[:300]) == 0.0 and off[700] == pytest.approx(0.2 * (1 - np.exp(-4.0)), abs=1e-3)


def test_in_a_what_if_faults_on_references_act_as_they_did(tmp_path):
    """Their triggers are told the recorded votes: a fault that waits for a level acts although it is not reached."""
    faults = (
        "faults=[{kind='hardover', signal='pitch_rate', channels=[3], start_s=1.0},"
        "{kind='offset', signal='reference.roll_rate', offset=0.3, on={signal='pitch_rate', level=3}}]"
    )
    recording = recorded(fly(overrides=["duration_s=3", faults], out=tmp_path).log)
    patient = changed(recording, None, ["redundancy.signals.pitch_rate.persistence=1000"])
    rows = read_log(recording.path).rows
    other = vote_again(rows, patient)
    assert rows["level"][-1, Q] == 3 and other["level"][-1, Q] == 4
    assert other["acting"].tobytes() == rows["acting"].tobytes() and rows["acting"][-1, 0] == 3


def test_a_replay_takes_nothing_over_from_what_was_voted(flown):
    rows = read_log(flown).rows
    again = vote_again(_blank(rows), recorded(flown).scenario)
    assert again.tobytes() == vote_again(rows, recorded(flown).scenario).tobytes()


def _blank(rows):
    blank = rows.copy()
    blank["voted"], blank["state"], blank["level"], blank["reference"] = 5.0, 1, 2, -3.0
    return blank


def test_a_vote_that_is_not_what_the_code_says_is_named_with_its_frame(flown, tmp_path, rig_command):
    rows = read_log(flown).rows
    rows["voted"][150, Q] = np.nextafter(rows["voted"][150, Q], 1.0)
    log = rewrite(flown, tmp_path / "a.mcap", rows)
    code, out, _ = rig_command("replay", log, "--json")
    found = json.loads(out)
    assert code == 1 and found["identical"] is False
    (field,) = found["fields"]
    assert (field["name"], field["frames"], field["first_frame"]) == ("pitch_rate.voted", 1, 150)


def test_a_manager_of_the_users_own_is_replayed(tmp_path, monkeypatch):
    (tmp_path / "third_manager.py").write_text(
        "import numpy as np\n"
        "class Third:\n"
        "    def __init__(self, params): self.last = 0.0\n"
        "    def step(self, bus, fcc, k):\n"
        "        fcc[k]['voted'][:] = bus[k]['channels'][:, 2]\n"
        "        fcc[k]['level'][:] = 1\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    sets = ["duration_s=1", "faults=[]", "redundancy.manager=third_manager:Third"]
    assert verify(recorded(fly(overrides=sets, out=tmp_path).log, allow_code=True)).comparison.identical


def test_identical_is_exit_code_0(flown, rig_command):
    code, out, _ = rig_command("replay", flown)
    assert code == 0 and "identical" in out


def test_a_log_without_a_scenario_or_with_missing_frames_is_refused(flown, tmp_path):
    with pytest.raises(BadLog, match="no scenario in its metadata"):
        recorded(rewrite(flown, tmp_path / "a.mcap", changes={"scenario": ""}))
    with pytest.raises(BadLog, match="scenario in its metadata is damaged"):
        recorded(rewrite(flown, tmp_path / "a.mcap", changes={"scenario": "{"}))
    with pytest.raises(BadInput, match=r"a\.mcap: its scenario: sede: unknown key"):
        other = json.dumps({**recorded(flown).scenario.resolved(), "sede": 3})
        recorded(rewrite(flown, tmp_path / "a.mcap", changes={"scenario": other}))
    with pytest.raises(BadInput, match="frames are missing"):
        recorded(rewrite(flown, tmp_path / "a.mcap", read_log(flown).rows[100:]))
    with pytest.raises(BadInput, match="no frames"):
        recorded(rewrite(flown, tmp_path / "a.mcap", read_log(flown).rows[:0]))


def drifting(tmp_path: Path) -> Path:
    """A recording made by hand: channel 3 of the pitch rate leaves the others by 0.001 rad/s a frame from frame 200.

    The others stand at -0.004, 0 and 0.004 rad/s; threshold 0.0505 rad/s, persistence 8 frames; no reference, no test.
    """
    none = [f"redundancy.references.{s}=none" for s in _REFERRED]
    sets = [*none, "redundancy.signals.pitch_rate.threshold=0.0505", "redundancy.signals.pitch_rate.persistence=8"]
    sets += ["redundancy.signals.pitch_rate.stale_frames=0"]  # samples made by hand repeat
    sets += ["redundancy.signals.pitch_rate.slow_tests=false"]
    which = scenario.load(None, ["duration_s=4", "faults=[]", *sets])
    rows = new_block(400)
    rows["valid"], rows["ilm"] = 1, 2
    rows["channels"][:, INDEX["static_pressure"]] = 50_000.0
    rows["channels"][:, Q] = -0.004, 0.0, 0.0, 0.004
    rows["channels"][:, Q, 2] = 0.001 * np.maximum(np.arange(400) - 200, 0)
    path = tmp_path / "drift.mcap"
    with LogWriter(path, 100.0, metadata(which)) as writer:
        writer.write(Table(vote_again(rows, which), timing=np.zeros(400, TIMING)))
    return path


_REFERRED = (
    *("pitch_rate", "roll_rate", "yaw_rate", "normal_load_factor"),
    *("angle_of_attack", "angle_of_sideslip", "dynamic_pressure"),
)


def test_a_threshold_halved_moves_the_decisions_that_a_hand_calculation_says(tmp_path):
    """Channel 3 is alone once 0.001 (k - 200) - 0.004 is beyond the threshold.

    0.0505:  k - 200 > 54.5, frame 255; failed with the eighth such frame, 262
    0.02525: k - 200 > 29.25, frame 230; failed in 237
    The vote is (0 + 0.004) / 2 of four channels, 0 of three, from the frame after the failure: 238 instead of 263.
    """
    recording = recorded(drifting(tmp_path))
    answer = what_if(recording, changed(recording, None, ["redundancy.signals.pitch_rate.threshold=0.02525"]))
    assert {(m.decision, m.channel, m.first_frame, m.last_frame, m.old, m.new) for m in answer.moved.moved} == {
        ("state", 3, 230, 236, "ok", "suspect"),
        ("state", 3, 237, 254, "ok", "failed"),
        ("state", 3, 255, 261, "suspect", "failed"),
        ("level", None, 237, 261, "4", "3"),
        ("pattern", None, 230, 237, "normal", "isolated"),
        ("pattern", None, 255, 262, "isolated", "normal"),
    }
    assert {m.signal for m in answer.moved.moved} == {"pitch_rate"}
    (failure,) = answer.moved.failures
    assert (failure.signal, failure.channel, failure.old_frame, failure.new_frame) == ("pitch_rate", 3, 262, 237)
    (vote,) = answer.moved.votes
    assert (vote.signal, vote.frames, vote.first_frame) == ("pitch_rate", 25, 238)
    assert vote.largest == pytest.approx(0.002, abs=1e-15)


def test_a_what_if_is_a_log_of_its_own_that_replays(flown, tmp_path):
    recording = recorded(flown)
    changes = ["redundancy.signals.pitch_rate.persistence=4"]
    answer = what_if(recording, changed(recording, None, changes), tmp_path / "b.mcap", changes)
    log, old = read_log(answer.path), read_log(flown)
    assert log.rows.tobytes() == vote_again(old.rows, answer.scenario).tobytes()
    for name in ("truth", "channels", "flight", "surface", "acting"):
        assert log.rows[name].tobytes() == old.rows[name].tobytes()
    assert [e.frame for e in log.events if e.name == "channel failed"] == [103]
    assert [e.frame for e in recording.log.events if e.name == "channel failed"] == [107]
    verdict = Verdict()
    verdict.add(Table(log.rows), ())
    assert log.result and log.result["digest"] == verdict.digest != (recording.log.result or {})["digest"]
    assert log.attachments == recording.log.attachments
    again = recorded(answer.path)
    assert again.what_if == changes[0] and verify(again).comparison.identical
    with pytest.raises(BadInput, match="never flown"):
        verify(again, fly=True)


def test_a_what_if_is_written_beside_the_recording_and_never_over_another(flown, tmp_path):
    log = rewrite(flown, tmp_path / "a.mcap")
    recording = recorded(log)
    made = [what_if(recording, recording.scenario).path.name for _ in range(2)]
    assert made == ["a.what-if.mcap", "a.what-if_2.mcap"]
    assert not list(tmp_path.glob(".*.part"))


def test_the_same_settings_move_nothing(flown, tmp_path):
    recording = recorded(flown)
    answer = what_if(recording, recording.scenario, tmp_path / "a.mcap")
    assert (answer.moved.moved, answer.moved.failures, answer.moved.votes) == ([], [], [])
    assert read_log(answer.path).rows.tobytes() == read_log(flown).rows.tobytes()


def test_another_manager_is_a_what_if(flown, tmp_path):
    recording = recorded(flown)
    answer = what_if(recording, changed(recording, None, ["redundancy.manager=mean"]), tmp_path / "a.mcap")
    votes = {vote.signal: vote for vote in answer.moved.votes}
    high = 1.5  # rad/s, where the hardover stands; a quarter of it is in the mean
    assert votes["pitch_rate"].largest == pytest.approx(high / 4, abs=0.01)


@pytest.mark.parametrize("text", ["[redundancy]\nmanager = 'median'\n", "manager = 'median'\n"])
def test_a_file_may_have_the_table_or_its_keys(flown, tmp_path, text):
    file = tmp_path / "median.toml"
    file.write_text(text)
    which = changed(recorded(flown), file, ["redundancy.discrete_persistence=5"])
    assert (which.redundancy.manager, which.redundancy.discrete_persistence) == ("median", 5)


@pytest.mark.parametrize(
    ("text", "sets", "says"),
    [
        ("", ["seed=3"], "--set seed=3: only redundancy"),
        ("", ["redundancy.manger=mean"], "redundancy.manger: unknown key"),
        ("[redundancy]\n[control]\n", [], "control: only"),
        ("thresholds = 3", [], "redundancy.thresholds: unknown key"),
        ("manager = ", [], "not valid TOML"),
    ],
)
def test_a_what_if_that_cannot_be_is_refused_by_name(flown, tmp_path, text, sets, says):
    file = tmp_path / "other.toml"
    file.write_text(text)
    with pytest.raises(BadInput, match=says) as caught:
        changed(recorded(flown), file, sets)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--fly", "--set", "redundancy.manager=mean"),
        ("--out", "b.mcap"),
        ("--set", "seed=2"),
        ("--redundancy", "no.toml"),
    ],
)
def test_bad_combinations_are_one_line_exit_code_2(flown, tmp_path, arguments, rig_command):
    code, out, err = rig_command("replay", flown, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith("error: ")
    assert list(tmp_path.iterdir()) == []


def test_the_command_says_what_moved(flown, tmp_path, rig_command):
    out = tmp_path / "b.mcap"
    sets = ["--set", "redundancy.signals.pitch_rate.persistence=4"]
    code, text, _ = rig_command("replay", flown, *sets, "--out", out)
    assert code == 0 and "open loop" in text and "1.07 s (frame 107)" in text and "1.03 s (frame 103)" in text
    code, text, _ = rig_command("replay", flown, *sets, "--out", out, "--json")
    found = json.loads(text)
    assert found["open_loop"] and found["what_if"] == str(out)
    assert {key: found["moved"][1][key] for key in ("decision", "signal", "channel", "first_frame", "last_frame")} == {
        "decision": "level",
        "signal": "pitch_rate",
        "channel": None,
        "first_frame": 103,
        "last_frame": 106,
    }


def test_decisions_that_move_are_joined_over_frames_in_a_row():
    old, new = new_block(10), new_block(10)
    new["state"][3:6, Q, 1] = State.SUSPECT
    new["state"][6, Q, 1] = State.FAILED
    new["state"][8, Q, 1] = State.FAILED
    assert decisions(Table(old), Table(new)).moved == [
        Moved("state", "pitch_rate", 2, 3, 5, "ok", "suspect"),
        Moved("state", "pitch_rate", 2, 6, 6, "ok", "failed"),
        Moved("state", "pitch_rate", 2, 8, 8, "ok", "failed"),
    ]


def test_every_decision_can_move():
    """Each u1 field of the frame that the manager or the control law decides, one by one."""
    decided = {"state", "level", "pattern", "decided_by", "reference_usable", "source"}
    decided |= {"discrete_state", "discrete_level", "discrete_voted"}
    for name in decided:
        old, new = new_block(2), new_block(2)
        new[name][1].flat[-1] = 1
        (entry,) = decisions(Table(old), Table(new)).moved
        assert entry.decision == name.removeprefix("discrete_") and entry.first_frame == 1
    assert FLAT.names and decided <= set(FLAT.names)
