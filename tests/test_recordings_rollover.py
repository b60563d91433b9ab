"""Clocks that begin again: counters, a day, a week; unrolled and told, where nothing else can be meant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from rig.core.errors import BadInput
from rig.log.recordings.read import read
from rig.log.recordings.rollover import unrolled
from rig.log.recordings.vote_config import VoteConfig

N = 400


def table(name: str, column: str, stamps: Any) -> Path:
    """Channels that count rows."""
    rows = np.arange(len(stamps), dtype=float)
    pl.DataFrame({column: stamps, "x.1": rows, "x.2": rows}).write_csv(name)
    return Path(name)


@pytest.mark.parametrize(
    ("bits", "unit", "tick_s", "step"),
    [
        (32, "us", 1e-6, 10_000),
        (32, "ms", 1e-3, 10),
        (16, "ms", 1e-3, 20),
        (16, "us", 1e-6, 10_000),
        (32, "ns", 1e-9, 10**7),
    ],
)
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_is_unrolled_in_every_unit(
    bits: int, unit: str, tick_s: float, step: int, signed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    whole, low = 1 << bits, -(1 << (bits - 1)) if signed else 0
    counted = whole + low - 150 * step + step * np.arange(N)
    config = VoteConfig(time_column="stamp", time_unit=unit)
    recorded = read(table("in.csv", "stamp", (counted - low) % whole + low), config)
    begin = (counted[0] - low) % whole + low
    assert recorded.time_s == pytest.approx((begin + step * np.arange(N)) * tick_s, abs=1e-6)
    assert recorded.signals["x"].channels[0].tolist() == list(range(N))  # no row is lost
    first = int(np.flatnonzero(np.diff((counted - low) % whole) < 0)[0]) + 2
    (line,) = (line for line in recorded.remarks if "rolls over" in line)
    assert f"after 2^{bits} {unit}" in line and f" {first}" in line


def test_a_counter_of_ticks_without_a_unit_rolls_over_again_and_again():
    counted = np.arange(3000) * 50
    time_s, (line,) = unrolled("in.csv", (counted % 65536).astype(float))
    assert time_s.tolist() == counted.tolist()
    assert line == "in.csv: the time rolls over after 2^16 s (65536 s) 2 times, in rows 1312, 2623: unrolled"


@pytest.mark.parametrize(("whole_s", "name"), [(86_400.0, "a day"), (604_800.0, "a week")])
def test_a_day_and_a_week_are_unrolled(whole_s: float, name: str):
    at = whole_s - 3.0 + np.arange(600) / 100
    time_s, (line,) = unrolled("a", at % whole_s)
    assert time_s == pytest.approx(at, abs=1e-9) and f"after {name} ({whole_s:g} s) in row 301" in line


def test_times_of_day_go_on_after_midnight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    at = [*(f"23:59:{s:02d}.50" for s in range(50, 60)), *(f"00:00:{s:02d}.50" for s in range(10))]
    recorded = read(table("in.csv", "time_s", at), VoteConfig())
    assert recorded.time_s.tolist() == list(range(20)) and any("a day" in line for line in recorded.remarks)


def test_a_pause_and_two_exchanged_rows_at_the_end_of_the_clock_do_not_matter():
    whole_s = 2.0**32 * 1e-6
    at = whole_s - 2.0 + np.arange(500) / 100
    at[200:] += 1.5  # a pause of 1.5 s in which it rolls over
    assert unrolled("a", at % whole_s)[0] == pytest.approx(at)
    at = whole_s - 2.0 + np.arange(500) / 100 + 0.001
    at[[199, 200]] = at[[200, 199]]
    assert unrolled("a", at % whole_s)[0] == pytest.approx(at)


def test_a_recording_that_counts_from_its_first_row_goes_on_where_its_counter_rolls_over():
    whole_s = 2.0**32 * 1e-6
    at = np.arange(500) / 100
    assert unrolled("a", np.where(at < 2.0, at, at - whole_s))[0] == pytest.approx(at)


@pytest.mark.parametrize("off_s", [-5.0, -4000.0, -80_000.0, 86_400.0, -86_400.0, 2.0**32 * 1e-6])
def test_a_step_back_or_a_lone_stamp_is_no_roll_over(off_s: float):
    at = 100_000.0 + np.arange(500) / 100
    lone = at.copy()
    lone[250] += off_s
    assert unrolled("a", lone) == (pytest.approx(lone), [])
    if off_s not in (-86_400.0, 86_400.0, 2.0**32 * 1e-6):
        back = np.where(np.arange(500) < 250, at, at + off_s)
        assert unrolled("a", back)[1] == []


def test_recorders_of_a_folder_are_unrolled_each_by_its_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("f").mkdir()
    at = 80.0 + np.arange(N) / 10
    table("f/a.csv", "time_s", at)
    table("f/b.csv", "t", at)
    mapping = {"x.1": "a.csv:x.1", "x.2": "b.csv:x.1"}
    recorded = read(Path("f"), VoteConfig(mapping=mapping, times={"b.csv": "t"}))
    assert recorded.signals["x"].channels[1].tolist() == list(range(N))
    with pytest.raises(BadInput, match=r"\[times\] 'c\.csv': not a source of \[mapping\]"):
        read(Path("f"), VoteConfig(mapping=mapping, times={"c.csv": "t"}))
    table("f/b.csv", "t", at + 1e6)
    with pytest.raises(BadInput, match=r"no time in common: a\.csv 80 to 119\.9 s, b\.csv 1000080 to 1000119\.9 s"):
        read(Path("f"), VoteConfig(mapping=mapping, times={"b.csv": "t"}))
