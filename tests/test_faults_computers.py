"""Faults of the computers, flown: who is failed, for what, in which frame, and what the flight keeps of it.

All frames are counted by hand: at 100 Hz a persistence of p seconds is over in frame ONSET + 100 p - 1; a lane that its
own test fails is out in that frame, one that the others accuse a frame later.
"""

from typing import Any

import numpy as np
import pytest
from lanes_flown import FOUR, ONSET, Flown, flown

from rig.computer.lanes.health import shut_off
from rig.core.errors import BadInput
from rig.core.frame import COMPUTERS, INDEX, Health, LaneTest, State, Table, new_block
from rig.flight.loop import Rig
from rig.scenario import scenario

SERVO = 'actuators.model="servo"'
SURE = ("computers.wrap_around.coverage=1", "computers.reference_voltage.coverage=1")
BLIND = tuple(f"computers.{test}.coverage=0" for test in ("wrap_around", "reference_voltage", "checksum", "watchdog"))
EXACT = "computers.clock_drift_ppm=0"
HARDOVER = 'kind="wrong_command", signal="computer.B", surface="elevator"'
DAC = 'kind="dac", signal="computer.D", surface="elevator", does="offset", offset={}'


def out_from(flight: Flown, lane: str) -> tuple[int, LaneTest] | None:
    """First frame in which a lane is not engaged, and what it was failed for."""
    health = flight.lanes["health"][:, COMPUTERS.index(lane)]
    out = np.flatnonzero((health != Health.ENGAGED) & (health != Health.SUSPECT))
    return (int(out[0]), LaneTest(flight.lanes["failed_for"][out[0], COMPUTERS.index(lane)])) if len(out) else None


@pytest.mark.parametrize(
    ("fault", "lane", "frames", "test"),
    [
        (HARDOVER, "B", 5, LaneTest.COMMANDS),
        ('kind="link_loss", signal="ccdl.D"', "D", 5, LaneTest.LINK),
        ('kind="computer_stop", signal="computer.A"', "A", 1, LaneTest.WATCHDOG),
        (DAC.format(0.05), "D", 2, LaneTest.WRAP_AROUND),
        ('kind="adc", signal="computer.C", says="zero"', "C", 2, LaneTest.WRAP_AROUND),
        ('kind="adc", signal="computer.C", says="last"', "C", 2, LaneTest.WRAP_AROUND),
        ('kind="adc", signal="computer.C", says="scale", factor=0.9', "C", 2, LaneTest.REFERENCE_VOLTAGE),
        ('kind="adc", signal="computer.C", says="offset", offset=0.03', "C", 2, LaneTest.REFERENCE_VOLTAGE),
    ],
)
@pytest.mark.parametrize("model", ["lag", "servo"])
def test_a_lane_is_failed_by_whom_it_should_and_the_others_are_not(fault, lane, frames, test, model):
    flight = flown(fault, seconds=0.4, sets=(*SURE, f"actuators.model={model}"))
    assert {name: out_from(flight, name) for name in COMPUTERS if name != lane} == dict.fromkeys(set("ABCD") - {lane})
    assert out_from(flight, lane) == (ONSET + frames, test)
    assert (flight.rows["acting"][:, 0] == [0] * ONSET + [1] * (len(flight.rows) - ONSET)).all()


@pytest.mark.parametrize("fault", ['says="scale", factor={}', 'says="offset", offset={}'])
@pytest.mark.parametrize(
    ("error", "tolerance", "detected"), [(0.03, 0.02, True), (0.03, 0.04, False), (0.01, 0.005, True)]
)
def test_the_reference_voltage_test_detects_a_converter_that_is_off_by_more_than_its_tolerance(
    fault, error, tolerance, detected
):
    size = 1 - error if "factor" in fault else error
    sets = (*SURE, f"computers.reference_voltage.tolerance={tolerance}")
    flight = flown(f'kind="adc", signal="computer.C", {fault.format(size)}', seconds=0.4, sets=sets)
    assert out_from(flight, "C") == ((ONSET + 2, LaneTest.REFERENCE_VOLTAGE) if detected else None)


def test_the_checksum_is_looked_at_when_its_period_ends():
    fault = 'kind="checksum", signal="computer.B", factor=0.98'
    flight = flown(fault, seconds=1.1)
    assert out_from(flight, "B") == (99, LaneTest.CHECKSUM)
    soon = flown(fault, seconds=0.4, sets=("computers.checksum_period_s=0.15",))
    assert out_from(soon, "B") == (14, LaneTest.CHECKSUM)
    told = soon.lanes["surface"][ONSET:14]
    assert told[:, 1] == pytest.approx(0.98 * told[:, 0], abs=1e-15)


def test_a_clock_that_gains_is_accused_when_it_has_been_out_of_its_window():
    """Clocks are watched from 0.5 s on: a drift from frame 60 shows in frame 61, for five frames; then one accuses."""
    drift = 'kind="clock_drift", signal="computer.C", drift_ppm=100000.0'
    table = f"faults=[{{{drift}, start_s=0.6}}]"
    flight = flown(seconds=0.9, sets=(table, EXACT))
    assert flight.lanes["clock_lead"][61, 2] == pytest.approx(0.1)
    assert out_from(flight, "C") == (66, LaneTest.CLOCK)
    assert [out_from(flight, name) for name in ("A", "B", "D")] == [None] * 3


def test_a_lane_that_was_failed_for_its_clock_relays_no_old_words():
    """C is ahead and reads the others a frame late; when B stops, C's relays would leave no majority for D's words."""
    drift = '{kind="clock_drift", signal="computer.C", drift_ppm=150000.0, start_s=0.6}'
    stop = '{kind="computer_stop", signal="computer.B", start_s=0.8}'
    flight = flown(seconds=1.2, sets=(f"faults=[{drift}, {stop}]", EXACT))
    assert out_from(flight, "C") == (66, LaneTest.CLOCK) and out_from(flight, "B") == (81, LaneTest.WATCHDOG)
    assert (flight.lanes["clock_lead"][80:, 2] > 0.2).all()  # the exchange's window
    for lane in (0, 3):
        held, sampled = flight.bus["channels"][80:, lane], flight.rows["channels"][80:]
        assert (held[..., [0, 3]] == sampled[..., [0, 3]]).all()
    assert (flight.lanes["state"][-1, 0, INDEX["pitch_rate"]][[0, 3]] == State.OK).all()


def test_a_lane_that_lies_beside_a_silent_one_takes_no_channel_of_the_good_ones_along():
    """B is silent; D, which is byzantine, leaves no majority until it is failed: within a signal's persistence."""
    byzantine = '{kind="link_byzantine", signal="ccdl.D", offset_thresholds=5.0, different=true, start_s=0.3}'
    loss = '{kind="link_loss", signal="ccdl.B", start_s=0.1}'
    flight = flown(seconds=0.6, sets=(f"faults=[{loss}, {byzantine}]", EXACT))
    out, test = out_from(flight, "D") or (0, LaneTest.NONE)
    assert test == LaneTest.COMMANDS and out <= 36
    held, sampled = flight.bus["channels"][:, 0, :, 2], flight.rows["channels"][:, :, 2]
    assert np.isnan(held[30:out]).all() and (held[out:] == sampled[out:]).all()
    assert (flight.lanes["state"][-1, 0, :, 2] != State.FAILED).all()


@pytest.mark.parametrize(
    ("fault", "lane"), [(DAC.format(0.05), "D"), ('kind="checksum", signal="computer.B", factor=0.98', "B")]
)
def test_a_test_without_coverage_sees_nothing(fault: str, lane: str):
    assert out_from(flown(fault, seconds=1.1, sets=BLIND), lane) is None


def test_a_lane_that_stops_unseen_by_its_watchdog_is_failed_for_its_link():
    flight = flown('kind="computer_stop", signal="computer.A"', seconds=0.3, sets=BLIND)
    assert out_from(flight, "A") == (ONSET + 5, LaneTest.LINK)
    assert flight.lanes["leads"][ONSET:, 1].all() and flight.lanes["leads"][:ONSET, 0].all()


def test_a_converter_that_is_off_within_the_tolerance_is_not_seen():
    stroke = np.ptp(scenario.load(None, []).airframe.surface_limits[0])
    for share, seen in ((0.019, None), (0.021, (ONSET + 2, LaneTest.WRAP_AROUND))):
        assert out_from(flown(DAC.format(share * stroke), sets=SURE), "D") == seen


def test_what_an_input_converter_says_is_in_its_channel_of_all_signals():
    flight = flown('kind="adc", signal="computer.C", says="zero"', sets=SURE)
    assert (flight.rows["channels"][ONSET:, :, 2][:, INDEX["pitch_rate"]] == 0).all()
    truth = flight.rows["channels"][:, :, 2]
    assert (flight.rows["channels"][ONSET:, :, 0] != 0).any(axis=0).sum() > 10 and (truth[:ONSET] != 0).any()


def test_a_bus_takes_two_lanes_with_all_their_sensors():
    flight = flown('kind="power_loss", signal="bus.1"', seconds=0.4)
    assert [out_from(flight, name) for name in COMPUTERS] == [(ONSET + 1, LaneTest.WATCHDOG), None] * 2
    valid = flight.rows["valid"][ONSET:]
    assert not valid[:, :, [0, 2]].any() and valid[:, :, [1, 3]].all()
    assert not flight.rows["discrete_valid"][ONSET:, :, [0, 2]].any()
    assert flight.lanes["leads"][ONSET:, 1].all()


@pytest.mark.parametrize(("frame", "back"), [(119, False), (120, True)])
def test_a_lane_that_stopped_starts_with_what_the_leading_one_has_and_is_readmitted_when_it_has_agreed(
    frame: int, back: bool
):
    """It runs again from frame 20 on and has agreed for 1 s, 100 frames, before frame 120."""
    order = f'computers.commands=[{{at_s={frame / 100}, do="readmit", lane="A"}}]'
    flight = flown('kind="computer_stop", signal="computer.A", duration_s=0.1', seconds=1.5, sets=(order, EXACT))
    health = flight.lanes["health"][:, 0]
    assert health[19] == Health.FAILED and (health[20:frame] == Health.RESTARTING).all()
    assert (health[frame:] == (Health.ENGAGED if back else Health.RESTARTING)).all()
    for name in flight.fcc.dtype.names:
        assert flight.fcc[name][20:, 0].tobytes() == flight.fcc[name][20:, 1].tobytes(), name
    assert (flight.lanes["integral"][20:, 0] == flight.lanes["integral"][20:, 1]).all()
    assert flight.lanes["leads"][-1].tolist() == ([1, 0, 0, 0] if back else [0, 1, 0, 0])


def blocks(*sets: str) -> tuple[Any, Any]:
    """Rows, and those of servos and computers, of an F-16's flight with servos."""
    from rig.flight.loop import frames

    rig, rows, lanes = Rig(scenario.load(None, [*sets, SERVO, FOUR])), [], []
    for block, _ in frames(rig, rig.scenario):
        rows.append(block.copy())
        lanes += rig.beside(len(block))
    return np.concatenate(rows), np.concatenate(lanes)


def test_valves_of_a_lane_that_is_out_are_shut_and_open_again_when_it_is_back():
    stop = 'faults=[{kind="computer_stop", signal="computer.A", start_s=0.1, duration_s=0.1}]'
    order = 'computers.commands=[{at_s=1.3, do="readmit", lane="A"}]'
    _, lanes = blocks(stop, order, "duration_s=2.5", "turbulence=severe")
    shut, out = lanes["servo"]["valve"], lanes["computer"]["health"][:, 0]
    engaged = np.isin(out, (Health.ENGAGED, Health.SUSPECT))
    assert (shut[:, :, 0] == ~engaged[:, None]).all() and not shut[:, :, 1:].any()
    assert not lanes["servo"]["failed_by"].any()


def test_no_surface_is_bypassed_while_the_back_up_takes_over_from_the_last_lane():
    """D alone is left, and fails itself in frame 32: its channels are shut off when the back-up drives all four."""
    orders = ", ".join(f'{{at_s=0.2, do="disengage", lane="{lane}"}}' for lane in "ABC")
    fault = f"faults=[{{{DAC.format(0.05)}, start_s=0.3}}]"
    _, lanes = blocks(f"computers.commands=[{orders}]", "duration_s=1", "faults=[]", *SURE, fault)
    leads, shut = lanes["computer"]["leads"], lanes["servo"]["valve"]
    assert leads[20:33, 3].all() and not leads[33:].any()
    assert lanes["computer"]["health"][32:, 3].tolist() == [Health.FAILED] * 68
    assert (shut[20:33] == [[1, 1, 1, 0]]).all() and not shut[33:].any()
    assert (shut_off(Table(new_block(len(lanes)), lanes)) == shut[:, 0]).all() and not lanes["servo"]["bypassed"].any()


ONE_BY_ONE = """faults=[
    {kind="wrong_command", signal="computer.B", surface="elevator", start_s=0.2},
    {kind="computer_stop", signal="computer.A", start_s=0.6},
    {kind="link_loss", signal="ccdl.C", start_s=1.0},
    {kind="dac", signal="computer.D", surface="aileron", start_s=1.4}]"""


@pytest.mark.parametrize("model", ["lag", "servo"])
def test_lanes_lost_one_after_the_other_leave_the_back_up_which_flies(model: str):
    flight = flown(seconds=20.0, sets=(ONE_BY_ONE.replace("\n", ""), *SURE, f"actuators.model={model}"))
    tests = (LaneTest.COMMANDS, LaneTest.WATCHDOG, LaneTest.LINK, LaneTest.WRAP_AROUND)
    expected = dict(zip("BACD", zip((25, 61, 105, 142), tests, strict=True), strict=True))
    assert {name: out_from(flight, name) for name in COMPUTERS} == dict(sorted(expected.items()))
    leads = flight.lanes["leads"]
    assert (leads[:60, 0] == 1).all() and (leads[60:105, 2] == 1).all() and (leads[105:143, 3] == 1).all()
    assert not leads[143:].any() and (flight.rows["level"][143:, INDEX["pitch_rate"]] == 0).all()
    assert len(flight.rows) == 2000 and np.abs(flight.rows["truth"][:, INDEX["pitch_angle"]]).max() < 0.5


def test_no_lane_detects_an_error_of_the_common_program_and_the_back_up_comes_by_command():
    order = 'computers.commands=[{at_s=0.2, do="backup"}]'
    fault = 'kind="software", signal="computer.all", surface="elevator", does="offset", offset=-0.02'
    flight = flown(fault, seconds=0.5, sets=(order,))
    assert [out_from(flight, name) for name in COMPUTERS] == [None] * 4
    assert flight.lanes["leads"][:20, 0].all() and not flight.lanes["leads"][20:].any()


ONE = "faults=[{{{}, start_s=1.0}}]"


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        (
            ['computers.commands=[{at_s=1, do="readmit", lane="C"}]', "computers.count=2", "faults=[]"],
            "no lane C.*A, B",
        ),
        (['computers.commands=[{at_s=1, do="readmit"}]', FOUR], "lane: is missing; readmit needs one"),
        (['computers.commands=[{at_s=1, do="backup", lane="A"}]', FOUR], "the back-up is not a lane; backup has none"),
        (['computers.commands=[{at_s=1, do="backup"}]'], "one computer has no lanes"),
        ([ONE.format('kind="software", signal="computer.B", surface="rudder"'), FOUR], "software cannot act on comp"),
        ([ONE.format('kind="dac", signal="computer.all", surface="rudder"'), FOUR], "dac cannot act on computer.all"),
        ([ONE.format('kind="dac", signal="computer.B"'), FOUR], "faults.0.surface: missing"),
        (
            [ONE.format('kind="adc", signal="computer.B", says="scale"'), FOUR],
            "factor: is needed with says = 'scale'",
        ),
        ([ONE.format('kind="computer_stop", signal="computer.E"'), FOUR], "no such computer"),
        ([ONE.format('kind="computer_stop", signal="computer.C"'), "computers.count=2"], "a lane that is not there"),
        ([ONE.format('kind="computer_stop", signal="computer.A"')], "a lane that is not there:.*count = 1"),
        ([ONE.format('kind="power_loss", signal="bus.3"'), FOUR], "no such electrical bus"),
        (["computers.wrap_around.coverage=2", FOUR], "computers.wrap_around.coverage: .*must be at most 1"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(sets: list[str], told: str):
    with pytest.raises(BadInput, match=told) as refused:
        scenario.load(None, sets)
    assert "\n" not in str(refused.value)
