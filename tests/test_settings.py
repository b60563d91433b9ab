"""Plain data from files: what is no setting is refused by its key."""

import math
import tomllib

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.core.settings import Settings, record, refuse_what_is_no_setting, share_in_frame


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


class Damper(Settings):
    lag_s: float = 0.5
    gain: float | None = None


DAMPER = np.dtype([("lag_s", "f8"), ("gain", "f8"), ("on", "u1"), ("rest", "f8", (2,))], align=True)


def test_a_record_takes_settings_by_their_names_and_derived_values_before_them():
    row = record(DAMPER, Damper(lag_s=2.0, gain=3.0), gain=4.0, on=True, rest=(1.0, 2.0))[0]
    assert row["lag_s"] == 2.0 and row["gain"] == 4.0 and row["on"] == 1 and row["rest"].tolist() == [1.0, 2.0]


def test_of_two_models_with_one_name_the_first_fills_the_field():
    row = record(DAMPER, Damper(gain=1.0), Damper(lag_s=9.0), on=0, rest=0.0)[0]
    assert row["lag_s"] == 0.5


def test_a_field_that_nothing_fills_is_refused_by_its_name():
    with pytest.raises(TypeError, match="nothing fills the record's field on"):
        record(DAMPER, Damper(gain=1.0), rest=0.0)
    with pytest.raises(TypeError, match="field gain"):  # the setting is there, and not set
        record(DAMPER, Damper(), on=0, rest=0.0)


def test_a_derived_value_without_a_field_is_refused():
    with pytest.raises(TypeError, match="no field of the record: offset"):
        record(DAMPER, Damper(gain=1.0), on=0, rest=0.0, offset=1.0)


def test_the_share_of_a_lag_in_a_frame_is_that_of_its_step_response():
    assert share_in_frame(0.1, 100.0) == pytest.approx(1.0 - math.exp(-0.1), rel=1e-15)
    assert share_in_frame(0.0, 100.0) == 1.0
