"""The redundancy page: what it says of a frame, live and from a log, on a terminal and in a pipe."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core.errors import BadInput, BadLog
from rig.core.frame import SIGNALS, TIMING, Block, DecidedBy, End, Pattern, Source, State, Table, new_block
from rig.flight.events import Event
from rig.log import read_log
from rig.log.writer import LogWriter
from rig.show.terminal.draw import InPipe, InProcess, OnTerminal
from rig.show.terminal.live import Watch, play, watching
from rig.show.terminal.redundancy_page import EVENTS, Page

RATE_HZ = 100.0
TOLD = [Event(100, "info", "fault on", "offset pitch_rate.2"), Event(110, "warning", "channel failed", "it failed")]


def flown(frames: int = 200) -> Block:
    """Pitch rate: channel 2 failed, channel 3 suspected; heading: lost, control goes on with its reference."""
    rows = new_block(frames)
    rows["channels"][:, 0] = [0.1, 0.9, 0.3, -0.125]
    rows["voted"][:, 0] = 0.2
    rows["level"] = 4
    rows["level"][:, 0], rows["level"][:, 15] = 2, 0
    rows["state"][:, 0] = [State.OK, State.FAILED, State.SUSPECT, State.OK]
    rows["pattern"][:, 0], rows["decided_by"][:, 0] = Pattern.P2_2, DecidedBy.REFERENCE
    rows["pattern"][:, 15], rows["source"][:, 15] = Pattern.LOST, Source.REFERENCE
    rows["channels"][:, 15] = np.nan
    rows["acting"][:, 0] = 0b101
    return rows


def terminal(width: int = 120) -> Console:
    return Console(
        file=io.StringIO(), force_terminal=True, width=width, height=40, record=True, color_system="truecolor"
    )


def pipe() -> Console:
    return Console(file=io.StringIO(), force_terminal=False, width=120, record=True)


def drawn(row: Block, width: int = 120) -> Console:
    page, screen = Page("a flight"), terminal(width)
    page.note(TOLD, RATE_HZ)
    screen.print(page.draw(Table(np.atleast_1d(row)), RATE_HZ))
    return screen


def test_a_page_says_what_each_channel_and_signal_is() -> None:
    lines = drawn(flown()[150]).export_text().splitlines()
    assert lines[0].split() == ["a", "flight", "1.50", "s", "law", "autopilot", "2", "faults", "acting"]
    [pitch] = [line for line in lines if line.startswith("pitch_rate")]
    assert pitch.split() == [
        *("pitch_rate", "deg/s", "5.730", "51.566x", "17.189?", "-7.162", "11.459", "2", "2:2", "reference"),
    ]
    [heading] = [line for line in lines if line.startswith("heading")]
    assert heading.split() == [
        *("heading", "deg", "nan", "nan", "nan", "nan", "0.000", "0", "lost", "control:", "reference"),
    ]
    assert any(line.startswith("? suspect, x failed, - not fitted") for line in lines)
    names = [line.split(" ")[0] for line in lines]
    assert [name for name in names if name in {signal.name for signal in SIGNALS}] == [s.name for s in SIGNALS]
    assert lines[-EVENTS:][:2] == [
        "     1.00 s  fault on          offset pitch_rate.2",
        "     1.10 s  channel failed    it failed",
    ]


def test_channels_are_coloured_by_their_state() -> None:
    html = drawn(flown()[150]).export_html(inline_styles=True)
    for value, color in (("5.730", "008000"), ("51.566x", "800000"), ("17.189?", "808000")):
        before = html[: html.index(value)]
        assert f"color: #{color}" in before[before.rindex("<span") :], value


def test_angles_around_north_are_read_together() -> None:
    rows = flown(1)
    rows["channels"][:, 15], rows["voted"][:, 15] = np.radians([359.75, 0.5, 0.25, 359.5]), np.radians(359.75)
    rows["channels"][:, 14], rows["voted"][:, 14] = np.radians([-0.5, 0.0, 0.25, -0.25]), np.radians(-0.125)
    lines = [line.split() for line in drawn(rows[0]).export_text().splitlines()]
    heading, roll = (next(line for line in lines if line[:1] == [name]) for name in ("heading", "roll_angle"))
    assert heading[2:7] == ["359.75", "360.50", "360.25", "359.50", "359.75"]
    assert roll[2:7] == ["-0.500", "0.000", "0.250", "-0.250", "-0.125"]


def test_a_page_fits_eighty_columns_and_keeps_its_height() -> None:
    row, page, screen = flown()[0], Page(), terminal(80)
    screen.print(page.draw(Table(np.atleast_1d(row)), RATE_HZ))
    bare = screen.export_text().splitlines()
    assert max(map(len, bare)) <= 80
    assert any("51.566x" in line and "-7.162" in line for line in bare)
    for count in (1, EVENTS, EVENTS + 5):
        page = Page()
        page.note([Event(i, "error", "level", f"event {i}") for i in range(count)], RATE_HZ)
        screen.print(page.draw(Table(np.atleast_1d(row)), RATE_HZ))
        text = screen.export_text().splitlines()
        assert len(text) == len(bare) + 1 + EVENTS
    assert "event 10" in text[-1]  # the latest stay


def test_the_end_of_a_flight_is_on_the_page() -> None:
    rows = flown(1)
    rows["end"] = End.DEPARTURE_LOAD_FACTOR
    assert "load factor beyond its limit" in drawn(rows[0]).export_text().splitlines()[0]


def test_a_live_page_shows_the_last_frame_and_all_events_and_delays_no_process() -> None:
    screen = terminal()
    watch = Watch(OnTerminal(screen), None)
    began = time.monotonic()
    for first in range(0, 2000, 100):
        rows = flown(100)
        rows["frame"] += first
        watch(Table(rows), RATE_HZ, [Event(first, "info", "reference", f"event at {first}")])
    assert time.monotonic() - began < 0.5
    watch.close()
    text = screen.export_text()
    assert "19.99 s  law autopilot" in text
    assert "event at 1900" in text
    assert watch.drawn <= 5  # the rest came faster than it can be drawn


def test_a_paced_page_is_drawn_several_times_a_block() -> None:
    watch = Watch(OnTerminal(terminal()), 1.0)
    watch(Table(flown(50)), RATE_HZ, [])
    time.sleep(0.6)
    watch.close()
    assert 3 <= watch.drawn <= 8


def test_what_draws_may_hang_and_does_not_hold_the_flight_up() -> None:
    class Stuck(InPipe):
        gate = threading.Event()

        def draw(self, row: Any, rate_hz: float, events: Sequence[Event]) -> None:
            self.gate.wait()

    watch = Watch(Stuck(pipe()), None)
    began = time.monotonic()
    for _ in range(100):
        watch(Table(flown(10)), RATE_HZ, [])
    watch.close(0.2)
    assert time.monotonic() - began < 1.0
    Stuck.gate.set()


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals there")
def test_on_a_terminal_another_process_draws_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    import pty

    ours, theirs = pty.openpty()
    real = subprocess.Popen
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(subprocess, "Popen", lambda *args, **more: real(*args, **more, stderr=theirs))
    drawer = InProcess()
    drawer.draw(None, RATE_HZ, TOLD[:1])
    drawer.draw(Table(flown()[150:151]), RATE_HZ, TOLD[1:])
    drawer.close()
    os.close(theirs)
    text = ""
    with contextlib.suppress(OSError):  # the end, on Linux
        while part := os.read(ours, 65536):
            text += part.decode()
    os.close(ours)
    for said in ("1.50 s", "51.566x", "offset pitch_rate.2", "it failed"):
        assert said in text


def test_a_process_that_is_gone_is_not_waited_for() -> None:
    drawer = InProcess()
    drawer._process.kill()
    drawer._process.wait()
    for _ in range(100):
        drawer.draw(Table(flown(1)), RATE_HZ, TOLD)
    drawer.close()


def test_in_a_pipe_events_are_lines_and_the_page_comes_once_at_the_end() -> None:
    screen = pipe()
    watch = Watch(InPipe(screen), None)
    watch(Table(flown()), RATE_HZ, TOLD)
    watch.close()
    lines = screen.export_text().splitlines()
    assert lines[:2] == [
        "     1.00 s  fault on          offset pitch_rate.2",
        "     1.10 s  channel failed    it failed",
    ]
    assert sum(line.startswith("pitch_rate ") for line in lines) == 1
    assert "\x1b" not in screen.file.getvalue()  # type: ignore[attr-defined]


def test_no_viewer_watches_unless_asked() -> None:
    with watching(False, None) as watch:
        assert watch is None


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("watch") / "a_flight.mcap"
    rows = flown()
    with LogWriter(path, RATE_HZ, {}) as writer:
        writer.write(Table(rows, timing=np.zeros(len(rows), TIMING)), TOLD)
    return path


def test_a_log_is_played_at_its_speed_from_where_it_is_asked(log: Path) -> None:
    now, screen = [0.0], terminal()

    def sleep(seconds: float) -> None:
        now[0] += seconds

    play(read_log(log), "a flight", screen, speed=2.0, from_s=0.5, clock=lambda: now[0], sleep=sleep)
    assert now[0] == pytest.approx(1.5 / 2.0, abs=0.15)  # what was left of two seconds, twice as fast
    text = screen.export_text()
    for time_s in ("0.50 s", "0.70 s", "1.99 s"):
        assert f"{time_s}  law" in text
    assert "0.10 s  law" not in text
    first, *_, last = text.split("a flight ")[1:]
    assert "it failed" not in first
    assert "it failed" in last


def test_a_log_in_a_pipe_is_its_events_and_its_last_page(log: Path) -> None:
    done = CliRunner().invoke(app, ["watch", str(log), "--from", "1.05"])
    assert done.exit_code == 0
    lines = done.output.splitlines()
    assert lines[0] == "     1.10 s  channel failed    it failed"
    assert lines[1].split()[:3] == ["a_flight", "1.99", "s"]


def test_what_cannot_be_played_is_refused_in_one_line(log: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"--from 2: the log ends at 1\.99 s"):
        play(read_log(log), "", pipe(), from_s=2.0)
    (tmp_path / "cut.mcap").write_bytes(log.read_bytes()[:-100])
    (tmp_path / "foreign.mcap").write_bytes(b"something else")
    for name, says in (("cut", "truncated at byte"), ("foreign", "not an MCAP file"), ("none", "no such file")):
        done = CliRunner().invoke(app, ["watch", str(tmp_path / f"{name}.mcap")])
        assert isinstance(done.exception, BadLog)
        assert says in str(done.exception)
        assert "\n" not in str(done.exception)


def test_watching_and_json_exclude_each_other() -> None:
    done = CliRunner().invoke(app, ["fly", "--watch", "--json"])
    assert isinstance(done.exception, BadInput)
    assert "--watch: not with --json" in str(done.exception)


def test_a_flight_that_is_watched_is_the_same_flight(tmp_path: Path) -> None:
    import rig

    screen = terminal()
    watch = Watch(OnTerminal(screen), None)
    watched = rig.fly("f16_split_2_2_level", overrides=["duration_s=11"], out=tmp_path, watch=watch)
    watch.close()
    alone = rig.fly("f16_split_2_2_level", overrides=["duration_s=11"], out=tmp_path)
    assert watched.digest == alone.digest
    text = screen.export_text()
    assert "pitch_rate.3 isolated by reference" in text
    assert "10.99 s  law autopilot" in text
