"""Tables of a campaign with servo actuators: which monitor found which fault, and how soon."""

from __future__ import annotations

import polars as pl
import pytest

from rig.core.frame import Table
from rig.scenario.scenario import load
from rig.studies.campaign.flying import CampaignFlight, fly
from rig.studies.campaign.group_rates import by_kind
from rig.studies.campaign.tables import Row, shut_off
from rig.studies.campaign.tables import rows as campaign_rows
from rig.verdict.scoring import score

BASE = "f16_elevator_coil_hardover"
COIL = "{kind='coil_hardover', signal='actuator.elevator', channels=[2], start_s=1.0}"
OPEN = "{kind='coil_open', signal='actuator.rudder', channels=[4], start_s=0.5}"
STUCK = "{kind='sov_stuck', signal='actuator.elevator', channels=[2], start_s=0.2}"
LOSS = "{kind='hydraulic_loss', signal='hydraulics.1', start_s=1.0}"


@pytest.fixture(scope="module")
def flight() -> CampaignFlight:
    return fly(
        load(BASE, ["duration_s=2", "actuators.continuity.coverage=1.0", f"faults=[{COIL}, {OPEN}, {LOSS}, {STUCK}]"])
    )


@pytest.fixture(scope="module")
def rows(flight: CampaignFlight) -> list[Row]:
    return campaign_rows("faults", 0, flight.scenario, score(flight.scenario, flight.table))


def test_a_fault_of_a_channel_has_the_monitor_that_found_it_and_the_delay(rows: list[Row]) -> None:
    coil, wire, loss, _ = rows
    assert (coil["decided_by"], wire["decided_by"], loss["decided_by"]) == ("current", "continuity", None)
    assert 0.04 <= coil["delay_from_onset_s"] <= 0.06  # its persistence, 0.05 s
    assert 0.01 <= wire["delay_from_onset_s"] <= 0.03  # 0.02 s


def test_a_stuck_valve_is_found_by_its_own_monitor_once_the_channel_is_shut_off(rows: list[Row]) -> None:
    coil, *_, valve = rows
    assert (valve["kind"], valve["decided_by"]) == ("sov_stuck", "valve")
    assert 0.04 <= valve["failed_s"] - coil["failed_s"] <= 0.06  # its persistence, 0.05 s


def test_a_run_counts_channels_that_were_shut_off_and_those_without_a_fault(flight: CampaignFlight) -> None:
    row = campaign_rows("runs", 0, flight.scenario, score(flight.scenario, Table(flight.table.rows)), flight)[0]
    assert (row["coils_failed"], row["healthy_coils_failed"]) == (2, 0)
    others = {"elevator": {1: (1.5, "spool"), 2: (1.04, "current")}}
    assert shut_off(flight.scenario, others) == (2, 1)


def test_a_channel_that_its_lane_drives_wrongly_is_no_healthy_one() -> None:
    dac = "{kind='dac', signal='computer.B', surface='elevator', does='hardover', start_s=1.0}"
    given = load(BASE, ["computers.count=4", f"faults=[{dac}]"])
    failed = {"elevator": {2: (1.1, "spool"), 3: (1.1, "spool")}, "rudder": {2: (1.1, "spool")}}
    assert shut_off(given, failed) == (3, 2)


def test_a_flight_without_servos_has_none_of_the_columns(flight: CampaignFlight) -> None:
    assert shut_off(load(None), {}) is None


def test_a_report_counts_kinds_by_their_monitors() -> None:
    faults = pl.DataFrame(
        {
            "kind": ["lvdt", "lvdt", "lvdt", "offset"],
            "signal": ["actuator.rudder"] * 3 + ["pitch_rate"],
            "onset_s": [1.0, 1.0, 1.0, 1.0],
            "decided_by": ["position", "ram", None, None],
            "delay_from_onset_s": [0.1, 0.3, None, None],
        }
    )
    [row] = by_kind(faults)
    assert (row["kind"], row["acted"], row["found"]["count"], row["longest_s"]) == ("lvdt", 3, 2, 0.3)
    assert set(row["by"].split(", ")) == {"position 1", "ram 1"}
