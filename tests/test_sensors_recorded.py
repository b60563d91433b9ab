"""A recorded noise file instead of the drawn noise."""

from pathlib import Path

import numpy as np
import pytest
from one_stage import sense, suite, truths

from rig.core.errors import BadInput
from rig.core.frame import INDEX
from rig.flight.loop import Rig
from rig.scenario import scenario

Q = INDEX["pitch_rate"]
ROWS = np.random.default_rng(5).normal(0, 0.01, (37, 4)).round(6)


@pytest.fixture
def noise(tmp_path: Path) -> Path:
    path = tmp_path / "noise.csv"
    np.savetxt(path, ROWS, delimiter=",", fmt="%.6f")
    return path


def sensed(path: Path, frames: int, file_hz: float = 100.0, seed: int = 0, **more):
    config = suite(pitch_rate={"noise_file": str(path), "noise_rate_hz": file_hz, **more})
    return sense(truths(frames), config, seed=seed, split=10)[:, Q]


def sets(path: Path, *more: str) -> list[str]:
    return [f'sensors.pitch_rate.noise_file="{path}"', "sensors.pitch_rate.noise_rate_hz=100", *more]


def test_the_rows_come_in_their_order_from_a_drawn_start_and_begin_anew_after_the_last(noise: Path):
    x = sensed(noise, 100)
    start = int(np.argmin(np.abs(ROWS - x[0]).sum(axis=1)))
    assert np.array_equal(x, ROWS[(start + np.arange(100)) % 37])


def test_the_start_is_of_the_seed(noise: Path):
    starts = {tuple(sensed(noise, 1, seed=seed)[0]) for seed in range(60)}
    assert len(starts) > 20
    assert np.array_equal(sensed(noise, 5, seed=3), sensed(noise, 5, seed=3))


@pytest.mark.parametrize(("file_hz", "step"), [(50.0, 0.5), (250.0, 2.5)])
def test_another_rate_is_read_off_the_straight_line_between_rows(noise: Path, file_hz: float, step: float):
    x = sensed(noise, 80, file_hz)
    start = int(np.argmin(np.abs(ROWS - x[0]).sum(axis=1)))
    at = start + step * np.arange(80)
    loop = np.vstack([ROWS, ROWS, ROWS, ROWS, ROWS, ROWS, ROWS, ROWS])
    expected = np.array([np.interp(at, np.arange(len(loop)), loop[:, c]) for c in range(4)]).T
    assert np.allclose(x, expected, atol=1e-15)


def test_bias_and_the_other_effects_stay(noise: Path):
    biased = sensed(noise, 20, bias_tolerance=0.1) - sensed(noise, 20)
    assert np.allclose(biased, biased[0], atol=1e-15) and len(set(biased[0].round(9))) == 4


def test_a_header_is_allowed(noise: Path):
    plain = sensed(noise, 5)
    noise.write_text("one,two,three,four\n" + noise.read_text())
    assert np.array_equal(sensed(noise, 5), plain)


def test_a_scenario_takes_the_drawn_noise_out_and_keeps_place_and_hash(noise: Path, monkeypatch: pytest.MonkeyPatch):
    sensor = scenario.load(None, sets(noise)).sensors.pitch_rate
    assert sensor.noise_std == 0.0 and len(sensor.noise_sha256) == 64
    assert sensor.bias_tolerance == scenario.load().sensors.pitch_rate.bias_tolerance
    monkeypatch.chdir(noise.parent)
    assert scenario.load(None, sets(Path("noise.csv"))).sensors.pitch_rate == sensor


def test_a_file_is_found_beside_its_scenario(noise: Path):
    path = noise.parent / "mine.toml"
    path.write_text('[sensors.pitch_rate]\nnoise_file = "noise.csv"\nnoise_rate_hz = 100\n')
    assert scenario.load(path).sensors.pitch_rate.noise_file == str(noise.resolve())


def test_flown_again_from_its_resolved_form_it_is_the_same_and_needs_the_same_file(noise: Path):
    first = scenario.load(None, sets(noise))
    again = scenario.from_resolved(first.resolved(), "log")
    assert again == first
    Rig(again)
    noise.write_text(noise.read_text().replace("0.0", "0.1", 1))
    with pytest.raises(BadInput, match=r"sensors.pitch_rate.noise_file: .* has changed: SHA-256"):
        Rig(again)
    noise.unlink()
    with pytest.raises(BadInput, match="no such file"):
        Rig(again)


BAD = [
    ("", "is empty"),
    ("1,2,3\n1,2,3\n", r"must have 4 columns and at least 2 rows, got \(3, 2\)"),
    ("1,2,3,4\n", "at least 2 rows"),
    ("1,2,3,4\n1,2,x,4\n", "not a CSV of numbers"),
    ("1,2,3,4\n1,2,3\n", "not a CSV of numbers"),
    ("1,2,3,4\n1,nan,3,4\n", "row 2 is not finite"),
]


@pytest.mark.parametrize(("text", "says"), BAD)
def test_a_file_that_is_no_noise_is_refused_in_one_line(noise: Path, text: str, says: str):
    noise.write_text(text)
    with pytest.raises(BadInput, match=says) as caught:
        Rig(scenario.load(None, sets(noise)))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_refused_when_the_scenario_is_loaded(tmp_path: Path):
    with pytest.raises(BadInput, match=r"noise_file: .*nowhere.csv: no such file"):
        scenario.load(None, sets(tmp_path / "nowhere.csv"))


def test_noise_drawn_beside_a_file_is_refused(noise: Path):
    with pytest.raises(BadInput, match="noise_std: must be 0 or left out, noise_file replaces it"):
        scenario.load(None, sets(noise, "sensors.pitch_rate.noise_std=0.1"))
