"""The stream: it never holds the flight up, counts what it drops, and stays on this machine."""

from __future__ import annotations

import resource
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import ProxyHandler, build_opener

import psutil
import pytest
from rerun.chunk import RrdReader

from rig.core.errors import BadInput, RigError
from rig.core.frame import FLAT, SIGNALS, Table, new_block
from rig.show.viewer import sink, viewer
from rig.show.viewer.blueprint import blueprint, decisive_span, main_signal, status_shown
from rig.show.viewer.facts import Facts, FaultFact, Layout, Seen, Shown, together
from rig.show.viewer.plots import strips_view
from rig.show.viewer.state_strips import of_signal
from rig.show.viewer.stream import Stream, open_stream

BLOCK = 10  # frames
ROOM = 3  # blocks


class FakeSink:
    """Takes blocks while its gate is open; waits, as a sink may, while it is shut."""

    where, browser = "nowhere", ""

    def __init__(self, *, is_open: bool = True, broken: bool = False) -> None:
        self.gate = threading.Event()
        self.taken: list[int] = []
        self.closed = False
        self.broken = broken
        if is_open:
            self.gate.set()

    def begin(self) -> None:
        self.gate.wait()

    def send(self, table: Table, rate_hz: float, events: Sequence[Any]) -> None:
        self.gate.wait()
        if self.broken:
            raise ValueError("no luck\nwith this one")
        self.taken.append(int(table["frame"][0]))

    def flush(self, timeout_s: float) -> None:
        pass

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def shut() -> Iterator[FakeSink]:
    sink = FakeSink(is_open=False)
    yield sink
    sink.gate.set()  # or its thread would wait for ever


def stream_to(sink: FakeSink) -> Stream:
    return Stream(sink, 100.0, queue_bytes=ROOM * BLOCK * FLAT.itemsize)


def put_blocks(stream: Stream, count: int) -> float:
    began = time.perf_counter()
    for i in range(count):
        stream.put(Table(new_block(BLOCK, i * BLOCK)))
    return time.perf_counter() - began


def test_all_blocks_reach_the_sink_in_order() -> None:
    sink = FakeSink()
    stream = Stream(sink, 100.0)
    put_blocks(stream, 20)
    report = stream.close(5.0)
    assert sink.taken == list(range(0, 200, BLOCK))
    assert (report.sent_frames, report.dropped_frames, report.error) == (200, 0, "")
    assert sink.closed


def test_a_sink_that_hangs_neither_holds_up_put_nor_close(shut: FakeSink) -> None:
    stream = stream_to(shut)
    assert put_blocks(stream, 1000) < 0.5
    began = time.perf_counter()
    report = stream.close(0.2)
    assert time.perf_counter() - began < 1.0
    assert (report.sent_frames, report.dropped_frames) == (0, 1000 * BLOCK)
    assert "did not finish within 0.2 s" in report.error


def test_a_full_queue_drops_and_counts_and_what_waits_is_sent_later(shut: FakeSink) -> None:
    stream = stream_to(shut)
    put_blocks(stream, ROOM + 4)
    shut.gate.set()
    report = stream.drain(5.0)
    assert (report.sent_frames, report.dropped_frames, report.error) == (ROOM * BLOCK, 4 * BLOCK, "")
    assert shut.taken == [0, 10, 20]
    stream.put(Table(new_block(BLOCK, 1000)))
    assert stream.close(5.0).sent_frames == (ROOM + 1) * BLOCK


def test_a_sink_that_fails_is_reported_in_one_line_and_its_frames_as_dropped() -> None:
    stream = Stream(FakeSink(broken=True), 100.0)
    put_blocks(stream, 2)
    report = stream.close(5.0)
    assert (report.sent_frames, report.dropped_frames, report.error) == (0, 20, "ValueError: no luck")


@pytest.mark.parametrize(
    "where",
    [
        *("on", "", "SAVE", "rerun+http://10.0.0.5:9876/proxy", "rerun+http://0.0.0.0:9876/proxy"),
        *("rerun+http://127.0.0.1.example.org:9876/proxy", "rerun+http://127.0.0.1:9876/proxy\n"),
        *("rerun+http://user@example.org:9876/proxy", "rerun+https://127.0.0.1:9876/proxy"),
        *("rerun+http://127.0.0.1:99999/proxy", "rerun+http://127.0.0.1/proxy", "http://127.0.0.1:9876"),
    ],
)
def test_other_machines_and_unknown_words_are_refused(where: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="allowed: off, save, serve, spawn or rerun"):
        open_stream(where, "t", 100.0, tmp_path / "log.mcap")


def test_an_address_where_no_program_listens_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no viewer listens"):
        open_stream(f"rerun+http://127.0.0.1:{viewer.free_port()}/proxy", "t", 100.0, tmp_path / "log.mcap")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="a display cannot be told beforehand here")
def test_a_viewer_without_a_display_is_refused_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    began = time.perf_counter()
    with pytest.raises(BadInput, match="no display"):
        open_stream("spawn", "t", 100.0, tmp_path / "log.mcap")
    assert time.perf_counter() - began < 1.0


def test_a_saved_recording_lies_beside_the_log_with_all_entities_and_the_layout(tmp_path: Path) -> None:
    stream = open_stream("save", "a flight", 100.0, tmp_path / "new" / "log.mcap")
    assert stream is not None
    put_blocks(stream, 3)
    report = stream.close(10.0)
    assert report.where == str(tmp_path / "new" / "log.rrd")
    assert (report.sent_frames, report.dropped_frames, report.error) == (3 * BLOCK, 0, "")
    reader = RrdReader(report.where)
    frames = dict.fromkeys((signal.topic for signal in SIGNALS), 0)
    for chunk in reader.stream():
        frames[chunk.entity_path] = frames.get(chunk.entity_path, 0) + chunk.num_rows
    assert {frames[signal.topic] for signal in SIGNALS} == {3 * BLOCK}
    assert {"/pitch_rate/pattern", "/path", "/track", "/about"} <= frames.keys()
    assert {"/discrete/gear_down", "/control", "/autopilot_command", "/flight", "/pose", "/position"} <= frames.keys()
    [recording], [layout] = reader.recordings(), reader.blueprints()
    assert layout.application_id == recording.application_id
    views = [chunk for chunk in reader.stream(store=layout) if chunk.entity_path.startswith("/view/")]
    assert len({chunk.entity_path.split("/")[2] for chunk in views}) > 3 * len(SIGNALS)


def test_a_recording_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.rrd").mkdir()
    with pytest.raises(BadInput, match=r"log\.rrd: cannot be written"):
        open_stream("save", "t", 100.0, tmp_path / "log.mcap")


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of a file")
def test_a_recording_on_a_full_disk_ends_with_the_reason_and_leaves_no_file(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, before[1]))
    try:
        stream = open_stream("save", "a flight", 100.0, tmp_path / "log.mcap")
        assert stream is not None
        put_blocks(stream, 3)
        report = stream.close(10.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert report.error == "File too large" and list(tmp_path.iterdir()) == []


def test_servers_listen_on_this_machine_alone_and_report_no_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.delenv("CI", raising=False)
    before = _listeners()
    stream = open_stream("serve", "t", 100.0, tmp_path / "log.mcap")
    assert stream is not None
    try:
        opened = _listeners() - before
        assert {address for address, _ in opened} == {"127.0.0.1"}
        port = int(stream.browser.removeprefix("http://127.0.0.1:").split("/")[0])
        assert port in {port for _, port in opened}
        assert len(opened) == 2  # data and page
        with build_opener(ProxyHandler({})).open(stream.browser, timeout=5) as page:
            assert b"re_viewer" in page.read()
            policy = page.headers["Content-Security-Policy"]
        assert policy.startswith("connect-src 'self' http://127.0.0.1:* ")
        assert "https:" not in policy
        put_blocks(stream, 2)
    finally:
        report = stream.close(5.0)
    assert (report.sent_frames, report.error) == (2 * BLOCK, "")
    assert _listeners() - before == set()
    assert not (tmp_path / "home").exists()  # where the viewer would keep its usage statistics


def test_servers_take_other_ports_when_theirs_are_taken_after_they_were_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free_port = viewer.free_port
    with _another_process_on_two_ports() as (data, page):
        monkeypatch.setattr(sink, "WEB_PORT", page)
        monkeypatch.setattr(viewer, "free_port", lambda preferred=0: data if preferred else free_port())
        before = _listeners()
        stream = open_stream("serve", "t", 100.0, tmp_path / "log.mcap")
        assert stream is not None
        opened = {port for _, port in _listeners() - before}
        report = stream.close(5.0)
    assert opened == {int(url.split(":")[2].split("/")[0]) for url in (report.where, stream.browser)}
    assert len(opened - {data, page}) == 2


@contextmanager
def _another_process_on_two_ports() -> Iterator[tuple[int, int]]:
    program = (
        "import socket, sys; held = [socket.create_server(('127.0.0.1', 0)) for _ in 'ab'];"
        "print(*(one.getsockname()[1] for one in held), flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        data, page = process.stdout.readline().split()
        yield int(data), int(page)
        process.stdin.close()


def test_servers_that_do_not_come_up_are_refused_and_leave_nothing_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = _listeners()
    monkeypatch.setattr(viewer, "opened", lambda port: False)
    with pytest.raises(RigError, match="data cannot be served: another process took every free port"):
        open_stream("serve", "t", 100.0, tmp_path / "log.mcap")
    assert _listeners() == before


def _listeners() -> set[tuple[str, int]]:
    found = psutil.Process().net_connections(kind="inet")
    return {(c.laddr.ip, c.laddr.port) for c in found if c.status == psutil.CONN_LISTEN}


def test_the_viewer_is_told_to_keep_its_statistics_off() -> None:
    given = {"FORCE_RERUN_ANALYTICS": "1", "PATH": "/bin"}
    assert viewer.environment(given) == {"PATH": "/bin", "CI": "true"}
    assert given == {"FORCE_RERUN_ANALYTICS": "1", "PATH": "/bin"}


def test_a_strip_keeps_its_own_look_where_another_of_the_view_shows_the_same_state_differently() -> None:
    strips = of_signal(SIGNALS[0])
    view = strips_view("strips", strips, [Shown()])
    looks = {state: look for strip in strips[:-1] for state, look in strip.looks.items()}
    differing = [strip.path for strip in strips if any(looks.get(s, look) != look for s, look in strip.looks.items())]
    assert list(view.visualizer_overrides) == differing == ["/pitch_rate/source"]
    assert view.contents == [strip.path for strip in strips]
    [shared] = view.defaults
    states = shared.values.as_arrow_array().to_pylist()
    assert {"OK", "SUSPECT", "FAILED", "OVER", "GROUND_CONTACT"} <= set(states)
    assert len(set(states)) == len(states)


def test_the_lanes_of_the_overview_are_all_signals_or_of_several_flights_those_with_something_to_tell() -> None:
    one = Facts(seen=Seen(noted=("heading",)))
    assert len(status_shown([Shown(facts=one)])) == len(SIGNALS)
    other = Facts(seen=Seen(noted=("pitch_rate",)))
    assert [lane.path for lane in status_shown(together([one, other]))] == ["/pitch_rate", "/heading"]


def test_the_main_signal_and_the_zoom_are_those_of_the_decisive_fault_or_of_the_first_one_to_come() -> None:
    fault = FaultFact("offset", "pitch_rate", (1,), 12.0)
    live = Facts(faults=(fault,))
    over = Facts(faults=(fault,), seen=Seen(main="heading", zoom_s=(3.5, 5.0)))
    healthy = Facts(seen=Seen())
    assert (main_signal([Shown(facts=live)]).name, decisive_span([Shown(facts=live)])) == ("pitch_rate", (11.5, 14.0))
    assert (main_signal([Shown(facts=over)]).name, decisive_span([Shown(facts=over)])) == ("heading", (3.5, 5.0))
    assert decisive_span([Shown(facts=healthy)]) is None
    assert decisive_span(together([over, healthy])) == (3.5, 5.0)


def test_a_layout_for_a_tab_that_does_not_exist_is_refused() -> None:
    with pytest.raises(BadInput, match="no tab 'nonsense'; there are: overview, rates"):
        blueprint(Layout(tab="nonsense"))


def test_a_tab_for_a_unit_is_only_there_when_one_was_flown() -> None:
    with pytest.raises(BadInput, match="no tab 'unit': no flight had a unit under test"):
        blueprint(Layout(tab="unit"))
    assert blueprint(Layout([Shown(facts=Facts(unit="mine"))], "unit")) is not None
