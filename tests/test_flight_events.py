import numpy as np
import pytest

from rig.core.frame import DISCRETE_INDEX, INDEX, DecidedBy, End, Law, Pattern, Source, State, new_block
from rig.flight.events import EventFinder
from rig.flight.loop import Rig, frames
from rig.flight.recorder import event_finder
from rig.scenario import scenario

Q = INDEX["pitch_rate"]


def blank(frames: int = 30):
    block = new_block(frames)
    block["level"] = 4
    block["valid"] = 1
    block["reference_usable"] = 1
    return block


def names(events):
    return [(event.frame, event.name) for event in events]


def test_a_flight_without_change_has_no_event():
    assert EventFinder([]).find(blank()) == []


def test_a_failed_channel_is_told_with_its_level_and_who_decided():
    block = blank()
    block["state"][12:, Q, 2] = State.FAILED
    block["level"][12:, Q] = 3
    block["decided_by"][12, Q] = DecidedBy.TREND
    found = EventFinder([]).find(block)
    assert names(found) == [(12, "channel failed"), (12, "level")]
    assert found[0].text == "pitch_rate.3 isolated by trend"
    assert found[1].text == "pitch_rate: 4 to 3 channels"


def test_faults_begin_and_end_in_their_frames():
    finder, block = EventFinder([*"abcdefghi", "offset pitch_rate.2"]), blank()
    block["acting"][5:20, 1] = 0b10
    found = [*finder.find(block[:10]), *finder.find(block[10:])]
    assert names(found) == [(5, "fault on"), (20, "fault off")]
    assert {event.text for event in found} == {"offset pitch_rate.2"}


def test_a_fault_from_the_first_frame_on_begins_there():
    block = blank()
    block["acting"][:, 0] = 1
    assert names(EventFinder(["drift"]).find(block)) == [(0, "fault on")]


def test_what_the_reader_must_know_is_an_error_or_warning():
    block = blank()
    block["pattern"][8:10, Q] = Pattern.P2_2
    block["level"][15:, Q] = 0
    block["law"][20:] = Law.STICK
    block["end"][29] = End.GROUND_CONTACT
    found = EventFinder([]).find(block)
    assert [(e.level, e.name) for e in found] == [
        ("warning", "split"),
        ("error", "signal lost"),
        ("info", "control law"),
        ("error", "flight ends"),
    ]
    assert found[0].text == "pitch_rate: 2:2" and found[3].text == "ground contact"


def test_a_suspicion_that_passes_is_no_event():
    block = blank()
    block["state"][5:7, Q, 1] = State.SUSPECT
    assert EventFinder([]).find(block) == []


def test_a_change_of_source_says_what_control_goes_on_with():
    block = blank()
    block["source"][5:, Q] = Source.REFERENCE
    block["source"][10:, Q] = Source.DEGRADED
    block["source"][20:, Q] = Source.VOTED
    found = EventFinder([]).find(block)
    assert [(e.frame, e.level, e.name) for e in found] == [
        (5, "warning", "source"),
        (10, "warning", "source"),
        (20, "info", "source"),
    ]
    assert [e.text.removeprefix("pitch_rate: the control law uses ") for e in found] == [
        "the reference",
        "the degraded mode",
        "the voted value",
    ]


def test_the_back_up_law_is_told_as_a_change_of_law():
    block = blank()
    block["law"][8:] = Law.BACKUP
    assert [(e.frame, e.text) for e in EventFinder([]).find(block)] == [(8, "autopilot to backup")]


def test_rows_that_have_not_moved_are_seen_at_a_glance(monkeypatch):
    """Whatever lies between and behind the fields: a copy of a row leaves it to chance."""
    finder, block = EventFinder([]), blank()
    finder.find(block)
    monkeypatch.setattr("rig.flight.events._changes", lambda old, new: pytest.fail("looked closer"))
    for _ in range(5):
        finder._last = np.frombuffer(bytes(range(256)) * 20, np.uint8)[: block.itemsize].copy().view(block.dtype)
        for name in block.dtype.names or ():
            finder._last[name] = block[name][-1]
        assert finder.find(block) == []


def test_what_is_failed_in_the_first_frame_has_its_events_there():
    """A monitor without persistence: the channel was not seen healthy before."""
    block, gear = blank(), DISCRETE_INDEX["gear_down"]
    block["state"][:, Q, 2] = block["discrete_state"][:, gear, 0] = State.FAILED
    block["level"][:, Q] = block["discrete_level"][:, gear] = 3
    block["pattern"][:4, Q] = Pattern.P1_1_1
    found = EventFinder([]).find(block)
    assert {event.frame for event in found} == {0}
    assert sorted(event.text for event in found) == [
        *("gear_down.1 isolated by comparison", "gear_down: 4 to 3 channels", "pitch_rate.3 isolated by comparison"),
        *("pitch_rate: 1:1:1", "pitch_rate: 4 to 3 channels"),
    ]


def test_the_first_frame_of_a_flight_may_fail_a_channel():
    which = scenario.load(None, ["duration_s=0.1", "redundancy.signals.pitch_rate.persistence=1", "faults.0.start_s=0"])
    rows = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    assert rows["state"][0, Q, 2] == State.FAILED
    assert "channel failed" in [event.name for event in event_finder(which).find(rows) if event.frame == 0]


def test_a_flight_that_is_over_in_its_first_frame_says_so():
    block = blank()[:1]
    block["end"] = End.GROUND_CONTACT
    assert [(e.frame, e.text) for e in EventFinder([]).find(block)] == [(0, "ground contact")]


def test_each_command_of_a_run_that_is_refused_is_told():
    """The bits stay set from frame 3 to 6, over the end of a block: nothing of the flags moves in between."""
    block = blank()
    block["reset"][3:7, Q] = 0b0100
    block["state"][:, Q, 2] = State.FAILED
    finder = EventFinder([])
    found = [*finder.find(block[:5]), *finder.find(block[5:])]
    assert [e.frame for e in found if e.name == "readmission refused"] == [3, 4, 5, 6]


def test_a_refused_readmission_is_told_in_its_frame():
    """Frame 15 asks for channels 2 and 3: 2 comes back, 3 stays out; frame 25 asks for 3 again, at a block's start."""
    block = blank()
    block["reset"][[15, 25], Q] = 0b0110, 0b0100
    block["state"][5:, Q, 2] = block["state"][5:15, Q, 1] = State.FAILED
    finder = EventFinder([])
    found = [*finder.find(block[:25]), *finder.find(block[25:])]
    assert [(e.frame, e.text) for e in found if e.name == "readmission refused"] == [
        (15, "pitch_rate.3: it has not agreed with the voted value for long enough"),
        (25, "pitch_rate.3: it has not agreed with the voted value for long enough"),
    ]
    assert [e.frame for e in found if e.name == "channel readmitted"] == [15]


def test_discretes_have_events_of_channels_levels_and_modes():
    block, d = blank(), DISCRETE_INDEX["gear_down"]
    block["discrete_level"][:, d] = 2
    block["discrete_state"][5:20, d, 0], block["discrete_level"][5:20, d] = State.FAILED, 1
    block["discrete_level"][10:15, d], block["discrete_voted"][10:15, d] = 0, 1
    block["discrete_voted"][25:, DISCRETE_INDEX["weight_on_wheels"]] = 1
    block["discrete_voted"][25:, DISCRETE_INDEX["autopilot_engaged"]] = 1  # the law's own event
    found = EventFinder([]).find(block)
    assert [(e.frame, e.level, e.name, e.text) for e in found] == [
        (5, "warning", "channel failed", "gear_down.1 isolated by comparison"),
        (5, "warning", "level", "gear_down: 2 to 1 channels"),
        (10, "error", "signal lost", "gear_down: no channel left, its fail-safe value 1 is used"),
        (10, "info", "mode", "gear_down: gear down mode"),
        (15, "warning", "level", "gear_down: 0 to 1 channels"),
        (15, "info", "mode", "gear_down: gear up mode"),
        (20, "info", "channel readmitted", "gear_down.1 readmitted"),
        (20, "warning", "level", "gear_down: 1 to 2 channels"),
        (25, "info", "mode", "weight_on_wheels: ground mode"),
    ]
