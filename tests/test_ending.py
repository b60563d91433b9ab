"""The end of a flight, as people read it."""

from __future__ import annotations

import pytest

from rig.core.ending import WHOLE, ending, why_lost
from rig.core.frame import End


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((True, WHOLE, 6000, 100.0), "survived, 60 s flown"),
        ((True, "interrupted", 1234, 100.0), "survived, 12.34 s flown, interrupted"),
        ((True, "", 100, 100.0), "survived, 1 s flown, no reason given"),
        (
            (False, "departure angle of attack", 2138, 100.0),
            "lost at 21.37 s: angle of attack beyond its limit",
        ),
        ((False, "ground contact", 2138, 1000.0), "lost at 2.137 s: ground contact"),
    ],
)
def test_an_end_is_a_sentence(given: tuple[bool, str, int, float], expected: str):
    assert ending(*given) == expected


def test_no_cause_of_a_loss_is_the_name_of_a_column():
    lost = [end for end in End if end != End.FLYING]
    causes = [why_lost(end.label) for end in lost]
    assert causes == [end.cause for end in lost] and len(set(causes)) == len(lost)
    assert not any(text.startswith("departure") for text in causes)
    assert why_lost("the manager class raised") == "the manager class raised"
