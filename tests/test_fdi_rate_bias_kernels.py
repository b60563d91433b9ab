"""The kernels that isolate a biased rate, one call each: what is compared, learned, counted and handed over."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rig.computer.analytic.unit_bank import bank_by
from rig.computer.fdi import rate_bias
from rig.computer.fdi.pitch_test_state import BOTH, GYROS_ALONE, STATE, UNIT_ALONE, Config, parameters
from rig.core.frame import INDEX, INERTIAL, S, Trust

pytestmark = pytest.mark.requirement("fault-tolerant", "the three hypotheses, isolation and return")

RATE_HZ = 100.0
DT = 1.0 / RATE_HZ
C = parameters(Config(), True, RATE_HZ)[0]
Q, R, ROLL = INDEX["pitch_rate"], INDEX["yaw_rate"], INDEX["roll_angle"]


def state(rates: int, **fields: Any) -> Any:
    """A trusted sensor whose innovations have a sigma of 1 mrad."""
    w = np.zeros(1, STATE)[0]
    w["rates"], w["trust"], w["sigma"] = rates, Trust.TRUSTED, 0.001
    for name, value in fields.items():
        w[name] = value
    return w


def turned(
    rates: int, voted: float, headed: bool = True, known: bool = True, roll_rate: float = 0.1
) -> tuple[Any, Any]:
    """State and signals after one frame with the unit's bank angle at 0.3 rad and the ``voted`` one."""
    w, x, inertial = state(rates, bank_effect=0.01), np.zeros(S), np.full(len(INERTIAL), 0.1)
    inertial[INERTIAL.index("roll_rate_rad_s")] = roll_rate
    w["filter"]["frames"], w["unit"]["started"], w["unit"]["roll_angle"] = 1, 1, 0.3
    w["second"]["drift"], w["second"]["scale"], w["second"]["rate"] = 0.002, 0.01, 0.03
    x[[Q, R, ROLL]], x[INDEX["normal_load_factor"]] = (0.02, 0.05, voted), 1.05
    rate_bias.turn(C, w, known, headed, inertial, x, 36)
    return w, x


@pytest.mark.parametrize(
    ("known", "roll_rate", "compared"), [(True, 0.1, True), (False, 0.1, False), (True, math.nan, False)]
)
def test_gyros_and_unit_are_compared_where_both_say_something(known: bool, roll_rate: float, compared: bool):
    w, _ = turned(BOTH, 0.32, known=known, roll_rate=roll_rate)
    assert (w["rate_difference"] != 0.0) == (w["bank_difference"] != 0.0) == compared
    assert w["rates"] == (GYROS_ALONE if math.isnan(roll_rate) else BOTH)


@pytest.mark.parametrize(
    ("rates", "headed", "learns"),
    [(BOTH, True, True), (BOTH, False, False), (UNIT_ALONE, True, False), (GYROS_ALONE, True, False)],
)
def test_the_unit_s_yaw_drift_is_learned_while_heading_and_rates_are_in_order(rates: int, headed: bool, learns: bool):
    w, _ = turned(rates, 0.3, headed)
    assert w["unit"]["yaw_seconds"] == (DT if learns else 0.0)


@pytest.mark.parametrize(
    ("rates", "voted", "asked"),
    [(BOTH, 0.32, True), (BOTH, 0.36, False), (UNIT_ALONE, 0.32, False), (GYROS_ALONE, 0.5, True)],
)
def test_the_second_mean_goes_by_the_voted_bank_angle_where_the_unit_s_agrees(rates: int, voted: float, asked: bool):
    """And the filter by the gyros, but where the unit alone is in order."""
    w, x = turned(rates, voted)
    unit, bank = w["unit"], bank_by(w["unit"])
    phi = voted if asked else bank
    other, by_bank = (unit["pitch_rate"] * math.cos(a) - unit["yaw_rate"] * math.sin(a) for a in (phi, bank))
    assert w["second"]["rate"] == pytest.approx(other, rel=1e-9)
    assert w["bank_effect"] == pytest.approx(0.01 + DT * (by_bank - other - 0.01 / 5.0), rel=1e-9)
    moved = DT * (0.5 * (other + 0.03) - math.cos(phi) * (0.002 - unit["pitch_rate"] * 0.01))
    assert w["second"]["theta"] == pytest.approx(moved, rel=1e-9)
    gyros = x[Q] * math.cos(voted) - x[R] * math.sin(voted)
    assert w["rate_difference"] == pytest.approx(DT / 1.01 * (gyros - other), rel=1e-9)
    assert w["filter"]["rate"] == pytest.approx(other if rates == UNIT_ALONE else gyros, rel=1e-9)


@pytest.mark.parametrize(
    ("rates", "off", "error"),
    [(BOTH, 0.039, 0.0), (BOTH, 0.041, 0.05), (BOTH, -0.041, 0.05), (UNIT_ALONE, 0.0, 0.05), (GYROS_ALONE, 0.041, 0.0)],
)
def test_the_rates_are_less_accurate_in_a_turn_when_the_unit_s_bank_angle_is_used(rates: int, off: float, error: float):
    w, x = state(rates), np.zeros(S)
    w["unit"]["roll_angle"], w["unit"]["settled"], w["unit"]["usual_bank"] = 3.15, 0.5, -0.02
    x[ROLL] = 3.14 + off - 2.0 * math.pi
    assert rate_bias.bank_error(w, x) == error


@pytest.mark.parametrize("rates", [BOTH, UNIT_ALONE])
def test_the_difference_of_the_rates_is_smoothed_over_a_second_and_learned_while_both_are_in_order(rates: int):
    w = state(rates, rate_difference=0.001, usual_rate_difference=0.0004, usual_rate_seconds=3.0, usual_frames=7)
    rate_bias.compare(C, w, 0.002)
    apart, learned = 0.001 + DT / 1.01 * 0.001, rates == BOTH
    assert w["rate_difference"] == pytest.approx(apart, rel=1e-9)
    usual = 0.0004 + (DT / 4.01 * (apart - 0.0004) if learned else 0.0)
    assert w["usual_rate_difference"] == pytest.approx(usual, rel=1e-9)
    assert w["usual_rate_seconds"] == pytest.approx(3.01 if learned else 3.0)
    assert (w["usual_frames"], w["unusual"]) == (8, 0)


@pytest.mark.parametrize(("off", "similar", "differ"), [(0.00099, 8, 0), (0.00101, 0, 1), (-0.00101, 0, 1)])
def test_rates_a_milliradian_a_second_apart_from_the_usual_differ(off: float, similar: int, differ: int):
    w = state(GYROS_ALONE, rate_difference=0.01 + off, usual_rate_difference=0.01, usual_frames=7)
    rate_bias.compare(C, w, 0.01 + off)
    assert (w["usual_frames"], w["unusual"]) == (similar, differ)


@pytest.mark.parametrize(
    ("rates", "suspected", "bank_apart", "bank", "returning"),
    [
        (BOTH, 0, 1.0, 1.0, True),
        (GYROS_ALONE, 0, 1.0, 1.0, True),
        (UNIT_ALONE, 0, 1.0, -0.09, True),  # straight flight
        (UNIT_ALONE, 0, 0.0, -0.11, False),
        (UNIT_ALONE, 1, -0.011, 0.5, True),  # it was the bank angle, and that agrees
        (UNIT_ALONE, 1, -0.013, 0.5, False),
    ],
)
def test_rates_as_usual_count_in_straight_flight_or_with_a_bank_angle_that_agrees_again(
    rates: int, suspected: int, bank_apart: float, bank: float, returning: bool
):
    w = state(rates, bank_suspected=suspected, bank_difference=bank_apart)
    w["unit"]["roll_angle"] = bank
    assert bool(rate_bias.returning(w)) == returning
    w["usual_frames"] = 7
    rate_bias.compare(C, w, 0.0)
    assert w["usual_frames"] == (8 if returning else 0)


@pytest.mark.parametrize(
    ("rates", "trust", "learns"),
    [(BOTH, Trust.TRUSTED, True), (UNIT_ALONE, Trust.TRUSTED, False), (BOTH, Trust.CORRECTED, False)],
)
def test_the_bank_angles_are_compared_over_a_second_and_the_usual_difference_learned(
    rates: int, trust: Trust, learns: bool
):
    w = state(rates, bank_difference=0.01)
    w["trust"], w["unit"]["roll_angle"], w["unit"]["settled"] = trust, 0.05, 1.0
    rate_bias.compare_banks(w, 0.07 + 2.0 * math.pi, DT)
    usual = DT / (DT + 0.3) * 0.02 if learns else 0.0
    assert w["unit"]["usual_bank"] == pytest.approx(usual, rel=1e-9)
    assert w["bank_difference"] == pytest.approx(0.01 + DT / 1.01 * (0.01 - usual), rel=1e-9)


@pytest.mark.parametrize(("rates", "drift", "kept"), [(BOTH, 0.1, 0.0), (UNIT_ALONE, 0.12, 0.003)])
def test_a_lost_unit_leaves_the_drift_of_the_gyros_and_nothing_counted(rates: int, drift: float, kept: float):
    w = state(rates, rate_difference=0.02, usual_rate_difference=0.003, usual_frames=9)
    w["filter"]["drift"], w["unit"]["started"] = 0.1, 1
    rate_bias.lose_unit(w)
    assert w["filter"]["drift"] == pytest.approx(drift) and w["kept"][:, 0] == pytest.approx(kept)
    assert (w["rates"], w["usual_frames"], w["unit"]["started"]) == (GYROS_ALONE, 0, 0) and not w["kept"][:, 1].any()


@pytest.mark.parametrize(
    ("first", "second", "over"),
    [
        (0.0, 6.1, 1),
        (0.0, 5.9, 0),
        (3.4, 7.0, 1),  # less than a half of it
        (3.6, 7.0, 0),
        (-7.0, 7.0, 1),
    ],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_unit_is_left_out_when_its_residual_alone_is_too_large_for_two_frames(
    first: float, second: float, over: int, sign: float
):
    w = state(BOTH, innovation=sign * 1e-3 * first, second_innovation=sign * 1e-3 * second, usual_frames=9)
    rate_bias.settle(C, w, True)
    assert (w["rates"], w["second_jump_frames"]) == (BOTH, over)
    rate_bias.settle(C, w, True)
    assert w["rates"] == (GYROS_ALONE if over else BOTH) and w["usual_frames"] == (0 if over else 9)


@pytest.mark.parametrize(("trust", "known"), [(Trust.CORRECTED, True), (Trust.TRUSTED, False)])
def test_who_is_not_asked_is_aligned_less_by_the_usual_difference(trust: Trust, known: bool):
    for rates, drift in ((BOTH, 0.1 - 0.003), (GYROS_ALONE, 0.1)):
        w = state(rates, second_innovation=0.1, usual_rate_difference=0.003)
        w["trust"] = trust
        for name in ("theta", "drift", "path", "scale"):
            w["filter"][name] = {"theta": 0.2, "drift": 0.1, "path": 0.3, "scale": 0.4}[name]
        rate_bias.settle(C, w, known)
        told = [float(w["second"][name]) for name in ("theta", "drift", "path", "scale")]
        assert told == pytest.approx([0.2, drift, 0.3, 0.4]) and (w["rates"], w["second_jump_frames"]) == (rates, 0)


@pytest.mark.parametrize(
    ("rates", "drift", "kept", "variance"), [(UNIT_ALONE, 0.12, 0.003, 5e-6), (GYROS_ALONE, 0.1, 0.0, 1e-6)]
)
def test_the_rates_are_both_used_after_five_seconds_as_usual(rates: int, drift: float, kept: float, variance: float):
    frames = round(5.0 * RATE_HZ)
    w = state(
        rates,
        innovation=0.002,
        rate_difference=0.02,
        usual_rate_difference=0.003,
        bank_effect=0.1,
        second_jump_frames=1,
        usual_frames=frames - 1,
    )
    w["filter"]["drift"], w["filter"]["p"][0, 0] = 0.1, 1e-6
    rate_bias.settle(C, w, True)
    assert w["rates"] == rates and w["second"]["drift"] == 0.1
    w["usual_frames"] = frames
    rate_bias.settle(C, w, True)
    assert (w["rates"], w["second_jump_frames"], w["bank_effect"]) == (BOTH, 0, 0.0)
    told = w["filter"]["drift"], w["filter"]["p"][0, 0], w["second"]["drift"], w["kept"][0, 0]
    assert told == pytest.approx((drift, variance, drift - 0.02, kept), rel=1e-9)


@pytest.mark.parametrize(
    ("second", "suspected"),
    [(0.4, 0), (0.6, 1), (3.0, 1), (-3.0, 0)],  # a quarter: the bank angle moves both
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_when_the_gyros_are_rejected_the_filter_goes_on_as_the_second_mean(second: float, suspected: int, sign: float):
    w = state(
        BOTH,
        innovation=sign * 0.002,
        second_innovation=sign * 0.001 * second,
        bank_effect=0.03,
        usual_rate_difference=0.003,
        usual_frames=9,
    )
    w["jump_frames"], w["cusum"], w["recent"], w["rate_difference"] = 2, 1.0, 0.002, 0.0025
    for name, value in {"theta": 0.2, "drift": 0.1, "path": 0.3, "scale": 0.4, "rate": 0.5}.items():
        w["second"][name] = value
    rate_bias.reject_gyros(w)
    told = [float(w["filter"][name]) for name in ("theta", "drift", "path", "scale", "rate")]
    assert told == pytest.approx([0.2 + 0.03 * suspected, 0.1, 0.3, 0.4, 0.5])
    assert w["bank_suspected"] == suspected and w["kept"][:, 0] == pytest.approx(-0.003)
    assert (w["rates"], w["usual_frames"], w["jump_frames"], w["cusum"], w["recent"]) == (UNIT_ALONE, 0, 0, 0.0, 0.0)


@pytest.mark.parametrize(("apart", "differ"), [(0.0035, 0), (0.0045, 1), (0.0015, 1)])
def test_rejected_gyros_are_biased_when_they_are_further_apart_than_usual(apart: float, differ: int):
    w = state(BOTH, innovation=0.002, rate_difference=apart, usual_rate_difference=0.003)
    assert not rate_bias.biased(w)
    rate_bias.reject_gyros(w)
    assert (w["unusual"], bool(rate_bias.biased(w))) == (differ, differ == 1)
    w["trust"] = Trust.CORRECTED
    assert not rate_bias.biased(w)


@pytest.mark.requirement("fault-tolerant", "confirmed, refuted or left open")
@pytest.mark.parametrize(
    ("second", "tilt", "recent", "confirmed", "refuted"),
    [
        (2.0, 0.0, 2.0, True, False),  # both means show it
        (1.1, 0.0, 2.0, True, False),
        (0.8, 0.0, 2.0, False, False),  # less than a half, more than a quarter: wait
        (0.4, 0.0, 2.0, False, True),  # a rate
        (-2.0, 0.0, 2.0, False, True),
        (2.0, 1.8, 2.0, False, True),  # the bank angle
        (2.0, 1.2, 2.0, False, False),
        (2.0, -1.8, 2.0, True, False),  # by the other bank angle it would be more
        (2.0, 1.8, 0.0, True, False),  # at once: a bank angle does not do that
        (0.4, 0.0, 0.0, False, True),
    ],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_trip_of_two_milliradians_is_confirmed_refuted_or_left_open(
    second: float, tilt: float, recent: float, confirmed: bool, refuted: bool, sign: float
):
    w = np.zeros(1, STATE)[0]
    w["innovation"], w["second_innovation"], w["bank_effect"], w["recent"] = (
        sign * 1e-3 * x for x in (2.0, second, tilt, recent)
    )
    assert (bool(rate_bias.confirmed(w)), bool(rate_bias.refuted(w))) == (confirmed, refuted)
