"""Which message answers a frame, and what becomes of all others: lost, late or discarded."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.unit.ready_message import sealed
from rig.unit.session import Counts, ReplyCheck
from rig.unit.unit_records import FROM_UNIT, OUTPUT, Kind, blank

SESSION = 7
FATES = ["answered", "request lost", "reply lost", "late", "doubled", "doubled late"]


def reply(frame: int, stepped: int, session: int = SESSION) -> memoryview:
    """The answer to a frame, of a unit that has stepped so many."""
    record = blank(OUTPUT, FROM_UNIT, Kind.REPLY, session)
    record["frame"], record["stepped"] = frame, stepped
    return sealed(record)


def told(counts: Counts) -> tuple[int, int, int, int, int]:
    return counts.missed, counts.late, counts.requests_lost, counts.replies_lost, counts.discarded


CASES = {  # the answers that come in each frame; missed, late, requests lost, replies lost, discarded
    "none missing": ([[(0, 1)], [(1, 2)]], (0, 0, 0, 0, 0)),
    "a reply lost": ([[(0, 1)], [], [(2, 3)]], (1, 0, 0, 1, 0)),
    "a request lost": ([[(0, 1)], [], [(2, 2)]], (1, 0, 1, 0, 0)),
    "late before the next": ([[(0, 1)], [], [(1, 2), (2, 3)]], (1, 1, 0, 0, 0)),
    "overtaken by the next": ([[(0, 1)], [], [(2, 3)], [(1, 2), (3, 4)]], (1, 1, 0, 0, 0)),
    "overtaken by three": ([[(0, 1)], [], [(2, 3)], [(3, 4)], [(4, 5)], [(1, 2), (5, 6)]], (1, 1, 0, 0, 0)),
    "two in the wrong order": ([[(0, 1)], [], [], [(3, 4)], [(2, 3), (1, 2), (4, 5)]], (2, 2, 0, 0, 0)),
    "one of two comes": ([[(0, 1)], [], [], [(3, 4)], [(2, 3), (4, 5)]], (2, 1, 0, 1, 0)),
    "overtaken and doubled": ([[(0, 1)], [], [(2, 3)], [(1, 2), (1, 2), (3, 4)]], (1, 1, 0, 0, 1)),
    "a lost request beside": ([[(0, 1)], [], [], [(3, 3)], [(2, 2), (4, 4)]], (2, 1, 1, 0, 0)),
    "a request overtaken": ([[(0, 1)], [], [(2, 2)], [(1, 3), (3, 4)]], (1, 1, 0, 0, 0)),
    "and then one lost": ([[(0, 1)], [], [(2, 2)], [(1, 3)], [(4, 4)]], (2, 1, 1, 0, 0)),
    "a unit that counts nothing": ([[(0, 0)], [], [(2, 0)], [(1, 0), (3, 0)]], (1, 1, 0, 0, 0)),
    "and never answers": ([[(0, 0)], [], [(2, 0)], [(3, 0)]], (1, 0, 0, 0, 0)),
    "an answer twice": ([[(0, 1)], [(1, 2), (1, 2)], [(1, 2), (2, 3)]], (0, 0, 0, 0, 1)),
}


@pytest.mark.parametrize("case", CASES)
def test_missed_frames_are_late_or_lost(case: str):
    frames, expected = CASES[case]
    check = ReplyCheck(SESSION, Counts())
    for frame, answers in enumerate(frames):
        answered = False
        for answer in answers:
            answered = answered or check.is_answer(reply(*answer), frame)
        if not answered:
            check.missed(frame)
    assert told(check.counts) == expected


def test_late_answers_of_another_session_are_discarded_and_a_unit_started_again_owes_none():
    check = ReplyCheck(SESSION, Counts())
    assert check.is_answer(reply(0, 1), 0)
    check.missed(1)
    assert not check.is_answer(reply(1, 2, SESSION + 1), 2) and check.is_answer(reply(2, 3), 2)
    assert check.awaits_late and told(check.counts) == (1, 0, 0, 1, 1)
    check.begin_again()
    assert not check.awaits_late and not check.is_answer(reply(1, 2), 3)
    assert told(check.counts) == (1, 0, 0, 1, 2)


@given(fates=st.lists(st.tuples(st.sampled_from(FATES), st.integers(1, 6), st.booleans()), max_size=40))
def test_every_missed_frame_is_late_lost_on_the_way_there_or_lost_on_the_way_back(fates: list[tuple[str, int, bool]]):
    """Whatever overtakes whatever; the first frame and the last ones are answered, and then all that is late is there.

    fates : of a frame: what becomes of it, the frames by which it is late, whether late answers come before its own
    """
    plan = [("answered", 1, False), *fates, *[("answered", 1, False)] * 7]
    check, stepped, expected = ReplyCheck(SESSION, Counts()), 0, Counter(fate for fate, *_ in plan)
    arriving: dict[int, list[tuple[int, int]]] = {}
    waiting: list[tuple[int, int]] = []  # to be read
    for frame, (fate, later, before) in enumerate(plan):
        stepped += fate != "request lost"
        answers = [] if "lost" in fate else [(frame, stepped)] * (1 + ("doubled" in fate))
        late = arriving.pop(frame, [])
        if "late" in fate:
            arriving.setdefault(frame + later, []).extend(answers)
            answers = []
        waiting += [*late, *answers] if before else [*answers, *late]
        answered = False
        while waiting and not answered:  # what is left is read while the next answer is awaited
            answered = check.is_answer(reply(*waiting.pop(0)), frame)
        assert answered == bool(answers)
        if not answered:
            check.missed(frame)
    counts, late_ones = check.counts, expected["late"] + expected["doubled late"]
    lost = expected["request lost"], expected["reply lost"]
    assert told(counts)[:4] == (late_ones + sum(lost), late_ones, *lost)
    assert counts.discarded == expected["doubled"] + expected["doubled late"]
