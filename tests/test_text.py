"""Text of others: escaped, on one line, cut in the middle, with the nearest names."""

import pickle
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.core.errors import BadInput, ManagerFailed, RigError
from rig.core.text import LONGEST_LINE, LONGEST_VALUE, choices, nearest, one_line, plain, quoted, shorten

ACTS = "\x1b\x07\x00\x7f\x9b\u202e\u2066\u200b\u2028\ud800\r\n\b"


@given(st.text(st.characters(exclude_categories=()) | st.sampled_from(ACTS)))
def test_nothing_that_a_terminal_acts_on_is_left(text: str):
    shown = plain(text)
    assert all(
        c.isprintable() or unicodedata.category(c) == "Zs" for c in shown
    )  # Python calls wide spaces unprintable
    assert not set(ACTS) & set(shown)
    shown.encode("utf-8")  # no half of a pair


def test_characters_are_shown_by_their_number_and_the_rest_stays():
    assert plain("é 漢 \x1b[2J") == "é 漢 \\u001b[2J"
    assert plain("a\u202eb\U000e0001") == "a\\u202eb\\U000e0001"
    assert plain("a\nb") == "a\\u000ab" and plain("a\nb", keep="\n") == "a\nb"


@given(st.text(max_size=3000))
def test_a_line_is_one_and_has_a_limit(text: str):
    line = one_line(text)
    assert len(line.splitlines()) <= 1 and len(line) <= LONGEST_LINE


def test_a_long_text_loses_its_middle():
    assert shorten("abc") == "abc"
    cut = shorten("a" * 500 + "b" * 500)
    assert len(cut) == LONGEST_VALUE and cut.startswith("aaa") and cut.endswith("bbb") and " ... " in cut
    assert quoted("x" * 1000).startswith("'xxx") and len(quoted("x" * 1000)) == LONGEST_VALUE
    assert quoted(16**5000) == "a number of thousands of digits"


def test_an_error_keeps_what_is_wrong_at_its_end_and_survives_pickling():
    for kind in (BadInput, RigError):
        error = kind("/very" * 1000 + "/x.toml: line\none: \x1b[31mno such file")
        assert str(error).endswith("line one: \\u001b[31mno such file") and len(str(error)) == LONGEST_LINE
        assert str(pickle.loads(pickle.dumps(error))) == str(error)
    failed = pickle.loads(pickle.dumps(ManagerFailed("a\nb", 3, 40)))
    assert (str(failed), failed.row, failed.frame) == ("a b", 3, 40)


def test_a_short_list_is_listed_and_of_a_long_one_the_nearest():
    assert choices("c", ["a", "b"]) == "allowed: a, b"
    names = [f"scenario_number_{i}" for i in range(60)]
    assert choices("scenario_numbr_42", names, "rig x").startswith("nearest: scenario_number_42, ")
    assert choices("y", names, "rig x").endswith("(60 allowed, see rig x)")
    assert nearest("pitch_rte", ["roll_rate", "pitch_rate", "heading", "pitch_angle"])[0] == "pitch_rate"
    assert len(nearest("x" * 100_000, names)) == 3


@pytest.mark.parametrize("name", ["", "x"])
def test_there_is_always_a_nearest(name: str):
    assert len(nearest(name, ["aaa", "bbb", "ccc", "ddd"])) == 3
