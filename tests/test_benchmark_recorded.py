"""A benchmark of recordings: half of them calibrates, the other half has the faults."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.stats import ttest_1samp

from rig.cli.benchmark import _show_recordings
from rig.core.errors import BadInput
from rig.log.recordings.vote_config import VoteConfig
from rig.studies.benchmark import injected
from rig.studies.benchmark.benchmark_trials import typed
from rig.studies.benchmark.entrants import BUILT_IN, OURS, TESTS, TESTS_AND_SUMS, OfSignal, entrants
from rig.studies.benchmark.on_recordings import BEFORE_S, MARGINS, PIECES, _chosen, benchmark
from rig.studies.benchmark.outcome_table import RECORDING, differences, table
from rig.studies.thresholds.data import Data, load
from rig.studies.thresholds.design import DataBlock
from rig.studies.thresholds.pieces import parameters
from rig.studies.thresholds.tradeoff import pieces

CONFIG = VoteConfig.model_validate({"default": {"threshold": 1.0, "persistence": 3}})
RATE_HZ = 50


def write(
    folder: Path, files: int, seconds: int = 20, apart: float = 1.0, noise: Sequence[float] = (0.02,), names: str = "xy"
) -> None:
    """Write recordings of signals, noise on channels that differ by constants; that of the files in turn."""
    time_s = np.arange(seconds * RATE_HZ) / RATE_HZ
    for i in range(files):
        rng = np.random.default_rng(i)
        columns: dict[str, Any] = {"time_s": time_s}
        for name in names:
            moved = np.sin(time_s + i)[:, None] + apart * np.array([-0.1, 0.02, 0.05, 0.1])
            samples = moved + noise[i % len(noise)] * rng.standard_normal((len(time_s), 4))
            columns |= {f"{name}.{c + 1}": samples[:, c] for c in range(4)}
        pl.DataFrame(columns).write_csv(folder / f"flight_{i}.csv")


@pytest.fixture(scope="module", autouse=True)
def fewer_pieces_to_choose_by() -> Iterator[None]:
    """A fifth of them decides the same here, in a third of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(injected, "CHOOSING", injected.CHOOSING // 5)
        yield


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Data:
    folder = tmp_path_factory.mktemp("recordings")
    write(folder, 4)
    return load([folder], CONFIG, "config")


@pytest.fixture(scope="module")
def result(data: Data) -> dict[str, Any]:
    return benchmark(data, CONFIG, entrants("cross-voter,median,benchmark_flights:Limited"))


def of_three_in_a_row(blocks: Sequence[DataBlock]) -> float:
    """Return the largest least distance from the median of three frames in a row: the level of the cross-voter."""
    apart = [np.abs(block.samples - np.median(block.samples, axis=0)) for block in blocks]
    return max(float(np.lib.stride_tricks.sliding_window_view(x, 3, axis=1).min(axis=2).max()) for x in apart)


@pytest.mark.long
def test_a_level_is_the_least_that_fails_no_channel_in_its_half_and_a_margin(data: Data, result: dict[str, Any]):
    for row in result["levels"]:
        if row["manager"] == "cross-voter":
            margin = row["told"]["threshold"] / of_three_in_a_row(data.signals[row["signal"]][row["half"] :: 2])
            assert any(chosen <= margin < 1.05 * chosen for chosen in MARGINS)


@pytest.mark.long
def test_flights_that_are_noisier_than_others_of_their_half_ask_for_a_margin(tmp_path: Path):
    write(tmp_path, 8, apart=0.0, noise=(0.02, 0.02, 0.036, 0.036), names="x")
    data = load([tmp_path], CONFIG, "config")
    for row in benchmark(data, CONFIG, entrants("cross-voter"))["levels"]:
        if row["manager"] in (OURS, "cross-voter"):
            quiet = data.signals["x"][row["half"] :: 4]
            assert row["told"]["threshold"] > 2.0 * of_three_in_a_row(quiet)
            assert row["false"] == 0


@pytest.mark.long
def test_every_piece_has_one_outcome_and_differences_pair_them(result: dict[str, Any]):
    every = [row for row in result["table"] if row["kind"] == "all"]
    assert {row["signal"] for row in every} == {"x", "y"}
    for row in every:
        assert row["trials"] == 11 * PIECES * 2
        assert row["isolated"] + row["wrong channel"] + row["missed"] + row["prior"] == row["trials"]
    by_pair = {(row["signal"], row["manager"]): row for row in every}
    for row in result["differences"]:
        if row["kind"] == "all":
            mine, ours = (by_pair[row["signal"], name]["isolated"] for name in (row["manager"], row["built_in"]))
            assert row["trials"] == 11 * PIECES * 2 and row["value"] == pytest.approx((mine - ours) / row["trials"])


@pytest.mark.long
def test_what_is_large_is_found_and_a_manager_that_fails_no_channel_misses_it(result: dict[str, Any]):
    offsets = {row["manager"]: row for row in result["table"] if (row["signal"], row["kind"]) == ("x", "offset 2")}
    assert offsets[BUILT_IN]["isolated"] == 2 * PIECES
    assert offsets["median"]["missed"] == 2 * PIECES
    small = {
        row["manager"]: row for row in result["table"] if (row["signal"], row["kind"]) == ("x", "small offset 0.05")
    }
    assert small[TESTS]["isolated"] > small[OURS]["isolated"] + PIECES / 2  # constants are four times the noise


@pytest.mark.long
def test_where_noise_dominates_what_lasts_finds_more(tmp_path: Path):
    """Offsets of a twentieth of the motion, below the noise of a sample."""
    write(tmp_path, 4, apart=0.1, noise=(0.1,), names="x")
    found = benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))
    told = [row["told"] for row in found["levels"] if row["manager"] == TESTS_AND_SUMS]
    assert len(told) == 2 and all(of["slow_means"] >= 1.1 for of in told)
    small = {
        row["manager"]: row for row in found["table"] if (row["signal"], row["kind"]) == ("x", "small offset 0.05")
    }
    assert small[TESTS_AND_SUMS]["isolated"] > small[OURS]["isolated"] + PIECES / 2


@pytest.mark.long
def test_a_tuned_manager_gets_a_bias_and_a_persistence_where_channels_differ(tmp_path: Path):
    write(tmp_path, 4, names="x")
    found = benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("cross-voter,cross-voter tuned"))
    told = [row["told"] for row in found["levels"] if row["manager"] == "cross-voter tuned"]
    assert all(of["learned_bias"] > 0.0 and of["persistence"] in (8, 12, 24, 48) for of in told)
    every = {row["manager"]: row["isolated"] for row in found["table"] if row["kind"] == "all"}
    assert every["cross-voter tuned"] >= every["cross-voter"]
    assert {row["place"] for row in found["table"]} == {"alone"} and found["silent"] == []


def test_votes_that_are_no_number_are_counted_and_written_as_nothing():
    at = np.arange(10)
    plain = {"combination": 0, "trial": at, "signal": "x", "place": "alone", "kind": "stuck", "faults": 1}
    plain |= {"size": None, "reference": "absent", "budget_per_h": 0.0, "delay_s": 0.1, "outcome": "missed"}
    peaks = {"median": np.where(at < 6, np.inf, 0.5), OURS: np.full(10, 0.5)}
    rows = pl.concat([typed(plain | {"manager": name, "peak": peak}) for name, peak in peaks.items()])
    of = {row["manager"]: row for row in table(rows) if row["kind"] == "all"}
    assert of["median"]["no_number"] == 6 and of["median"]["peak_largest"] is of["median"]["peak_median"] is None
    assert of[OURS]["no_number"] == 0 and of[OURS]["peak_largest"] == 0.5
    (row, *_) = differences(rows)
    assert row["peak_larger"] == 6 and row["peak_smaller"] == 0
    json.dumps([*of.values(), row], allow_nan=False)


def test_a_recording_with_a_channel_that_stands_out_is_left_out_and_told(tmp_path: Path):
    write(tmp_path, 4, names="x")
    table_of = pl.read_csv(tmp_path / "flight_1.csv")
    table_of = table_of.with_columns(pl.col("x.2") + 9.0 * (pl.col("time_s") > 8.0))
    table_of.write_csv(tmp_path / "flight_1.csv")
    found = benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))
    (note,) = [note for note in found["notes"] if "stands out" in note]
    assert "flight_1.csv: x.2 stands out" in note and note.endswith("left out for this signal")
    (tmp_path / "flight_3.csv").unlink()
    (tmp_path / "flight_2.csv").unlink()
    with pytest.raises(BadInput, match=r"--recordings: x: fewer than 2 healthy recordings; .*x\.2 stands out"):
        benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))


def test_channels_that_do_not_differ_are_one_line(tmp_path: Path):
    write(tmp_path, 4, apart=0.0, noise=(0.0,), names="x")
    with pytest.raises(BadInput, match="--recordings: x: the channels do not differ; nothing can be calibrated"):
        benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("cusum"))


@pytest.mark.long
def test_of_two_recordings_a_reserve_is_chosen_by_the_halves_of_each(tmp_path: Path):
    write(tmp_path, 2, seconds=60, apart=0.0, noise=(0.02,), names="x")
    data = load([tmp_path], CONFIG, "config")
    (own,) = entrants("cross-voter")[4:]
    signal = OfSignal("x", parameters(data.settings["x"], 4, 50.0), data.settings["x"], CONFIG.baselines, 50.0, None)
    found = [_chosen(own, signal, [block])["threshold"] / of_three_in_a_row([block]) for block in data.signals["x"]]
    assert max(found) > 0.99 * MARGINS[1]  # levels that just hold in a half do not hold in the other


@pytest.mark.long
def test_the_tests_isolate_no_channel_in_the_recordings_that_their_factors_follow_from(tmp_path: Path):
    """Three times the noise in a healthy channel: what counts of its squares grows with the factor."""
    write(tmp_path, 4, seconds=60, apart=0.1, names="x")
    for i, path in enumerate(sorted(tmp_path.glob("*.csv"))):
        more = pl.Series(np.random.default_rng(100 + i).normal(0.0, 0.06, 60 * RATE_HZ))
        pl.read_csv(path).with_columns(pl.col("x.4") + more).write_csv(path)
    found = benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))
    assert [note for note in found["notes"] if "isolates a channel" in note] == []
    told = [row["told"] for row in found["levels"] if row["manager"] == TESTS]
    assert all(of["slow_squares"] > 3.0 for of in told)


def test_pieces_name_the_recording_that_each_is_of(data: Data):
    cut = pieces(data.signals["x"], PIECES, BEFORE_S)
    assert cut is not None and np.array_equal(cut.flight, np.repeat(np.arange(4), PIECES // 4))


def test_a_difference_in_one_of_four_recordings_is_none_of_the_managers():
    """Forty trials, of which ten, all of one recording, are isolated by the other manager alone: 0.25 apart."""
    at = np.arange(40)
    plain = {"combination": 0, "trial": at, "signal": "x", "place": "alone", "kind": "stuck", "faults": 1}
    plain |= {"size": None, "reference": "absent", "budget_per_h": 0.0, "delay_s": 0.1, "peak": None}
    of = {"median": at < 20, OURS: (at >= 10) & (at < 20)}
    made = [
        typed(plain | {"manager": name, "outcome": np.where(isolated, "isolated", "missed")})
        for name, isolated in of.items()
    ]
    rows = pl.concat(made)
    (by_trial, *_), recorded = differences(rows), rows.with_columns(pl.Series(RECORDING, np.tile(at // 10, 2)))
    (row, *_) = differences(recorded)
    assert by_trial["value"] == row["value"] == 0.25
    assert by_trial["low"] > 0.0 > row["low"] and by_trial["p_value"] < 0.01
    assert row["p_value"] == pytest.approx(ttest_1samp([1.0, 0.0, 0.0, 0.0], 0.0)[1])


def test_pieces_begin_ten_seconds_ahead_of_the_fault(data: Data):
    cut = pieces(data.signals["x"], PIECES, BEFORE_S)
    assert cut is not None and cut.onset == 500 and cut.samples.shape == (PIECES, 901, 4)
    first = data.signals["x"][0].samples[:, 4:905]  # the first of 48 evenly over four times 100 rows
    assert np.array_equal(cut.samples[0].T, first)
    assert pieces([DataBlock("short", np.zeros((4, 900)), 50.0)], PIECES, BEFORE_S) is None


def test_too_few_or_too_short_recordings_are_one_line(tmp_path: Path):
    write(tmp_path, 1, seconds=2)
    with pytest.raises(BadInput, match="--recordings: 1 recording; give 2 or more: one half calibrates"):
        benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))
    write(tmp_path, 2, seconds=2)
    with pytest.raises(BadInput, match="--recordings: every recording is shorter than a trial of 18 s"):
        benchmark(load([tmp_path], CONFIG, "config"), CONFIG, entrants("median"))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "--recordings: needs --config"),
        (["--config", "c.toml", "--healthy", "H"], "--healthy: not with --recordings"),
        (["--config", "c.toml", "--trials", "7"], "--trials: not with --recordings"),
        (["--config", "c.toml", "--budget", "1"], "--budget: not with --recordings"),
    ],
)
def test_options_that_do_not_go_together_are_one_line(rig_command: Any, more: list[str], said: str):
    code, out, err = rig_command("benchmark", "--recordings", "R", *more)
    assert (code, out, err.count("\n")) == (2, "", 1) and said in err


def test_a_benchmark_without_anything_says_what_is_needed(rig_command: Any):
    code, _, err = rig_command("benchmark")
    needs = "CAMPAIGN: missing; a benchmark needs CAMPAIGN, --healthy and --out, or --recordings with --config"
    assert code == 2 and needs in err


def test_what_is_printed_names_the_number_of_recordings_and_where_the_other_losses_are(
    capsys: pytest.CaptureFixture[str],
):
    empty: dict[str, list[Any]] = {"levels": [], "table": [], "differences": [], "notes": ["as told"]}
    _show_recordings({"losses": ["LOSS"] * 30, "hours": 0.1, "recordings": 2, **empty})
    said = capsys.readouterr().out
    assert (
        "6 more with --json" in said and "note: as told\n" in said and "2 recordings; trials of one are alike" in said
    )
