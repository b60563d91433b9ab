"""Faults on recorded channels are those of the flight, and the same for the same file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from faulted import RATE, faulted, healthy
from faulted import x as lively

from rig.bench.inject import Injection, inject
from rig.core.errors import BadInput
from rig.core.frame import INDEX
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import VoteConfig

N = 600
RNG = np.random.default_rng(3)
NOISE = [RNG.normal(0.0, 0.1, N) for _ in range(4)]
SETTINGS = {"threshold": 1.0, "persistence": 8, "split_persistence": 10, "range": [-50.0, 50.0]}
CONFIG = VoteConfig(default=SETTINGS)
OFFSET = {"kind": "offset", "signal": "gyro", "channels": [2], "start_s": 7.0, "offset": 3.0}


def recording(first_s: float = 5.0, **signals: list[Any]) -> Recording:
    named = signals or {"gyro": NOISE, "acc": [1.0 + column for column in NOISE]}
    return Recording(first_s + np.arange(N) / 100, {name: Samples(columns) for name, columns in named.items()})


def put(
    *faults: dict[str, Any], into: Recording | None = None, config: VoteConfig = CONFIG, seed: int = 0
) -> Injection:
    into = recording() if into is None else into
    return inject(into, faults, config.signals(into.signals, "c"), seed=seed)


def columns(found: Injection, signal: str = "gyro") -> np.ndarray[Any, Any]:
    return np.array(found.recording.signals[signal].channels)


def test_no_fault_and_a_fault_that_never_begins_change_no_bit():
    broken = [column.copy() for column in NOISE]
    broken[0][10:20], broken[1][30:40] = np.nan, 1e9  # no number; out of range
    into = recording(gyro=broken)
    never = {"kind": "noise", "signal": "gyro", "channels": [1, 2], "rate_per_hour": 1e-6, "std": 1.0}
    for faults in ([], [never]):
        found = put(*faults, into=into)
        assert columns(found).tobytes() == np.array(broken).tobytes()
        assert found.recording.signals["gyro"].valid is None
    assert [one.first for one in found.injected] == [None, None]


def test_an_offset_is_added_exactly_from_its_time_on_and_nowhere_else():
    before = np.array(NOISE)
    found = put(OFFSET)
    assert columns(found)[1, :200].tobytes() == before[1, :200].tobytes()
    assert (columns(found)[1, 200:] == before[1, 200:] + 3.0).all()
    assert columns(found)[[0, 2, 3]].tobytes() == before[[0, 2, 3]].tobytes()
    assert [(one.first, one.last) for one in found.injected] == [(200, N - 1)]
    ended = put({**OFFSET, "end_s": 8.0})
    assert (columns(ended)[1] != before[1]).nonzero()[0].tolist() == list(range(200, 300))
    assert np.array(NOISE).tobytes() == before.tobytes()  # the given recording stays


def test_a_stuck_channel_holds_its_last_sample():
    found = put({"kind": "stuck", "signal": "gyro", "channels": [3], "start_s": 7.0})
    assert (columns(found)[2, 200:] == NOISE[2][199]).all()


def test_a_hardover_is_at_the_end_of_the_range_and_needs_one():
    hardover = {"kind": "hardover", "signal": "gyro", "channels": [1], "start_s": 7.0, "direction": "low"}
    assert (columns(put(hardover))[0, 200:] == -50.0).all()
    with pytest.raises(BadInput, match=r"inject: faults.0: gyro has no range in CONFIG, which this fault needs"):
        put(hardover, config=VoteConfig(default={"threshold": 1.0}))


def test_a_dropout_is_flagged_or_no_number():
    dropout = {"kind": "dropout", "signal": "gyro", "channels": [4], "start_s": 7.0, "duration_s": 0.5}
    flagged, none = put(dropout), put({**dropout, "flagged": False})
    valid = flagged.recording.signals["gyro"].valid
    assert valid is not None and (valid[3] == 0).nonzero()[0].tolist() == list(range(200, 250))
    assert columns(flagged).tobytes() == np.array(NOISE).tobytes()
    assert np.isnan(columns(none)[3]).nonzero()[0].tolist() == list(range(200, 250))


def test_a_sample_that_is_not_usable_stays_so_under_an_offset_and_is_replaced_by_a_value():
    broken = [column.copy() for column in NOISE]
    broken[1][300], broken[1][301] = -9999.0, np.nan
    found = columns(put(OFFSET, into=recording(gyro=broken)))[1]
    assert found[300] == -9999.0 and np.isnan(found[301]) and found[302] == broken[1][302] + 3.0
    stuck = {"kind": "stuck", "signal": "gyro", "channels": [2], "start_s": 7.0, "value": 4.0}
    assert (columns(put(stuck, into=recording(gyro=broken)))[1, 200:] == 4.0).all()


def test_an_offset_of_an_angle_goes_round_the_circle():
    turn = [np.full(N, 3.0) for _ in range(4)]
    config = VoteConfig(default={"threshold": 0.1, "wraps": True})
    found = columns(put({**OFFSET, "offset": 1.0}, into=recording(gyro=turn), config=config))[1]
    assert found[200:] == pytest.approx(4.0 - 2 * np.pi)


def test_a_file_has_faults_on_any_number_of_signals():
    names = [f"gyro_{i}" for i in range(20)]
    into = recording(5.0, **{name: [column + i for column in NOISE] for i, name in enumerate(names)})
    found = put(*({**OFFSET, "signal": name} for name in names), into=into)
    assert [one.signal for one in found.injected] == names
    for i, name in enumerate(names):
        assert (columns(found, name)[1, 200:] == (NOISE[1] + i)[200:] + 3.0).all()


def test_magnitudes_in_thresholds_are_those_of_the_configuration():
    sized = {"kind": "offset", "signal": "gyro", "channels": [2], "start_s": 7.0, "offset_thresholds": 4.0}
    config = VoteConfig(default={**SETTINGS, "threshold": 0.75})
    assert (columns(put(sized, config=config))[1, 200:] == NOISE[1][200:] + 3.0).all()


def test_a_fault_of_a_discrete_turns_its_samples_over():
    ones = [np.ones(N) for _ in range(3)]
    ones[0][250] = np.nan
    config = VoteConfig.model_validate({"discrete": {"door": {"fail_safe": 0}}})
    into = Recording(np.arange(N) / 100, {}, discretes={"door": Samples(ones)})
    fault = {"kind": "inverted", "signal": "door", "channels": [1], "start_s": 2.0}
    found = inject(into, [fault], {}, config.discretes(["door"], "c")).recording.discretes["door"]
    assert (found.channels[0][:200] == 1).all() and (np.delete(found.channels[0][200:], 50) == 0).all()
    assert np.isnan(found.channels[0][250]) and found.valid is None
    with pytest.raises(BadInput, match="inverted cannot act on gyro, allowed: discrete"):
        put({**fault, "signal": "gyro", "start_s": 7.0})


FLOWN = {
    "offset": {"offset": 0.1, "ramp_s": 0.1},
    "drift": {"settles_at": 0.2, "time_constant_s": 0.1},
    "scale": {"factor": 0.5},
    "noise": {"std": 0.01},
    "bias_instability": {"std": 0.01, "time_constant_s": 0.5},
    "oscillation": {"amplitude": 0.1, "frequency_hz": 3.0, "replacing": True},
    "spikes": {"amplitude": 0.3, "rate_per_s": 20.0},
    "intermittent": {"gap_s": 0.05, "contact_s": 0.05, "random": True, "in_gaps": "no number"},
    "delay": {"latency_s": 0.07},
    "frame_skew": {"skew_s": 0.025},
    "quantisation": {"step": 0.125},
    "cross_talk": {"source": "roll_rate", "gain": 0.5},
    "duplicate_frame": {"every_s": 0.05},
}


@pytest.mark.parametrize("kind", FLOWN)
def test_a_fault_of_a_recording_is_the_fault_of_the_flight_bit_for_bit(kind: str):
    fault = {"kind": kind, "signal": "pitch_rate", "channels": [2], "start_s": 0.2, **FLOWN[kind]}
    block = healthy(300)
    block["channels"] = lively(300)[:, None, None]
    flown = faulted(fault, block=block, seed=7)["channels"][:, INDEX["pitch_rate"], 1]
    same = [lively(300) for _ in range(4)]
    into = Recording(np.arange(300) / RATE, {"pitch_rate": Samples(same), "roll_rate": Samples(same)})
    found = inject(into, [fault], CONFIG.signals(into.signals, "c"), seed=7).recording.signals["pitch_rate"]
    assert found.channels[1].tobytes() == flown.tobytes() and found.channels[1].tobytes() != same[1].tobytes()


def test_what_is_drawn_depends_on_the_seed_and_the_name_alone():
    noise = {"kind": "noise", "signal": "gyro", "channels": [2], "start_s": 7.0, "std": 1.0}
    other = {**noise, "signal": "acc"}
    once, again, beside = put(noise), put(noise), put(other, noise)
    assert columns(once).tobytes() == columns(again).tobytes() == columns(beside).tobytes()
    assert columns(once).tobytes() != columns(put(noise, seed=1)).tobytes()
    assert (columns(beside, "acc")[1] - 1.0)[200:] != pytest.approx(columns(once)[1, 200:])


def test_a_fault_comes_after_another_by_its_name_in_the_recording():
    later = {**OFFSET, "signal": "acc", "after": "offset gyro.2", "delay_s": 0.5}
    del later["start_s"]
    assert [(one.label, one.first) for one in put(OFFSET, later).injected] == [
        ("offset gyro.2", 200),
        ("offset acc.2", 250),
    ]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"signal": "giro"}, "faults.0.signal: 'giro' is not voted in the recording, allowed: gyro, acc"),
        ({"signal": "surface.elevator"}, "'surface.elevator': a recording has only channels, allowed: gyro, acc"),
        ({"channels": [5]}, "faults.0.channels: gyro has 4 channels, got [5]"),
        ({"start_s": 99.0}, "faults.0.start_s: the recording is from 5 to 10.99 s, got 99"),
        ({"end_s": 6.0}, "faults.0.end_s: 6 is not after start_s or the first row, 7"),
        ({"start_s": None}, "faults.0.offset.start_s"),
        ({"when": "gyro > 1"}, "faults.0.when: needs the truth or votes, which a recording does not have; allowed"),
        (
            {"on": {"signal": "gyro"}},
            "faults.0.on: needs votes, which a recording does not have; allowed triggers: start_s",
        ),
        ({"after": "roll"}, "faults.0.after: no fault 'roll', allowed: none, there is no other"),
        ({"seen_by_ilm": True}, "faults.0.seen_by_ilm: gyro has no in-line monitor in the recording"),
        ({"kind": "offset_"}, "faults.0.kind: unknown kind 'offset_', nearest: offset"),
        (
            {"kind": "pitot_icing"},
            "pitot_icing needs static_pressure and dynamic_pressure, which the recording does not have",
        ),
        ({"amplitude": 1.0}, "amplitude: unknown key"),
    ],
)
def test_what_a_recording_has_not_is_refused_in_one_line(changes: dict[str, Any], says: str):
    fault = {key: value for key, value in {**OFFSET, **changes}.items() if value is not None}
    if "after" in fault:
        del fault["start_s"]
    if changes == {"start_s": None}:
        fault["start_s"] = "soon"
    with pytest.raises(BadInput) as caught:
        put(fault)
    assert says in str(caught.value) and str(caught.value).startswith("inject: ") and "\n" not in str(caught.value)


@pytest.fixture
def run(rig: Any) -> Any:
    """run(faults as TOML, options) -> exit code, what was printed, the error."""
    table = {"time_s": np.arange(N) / 100, **{f"x.{c}": np.zeros(N) for c in range(1, 5)}}
    pl.DataFrame(table).write_csv("in.csv")
    Path("c.toml").write_text("[default]\nthreshold = 1.0\n")

    def vote_it(faults: str, *options: str) -> tuple[Any, str, str]:
        Path("f.toml").write_text(faults)
        return rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--inject", "f.toml", *options)

    return vote_it


FILE = "seed = 4\n[[faults]]\nkind = 'offset'\nsignal = 'x'\nchannels = [2]\nstart_s = 1.0\noffset = 5.0\n"


def test_a_file_of_faults_is_injected_scored_and_the_same_twice(run: Any):
    code, text, _ = run(FILE, "--json")
    found, bytes_ = json.loads(text)["injected"], Path("o.csv").read_bytes()
    assert code == 0 and (found["file"], found["seed"]) == ("f.toml", 4)
    assert found["outcomes"] == {"correct": 1, "wrong": 0, "missed": 0, "prior": 0, "none": 0}
    assert found["faults"][0]["delay_s"] == pytest.approx(0.07)
    assert run(FILE)[1].count("offset x.2") == 1 and Path("o.csv").read_bytes() == bytes_


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("seed = 1", "error: f.toml: no [[faults]] to inject"),
        (
            FILE.replace("seed", "sede"),
            "error: f.toml: sede: unknown key; nearest: seed; all keys: docs/reference/recordings.md",
        ),
        (FILE.replace("4", "-4"), "error: f.toml: seed: must be 0 or more, got -4"),
        (FILE.replace("'x'", "'y'"), "error: f.toml: faults.0.signal: 'y' is not voted in the recording, allowed: x"),
    ],
)
def test_a_bad_file_of_faults_is_one_line_and_writes_nothing(run: Any, text: str, says: str):
    code, _, error = run(text)
    assert code == 2 and error.strip() == says and not Path("o.csv").exists()


def test_a_bundled_scenario_gives_its_faults_by_name():
    from rig.log.recordings.injection_file import read_injection

    file, path = read_injection("f16_pitch_rate_hardover")
    assert [fault["kind"] for fault in file.faults] == ["hardover"] and path.endswith("f16_pitch_rate_hardover.toml")
