"""The headline, the decisive seconds and the ranges of plots: found from the rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from rig.core.frame import AUTOPILOT_COMMANDS, INDEX, SURFACES, TIMING, Block, DecidedBy, End, State, Table, new_block
from rig.flight.failures import decisive_s
from rig.log.writer import LogWriter
from rig.show.viewer import charts
from rig.show.viewer.facts import Facts, FaultFact
from rig.show.viewer.opened import read, save
from rig.show.viewer.story import Story, look, signal_range

HZ = 100.0
THRESHOLDS = {"pitch_rate": 0.05, "heading": 0.1}
HARDOVER = Facts("a flight", THRESHOLDS, (FaultFact("hardover pitch_rate.3", "pitch_rate", (3,), 20.0),))


def flown(frames: int = 6000, onset: int = 2000, **failed: int) -> Block:
    """Rows with a fault from ``onset`` on; ``failed``: the frames in which channels fail, like ``pitch_rate_3``."""
    rows = new_block(frames)
    rows["valid"] = 1
    rows["acting"][onset:, 0] = 1
    for place, frame in failed.items():
        signal, _, channel = place.rpartition("_")
        rows["state"][frame:, INDEX[signal], int(channel) - 1] = State.FAILED
    return rows


def headline(facts: Facts, rows: Block) -> str:
    return look(facts, Table(rows), HZ, ended=True)[1]


def test_the_headline_says_what_failed_when_how_long_after_the_onset_and_by_what() -> None:
    told = headline(HARDOVER, flown(pitch_rate_3=2007))
    assert told == "SURVIVED: pitch rate, channel 3, isolated at 20.07 s, 70 ms after onset, by comparison"


def test_channels_that_fail_together_are_told_together_and_a_long_delay_in_seconds() -> None:
    facts = Facts("", THRESHOLDS, (FaultFact("", "pitch_rate", (3, 4)),))
    rows = flown(pitch_rate_3=2986, pitch_rate_4=2986)
    rows["decided_by"][2986, INDEX["pitch_rate"]] = DecidedBy.REFERENCE
    told = headline(facts, rows)
    assert told == "SURVIVED: pitch rate, channels 3, 4, isolated at 29.86 s, 9.86 s after onset, by reference"


def test_an_aircraft_that_is_lost_is_told_first() -> None:
    rows = flown(2554, pitch_rate_3=2007)
    rows["end"][-1] = End.DEPARTURE_ANGLE_OF_ATTACK
    told = headline(HARDOVER, rows)
    assert told.startswith("LOST at 25.53 s: angle of attack beyond its limit; pitch rate, channel 3, isolated")


def test_a_channel_that_fails_without_a_fault_on_it_is_told_so() -> None:
    told = headline(HARDOVER, flown(pitch_rate_3=1000, pitch_rate_1=2007))
    assert told.count("without a fault on it") == 2  # one before its fault, one beside it
    assert "after onset" not in told


def test_a_fault_that_was_not_isolated_and_a_flight_without_any() -> None:
    assert headline(HARDOVER, flown()) == "SURVIVED: no channel isolated; hardover pitch_rate.3 from 20.00 s"
    assert headline(HARDOVER, new_block(100)) == "SURVIVED: no channel isolated"


@pytest.mark.parametrize(
    ("onset", "isolated", "end", "expected"),
    [
        (20.0, 20.07, 60.0, (19.5, 21.07)),
        (0.2, 0.3, 60.0, (0.0, 1.3)),
        (20.0, 20.07, 20.5, (19.5, 20.5)),
        (20.0, None, 60.0, (19.5, 22.0)),
    ],
)
def test_the_zoom_is_from_half_a_second_before_the_fault_to_one_after_the_isolation(
    onset: float, isolated: float | None, end: float, expected: tuple[float, float]
) -> None:
    assert decisive_s(onset, isolated, end) == pytest.approx(expected)


def test_what_is_seen_of_a_flight_is_of_its_decisive_fault() -> None:
    rows = flown(roll_rate_1=1500, pitch_rate_3=2007)
    rows["state"][2500:, 15, 0] = State.SUSPECT
    facts, _ = look(HARDOVER, Table(rows), HZ, ended=True)
    seen = facts.seen
    assert seen is not None
    assert (seen.main, seen.isolated_s, seen.survived) == ("pitch_rate", 20.07, True)
    assert seen.zoom_s == pytest.approx((19.5, 21.07))
    assert seen.noted == ("pitch_rate", "roll_rate", "heading")


def test_blocks_of_any_size_tell_the_same_story() -> None:
    rows = flown(pitch_rate_3=2007)
    for size in (100, 6000):
        story = Story(HARDOVER, HZ)
        for k in range(0, 6000, size):
            changed = story.add(Table(rows[k : k + size]))
            assert changed == (k <= 2007 < k + size)
        assert story.headline("IN FLIGHT").endswith("isolated at 20.07 s, 70 ms after onset, by comparison")


def test_a_hardover_does_not_set_the_scale_of_its_signal() -> None:
    rows = flown(100)
    rows["truth"][:, 0] = rows["voted"][:, 0] = np.linspace(0.0, 0.01, 100)
    rows["channels"][50:, 0, 2] = 1.5
    low, high = np.radians(signal_range(HARDOVER, rows, 0))
    assert (low, high) == pytest.approx((-0.15, 0.16))  # three thresholds either side


def test_the_scale_of_a_heading_through_north_is_that_of_the_turn() -> None:
    rows = new_block(90)
    rows["truth"][:, 15] = rows["voted"][:, 15] = np.radians((315.0 + np.arange(90)) % 360.0)
    low, high = signal_range(HARDOVER, rows, 15)
    room = np.degrees(0.3)
    assert (low, high) == pytest.approx((315.0 - room, 404.0 + room))


def test_noise_is_not_drawn_as_motion_and_motion_is_within_the_scale() -> None:
    rows = new_block(2)
    elevator = SURFACES.index("elevator_rad")
    rows["surface"][:, elevator] = np.radians([0.1, 0.1002])
    low, high = charts.ranges(rows)["elevator"]
    assert high - low == pytest.approx(2.0)
    rows["autopilot_command"][1, AUTOPILOT_COMMANDS.index("altitude_m")] = 100.0
    assert charts.ranges(rows)["commanded change of altitude"] == pytest.approx((-10.0, 110.0))
    assert charts.spanned(np.array([np.nan]), 2.0) == (-1.0, 1.0)


def test_a_chart_has_one_unit_and_every_angle_of_control_is_in_one() -> None:
    ends = {"deg": ("_rad",), "deg/s": ("_rad_s",), "m": ("_m",), "m/s": ("_m_s",), "1": ("throttle",)}
    for chart in charts.CHARTS:
        assert all(name.endswith(ends[chart.unit]) for name in chart.names), chart.name


def test_the_lanes_of_a_flight_end_with_it(tmp_path: Path) -> None:
    short, lost, long = new_block(300), new_block(500), new_block(1000)
    lost["end"][-1] = End.DEPARTURE_RATE
    for name, rows in (("short", short), ("lost", lost), ("long", long)):
        with LogWriter(tmp_path / f"{name}.mcap", HZ, {}) as writer:
            writer.write(Table(rows, timing=np.zeros(len(rows), TIMING)), [])
    save(read([tmp_path / f"{name}.mcap" for name in ("short", "lost", "long")]), tmp_path / "all.rrd")
    told: dict[str, list[str]] = {}
    for chunk in RrdReader(tmp_path / "all.rrd").stream():
        if chunk.entity_path[2:] in ("/heading", "/heading/channel_2"):
            told.setdefault(chunk.entity_path, []).extend(
                state for [state] in chunk.to_record_batch()["StateChange:state"].to_pylist()
            )
    assert told == {
        "/A/heading": ["0000", "OVER"],
        "/A/heading/channel_2": ["OK", "OVER"],
        "/B/heading": ["0000", "DEPARTURE_RATE"],
        "/B/heading/channel_2": ["OK", "DEPARTURE_RATE"],
        "/C/heading": ["0000"],
        "/C/heading/channel_2": ["OK"],
    }
