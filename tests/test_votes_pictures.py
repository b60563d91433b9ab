"""Pictures of votes: what is drawn is what was voted, in the unit of the signal, since the first row."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import rig
from rig.bench.shown_votes import shown_votes
from rig.core.errors import BadInput
from rig.show.pages.lines import MOST_POINTS

EPOCH_S = 1_700_000_000.0  # times of the calendar
RATE_HZ = 100.0
STEP_ROW, PERSISTENCE = 100, 8
ISOLATED_S = (STEP_ROW + PERSISTENCE - 1) / RATE_HZ
CONFIG: dict[str, Any] = {"signal": {"rate": {"threshold": 0.1, "unit": "deg/s", "persistence": PERSISTENCE}}}


def recorded(path: Path, channels: np.ndarray, name: str = "rate") -> Path:
    """A recording of channels (n, c)."""
    columns = {f"{name}.{c + 1}": channels[:, c] for c in range(channels.shape[1])}
    pl.DataFrame({"time_s": EPOCH_S + np.arange(len(channels)) / RATE_HZ, **columns}).write_parquet(path)
    return path


@pytest.fixture(scope="module")
def stepped(tmp_path_factory: pytest.TempPathFactory) -> rig.Votes:
    """Three channels of 0, 0 and 0.02; the third is 0.5 higher from row 100 on."""
    channels = np.tile([0.0, 0.0, 0.02], (200, 1))
    channels[STEP_ROW:, 2] += 0.5
    return rig.vote(recorded(tmp_path_factory.mktemp("plot") / "in.parquet", channels), CONFIG)


def lines(axes: Axes) -> dict[str, np.ndarray]:
    """The lines with a name, (2, n) each."""
    drawn = {str(line.get_label()): np.asarray(line.get_data()) for line in axes.get_lines()}
    return {label: data for label, data in drawn.items() if not label.startswith("_")}


def panels(figure: Figure) -> list[Axes]:
    return list(figure.axes)


def test_a_plot_shows_channels_vote_and_differences_in_thresholds_since_the_first_row(stepped: rig.Votes) -> None:
    values, differences = panels(stepped.plot("rate"))
    drawn, table = lines(values), stepped.to_polars()
    assert list(drawn) == ["vote", "channel 1", "channel 2", "channel 3"]
    assert drawn["vote"][0] == pytest.approx(np.arange(200) / RATE_HZ, abs=1e-6)
    assert drawn["vote"][1] == pytest.approx(table["rate.voted"].to_numpy())
    assert drawn["channel 3"][1][[0, -1]] == pytest.approx([0.02, 0.52])
    apart = lines(differences)["channel 3"][1]
    assert apart[0] == pytest.approx(0.2) and apart[-1] == pytest.approx(5.2)
    assert lines(differences)["channel 1"][1] == pytest.approx(0.0, abs=1e-9)
    assert values.get_ylabel() == "rate, deg/s" and differences.get_ylabel() == "minus the vote, thresholds"
    assert values.get_xlabel() == "" and differences.get_xlabel() == "time since the first row, s"


def test_an_isolation_is_marked_in_both_panels_where_the_persistence_ends(stepped: rig.Votes) -> None:
    for axes in panels(stepped.plot("rate")):
        marks = [line for line in axes.get_lines() if line.get_color() == "#b2182b"]
        assert [np.asarray(line.get_xdata())[0] for line in marks] == pytest.approx([ISOLATED_S], abs=1e-6)
    (text,) = panels(stepped.plot("rate"))[0].texts
    assert text.get_text() == " channel 3 isolated at 1.07 s"


def test_a_plot_of_all_has_a_row_for_each_signal(tmp_path: Path) -> None:
    source = pl.read_parquet(recorded(tmp_path / "a.parquet", np.zeros((20, 2)), "a b.c"))
    both = source.hstack(pl.DataFrame({f"other.{c}": np.ones(20) for c in range(1, 5)}))
    both.write_parquet(tmp_path / "both.parquet")
    figure = rig.vote(tmp_path / "both.parquet", {"default": {"threshold": 0.1}}).plot()
    assert [axes.get_ylabel() for axes in panels(figure)[::2]] == ["a b.c", "other"]
    assert [len(lines(axes)) for axes in panels(figure)] == [3, 2, 5, 4]


def test_two_channels_agree_within_half_a_threshold_of_the_vote_between_them(tmp_path: Path) -> None:
    votes = rig.vote(recorded(tmp_path / "in.parquet", np.tile([0.0, 0.08], (20, 1))), CONFIG)
    (shown,) = shown_votes(votes.recording, votes.voted)
    assert shown.apart(0) == pytest.approx(-0.4) and shown.apart(1) == pytest.approx(0.4)
    assert (shown.bound == 0.5).all() and not shown.noted


def test_the_threshold_is_that_of_the_number_of_channels_in_use(tmp_path: Path) -> None:
    channels = np.tile([0.0, 0.0, 0.0], (40, 1))
    channels[10:, 2] = 9.0
    table = {**CONFIG["signal"]["rate"], "threshold": 0.4, "threshold_triplex": 0.2, "threshold_duplex": 0.1}
    votes = rig.vote(recorded(tmp_path / "in.parquet", channels), {"signal": {"rate": table}})
    (shown,) = shown_votes(votes.recording, votes.voted)
    assert shown.threshold is not None
    assert shown.threshold[[0, -1]] == pytest.approx([0.2, 0.1]) and shown.bound[[0, -1]].tolist() == [1.0, 0.5]
    assert shown.ends()[1] < 1.0  # the isolated channel leaves the picture


def test_an_angle_is_drawn_without_a_jump_through_north(tmp_path: Path) -> None:
    degrees = np.linspace(350.0, 370.0, 21)[:, None] + [-1.0, 0.0, 1.0]
    path = recorded(tmp_path / "in.parquet", (degrees + 180.0) % 360.0 - 180.0, "heading")
    settings = {"threshold": 5.0, "unit": "deg", "wraps": True, "range": [-180, 180]}
    (axes, differences) = panels(rig.vote(path, {"signal": {"heading": settings}}).plot("heading"))
    for c in range(3):
        assert np.diff(lines(axes)[f"channel {c + 1}"][1]) == pytest.approx(1.0)
        assert lines(differences)[f"channel {c + 1}"][1] == pytest.approx((c - 1) / 5.0)


def test_a_discrete_has_no_differences(tmp_path: Path) -> None:
    path = recorded(tmp_path / "in.parquet", np.tile([1.0, 1.0, 0.0], (30, 1)), "down")
    votes = rig.vote(path, {"discrete": {"down": {"fail_safe": 1}}})
    (shown,) = shown_votes(votes.recording, votes.voted)
    assert shown.discrete and shown.isolations[0].channel == 3
    assert lines(panels(votes.plot("down"))[0])["vote"][1].tolist() == [1.0] * 30


def test_an_unknown_signal_is_one_line_with_the_known_ones(stepped: rig.Votes) -> None:
    with pytest.raises(BadInput, match=r"^unknown signal 'rates', allowed: rate$"):
        stepped.plot("rates")


def test_a_long_recording_is_drawn_by_the_extremes_of_its_parts(tmp_path: Path) -> None:
    rows = 600_000
    channels = np.zeros((rows, 3))
    channels[123_456, 1] = 0.5  # one row of one channel
    votes = rig.vote(recorded(tmp_path / "in.parquet", channels), CONFIG)
    values, differences = panels(votes.plot("rate"))
    for axes, peak in ((values, 0.5), (differences, 5.0)):
        drawn = lines(axes)["channel 2"]
        assert drawn.shape[1] <= MOST_POINTS and drawn[1].max() == pytest.approx(peak)
        assert drawn[0][drawn[1].argmax()] == pytest.approx(1234.56, abs=1e-6)
