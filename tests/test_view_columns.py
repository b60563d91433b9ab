"""Rows as Rerun columns: nothing lost, and exactly what Rerun's importer makes of our log."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import Chunk, McapReader, RrdReader

from rig.errors import BadLog
from rig.events import Event
from rig.frame import FRAME, INDEX, SIGNALS, TIMING, TWO_PI, Block, Ilm, Pattern, Resolver, State, new_block
from rig.log import LogWriter
from rig.names import places
from rig.view import deviation
from rig.view.columns import ENTITIES, TIMELINE, east_north_up, send_block, struct
from rig.view.opened import log_to_rrd

RATE_HZ = 100.0
EVENTS = [Event(3, "info", "fault on", "one"), Event(5, "warning", "level", "two"), Event(7, "error", "end", "three")]


@pytest.fixture(scope="module")
def rows() -> Block:
    rng = np.random.default_rng(1)
    block = new_block(20, 500)
    for name in FRAME.names or ():
        if name != "frame":
            is_flag = name in ("valid", "reference_usable")
            low, high = (-1.0, 1.0) if FRAME[name].base == np.float64 else (0, 2 if is_flag else 3)
            block[name] = rng.uniform(low, high, block[name].shape)
    return block


@pytest.fixture(scope="module")
def files(rows: Block, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same rows as our log and as a recording of the stream."""
    folder = tmp_path_factory.mktemp("view")
    log, streamed = folder / "log.mcap", folder / "streamed.rrd"
    events = [Event(500 + e.frame, e.level, e.name, e.text) for e in EVENTS]
    with LogWriter(log, RATE_HZ, {}) as writer:
        writer.write(rows, np.zeros(len(rows), TIMING), events)
    recording = rr.RecordingStream("test")
    recording.save(streamed)
    send_block(recording, rows, RATE_HZ, events)
    recording.disconnect()
    return log, streamed


def imported(log: Path) -> Iterable[Chunk]:
    return McapReader(log, timeline_type="duration").stream()


def components(chunks: Iterable[Chunk]) -> dict[tuple[str, str], tuple[Any, Any]]:
    """(entity, component) -> (times, values) of all that carries our timeline."""
    found: dict[tuple[str, str], tuple[Any, Any]] = {}
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if TIMELINE in batch.schema.names:
            for name in batch.schema.names:
                if ":" in name:
                    found[chunk.entity_path, name] = batch[TIMELINE], batch[name]
    return found


@pytest.mark.parametrize("entity", ENTITIES, ids=lambda entity: entity.path)
def test_every_field_of_a_struct_is_its_column_of_the_rows(rows: Block, entity: Any) -> None:
    shown = struct(rows, entity)
    for column in places(entity.archetype):
        place = (slice(None), *(() if entity.item is None else (entity.item,)), *column.index)
        array = shown.field(column.name)
        values = array.field("value") if pa.types.is_struct(array.type) else array
        np.testing.assert_array_equal(values.to_numpy(zero_copy_only=False), rows[column.field][place])


def test_every_field_of_the_frame_is_shown_once() -> None:
    shown = {c.field for archetype in {e.archetype for e in ENTITIES} for c in places(archetype)}
    assert shown == set(FRAME.names or ()) - {"frame"}


def test_the_importer_makes_the_same_components_of_our_log(files: tuple[Path, Path]) -> None:
    ours, theirs = components(RrdReader(files[1]).stream()), components(imported(files[0]))
    assert {name for _, name in ours if name.startswith("rig.Signal")} == {"rig.Signal:message"}
    compared = [key for key in ours if not key[0].startswith("/deviation")]
    assert {key[0] for key in theirs} - {key[0] for key in compared} == {"/timing"}
    for key in compared:
        (our_times, our_values), (their_times, their_values) = ours[key], theirs[key]
        assert our_times.equals(their_times), key
        assert our_values.type == their_values.type, key
        if pa.types.is_struct(our_values.type.value_type):
            assert our_values.equals(their_values), key


def test_attitude_is_the_one_in_the_log_up_to_its_sign(files: tuple[Path, Path]) -> None:
    key = ("/pose", "Transform3D:quaternion")
    ours, theirs = (
        np.array(components(chunks)[key][1].to_pylist()).reshape(-1, 4)
        for chunks in (RrdReader(files[1]).stream(), imported(files[0]))
    )
    np.testing.assert_allclose(np.abs((ours * theirs).sum(1)), (theirs**2).sum(1), rtol=1e-6)


def test_level_flight_to_the_north_points_the_nose_along_y() -> None:
    x, y, z, w = east_north_up(np.array([[1.0, 0.0, 0.0, 0.0]]))[0]
    nose = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]  # the rotation's first column
    np.testing.assert_allclose(nose, [0, 1, 0], atol=1e-12)


def test_a_log_shows_the_deviations_that_were_streamed(files: tuple[Path, Path], tmp_path: Path) -> None:
    log_to_rrd(files[0], tmp_path / "opened.rrd")
    opened, streamed = (components(RrdReader(f).stream()) for f in (tmp_path / "opened.rrd", files[1]))
    for signal in SIGNALS:
        key = (deviation.path(signal), "rig.Deviation:message")
        for one, other in zip(opened[key], streamed[key], strict=True):
            assert str(one) == str(other)  # as text, for NaN is there to be equal to NaN


def test_a_log_that_is_none_is_refused_and_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(b"no log\n")
    with pytest.raises(BadLog, match=r"log\.mcap: cannot be shown"):
        log_to_rrd(tmp_path / "log.mcap", tmp_path / "log.rrd")
    assert not (tmp_path / "log.rrd").exists()


def test_a_log_that_was_cut_off_is_shown_as_far_as_it_goes(rows: Block, tmp_path: Path) -> None:
    log, cut = tmp_path / "log.mcap", tmp_path / "cut.mcap"
    with LogWriter(log, RATE_HZ, {}) as writer:
        for part in (rows[:10], rows[10:]):
            writer.write(part, np.zeros(len(part), TIMING))
        whole = log.stat().st_size
        writer.write(new_block(10, 520), np.zeros(10, TIMING))
    cut.write_bytes(log.read_bytes()[: whole + 100])
    log_to_rrd(cut, tmp_path / "cut.rrd")
    shown = [c for c in RrdReader(tmp_path / "cut.rrd").stream() if c.entity_path == deviation.path(SIGNALS[0])]
    assert sum(chunk.num_rows for chunk in shown) == 20


def test_deviation_leaves_out_what_is_not_trusted_and_goes_the_short_way_round() -> None:
    rows = new_block(1)
    heading = INDEX["heading"]
    rows["truth"][:, heading], rows["voted"][:, heading] = 0.1, TWO_PI - 0.1
    rows["channels"][:, heading] = TWO_PI - 0.2
    rows["state"][:, heading] = [State.OK, State.SUSPECT, State.FAILED, State.OK]
    found = list(deviation.from_rows(rows, heading)[0].as_py().values())
    np.testing.assert_allclose(found, [-0.3, np.nan, np.nan, -0.3, -0.2], atol=1e-12)


def test_a_code_that_its_enum_does_not_know_is_shown_without_a_name() -> None:
    rows = new_block(2)
    rows["pattern"][1] = 200
    shown = struct(rows, ENTITIES[0]).field("pattern").to_pylist()
    assert shown == [{"name": Pattern.NORMAL.name, "value": 0}, {"name": None, "value": 200}]


@pytest.mark.parametrize(("source", "enum"), [("resolver", Resolver), ("ilm_1", Ilm), ("st_1", State)])
def test_enums_are_shown_by_name(source: str, enum: Any) -> None:
    rows = new_block(len(enum))
    for field in ("resolver", "ilm", "state"):
        rows[field].T[:] = np.arange(len(enum))
    shown = struct(rows, ENTITIES[0]).field(source).to_pylist()
    assert shown == [{"name": member.name, "value": member.value} for member in enum]
