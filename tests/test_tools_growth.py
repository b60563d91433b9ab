"""The growth table: what is extrapolated follows the last two measurements, and says so."""

import os

import pytest
from figures import growth
from figures.growth import Size

SMALL, LARGE = Size(1000, 100.0, 4.0, 2.0, 1.0), Size(3000, 110.0, 12.0, 3.0, 0.9)


def test_what_grows_in_proportion_goes_on_so_and_what_does_not_grow_stays():
    later = growth.extrapolated([Size(10, 0.0, 0.0, 0.0, 0.0), SMALL, LARGE], 101_000)
    assert later == pytest.approx(Size(101_000, 110.0 + 49 * 10.0, 4.0 * 101, 3.0 + 49.0, 0.9))


def test_the_workers_double_up_to_the_cores(monkeypatch: pytest.MonkeyPatch):
    for cores, counts in ((1, [1]), (2, [1, 2]), (6, [1, 2, 4, 6]), (16, [1, 2, 4, 8, 16])):
        monkeypatch.setattr(os, "cpu_count", lambda cores=cores: cores)
        assert growth.counts() == counts


def test_a_row_says_whether_it_was_flown(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path):
    monkeypatch.setattr(growth, "_size", {1000: SMALL, 3000: LARGE}.__getitem__)
    monkeypatch.setattr(growth, "PICTURE", tmp_path / "growth.svg")
    growth.growth_size("1000", "3000")
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")][2:]
    assert [row.split("|")[-2].strip() for row in rows] == ["measured"] * 2 + ["extrapolated, not flown"] * 2
    drawn = (tmp_path / "growth.svg").read_text()
    assert drawn.count("stroke-dasharray") == 4 and "dashed: extrapolated" in drawn


def test_what_was_flown_is_not_extrapolated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path
):
    monkeypatch.setattr(growth, "_size", {1000: SMALL, 100_000: LARGE._replace(flights=100_000)}.__getitem__)
    monkeypatch.setattr(growth, "PICTURE", tmp_path / "growth.svg")
    growth.growth_size("1000", "100000")
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines() if line.startswith("|")][2:]
    assert [(row[1].strip(), row[-2].strip()) for row in rows] == [
        ("1,000", "measured"),
        ("100,000", "measured"),
        ("1,000,000", "extrapolated, not flown"),
    ]


def test_the_most_memory_of_a_process_is_that_of_the_system():
    assert growth._peak_mb(os.getpid()) > 10.0
    assert growth._peak_mb(2**31 - 1) == 0.0
