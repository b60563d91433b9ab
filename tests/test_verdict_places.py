"""Faults on no channel, told in the unit and the size of their own place: inertial unit, references, surfaces."""

import re
from functools import cache
from math import degrees
from typing import Any

import numpy as np
import pytest

from rig.core.frame import INDEX, INERTIAL, SIGNALS, Table
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.scenario.scenario import Scenario
from rig.studies.campaign.flying import CampaignFlight, fly
from rig.verdict.conclusion import conclusion
from rig.verdict.score_records import Score
from rig.verdict.score_tables import FAULTS, tables
from rig.verdict.scoring import score

# What people read of each quantity, and how many of it are one of SI.
SHOWN = {
    **dict.fromkeys(("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"), ("deg/s", degrees(1.0))),
    **dict.fromkeys((f"velocity_{way}_m_s" for way in ("north", "east", "down")), ("m/s", 1.0)),
    **dict.fromkeys((f"specific_force_{way}_m_s2" for way in ("forward", "right", "down")), ("m/s2", 1.0)),
}
# Each kind with its sentence; {} is the largest error, as three digits of it are shown.
KINDS = {
    "offset": ({"offset": 0.1}, "offset of {} at"),
    "drift": ({"rate_per_s": 0.05}, "drift of up to {} from 1.00 s on"),
    "settling drift": ({"kind": "drift", "settles_at": 0.2, "time_constant_s": 0.5}, "drift of up to {} from"),
    "scale": ({"factor": 0.5}, "scale error of up to {} from 1.00 s on"),
    "sign_reversal": ({}, "wrong sign from 1.00 s on, an error of up to {}"),
    "noise": ({"std": 0.1}, "noise of up to {} from"),
    "bias_instability": ({"std": 0.1, "time_constant_s": 1.0}, "unstable bias of up to {} from 1.00 s on"),
    "oscillation": ({"amplitude": 0.1, "frequency_hz": 2.0}, "oscillation of up to {} from 1.00 s on"),
    "spikes": ({"amplitude": 0.3, "times_s": [0.1]}, "spikes of up to {} from"),
    "quantisation": ({"step": 0.1}, "quantisation from 1.00 s on, an error of up to {}"),
    "delay": ({"latency_s": 0.1}, "delay from 1.00 s on, an error of up to {}"),
}


def fault(place: str, kind: str, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "signal": place, "start_s": 1.0, **more}


@cache
def unfaulted() -> CampaignFlight:
    return flown()


def loaded(*faults: dict[str, Any], sets: tuple[str, ...] = ()) -> Scenario:
    """Two seconds of an F-16."""
    which = scenario.load(None, ["duration_s=2", "faults=[]", *sets])
    return scenario.from_resolved({**which.resolved(), "faults": list(faults)}, "test")


def flown(*faults: dict[str, Any], sets: tuple[str, ...] = ()) -> CampaignFlight:
    return fly(loaded(*faults, sets=sets))


def scored(flight: CampaignFlight) -> Score:
    return score(flight.scenario, Table(flight.rows))


def shown(value: float) -> str:
    """Three digits, no exponent from 0.0001 on."""
    return f"{value:.2e}" if 0.0 < value < 1e-4 else f"{value:.0f}" if value >= 999.5 else f"{value:.3g}"


def test_every_quantity_of_the_inertial_unit_is_here():
    assert set(SHOWN) == set(INERTIAL)


@pytest.mark.parametrize("quantity", INERTIAL)
def test_an_offset_of_the_inertial_unit_is_told_in_the_unit_of_its_quantity(quantity: str):
    flight, (unit, times) = flown(fault(f"inertial.{quantity}", "offset", offset=0.25)), SHOWN[quantity]
    found = scored(flight)
    assert found.faults[0].peak_error == pytest.approx(0.25, rel=1e-9)
    label = "inertial unit, " + re.sub("_(rad_s|rad|m_s2|m_s|m)$", "", quantity).replace("_", " ")
    begin = f"{label}: offset of {shown(0.25 * times)} {unit} at 1.00 s"
    assert conclusion(flight.scenario, found)[1].startswith(begin)
    row = tables(found, flight.scenario.rate_hz)["faults"].rows[0]
    row = {column.name: column.of(row) for column in FAULTS}
    assert (row["peak error"], row["unit"]) == (shown(0.25 * times), unit)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("quantity", ["pitch_rate_rad_s", "velocity_north_m_s"])
def test_every_kind_is_told_by_the_size_that_it_has_at_its_place(quantity: str, name: str):
    settings, sentence = KINDS[name]
    flight, (unit, times) = flown(fault(f"inertial.{quantity}", **{"kind": name, **settings})), SHOWN[quantity]
    column = INERTIAL.index(quantity)
    errors = np.abs(flight.rows["inertial"] - unfaulted().rows["inertial"])[:, column]
    assert errors[:100].max() == 0.0 and errors.max() > 0.0
    found = scored(flight)
    assert found.faults[0].peak_error == errors.max()
    assert sentence.format(f"{shown(errors.max() * times)} {unit}") in conclusion(flight.scenario, found)[1]


def test_where_it_sticks_or_runs_to_is_told_in_its_own_unit():
    for settings, told in (
        ({"kind": "stuck", "value": -0.2}, "stuck at -11.5 deg/s at 1.00 s"),
        ({"kind": "hardover", "direction": "low"}, "hardover at 1.00 s"),
        ({"kind": "hardover", "ramp_s": 0.05}, "hardover at 1.00 s"),
    ):
        flight = flown(fault("inertial.yaw_rate_rad_s", **settings))
        assert conclusion(flight.scenario, scored(flight))[1].startswith(f"inertial unit, yaw rate: {told}")
    flight = flown(fault("inertial.velocity_north_m_s", "stuck", value=12.5))
    told = "inertial unit, velocity north: stuck at +12.5 m/s at 1.00 s"
    assert conclusion(flight.scenario, scored(flight))[1].startswith(told)


def test_a_quantity_that_is_gone_has_no_size():
    flight = flown(fault("inertial.pitch_rate_rad_s", "dropout"))
    found = scored(flight)
    assert found.faults[0].peak_error is None and found.faults[0].outcome == "detected"
    told = "inertial unit, pitch rate: no valid sample from 1.00 s on"
    assert conclusion(flight.scenario, found)[1].startswith(told)


def test_faults_of_one_quantity_share_its_error():
    place = "inertial.roll_rate_rad_s"
    flight = flown(fault(place, "offset", offset=0.1), fault(place, "offset", offset=0.3, id="other"))
    assert [each.peak_error for each in scored(flight).faults] == pytest.approx([0.4, 0.4])


def test_what_no_reference_reads_is_said_to_be_read_by_none():
    none = tuple(f"redundancy.references.{s.name}=none" for s in SIGNALS if not s.name.startswith(("stick", "pedal")))
    flight = flown(fault("inertial.pitch_rate_rad_s", "offset", offset=0.1), sets=none)
    found = scored(flight)
    assert (found.faults[0].outcome, found.faults[0].peak_error) == ("undetectable", pytest.approx(0.1))
    told = "offset of 5.73 deg/s at 1.00 s, not detectable: no reference reads it"
    assert told in conclusion(flight.scenario, found)[1]


@pytest.mark.parametrize(
    ("signal", "size", "told"),
    [
        ("pitch_rate", 0.1, "5.73 deg/s"),
        ("normal_load_factor", 0.3, "0.3 g"),
        ("static_pressure", 250.0, "250 Pa"),
        ("heading", 0.2, "11.5 deg"),
    ],
)
def test_a_fault_of_a_reference_is_told_without_the_references_own_error(signal: str, size: float, told: str):
    flight = flown(fault(f"reference.{signal}", "offset", offset=size))
    found = scored(flight)
    assert found.faults[0].peak_error == pytest.approx(size, rel=1e-6)
    begin = f"reference of {signal.replace('_', ' ')}: offset of {told} at 1.00 s"
    assert conclusion(flight.scenario, found)[1].startswith(begin)


@pytest.mark.parametrize("manager", ["cross-channel", "median"])
def test_references_by_the_recorded_votes_are_those_of_the_flight(manager: str):
    """Those of all other signals to the bit, and that of the faulty one as it was without its fault."""
    from rig.verdict.unfaulted import ReferredAgain

    sets = (f"redundancy.manager={manager}", "turbulence=light")
    flight = flown(fault("reference.roll_rate", "noise", std=0.2), sets=sets)
    healthy, p = flown(sets=sets), INDEX["roll_rate"]
    again = ReferredAgain(flight.scenario)
    parts = [again.of(flight.rows[k : k + 70].copy()) for k in range(0, len(flight.rows), 70)]
    assert np.concatenate(parts).tobytes() == np.ascontiguousarray(healthy.rows["reference"]).tobytes()
    errors = np.abs(flight.rows["reference"] - healthy.rows["reference"])[:, p]
    assert scored(flight).faults[0].peak_error == errors.max() > 0.2


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"signal": "surface.throttle", "kind": "offset", "offset": 0.2}, "offset of 0.2 at 1.00 s"),
        ({"signal": "surface.elevator", "kind": "offset", "offset": 0.1}, "offset of 5.73 deg at 1.00 s"),
        ({"signal": "surface.rudder", "kind": "stuck", "value": 0.1}, "stuck at +5.73 deg at 1.00 s"),
        ({"signal": "surface.throttle", "kind": "stuck", "value": 0.5}, "stuck at +0.5 at 1.00 s"),
    ],
)
def test_a_fault_of_a_surface_is_told_in_its_own_unit(settings: dict[str, Any], told: str):
    flight = flown({"start_s": 1.0, **settings})
    label = f"{settings['signal'].removeprefix('surface.')} surface"
    assert conclusion(flight.scenario, scored(flight))[1].startswith(f"{label}: {told}")


def test_what_was_kept_in_flight_gives_the_same_as_measuring_again():
    flight = flown(
        fault("inertial.pitch_rate_rad_s", "noise", std=0.1), fault("reference.roll_angle", "drift", rate_per_s=0.1)
    )
    kept = score(flight.scenario, flight.table)
    assert kept.as_dict() == scored(flight).as_dict() and kept.faults[0].peak_error


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"kind": "wrong_command", "signal": "computer.B", "surface": "elevator", "does": "offset", "offset": 0.1},
            "computer B: wrong command computed from 1.00 s on (offset 5.73 deg)",
        ),
        (
            {"kind": "dac", "signal": "computer.C", "surface": "throttle", "does": "offset", "offset": 0.1},
            "computer C: wrong command at its output from 1.00 s on (offset 0.1)",
        ),
        (
            {"kind": "wrong_command", "signal": "computer.B", "surface": "elevator", "does": "hardover"},
            "computer B: wrong command computed from 1.00 s on",
        ),
        (
            {"kind": "clock_drift", "signal": "computer.D", "drift_ppm": 500.0},
            "computer D: clock wrong from 1.00 s on (drift 500 ppm)",
        ),
        (
            {"kind": "link_byzantine", "signal": "ccdl.C-D", "offset_thresholds": 1.5},
            "link C-D: wrong samples transmitted from 1.00 s on (offset 1.5 thresholds)",
        ),
        (
            {"kind": "lvdt", "signal": "actuator.rudder", "channels": [2], "factor": 0.5},
            "rudder servo, channel 2: position sensor wrong from 1.00 s on (factor 0.5)",
        ),
        (
            {"kind": "leak", "signal": "actuator.aileron", "share": 0.3},
            "aileron servo: leak from 1.00 s on (share 0.3)",
        ),
        ({"kind": "hydraulic_loss", "signal": "hydraulics.2"}, "hydraulic system 2: pressure lost at 1.00 s"),
    ],
)
def test_faults_of_computers_links_and_servos_are_told_by_their_setting(settings: dict[str, Any], told: str):
    which = loaded({"start_s": 1.0, **settings}, sets=("computers.count=4", "actuators.model=servo"))
    beside: list[Any] = []
    rows = fly_rows(which, beside=beside)
    assert conclusion(which, score(which, Table(rows, np.concatenate(beside))))[1].startswith(told)
