"""How far a sample may be from its reference: a constant, or what a wind makes of the dynamic pressure."""

import numpy as np
import pytest
from conftest import Voted, constant, vote_samples
from numpy.typing import NDArray

from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.core.frame import State

WIND_M_S = 6.0
CONSTANT = 3000.0
LIMITS = (0.0, 1e6)


def params(airspeed_m_s: float) -> np.void:
    row = np.zeros(1, PARAMS)
    row["reference_threshold"], row["reference_airspeed_m_s"] = CONSTANT, airspeed_m_s
    return row[0]


def watched(samples: NDArray[np.float64], reference: float) -> Voted:
    settings = {"limits": LIMITS, "threshold": 600.0, "reference_threshold": CONSTANT}
    return vote_samples(samples, reference=reference, reference_airspeed_m_s=WIND_M_S, **settings)


def test_without_an_airspeed_the_threshold_is_the_constant():
    for reference in (20_000.0, -1.0, 0.0, np.nan):
        assert reference_threshold(reference, params(0.0)) == CONSTANT


@pytest.mark.parametrize("airspeed_m_s", [1.0, 60.0, 140.0, 260.0])
def test_the_threshold_is_the_change_of_dynamic_pressure_with_a_wind(airspeed_m_s: float):
    """Half the sea-level density times the difference of the squares of v + w and v - w, halved: rho0 v w."""

    def pressure(v: float) -> float:
        return 0.5 * 1.225 * v * v

    change = 0.5 * (pressure(airspeed_m_s + WIND_M_S) - pressure(airspeed_m_s - WIND_M_S))
    assert reference_threshold(pressure(airspeed_m_s), params(WIND_M_S)) == pytest.approx(change, rel=1e-12)


def test_a_wind_below_a_metre_a_second_counts_too():
    assert reference_threshold(20_000.0, params(0.5)) == pytest.approx(110.7, abs=0.1)


def test_it_is_never_more_than_the_constant():
    assert reference_threshold(110_000.0, params(WIND_M_S)) == CONSTANT
    assert reference_threshold(90_000.0, params(WIND_M_S)) == pytest.approx(2817.4, abs=0.1)


@pytest.mark.parametrize("reference", [0.0, -300.0, np.nan])
def test_a_reference_without_an_airspeed_has_the_constant_threshold(reference: float):
    assert reference_threshold(reference, params(WIND_M_S)) == CONSTANT


@pytest.mark.parametrize(("pressure_pa", "settled"), [(5_000.0, True), (20_000.0, False)])
def test_a_pair_off_by_1000_pa_is_settled_where_the_aircraft_is_slow(pressure_pa: float, settled: bool):
    """6 m/s is 664 Pa at 5 kPa and 1328 Pa at 20 kPa."""
    samples = pressure_pa + constant(-10.0, -10.0, 990.0, 990.0)  # the reference lies between
    limits = {"limits": LIMITS, "threshold": 600.0, "tie_break": ["reference"], "reference_threshold": CONSTANT}
    out = vote_samples(samples, reference=pressure_pa, reference_airspeed_m_s=WIND_M_S, **limits)
    assert (out.state[-1, 2:] == State.FAILED).all() == settled and (out.state[:, :2] == State.OK).all()


@pytest.mark.parametrize(("pressure_pa", "failed"), [(5_000.0, True), (20_000.0, False)])
def test_a_last_channel_is_failed_beyond_one_and_a_half_of_that(pressure_pa: float, failed: bool):
    """Off by 1500 Pa: 2.3 thresholds at 5 kPa, 1.1 at 20 kPa."""
    samples = constant(np.nan, np.nan, np.nan, pressure_pa + 1500.0, frames=60)
    out = watched(samples, pressure_pa)
    assert (out.state[-1, 3] == State.FAILED) == failed


@pytest.mark.parametrize(("pressure_pa", "usable"), [(5_000.0, False), (20_000.0, True)])
def test_a_reference_off_a_healthy_vote_by_more_than_that_is_unusable(pressure_pa: float, usable: bool):
    samples = constant(*[pressure_pa + 1000.0] * 4)
    out = watched(samples, pressure_pa)
    assert bool(out.reference_usable[-1]) is usable
