"""Several computers: with nothing that fails in them they decide what one decides, each on memory of its own."""

from pathlib import Path

import numpy as np
import pytest
from equal_lanes import compared
from interpreted import printed
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from rig.core.errors import BadInput
from rig.core.frame import COMPUTERS, INDEX, State
from rig.flight.fly import fly
from rig.flight.loop import Rig, fly_rows, frames
from rig.log import read_log
from rig.log.info import info
from rig.log.scan import recover
from rig.scenario import scenario

SERVO = 'actuators.model="servo"'
SOON = [  # one for each kind of memory that faults on references have, and a lost channel
    '{kind="stuck",signal="reference.roll_rate",start_s=0.3}',
    '{kind="delay",signal="reference.pitch_rate",latency_s=0.035,start_s=0.3}',
    '{kind="duplicate_frame",signal="reference.yaw_rate",every_s=0.05,start_s=0.3}',
    '{kind="offset",signal="pitch_rate",channels=[3],offset=0.2,start_s=0.5}',
    '{kind="offset",signal="surface.elevator",offset=0.01,start_s=0.9}',
]


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        (None, [f"faults=[{','.join(SOON)}]", "turbulence=light"]),
        (None, [SERVO, f"faults=[{','.join(SOON[3:])}]"]),
        ("b707_pitch_sensor_half", ["faults.0.start_s=0.5"]),
        ("b737_roll_rate_scale", ["faults.0.start_s=0.5", "redundancy.manager=selection"]),
    ],
)
def test_equal_lanes_fly_what_one_computer_flies(name: str | None, sets: list[str]):
    found = compared(name, "duration_s=2", *sets)
    assert found.frames == 200 and not found.differing


@pytest.mark.parametrize(("last", "equal"), [(0.2, True), (0.21, False)])
def test_lanes_whose_clocks_are_within_the_exchange_window_fly_what_one_computer_flies(last: float, equal: bool):
    """One whose sensors sample as early; with clocks beyond the window the lanes have samples of two frames."""
    found = compared(None, "duration_s=1", "faults=[]", 'turbulence="light"', ahead=(0.0, 0.05, last, 0.1))
    assert found.frames == 100 and (not found.differing) == equal


def lanes_of(rig: Rig) -> np.ndarray:
    """All rows of a flight's lanes."""

    blocks = (rig.beside(len(rows)) for rows, _ in frames(rig, rig.scenario))
    return np.concatenate([lanes for block in blocks for lanes in block])


LANES_FAIL = (
    *(
        "f16_four_lanes_lost",
        "f16_software",
        "f16_link_byzantine",
        "f16_clock_drift",
        "f16_wrong_command",
        "f16_link_loss",
    ),
    *(
        "f16_computer_stop",
        "f16_link_frozen",
        "f16_link_corrupt",
        "f16_checksum",
        "f16_power_loss",
        "f16_dac",
        "f16_adc",
    ),
)
READMITTED = [
    "computers.count=4",
    'computers.commands=[{at_s=0.5,do="disengage",lane="A"},{at_s=2.0,do="readmit",lane="A"},{at_s=2.5,do="backup"}]',
]


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        *(pytest.param(name, [], marks=[pytest.mark.long] if i % 4 else []) for i, name in enumerate(LANES_FAIL)),
        (None, READMITTED),
        (None, ["computers.count=4", "computers.output=own"]),
    ],
)
def test_one_lane_thinks_for_all_that_are_alike_and_every_bit_is_as_if_each_did(name: str | None, sets: list[str]):
    """Rows, and all records of the lanes, until they are parted and after."""
    made = scenario.load(name, ["duration_s=6", *sets])
    rows, lanes = zip(*(recorded(made, alike) for alike in (True, False)), strict=True)
    assert rows[0] == rows[1] and lanes[0] == lanes[1]


def recorded(made: scenario.Scenario, alike: bool) -> tuple[bytes, bytes]:
    """The rows of a flight, and those of its lanes."""
    rig = Rig(made)
    assert rig.computers is not None and rig.computers.data.alike.all()
    if not alike:
        rig.computers.data.alike[:] = 0
    rows, lanes = [], []
    for block, _ in frames(rig, rig.scenario):
        rows.append(block.tobytes())
        lanes += [part.tobytes() for part in rig.beside(len(block))]
    return b"".join(rows), b"".join(lanes)


@pytest.mark.parametrize("output", ["own", "voted"])
def test_each_lane_asks_its_own_channel_of_every_servo(output: str):
    """A lane whose integrator begins elsewhere; each drives its coils with its own command, or all with the median."""
    sets = [SERVO, "duration_s=0.5", "faults=[]", "computers.count=4", f"computers.output={output}"]
    rig = Rig(scenario.load(None, [*sets, "computers.equalise=false"]))
    assert rig.computers is not None
    rig.computers.data.alike[:] = 0
    rig.computers.data.control["surface"][2] += 0.02
    rig.computers.data.control["elevator_integral"][2] += 0.02
    lanes = lanes_of(rig)
    asked, told = lanes["servo"]["asked"], lanes["computer"]["surface"]
    put = told if output == "own" else np.median(told, axis=1)[:, None]
    assert (asked == put[:, :, :3].transpose(0, 2, 1)).all()
    assert (told[:, 0, 0] == told[:, 1, 0]).all() and (told[:, 0, 0] != told[:, 2, 0]).all()


@pytest.mark.parametrize("count", [2, 3])
def test_channels_whose_lane_is_not_fitted_are_not_fitted(count: int):
    rows = fly_rows(scenario.load(None, ["duration_s=0.2", "faults=[]", f"computers.count={count}"]))
    assert (rows["state"][:, :, count:] == State.ABSENT).all() and (rows["level"] == count).all()
    assert (rows["discrete_level"] == count).all()


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        (["computers.count=5"], "computers.count: must be at most 4, got 5"),
        (["computers.count=3"], r"faults.0.channels: pitch_rate has 3 channels, got \[4\]"),
        ([SERVO, "computers.count=2", "faults=[]"], "computers.count: must be 1 or 4 with servo actuators.*got 2"),
    ],
)
def test_what_does_not_go_together_is_one_line(sets: list[str], told: str):
    with pytest.raises(BadInput, match=told):
        scenario.load(None, ["faults.0.channels=[4]", *sets])


OWN = """
class Silent:
    def __init__(self, params): pass
    def step(self, bus, fcc, k): pass
"""


@pytest.mark.parametrize("whose", ["manager", "unit"])
def test_a_manager_or_a_unit_of_the_users_own_flies_alone(whose: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "silent_manager.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    own = ["redundancy.manager=silent_manager:Silent"] if whose == "manager" else []
    given = scenario.load(None, ["computers.count=4", *own])
    told = "the manager 'silent_manager:Silent'" if own else "a unit under test"
    with pytest.raises(BadInput, match=f"computers.count: 4 computers need a built-in manager.*with {told} allowed: 1"):
        Rig(given, None if own else lambda rig: lambda rows, k, data: None)
    if own:
        with pytest.raises(BadInput):
            fly(given, out=tmp_path / "logs")
        assert not (tmp_path / "logs").exists()


@pytest.fixture(scope="module", params=[[], [SERVO]], ids=["lag", "servo"])
def logged(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """A flight of four computers with its log."""
    exact = "computers.clock_drift_ppm=0"  # else one computer samples at other moments
    sets = ["duration_s=2.5", f"faults=[{SOON[3]}]", "computers.count=4", exact, *request.param]
    return fly(None, overrides=sets, out=tmp_path_factory.mktemp("lanes"))


def test_the_log_has_what_the_lanes_decided(logged):
    log = read_log(logged.log)
    assert log.parts is not None and len(log.parts) == 250
    parts = ["servo"] if logged.scenario.has_servos else []
    assert log.parts.dtype.names == ("frame", *parts, "computer")
    assert (log.parts["frame"] == log.rows["frame"]).all()
    flown = lanes_of(Rig(logged.scenario))
    for part in (*parts, "computer"):
        for name in flown[part].dtype.names or ():
            assert log.parts[part][name].tobytes() == flown[part][name].tobytes(), name
    assert (log.parts["computer"]["state"][-1, :, INDEX["pitch_rate"], 2] == State.FAILED).all()


def test_the_log_tells_the_topics_and_a_cut_one_is_mended(logged, tmp_path):
    counts = {name: count for name, count in info(logged.log)["topics"].items() if name.startswith("/computer/")}
    assert counts == dict.fromkeys([f"/computer/{name}" for name in COMPUTERS], 250)
    cut, mended = tmp_path / "cut.mcap", tmp_path / "mended.mcap"
    cut.write_bytes(logged.log.read_bytes()[:-2000])
    assert not recover(cut, mended).complete
    saved, whole = read_log(mended), read_log(logged.log)
    assert saved.parts is not None and whole.parts is not None and len(saved.parts) == len(saved.rows) >= 100
    assert (saved.parts["computer"]["voted"] == whole.parts["computer"]["voted"][: len(saved.parts)]).all()


def test_a_reader_that_knows_nothing_of_ours_reads_the_lanes(logged):
    lanes = lanes_of(Rig(logged.scenario))["computer"]
    signal, frames_read = INDEX["pitch_rate"], 0
    with logged.log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        for _, channel, message, decoded in reader.iter_decoded_messages(["/computer/B"]):
            k = message.sequence
            assert channel.topic == "/computer/B" and decoded.voted_pitch_rate == lanes["voted"][k, 1, signal]
            assert decoded.state_pitch_rate_3 == lanes["state"][k, 1, signal, 2]
            assert decoded.integral_throttle == lanes["integral"][k, 1, 3]
            frames_read += 1
    assert frames_read == 250 and summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == sum(summary.statistics.channel_message_counts.values())


def test_the_digest_has_the_lanes(logged, tmp_path):
    """It is the same every time, and not that of one computer."""
    again = fly(logged.scenario, out=tmp_path)
    alone = fly(logged.scenario, overrides=["computers.count=1"], out=tmp_path)
    assert again.digest == logged.digest != alone.digest
    assert (again.rows["voted"] == alone.rows["voted"]).all()


@pytest.mark.long
def test_compiled_and_interpreted_lanes_decide_the_same_bits():
    program = (
        "import hashlib\nfrom rig.scenario import scenario\nfrom rig.flight.loop import Rig, frames\n"
        "rig = Rig(scenario.load(None, ['duration_s=0.2', 'computers.count=3', 'faults=[]']))\n"
        "lanes = [rig.beside(len(rows))[0]['computer'] for rows, _ in frames(rig, rig.scenario)]\n"
        "fields = (part[name] for part in lanes for name in part.dtype.names)\n"
        "print(hashlib.sha256(b''.join(field.tobytes() for field in fields)).hexdigest())\n"
    )
    assert printed(program, interpreted=True) == printed(program, interpreted=False)
