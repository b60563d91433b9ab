"""One call of ``rig mcp`` in its own process: progress, one answer, and an end when nobody waits for it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from rig.cli import mcp_call
from rig.cli.mcp_call import explained, refuse_many, with_json
from rig.core.confined import environment
from rig.core.errors import BadInput
from rig.flight.fly import fly
from rig.log import read_log
from rig.verdict.of_log import FlightConclusion

CALL = [sys.executable, "-P", "-m", "rig.cli.mcp_call"]


@contextmanager
def begun(folder: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """A call as the server starts it, its standard input still open."""
    around = {**os.environ, **environment(folder, [], 60_000)}
    with subprocess.Popen(CALL, env=around, cwd="/", text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as call:
        assert call.stdin is not None
        call.stdin.write(f"{json.dumps(words)}\n")
        call.stdin.flush()
        yield call


def messages(call: subprocess.Popen[str]) -> list[dict[str, Any]]:
    assert call.stdout is not None
    return [json.loads(line) for line in call.stdout]


def test_json_is_asked_for_before_the_arguments():
    assert with_json(["fly", "--seed=1", "--", "--json"]) == ["fly", "--seed=1", "--json", "--", "--json"]
    assert with_json(["scenario", "list"]) == ["scenario", "list", "--json"]


def test_a_step_is_reported_when_it_begins_when_it_ends_and_now_and_then_between(monkeypatch: pytest.MonkeyPatch):
    clock, sent = [0.0], []
    monkeypatch.setattr(mcp_call.time, "monotonic", lambda: clock[0])
    report = mcp_call._reporter(lambda **message: sent.append(message["progress"]))
    for at_s, done in ((0.0, 1), (0.1, 2), (0.3, 3), (0.4, 4), (0.41, 9)):
        clock[0] = at_s
        report("flying", done, 9)
    report("scoring", 0, 0)
    assert sent == [["flying", 1, 9], ["flying", 3, 9], ["flying", 9, 9], ["scoring", 0, 0]]


def test_an_answer_is_what_the_command_prints(capsys: pytest.CaptureFixture[str]):
    made = mcp_call._answer(["scenario", "list"])
    assert made["answer"]["f16_pitch_rate_hardover"] == "F-16 pitch-rate hardover" and made["remark"] == ""
    assert capsys.readouterr() == ("", "")


def test_bad_input_is_the_line_of_the_command(capsys: pytest.CaptureFixture[str]):
    made = mcp_call._answer(["fly", "--", "f16_pitch_rate_hardver"])
    assert made["error"].startswith("f16_pitch_rate_hardver: no such file; nearest bundled: f16_pitch_rate_hardover")
    assert mcp_call._answer(["fly", "--sed=1"])["error"].startswith("--sed: no such option; nearest: ")
    assert capsys.readouterr() == ("", "")


def test_the_text_of_an_error_of_the_rig_stays_with_the_server(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def broken(_: object) -> int:
        raise RuntimeError("secret")

    monkeypatch.setattr(mcp_call, "run", broken)
    monkeypatch.setattr(sys, "__stderr__", sys.stderr)
    made = mcp_call._answer(["scenario", "list"])
    assert made == {"error": "an error of the rig itself; the standard error of rig mcp has its text"}
    out, err = capfd.readouterr()
    assert out == "" and "RuntimeError: secret" in err


def test_a_suite_of_too_many_flights_is_refused(tmp_path: Path):
    suite = tmp_path / "suite.toml"
    suite.write_text('[[cases]]\nscenario = "f16_pitch_rate_hardover"\n[[cases]]\ncampaign = "reliability"\n')
    with pytest.raises(BadInput, match=r"suite\.toml: \d{4} flights; rig mcp flies at most 2000 in one call"):
        refuse_many(str(suite))
    refuse_many("bundled")
    suite.write_text('[[cases]]\ncampaign = "reliability"\nruns = 3\n')
    refuse_many(str(suite))


def test_a_log_is_explained_by_its_conclusion(tmp_path: Path):
    overrides = ["duration_s=3", "faults.0.start_s=1"]
    flight = fly("f16_pitch_rate_hardover", overrides=overrides, out=tmp_path, outcome=FlightConclusion())
    made = explained(flight.log, baseline=False)
    assert flight.conclusion is not None and made["outcome"] == "SURVIVED" and made["digest"] == flight.digest
    rows = [*made["rows"], *made["flight"]]
    said = [f"{row['label']}: {'; '.join((*row['texts'], *row['why']))}" for row in rows]
    assert [f"{made['outcome']}: {made['summary']}", *said] == list(flight.conclusion)
    assert made["rows"][0]["label"] == "pitch rate, channel 3"
    (tmp_path / "none.mcap").write_bytes(b"no log")
    with pytest.raises(BadInput):
        explained(tmp_path / "none.mcap", baseline=False)


def test_the_lines_of_a_call_are_progress_and_one_answer(tmp_path: Path):
    with begun(tmp_path, "scenario", "list") as call:
        *progress, last = messages(call)
    assert call.returncode == 0 and "answer" in last and all("progress" in each for each in progress)


def first_progress(call: subprocess.Popen[str], what: str) -> None:
    assert call.stdout is not None
    while True:
        line = call.stdout.readline()
        assert line, "the call ended before its flight began"
        if json.loads(line).get("progress", [""])[0] == what:
            return


@pytest.mark.long
@pytest.mark.parametrize("stops", ["the server is gone", "the server asks for it"])
def test_a_flight_that_nobody_waits_for_ends_and_its_log_is_whole(tmp_path: Path, stops: str):
    words = ["fly", f"--out={tmp_path}", "--set=duration_s=600", "--", "f16_pitch_rate_hardover"]
    with begun(tmp_path, *words) as call:
        first_progress(call, "flying")
        assert call.stdin is not None
        call.stdin.close() if stops == "the server is gone" else call.send_signal(signal.SIGTERM)
        *_, last = messages(call)
    assert call.returncode == 0
    (path,) = tmp_path.glob("*.mcap")
    log = read_log(path)
    assert log.result is not None and log.result["end_reason"] == "interrupted"
    assert last["answer"]["end_reason"] == "interrupted"
    assert 0 < len(log.rows) == last["answer"]["frames"] < 60_000


SPACE = """
base = "base.toml"
sampling = "random"
runs = 1
[vary]
"faults.0.offset" = { low = 0.05, high = 1.0, log = true }
"""
BASE = """
duration_s = 1.5
redundancy.manager = "mean"
[[faults]]
kind = "offset"
signal = "pitch_rate"
channels = [1]
start_s = 0.5
offset = 0.1
"""


@pytest.mark.long
def test_a_search_that_nobody_waits_for_ends_with_its_workers_and_can_resume(tmp_path: Path):
    (tmp_path / "space.toml").write_text(SPACE)
    (tmp_path / "base.toml").write_text(BASE)
    words = ["search", f"--out={tmp_path / 's'}", "--requirement=vote", "--flights=2000", "--workers=2"]
    with begun(tmp_path, *words, "--", str(tmp_path / "space.toml")) as call:
        while not list(tmp_path.glob("s/runs/*.parquet")):
            assert call.poll() is None
            time.sleep(0.05)
        workers = psutil.Process(call.pid).children(recursive=True)
        assert call.stdin is not None
        call.stdin.close()
        *_, last = messages(call)
    assert last["error"].startswith("stopped: ") and last["error"].endswith("flights; the same command resumes")
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert len(workers) >= 2 and alive == []
    assert not list(tmp_path.rglob("*.part"))
