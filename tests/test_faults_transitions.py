"""Faults triggered by a change of what is decided: pattern, decided_by, source, state of a channel."""

from typing import get_args

import pytest
from faulted import PARSE, acts, faulted, healthy
from pydantic import ValidationError

from rig.core.frame import INDEX, DecidedBy, Pattern, Source, State
from rig.world.faults.trigger import Transition

P, Q = INDEX["roll_rate"], INDEX["pitch_rate"]
BACK = {"pattern": "normal", "decided_by": "none", "source": "voted", "state": "ok"}


def offset(**keys):
    return {"kind": "offset", "offset": 0.1, "signal": "pitch_rate", "channels": [2], **keys}


@pytest.mark.parametrize(
    ("keys", "field", "channel", "value"),
    [
        ({"pattern": "2:2"}, "pattern", (), Pattern.P2_2),
        ({"pattern": "1:1:1:1"}, "pattern", (), Pattern.P1_1_1_1),
        ({"decided_by": "trend"}, "decided_by", (), DecidedBy.TREND),
        ({"decided_by": "unresolved"}, "decided_by", (), DecidedBy.UNRESOLVED),
        ({"source": "reference"}, "source", (), Source.REFERENCE),
        ({"channel": 2, "state": "suspect"}, "state", (1,), State.SUSPECT),
        ({"channel": 4, "state": "failed"}, "state", (3,), State.FAILED),
    ],
)
def test_a_fault_comes_in_the_frame_after_a_decision_changes_and_in_no_other(keys, field, channel, value):
    on = {"signal": "roll_rate", **keys}
    block, elsewhere = healthy(), healthy()
    block[field][(slice(25, 40), P, *channel)] = value
    elsewhere[field][(slice(25, 40), Q, *channel)] = value
    assert acts(faulted(offset(on=on), block=block.copy()))[0] == 26
    assert acts(faulted(offset(on=on, start_s=0.27), block=block.copy())) == []  # armed when it has stood for a frame
    assert acts(faulted(offset(on=on), block=elsewhere)) == []
    assert acts(faulted(offset(on={**on, field: BACK[field]}), block=block.copy()))[0] == 41


def test_the_words_of_a_transition_are_those_of_the_frame():
    words = {key: get_args(get_args(info.annotation)[0]) for key, info in Transition.model_fields.items()}
    assert words["pattern"] == tuple(pattern.label for pattern in Pattern)
    assert words["decided_by"] == tuple(decided_by.name.lower() for decided_by in DecidedBy)
    assert words["source"] == tuple(source.name.lower() for source in Source)
    assert words["state"] == tuple(state.name.lower() for state in State if state != State.ABSENT)


@pytest.mark.parametrize(
    ("on", "says"),
    [
        ({}, "must be { autopilot = "),
        ({"level": 3}, "must be { autopilot = "),
        ({"autopilot": "engaged", "level": 3}, "must be { autopilot = "),
        ({"autopilot": "engaged", "channel": 3}, "must be { autopilot = "),
        ({"autopilot": "engaged", "signal": "heading", "level": 3}, "autopilot: not allowed with signal"),
        ({"signal": "heading"}, "must be { signal = ..., level or pattern"),
        ({"signal": "heading", "level": 3, "pattern": "2:2"}, "must be { signal = ..., level or pattern"),
        ({"signal": "haeding", "level": 3}, "unknown signal 'haeding', nearest: heading"),
        ({"signal": "heading", "state": "failed"}, "channel and state: give both or none"),
        ({"signal": "heading", "level": 3, "channel": 2}, "channel and state: give both or none"),
        ({"signal": "heading", "pattern": "3:1"}, "Input should be 'normal', 'isolated', '2:2'"),
        ({"signal": "heading", "channel": 5, "state": "failed"}, "less than or equal to 4"),
    ],
)
def test_a_transition_without_a_meaning_is_refused(on, says):
    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python(offset(on=on))
