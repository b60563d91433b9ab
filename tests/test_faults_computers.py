"""Faults of computers and buses in flight: what each does, who finds it, after how long, and what the lanes do then."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from rig import scenario
from rig.errors import BadInput
from rig.frame import COMPUTERS, INDEX, MOVED, SURFACES, Health, LaneBlock, LaneTest
from rig.loop import fly_rows
from rig.sensors import ranges

SERVO = 'actuators.model="servo"'
ONSET = 30  # frames
Q = INDEX["pitch_rate"]


class Flown(NamedTuple):
    """A short flight of four computers with servos."""

    rows: Any  # (n,)
    lanes: LaneBlock  # (n,)

    def health(self, lane: str) -> list[int]:
        return self.lanes["computer"]["health"][:, COMPUTERS.index(lane)].tolist()

    def first(self, lane: str, health: Health) -> int:
        return self.health(lane).index(health)

    def failed_for(self, lane: str) -> LaneTest:
        return LaneTest(self.lanes["computer"]["failed_for"][-1, COMPUTERS.index(lane)])

    def others_engaged(self, lane: str) -> bool:
        others = [i for i, name in enumerate(COMPUTERS) if name not in lane]
        return bool(np.isin(self.lanes["computer"]["health"][-1, others], (Health.ENGAGED, Health.SUSPECT)).all())


@cache
def flown(*faults: str, sets: tuple[str, ...] = (), seconds: float = 1.0) -> Flown:
    """Fly the faults, which begin at frame ONSET unless they say otherwise."""
    entries = [fault if "start_s" in fault else f"{fault}, start_s={ONSET / 100}" for fault in faults]
    given = [SERVO, "computers.count=4", f"duration_s={seconds}", f"faults=[{','.join(f'{{{e}}}' for e in entries)}]"]
    lanes: list[LaneBlock] = []
    rows = fly_rows(scenario.load(None, [*given, *sets]), lanes=lanes)
    return Flown(rows, np.concatenate(lanes))


STOP = 'kind="computer_stop", signal="computer.A"'
WRONG = 'kind="wrong_command", signal="computer.B", surface="elevator", does="hardover"'
DAC = 'kind="dac", signal="computer.C", surface="aileron", does="offset", offset=0.2'
SURE = ("computers.wrap_around.coverage=1.0", "computers.reference_voltage.coverage=1.0")


def test_a_lane_that_stops_is_failed_by_its_watchdog_and_the_next_one_leads():
    """Persistence 0.02 s: failed in its second frame without a computation."""
    flight = flown(STOP)
    assert flight.first("A", Health.FAILED) == ONSET + 1 and flight.failed_for("A") is LaneTest.WATCHDOG
    leads = flight.lanes["computer"]["leads"]
    assert leads[:ONSET, 0].all() and leads[ONSET:, 1].all() and (leads.sum(axis=1) == 1).all()
    assert (flight.lanes["computer"]["voted"][ONSET:, 0] == flight.lanes["computer"]["voted"][ONSET - 1, 0]).all()
    assert flight.others_engaged("A")


def test_without_its_watchdog_the_others_accuse_a_silent_lane_for_the_link():
    """Silent for 0.05 s: five frames without a message, accused in the fifth, failed a frame later."""
    flight = flown(STOP, sets=("computers.watchdog.coverage=0.0",))
    assert flight.first("A", Health.FAILED) == ONSET + 5 and flight.failed_for("A") is LaneTest.LINK
    assert (flight.lanes["computer"]["accuses"][ONSET + 4, 1:, 0] == LaneTest.LINK).all()


def test_a_failed_lane_shuts_its_servo_channels_off_and_no_monitor_trips():
    flight = flown(STOP)
    valve = flight.lanes["actuator"]["valve"]
    assert not valve[:ONSET].any() and valve[ONSET + 1 :, :, 0].all() and not valve[:, :, 1:].any()
    assert not flight.lanes["actuator"]["failed_by"].any() and not flight.lanes["actuator"]["valve_differs"].any()


def test_a_wrong_command_is_accused_by_all_others_and_fails_a_frame_later():
    """Persistence 0.05 s, five frames, and a frame until the accusations count."""
    flight = flown(WRONG)
    accused = flight.lanes["computer"]["accuses"][:, :, 1]
    assert flight.first("B", Health.FAILED) == ONSET + 5 and flight.failed_for("B") is LaneTest.COMMANDS
    assert (accused[ONSET + 4, [0, 2, 3]] == LaneTest.COMMANDS).all() and not accused[: ONSET + 4].any()
    assert flight.others_engaged("B")


def test_what_is_voted_is_the_median_of_four_commands_while_one_is_wrong():
    flight = flown(WRONG)
    told, put = flight.lanes["computer"]["surface"][:, :, 0], flight.lanes["computer"]["output"][:, :, 0]
    assert told[ONSET, 1] == pytest.approx(scenario.load(None).airframe.elevator.max_rad)
    wrong = slice(ONSET, ONSET + 5)
    assert put[wrong] == pytest.approx(np.repeat(np.median(told[wrong], axis=1)[:, None], 4, axis=1), abs=1e-12)
    assert (flight.lanes["actuator"]["asked"][wrong, 0] == put[wrong]).all()


def test_with_output_own_each_lane_drives_its_coils_with_its_own_command():
    flight = flown(WRONG, sets=('computers.output="own"',))
    asked, told = flight.lanes["actuator"]["asked"], flight.lanes["computer"]["surface"]
    assert (asked == told[:, :, :3].transpose(0, 2, 1)).all()
    assert flight.first("B", Health.FAILED) == ONSET + 5


@pytest.mark.parametrize("does", ['does="stuck"', 'does="oscillation", amplitude=0.3, frequency_hz=5.0'])
def test_a_command_that_sticks_or_oscillates_is_what_it_says(does: str):
    fault = f'kind="wrong_command", signal="computer.D", surface="elevator", {does}'
    flight = flown(fault, sets=("computers.command_threshold=1.0",))
    told, right = flight.lanes["computer"]["surface"][:, 3, 0], flight.lanes["computer"]["surface"][:, 1, 0]
    if "stuck" in does:
        assert (told[ONSET:] == told[ONSET - 1]).all()
    else:
        t = np.arange(len(told) - ONSET) / 100
        assert told[ONSET:] - right[ONSET:] == pytest.approx(0.3 * np.sin(2 * np.pi * 5.0 * t), abs=1e-9)


@pytest.mark.parametrize(("coverage", "found"), [(1.0, True), (0.0, False)])
def test_the_wrap_around_finds_an_output_converter_by_its_coverage(coverage: float, found: bool):
    """Persistence 0.03 s: in the third frame.  Without it the monitors of the servo find the channel."""
    flight = flown(DAC, sets=(f"computers.wrap_around.coverage={coverage}",))
    out = flight.lanes["computer"]["output"][:, :, 1]
    assert out[ONSET, 2] - out[ONSET, 0] == pytest.approx(0.2, abs=1e-9)
    if found:
        assert flight.first("C", Health.FAILED) == ONSET + 2 and flight.failed_for("C") is LaneTest.WRAP_AROUND
    else:
        assert flight.failed_for("C") is LaneTest.NONE
        assert flight.lanes["actuator"]["failed_by"][-1, MOVED.index("aileron"), 2] != 0


@pytest.mark.parametrize(
    ("says", "test"),
    [
        ('says="zero"', LaneTest.WRAP_AROUND),
        ('says="last"', LaneTest.WRAP_AROUND),
        ('says="scale", factor=0.9', LaneTest.REFERENCE_VOLTAGE),
        ('says="offset", offset=0.05', LaneTest.REFERENCE_VOLTAGE),
        ('says="offset", offset=0.01', LaneTest.NONE),  # within the converter's tolerance
    ],
)
def test_an_input_converter_is_wrong_in_its_own_channel_of_all_signals(says: str, test: LaneTest):
    flight, healthy = flown(f'kind="adc", signal="computer.B", {says}', sets=SURE), flown(sets=SURE)
    own, clean = (f.rows["channels"][ONSET, :, 1] for f in (flight, healthy))
    low, high = ranges(scenario.load(None).sensors).T
    expected = {
        "zero": np.clip(0.0, low, high),
        "last": healthy.rows["channels"][ONSET - 1, :, 1],
        "scale": np.clip(0.9 * clean, low, high),
    }
    name = says.split('"')[1]
    if name in expected:
        assert own == pytest.approx(np.broadcast_to(expected[name], own.shape), abs=1e-9)
    assert (np.delete(flight.rows["channels"][ONSET], 1, 1) == np.delete(healthy.rows["channels"][ONSET], 1, 1)).all()
    assert flight.failed_for("B") is test
    if test:
        assert flight.first("B", Health.FAILED) == ONSET + 2  # 0.03 s


def test_a_damaged_program_is_found_at_the_end_of_the_period_of_its_checksum():
    sets = ("computers.checksum_period_s=0.5", "computers.command_threshold=1.0")
    flight = flown('kind="checksum", signal="computer.D", factor=0.9', sets=sets)
    told = flight.lanes["computer"]["surface"]
    assert told[ONSET, 3] == pytest.approx(0.9 * told[ONSET, 0], rel=1e-9)
    assert flight.first("D", Health.FAILED) == 49 and flight.failed_for("D") is LaneTest.CHECKSUM


def test_a_clock_that_drifts_is_accused_by_a_majority_once_it_is_out_of_the_window():
    """0.1 frame a frame and half of it taken out: 0.2 frame apart in the end; armed after 0.5 s, then 0.05 s."""
    flight = flown('kind="clock_drift", signal="computer.C", drift_ppm=100000.0, start_s=0.7')
    failed = flight.first("C", Health.FAILED)
    assert flight.failed_for("C") is LaneTest.CLOCK and 75 <= failed <= 77 and flight.others_engaged("C")
    lead = flight.lanes["computer"]["clock_lead"]
    assert lead[failed - 1, 2] - lead[failed - 1, 0] == pytest.approx(0.2, abs=0.01)


def test_a_bus_takes_two_lanes_and_all_their_samples_and_the_other_two_fly_on():
    flight = flown('kind="power_loss", signal="bus.2"')
    assert flight.first("B", Health.FAILED) == flight.first("D", Health.FAILED) == ONSET + 1
    bus = flight.rows["valid"][ONSET:]
    assert not bus[:, :, [1, 3]].any() and bus[:, :, [0, 2]].all()
    assert np.isnan(flight.rows["channels"][ONSET:, :, [1, 3]]).all()
    assert not flight.rows["discrete_valid"][ONSET:][:, :, [1, 3]].any() and flight.others_engaged("BD")


def test_nobody_finds_what_all_lanes_compute_alike_and_the_pilot_takes_the_back_up():
    software = 'kind="software", signal="computer.all", surface="elevator", does="offset", offset=-0.02'
    flight = flown(software, sets=('computers.commands=[{at_s=0.6, do="backup"}]',))
    assert not flight.lanes["computer"]["failed_for"].any() and not flight.lanes["computer"]["accuses"].any()
    leads = np.any(flight.lanes["computer"]["leads"], axis=1)
    assert leads[:60].all() and not leads[60:].any()
    sticks = [INDEX[name] for name in ("stick_pitch", "stick_roll", "pedal")]
    others = [s for s in range(len(INDEX)) if s not in sticks]
    assert (flight.rows["level"][60:][:, sticks] == 4).all() and not flight.rows["level"][60:][:, others].any()
    asked = flight.lanes["actuator"]["asked"][60:]
    assert (asked == flight.rows["surface"][60:, :3, None]).all()  # the back-up drives all coils


def test_a_lane_that_starts_again_takes_over_the_leading_ones_state_and_waits_for_the_command():
    """Equal to lane B bit for bit from its second frame on; readmission before ``rejoin_s`` is refused."""
    commands = 'computers.commands=[{at_s=0.6, do="readmit", lane="A"}, {at_s=1.2, do="readmit", lane="A"}]'
    flight = flown(f"{STOP}, duration_s=0.1", sets=(commands, "computers.rejoin_s=0.5"), seconds=1.5)
    again = flight.first("A", Health.RESTARTING)
    assert again == ONSET + 10
    for name in ("voted", "level", "surface", "integral"):
        one, other = flight.lanes["computer"][name][again + 1 :, 0], flight.lanes["computer"][name][again + 1 :, 1]
        assert (one == other).all(), name
    assert set(flight.health("A")[again:120]) == {Health.RESTARTING}  # 0.2 s after it started: refused
    assert set(flight.health("A")[120:]) <= {Health.ENGAGED, Health.SUSPECT}
    valve = flight.lanes["actuator"]["valve"][:, 0, 0]
    assert valve[119] and not valve[121:].any() and not flight.lanes["actuator"]["failed_by"].any()


def test_the_pilot_disengages_a_lane():
    flight = flown(sets=('computers.commands=[{at_s=0.5, do="disengage", lane="C"}]',))
    assert flight.first("C", Health.OFF) == 50 and flight.failed_for("C") is LaneTest.COMMANDED
    assert flight.lanes["actuator"]["valve"][50:, :, 2].all() and flight.others_engaged("C")


def test_two_lanes_that_differ_and_no_test_that_tells_lead_to_the_back_up_not_to_a_coin():
    """B and C are off; of A and D one is wrong: 0.1 s unresolved, then the back-up flies."""
    off = 'computers.commands=[{at_s=0.1, do="disengage", lane="B"}, {at_s=0.1, do="disengage", lane="C"}]'
    flight = flown('kind="wrong_command", signal="computer.D", surface="elevator", does="hardover"', sets=(off,))
    leads = np.any(flight.lanes["computer"]["leads"], axis=1)
    assert leads[: ONSET + 10].all() and not leads[ONSET + 10 :].any()
    assert not np.isin(flight.lanes["computer"]["failed_for"][-1, [0, 3]], (LaneTest.COMMANDS,)).any()
    put = flight.lanes["computer"]["output"][ONSET : ONSET + 10, 0, 0]
    assert np.ptp(put) < 0.01  # the vote holds meanwhile


def test_two_lanes_that_differ_are_settled_by_a_test_of_one_of_them():
    off = 'computers.commands=[{at_s=0.1, do="disengage", lane="B"}, {at_s=0.1, do="disengage", lane="C"}]'
    faults = ('kind="adc", signal="computer.D", says="zero"',)
    flight = flown(*faults, sets=(off, *SURE))
    assert flight.failed_for("D") is LaneTest.WRAP_AROUND and flight.lanes["computer"]["leads"][-1, 0]


def test_four_lanes_lost_one_after_the_other_leave_the_back_up():
    faults = (
        'kind="wrong_command", signal="computer.A", surface="elevator", does="hardover", start_s=0.2',
        'kind="computer_stop", signal="computer.B", start_s=0.5',
        'kind="link_loss", signal="ccdl.C", start_s=0.8',
        'kind="dac", signal="computer.D", surface="elevator", does="hardover", start_s=1.1',
    )
    flight = flown(*faults, sets=SURE, seconds=2.0)
    found = [flight.failed_for(name) for name in COMPUTERS]
    assert found == [LaneTest.COMMANDS, LaneTest.WATCHDOG, LaneTest.LINK, LaneTest.WRAP_AROUND]
    assert [flight.first(name, Health.FAILED) for name in COMPUTERS] == [25, 51, 85, 112]
    assert flight.lanes["computer"]["leads"][112, 3] and not flight.lanes["computer"]["leads"][113:].any()
    assert not flight.lanes["actuator"]["valve"][114:, :, :3].any()  # it drives the channels of all lanes


def test_a_healthy_flight_of_lanes_whose_clocks_drift_trips_nobody():
    flight = flown(sets=("computers.clock_drift_ppm=100", "turbulence=severe"), seconds=3.0)
    assert (flight.lanes["computer"]["health"] == Health.ENGAGED).all()
    assert not flight.lanes["computer"]["accuses"].any() and not flight.lanes["actuator"]["failed_by"].any()


def test_with_the_lag_the_actuator_gets_the_median_of_what_engaged_lanes_put_out():
    flight = flown(DAC, sets=('actuators.model="lag"', "computers.wrap_around.coverage=0.0"))
    put = flight.lanes["computer"]["output"]
    assert flight.rows["actuator"] == pytest.approx(np.median(put, axis=1), abs=1e-15)
    assert put.shape[2] == len(SURFACES)


COUNT = "computers.count=4"
BAD = 'faults=[{{kind="{}", start_s=1.0, {}}}]'
OF_ALL = 'faults=[{{kind="software", start_s=1.0, surface="elevator", signal="{}"}}]'
CONVERTER = 'faults=[{{kind="dac", start_s=1.0, surface="elevator", signal="{}"{}}}]'
STOPPED = 'faults=[{{kind="computer_stop", start_s=1.0, signal="{}"}}]'
TO_D = 'computers.commands=[{at_s=1, do="readmit", lane="D"}]'


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        ([OF_ALL.format("computer.B"), COUNT], "software cannot sit on computer.B, allowed: computer.all"),
        ([CONVERTER.format("computer.all", ""), COUNT], "dac cannot sit on computer.all, allowed: computer.A"),
        ([CONVERTER.format("computer.B", ',does="offset"'), COUNT], "offset: is needed for does = 'offset'"),
        ([BAD.format("dac", 'signal="computer.B"'), COUNT], "faults.0.surface"),
        ([BAD.format("adc", 'signal="computer.B",says="zero",factor=2.0'), COUNT], "factor: does not go with says"),
        ([STOPPED.format("computer.D"), "computers.count=3"], "computer.D has a lane that is not there.*lanes A to C"),
        ([STOPPED.format("computer.A")], "count = 1, no lanes"),
        ([STOPPED.format("computer.E"), COUNT], "no such computer, .*computer.A"),
        ([BAD.format("power_loss", 'signal="bus.3"'), COUNT], "no such bus of electrical power"),
        ([TO_D, "computers.count=3", "faults=[]"], "commands.0.lane: there is no lane D, allowed: A, B, C"),
        (['computers.commands=[{at_s=1, do="backup"}]'], "commands.0: one computer has no lanes"),
        (['computers.commands=[{at_s=1, do="backup", lane="A"}]', COUNT], "lane: the back-up is no lane"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(sets: list[str], told: str):
    with pytest.raises(BadInput, match=told) as refused:
        scenario.load(None, sets)
    assert "\n" not in str(refused.value)
