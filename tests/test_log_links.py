"""The links of several computers in the log: the topic /ccdl, Log.parts["link"], the columns, a log that was cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from rig.core.frame import LINK, LinkState
from rig.flight.flight_result import Flight
from rig.flight.fly import fly
from rig.log import read_log, recover
from rig.log.export import export

A, B, C = range(3)
LOST = 'kind="link_loss", signal="ccdl.A-B", start_s=0.5'
BYZANTINE = 'kind="link_byzantine", signal="ccdl.C-B", offset_thresholds=5.0, start_s=1.0, duration_s=0.1'


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    sets = ["duration_s=2.5", "computers.count=4", f"faults=[{{{LOST}}}, {{{BYZANTINE}}}]"]
    return fly(None, overrides=sets, out=tmp_path_factory.mktemp("links"))


def test_links_are_receiver_by_sender_with_state_age_and_outvoted_words(flight: Flight):
    log = read_log(flight.log)
    assert log.parts is not None
    links = log.parts["link"]
    assert (links.shape, links.dtype) == ((250, 4, 4), LINK)
    assert (links["state"][-1, B, A], links["age"][-1, B, A]) == (LinkState.FAILED, 127)
    assert (links["state"][-1, A, B], links["age"][-1, A, B]) == (LinkState.FRESH, 0)
    assert np.flatnonzero(links["outvoted"][:, B, C]).tolist() == list(range(100, 110))
    assert {int(receiver) for _, receiver, _ in np.argwhere(links["outvoted"])} == {B}
    assert (links["state"][:, range(4), range(4)] == LinkState.ABSENT).all()
    assert log.parts.dtype.names == ("frame", "computer")  # it follows from the computers' records


def test_a_reader_that_knows_nothing_of_ours_reads_the_links_by_sender_and_receiver(flight: Flight):
    with flight.log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = [decoded for *_, decoded in reader.iter_decoded_messages(["/ccdl"])]
    assert len(messages) == 250
    last, lied = messages[-1], messages[105]
    assert (last.state_A_B, last.age_A_B, last.state_B_A) == (LinkState.FAILED, 127, LinkState.FRESH)
    assert lied.outvoted_C_B and not lied.outvoted_C_A and not lied.outvoted_B_C


def test_the_links_are_columns(flight: Flight, tmp_path: Path):
    table = flight.to_polars("ccdl")
    assert len(table.columns) == 1 + 3 * 12
    assert table["ccdl.state_A_B"][-1] == "failed" and table["ccdl.outvoted_C_B"].sum() == 10
    exported = export(flight.log, "npz", tmp_path / "links.npz", ["ccdl"])
    assert exported.columns == table.columns
    with np.load(tmp_path / "links.npz") as columns:
        assert columns["ccdl.age_A_B"].tolist() == table["ccdl.age_A_B"].to_list()


def test_a_log_that_was_cut_is_mended_with_lanes_that_are_those_of_the_whole(flight: Flight, tmp_path: Path):
    cut, mended = tmp_path / "cut.mcap", tmp_path / "mended.mcap"
    data = flight.log.read_bytes()
    cut.write_bytes(data[: len(data) * 6 // 10])  # within the second chunk
    assert not recover(cut, mended).complete
    saved, whole = read_log(mended), read_log(flight.log)
    assert saved.parts is not None and whole.parts is not None
    assert 100 <= len(saved.parts) == len(saved.rows) < 250
    assert saved.parts.tobytes() == whole.parts[: len(saved.parts)].tobytes()
    assert saved.rows.tobytes() == whole.rows[: len(saved.rows)].tobytes()
