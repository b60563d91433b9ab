"""The words for a voted value, from the figures of a score."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rig.core.frame import SIGNALS
from rig.verdict.flight_rows import _voted


def context(peak: float, above_s: float) -> Any:
    """Pitch rate with an error limit of 0.05 rad/s, and no fault."""
    params = np.zeros(len(SIGNALS), [("threshold", "f8")])
    params["threshold"] = 0.05
    score = SimpleNamespace(
        faults=[],
        vote_error={"pitch_rate": SimpleNamespace(peak=peak, above_threshold_s=above_s)},
        signals={"pitch_rate": SimpleNamespace(lost_s=0.0)},
    )
    return SimpleNamespace(score=score, params=params)


@pytest.mark.parametrize(
    ("peak", "above_s", "said"),
    [
        (0.0, 6.0, "no number for 6 s, otherwise at most 0"),  # an error that is no number is no peak
        (0.1, 6.0, "up to 5.7 deg/s from the true value, beyond the error limit of 2.86 deg/s for 6 s"),
        (0.01, 0.0, "at most 0.57 deg/s from the true value"),
    ],
)
def test_a_vote_that_is_no_number_is_no_error_of_zero(peak: float, above_s: float, said: str):
    assert _voted("pitch_rate", context(peak, above_s)).startswith(said)
