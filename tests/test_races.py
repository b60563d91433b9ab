"""Several processes at once: each has a file of its own, or the file that all were given is one writer's, whole."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rig.log import read_log

# The parent makes everything ready; one child, forked from it, writes each output alone, then several at once.
SCRIPT = """
import json, os, signal, sys
from pathlib import Path

from rig.studies.campaign.flying import fly as fly_in_memory, write_log
from rig.core.files import write_text
from rig.flight.fly import fly
from rig.log import read_log, recover
from rig.log.recordings.flown_log import recorded
from rig.log.export import export
from rig.bench.replay.what_if import what_if
from rig.scenario.scenario import load

SHORT = ["duration_s=0.5"]

def together(act, count=int(sys.argv[1])):
    gate, opener = os.pipe()
    children = [child(act, number, gate) for number in range(count)]
    os.write(opener, bytes(count))
    assert [os.waitpid(pid, 0)[1] for pid in children] == [0] * count

def child(act, number, gate):
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        signal.alarm(120)
        os.read(gate, 1)
        act(number)
        code = 0
    finally:
        os._exit(code)

def say(path):
    os.write(1, (json.dumps(str(path)) + "\\n").encode())

first = fly(None, overrides=SHORT, out="logs").log
log, of_it = read_log(first), recorded(first)
flown = fly_in_memory(load(None, SHORT))
Path("cut.mcap").write_bytes(first.read_bytes()[:-9])
OUTPUTS = {
    "o.csv": lambda path, number: export(log, "csv", path, ["pitch_rate"]),
    "o.txt": lambda path, number: write_text(path, str(number) * 2_000_000),
    "recovered.mcap": lambda path, number: recover("cut.mcap", path),
    "run_000001.mcap": lambda path, number: write_log(flown, path),
}
for folder in ("alone", "out"):
    Path(folder).mkdir()
for name, write in OUTPUTS.items():
    together(lambda number: write(Path("alone") / name, number), 1)  # a child too: threads do not outlive a fork
    together(lambda number: write(Path("out") / name, number))
for again in range(3):
    together(lambda number: say(fly(None, overrides=SHORT, out="logs").log))
together(lambda number: say(what_if(of_it, of_it.scenario).path))
"""


@pytest.fixture(
    scope="module", params=[3, pytest.param(8, marks=pytest.mark.long)], ids=lambda count: f"{count} at once"
)
def raced(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path], int]:
    """The folder, the paths that flights and then what-ifs said, and how many processes there were."""
    folder = tmp_path_factory.mktemp("raced")
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(request.param)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr[-3000:]
    return folder, [folder / json.loads(line) for line in ran.stdout.splitlines()], request.param


@pytest.mark.long
def test_flights_that_start_together_have_a_log_each_and_every_log_is_whole(raced: tuple[Path, list[Path], int]):
    _, said, processes = raced
    logs = said[: 3 * processes]
    assert len(set(logs)) == 3 * processes
    assert all(len(log.rows) == 50 and log.result is not None for log in map(read_log, logs))


def test_what_ifs_of_one_log_that_are_made_together_have_a_file_each(raced: tuple[Path, list[Path], int]):
    folder, said, processes = raced
    what_ifs = said[3 * processes :]
    assert len(set(what_ifs)) == processes and all(len(read_log(path).rows) == 50 for path in what_ifs)
    assert len(list((folder / "logs").iterdir())) == 1 + 4 * processes  # nothing else is left there


@pytest.mark.parametrize("name", ["o.csv", "o.txt", "recovered.mcap", "run_000001.mcap"])
def test_one_output_written_by_many_is_one_writers_whole(raced: tuple[Path, list[Path], int], name: str):
    folder, _, processes = raced
    alone, after = ((folder / place / name).read_bytes() for place in ("alone", "out"))
    assert after in ([alone] if name != "o.txt" else [bytes([48 + n]) * 2_000_000 for n in range(processes)])


def test_no_draft_is_left(raced: tuple[Path, list[Path], int]):
    folder, *_ = raced
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "o.csv",
        "o.csv.units.json",
        "o.txt",
        "recovered.mcap",
        "run_000001.mcap",
    ]
