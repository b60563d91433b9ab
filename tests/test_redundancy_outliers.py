"""One channel of four or three that agree, further from the majority than the isolation threshold: by hand."""

from typing import Any

import numpy as np
import pytest
from conftest import constant, vote_samples

from rig.core.frame import Pattern, State

NAN = np.nan
LIMITS: dict[str, Any] = {"threshold": 5.0, "outlier_threshold": 1.0, "outlier_threshold_triplex": 2.0}


@pytest.mark.requirement("redundancy", "an outlier of channels that agree")
@pytest.mark.parametrize(
    ("samples", "pattern", "suspects"),
    [
        ((0.0, 0.0, 0.0, 1.5), Pattern.ISOLATED, [4]),
        ((0.0, 0.0, 0.0, 1.0), Pattern.NORMAL, []),  # the limit itself is agreement
        ((-1.5, 0.0, 0.0, 1.5), Pattern.ISOLATED, [1, 4]),
        ((0.0, 0.0, 1.5, 3.0), Pattern.ISOLATED, [3, 4]),
        ((0.0, 0.9, 1.8, 2.7), Pattern.NORMAL, []),  # a chain
        ((0.0, 0.0, 3.0, 3.0), Pattern.NORMAL, []),  # no majority at this scale, and the halves agree
        ((0.0, 1.5, 3.0, 4.5), Pattern.NORMAL, []),  # no two are close
        ((0.0, 0.0, 6.0, 6.0), Pattern.P2_2, [3, 4]),  # apart by more than the threshold: as without the limit
        ((0.0, 1.5, 7.0, 7.0), Pattern.P2_2, [3, 4]),
        ((0.0, 0.0, 1.5, 9.0), Pattern.ISOLATED, [4]),  # the one far off first
        ((0.0, 0.0, 2.5, NAN), Pattern.ISOLATED, [3, 4]),
        ((0.0, 0.0, 1.5, NAN), Pattern.NORMAL, [4]),
        ((0.0, 2.5, 5.0, NAN), Pattern.NORMAL, [4]),
        ((0.0, 4.0, NAN, NAN), Pattern.NORMAL, [3, 4]),  # of two none is the outlier
    ],
)
def test_who_is_suspect_in_the_first_frame(samples, pattern, suspects):
    out = vote_samples(constant(*samples, frames=1), tie_break=["trend", "reference"], reference=np.zeros(1), **LIMITS)
    assert out.pattern[0] == pattern
    assert [c + 1 for c in range(4) if out.state[0, c] == State.SUSPECT] == suspects


@pytest.mark.requirement("redundancy", "an outlier of channels that agree")
def test_an_outlier_is_failed_after_the_persistence_and_then_three_have_their_own_limit():
    samples = constant(0.0, 0.0, 0.0, 0.0, frames=60)
    samples[5:, 3], samples[30:, 2] = 1.5, 2.5
    assert vote_samples(samples, **LIMITS).failed_at() == [None, None, 38, 13]  # counted from 1
    samples[30:, 2] = 1.5
    assert vote_samples(samples, **LIMITS).failed_at() == [None, None, None, 13]


@pytest.mark.requirement("redundancy", "an outlier of channels that agree")
def test_without_the_limits_no_channel_is_suspect():
    out = vote_samples(constant(0.0, 0.0, 0.0, 4.5, frames=30), threshold=5.0)
    assert out.failed_at() == [None] * 4 and (out.state[:, :4] == State.OK).all()


@pytest.mark.requirement("redundancy", "an outlier of channels that agree")
def test_an_inner_outlier_is_no_part_of_the_vote():
    """Ranks 0, 0, 1.5, 3: the third is alone, so the vote is the second, as where it disagrees by the threshold."""
    out = vote_samples(constant(0.0, 0.2, 1.5, 3.0, frames=1), **LIMITS)
    assert out.voted[0] == 0.2
