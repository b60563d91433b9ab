"""What a recorded channel is: sign, scale, unit, offset, convention, rotation; the four that vote; known bad ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w

from rig.core.errors import BadInput
from rig.log.recordings.max_change import jumps, limited
from rig.log.recordings.mirrored import mirrors
from rig.log.recordings.read import load
from rig.log.recordings.recording import Recording
from rig.log.recordings.vote_config import config_of
from rig.studies.thresholds.data import load as load_flights

N = 600
T = np.arange(N) / 100
SOURCE = Path("c.toml")
RATE = 0.3 * np.sin(2 * np.pi * 0.4 * T)  # rad/s
VECTOR = np.array([RATE, 0.5 * np.cos(2 * np.pi * 0.7 * T), 0.4 * np.sin(2 * np.pi * 1.1 * T)])


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def table(**columns: Any) -> None:
    pl.DataFrame({"time_s": T, **{name.replace("__", "."): x for name, x in columns.items()}}).write_csv("in.csv")


def loaded(**tables: Any) -> tuple[Recording, Any]:
    return load(Path("in.csv"), config_of(tables, SOURCE), "c.toml")


def refused(**tables: Any) -> str:
    with pytest.raises(BadInput) as error:
        loaded(**tables)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_sign_scale_unit_and_offset_bring_a_channel_to_its_signal():
    noted = (np.degrees(RATE) - 3.0) / -2.0  # -2 times what is noted, and 3 deg/s, is the rate
    table(x__1=RATE, x__2=noted, x__3=RATE, x__ref=-RATE)
    channel = {"x.2": {"sign": -1, "scale": 2.0, "unit": "deg/s", "offset": 3.0}, "x.ref": {"sign": -1}}
    recorded, _ = loaded(signal={"x": {"threshold": 0.1, "unit": "rad/s"}}, channel=channel)
    samples = recorded.signals["x"]
    assert samples.channels[1] == pytest.approx(RATE, abs=1e-12) and samples.channels[0].tolist() == RATE.tolist()
    assert samples.reference is not None and samples.reference.tolist() == RATE.tolist()
    assert "x.2: sign -1, scale 2.0, unit deg/s, offset 3.0, by CONFIG" in recorded.remarks


@pytest.mark.parametrize("unit", ["deg", "rad"])
@pytest.mark.parametrize("counted_from_zero", [(2,), (1, 3), (1, 2, 3)])
def test_angles_of_two_conventions_are_voted_together(unit: str, counted_from_zero: tuple[int, ...]):
    turn = 360.0 if unit == "deg" else 2.0 * np.pi
    angle = (np.linspace(-0.9, 0.9, N) * turn + turn / 2) % turn - turn / 2
    columns = {f"h__{c}": angle % turn if c in counted_from_zero else angle for c in (1, 2, 3)}
    table(**columns)
    settings = {"unit": unit, "wraps": True, "range": [-turn / 2, turn / 2], "threshold": 0.01}
    channel = {f"h.{c}": {"convention": "0 to 360"} for c in counted_from_zero}
    recorded, _ = loaded(signal={"h": settings}, channel=channel)
    off = np.ptp([np.exp(1j * column) for column in recorded.signals["h"].channels], axis=0)
    assert np.abs(off).max() < 1e-9 and all(np.isfinite(c).all() for c in recorded.signals["h"].channels)
    columns["h__2"] = np.where(np.arange(N) == 5, 1.2 * turn, columns["h__2"])
    table(**columns)
    recorded, _ = loaded(signal={"h": settings}, channel={"h.2": {"convention": "0 to 360"}} | channel)
    assert np.isnan(recorded.signals["h"].channels[1][5])


@pytest.mark.parametrize(
    ("rotation", "turned"),
    [
        ({"yaw_deg": 90.0}, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
        ({"roll_deg": 180.0}, np.diag([1.0, -1.0, -1.0])),
        ({"pitch_deg": 90.0}, np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])),
        ({"matrix": [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]}, np.roll(np.eye(3), 1, axis=1)),
    ],
)
def test_a_known_rotation_is_taken_off(rotation: dict[str, Any], turned: Any):
    recorder = turned.T @ VECTOR  # v = R v_recorder
    columns = {f"{a}__{c}": VECTOR[i] for i, a in enumerate("xyz") for c in (1, 3)}
    table(**columns, **{f"{a}__2": recorder[i] for i, a in enumerate("xyz")})
    recorded, _ = loaded(
        default={"threshold": 0.1}, triads={"gyro": ["x", "y", "z"]}, rotation={"gyro": {"2": rotation}}
    )
    for i, axis in enumerate("xyz"):
        assert recorded.signals[axis].channels[1] == pytest.approx(VECTOR[i], abs=1e-12)


def test_angles_turn_about_x_first_and_z_last():
    config = config_of({"rotation": {"g": {"1": {"roll_deg": 90.0, "yaw_deg": 90.0}}}}, SOURCE)
    assert config.rotation["g"]["1"].as_matrix() @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0])
    assert config.rotation["g"]["1"].as_matrix() @ [0.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0])


X = {"signal": {"x": {"threshold": 0.1}}}


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        (
            {"channel": {"x.4": {"sign": -1}}},
            "c.toml: channel.'x.4': no such channel of a signal that is voted; allowed: x.1",
        ),
        ({"channel": {"x.1": {"unit": "deg/s"}}}, "c.toml: channel.'x.1': unit: the signal has none; give it a unit"),
        ({"channel": {"x.1": {"convention": "0 to 360"}}}, "c.toml: channel.'x.1': convention: the signal is no angle"),
        ({"channel": {"x.1": {"sign": 2}}}, "c.toml: channel.x.1.sign: must be"),
        ({"channel": {"x.1": {"sing": -1}}}, "c.toml: channel.x.1.sing: unknown"),
        ({"channel": {"x.1": {"scale": 0.0}}}, "c.toml: channel.x.1.scale: must be"),
        ({"channel": {"x.1": {"convention": "0 to 2 pi"}}}, "c.toml: channel.x.1.convention: must be"),
        ({"rotation": {"gyro": {"1": {}}}}, "c.toml: rotation.gyro: no such triad"),
        ({"rotation": {"g": {"1": {"matrix": [[1.0]]}}}}, "matrix: must be three rows of three numbers"),
        (
            {"rotation": {"g": {"1": {"matrix": [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}}}},
            "must be a rotation",
        ),
        (
            {"rotation": {"g": {"1": {"matrix": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]}}}},
            "mirrors an axis",
        ),
        ({"rotation": {"g": {"1": {"yaw_deg": 1.0, "matrix": np.eye(3).tolist()}}}}, "give it or angles, not both"),
        (
            {"signal": {"x": {"threshold": 0.1, "bad_from_start": [5]}}},
            "bad_from_start: must be different channels, 1 to 4",
        ),
        (
            {"signal": {"x": {"threshold": 0.1, "bad_from_start": [1], "manager": "median"}}},
            "bad_from_start: manager median isolates no channel for good; allowed: cross-channel",
        ),
        ({"signal": {"x": {"threshold": 0.1, "max_change": 0.0}}}, "signal.x: max_change: must be above 0"),
        (
            {"signal": {"x": {"threshold": 0.1, "channels": [1]}}},
            "signal.x.channels of CONFIG: must be two to 4 different",
        ),
        (
            {"signal": {"x": {"threshold": 0.1, "channels": [1, 9]}}},
            "signal.x.channels: no channel 9; there are 1, 2, 3",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tables: dict[str, Any], says: str):
    table(x__1=RATE, x__2=RATE, x__3=RATE)
    assert says in refused(**X | tables)


def test_a_unit_of_another_quantity_and_a_rotation_without_its_channel_are_refused():
    table(**{f"{a}__{c}": RATE for a in "xyz" for c in (1, 2)})
    assert "'m' is not a unit of this quantity" in refused(
        signal={"x": {"threshold": 0.1, "unit": "rad/s"}}, channel={"x.1": {"unit": "m"}}
    )
    triads = {"default": {"threshold": 0.1}, "triads": {"g": ["x", "y", "z"]}}
    assert "rotation.g.3: x has no channel '3'; allowed: 1, 2" in refused(**triads, rotation={"g": {"3": {}}})


def test_a_sample_that_changes_faster_than_the_quantity_can_is_invalid():
    x = np.full(N, 100.0)
    spiky, stepped = x.copy(), np.where(np.arange(N) < 300, 100.0, 140.0)
    spiky[[0, 50, 51, 200]] = 2000.0, -1900.0, 2000.0, 2000.0
    table(x__1=x, x__2=spiky, x__3=stepped)
    recorded, settings = loaded(signal={"x": {"threshold": 1.0, "max_change": 10.0}})
    flags = limited(recorded, settings).signals["x"].valid
    assert flags is not None and flags[0].all()
    assert np.flatnonzero(flags[1] == 0).tolist() == [1, 50, 51, 200]  # the first sample of all is taken as it is
    assert np.flatnonzero(flags[2] == 0).tolist() == [300]
    assert limited(recorded, {}).signals["x"].valid is None


def test_the_limit_is_for_each_row_that_is_missing_and_goes_round_the_circle():
    assert not jumps(np.array([0.0, 5.0]), np.array([0.0, 5.0]), 1.0).any()
    assert jumps(np.array([0.0, 5.1]), np.array([0.0, 5.0]), 1.0).tolist() == [False, True]
    assert not jumps(np.array([3.1, -3.1]), np.array([0.0, 1.0]), 0.1, wraps=True).any()
    assert jumps(np.array([0.0, 9.0, 0.5, 9.0]), np.arange(4.0), 1.0).tolist() == [False, True, False, True]


@pytest.fixture
def vote(rig: Any) -> Any:
    """vote(tables, options) -> exit code, text, summary."""

    def voted(*options: str, **tables: Any) -> tuple[int, str, dict[str, Any]]:
        SOURCE.write_text(tomli_w.dumps(tables))
        command = ("in.csv", "--config", "c.toml", "--out", "o.csv", *options)
        code, text, error = rig(*command)
        return code, text + error, json.loads(rig(*command, "--json")[1]) if code == 0 else {}

    return voted


def test_four_of_six_channels_vote_and_the_others_are_shown(vote: Any):
    columns = {f"x__{c}": RATE + 0.001 * c for c in range(1, 7)}
    columns["x__5"] = RATE + np.where(T < 3.0, 0.0, 1.0)
    columns["x__2"] = RATE + 0.25
    table(**columns)
    code, text, _ = vote(**X)
    assert code == 2 and "a signal has channels 1 to 4; of more, channels = [1, 2, 3, 5] in [signal.x] names" in text
    code, text, found = vote(signal={"x": {"threshold": 0.1, "channels": [1, 3, 5, 6]}})
    assert code == 0 and "x.3 (recorded 5)" in text and "x, recorded 2" in text
    signal = found["signals"]["x"]
    assert [bool(channel["failed"]) for channel in signal["channels"]] == [False, False, True, False]
    assert signal["recorded"] == [1, 3, 5, 6]
    assert [(one["recorded"], one["beyond_threshold_share"]) for one in signal["not_voted"]] == [(2, 1.0), (4, 0.0)]
    votes = pl.read_csv("o.csv")
    assert votes["x.not_voted.2"].to_list() == pytest.approx((RATE + 0.25).tolist())
    assert np.abs(votes["x.voted"].to_numpy() - RATE).max() < 0.007


def test_a_channel_that_is_known_bad_begins_isolated_and_is_told(vote: Any):
    table(x__1=RATE, x__2=RATE + 1.0, x__3=RATE + 1.0, x__4=RATE)
    code, text, found = vote(signal={"x": {"threshold": 0.1, "bad_from_start": [2], "tie_break": ["ilm"]}})
    first, second, third, _ = found["signals"]["x"]["channels"]
    assert code == 0 and "bad_from_start" in text
    assert second["failed"] == [{"frame": 1, "time_s": 0.0, "why": "bad_from_start", "since_first_row_s": 0.0}]
    assert not first["failed"] and [failed["why"] for failed in third["failed"]] == ["comparison"]
    votes = pl.read_csv("o.csv")
    assert votes["x.level"][0] == 3 and np.abs(votes["x.voted"].to_numpy() - RATE).max() < 1e-9
    code, text, _ = vote(signal={"x": {"threshold": 0.1, "bad_from_start": [1, 2, 3, 4]}})
    assert code == 2 and "signal.x.bad_from_start: all 4 channels; at least one must be good" in text


def test_a_reset_readmits_a_channel_that_was_known_bad(vote: Any):
    table(x__1=RATE, x__2=RATE, x__3=RATE)
    resets = [{"at_s": 3.0, "signal": "x", "channels": [2]}]
    _, _, found = vote(signal={"x": {"threshold": 0.1, "bad_from_start": [2], "readmit_frames": 10}}, resets=resets)
    assert found["signals"]["x"]["level"] == 3 and found["signals"]["x"]["channels"][1]["state"] == "ok"


@pytest.mark.parametrize("covered", ["an offset", "frozen at zero"])
def test_an_error_in_the_first_row_is_isolated_and_told_as_such(covered: str, vote: Any):
    table(x__1=RATE + 1, x__2=RATE + 1, x__3=RATE + 2 if covered == "an offset" else np.zeros(N))
    code, text, found = vote(**X)
    assert code == 0 and "x.3 deviates from the first row on: a fault from before the recording" in text
    third = found["signals"]["x"]["channels"][2]
    assert third["from_first_row"] and third["failed"][0]["frame"] == 8
    assert [c["from_first_row"] for c in found["signals"]["x"]["channels"]] == [False, False, True]
    table(x__1=RATE, x__2=RATE, x__3=RATE + np.where(np.arange(N) < 1, 0.0, 1.0))
    assert not vote(**X)[2]["from_first_row"]


def noisy(count: int, seed: int = 1) -> Any:
    """Vectors (3, C, n) of recorders with noise of their sensors."""
    return VECTOR[:, None] + np.random.default_rng(seed).normal(0.0, 0.02, (3, count, N))


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("delay", [0, 7])
def test_a_flipped_axis_is_named_with_its_recorder(count: int, axis: int, delay: int):
    for c in range(count):
        x = noisy(count)
        x[:, c] = np.roll(x[:, c], delay, axis=-1)
        assert mirrors(x) == []
        x[axis, c] *= -1.0
        assert [(found.channel, found.axes) for found in mirrors(x)] == [(c + 1, (axis,))]


def test_a_mounting_is_no_mirror_and_exchanged_axes_are_one():
    x = noisy(3)
    x[:, 1] = np.diag([-1.0, -1.0, 1.0]) @ x[:, 1]
    assert mirrors(x) == []
    x = noisy(3)
    x[:, 1] = x[[1, 2, 0], 1]
    assert mirrors(x) == []
    x = noisy(3)
    x[:, 1] = x[[1, 0, 2], 1]
    assert [found.channel for found in mirrors(x)] == [2]


def test_of_two_recorders_one_is_mirrored_and_noise_alone_is_no_sign():
    x = noisy(2)
    x[1, 0] *= -1.0
    assert [(found.of_two, found.axes) for found in mirrors(x)] == [(True, (1,))]
    for seed in range(10):
        assert mirrors(np.random.default_rng(seed).normal(0.0, 1.0, (3, 3, N))) == []


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_flipped_axis_is_named_where_noise_hides_which_rotation_is_best(axis: int):
    """Every axis follows the others' by a correlation of 0.55: a mirror leaves more than half of what a turn leaves."""
    rng = np.random.default_rng(3)
    shared = np.repeat(rng.normal(0.0, 1.0, (3, 1, 3000)), 20, axis=-1)
    own = np.repeat(rng.normal(0.0, 1.0, (3, 2, 3000)), 20, axis=-1)
    x = 0.55**0.5 * shared + 0.45**0.5 * own
    assert mirrors(x) == []
    x[axis, 1] *= -1.0
    assert [found.axes for found in mirrors(x)] == [(axis,)]


def test_a_mirrored_recorder_is_told_and_never_taken_off(vote: Any):
    x = noisy(3)
    x[1, 2] *= -1.0
    table(**{f"{a}__{c + 1}": x[i, c] for i, a in enumerate("xyz") for c in range(3)})
    tables = {"default": {"threshold": 0.2}, "triads": {"gyro": ["x", "y", "z"]}}
    code, text, found = vote("--align", "--align-matrix", **tables)
    mend = 'sign = -1 in [channel."y.3"] of CONFIG'
    assert code == 0 and f"gyro, channel 3: mirrored, opposite sign of y.3: no mounting, not corrected; {mend}" in text
    third = found["alignment"]["matrices"][2]
    assert third["mirrored"] and not third["applied"]
    assert found["signals"]["y"]["channels"][2]["state"] == "failed"
    _, text, found = vote("--align", "--align-matrix", **tables, channel={"y.3": {"sign": -1}})
    assert "mirrored" not in text and found["signals"]["y"]["level"] == 3


def test_a_design_of_thresholds_leaves_out_what_is_known_bad_or_too_fast():
    spiky = np.where(np.arange(N) == 9, 50.0, RATE)
    table(x__1=RATE, x__2=spiky, x__3=RATE + 7.0)
    config = config_of({"signal": {"x": {"threshold": 0.1, "bad_from_start": [3], "max_change": 1.0}}}, SOURCE)
    (block,) = load_flights([Path("in.csv")], config, "c.toml").signals["x"]
    assert np.isnan(block.samples[2]).all() and np.flatnonzero(np.isnan(block.samples[1])).tolist() == [9]


QUADS = Path(__file__).parents[2] / "shared" / "data"


@pytest.mark.skipif(not (QUADS / "quad_imu").is_dir(), reason="the recordings are not here")
@pytest.mark.parametrize("folder", ["quad_imu", pytest.param("quad_imu_horizontal", marks=pytest.mark.long)])
def test_a_flipped_gyro_axis_of_real_recorders_is_named_in_all_flights(folder: str):
    mapping = {f"{a}.{c}": f"IMU_{c}.csv:Gyr_{a.upper()}" for a in "xyz" for c in range(1, 5)}
    config = config_of({"time_column": "time", "default": {"threshold": 10.0}, "mapping": mapping}, SOURCE)
    flights = sorted((QUADS / folder).glob("path_*"))
    for flight in flights:
        recorded, _ = load(flight, config, "c.toml", repair=True)
        x = np.array([recorded.signals[axis].channels for axis in "xyz"])[:, :, :720]  # six seconds
        assert mirrors(x) == []
        for c in range(4):
            x[1, c] *= -1.0
            assert [(found.channel, found.axes) for found in mirrors(x)] == [(c + 1, (1,))], (flight.name, c)
            x[1, c] *= -1.0
    assert len(flights) >= 4
