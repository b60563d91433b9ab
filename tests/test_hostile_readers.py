"""Each reading function with each thing that is no sound file; the table of readers is complete."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hostile_cases import readers
from hostile_cases.places import FOLDER_THINGS, REFUSED, THINGS
from hostile_cases.remade import exchanged

import rig
from rig.cli import main
from rig.core import frame
from rig.core.errors import BadInput, BadLog, RigError
from rig.core.event import Event
from rig.core.files import open_regular
from rig.core.frame import FLAT, TIMING
from rig.core.frame.fields import FIELDS
from rig.core.settings import read_toml
from rig.log import foreign, read_log
from rig.log.recordings.columns_file import Table
from rig.log.recordings.csv_file import TableFormat
from rig.log.scan import contents
from rig.log.writer import LogWriter
from rig.studies.campaign import compile_ahead, pool
from rig.unit.unit_file import Unit
from rig.world.sensors import noise_file as recorded

TOOL = Path(__file__).parent / "tools" / "hostile.py"
SPARSE = 20 << 30


def test_every_parameter_and_key_that_may_name_a_file_has_its_row():
    assert readers.missing() == []


def test_a_reader_without_a_row_is_noticed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(readers.READERS, "vote recorded")
    monkeypatch.delitem(readers.KEYS, "Sensor.noise_file")
    assert readers.missing() == ["vote recorded", "Sensor.noise_file"]


def test_each_reader_meets_each_thing_or_the_table_says_why_not():
    pairs = readers.pairs()
    for key, rows in {**readers.READERS, **readers.KEYS}.items():
        for number, row in enumerate(rows):
            for thing in FOLDER_THINGS if row.mark else THINGS:
                assert ((key, number, thing) in pairs) != bool(readers.not_for(row, thing))
            assert {thing for k, n, thing in pairs if (k, n) == (key, number)} >= REFUSED


@pytest.mark.long
def test_all_readers_answer_in_one_line(tmp_path: Path):
    report = tmp_path / "found.json"
    count = str(len(readers.pairs()))
    command = [sys.executable, str(TOOL), "--kind", "reader", "--cases", count, "--json", str(report)]
    with tempfile.TemporaryDirectory(prefix="rig") as short:  # a socket's path is short
        environment = {**os.environ, "TMPDIR": short}
        out = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=3600, check=False)
    assert report.exists(), out.stderr
    assert [case for case in json.loads(report.read_text()) if case["failed"]] == []


# Functions ----------------------------------------------------------------------------------------------------


def _unit(path: Path) -> str:
    unit = Unit.model_validate({"name": "u", "path": path.name})
    unit._folder = path.parent
    return unit.sha256()


READING: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "CSV": (".csv", Table),
    "Parquet": (".parquet", Table),
    "log": (".mcap", read_log),
    "what a log says": (".mcap", contents),
    "topics": (".mcap", foreign.topics),
    "TOML": (".toml", read_toml),
    "noise": (".csv", lambda path: recorded._bytes(path, "sensors.x.noise_file")),
}


def _socket(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as made:
        made.bind(f"{folder}/s")  # a socket's path is short
        Path(folder, "s").rename(path)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(SPARSE)


def _linked(path: Path) -> None:
    os.mkfifo(path.with_name("pipe"))
    path.symlink_to("pipe")


PLACES: dict[str, tuple[Callable[[Path], Any], str]] = {
    "FIFO": (os.mkfifo, "is a pipe"),
    "link to a FIFO": (_linked, "is a pipe"),
    "endless": (lambda path: path.symlink_to("/dev/zero"), "is a device"),
    "socket": (_socket, "is a socket"),
    "folder": (Path.mkdir, "is a folder"),
    "sparse": (_sparse, "larger|not an MCAP|magic bytes|longer than"),
    "missing": (lambda path: None, "no such file"),
    "link to itself": (lambda path: path.symlink_to(path.name), "symbolic links"),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("reading", READING)
def test_no_reader_waits_or_fills_memory(tmp_path: Path, reading: str, place: str):
    ending, read = READING[reading]
    path = tmp_path / f"x{ending}"
    make, says = PLACES[place]
    make(path)
    with pytest.raises(BadInput, match=says) as error:
        read(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)


def test_a_library_of_20_gb_is_refused_and_a_pipe_is_none(tmp_path: Path):
    _sparse(tmp_path / "u.so")
    with pytest.raises(BadInput, match=r"u.so: larger than 1024 MiB"):
        _unit(tmp_path / "u.so")
    os.mkfifo(tmp_path / "pipe.so")
    assert _unit(tmp_path / "pipe.so") == ""


def test_a_header_without_an_end_is_no_table_and_one_of_a_megabyte_is_cut_between_rows(tmp_path: Path):
    path = tmp_path / "x.csv"
    path.write_bytes(b"a" * (1 << 20) + b"b")
    with pytest.raises(BadInput, match=r"first line is longer than 1 MiB"):
        Table(path)
    names = [f"{'n' * 300}{i}" for i in range(400)]
    path.write_text("\n".join([",".join(names), *[",".join(["1.5"] * 400)] * 900]) + "\n")
    assert path.stat().st_size > 1 << 20
    assert Table(path, written=TableFormat()).column(names[-1]).tolist() == [1.5] * 900


def test_a_name_that_is_not_utf8_is_opened(tmp_path: Path):
    sound = tmp_path / "x.csv"
    sound.write_text("time_s,a.1\n0,1.5\n1,2.5\n")
    path = sound.rename(tmp_path / "odd\udce9.csv")
    assert Table(path).column("a.1").tolist() == [1.5, 2.5]
    with open_regular(path) as file:
        assert file.readline() == b"time_s,a.1\n"


# Commands -----------------------------------------------------------------------------------------------------


def _told(argv: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["rig", *argv])
    with pytest.raises(SystemExit) as end:
        main.main()
    return cast("int", end.value.code), capsys.readouterr().err


@pytest.mark.parametrize("content", [b'title = "\xff\xfe"\n', b'title = "\xed\xa0\x80"\n'])
@pytest.mark.parametrize("rest", [[], ["--json"]])
def test_a_scenario_that_is_not_utf8_is_refused_in_one_line(
    tmp_path: Path, content: bytes, rest: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path = tmp_path / "s.toml"
    path.write_bytes(content)
    code, err = _told(["fly", str(path), "--out", str(tmp_path / "logs"), *rest], monkeypatch, capsys)
    assert code == 2 and err.count("\n") == 1 and "s.toml: not valid TOML" in err
    assert not (tmp_path / "logs").exists()


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.fly(overrides=["duration_s=0.3", "faults=[]"], out=tmp_path_factory.mktemp("logs")).log


@pytest.mark.parametrize("begin", ["inf", "1e308", "99"])
def test_watch_from_beyond_the_end_is_refused(
    flown: Path, begin: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    code, err = _told(["watch", str(flown), "--from", begin], monkeypatch, capsys)
    assert code == 2 and err.count("\n") == 1 and "the log ends at 0.29 s" in err


def test_a_scheduler_without_an_address_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    argv = ["campaign", "run", "smoke", "--out", str(tmp_path / "o"), "--scheduler", ""]
    code, err = _told(argv, monkeypatch, capsys)
    assert code == 2 and err.count("\n") == 1 and "--scheduler" in err
    assert not (tmp_path / "o").exists()


def test_a_machine_that_starts_no_worker_is_a_failure_in_one_line(monkeypatch: pytest.MonkeyPatch):
    """As where there are no semaphores, and where Python itself cannot be read."""

    def none(*_: object, **__: object) -> None:
        raise NotImplementedError("no semaphores")

    monkeypatch.setattr(pool, "ProcessPoolExecutor", none)
    with pytest.raises(RigError, match="no workers can be started: no semaphores"):
        pool.Local(1)
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(RigError, match="/nowhere/python: cannot be started"), compile_ahead._child("part", 2):
        raise AssertionError("the block was entered")


# Logs ---------------------------------------------------------------------------------------------------------

CODED = [field.name for field in FIELDS if field.enum is not None or field.kind == "flag"]
COUNTED = ["level", "discrete_level", "reset", "discrete_reset"]


def _again(flown: Path, out: Path, change: Callable[[Any], None], result: Any = None) -> Path:
    """The log of ``flown`` written again, with right checksums, after ``change`` of what it holds."""
    log = read_log(flown)
    held = SimpleNamespace(rows=log.rows, timing=log.timing, events=log.events)
    change(held)
    with LogWriter(out, log.rate_hz, {**log.metadata}) as writer:
        writer.write(frame.Table(held.rows, timing=held.timing), held.events)
        writer.close(log.result if result is None else result)
    return out


@pytest.mark.parametrize("name", [*CODED, *COUNTED])
def test_a_number_without_a_meaning_is_damage(flown: Path, tmp_path: Path, name: str):
    def change(log: Any) -> None:
        log.rows[name][7] = 117

    with pytest.raises(BadLog, match=rf"damaged at byte \d+: {name} is 117 in a frame, allowed: at most \d+"):
        read_log(_again(flown, tmp_path / "x.mcap", change))


def test_the_last_member_of_each_enum_is_read(flown: Path, tmp_path: Path):
    def change(log: Any) -> None:
        for field in FIELDS:
            if field.enum is not None:
                log.rows[field.name][7] = max(field.enum)

    log = read_log(_again(flown, tmp_path / "x.mcap", change))
    assert log.rows.dtype == FLAT and log.timing.dtype == TIMING
    assert all((log.rows[field.name][7] == max(field.enum)).all() for field in FIELDS if field.enum is not None)


@pytest.mark.parametrize("key", ["unit", "keys"])
@pytest.mark.parametrize("text", ["nan", "[/red]", "", "[1]", '{"a": NaN}', '{"a": 1e999}', "[" * 100_000, "9" * 5000])
def test_a_result_that_is_no_table_is_damage(flown: Path, tmp_path: Path, key: str, text: str):
    result = {**(read_log(flown).result or {}), key: text}
    with pytest.raises(BadLog, match=f"'{key}' of its result is damaged"):
        read_log(_again(flown, tmp_path / "x.mcap", lambda log: None, result))


@pytest.mark.parametrize("rate", ["[[[", "nan", "inf", "0", "-100.0", "1e308", "5e-324", ""])
def test_a_rate_that_no_flight_has_is_refused_by_every_command(
    flown: Path, tmp_path: Path, rate: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path = tmp_path / "x.mcap"
    exchanged(flown, path, repr(read_log(flown).rate_hz), rate, mended=False)
    for argv in (["info", str(path)], ["export", str(path), "--to", "csv"], ["recover", str(path)]):
        code, err = _told(argv, monkeypatch, capsys)
        assert code == 2 and err.count("\n") == 1 and "rate_hz" in err


def test_an_event_at_a_time_beyond_all_clocks_is_damage(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from rig.log import writer

    times = writer.log_times
    late = np.uint64(2**63)

    def beyond(frames: Any, rate_hz: float) -> Any:
        return np.full(1, late) if len(frames) == 1 and frames[0] == 5 else times(frames, rate_hz)

    monkeypatch.setattr(writer, "log_times", beyond)
    monkeypatch.setattr(writer, "event_runs", lambda events: [])

    def change(log: Any) -> None:
        log.events = [Event(5, "info", "late", "x")]

    path = _again(flown, tmp_path / "x.mcap", change)
    with pytest.raises(BadLog, match="the time of an event is 9223372036854775808 ns"):
        read_log(path)
