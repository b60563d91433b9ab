"""What the rows of tests/tools/evidence.py find in frames, beside numbers worked out by hand."""

from collections import Counter
from math import pi

import evidence
import evidence_found
import evidence_rows
import numpy as np
import pytest
from evidence_rows import UNIT_OF

from rig.core.frame import CHANNELS, INDEX, SIGNALS, S
from rig.scenario import scenario
from rig.studies.campaign.flying import CampaignFlight, fly

Q = INDEX["pitch_rate"]
FITTED = np.ones((S, CHANNELS), bool)


def flown(*sets: str) -> CampaignFlight:
    return fly(scenario.load(None, ["aircraft=f16", "duration_s=4.0", "seed=1", *sets]))


def off_mean(seconds: float, thresholds: float) -> list[str]:
    """What flies undeclared when one channel of four is off for so long, and the vote is the mean of all."""
    fault = {**evidence_rows.offset("pitch_rate", [3], 4.0 * thresholds, 1.0), "duration_s": seconds}
    found = flown("redundancy.manager=mean", f"faults={evidence_rows.toml([fault])}")
    return evidence_found.by_frames(found)["undeclared"]


def failed(at: dict[int, int]) -> np.ndarray:
    """(100, S, 4): channels of the pitch rate, failed from a frame on."""
    flags = np.zeros((100, S, CHANNELS), bool)
    for channel, frame in at.items():
        flags[frame:, Q, channel - 1] = True
    return flags


def healthy_failed(at: dict[int, int], faulty: list[int]) -> tuple[list[str], list[str]]:
    of = np.zeros((S, CHANNELS), bool)
    of[Q, [channel - 1 for channel in faulty]] = True
    alone, along = evidence_found.healthy_failed(failed(at), FITTED, of)
    return evidence_found.channels(alone), evidence_found.channels(along)


def test_a_hardover_that_is_isolated_is_right():
    found = evidence_found.by_frames(flown('faults=[{kind="hardover",signal="pitch_rate",channels=[3],start_s=1.0}]'))
    assert found["right"] and found["faulty"] == 1
    assert not any(found[key] for key in ("wrong", "along", "unit", "missed", "undeclared", "given_up", "substitute"))


def test_a_vote_is_off_from_a_threshold_and_a_second_on():
    assert off_mean(1.1, 1.2) == ["pitch_rate"]
    assert off_mean(0.9, 1.2) == []
    assert off_mean(1.1, 0.8) == []


def test_a_fault_without_an_isolation_is_missed():
    sets = 'faults=[{kind="offset",signal="pitch_rate",channels=[3],start_s=1.0,offset_thresholds=8.0}]'
    found = evidence_found.by_frames(flown("redundancy.manager=mean", sets))
    assert (found["missed"], found["undeclared"], found["right"]) == (["pitch_rate.3"], ["pitch_rate"], False)


def test_flags_last_when_they_are_up_in_a_row():
    flags = np.zeros((30, S), bool)
    flags[5:15, 0] = flags[5:14, 1] = flags[20:30, 2] = True
    flags[0:20, 3], flags[9, 3] = True, False
    assert np.flatnonzero(evidence_found.lasts(flags, 10)).tolist() == [0, 2, 3]
    assert not evidence_found.lasts(flags[:9], 10).any()


def test_healthy_channels_failed_before_the_last_or_as_the_last_are_failed_alone():
    assert healthy_failed({1: 10, 2: 10}, [3, 4]) == (["pitch_rate.1", "pitch_rate.2"], [])
    assert healthy_failed({1: 10, 2: 10, 3: 20, 4: 20}, [3, 4]) == (["pitch_rate.1", "pitch_rate.2"], [])
    assert healthy_failed({1: 10, 2: 20, 3: 30, 4: 40}, [1, 2, 3]) == (["pitch_rate.4"], [])
    assert healthy_failed({1: 5}, [2]) == (["pitch_rate.1"], [])


def test_healthy_channels_are_given_up_with_the_faulty_ones_that_are_left():
    assert healthy_failed({1: 10, 2: 20, 3: 30, 4: 30}, [1, 2, 3]) == ([], ["pitch_rate.4"])
    assert healthy_failed(dict.fromkeys((1, 2, 3, 4), 9), [3, 4]) == ([], ["pitch_rate.1", "pitch_rate.2"])


def test_all_channels_of_a_healthy_signal_are_not_given_up_but_failed():
    alone, along = healthy_failed(dict.fromkeys((1, 2, 3, 4), 9), [])
    assert (len(alone), along) == (4, [])


def test_a_box_is_faulty_when_most_of_its_signals_are():
    faulty = np.zeros((S, CHANNELS), bool)
    of = {name: [INDEX[one] for one, unit in UNIT_OF.items() if unit == name] for name in evidence_rows.UNITS}
    assert {name: len(places) for name, places in of.items()} == {"air-data": 4, "inertial": 9, "sticks": 3}
    faulty[of["air-data"][:2], 0] = faulty[of["air-data"][:3], 1] = True
    faulty[of["inertial"][:4], 0] = faulty[of["inertial"][:5], 2] = True
    flags = evidence_found.of_faulty_units(faulty)
    assert {(int(s), int(c)) for s, c in np.argwhere(flags)} == {
        *((s, 1) for s in of["air-data"]),
        *((s, 2) for s in of["inertial"]),
    }


def test_the_middle_of_an_angle_is_taken_the_short_way():
    truth = np.zeros((1, S))
    clean = np.zeros((1, S, CHANNELS))
    truth[0, INDEX["roll_angle"]], truth[0, INDEX["heading"]] = -pi + 0.01, 0.01
    clean[0, INDEX["roll_angle"]] = pi - 0.02, pi - 0.01, -pi + 0.02, -pi + 0.03
    clean[0, INDEX["heading"]] = 2 * pi - 0.01, 0.01, 0.02, np.nan
    middle = evidence_found.middle_of(clean, truth)[0]
    assert middle[INDEX["roll_angle"]] == pytest.approx(-pi + 0.005)
    assert middle[INDEX["heading"]] == pytest.approx(0.01)


@pytest.mark.parametrize(("signal", "frames"), [("pitch_rate", 1), ("static_pressure", 3), ("heading", 7)])
def test_bursts_are_twelve_and_as_long_as_said(signal, frames):
    one = next(one for one in evidence_rows.bursts() if one.about == f"f16 {signal} 0 {frames} +10")
    found = fly(scenario.load(None, one.seeded(1).sets))
    changed = (found.rows["channels"] != found.table.clean["channels"]) & np.isfinite(found.table.clean["channels"])
    assert np.flatnonzero(changed.any(axis=(0, 2))).tolist() == [INDEX[signal]]
    edges = np.flatnonzero(np.diff(changed[:, INDEX[signal], 1].astype(int)))
    assert np.diff(edges)[::2].tolist() == [frames] * 12


def test_one_sign_in_two_flies_through_weather_for_every_signal_kind_and_rate():
    flights = [one.about for one in evidence_rows.slow_weather()]
    assert len({about.translate(str.maketrans("", "", "+-")) for about in flights}) == len(flights) == 156
    assert Counter("+" in about for about in flights) == {True: 78, False: 78}


def test_a_reference_is_measured_in_its_own_thresholds():
    """The load factor's reference is the unit's force: an offset there is its error."""
    force = {"kind": "offset", "signal": "inertial.specific_force_forward_m_s2", "offset": 9.80665}
    found = flown(f"faults={evidence_rows.toml([{**force, 'start_s': 1.0, 'ramp_s': 1.0}])}")
    middle = evidence_found.middle_of(found.table.clean["channels"], found.rows["truth"])
    threshold = found.scenario.references.error("longitudinal_load_factor", "inertial")
    assert threshold is not None
    error, unusable = evidence_found.reference_errors(found, middle)["longitudinal_load_factor"]
    assert error == pytest.approx(1.0 / threshold.threshold, rel=0.1)
    assert unusable == pytest.approx(3.0 / 4.0, abs=0.04)


def test_a_table_counts_a_flight_in_each_of_its_lines():
    found = [
        {"about": f"{aircraft} heading third {rate}", "right": right, "survived": True, "given_up": []}
        | {"wrong": [] if right else ["heading.4"], "undeclared": []}
        for aircraft, rate, right in (("f16", "+0.1", True), ("f16", "-0.1", False), ("b737", "+2", True))
    ]
    assert evidence.drifts("slow", found).splitlines()[2:] == [
        "| heading | 3 | 2 | 1 | 0 | 0 | 0 |",
        "| f16 | 2 | 1 | 1 | 0 | 0 | 0 |",
        "| b737 | 1 | 1 | 0 | 0 | 0 | 0 |",
        "| 0.1/s | 2 | 1 | 1 | 0 | 0 | 0 |",
        "| 2/s | 1 | 1 | 0 | 0 | 0 | 0 |",
        "| all | 3 | 2 | 1 | 0 | 0 | 0 |",
    ]


def test_every_signal_is_in_a_box():
    assert set(UNIT_OF) == {signal.name for signal in SIGNALS}
