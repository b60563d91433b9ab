"""Plain data from files: what is no setting is refused by its key."""

import tomllib

import pytest

from rig.errors import BadInput
from rig.settings import refuse_what_is_no_setting


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a.b = nan", "x: a.b: must be a finite number, got nan"),
        ("a = [1.0, inf]", "x: a.1: must be a finite number, got inf"),
        ("a = 1979-05-27T07:32:00Z", "x: a: must be a number, a text, a list or a table, got the date or time 1979"),
        ("a = [{ b = 1979-05-27 }]", "x: a.0.b: must be a number, a text, a list or a table, got the date or time"),
        ("a = 07:32:00", "x: a: must be a number, a text, a list or a table, got the date or time 07:32:00"),
    ],
)
def test_what_is_no_setting_is_refused_by_its_key(text: str, says: str):
    with pytest.raises(BadInput, match=says):
        refuse_what_is_no_setting(tomllib.loads(text), "x")


def test_numbers_texts_lists_and_tables_pass():
    refuse_what_is_no_setting({"a": [1, 2.5, "b", {"c": True}]}, "x")
