"""The study of laws: its cases, its measures, its summary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.core.frame import FLIGHT_INDEX, INDEX, End, Trust, new_block
from rig.studies.papers.tolerant import FAULTS, LAWS, Case, FaultFlight, cases, fly, measure, summarise

CASE = Case("f16", "pitch", "none", 0.0, 1)


def rows(count: int = 8000):
    block = new_block(count)
    block["flight"][:, FLIGHT_INDEX["altitude_m"]] = 1000.0
    return block


def test_one_seed_is_more_than_five_hundred_flights():
    assert len(cases([1])) * len(LAWS) * (len(FAULTS) + 1) == 648


def test_deviations_count_from_the_onset_on_against_the_flight_without_the_fault():
    healthy, faulty = rows(), rows()
    faulty["truth"][:1000, INDEX["pitch_angle"]] = 9.0  # before the onset
    faulty["truth"][3000, INDEX["pitch_angle"]] = -0.2
    faulty["truth"][-1000:, INDEX["pitch_angle"]] = 0.05
    faulty["flight"][4000, FLIGHT_INDEX["altitude_m"]] = 970.0
    faulty["truth"][4000, INDEX["normal_load_factor"]] = 1.7
    faulty["trust"][2060:] = Trust.CORRECTED
    found = measure(CASE, "F 0.5", "plain", faulty, healthy)
    assert (found.pitch_peak_rad, found.altitude_loss_m, found.load_factor_max) == (0.2, 30.0, 1.7)
    assert found.pitch_steady_rad == pytest.approx(0.05) and found.detected_after_s == pytest.approx(0.6)
    assert found.survived


def test_a_flight_that_is_lost_counts_as_far_as_it_went():
    healthy, faulty = rows(), rows(5000)
    faulty["end"][-1] = End.GROUND_CONTACT
    found = measure(CASE, "F 0.5", "plain", faulty, healthy)
    assert not found.survived and found.detected_after_s is None


def test_the_summary_takes_the_worst_and_an_exact_interval():
    def one(peak: float, survived: bool) -> FaultFlight:
        return FaultFlight(CASE, "F 0.5", "plain", peak, 0.0, 0.0, 1.0, None, survived)

    flown = [FaultFlight(CASE, fault, law, 0.0, 0.0, 0.0, 1.0, 0.5, True) for fault in FAULTS for law in LAWS]
    altitude = [replace(x, case=Case("f16", "altitude", "none", 0.0, 1)) for x in flown]
    table = summarise([*flown, *altitude, one(0.3, False)])
    (found,) = [x for x in table if (x.hold, x.fault, x.law) == ("pitch", "F 0.5", "plain")]
    assert (found.flights, found.survived, found.pitch_peak_rad, found.detected) == (2, 1, 0.3, 1)
    assert (found.survived_low, found.survived_high) == pytest.approx((0.0126, 0.9874), abs=1e-4)


def test_a_moved_centre_of_gravity_is_added_to_the_aircraft_s_own():
    there, here = fly_short(0.0), fly_short(0.03)
    assert not np.array_equal(there["truth"][-1], here["truth"][-1])


def fly_short(shift: float):
    return fly(Case("f16", "pitch", "none", shift, 1), "fault-tolerant", None)[:500]
