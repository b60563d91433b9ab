"""``rig vote`` gives what the flight's manager gives: the table of examples, and bit for bit on any samples."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w
from conftest import constant, vote_samples

from rig.bench.rows_of_recording import FIELDS
from rig.bench.vote_rows import vote
from rig.computer.redundancy.manager_config import MANAGERS
from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, DecidedBy, Pattern, State
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig, read_config
from rig.world.sensors import data_sheets

K = np.arange(30.0)
RISING = np.stack([0.1 * K, 0.1 * K + 0.1, 0.1 * K + 5, 0.1 * K + 5.1], axis=1)
SETTINGS = {"threshold": 1.0, "persistence": 8, "split_persistence": 10}


@pytest.fixture
def run(tmp_path: Path, rig: Any) -> Any:
    """run(columns, settings) -> the table written, the JSON printed."""

    def voted(columns: dict[str, Any], settings: dict[str, Any], *options: str) -> tuple[pl.DataFrame, dict[str, Any]]:
        pl.DataFrame(columns).write_csv(tmp_path / "in.csv")
        (tmp_path / "c.toml").write_text(tomli_w.dumps({"default": settings}))
        code, out, _ = rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--json", *options)
        assert code == 0
        return pl.read_csv(tmp_path / "o.csv"), json.loads(out)

    return voted


def columns(samples: Any, **more: Any) -> dict[str, Any]:
    samples = np.asarray(samples, float)
    named = {f"x.{c + 1}": samples[:, c] for c in range(samples.shape[1])}
    return {"time_s": np.arange(len(samples)) / 100, **named, **{f"x.{k}": v for k, v in more.items()}}


def failed(found: dict[str, Any]) -> dict[int, tuple[int, str]]:
    channels = found["signals"]["x"]["channels"]
    assert all(len(channel["failed"]) <= 1 for channel in channels)
    return {c["channel"]: (f["frame"], f["why"]) for c in channels for f in c["failed"]}


def test_one_channel_off_is_failed_at_its_eighth_frame(run: Any):
    table, found = run(columns(constant(0, 0.2, -0.1, 5)), SETTINGS)
    assert failed(found) == {4: (8, "comparison")}
    assert table["x.voted"].is_between(0, 0.2).all()
    assert table["x.state.4"].to_list() == ["suspect"] * 7 + ["failed"] * 23
    assert table["x.level"].to_list() == [4] * 7 + [3] * 23
    assert table["x.pattern"][:8].to_list() == ["isolated"] * 8


def test_the_slow_fault_tests_of_a_vote_file_isolate_what_no_threshold_does_and_are_named(run: Any):
    draw = np.random.default_rng(1)
    samples = draw.normal(0.0, 0.01, (2000, 4))
    samples[1200:, 2] += 0.05
    tests = {"noise_std": 0.01, "bias_tolerance": 0.1}
    table, found = run(columns(samples), {**SETTINGS, "slow_tests": tests})
    ((channel, (frame, why)),) = failed(found).items()
    assert (channel, why) == (3, "slow_means") and 1200 < frame < 1260
    assert table["x.decided_by"][frame - 1] == "slow_means"
    assert failed(run(columns(samples), SETTINGS)[1]) == {}


def test_two_channels_off_apart_are_never_in_the_vote(run: Any):
    table, found = run(columns(constant(0, 0, 5, 9)), SETTINGS)
    assert failed(found) == {3: (8, "comparison"), 4: (8, "comparison")}
    assert (table["x.voted"] == 0).all()


def test_constant_pairs_go_to_the_smaller_pair(run: Any):
    table, found = run(columns(constant(0, 0.1, 5, 5.1)), SETTINGS)
    assert failed(found) == {3: (10, "trend"), 4: (10, "trend")}
    assert table["x.pattern"].to_list() == ["2:2"] * 10 + ["normal"] * 20
    assert table["x.decided_by"].to_list() == ["unresolved"] * 8 + ["trend"] * 2 + ["none"] * 20
    assert found["signals"]["x"]["split_share"] == pytest.approx(10 / 30)


def test_rising_pairs_go_to_the_larger_pair(run: Any):
    table, found = run(columns(RISING), SETTINGS)
    assert failed(found) == {1: (10, "trend"), 2: (10, "trend")}
    assert (table["x.trend.high"][8:10] == 255).all() and (table["x.trend.low"][8:10] == 255).all()


def test_a_reference_asked_first_saves_the_pair_that_the_trend_would_fail(run: Any):
    settings = {**SETTINGS, "tie_break": ["reference", "trend"]}
    _, found = run(columns(RISING, ref=0.1 * K), settings)
    assert failed(found) == {3: (10, "reference"), 4: (10, "reference")}


def test_in_line_monitors_settle_two_against_two(run: Any):
    flags = {f"ilm.{c}": np.full(30, int(c > 2)) for c in range(1, 5)}
    _, found = run(columns(constant(0, 0.1, 5, 5.1), **flags), SETTINGS)
    assert failed(found) == {1: (10, "ilm"), 2: (10, "ilm")}


def test_four_ways_apart_fail_the_extremes_and_leave_a_duplex(run: Any):
    table, found = run(columns(constant(-9, -3, 3, 9, frames=19)), SETTINGS)
    assert failed(found) == {1: (10, "extremes"), 4: (10, "extremes")}
    assert table["x.pattern"].to_list() == ["1:1:1:1"] * 10 + ["1:1"] * 9
    assert found["signals"]["x"]["level"] == 2


def test_three_channels_apart_leave_the_middle_one(run: Any):
    table, found = run(columns(constant(-9, 0, 9)), SETTINGS)
    assert failed(found) == {1: (10, "middle"), 3: (10, "middle")}
    assert table["x.pattern"][0] == "1:1:1" and table["x.pattern"][29] == "normal"
    assert "x.state.4" not in table.columns


@pytest.mark.parametrize("written", ["nan", "", "NaN", "inf"])
def test_a_cell_without_a_number_is_an_invalid_sample(written: str, tmp_path: Path):
    rows = "".join(f"{k / 100},0,{written},0.1,0.2\n" for k in range(30))
    (tmp_path / "a.csv").write_text("time_s,x.1,x.2,x.3,x.4\n" + rows)
    config = VoteConfig(default=SETTINGS)
    recording = read(tmp_path / "a.csv", config)
    out = vote(recording, config.signals(recording.signals, ""), [])["x"]
    assert [(f.channel, f.frame, f.why) for f in out.failures] == [(2, 8, "invalid")]
    assert (out.voted == 0.1).all() and out.invalid == [0, 30, 0, 0]


def test_a_sample_out_of_range_is_invalid(run: Any):
    table, found = run(columns(constant(0, 0.2, 0.1, 5)), {**SETTINGS, "threshold": 9.0, "range": [-1.0, 1.0]})
    assert failed(found) == {4: (8, "invalid")}
    assert found["signals"]["x"]["channels"][3]["invalid_samples"] == 30
    assert found["signals"]["x"]["spread"]["max"] == pytest.approx(0.2)
    assert table["x.voted"][0] == 0.1


@pytest.mark.parametrize("written", [9.0, np.nan])
def test_a_channel_that_is_off_or_invalid_in_seven_rows_of_eight_is_told_though_it_is_never_failed(
    written: float, run: Any, rig: Any
):
    samples = constant(0, 0.1, 0.2, frames=80)
    samples[np.arange(80) % 8 != 7, 1] = written
    _, found = run(columns(samples), SETTINGS)
    counts = [(c["suspect_rows"], c["suspect_share"]) for c in found["signals"]["x"]["channels"]]
    assert failed(found) == {} and counts == [(0, 0.0), (70, 0.875), (0, 0.0)]
    assert found["suspects"] == ["x.2: suspect in 70 of 80 rows (87.5 %), never isolated"]
    told = rig("in.csv", "--config", "c.toml", "--out", "o.csv")[1]
    assert "x.2: suspect in 70 of 80 rows (87.5 %), never isolated\n" in told
    rows = [line.split() for line in told.splitlines() if line.strip().startswith("x.")]
    assert [row[:4] for row in rows[:3]] == [
        ["x.1", "ok", "never", "never"],
        ["x.2", "ok", "70", "(87.5"],
        ["x.3", "ok", "never", "never"],
    ]


def test_few_suspect_rows_are_counted_and_deserve_no_sentence(run: Any):
    samples = constant(0, 0.1, 0.2, 0.1, frames=300)
    samples[[50, 120], 2] = 9.0
    _, found = run(columns(samples), SETTINGS)
    assert [c["suspect_rows"] for c in found["signals"]["x"]["channels"]] == [0, 0, 2, 0] and found["suspects"] == []


def test_an_angle_that_wraps_is_compared_the_short_way(run: Any):
    angles = (np.pi + 0.01 * np.array([[-1.0, 0.0, 1.0, 2.0]]) + np.pi) % (2 * np.pi) - np.pi
    samples = np.tile(angles, (30, 1))
    table, found = run(columns(samples), {**SETTINGS, "threshold": 0.05, "wraps": True})
    assert failed(found) == {}
    assert np.allclose(np.cos(table["x.voted"]), np.cos(np.pi + 0.005))
    assert found["signals"]["x"]["spread"]["max"] == pytest.approx(0.03)
    _, straight = run(columns(samples), {**SETTINGS, "threshold": 0.05})
    assert failed(straight) == {1: (8, "comparison")}


def test_a_channel_that_agrees_again_is_readmitted_by_a_reset():
    samples = constant(0, 0.2, -0.1, 5, frames=60)
    samples[20:, 3] = 0.1
    config = VoteConfig.model_validate(
        {
            "signal": {"x": {**SETTINGS, "readmit_frames": 20}},
            "resets": [{"at_s": 0.3, "signal": "x", "channels": [4]}, {"at_s": 0.5, "signal": "x", "channels": [4]}],
        }
    )
    recording = Recording(np.arange(60) / 100, {"x": Samples(list(samples.T))})
    out = vote(recording, config.signals(["x"], ""), config.resets)["x"]
    assert (out.level[8:50] == 3).all() and (out.level[50:] == 4).all()


def disturbed(seed: int, channels: int) -> np.ndarray[Any, Any]:
    """A walk in all channels; some drift off, drop out, come back."""
    rng = np.random.default_rng(seed)
    samples = np.cumsum(rng.normal(0, 0.2, 700))[:, None] + rng.normal(0, 0.2, (700, channels))
    for bad in (np.nan, np.inf, -40.0, 1.5, 2.5, 1e300) * 6:
        begin, c = rng.integers(700), rng.integers(channels)
        samples[begin : begin + rng.choice([1, 2, 3, 4, 12], p=[0.3, 0.3, 0.3, 0.08, 0.02]), c] += bad
    return samples


@pytest.mark.parametrize("manager", MANAGERS)
@pytest.mark.parametrize(("channels", "seed", "wraps"), [(4, 1, False), (4, 2, True), (3, 3, False), (2, 4, False)])
def test_every_output_is_that_of_the_flight_bit_for_bit(manager: str, channels: int, seed: int, wraps: bool):
    rng = np.random.default_rng(seed)
    samples = disturbed(seed, channels)
    reference = np.where(rng.random(700) < 0.9, samples[:, 0] + 0.1, np.nan)
    ilm = rng.integers(0, 3, (700, channels), dtype=np.uint8)
    limits = (-np.pi, np.pi) if wraps else (-30.0, 30.0)
    settings: dict[str, Any] = {"fade_s": 0.2, "mean": "trend-weighted", "trend_frames": 2, "persistence": 5}
    padded = np.full((700, 4), np.nan)
    padded[:, :channels] = samples
    flags = np.full((700, 4), 2)
    flags[:, :channels] = ilm
    flown = vote_samples(
        padded,
        manager=manager,
        reference=reference,
        ilm=flags,
        wraps=wraps,
        limits=limits,
        channels=channels,
        **settings,
    )
    chosen = RecordedSignal(threshold=1.0, range=list(limits), wraps=wraps, manager=manager, **settings)  # pyright: ignore[reportArgumentType]
    recording = Recording(np.arange(700) / 100, {"x": Samples(list(samples.T), list(ilm.T), reference)})
    out = vote(recording, {"x": chosen}, [])["x"]
    for name in FIELDS:
        assert getattr(out, name).tobytes() == np.ascontiguousarray(getattr(flown, name)).tobytes(), name
    for c in range(channels):
        assert (out.state[c] == flown.state[:, c]).all()
    if manager == "cross-channel":
        assert len(np.unique(out.pattern)) >= 2 and (out.state[0] != State.OK).any()


def test_a_flown_log_votes_as_it_was_voted_in_flight(tmp_path: Path):
    from rig.flight.fly import fly
    from rig.log import read_log

    sets = ["duration_s=6", "faults.0.start_s=2"]
    flight = fly("f16_pitch_rate_hardover", overrides=sets, out=tmp_path)
    rows = read_log(flight.log).rows
    redundancy = flight.scenario.redundancy
    sheets = data_sheets(flight.scenario.sensors, flight.scenario.rate_hz)
    given = {name: getattr(redundancy.signals, name).with_figures(sheets[i]) for name, i in INDEX.items()}
    tables = {name: of.model_dump(exclude_none=True) for name, of in given.items()}
    (tmp_path / "c.toml").write_text(tomli_w.dumps({"signal": tables}))
    config = read_config(tmp_path / "c.toml")
    recording = read(Path(flight.log), config)
    out = vote(recording, config.signals(recording.signals, ""), [])
    assert len(recording.time_s) == len(rows) == 600 and list(out) == [signal.name for signal in SIGNALS]
    for name, i in INDEX.items():
        for field in FIELDS:
            assert getattr(out[name], field).tobytes() == np.ascontiguousarray(rows[field][:, i]).tobytes(), field
        for c, state in enumerate(out[name].state):
            assert (state == rows["state"][:, i, c]).all()
    assert any(signal.failures for signal in out.values())


def test_a_manager_of_the_users_own_votes(run: Any, tmp_path: Path):
    (tmp_path / "first_of_all.py").write_text(
        "class First:\n"
        "    def __init__(self, params):\n"
        "        self.fitted = int(params['fitted'][0])\n"
        "    def step(self, bus, fcc, k):\n"
        "        fcc[k]['voted'][0] = bus[k]['channels'][0, 0]\n"
        "        fcc[k]['level'][0] = self.fitted\n"
    )
    table, found = run(columns(constant(7, 0, 0)), {**SETTINGS, "manager": "first_of_all:First"}, "--allow-code")
    assert failed(found) == {} and (table["x.voted"] == 7).all() and (table["x.level"] == 3).all()


def test_the_mean_fails_no_channel_and_the_output_says_so(run: Any):
    table, found = run(columns(constant(0, 0, 0, 4)), {**SETTINGS, "manager": "mean"})
    assert failed(found) == {} and (table["x.voted"] == 1).all()


def test_names_of_patterns_and_rules_are_those_of_the_table():
    from rig.bench.write_votes import PATTERNS, STATES, TIE_BREAKS

    assert PATTERNS == ("normal", "isolated", "2:2", "1:1:1:1", "1:1:1", "1:1", "lost")
    further = ("box", "common", "slow", "lane", "given_up", "slow_means", "slow_squares", "slow_halves")
    assert ("none", "ilm", "trend", "reference", "extremes", "middle", "unresolved", *further) == TIE_BREAKS
    assert [State[name.upper()] for name in STATES] == [0, 1, 2]
    assert len(PATTERNS) == len(Pattern) and len(TIE_BREAKS) == len(DecidedBy)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[default]\nthreshold = 1.0\nfade_s = 1e17", "fade_s: must be at most 1e"),
        ("[default]\nthreshold = 1.0\npersistence = 9223372036854775808", "persistence: must be at most 1e"),
        ("[default]\nthreshold = 1.0\nthreshhold = 2.0", "default.threshhold: unknown key; nearest: threshold"),
        ("a = " + "[" * 2000 + "]" * 2000, "nested more than 100 deep"),
        ("[[resets]]\nsignal = 'x'\nat_s = 1e12\n[default]\nthreshold = 1.0", "at_s: must be at most"),
    ],
)
def test_settings_beyond_what_a_frame_counter_holds_are_refused(text: str, says: str, tmp_path: Path):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(BadInput) as caught:
        read_config(tmp_path / "c.toml").signals(["x"], "c.toml")
    assert says in str(caught.value) and len(str(caught.value)) < 600


def test_a_reset_may_be_at_the_time_of_a_calendar(tmp_path: Path):
    (tmp_path / "c.toml").write_text("[[resets]]\nsignal = 'x'\nat_s = 1.7e9\n[default]\nthreshold = 1.0\n")
    assert read_config(tmp_path / "c.toml").resets[0].at_s == 1.7e9
