"""``rig fly --rerun serve``: the flight waits for a viewer, and is served until Ctrl-C."""

import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from rig.cli.fly import Watching
from rig.core.interrupt import Stop
from rig.show.viewer import viewer


class Served:
    """A stream that is served: watched after so many looks."""

    browser = "http://127.0.0.1:9090/"

    def __init__(self, looks: int) -> None:
        self.looks, self.drained = looks, 0

    @property
    def watched(self) -> bool:
        self.looks -= 1
        return self.looks < 0

    def drain(self) -> None:
        self.drained += 1


def test_a_flight_begins_when_a_viewer_is_connected(capsys: pytest.CaptureFixture[str]):
    stream = Served(2)
    Watching().opened(stream, Stop())  # pyright: ignore[reportArgumentType]
    assert (
        stream.looks == -1
        and "the flight starts when a viewer is connected (--no-wait: at once)" in capsys.readouterr().err
    )


def test_it_waits_for_no_viewer_when_told_so_or_when_it_is_given_up(capsys: pytest.CaptureFixture[str]):
    stream, stop = Served(10**9), Stop()
    Watching(wait=False).opened(stream, stop)  # pyright: ignore[reportArgumentType]
    assert "starts when" not in capsys.readouterr().err
    stop.requested = True
    Watching().opened(stream, stop)  # pyright: ignore[reportArgumentType]
    assert stream.looks == 10**9


def test_it_is_served_until_ctrl_c(capsys: pytest.CaptureFixture[str]):
    stream, stop = Served(0), Stop()
    threading.Timer(0.3, lambda: setattr(stop, "requested", True)).start()
    Watching().flown(stream, stop)  # pyright: ignore[reportArgumentType]
    assert stop.requested and stream.drained == 1 and "the server still runs; Ctrl-C ends it" in capsys.readouterr().err
    Watching().flown(stream, stop)  # pyright: ignore[reportArgumentType]
    assert stream.drained == 1  # Ctrl-C in flight ended the serving too


def test_a_connection_to_a_port_of_ours_is_seen():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not viewer.connected(port)
        with socket.create_connection(("127.0.0.1", port)), server.accept()[0]:
            assert viewer.connected(port)


@pytest.mark.long
def test_a_served_flight_waits_flies_and_stays_as_a_user_sees_it(tmp_path: Path):
    command = [sys.executable, "-m", "rig", "fly", "--set", "duration_s=2", "--rerun", "serve", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = until(process, "watch at ")
        time.sleep(0.5)
        (log,) = tmp_path.glob("*.mcap")
        waiting = log.stat().st_size
        data = urlsplit(parse_qs(urlsplit(address.split()[2].rstrip(";")).query)["url"][0].removeprefix("rerun+"))
        with socket.create_connection((str(data.hostname), data.port or 0)):
            until(process, "the flight is over")
        assert log.stat().st_size > waiting + 100_000 and process.poll() is None
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=60)
        assert process.returncode == 0 and "SURVIVED" in said
    finally:
        process.kill()
        process.communicate()


def until(process: subprocess.Popen[str], begins: str) -> str:
    """The line of standard error that ``begins`` so."""
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith(begins):
            return line
    raise AssertionError(f"ended without {begins!r}")
