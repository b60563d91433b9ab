"""Conclusions against what follows from the rows of the log alone: tests/tools/conclusions_of_logs.py."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import conclusions_of_logs as tool
import pytest

from rig.flight import loop
from rig.flight.fly import fly
from rig.log import read_log
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

SHORT = ["duration_s=34"]  # of the law's fault at 30 s
Flown = dict[str, tuple[Any, Any, Any, Sequence[str]]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Scenario, rows, those of the fault-free flight and sentences, by name."""
    found: Flown = {}
    out = tmp_path_factory.mktemp("logs")
    for name, sets in (
        ("f16_pitch_sensor_ramp", [*SHORT, "redundancy.signals.pitch_angle.slow_tests=false"]),
        ("f16_stuck_together", []),
        ("history_blocked_pitot", []),
    ):
        flight = fly(name, out=out, overrides=sets)
        log, scored = read_log(flight.log), score_log(flight.log, Yardstick())
        baseline = loop.fly_rows(scored.scenario.model_copy(update={"faults": []}), log.frames)
        found[Path(name).name] = scored.scenario, log.rows, baseline, scored.conclusion
    return found


def test_no_sentence_contradicts_the_rows(flown: Flown):
    for name, parts in flown.items():
        assert tool.contradictions(*parts) == [], name
        assert "the flight without the faults" in parts[-1][-1], name


def test_the_law_is_told_to_have_detected_what_it_corrected(flown: Flown):
    *_, told = flown["f16_pitch_sensor_ramp"]
    assert "4 of 4 faults detected, no healthy channel isolated" in told[0]
    assert told[1].startswith("pitch angle, channels 1, 2, 3 and 4: scale error")
    assert "detected after 860 ms by the fault-tolerant law" in told[1]
    assert "estimate of the pitch angle from 30.86 s on" in told[1]


def test_all_faulty_channels_are_named_beside_a_healthy_one_that_was_isolated(flown: Flown):
    *_, told = flown["history_blocked_pitot"]
    (healthy,) = (line for line in told if ": healthy, isolated by mistake " in line)
    assert healthy == told[1] and healthy.endswith("(faulty: 1, 2, 3)")


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("f16_pitch_sensor_ramp", "detected after 860 ms by the fault-tolerant law", "not isolated"),
        ("f16_pitch_sensor_ramp", "from 30.86 s on", "from 31.86 s on"),
        ("f16_pitch_sensor_ramp", "4 of 4 faults", "0 of 4 faults"),
        ("history_blocked_pitot", "mistake at 13.90 s", "mistake at 14.65 s"),
        ("history_blocked_pitot", "by the slow-fault test of means", "by the trend"),
        ("history_blocked_pitot", "1 healthy channel isolated", "no healthy channel isolated"),
        ("f16_stuck_together", "isolated after", "not isolated, although"),
        ("f16_stuck_together", "load factor within 0", "load factor within 1"),
        ("f16_stuck_together", "load factor within", "load factor about"),
    ],
)
def test_a_sentence_that_is_wrong_is_contradicted(flown: Flown, name: str, before: str, after: str):
    """The check can fail: each change of the sentences is seen."""
    scenario, rows, baseline, told = flown[name]
    changed = [line.replace(before, after) for line in told]
    assert changed != [*told] and tool.contradictions(scenario, rows, baseline, changed)
