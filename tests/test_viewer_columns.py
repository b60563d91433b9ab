"""Rows as Rerun columns: nothing lost, and exactly what Rerun's importer makes of our log."""

from __future__ import annotations

import resource
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import Chunk, McapReader, RrdReader

from rig.core.errors import BadInput, BadLog, RigError
from rig.core.frame import (
    COMMANDS,
    FLAT,
    INDEX,
    SURFACES,
    TIMING,
    Block,
    DecidedBy,
    Ilm,
    Pattern,
    State,
    Table,
    new_block,
)
from rig.core.frame.fields import FIELD, places
from rig.core.units.constants import TWO_PI
from rig.flight.events import Event
from rig.log.schema import TOPICS_OF_ROWS, Topic
from rig.log.writer import LogWriter
from rig.show.viewer import derived, matrix
from rig.show.viewer import state_strips as lanes
from rig.show.viewer.facts import Facts, FaultFact
from rig.show.viewer.opened import read, save
from rig.show.viewer.rerun_columns import Columns, struct
from rig.show.viewer.scene import POINTS, TIMELINE, Scene, east_north_up, position
from rig.show.viewer.style import ALL_FAILED, STATE_LOOKS

RATE_HZ = 100.0
EVENTS = [Event(3, "info", "fault on", "one"), Event(5, "warning", "level", "two"), Event(7, "error", "end", "three")]


@pytest.fixture(scope="module")
def rows() -> Block:
    rng = np.random.default_rng(1)
    block = new_block(20, 500)
    for name in FLAT.names or ():
        if name != "frame":
            is_flag = name in FIELD and FIELD[name].kind == "flag"
            low, high = (-1.0, 1.0) if FLAT[name].base == np.float64 else (0, 2 if is_flag else 3)
            block[name] = rng.uniform(low, high, block[name].shape)
    return block


@pytest.fixture(scope="module")
def files(rows: Block, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same rows as our log and as a recording of the stream."""
    folder = tmp_path_factory.mktemp("view")
    log, streamed = folder / "log.mcap", folder / "streamed.rrd"
    events = [Event(500 + e.frame, e.level, e.name, e.text) for e in EVENTS]
    with LogWriter(log, RATE_HZ, {}) as writer:
        writer.write(Table(rows, timing=np.zeros(len(rows), TIMING)), events)
    recording = rr.RecordingStream("test")
    recording.save(streamed)
    Columns(recording, RATE_HZ).send(Table(rows), events)
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


@pytest.mark.parametrize("topic", TOPICS_OF_ROWS, ids=lambda topic: topic.name)
def test_every_field_of_a_struct_is_its_column_of_the_rows(rows: Block, topic: Topic) -> None:
    shown = struct(rows, topic)
    for column in places(topic.message):
        place = (slice(None), *(() if topic.item is None else (topic.item,)), *column.index)
        array = shown.field(column.name)
        values = array.field("value") if pa.types.is_struct(array.type) else array
        np.testing.assert_array_equal(values.to_numpy(zero_copy_only=False), rows[column.field][place])


def test_every_field_of_the_frame_is_shown_once() -> None:
    shown = {c.field for message in {topic.message for topic in TOPICS_OF_ROWS} for c in places(message)}
    assert shown == set(FLAT.names or ()) - {"frame"}


def test_the_importer_makes_the_same_components_of_our_log(files: tuple[Path, Path]) -> None:
    ours, theirs = components(RrdReader(files[1]).stream()), components(imported(files[0]))
    assert {name for _, name in ours if name.startswith("rig.Signal")} == {"rig.Signal:message"}
    alone = {f"{derived.VALUES}:values", f"{derived.DEGREES}:values"}  # the viewer's
    compared = [key for key in ours if key[0] in {path for path, _ in theirs} and key[1] not in alone]
    assert {key[0] for key in theirs} - {key[0] for key in compared} == {"/timing"}
    for key in compared:
        (our_times, our_values), (their_times, their_values) = ours[key], theirs[key]
        if key[0] in ("/pose", "/position"):  # in the log at every fourth frame
            our_times, our_values = our_times[::4], our_values[::4]
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
    ours = ours[::4]  # the log has every fourth
    np.testing.assert_allclose(np.abs((ours * theirs).sum(1)), (theirs**2).sum(1), rtol=1e-6)


def test_level_flight_to_the_north_points_the_nose_along_y() -> None:
    x, y, z, w = east_north_up(np.array([[1.0, 0.0, 0.0, 0.0]]))[0]
    nose = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]  # the rotation's first column
    np.testing.assert_allclose(nose, [0, 1, 0], atol=1e-12)


def test_a_log_shows_what_was_streamed(files: tuple[Path, Path], tmp_path: Path) -> None:
    save(read(files[:1]), tmp_path / "opened.rrd")
    opened, streamed = (components(RrdReader(f).stream()) for f in (tmp_path / "opened.rrd", files[1]))
    assert opened.keys() == streamed.keys()
    for key in opened:
        for one, other in zip(opened[key], streamed[key], strict=True):
            assert str(one) == str(other), key  # as text, for NaN is there to be equal to NaN


def test_a_file_on_a_full_disk_is_one_line_and_leaves_what_was_there(files: tuple[Path, Path], tmp_path: Path) -> None:
    opened, path, before = read(files[:1]), tmp_path / "opened.rrd", resource.getrlimit(resource.RLIMIT_FSIZE)
    path.write_text("of before")
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(RigError, match=r"opened\.rrd: cannot be written: File too large$") as error:
            save(opened, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not isinstance(error.value, BadInput)  # exit code 1
    assert list(tmp_path.iterdir()) == [path] and path.read_text() == "of before"


@pytest.mark.parametrize("contents", [b"", b"no log\n"])
def test_a_log_that_is_none_is_refused_and_leaves_nothing_behind(contents: bytes, tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(contents)
    with pytest.raises(BadLog, match=r"log\.mcap: not an MCAP file"):
        save(read([tmp_path / "log.mcap"]), tmp_path / "log.rrd")
    assert not (tmp_path / "log.rrd").exists()


def test_a_log_that_was_cut_off_is_refused_and_the_way_out_named(files: tuple[Path, Path], tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(files[0].read_bytes()[:-1000])
    with pytest.raises(BadLog, match=r"truncated at byte \d+; rig recover"):
        save(read([cut]), tmp_path / "cut.rrd")


def test_a_log_without_frames_and_too_many_logs_are_refused(files: tuple[Path, Path], tmp_path: Path) -> None:
    with LogWriter(tmp_path / "none.mcap", RATE_HZ, {}):
        pass
    with pytest.raises(BadLog, match=r"none\.mcap: has no frames"):
        read([tmp_path / "none.mcap"])
    with pytest.raises(BadInput, match="5 logs: 1 to 4 can be shown together"):
        read([files[0]] * 5)


def test_flights_that_lie_over_each_other_keep_their_columns_under_their_letter(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    other = tmp_path / "baseline" / files[0].name
    other.parent.mkdir()
    other.write_bytes(files[0].read_bytes())
    opened = read([files[0], other])
    assert "A " in opened.about.title
    assert f"B baseline/{files[0].stem}" in opened.about.title
    save(opened, tmp_path / "both.rrd")
    both, one = (components(RrdReader(f).stream()) for f in (tmp_path / "both.rrd", files[1]))
    assert {path for path, _ in both} == {f"/{tag}{path}" for path, _ in one for tag in "AB"}
    for tag in "AB":
        for one_part, both_part in zip(
            one["/control", "rig.Control:message"], both[f"/{tag}/control", "rig.Control:message"], strict=True
        ):
            assert one_part.equals(both_part)


def test_a_lane_has_one_entry_for_each_change_and_a_fault_ends() -> None:
    rows = new_block(6)
    rows["state"][2:4, 0, 1] = State.SUSPECT
    rows["acting"][1:3, 0] = 0b10
    found = {c.path: (c.rows.tolist(), c.states) for c in lanes.changes(rows, None, ["first", "second"])}
    told = ["OK", "SUSPECT", "OK"]
    assert found["/pitch_rate/channel_2"] == ([0, 2, 4], told)
    assert found["/pitch_rate/channel_1"] == ([0], ["OK"])
    assert found["/pitch_rate"] == ([0, 2, 4], ["0000", "0100", "0000"])
    assert found["/fault_2"] == ([1, 3], ["ACTING", ""])
    assert "/fault_1" not in found


@pytest.mark.parametrize(
    ("states", "words", "color"),
    [
        ([0, 0, 0, 0], "ok", STATE_LOOKS["OK"][1]),
        ([0, 1, 0, 0], "channel 2 suspect", STATE_LOOKS["SUSPECT"][1]),
        ([1, 0, 2, 2], "channel 3, 4 failed; channel 1 suspect", STATE_LOOKS["FAILED"][1]),
        ([2, 2, 2, 3], "all failed", ALL_FAILED),
    ],
)
def test_the_lane_of_a_signal_says_which_channels_are_not_ok(states: list[int], words: str, color: Any) -> None:
    rows = new_block(1)
    rows["state"][0, INDEX["heading"]] = states
    lane = lanes.STATUS[INDEX["heading"]]
    [told] = [c.states for c in lanes.changes(rows, None, []) if c.path == lane.path == "/heading"]
    assert [lane.looks[state] for state in told] == [(words, color)]


def test_the_matrix_has_a_cell_for_each_channel_and_changes_with_any_state() -> None:
    rows = new_block(4)
    rows["state"][2:, 15, 3] = State.FAILED
    assert lanes.moved(rows["state"], None).tolist() == [0, 2]
    assert lanes.moved(rows["state"][1:], rows["state"][:1]).tolist() == [1]
    shades = matrix.colors(rows["state"])
    assert shades.shape == (4, len(matrix.cells()), 3) == (4, 64, 3)
    assert [tuple(c) for c in shades[:, 63]] == [STATE_LOOKS["OK"][1]] * 2 + [STATE_LOOKS["FAILED"][1]] * 2
    assert (shades[:, :63] == STATE_LOOKS["OK"][1]).all()


def derive(rows: Block, name: str, facts: Facts, *names: str) -> np.ndarray:
    """(n, names) of what is derived of one signal."""
    return derived.Derived(facts).values(rows)[INDEX[name]][:, [derived.NAMES.index(n) for n in names]]


CH = ("ch_1", "ch_2", "ch_3", "ch_4")


def test_deviation_leaves_out_what_is_not_trusted_and_goes_the_short_way_round() -> None:
    rows = new_block(1)
    heading = INDEX["heading"]
    rows["truth"][:, heading], rows["voted"][:, heading] = 0.1, TWO_PI - 0.1
    rows["channels"][:, heading] = TWO_PI - 0.2
    rows["state"][:, heading] = [State.OK, State.SUSPECT, State.FAILED, State.OK]
    rows["channels"][:, heading, 3] = 0.3
    for threshold, fourth in ((0.2, np.nan), (0.5, 0.2), (np.nan, 0.2)):  # 0.4 from the vote
        facts = Facts(thresholds={"heading": threshold})
        [found] = derive(rows, "heading", facts, "off_voted", *(f"off_{ch}" for ch in CH))
        np.testing.assert_allclose(np.radians(found), [-0.2, -0.3, np.nan, np.nan, fourth], atol=1e-6)


def test_the_difference_is_in_thresholds_and_a_hardover_stays_at_the_edge() -> None:
    rows = new_block(1)
    rows["voted"][:, 0], rows["truth"][:, 0] = 0.02, 0.01
    rows["channels"][:, 0] = [0.03, 0.02, 1.5, -1.5]
    [found] = derive(
        rows, "pitch_rate", Facts(thresholds={"pitch_rate": 0.04}), *(f"apart_{n}" for n in ("truth", *CH))
    )
    np.testing.assert_allclose(found, [-0.25, 0.25, 0.0, 1.5, -1.5], atol=1e-6)
    [bounds] = derive(rows, "pitch_rate", Facts(), "apart_low", "apart_high")
    assert bounds.tolist() == [-1.0, 1.0]


def test_a_heading_through_north_is_drawn_in_degrees_without_a_jump_in_blocks_of_any_size() -> None:
    rows, degrees = new_block(300), np.linspace(300.0, 660.0 + 90.0, 300)  # more than once around
    heading = INDEX["heading"]
    rows["truth"][:, heading] = np.radians(degrees % 360.0)
    rows["voted"][:, heading] = np.radians((degrees + 1.0) % 360.0)
    rows["channels"][:, heading] = np.radians((degrees[:, None] - 2.0) % 360.0)
    for size in (1, 7, 300):
        drawing = derived.Derived(Facts())
        blocks = [drawing.values(rows[k : k + size])[heading] for k in range(0, 300, size)]
        values = dict(zip(derived.NAMES, np.concatenate(blocks).T, strict=True))
        np.testing.assert_allclose(values["truth"], degrees, atol=1e-3)
        np.testing.assert_allclose(values["voted"], degrees + 1.0, atol=1e-3)
        np.testing.assert_allclose(values["ch_4"], degrees - 2.0, atol=1e-3)


def test_an_angle_that_is_not_a_number_for_a_while_goes_on_where_it_was() -> None:
    rows = new_block(3)
    rows["truth"][:, INDEX["heading"]] = [TWO_PI - 0.1, np.nan, 0.1]
    for blocks in ([rows], [rows[:2], rows[2:]]):
        drawing = derived.Derived(Facts())
        truth = np.concatenate(
            [drawing.values(block)[INDEX["heading"]][:, derived.NAMES.index("truth")] for block in blocks]
        )
        np.testing.assert_allclose(np.radians(truth[[0, 2]]), [TWO_PI - 0.1, TWO_PI + 0.1], atol=1e-5)
        assert np.isnan(truth[1])


def test_the_band_is_the_vote_with_the_threshold_either_side_and_marks_the_fault() -> None:
    rows = new_block(3)
    rows["voted"][:, 0] = np.radians([1.0, 2.0, 3.0])
    rows["acting"][1, 0] = 0b100  # fault 3 alone, which sits on pitch rate
    places = ("heading", "elsewhere", "pitch_rate+roll_rate")
    facts = Facts(thresholds={"pitch_rate": np.radians(0.5)}, faults=tuple(FaultFact("", place) for place in places))
    names = ("low", "high", "fault", "apart_fault")
    expected = [[0.5, 1.5, np.nan, np.nan], [1.5, 2.5, 2.0, 0.0], [2.5, 3.5, np.nan, np.nan]]
    np.testing.assert_allclose(derive(rows, "pitch_rate", facts, *names), expected, rtol=1e-6)
    assert np.isfinite(derive(rows, "roll_rate", facts, "fault")).tolist() == [[False], [True], [False]]
    assert not np.isfinite(derive(rows, "heading", facts, "fault")).any()


def test_angles_of_control_are_in_degrees_and_a_heading_is_around_north() -> None:
    rows = new_block(1)
    rows["command"][:, COMMANDS.index("heading_rad")] = np.radians(359.0)
    rows["surface_command"][:, SURFACES.index("rudder_rad")] = np.radians(-4.0)
    [found] = derived.degrees(rows)
    at = dict(zip(derived.DEGREE_NAMES, found, strict=True))
    assert at["command_heading_rad"] == pytest.approx(-1.0)
    assert at["surface_command_rudder_rad"] == pytest.approx(-4.0)
    assert at["surface_rudder_rad"] == 0.0


def test_the_path_stays_short_and_keeps_beginning_and_shape() -> None:
    recording = rr.RecordingStream("test")
    scene = Scene(recording, "", (1, 2, 3))
    for first in range(0, 60_000, 1000):
        rows = new_block(1000, first)
        rows["flight"][:, 2] = rows["frame"]  # north, m
        scene.send(rows, rows["frame"] * 1e7)
    north = scene._path[:, 1]
    assert POINTS // 4 < len(north) < POINTS
    assert north[0] == 0
    assert north[-1] > 58_000
    assert np.ptp(np.diff(north)) <= np.diff(north).max() / 2  # evenly, whatever was thinned out


def test_places_are_written_as_people_read_them() -> None:
    assert position(-36.5, 8.25) == "36.5000° S 8.2500° E"
    assert position(36.5, -8.25) == "36.5000° N 8.2500° W"


def test_a_code_that_its_enum_does_not_know_is_shown_without_a_name() -> None:
    rows = new_block(2)
    rows["pattern"][1] = 200
    shown = struct(rows, TOPICS_OF_ROWS[0]).field("pattern").to_pylist()
    assert shown == [{"name": Pattern.NORMAL.name, "value": 0}, {"name": None, "value": 200}]


@pytest.mark.parametrize(("source", "enum"), [("decided_by", DecidedBy), ("ilm_1", Ilm), ("st_1", State)])
def test_enums_are_shown_by_name(source: str, enum: Any) -> None:
    rows = new_block(len(enum))
    for field in ("decided_by", "ilm", "state"):
        rows[field].T[:] = np.arange(len(enum))
    shown = struct(rows, TOPICS_OF_ROWS[0]).field(source).to_pylist()
    assert shown == [{"name": member.name, "value": member.value} for member in enum]
