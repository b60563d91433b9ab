"""Flights of several computers asked again: every lane to the bit from the recorded rows, what if, diff, export."""

from itertools import product
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from rig.bench.replay.before_after import diff, side
from rig.bench.replay.verify import verify
from rig.bench.replay.what_if import changed, what_if
from rig.core.errors import BadInput
from rig.core.frame import COMPUTERS, INDEX, Health, LinkState, State
from rig.flight.fly import fly
from rig.log import read_log
from rig.log.export import export
from rig.log.recordings.flown_log import Recorded, recorded
from rig.log.writer import LogWriter

# Each with its fault within 8 s; servos in the first, whose lane is shut off.
SCENARIOS = ("f16_wrong_command", "f16_link_byzantine", "f16_clock_drift", "f16_adc", "f16_power_loss")


WORDS = np.array([state.name.lower() for state in State])


def flown(name: str, out: Path) -> Path:
    return fly(f"faults/{name}.toml", overrides=["duration_s=8"], out=out).log


@pytest.fixture(scope="module")
def wrong_command(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(flown("f16_wrong_command", tmp_path_factory.mktemp("logs")))


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_lane_says_the_same_again_to_the_bit(name: str, tmp_path: Path):
    recording = recorded(flown(name, tmp_path))
    lanes = read_log(recording.path).parts
    assert lanes is not None and np.count_nonzero(lanes["computer"]["health"][-1] != Health.ENGAGED) + np.count_nonzero(
        lanes["computer"]["link"] == LinkState.FAILED
    ) + np.count_nonzero(lanes["computer"]["outvoted"])  # the fault has done something to a lane or a link
    found = verify(recording)
    fields = {field.name for field in found.comparison.fields}
    assert found.comparison.identical and not found.decisions.moved
    assert {f"computer.{lane}.health" for lane in COMPUTERS} <= fields and "control.surface_elevator_rad" in fields


def test_the_valves_of_a_lane_that_failed_are_shut_again(wrong_command: Recorded):
    lanes = read_log(wrong_command.path).parts
    assert lanes is not None and lanes["servo"]["valve"][-1, :, 1].all()  # those of lane B
    fields = {field.name: field.verdict for field in verify(wrong_command).comparison.fields}
    assert fields["actuator.elevator.valve_2"] == "equal"


def test_a_flight_flown_again_has_the_same_lanes(wrong_command: Recorded):
    found = verify(wrong_command, fly=True).comparison
    assert found.identical and "computer.D.clock_lead" in {field.name for field in found.fields}


@pytest.mark.parametrize("field", ["clock_lead", "health"])
def test_a_number_of_a_lane_that_was_changed_in_the_log_is_found(wrong_command: Recorded, field: str, tmp_path: Path):
    log, path = read_log(wrong_command.path), tmp_path / "changed.mcap"
    assert log.parts is not None
    log.parts["computer"][field][50, 2] = Health.FAILED
    with LogWriter(path, log.rate_hz, log.metadata, log.attachments.items(), parts=wrong_command.log.parts) as writer:
        writer.write(log.table)
    unequal = [one for one in verify(recorded(path)).comparison.fields if one.verdict != "equal"]
    assert [(one.name, one.frames, one.first_frame) for one in unequal] == [(f"computer.C.{field}", 1, 50)]


def test_another_threshold_is_taken_by_every_lane(wrong_command: Recorded, tmp_path: Path):
    """Channels of noise are beyond a threshold of nearly nothing: all lanes, which hold the same, say so."""
    text = "redundancy.signals.pitch_rate.threshold=1e-6"
    answer = what_if(wrong_command, changed(wrong_command, None, [text]), tmp_path / "new.mcap", [text])
    assert any(one.signal == "pitch_rate" for one in answer.moved.moved)
    log = read_log(answer.path)
    assert log.parts is not None
    state = log.parts["computer"]["state"]
    assert all(np.array_equal(state[:, 0], state[:, lane]) for lane in range(1, len(COMPUTERS)))
    assert verify(recorded(answer.path)).comparison.identical


def test_a_manager_of_the_users_own_cannot_think_for_lanes(
    wrong_command: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    module = "class Silent:\n    def __init__(self, params): pass\n    def step(self, bus, fcc, k): pass\n"
    (tmp_path / "silent_of_lanes.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    text = "redundancy.manager=silent_of_lanes:Silent"
    out = tmp_path / "out" / "new.mcap"
    out.parent.mkdir()
    with pytest.raises(
        BadInput, match=r"computers.count: 4 computers need a built-in manager.*silent_of_lanes:Silent.* allowed: 1"
    ):
        what_if(wrong_command, changed(wrong_command, None, [text]), out, [text])
    assert not list(out.parent.iterdir())


def test_two_flights_are_identical_and_exported_with_their_lanes(wrong_command: Recorded, tmp_path: Path):
    again = flown("f16_wrong_command", tmp_path)
    compared = diff(side(wrong_command.path), side(again))
    assert compared.identical and "computer.B.failed_for" in {field.name for field in compared.fields}
    for ending in ("csv", "parquet"):
        export(again, ending, tmp_path / f"table.{ending}", [], False)
    tables = pl.read_csv(tmp_path / "table.csv"), pl.read_parquet(tmp_path / "table.parquet")
    lanes = read_log(again).parts
    assert lanes is not None
    states = lanes["computer"]["state"][:, 1]
    for table in tables:
        assert table["computer.B.health"][-1] == "failed"
        for (name, s), c in product(INDEX.items(), range(4)):
            assert table[f"computer.B.state_{name}_{c + 1}"].to_list() == WORDS[states[:, s, c]].tolist()
        assert np.array_equal(table["computer.C.clock_lead"].to_numpy(), lanes["computer"]["clock_lead"][:, 2])
