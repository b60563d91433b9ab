"""Right, wrong, missed, prior and none, with their delays, as the definitions say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.bench.inject import inject
from rig.bench.injection_score import Scored, score
from rig.bench.vote_rows import Result, vote
from rig.log.recordings.align import Correction
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import VoteConfig

N = 600
SETTINGS = {"threshold": 1.0, "persistence": 8, "split_persistence": 10}


def flat() -> list[Any]:
    return [np.zeros(N) for _ in range(4)]


def recording(samples: list[Any]) -> Recording:
    return Recording(np.arange(N) / 100, {"x": Samples(samples)})


def voted(*faults: dict[str, Any], samples: list[Any] | None = None, **settings: Any) -> list[Scored]:
    """Four channels at 0, or ``samples``; threshold 1, 8 frames, a row every 10 ms from 0."""
    into = recording(flat() if samples is None else samples)
    chosen = VoteConfig(default={**SETTINGS, **settings}).signals(["x"], "c")
    found = inject(into, [{"kind": "offset", "signal": "x", **fault} for fault in faults], chosen)
    return score(found, found.recording, Result(vote(found.recording, chosen, [])))


def test_the_faulty_channel_is_failed_rightly_after_eight_rows():
    [one] = voted({"channels": [3], "start_s": 1.0, "offset": 5.0})
    assert (one.outcome, one.onset_s, one.failed_channel, one.by) == ("correct", 1.0, 3, "comparison")
    assert one.failed_at_s == pytest.approx(1.07) and one.delay_s == pytest.approx(0.07)


def test_a_fault_below_the_threshold_is_missed_and_one_that_never_began_is_none():
    small = {"channels": [3], "start_s": 1.0, "offset": 0.9}
    never = {"channels": [4], "rate_per_hour": 1e-6, "offset": 5.0}
    found = voted(small, never)
    assert [(one.outcome, one.onset_s, one.delay_s) for one in found] == [("missed", 1.0, None), ("none", None, None)]


def test_a_pair_outvoted_by_the_trend_is_wrong_or_right_by_its_sign():
    """Constant pairs: the trend keeps the smaller pair, ten rows after the onset."""
    up, down = ({"channels": [1, 2], "start_s": 1.0, "offset": sign * 5.0} for sign in (1, -1))
    assert [(one.outcome, one.failed_channel, one.by) for one in voted(up)] == [
        ("correct", 1, "trend"),
        ("correct", 2, "trend"),
    ]
    assert [(one.outcome, one.failed_channel, one.by) for one in voted(down)] == [("wrong", 3, "trend")] * 2
    assert voted(down)[0].delay_s == pytest.approx(0.09)


def test_after_a_false_isolation_every_fault_is_prior_but_not_after_a_right_one():
    samples = flat()
    samples[3][:50] = 5.0
    later = {"channels": [1], "start_s": 3.0, "offset": 5.0}
    assert [one.outcome for one in voted(later, samples=samples)] == ["prior"]
    first = {"channels": [2], "start_s": 1.0, "offset": 5.0}
    assert [one.outcome for one in voted(first, later)] == ["correct", "correct"]
    again = {"channels": [2], "start_s": 4.0, "offset": 1.0}
    assert [one.outcome for one in voted(first, again)] == ["correct", "prior"]


def test_the_onset_of_an_aligned_channel_is_moved_by_its_delay():
    into = recording(flat())
    chosen = VoteConfig(default=SETTINGS).signals(["x"], "c")
    fault = {"kind": "offset", "signal": "x", "channels": [3], "start_s": 1.0, "offset": 5.0}
    found = inject(into, [fault], chosen)
    corrections = {"x": [Correction(True, delay, delay / 100, 0.0, 1.0) for delay in (0.0, 0.0, 3.5, 0.0)]}
    cut = Recording(into.time_s[2:], into.signals, first_row=2)
    [one] = score(found, cut, Result(vote(cut, chosen, [])), corrections)
    assert one.onset_s == pytest.approx(0.96)  # row 96.5: the first row that reads a sample of row 100
