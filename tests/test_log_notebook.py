"""A log in a notebook: as a table, as a figure, in one line; and the notebook of the docs."""

import base64
import json
import re
from pathlib import Path

import notebook
import numpy as np
import polars as pl
import pytest

import rig
from rig.core.errors import BadInput
from rig.core.frame import INDEX, State, new_block
from rig.log.export import export
from rig.show.viewer.series import limits, series

PAGE = Path(__file__).parents[1] / "docs" / "examples" / "first_flight.ipynb"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> rig.Flight:
    return rig.fly(overrides=["duration_s=3", "faults.0.start_s=1"], out=tmp_path_factory.mktemp("logs"))


def test_the_table_is_the_one_of_rig_export(flight: rig.Flight, tmp_path: Path):
    export(flight.recorded, "parquet", tmp_path / "log.parquet")
    table = rig.read_log(flight.log).to_polars()
    assert table.equals(pl.read_parquet(tmp_path / "log.parquet")) and len(table) == 300
    assert table["pitch_rate.state.3"][[99, 110]].to_list() == ["ok", "failed"]
    some = flight.to_polars("pitch_rate", "control")
    assert {name.split(".")[0] for name in some.columns} == {"time_s", "pitch_rate", "control"}
    with pytest.raises(BadInput, match=r"unknown .pich_rate., nearest: pitch_rate"):
        flight.to_polars("pich_rate")


def test_a_plot_follows_the_vote_and_not_the_hardover(flight: rig.Flight):
    (axes,) = flight.plot("pitch_rate").axes
    labels = [line.get_label() for line in axes.get_lines()]
    assert labels == ["vote", "truth", "channel 1", "channel 2", "channel 3", "channel 4"]
    assert axes.get_ylabel() == "pitch_rate, deg/s" and axes.get_ylim()[1] < 10.0
    assert np.max(np.asarray(axes.get_lines()[4].get_ydata())) == pytest.approx(np.degrees(1.5))
    with pytest.raises(BadInput, match="unknown signal"):
        flight.plot("pich_rate")


def test_heading_through_north_is_drawn_without_a_jump():
    rows, s = new_block(3), INDEX["heading"]
    rows["truth"][:, s] = np.radians([359.0, 1.0, 3.0])
    rows["voted"][:, s] = np.radians([0.5, 359.5, 3.0])
    rows["channels"][:, s] = np.radians([[358.0, 0.0, 1.0, 178.5]] * 3)
    shown = series(rows, 100.0, "heading")
    assert shown.truth == pytest.approx([359.0, 361.0, 363.0]) and shown.voted == pytest.approx([360.5, 359.5, 363.0])
    assert shown.channels[1] == pytest.approx([358.0, 360.0, 361.0, 178.5 + 360.0])
    assert limits(shown, np.radians(2.0)) == pytest.approx((353.0, 369.0))


def test_a_channel_in_use_is_in_the_picture_unless_it_is_far_off():
    rows, s = new_block(2), INDEX["pitch_rate"]
    rows["channels"][:, s] = np.radians([0.0, 0.5, 8.0, 80.0])
    shown = series(rows, 100.0, "pitch_rate")
    assert limits(shown, np.radians(1.0)) == pytest.approx((-3.0, 9.0))
    rows["state"][:, s, 2] = State.FAILED
    assert limits(series(rows, 100.0, "pitch_rate"), np.radians(1.0)) == pytest.approx((-3.0, 3.0))


def test_a_representation_is_a_line_and_a_table_without_frames(flight: rig.Flight):
    log = flight.recorded
    assert repr(log) == "<Log F-16 pitch-rate hardover seed 1: survived, 3 s flown; isolated pitch_rate 3>"
    assert repr(flight) == f"<Flight{repr(log)[4:-1]}, log {flight.log}>"
    for table in (log._repr_html_(), flight._repr_html_()):
        assert flight.digest in table and "pitch_rate 3" in table and "manager cross-channel" in table
        assert "pitch rate, channel 3: hardover at " in table and len(table) < 3000
    assert "duration_s=3" in flight._repr_html_()


def test_a_title_cannot_break_the_table(flight: rig.Flight):
    log = flight.recorded
    metadata = {**log.metadata, "scenario": json.dumps({"title": "<script>"})}
    html = rig.Log(log.rate_hz, log.rows[:1], log.timing[:1], [], metadata, None, {})._repr_html_()
    assert "<script>" not in html and "&lt;script&gt;" in html and "not finished" in html


@pytest.mark.long
def test_the_cells_of_the_notebook_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    kept, again = (json.loads(PAGE.read_text()) for _ in range(2))
    notebook.execute(again)
    for old, new in zip(notebook.code_cells(kept), notebook.code_cells(again), strict=True):
        assert [sorted(one.get("data", one)) for one in old["outputs"]] == [
            sorted(one.get("data", one)) for one in new["outputs"]
        ]
        assert [one.get("text") for one in old["outputs"]] == [one.get("text") for one in new["outputs"]]


def test_the_notebook_is_kept_with_its_outputs_small_and_without_paths_of_a_machine():
    text = PAGE.read_text()
    cells = notebook.code_cells(json.loads(text))
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert all(cell["outputs"] for cell in cells) and len(text) < 200_000
    pictures = [one["data"]["image/png"] for cell in cells for one in cell["outputs"] if "image/png" in str(one)]
    assert len(pictures) == 2 and all(base64.b64decode(one).startswith(b"\x89PNG") for one in pictures)
    assert not re.search(r"/(home|tmp|root|work|Users)/", text)
