import numpy as np
import pytest

from rig.frame import DISCRETES, FLAT, INDEX, SIGNALS, Pattern, new_block, sig, to_frame


def test_the_sixteen_signals_and_three_discretes_of_a_flight_control_system_are_there():
    assert len(SIGNALS) == len(INDEX) == 16 and len(DISCRETES) == 3
    assert {signal.name for signal in SIGNALS if signal.wraps} == {"roll_angle", "heading"}
    assert all(signal.low < signal.high for signal in SIGNALS)
    assert all(abs(signal.high - signal.low - 2 * np.pi) < 1e-12 for signal in SIGNALS if signal.wraps)


def test_a_block_is_numbered_from_its_first_frame_and_blank():
    block = new_block(5, 100)
    assert block["frame"].tolist() == [100, 101, 102, 103, 104]
    assert block.dtype == FLAT and not block["channels"].any()


def test_patterns_are_called_as_in_the_paper():
    labels = [pattern.label for pattern in Pattern]
    assert labels == ["normal", "isolated", "2:2", "1:1:1:1", "1:1:1", "1:1", "lost"]


@pytest.mark.parametrize(("time_s", "frame"), [(0.0, 0), (0.1, 10), (0.07, 7), (0.071, 8), (0.29, 29)])
def test_times_become_the_first_frame_not_before_them(time_s, frame):
    assert to_frame(time_s, 100.0) == frame


def test_the_places_by_symbol_are_those_of_the_table():
    assert [getattr(sig, signal.symbol.upper()) for signal in SIGNALS] == list(range(len(SIGNALS)))
