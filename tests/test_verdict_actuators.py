"""What became of faults of servo actuators: who found them when, who was failed wrongly, what it cost."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core.frame import MOVED, ActuatorMonitor, Table
from rig.flight.conclusion_rows import Conclusion
from rig.flight.fly import fly
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.scenario.scenario import Scenario
from rig.verdict.conclusion import conclusion
from rig.verdict.of_log import FlightConclusion, score_log
from rig.verdict.score_records import Score, Yardstick
from rig.verdict.scoring import score

ONSET_S, RATE_HZ = 1.0, 100.0
ONSET = int(ONSET_S * RATE_HZ)
HARDOVER = 'kind="coil_hardover", signal="actuator.elevator", channels=[2]'
JAM = 'kind="spool_jam", signal="actuator.elevator"'
PULL = "pilot.stick_pitch=[{time_s=1.1,value=0.5}]"


def given(faults: tuple[str, ...], sets: tuple[str, ...] = (), seconds: float = 2.0) -> list[str]:
    tables = ", ".join(f"{{{fault}{'' if 'start_s' in fault else f', start_s={ONSET_S}'}}}" for fault in faults)
    return ['actuators.model="servo"', f"duration_s={seconds}", f"faults=[{tables}]", *sets]


@cache
def flown(*faults: str, sets: tuple[str, ...] = (), seconds: float = 2.0) -> tuple[Scenario, Any, Any]:
    """The scenario, rows and second rows of an F-16 in level flight with ``faults``; never to be written."""
    which = scenario.load(None, given(faults, sets, seconds))
    rig, rows, beside = Rig(which), [], []
    for block, _ in frames(rig, which):
        rows.append(block.copy())
        beside += rig.beside(len(block))
    return which, np.concatenate(rows), np.concatenate(beside)


def scored_flight(*faults: str, **more: Any) -> tuple[Score, Conclusion]:
    which, rows, beside = flown(*faults, **more)
    scored = score(which, Table(rows, beside))
    return scored, conclusion(which, scored)


def test_a_runaway_coil_is_found_by_its_current_when_the_persistence_is_over():
    scored, told = scored_flight(HARDOVER)
    (fault,) = scored.faults
    # wrong from the onset on, for five frames, the onset's counted
    assert (fault.outcome, fault.decided_by, fault.exceeded_frame, fault.failed_frame) == (
        "detected", "current", ONSET, ONSET + 4,
    )  # fmt: skip
    (failure,) = scored.actuators["elevator"].failures
    assert (failure.channel, failure.frame, failure.monitor, failure.cause) == (2, ONSET + 4, "current", "own fault")
    assert told[1] == (
        "elevator servo, channel 2: full coil current at 1.00 s, isolated after 40 ms by the current monitor"
    )
    assert "1 of 1 faults detected, no healthy channel isolated" in told[0]


def test_a_fault_of_a_channel_of_an_actuator_is_none_of_a_signal():
    scored, told = scored_flight(HARDOVER)
    assert scored.faults[0].window is None and "voted values: all 16 within their error limits" in told


def test_a_loss_of_pressure_is_not_found_since_the_models_know_the_pressures():
    scored, told = scored_flight('kind="hydraulic_loss", signal="hydraulics.1"')
    assert scored.faults[0].outcome == "undetectable"
    assert told[1] == "hydraulic system 1: pressure lost at 1.00 s, not isolated: no monitor threshold was exceeded"


def test_both_hydraulic_systems_cost_every_surface_at_once():
    scored, told = scored_flight(*(f'kind="hydraulic_loss", signal="hydraulics.{n}"' for n in (1, 2)))
    assert all(one.bypassed_frame == ONSET for one in scored.actuators.values())
    assert scored.faults[0].bypassed == MOVED and "elevator, aileron and rudder bypassed at once" in told[1]
    assert [fault.outcome for fault in scored.faults] == ["missed", "missed"], "who took every surface is to be found"
    assert "0 of 2 faults detected" in told[0] and "no monitor threshold was exceeded" in told[1]


def test_a_jam_fails_all_channels_and_costs_the_surface_when_the_last_one_is_shut_off():
    which, rows, beside = flown(JAM, sets=('turbulence="severe"',), seconds=5.0)
    scored = score(which, Table(rows, beside))
    by = beside["servo"]["failed_by"][:, 0]
    failed = [int(np.argmax(by[:, c] != 0)) for c in range(4)]
    assert by[-1].all() and scored.faults[0].failed_frame == min(failed)
    assert scored.faults[0].bypassed_frame == scored.actuators["elevator"].bypassed_frame == max(failed)
    assert [one.cause for one in scored.actuators["elevator"].failures] == ["own fault"] * 4
    assert not scored.false_alarms and not scored.wrong_isolations


def test_a_stuck_valve_is_found_when_the_channel_is_to_be_shut_off():
    stuck = 'kind="sov_stuck", signal="actuator.elevator", channels=[2]'
    alone, said = scored_flight(stuck)
    assert alone.faults[0].outcome == "undetectable" and "the channel was not shut off" in said[1]
    scored, told = scored_flight(stuck, HARDOVER)
    valve, coil = scored.faults
    assert (coil.decided_by, coil.failed_frame) == ("current", ONSET + 4)
    # sensed from the next frame on, then for five frames
    assert (valve.decided_by, valve.failed_frame) == ("valve", ONSET + 9)
    assert "detected after 90 ms by the switch of the valve" in told[1]
    assert scored.actuators["elevator"].valves_differ == {2: ONSET + 9}


def test_without_monitors_nothing_is_detected_and_that_is_said():
    scored, told = scored_flight(HARDOVER, sets=("actuators.monitors=false",))
    assert scored.faults[0].outcome == "missed" and not scored.faults[0].tolerated
    assert "not isolated: the monitors are switched off" in told[1]
    assert "0 of 1 faults detected" in told[0]


def test_a_fault_shorter_than_the_persistence_is_tolerated():
    scored, told = scored_flight(f"{HARDOVER}, duration_s=0.03")
    # three frames by its current, and one by the spool, which shows what was before
    assert scored.faults[0].tolerated and scored.faults[0].exceeded_run_frames == 4
    assert "a monitor threshold was exceeded for 40 ms, shorter than the persistence" in told[1]


@pytest.mark.parametrize(
    ("surface", "kind", "field", "words"),
    [
        (0, "wrong isolation", "wrong_isolations", "faulty: 2"),
        (1, "false alarm", "false_alarms", "faulty: no channel"),
    ],
)
def test_a_healthy_channel_that_is_shut_off_is_told(surface: int, kind: str, field: str, words: str):
    which, rows, beside = flown(HARDOVER)
    tampered = beside.copy()
    tampered["servo"]["failed_by"][ONSET + 12 :, surface, 2] = ActuatorMonitor.RAM
    scored, name = score(which, Table(rows, tampered)), MOVED[surface]
    (one,) = getattr(scored, field)
    assert (one.signal, one.channel, one.frame, one.decided_by) == (f"actuator.{name}", 3, ONSET + 12, "ram")
    assert scored.actuators[name].failures[-1].cause == kind
    told = conclusion(which, scored)
    assert told[1] == f"{name} servo, channel 3: healthy, isolated by mistake at 1.12 s by the ram monitor ({words})"
    assert "1 healthy channel isolated" in told[0]
    assert scored.faults[0].word == ("wrong channel" if surface == 0 else "isolated")


def test_a_threshold_that_noise_leaves_gives_false_alarms_of_a_flight_without_faults():
    scored, told = scored_flight(sets=("actuators.ram.threshold=1e-5",))
    assert len(scored.false_alarms) == 12 and {one.decided_by for one in scored.false_alarms} == {"ram"}
    assert "no fault injected, 12 healthy channels isolated" in told[0]


def test_rows_without_those_of_the_servos_are_not_scored():
    which, rows, _ = flown(HARDOVER)
    scored = score(which, Table(rows))
    assert scored.actuators == {} and "not scored: the log has no rows of the servos" in conclusion(which, scored)[1]


def test_the_command_lists_the_channels_of_actuators_among_the_failed(tmp_path: Path):
    sets = [part for text in given((HARDOVER,)) for part in ("--set", text)]
    result = CliRunner().invoke(app, ["fly", *sets, "--out", str(tmp_path)])
    assert result.exit_code == 0 and "isolated elevator servo channel 2\n" in result.stdout
    assert "isolated after 40 ms by the current monitor" in result.stdout


def test_a_flight_and_its_log_have_one_conclusion(tmp_path: Path):
    flight = fly(None, overrides=given((HARDOVER,)), out=tmp_path, outcome=FlightConclusion())
    scored = score_log(flight.log, Yardstick(), baseline=False)
    assert flight.conclusion == scored.conclusion
    assert flight.conclusion and "after 40 ms by the current monitor" in flight.conclusion[1]
    assert scored.as_dict()["actuators"]["elevator"]["failures"][0]["monitor"] == "current"
