from math import ceil, log10

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.core.frame import DISCRETES, FLAT, INDEX, SIGNALS, Pattern, copied, new_block, sig, to_frame, to_frames


def test_the_sixteen_signals_and_three_discretes_of_a_flight_control_system_are_there():
    assert len(SIGNALS) == len(INDEX) == 16 and len(DISCRETES) == 3
    assert {signal.name for signal in SIGNALS if signal.wraps} == {"roll_angle", "heading"}
    assert all(signal.low < signal.high for signal in SIGNALS)
    assert all(abs(signal.high - signal.low - 2 * np.pi) < 1e-12 for signal in SIGNALS if signal.wraps)


def test_a_block_is_numbered_from_its_first_frame_and_blank():
    block = new_block(5, 100)
    assert block["frame"].tolist() == [100, 101, 102, 103, 104]
    assert block.dtype == FLAT and not block["channels"].any()


def test_copied_rows_are_the_same_bytes_in_memory_of_their_own():
    block = new_block(5, 100)
    block["channels"] = np.arange(5)[:, None, None]
    copy = copied(block[3:])
    assert copy.dtype == FLAT and copy.flags.aligned and copy.tobytes() == block[3:].tobytes()
    copy["frame"] = 0
    assert block["frame"].tolist() == [100, 101, 102, 103, 104]
    assert len(copied(block[:0])) == 0


def test_patterns_are_called_as_in_the_paper():
    labels = [pattern.label for pattern in Pattern]
    assert labels == ["normal", "isolated", "2:2", "1:1:1:1", "1:1:1", "1:1", "lost"]


@pytest.mark.parametrize(("time_s", "frame"), [(0.0, 0), (0.1, 10), (0.07, 7), (0.071, 8), (0.29, 29)])
def test_times_become_the_first_frame_not_before_them(time_s, frame):
    assert to_frame(time_s, 100.0) == frame


@given(frame=st.integers(1, 100_000), rate_hz=st.sampled_from([30, 60, 70, 90, 120, 144, 300]), more=st.integers(0, 6))
def test_a_rounded_decimal_is_the_frame_whose_time_was_rounded(frame: int, rate_hz: int, more: int):
    decimals = ceil(log10(rate_hz)) + 2 + more  # of which one is a hundredth of a frame or less
    assert to_frame(round(frame / rate_hz, decimals), float(rate_hz)) == frame


@given(
    frame=st.integers(0, 100_000),
    more=st.integers(-3, 3),
    decimals=st.integers(3, 7),
    rate_hz=st.sampled_from([50, 100, 125, 200, 250, 500, 1000]),
)
def test_where_frames_are_decimals_no_time_is_taken_for_a_rounded_one(
    frame: int, more: int, decimals: int, rate_hz: int
):
    parts = max(0, frame * 10**decimals // rate_hz + more)
    assert to_frame(parts / 10**decimals, float(rate_hz)) == -(-parts * rate_hz // 10**decimals)


@pytest.mark.parametrize("time_s", [0.02, 0.017, 0.0168, 0.01669])
def test_a_time_between_two_frames_is_the_later_one(time_s: float):
    assert to_frame(time_s, 60.0) == 2


@given(
    times=st.lists(st.floats(-10.0, 600.0) | st.integers(-9999, 9_999_999).map(lambda n: n / 10_000), min_size=1),
    rate_hz=st.sampled_from([1.0, 33.3333, 50.0, 60.0, 100.0, 144.0, 400.0, 1000.0]),
)
def test_many_times_become_the_frames_of_each(times: list[float], rate_hz: float):
    assert to_frames(np.array(times), rate_hz).tolist() == [to_frame(time_s, rate_hz) for time_s in times]


def test_the_places_by_symbol_are_those_of_the_table():
    assert [getattr(sig, signal.symbol.upper()) for signal in SIGNALS] == list(range(len(SIGNALS)))
