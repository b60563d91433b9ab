"""The flown loop: repeatable, blind to the truth, whole under its worst neighbours."""

import numpy as np
import pytest
from interpreted import printed
from one_stage import step_stage

from rig.computer.lanes.think import ComputerData, think_lane
from rig.core.frame import INDEX, End, Table, nested, new_block
from rig.flight import loop
from rig.flight.block_length import block_frames
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.world.faults import actuate


def load(*sets: str, seconds: float = 5.0, seed: int = 1):
    return scenario.load(None, [f"duration_s={seconds}", "faults.0.start_s=1.0", *sets], seed)


def flown(which: scenario.Scenario) -> np.ndarray:
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Bit for bit, NaN included; copies do not carry what lies between the fields."""
    return all(a[name].tobytes() == b[name].tobytes() for name in a.dtype.names or ())


def test_the_same_scenario_and_seed_give_the_same_bytes_and_another_seed_does_not():
    first = flown(load("turbulence=moderate"))
    assert same(first, flown(load("turbulence=moderate")))
    assert not same(first, flown(load("turbulence=moderate", seed=2)))


@pytest.mark.requirement("references", "never the truth, never the signal that it checks")
def test_truth_never_reaches_redundancy_or_control():
    """Once the sensors have spoken, truth and flight condition become garbage; nothing that follows changes."""
    which = load("turbulence=light")
    seeing, blind = Rig(which), Rig(which)
    a, b = new_block(300), new_block(300)
    for block, rig in ((a, seeing), (b, blind)):
        rig.prepare(block)
        for k in range(len(block)):
            assert rig.plant.read(block, k) == 0
            step_stage(rig.sensors, block, k)
            step_stage(rig.inertial, block, k)
            step_stage(rig.faults, block, k)
            kept = block["truth"][k].copy(), block["flight"][k].copy(), block["discrete_truth"][k].copy()
            if rig is blind:
                block["truth"][k], block["flight"][k], block["discrete_truth"][k] = np.nan, np.nan, 77
            row, data = nested(block)[k], rig.data
            think_lane(row, row["bus"], row["fcc"], k, ComputerData(data.redundancy, data.control, data.faults))
            block["truth"][k], block["flight"][k], block["discrete_truth"][k] = kept
            block["surface_command"][k] = block["surface"][k]
            actuate(row, rig.faults.data)
            rig.plant.step(block, k)
    assert same(a, b)


@pytest.mark.requirement("redundancy", "compiled and interpreted kernels agree bit for bit")
def test_compiled_and_interpreted_kernels_fly_the_same_bits():
    program = (
        "import hashlib, numpy as np\n"
        "from rig.scenario import scenario\nfrom rig.flight.loop import Rig, frames\n"
        "s = scenario.load('f16_pull_up_load_factor_offset', ['duration_s=1.0', 'turbulence=moderate',"
        "'faults.0.start_s=0.2', 'pilot.manoeuvres.0.start_s=0.3'])\n"
        "fields = (r[n] for r, _ in frames(Rig(s), s) for n in r.dtype.names)\n"
        "print(hashlib.sha256(b''.join(f.tobytes() for f in fields)).hexdigest())\n"
    )

    assert printed(program, interpreted=True) == printed(program, interpreted=False)


def test_the_faulted_channel_alone_is_failed_and_the_aircraft_flies_on():
    rows = flown(load())
    failed = rows["state"][-1] == 2
    assert np.argwhere(failed).tolist() == [[INDEX["pitch_rate"], 2]]
    assert rows["end"][-1] == End.FLYING and len(rows) == 500


def test_with_the_mean_the_same_fault_loses_the_aircraft_and_the_flight_ends_there():
    rows = flown(load("redundancy.manager=mean"))
    assert End(rows["end"][-1]).label.startswith("departure")
    assert len(rows) < 500 and not rows["end"][:-1].any()


def test_three_and_two_channels_fly_too():
    rows = flown(load("sensors.pitch_rate.channels=3", "sensors.heading.channels=2"))
    assert rows["level"][0, INDEX["pitch_rate"]] == 3 and rows["level"][-1, INDEX["pitch_rate"]] == 2
    assert (rows["level"][:, INDEX["heading"]] == 2).all()
    assert rows["end"][-1] == End.FLYING


def test_several_simulation_steps_a_frame_fly_the_same_manoeuvre():
    coarse, fine = flown(load("faults=[]")), flown(load("faults=[]", "simulation_rate_hz=400"))
    assert len(coarse) == len(fine)
    assert np.abs(coarse["truth"][:, INDEX["pitch_rate"]] - fine["truth"][:, INDEX["pitch_rate"]]).max() < 0.01


def test_a_stop_ends_the_flight_after_its_frame():
    which, stop = load(), loop.Stop()
    seen = 0
    for rows, _ in frames(Rig(which), which, stop=stop):
        seen += len(rows)
        stop.requested = True
    assert seen == block_frames(which) + 1


class Frames:
    """A recorder of their numbers."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def record(self, table: Table) -> None:
        assert len(table) == len(table.timing) and table.beside is None
        self.numbers += table["frame"].tolist()


def test_each_recorder_takes_every_row_and_the_hook_acts_before_it():
    which, recorders, before = load(seconds=2.5), [Frames(), Frames()], list[int]()
    loop.fly(Rig(which), recorders, before_row=lambda rig, rows, k: before.append(int(rows["frame"][k])))
    assert recorders[0].numbers == recorders[1].numbers == before == list(range(which.frames))


def test_a_computer_takes_the_place_of_the_rigs_own_and_its_answer_is_timed():
    which = load(seconds=2.0)

    def computer(rig: Rig) -> loop.ComputerStep:
        ours = loop.bind_computer(rig.data, None)

        def step(rows: np.ndarray, k: int, data: loop.StageData) -> float:
            ours(rows, k, data)
            return 7.0

        return step

    assert same(loop.fly_rows(which), loop.fly_rows(which, computer=computer))
    assert {us for _, timing in frames(Rig(which, computer), which) for us in timing["reply_us"]} == {7.0}


def test_a_flight_in_memory_may_end_after_its_first_frames():
    which = load()
    assert same(loop.fly_rows(which, 130), loop.fly_rows(which)[:130])
