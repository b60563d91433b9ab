"""Faults of servo actuators: what each does to its part, in flight and against the equations."""

from typing import Any

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.core.frame import MOVED, ActuatorMonitor, End
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.world.faults.servo_parts import Part, whole_parts

SERVO = 'actuators.model="servo"'
ONSET_S, RATE_HZ = 2.0, 100.0
ONSET = int(ONSET_S * RATE_HZ)


def flown(*faults: str, seconds: float = 4.0, sets: tuple[str, ...] = ()) -> tuple[Any, Any, Any]:
    """Rows, rows of the servos and broken parts (frames, 3, Part, 4) of an F-16 in level flight with ``faults``."""
    tables = ", ".join(f"{{{fault}, start_s={ONSET_S}}}" for fault in faults)
    given = scenario.load(None, [SERVO, f"duration_s={seconds}", f"faults=[{tables}]", *sets])
    rig, rows, servos, broken = Rig(given), [], [], []
    step = rig.computer_step

    def watched(block: Any, k: int, data: Any) -> None:
        step(block, k, data)
        broken.append(rig.actuators.data.broken.copy())  # pyright: ignore[reportOptionalMemberAccess]

    rig.computer_step = watched
    for block, _ in frames(rig, given):
        rows.append(block.copy())
        servos += rig.beside(len(block))
    return np.concatenate(rows), np.concatenate(servos)["servo"], np.array(broken)


WHOLE = whole_parts()
CASES = {
    'kind="coil_open", signal="actuator.elevator", channels=[4]': [(Part.COMMANDED, 3, 0.0), (Part.OPEN_SEEN, 3, 1.0)],
    'kind="coil_hardover", signal="actuator.elevator", channels=[2], direction="low"': [
        (Part.COMMANDED, 1, 0.0),
        (Part.ADDED, 1, -1.0),
    ],
    'kind="lvdt", signal="actuator.elevator", channels=[1], offset=0.01': [(Part.OFFSET, 0, 0.01)],
    'kind="lvdt", signal="actuator.elevator", channels=[1], factor=0.4': [(Part.FACTOR, 0, 0.4)],
    'kind="lvdt", signal="actuator.elevator", channels=[1], stuck=true': [(Part.STUCK, 0, 1.0)],
    'kind="sov_stuck", signal="actuator.elevator", channels=[3]': [(Part.VALVE_STUCK, 2, 1.0)],
    'kind="spool_jam", signal="actuator.elevator"': [(Part.JAMMED, 0, 1.0)],
    'kind="leak", signal="actuator.elevator", share=0.3': [(Part.LEFT, 0, 0.7)],
    'kind="hydraulic_loss", signal="hydraulics.2", share=0.6': [(Part.PRESSURE, 1, 0.4)],
}


@pytest.mark.parametrize("fault", CASES)
def test_a_fault_changes_its_part_from_its_onset_on_and_no_other(fault: str):
    rows, _, broken = flown(fault, seconds=2.5, sets=("actuators.continuity.coverage=1.0",))
    assert (broken[:ONSET] == WHOLE).all() and not rows["acting"][:ONSET].any() and rows["acting"][ONSET:].any(1).all()
    expected = WHOLE.copy()
    for part, column, value in CASES[fault]:
        expected[0, part, column] = value
    assert broken[ONSET:] == pytest.approx(np.broadcast_to(expected, broken[ONSET:].shape))


@pytest.mark.parametrize(("mode", "commanded"), [("liquid", 1.0), ("solid", 0.0)])
def test_an_oscillatory_failure_is_a_sine_with_the_current_or_in_its_place(mode: str, commanded: float):
    fault = f'kind="oscillatory_failure", signal="actuator.aileron", channels=[2], mode="{mode}", amplitude=0.2, '
    _, _, broken = flown(fault + "frequency_hz=3.0", seconds=3.0)
    t = np.arange(len(broken) - ONSET) / RATE_HZ
    assert broken[ONSET:, 1, Part.ADDED, 1] == pytest.approx(0.2 * np.sin(2 * np.pi * 3.0 * t), abs=1e-9)
    assert (broken[ONSET:, 1, Part.COMMANDED, 1] == commanded).all()


def test_a_leak_and_a_loss_of_pressure_grow_over_their_ramps():
    ramps = (
        'kind="leak", signal="actuator.rudder", share=1.0, ramp_s=1.0',
        'kind="hydraulic_loss", signal="hydraulics.1", ramp_s=0.5',
    )
    _, _, broken = flown(*ramps, seconds=3.5)
    t = np.arange(len(broken) - ONSET) / RATE_HZ
    assert broken[ONSET:, 2, Part.LEFT, 0] == pytest.approx(np.clip(1 - t, 0, 1), abs=1e-9)
    assert broken[ONSET:, 0, Part.PRESSURE, 0] == pytest.approx(np.clip(1 - 2 * t, 0, 1), abs=1e-9)


def test_a_wire_is_seen_to_be_open_as_often_as_its_monitor_covers():
    fault = 'kind="coil_open", signal="actuator.elevator", channels=[4]'
    seen = [
        flown(fault, seconds=2.1, sets=(f"seed={seed}", "actuators.continuity.coverage=0.5"))[2][
            -1, 0, Part.OPEN_SEEN, 3
        ]
        for seed in range(24)
    ]
    assert 4 <= sum(seen) <= 20  # 1e-3 outside


def test_a_fault_with_an_end_leaves_its_part_whole_again():
    fault = 'kind="lvdt", signal="actuator.elevator", channels=[1], offset=0.004, duration_s=0.5'
    _, servos, broken = flown(fault, seconds=3.0)
    assert (broken[ONSET + 50 :] == WHOLE).all() and not servos["failed_by"].any()


def test_a_stuck_position_sensor_stays_at_its_last_value():
    _, servos, _ = flown(
        'kind="lvdt", signal="actuator.elevator", channels=[1], stuck=true', sets=('turbulence="severe"',)
    )
    held = servos["lvdt"][ONSET:, 0, 0]
    assert (held == held[0]).all() and np.ptp(servos["lvdt"][ONSET:, 0, 1]) > 0


def test_a_fault_of_the_surface_comes_behind_the_servo():
    rows, servos, _ = flown('kind="offset", signal="surface.elevator", offset=0.002', seconds=3.0)
    off = rows["surface_command"][:, 0] - servos["ram"][:, 0]
    assert (off[:ONSET] == 0).all() and off[ONSET:] == pytest.approx(0.002)


@pytest.mark.parametrize("surface", MOVED)
@pytest.mark.parametrize(
    ("fault", "monitor"),
    [
        ('kind="coil_hardover"', ActuatorMonitor.CURRENT),
        ('kind="coil_open"', ActuatorMonitor.CONTINUITY),
        ('kind="lvdt", offset=0.09', ActuatorMonitor.POSITION),
    ],
)
def test_one_channel_is_found_and_the_aircraft_flies_on(surface: str, fault: str, monitor: ActuatorMonitor):
    sets = ("actuators.continuity.coverage=1.0",)
    rows, servos, _ = flown(f'{fault}, signal="actuator.{surface}", channels=[3]', seconds=6.0, sets=sets)
    failed = servos["failed_by"][-1]
    assert rows["end"][-1] == End.FLYING and failed[MOVED.index(surface), 2] == monitor
    assert np.count_nonzero(failed) == 1


def test_two_coils_that_run_away_lose_the_aircraft_without_monitors_alone():
    both = 'kind="coil_hardover", signal="actuator.elevator", channels=[1, 2]'
    assert flown(both, seconds=8.0)[0]["end"][-1] == End.FLYING
    assert flown(both, seconds=8.0, sets=("actuators.monitors=false",))[0]["end"][-1] != End.FLYING


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (
            ['faults=[{kind="spool_jam", signal="actuator.elevator", channels=[1], start_s=1.0}]', SERVO],
            "channels: spool_jam acts on a part that all channels of actuator.elevator share, give none, got",
        ),
        (['faults=[{kind="coil_open", signal="actuator.elevator", channels=[5], start_s=1.0}]', SERVO], "1 to 4"),
        (
            ['faults=[{kind="coil_open", signal="actuator.elevato", channels=[1], start_s=1.0}]', SERVO],
            "no such actuator, allowed: actuator.elevator, actuator.aileron, actuator.rudder, got 'actuator.elevato'",
        ),
        (['faults=[{kind="hydraulic_loss", signal="hydraulics.3", start_s=1.0}]', SERVO], "no such hydraulic system"),
        (
            ['faults=[{kind="leak", signal="pitch_rate", share=0.5, start_s=1.0}]', SERVO],
            "leak cannot act on pitch_rate",
        ),
        (['faults=[{kind="coil_open", signal="actuator.elevator", channels=[1], start_s=1.0}]'], "needs servos"),
        ([SERVO, "actuators.spool_rad_s=50"], "at least 4"),
        ([SERVO, "actuators.sppool.threshold=0.2"], "actuators.sppool: unknown key; nearest: spool"),
        ([SERVO, "actuators.current.treshold=0.2"], "actuators.current.treshold: unknown key; nearest: threshold"),
        (["aircraft=b707", "flight_point=35000ft_m08", "faults=[]", SERVO], "a linear aircraft has no servos"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(sets: list[str], message: str):
    with pytest.raises(BadInput, match=message) as refused:
        scenario.load(None, sets)
    assert "\n" not in str(refused.value)


def test_one_key_of_a_limit_leaves_its_other_key_as_it_was():
    limit = scenario.load(None, [SERVO, "actuators.ram.threshold=0.05"]).actuators.ram
    assert (limit.threshold, limit.persistence_s) == (0.05, 0.1)
