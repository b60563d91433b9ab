"""What the viewer shows of the wall clock of a flight with a unit under test."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from rig.core.frame import TIMING, Table, new_block
from rig.flight.time_histogram import EDGES_US, binned
from rig.log.of_flight import metadata
from rig.scenario.scenario import load
from rig.show.viewer.facts import Facts, of_log
from rig.show.viewer.stream import open_stream


def streamed(folder: Path, facts: Facts, timing: Any) -> dict[str, list[Any]]:
    """Entities of a saved stream of two blocks, each with the batches of its chunks."""
    stream = open_stream("save", "a flight", 100.0, folder / "log.mcap", facts)
    assert stream is not None
    half = len(timing) // 2
    for first in (0, half):
        stream.put(Table(new_block(half, first), timing=timing[first : first + half]))
    report = stream.close(10.0)
    assert report.error == ""
    found: dict[str, list[Any]] = {}
    for chunk in RrdReader(report.where).stream():
        found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return found


@pytest.fixture
def timing() -> Any:
    timing = np.zeros(20, TIMING)
    timing["reply_us"] = [3.0] * 12 + [60.0] * 7 + [5e6]
    return timing


def test_reply_times_are_lines_and_a_histogram_up_to_the_cursor(tmp_path: Path, timing: Any) -> None:
    found = streamed(tmp_path, Facts(unit="mine"), timing)
    structs = [row for batch in found["/timing"] for row in batch["rig.Timing:message"].to_pylist()]
    assert [row[0]["reply_us"] for row in structs] == timing["reply_us"].tolist()
    bars = [row[0] for batch in found["/timing/replies"] for row in batch["BarChart:values"].to_pylist()]
    counts = [list(bar["buffer"]) for bar in bars]
    assert counts == [binned(timing["reply_us"][:10]).tolist(), binned(timing["reply_us"]).tolist()]
    assert "/timing/lateness" not in found, "nothing was late in lockstep"


def test_a_flight_of_our_own_manager_has_no_times(tmp_path: Path, timing: Any) -> None:
    assert not [path for path in streamed(tmp_path, Facts(), timing) if path.startswith("/timing")]


def test_a_log_names_its_unit_to_the_viewer() -> None:
    about = metadata(load(None))
    assert of_log({**about, "unit": '{"name": "mine"}'}).unit == "mine" and of_log(about).unit == ""


def test_a_time_lies_in_the_bin_whose_upper_edge_is_the_first_above_it() -> None:
    counts = binned(np.array([0.5, 1.0, 3.0, 1e9]))
    assert np.flatnonzero(counts).tolist() == [0, 1, 2, len(EDGES_US)]
