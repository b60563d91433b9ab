"""Units that raise signals, with a name or without, and units that print without end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from unit_files import needs_a_compiler, unit

import rig
from rig.core.errors import BadInput, RigError
from rig.core.interrupt import signal_name
from rig.studies.campaign.worker import Orders, _died
from rig.unit.guard import MOST_KEPT, MOST_SHOWN

SHORT = ("duration_s=0.3", "faults=[]")
pytestmark = [needs_a_compiler, pytest.mark.skipif(not hasattr(signal, "SIGRTMIN"), reason="no real-time signals")]
REAL_TIME = int(signal.SIGRTMIN) + 3


def is_ignored(number: int) -> bool:
    """Whether this process was begun with a signal ignored: make and others leave those of the C library so."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return any(line.startswith("SigIgn:") and int(line.split()[1], 16) >> (number - 1) & 1 for line in lines)


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (9, "9 (SIGKILL)"),
        (int(signal.SIGRTMIN), f"{int(signal.SIGRTMIN)} (SIGRTMIN)"),
        (REAL_TIME, f"{REAL_TIME} (SIGRTMIN+3)"),
        (int(signal.SIGRTMAX), f"{int(signal.SIGRTMAX)} (SIGRTMAX)"),
        (32, "32"),
        (200, "200"),
    ],
)
def test_every_signal_has_a_number_and_a_name_where_there_is_one(number: int, name: str):
    assert signal_name(number) == name


@pytest.mark.parametrize("number", [REAL_TIME, *([] if is_ignored(32) else [32])])
@pytest.mark.parametrize("place", ["open", "step", "close"])
def test_a_unit_that_dies_of_a_signal_without_a_name_is_told_in_one_line(tmp_path: Path, place: str, number: int):
    tested = unit(tmp_path, "signals", environment={"PLACE": place, "RAISE": str(number)})
    says = f"killed by signal {signal_name(number)}"
    if place == "close":
        flight = rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
        assert flight.frames == 30 and says in flight.printed
        return
    with pytest.raises(BadInput if place == "open" else RigError) as error:
        rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_a_run_of_a_campaign_that_dies_of_such_a_signal_is_told():
    orders = Orders("none", 1, "", 60.0, baseline=False, rig="")
    assert _died(-REAL_TIME, orders) == ("crashed", f"killed by signal {REAL_TIME} (SIGRTMIN+3)")


@pytest.mark.parametrize("place", ["open", "step", "close"])
def test_an_interrupt_that_a_library_raises_is_no_ctrl_c(tmp_path: Path, place: str):
    tested = unit(tmp_path, "signals", environment={"PLACE": place, "RAISE": str(int(signal.SIGINT))})
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    assert flight.frames == 30 and flight.printed == ""


def test_of_what_a_unit_prints_the_end_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    sizes: list[int] = []
    made = tempfile.TemporaryFile

    def kept(*arguments: object, **options: object) -> object:
        file = made(*arguments, **options)  # pyright: ignore[reportCallIssue, reportArgumentType]
        close = file.close

        def closed() -> None:
            sizes.append(512 * os.fstat(file.fileno()).st_blocks)
            close()

        monkeypatch.setattr(file, "close", closed, raising=False)
        return file

    lines = 200_000
    tested = unit(tmp_path, "signals", environment={"PLACE": "step", "RAISE": str(-lines)})
    monkeypatch.setattr("rig.unit.processes.tempfile.TemporaryFile", kept)
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    assert len(sizes) == 2 and 0 < sizes[-1] <= MOST_KEPT + 8192  # whole blocks; the first had the orders of the guard
    assert len(flight.printed) == MOST_SHOWN
    told = flight.printed.splitlines()[1:]
    first = lines - len(told)
    assert told == [f"line {first + i:09d} of what a unit prints" for i in range(len(told))]


def test_a_program_that_prints_and_ends_is_quoted(tmp_path: Path):
    """All that a program prints is there when it has ended."""
    from rig.unit.processes import UnitProcess

    code = "import sys; sys.stdout.write('x' * 3000 + chr(10) + 'the last line')"
    for _ in range(5):
        process = UnitProcess("exec", [sys.executable, "-c", code], folder=tmp_path)
        assert process.how_it_ended(10.0) == "exited with status 0"
        assert process.last_line() == "the last line" and len(process.printed()) == 3014
        assert process.stop() == ""
        process.forget()


def test_nothing_of_the_guard_holds_the_output_of_its_parent(tmp_path: Path):
    """What the rig itself prints to is not what a unit prints to."""
    code = (
        "from rig.unit.processes import UnitProcess; p = UnitProcess('exec', ['true']); p.how_it_ended(9.0); p.stop()"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert out.stdout == out.stderr == ""
