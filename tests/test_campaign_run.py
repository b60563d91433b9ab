"""Flying campaigns: the same table by any worker, nothing lost and nothing twice, whatever is killed."""

import gc
import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import polars as pl
import psutil
import pytest
from mcap.reader import make_reader

from rig.core.errors import BadInput, RigError
from rig.core.interrupt import Stop
from rig.core.trust import Trust
from rig.log import read_log
from rig.log.chunk_layout import ROW
from rig.log.writer import CHUNK_BYTES
from rig.studies.campaign import pool, study_folder
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import Progress, Result, again, run

CAMPAIGN = """
base = "f16_pitch_rate_hardover"
seed = 7
runs = 48
[set]
duration_s = 8.0
"faults.0.start_s" = 1.0
[vary]
"faults.0.signal" = ["pitch_rate", "roll_rate"]
turbulence = ["none", "light"]
[run]
workers = 2
batch = 3
"""
# What JSBSim does with an aircraft whose equations read what is not declared: it ends the process.
ABORTING = """
from pathlib import Path

import jsbsim

from rig.scenario import aircraft
from rig.world.plant import actuated, airframe


class Aborts:
    def __init__(self, params):
        config = airframe.read(aircraft.folder("f16") / "aircraft.toml").model_copy(update={"properties": {}})
        root = Path(jsbsim.get_default_root_dir())
        fdm = jsbsim.FGFDMExec(None)
        paths = (str(actuated.folder(config, root)), str(root / "engine"), str(root / "systems"))
        fdm.load_model_with_paths("f16", *paths, True)
        try:
            fdm.run_ic()
        finally:
            del fdm

    def step(self, bus, fcc, k):
        pass


class Hangs:
    def __init__(self, params):
        while True:
            pass


class Raises:
    def __init__(self, params):
        raise ValueError("first line\\nsecond line")
"""


def write(folder: Path, text: str = CAMPAIGN) -> Path:
    path = folder / "campaign.toml"
    path.write_text(text)
    return path


def planned(path: Path, allow_code: bool = False) -> Plan:
    return Plan(read(path), str(path), Trust(str(path), allow_code))


@pytest.fixture(scope="module")
def whole(once: Any) -> Result:
    """The campaign flown without any interruption, by one worker."""
    return once("campaign", lambda place: run(planned(write(place)), place / "out", workers=1))


def command(path: Path, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "rig", "campaign", "run", str(path), "--out", str(out), "--json", *more]


def after_the_first_part(path: Path, out: Path, act: Callable[[psutil.Process], None]) -> subprocess.Popen[str]:
    """Start the campaign and ``act`` as soon as its first part is there."""
    process = subprocess.Popen(command(path, out), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not list((out / "runs").glob("*.parquet")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.002)
    act(psutil.Process(process.pid))
    return process


def workers_of(process: psutil.Process) -> list[psutil.Process]:
    """The processes that fly: children of the server that forks them."""
    servers = [child for child in process.children() if "forkserver" in " ".join(child.cmdline())]
    return [worker for server in servers for worker in server.children()]


def done(out: Path) -> list[int]:
    return [n for path in (out / "runs").glob("*.parquet") for n in pl.read_parquet(path, columns=["run"])["run"]]


def test_all_runs_are_there_and_two_workers_and_other_batches_give_the_same_table(whole: Result, tmp_path: Path):
    assert (whole.done, whole.outcomes) == (48, {"flown": 48})
    other = run(planned(write(tmp_path, CAMPAIGN.replace("batch = 3", "batch = 5"))), tmp_path / "out", workers=2)
    assert other.table_sha256 == whole.table_sha256
    rows = open_folder(tmp_path / "out").tables
    assert rows["runs"]["run"].to_list() == list(range(48))
    assert rows["faults"]["outcome"].unique().to_list() == ["detected"]
    assert set(rows["faults"].filter(pl.col("run") % 4 < 2)["signal"]) == {"pitch_rate"}
    assert set(rows["runs"]["turbulence"]) == {"none", "light"}


def test_a_run_flown_again_has_the_digest_of_the_table_and_its_full_log(whole: Result, tmp_path: Path):
    flight, digest = again(open_folder(whole.out), 5, tmp_path)
    assert flight.digest == digest and flight.frames == 800
    result = read_log(flight.log).result
    assert result is not None and result["digest"] == digest
    with pytest.raises(BadInput, match="--run 48: must be from 0 to 47"):
        again(open_folder(whole.out), 48, tmp_path)


LANES = """
base = "f16_wrong_command"
[set]
duration_s = 3.0
[vary]
"computers.count" = [1, 4]
"actuators.model" = ["lag", "servo"]
[[cases.faulty]]
name = "none"
set = { faults = [] }
"""


def test_a_run_with_lanes_or_servos_has_the_digest_of_the_table_when_it_is_flown_again(tmp_path: Path):
    """Three seconds are one block in memory and three in a log."""
    out = run(planned(write(tmp_path, LANES)), tmp_path / "out", workers=1).out
    campaign, there = open_folder(out), set[tuple[str, ...]]()
    for number in range(len(campaign.plan)):
        flight, digest = again(campaign, number, tmp_path)
        assert flight.digest == digest
        there.add(flight.scenario.row_parts)
    assert there == {(), ("servo",), ("computer",), ("servo", "computer")}


@pytest.mark.parametrize("logs", ["some", "sample:x", "sample:0", ""])
def test_other_logs_than_there_are_are_one_line_and_nothing_is_written(logs: str, tmp_path: Path):
    with pytest.raises(BadInput, match="--logs: must be all, failures, none or sample:N, got"):
        run(planned(write(tmp_path)), tmp_path / "out", runs=1, workers=1, logs=logs)
    assert not (tmp_path / "out").exists()


def test_a_campaign_logs_in_chunks_as_large_as_they_may_be(tmp_path: Path):
    out = tmp_path / "out"
    assert run(planned(write(tmp_path)), out, runs=1, workers=1, logs="all").done == 1
    [path] = (out / "logs").glob("*.mcap")
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    sizes = [index.uncompressed_size for index in summary.chunk_indexes]
    assert len(sizes) == -(-800 // (CHUNK_BYTES // ROW)) and max(sizes) <= CHUNK_BYTES
    assert next(event.frame for event in read_log(path).events) == 100  # the fault, in the first chunk


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere workers are not forked from a process that is ready")
def test_a_worker_begins_with_its_kernels_compiled_and_ctrl_c_still_reaches_the_parent():
    workers = pool.Local(1)
    try:
        assert workers.submit(gc.get_freeze_count).result(60) > 100_000  # what warm() left
    finally:
        workers.close()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.long
def test_after_kill_9_of_the_parent_the_workers_end_and_the_same_command_goes_on(whole: Result, tmp_path: Path):
    path, out, flying = write(tmp_path), tmp_path / "out", []

    def kill(process: psutil.Process) -> None:
        flying.extend(workers_of(process))
        process.send_signal(signal.SIGKILL)

    process = after_the_first_part(path, out, kill)
    _, stderr = process.communicate(timeout=30)
    assert stderr == ""  # of what is cleared away behind it, no word
    gone, alive = psutil.wait_procs(flying, timeout=20)
    assert gone and not alive
    before = done(out)
    assert 0 < len(before) < 48
    result = run(planned(path), out)
    assert result.flown == 48 - len(before) and result.table_sha256 == whole.table_sha256
    assert sorted(done(out)) == list(range(48))


@pytest.mark.long
def test_after_kill_9_of_a_worker_the_campaign_goes_on_by_itself(whole: Result, tmp_path: Path):
    path, out, killed = write(tmp_path), tmp_path / "out", []

    def kill(process: psutil.Process) -> None:
        killed.append(workers_of(process)[0])
        killed[0].send_signal(signal.SIGKILL)

    process = after_the_first_part(path, out, kill)
    stdout, stderr = process.communicate(timeout=120)
    assert (process.returncode, stderr) == (0, "") and killed
    result = json.loads(stdout)
    assert (result["done"], result["crashed"], result["table_sha256"]) == (48, 0, whole.table_sha256)
    assert sorted(done(out)) == list(range(48))


@pytest.mark.long
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=str)
def test_an_interruption_keeps_what_is_flown_and_says_how_to_go_on(
    whole: Result, tmp_path: Path, number: signal.Signals, code: int
):
    path, out = write(tmp_path), tmp_path / "out"
    process = after_the_first_part(path, out, lambda process: process.send_signal(number))
    stdout, stderr = process.communicate(timeout=60)
    result = json.loads(stdout)
    assert process.returncode == code and result["interrupted"]
    assert stderr == f"stopped: {result['done']} of 48 runs done; the same command resumes\n"
    assert 0 < result["done"] < 48 and result["done"] == len(done(out))
    assert run(planned(path), out).table_sha256 == whole.table_sha256


@pytest.mark.long
def test_a_second_ctrl_c_ends_at_once_and_says_no_more_than_the_first(whole: Result, tmp_path: Path):
    path, out = write(tmp_path), tmp_path / "out"

    def twice(process: psutil.Process) -> None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)

    process = after_the_first_part(path, out, twice)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert stderr == f"stopped: {json.loads(stdout)['done']} of 48 runs done; the same command resumes\n"
    assert run(planned(path), out).table_sha256 == whole.table_sha256


def test_runs_that_are_deleted_in_flight_are_missed_and_the_same_command_flies_them_again(
    whole: Result, tmp_path: Path
):
    path, out = write(tmp_path), tmp_path / "out"
    gone: list[int] = []

    def delete(report: Progress) -> None:
        if report.flown >= 6 and not gone:
            gone.extend(done(out))
            shutil.rmtree(out / "runs")

    with pytest.raises(RigError, match="that were flown are no longer in the tables; the same command"):
        run(planned(path), out, report=delete)
    again = run(planned(path), out)
    assert again.flown == len(gone) > 0 and again.table_sha256 == whole.table_sha256


@pytest.mark.long
def test_a_flight_that_ends_the_process_is_recorded_as_crashed_among_twenty_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "hooks.py").write_text(ABORTING)
    monkeypatch.chdir(tmp_path)
    managers = ['"cross-channel"'] * 10 + ['"hooks:Aborts"'] + ['"cross-channel"'] * 9 + ['"hooks:Raises"']
    varied = f'[vary]\n"redundancy.manager" = [{", ".join(managers)}]\n'
    head, _, tail = CAMPAIGN.replace("runs = 48\n", "").replace("8.0", "2.0").partition("[vary]")
    path = write(tmp_path, head + varied + tail[tail.index("[run]") :] + 'logs = "all"\n')
    result = run(planned(path, allow_code=True), tmp_path / "out")
    assert result.outcomes == {"flown": 19, "crashed": 1, "failed": 1} and result.done == 19
    assert result.not_flown == 2 and result.first_reason == "run 10: crashed: killed by signal 6 (SIGABRT)"
    rows = open_folder(result.out).tables["runs"].filter(pl.col("outcome") != "flown")
    crashed, failed = rows.sort("run").select("run", "outcome", "reason").rows()
    assert crashed == (10, "crashed", "killed by signal 6 (SIGABRT)")
    assert failed[:2] == (20, "failed") and "ValueError: first line second line" in failed[2]
    logs = sorted(path.name for path in (result.out / "logs").glob("*"))
    assert len(logs) == 19 and "run_000010.mcap" not in logs
    flown = dict(open_folder(result.out).tables["runs"].select("run", "digest").rows())
    logged = read_log(result.out / "logs" / "run_000003.mcap").result
    assert logged is not None and logged["digest"] == flown[3]


@pytest.mark.long
def test_a_flight_that_never_ends_is_timed_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "hooks.py").write_text(ABORTING)
    monkeypatch.chdir(tmp_path)
    text = 'base = "f16_pitch_rate_hardover"\n[set]\nduration_s = 1.0\nfaults = []\n[vary]\n'
    text += '"redundancy.manager" = ["mean", "hooks:Hangs", "median"]\n[run]\nworkers = 1\ntimeout_s = 1.5\n'
    result = run(planned(write(tmp_path, text), allow_code=True), tmp_path / "out")
    rows = open_folder(result.out).tables["runs"].select("outcome", "reason").rows()
    assert rows == [("flown", None), ("timed out", "longer than 1.5 s"), ("flown", None)]


@pytest.mark.long
def test_a_full_disk_stops_with_one_line_and_the_same_command_goes_on(whole: Result, tmp_path: Path):
    path, out = write(tmp_path), tmp_path / "out"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))  # noqa: E731 # less than one log
    limited = subprocess.run(
        command(path, out, "--logs", "all"), capture_output=True, text=True, preexec_fn=limit, timeout=120, check=False
    )
    said = [line for line in limited.stderr.splitlines() if not line.startswith("note: ")]  # kernels that are new
    assert limited.returncode == 1 and len(said) == 1
    assert said[0].startswith("failed: ") and "disk full" in said[0]
    assert "of 48 runs done, the same command resumes" in said[0]
    assert run(planned(path), out).table_sha256 == whole.table_sha256


def test_a_part_that_cannot_be_written_leaves_nothing_half(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path, out = write(tmp_path, CAMPAIGN.replace("runs = 48", "runs = 4")), tmp_path / "out"

    run(planned(path), out, runs=2)
    before = sorted(out.rglob("*"))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(study_folder.os, "fsync", full)
    with pytest.raises(RigError, match="No space left on device; 2 of 4 runs done"):
        run(planned(path), out)
    monkeypatch.undo()
    assert sorted(out.rglob("*")) == before
    assert run(planned(path), out).done == 4


@pytest.mark.long
def test_what_an_interrupted_write_left_is_swept_away_and_never_counted(whole: Result, tmp_path: Path):
    path, out = write(tmp_path), tmp_path / "out"
    run(planned(path), out, runs=6)
    (out / "faults" / "000006-000008.parquet").write_bytes(b"whole, but its runs are not there")
    (out / "runs" / "000006-000008.parquet.tmp").write_bytes(b"half")
    assert len(open_folder(out).tables["faults"]) == 6
    assert run(planned(path), out).table_sha256 == whole.table_sha256


def test_the_first_runs_alone_are_those_of_the_whole_campaign(whole: Result, tmp_path: Path):
    path, out = write(tmp_path), tmp_path / "out"
    few = run(planned(path), out, runs=5)
    assert few.done == few.runs == 5
    first = open_folder(out).tables["runs"].drop("wall_s", "replies")
    assert first.equals(open_folder(whole.out).tables["runs"].head(5).drop("wall_s", "replies"))
    for wrong in (0, 49):
        with pytest.raises(BadInput, match=f"--runs {wrong}: must be from 1 to 48"):
            run(planned(path), out, runs=wrong)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("seed = 7", "seed = 8"), "campaign.seed was 7, is 8"),
        (("runs = 48", "runs = 50"), "campaign.runs was 48, is 50"),
        (("duration_s = 8.0", "duration_s = 9.0"), "campaign.set.duration_s was 8.0, is 9.0"),
        (('"light"]', '"severe"]'), 'campaign.vary.turbulence.values.1 was "light", is "severe"'),
    ],
)
def test_another_campaign_is_refused_with_the_difference(
    whole: Result, tmp_path: Path, change: tuple[str, str], says: str
):
    before = sorted(whole.out.rglob("*"))
    with pytest.raises(BadInput, match="contains runs of another campaign") as error:
        run(planned(write(tmp_path, CAMPAIGN.replace(*change))), whole.out)
    assert says in str(error.value)
    assert sorted(whole.out.rglob("*")) == before


def test_how_it_runs_may_change_under_a_folder(whole: Result, tmp_path: Path):
    path = write(tmp_path, CAMPAIGN.replace("workers = 2\nbatch = 3", "workers = 1\nbatch = 7\ntimeout_s = 60.0"))
    assert run(planned(path), whole.out).flown == 0


def test_a_folder_of_something_else_is_refused(tmp_path: Path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "letter.txt").write_text("mine")
    with pytest.raises(BadInput, match="is not empty and not a campaign's folder"):
        run(planned(write(tmp_path)), tmp_path / "out")
    with pytest.raises(BadInput, match="not a campaign's folder"):
        open_folder(tmp_path / "out")


def test_two_cannot_fly_into_one_folder_at_once(whole: Result):
    folder = open_folder(whole.out)
    with folder.held(), pytest.raises(BadInput, match="another rig campaign run is flying into it"), folder.held():
        pass


def test_a_scheduler_that_does_not_answer_is_refused_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(pool, "ANSWER_S", 1.0)
    with pytest.raises(BadInput, match=r"--scheduler tcp://127.0.0.1:9: no reply") as error:
        run(planned(write(tmp_path)), tmp_path / "out", scheduler="tcp://127.0.0.1:9")
    assert "\n" not in str(error.value) and not (tmp_path / "out").exists()


CLUSTER = """
import os, signal, sys, threading, time
from pathlib import Path

from distributed import LocalCluster

from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import run

if __name__ == "__main__":
    out = Path(sys.argv[2])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        def kill():
            while not list((out / "runs").glob("*.parquet")):
                time.sleep(0.002)
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        threading.Thread(target=kill).start()
        result = run(Plan(read(sys.argv[1]), sys.argv[1]), out, scheduler=cluster.scheduler_address)
    print(result.done, result.outcomes, result.table_sha256)
"""


@pytest.mark.long
def test_a_cluster_of_which_one_worker_is_killed_gives_the_same_table(whole: Result, tmp_path: Path):
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    path = write(tmp_path)
    ran = subprocess.run(
        [sys.executable, str(script), str(path), str(tmp_path / "out")],
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert ran.returncode == 0, ran.stderr[-3000:]
    assert ran.stdout.split("\n")[-2] == f"48 {{'flown': 48}} {whole.table_sha256}"


RESTARTED = """
import os, subprocess, sys, threading, time
from pathlib import Path

from rig.core.errors import RigError
from rig.studies.campaign import pool
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import run

PORT = sys.argv[3]
started = []

def start(what, *more):
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *more, "--no-dashboard"]
    started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
    return started[-1]

def cluster():
    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", PORT)
    start("worker", f"tcp://127.0.0.1:{PORT}", "--nthreads", "1", "--no-nanny")
    return scheduler

def flown(out, restarts):
    scheduler = cluster()

    def kill():
        while not list((out / "runs").glob("*.parquet")):
            time.sleep(0.002)
        scheduler.kill()
        scheduler.wait()
        if restarts:
            cluster()

    pool.ANSWER_S, pool.RETURN_S = 60.0, 60.0  # both of them have to start
    while True:
        try:
            pool.Cluster(f"tcp://127.0.0.1:{PORT}").close()
            break
        except pool.BadInput:
            time.sleep(0.2)
    pool.RETURN_S = 60.0 if restarts else 0.5
    killer = threading.Thread(target=kill)
    killer.start()
    try:
        return run(Plan(read(sys.argv[1]), sys.argv[1]), out, scheduler=f"tcp://127.0.0.1:{PORT}")
    finally:
        killer.join()

if __name__ == "__main__":
    folder = Path(sys.argv[2])
    try:
        result = flown(folder / "restarted", True)
        print(result.done, result.outcomes, result.table_sha256)
        for process in started:
            process.kill()
            process.wait()
        flown(folder / "lost", False)
    except RigError as error:
        print(error)
    finally:
        for process in started:
            process.kill()
"""


@pytest.mark.long
def test_a_scheduler_that_is_started_again_gives_the_same_table_and_one_that_is_not_loses_no_run(
    whole: Result, tmp_path: Path
):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    script = tmp_path / "restarted.py"
    script.write_text(RESTARTED)
    path = write(tmp_path)
    ran = subprocess.run(
        [sys.executable, str(script), str(path), str(tmp_path), str(port)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert ran.returncode == 0 and "Traceback" not in ran.stderr, ran.stderr[-3000:]
    table, lost = ran.stdout.splitlines()
    assert table == f"48 {{'flown': 48}} {whole.table_sha256}"
    gone = r"--scheduler tcp://\S+: it or its workers stopped, and are not back after 0.5 s; (\d+) of 48 runs done, "
    done = re.match(gone, lost)
    assert done is not None and 0 < int(done[1]) < 48, lost
    assert len(open_folder(tmp_path / "lost").tables["runs"]) == int(done[1])


def test_an_interruption_ends_the_wait_for_a_scheduler(monkeypatch: pytest.MonkeyPatch):
    stop, cluster, tried = Stop(), pool.Cluster.__new__(pool.Cluster), list[str]()

    def client(address: str, **_: Any) -> None:
        tried.append(address)
        stop.requested = len(tried) == 2
        raise OSError("no reply")

    monkeypatch.setattr("distributed.Client", client)
    monkeypatch.setattr(pool, "_LOOK_S", 0.0)
    monkeypatch.setattr(cluster, "_address", "tcp://127.0.0.1:9", raising=False)
    monkeypatch.setattr(cluster, "_client", SimpleNamespace(status="closed"), raising=False)
    cluster.renew(stop)  # would raise RigError after a minute
    assert len(tried) == 2


def test_the_commands_say_one_json_object_and_refuse_in_one_line(whole: Result, rig_command: Any):
    code, said, _ = rig_command("campaign", "status", str(whole.out), "--json")
    assert code == 0 and json.loads(said)["table_sha256"] == whole.table_sha256
    code, said, _ = rig_command("campaign", "fly", str(whole.out), "--run", "3", "--out", ".", "--json")
    assert code == 0 and json.loads(said)["same"] is True
    code, _, error = rig_command("campaign", "run", "nowhere", "--out", "out")
    assert code == 2 and error.count("\n") == 1 and "nowhere: no such file; bundled: " in error
