"""Sources that were not sampled together, on common rows."""

from __future__ import annotations

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.recordings.join import in_lines, joined, running_mean, shortened, whole
from rig.log.recordings.stamps import Clock, Floats, clock


def source(rate_hz: float, span_s: float = 20.0, begin_s: float = 0.0, noise: float = 0.0) -> Source:
    time_s = begin_s + np.arange(round(span_s * rate_hz)) / rate_hz
    rng = np.random.default_rng(round(rate_hz))
    return Source(time_s, {"x": np.sin(2.0 * time_s) + noise * rng.normal(size=len(time_s))})


def columns(sources: dict[str, Source], signals: dict[str, list[str]]) -> tuple[Clock, dict[str, Floats]]:
    clocks = {name: clock(name, own.time_s) for name, own in sources.items()}
    rows, taken = joined("f", sources, clocks, signals)
    return rows, {name: taken(name, "x") for name in sources}


def test_rows_are_those_of_the_slowest_channel():
    rows, of = columns({"a": source(100), "b": source(25, begin_s=0.013)}, {"x": ["a", "b"]})
    np.testing.assert_allclose(rows.time_s, 0.013 + np.arange(len(rows.time_s)) / 25)
    assert all(len(values) == len(rows.time_s) for values in of.values())


def test_a_slow_signal_leaves_the_rows_of_a_fast_one():
    sources = {"a": source(50), "b": source(40), "p": source(2), "q": source(1)}
    rows, of = columns(sources, {"gyro": ["a", "b"], "height": ["p", "q"]})
    assert np.median(np.diff(rows.time_s)) == pytest.approx(1 / 40)
    np.testing.assert_allclose(of["p"], np.interp(rows.time_s, sources["p"].time_s, sources["p"].fields["x"]))


def test_a_faster_channel_is_averaged_over_the_step_of_the_rows():
    fast = source(100, noise=0.2)
    rows, of = columns({"a": fast, "b": source(10, begin_s=0.005)}, {"x": ["a", "b"]})
    truth = np.sin(2.0 * rows.time_s)
    held = fast.fields["x"][np.searchsorted(fast.time_s, rows.time_s, side="right") - 1]
    assert np.std(of["a"] - truth) < 0.5 * np.std(held - truth)


def test_values_between_two_samples_lie_on_a_line():
    made = in_lines(np.array([0.0, 0.25, 1.0, 1.5]), np.array([0.0, 1.0, 2.0]), np.array([0.0, 4.0, 2.0]), 5.0)
    np.testing.assert_array_equal(made, [0.0, 1.0, 4.0, 3.0])


def test_a_pause_has_no_samples():
    own_s = np.array([0.0, 1.0, 2.0, 10.0, 11.0])
    made = in_lines(np.array([0.5, 2.0, 5.0, 10.0, 10.5]), own_s, own_s, 5.0)
    np.testing.assert_array_equal(made, [0.5, 2.0, np.nan, 10.0, 10.5])


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 7])
def test_a_running_mean_is_that_of_the_rows_about_each(rows: int):
    values = np.random.default_rng(0).normal(size=40)
    width = rows if rows % 2 else rows + 1
    padded = np.pad(values, width // 2, mode="edge")
    expected = [padded[k : k + width].mean() for k in range(40)] if rows > 1 else values
    np.testing.assert_allclose(running_mean(values, rows), expected, atol=1e-14)


def test_a_missing_sample_is_missing_from_each_mean_with_it_and_from_no_other():
    values = np.ones(12)
    values[5] = np.nan
    assert np.flatnonzero(np.isnan(running_mean(values, 3))).tolist() == [4, 5, 6]


def test_sources_without_a_common_time_are_refused_with_the_span_of_each():
    with pytest.raises(BadInput, match=r"f: the sources have no time in common: a 0 to 19\.96 s, b 100 to 119\.96 s"):
        columns({"a": source(25), "b": source(25, begin_s=100.0)}, {"x": ["a", "b"]})


def test_rows_without_a_sample_at_the_ends_are_left_out():
    own = Source(np.arange(6.0), {"x": np.array([np.nan, 1, np.nan, 3, 4, 5]), "y": np.array([0, 1, 2, 3, 4, np.nan])})
    made = whole("f: a", own)
    np.testing.assert_array_equal(made.time_s, [1, 2, 3, 4])
    np.testing.assert_array_equal(made.fields["x"], [1, np.nan, 3, 4])
    with pytest.raises(BadInput, match="f: a: no row has a sample of x"):
        whole("f: a", Source(np.arange(2.0), {"x": np.full(2, np.nan)}))


def test_a_short_source_is_told():
    sources = {"a": source(25, 20.0), "b": source(25, 5.0, begin_s=3.0)}
    clocks = {name: clock(name, own.time_s) for name, own in sources.items()}
    rows, _ = joined("f", sources, clocks, {"x": ["a", "b"]})
    (line,) = shortened("f", rows, clocks)
    assert "only 3 to 7.96 s in common; a has 0 to 19.96 s" in line
    assert shortened("f", clocks["a"], {"a": clocks["a"]}) == []
