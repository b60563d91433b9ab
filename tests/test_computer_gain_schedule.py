from dataclasses import dataclass

import numpy as np
import pytest

from rig.computer.gain_schedule import check_rising, look_up, table


@dataclass(frozen=True)
class At:
    dynamic_pressure_pa: float
    gain: float = 0.0
    slope: float = 0.0


@pytest.mark.parametrize("points", [1, 2, 3, 4, 7])
def test_numbers_are_interpolated_between_points_and_held_beyond(points: int):
    rng = np.random.default_rng(points)
    pressures = np.cumsum(rng.uniform(500.0, 5000.0, points))
    numbers = rng.standard_normal((points, 12))
    out = np.zeros(12)
    for pressure in (*pressures, *rng.uniform(0.0, 1.2 * pressures[-1], 40), -1.0):
        look_up(pressures, numbers, pressure, out)
        assert out == pytest.approx([np.interp(pressure, pressures, column) for column in numbers.T], abs=1e-12)


def test_at_a_point_the_numbers_are_the_points_own_to_the_last_bit():
    """Margins are computed there: a gain must be the one that was designed."""
    rng = np.random.default_rng(1)
    pressures, numbers, out = np.array([5.1e3, 11.7e3, 31.2e3, 40e3]), rng.standard_normal((4, 50)), np.zeros(50)
    for pressure, expected in zip(pressures[:-1], numbers, strict=False):
        look_up(pressures, numbers, pressure, out)
        assert np.array_equal(out, expected)


def test_a_table_has_the_points_in_rows_and_the_columns_in_the_order_asked_for():
    pressures, numbers = table([At(1e3, 1.0, 2.0), At(2e3, 3.0, 4.0)], ("slope", "gain"))
    assert pressures.tolist() == [1e3, 2e3]
    assert numbers.tolist() == [[2.0, 1.0], [4.0, 3.0]]


@pytest.mark.parametrize("pressures", [(2e3, 1e3), (1e3, 1e3), (1e3, 3e3, 2e3)])
def test_points_that_do_not_rise_are_refused(pressures: tuple[float, ...]):
    with pytest.raises(ValueError, match="rising dynamic pressure"):
        check_rising([At(p) for p in pressures])


def test_points_that_rise_are_fine():
    check_rising([At(1e3)])
    check_rising([At(1e3), At(1.5e3), At(9e3)])
