"""Times of a recording: readable where its clock began long ago, and refused in its settings where it has no row."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from rig.log.recordings.stamps import digits, gaps, of_rows

EPOCH = 1764166800.0
N = 400


@pytest.fixture
def vote(rig: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """vote(first time, settings, options) -> exit code, standard output, standard error."""
    monkeypatch.setenv("COLUMNS", "200")

    def voted(first_s: float, settings: str = "", *options: str) -> tuple[int, str, str]:
        rng = np.random.default_rng(1)
        time_s = first_s + np.arange(N) / 100 + np.where(np.arange(N) > 300, 0.5, 0.0)
        x = {f"x.{c}": rng.normal(0.0, 0.001, N) for c in range(1, 5)}
        x["x.2"][100:120] = np.nan
        x["x.3"][200:] += 1.0
        pl.DataFrame({"time_s": time_s, **x}).write_csv("in.csv")
        Path("c.toml").write_text(f"{settings}\n[default]\nthreshold = 0.1\npersistence = 8\n")
        return rig("in.csv", "--config", "c.toml", "--out", "o.csv", *options)

    return voted


def test_times_of_a_recording_of_a_calendar_have_all_digits_and_seconds_since_its_first_row(vote: Any):
    code, out, _ = vote(EPOCH)
    assert code == 0 and "e+09" not in out
    to = "+4.490 s, 2025-11-26 14:20:04.49 UTC (1764166800 to 1764166804.49 s), +: since the first row"
    assert f"400 rows from 2025-11-26 14:20:00.00 UTC to {to}" in out
    assert "+1.070 s, 2025-11-26 14:20:01.07 UTC" in out and "+2.070 s, 2025-11-26 14:20:02.07 UTC" in out
    assert "gap of 0.51 s at +3.000 s, 2025-11-26 14:20:03.00 UTC" in out


def test_times_of_a_recording_that_begins_at_zero_stay_short(vote: Any):
    _, out, _ = vote(0.0)
    assert "400 rows from 0 to 4.49 s, 100 per second" in out and "1.07 s " in out and "(+" not in out


def test_an_aligned_recording_tells_its_stretch_as_well(vote: Any):
    _, out, _ = vote(EPOCH, "", "--align", "--align-to", str(EPOCH + 3.0))
    date = r"2025-11-26 14:20:0\d\.\d\d UTC"
    assert re.search(rf"from [+-]0\.\d{{3}} s, {date} to \+(2\.9|3\.0)\d\d s, {date}", out)


@pytest.mark.parametrize("at_s", [EPOCH + 4.0, EPOCH, EPOCH + 4.49])
def test_a_reset_within_the_recording_acts(vote: Any, at_s: float):
    code, out, _ = vote(EPOCH, f"[[resets]]\nsignal = 'x'\nat_s = {at_s!r}")
    assert code == 0 and ("ok" in next(line for line in out.splitlines() if " x.2 " in line)) == (at_s > EPOCH)


@pytest.mark.parametrize(
    ("first_s", "at_s", "hint"),
    [
        (EPOCH, 1.5, "; 1.5 s after the first row is 1764166801.5"),
        (EPOCH, EPOCH + 5, ""),
        (0.0, 4.5, ""),
        (9.0, 8.99, ""),
    ],
)
def test_a_reset_outside_the_recording_is_refused(vote: Any, first_s: float, at_s: float, hint: str):
    code, _, err = vote(
        first_s, f"[[resets]]\nsignal = 'x'\nat_s = {first_s + 1.5!r}\n[[resets]]\nsignal='x'\nat_s = {at_s!r}"
    )
    assert code == 2 and not Path("o.csv").exists()
    allowed = f"must be from {digits(first_s)} to {digits(first_s + 4.49)} s, the times of the recording"
    assert err == f"error: c.toml: resets.1.at_s: {allowed}, got {digits(at_s)}{hint}\n"


@pytest.mark.parametrize("start_s", [1.0, EPOCH - 0.01, EPOCH + 5])
def test_a_fault_that_begins_outside_the_recording_is_refused(vote: Any, start_s: float):
    fault = f"[[faults]]\nkind = 'offset'\nsignal = 'x'\nchannels = [1]\noffset = 1.0\nstart_s = {start_s!r}\n"
    Path("f.toml").write_text(fault)
    code, _, err = vote(EPOCH, "", "--inject", "f.toml")
    assert code == 2 and f"the recording is from 1764166800 to 1764166804.49 s, got {digits(start_s)}" in err


def test_a_stretch_that_has_no_rows_is_refused_with_the_times_that_there_are(vote: Any):
    code, _, err = vote(EPOCH, "", "--align", "--align-to", "20")
    assert code == 2 and "the recording is from 1764166800 to 1764166804.49 s" in err and "None" not in err


def test_how_a_channel_comes_back_is_told(vote: Any):
    _, out, _ = vote(0.0)
    assert "[[resets]] in CONFIG" in out and "by invalid: no valid sample for the persistence" in out
    _, mended, _ = vote(0.0, "[[resets]]\nsignal = 'x'\nat_s = 4.0")
    assert "by invalid:" not in mended and "[[resets]] in CONFIG" in mended  # channel 3 is out by comparison


@pytest.mark.parametrize(
    ("time_s", "text"), [(0.0, "0"), (20.15, "20.15"), (12345.678, "12345.678"), (1.764e9, "1764000000")]
)
def test_digits_have_milliseconds(time_s: float, text: str):
    assert digits(time_s) == text


def test_a_gap_is_told_where_it_is():
    time_s = EPOCH + np.array([0.0, 0.01, 0.02, 0.03, 1.0, 1.01])
    assert "gap of 0.97 s at +0.030 s, 2025-11-26 14:20:00.03 UTC" in gaps("a", time_s)[0]
    assert of_rows(3.0, 1.0) == "3 s" and of_rows(2e5 + 14.16, 2e5) == "200014.16 s (+14.160 s)"
    assert of_rows(1_700_000_014.16, 1.7e9) == "+14.160 s, 2023-11-14 22:13:34.16 UTC"
