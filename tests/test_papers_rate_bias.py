"""The study of biased rates: its grid, its measures, its bounds, and a dozen of its flights."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from rig.core.frame import FLIGHT_INDEX, End, SensorFault, Trust, new_block
from rig.scenario import scenario
from rig.studies.papers.rate_bias_study import (
    ALL_FOUR,
    BIASES_RAD_S,
    DRAWN,
    ONSETS_S,
    POINTS,
    TURBULENCE,
    Case,
    as_dict,
    bound,
    cases,
    drawn,
    faults_of,
    fly_faults,
    measure,
    of_grid,
    settings,
    summarise,
    worst,
)

CASE, FAULT = of_grid("f16", "none", 20.0, 1), ALL_FOUR[0]
ALTITUDE = FLIGHT_INDEX["altitude_m"]


def rows(count: int = 8000):
    block = new_block(count)
    block["flight"][:, ALTITUDE] = 1000.0
    block["trust"] = Trust.TRUSTED
    return block


def test_the_grid_is_complete():
    flown = [(case, fault) for case in cases([1]) for fault in faults_of(case)]
    four = {(c.aircraft, c.turbulence, c.onset_s, f.size) for c, f in flown if f.kind == "all four pitch rates"}
    sizes = [sign * size for size in BIASES_RAD_S for sign in (1.0, -1.0)]
    assert four == set(product(POINTS, TURBULENCE, ONSETS_S, sizes)) and len(four) == 630
    assert len(flown) == 918 and 2 * len(flown) + len(cases([1])) == 1881  # as the help of the command says


def test_drawn_flights_are_within_the_limits_of_the_grid_and_reproducible():
    flights = drawn(60, 3)
    assert flights == drawn(80, 3)[:60] != drawn(60, 4)
    assert {case.aircraft for case, _ in flights} == set(POINTS) and len({case.flight_point for case, _ in flights}) > 6
    assert all(ONSETS_S[0] <= case.onset_s <= ONSETS_S[-1] for case, _ in flights)
    faults = [fault for _, (fault,) in flights]
    assert {fault.kind for fault in faults} == set(DRAWN)
    sizes = [fault.size for fault in faults if "scale" not in fault.kind]
    assert (
        min(np.abs(sizes)) >= BIASES_RAD_S[0] and max(np.abs(sizes)) <= BIASES_RAD_S[-1] and min(sizes) < 0 < max(sizes)
    )
    for case, (fault,) in flights[:10]:
        chosen = scenario.load(None, settings(case, fault, "fault-tolerant"), case.seed)
        assert chosen.faults and chosen.pilot.manoeuvres


@pytest.mark.parametrize(("plain", "most"), [(0.0, 25.0), (10.0, 35.0), (50.0, 75.0), (200.0, 300.0)])
def test_the_bound_is_half_more_or_25_m_more(plain: float, most: float):
    assert bound(plain) == most


def test_errors_count_from_the_onset_on_against_the_flight_without_the_fault():
    healthy, plain, tolerant = rows(), rows(), rows()
    plain["flight"][1000, ALTITUDE] = 0.0  # before the onset
    plain["flight"][3000, ALTITUDE], tolerant["flight"][4000, ALTITUDE] = 990.0, 1036.0
    tolerant["sensor_fault"][2050:] = SensorFault.RATE_BIAS
    found = measure(CASE, FAULT, plain, tolerant, healthy)
    assert (found.plain_m, found.tolerant_m, found.within) == (10.0, 36.0, False)
    assert found.answered_after_s == pytest.approx(0.5) and not found.blamed and found.identical and not found.early
    tolerant["sensor_fault"][1999] = SensorFault.RATE_BIAS
    assert measure(CASE, FAULT, plain, tolerant, healthy).early


def test_who_is_blamed_or_flown_without_is_counted():
    for field, value in (("trust", Trust.CORRECTED), ("sensor_fault", SensorFault.OFFSET)):
        tolerant = rows()
        tolerant[field][5000] = value
        assert measure(CASE, FAULT, rows(), tolerant, rows()).blamed


def test_where_the_plain_law_is_lost_the_other_one_may_be_no_earlier():
    plain, late, early = rows(6000), rows(6000), rows(5999)
    for lost in (plain, late, early):
        lost["end"][-1] = End.GROUND_CONTACT
    assert measure(CASE, FAULT, plain, late, rows()).within
    assert not measure(CASE, FAULT, plain, early, rows()).within
    assert not measure(CASE, FAULT, rows(), late, rows()).within


def test_the_table_counts_with_exact_intervals_and_names_the_worst_first():
    good = measure(CASE, FAULT, rows(), rows(), rows())
    bad = replace(good, within=False, tolerant_m=99.0)
    (row, together) = summarise([good, bad, good])
    assert row["within"]["count"] == together["within"]["count"] == 2 and row["flights"] == 3
    assert (row["within"]["low"], row["within"]["high"]) == pytest.approx((0.0943, 0.9916), abs=1e-4)
    assert worst([good, bad, good], 1) == [bad] and as_dict([bad])["worst"][0]["tolerant_m"] == 99.0
    assert all(f"'{key}'" in good.command or key in good.command for key in settings(CASE, FAULT, "fault-tolerant"))


@pytest.mark.requirement("fault-tolerant", "biased gyros: the plain law's flight")
@pytest.mark.parametrize(
    ("case", "faults"),
    [
        (of_grid("f16", "moderate", 5.0, 2), (7, 9)),
        pytest.param(of_grid("b747", "light", 10.0, 2), (2, 6), marks=pytest.mark.long),
        pytest.param(of_grid("b737", "none", 10.0, 2), (1, 11), marks=pytest.mark.long),
    ],
)
def test_a_dozen_flights_are_within_bounds(case: Case, faults: tuple[int, int]):
    for found in fly_faults(case, [faults_of(case)[i] for i in faults]):
        assert found.within and not found.blamed and found.identical and found.answered_after_s is not None, found
        assert np.isfinite(found.plain_m)
