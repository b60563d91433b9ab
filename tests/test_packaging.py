"""What is shipped, and where it can be imported."""

import ast
import os
import re
import subprocess
import sys
import types
from importlib.metadata import version
from pathlib import Path

import outside
import pytest

from rig.cli import main as cli
from rig.core.errors import BadInput
from rig.studies.campaign import study_folder as folder

ROOT = Path(__file__).parents[1]
POSIX_ONLY = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
# A platform whose os and signal lack what Windows lacks, in a process of its own.
NEVER_ENDS = """
import signal
del signal.setitimer, signal.SIGALRM
from rig.studies.campaign.worker import _limit
with _limit(30.0):
    pass
print("in time", flush=True)
with _limit(0.2):
    while True:
        pass
"""


def imported_at_load(path: Path) -> set[str]:
    """Modules that are imported when the file is, whatever the platform: not those in functions."""
    waiting: list[ast.AST] = [ast.parse(path.read_text())]
    found = set()
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
        waiting += ast.iter_child_nodes(node)
    return found


def test_no_module_imports_at_load_what_only_posix_has(tmp_path: Path):
    (tmp_path / "x.py").write_text(
        "if True:\n    import fcntl\nclass A:\n    from pwd import x\ndef f():\n    import tty\n"
    )
    assert imported_at_load(tmp_path / "x.py") & POSIX_ONLY == {"fcntl", "pwd"}
    files = sorted((ROOT / "rig").rglob("*.py"))
    assert len(files) > 100 and {str(path): imported_at_load(path) & POSIX_ONLY for path in files} == {
        str(path): set() for path in files
    }


BUSY = "rig campaign run is flying"


def test_a_folder_is_locked_for_one_at_a_time_and_free_afterwards(tmp_path: Path):
    for _ in range(2):
        with (
            folder.locked(tmp_path, BUSY),
            pytest.raises(BadInput, match="is flying into it"),
            folder.locked(tmp_path, BUSY),
        ):
            pass


def test_without_flock_the_first_byte_of_the_lock_is_locked_and_released(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    held, calls = set(), []

    def locking(file: int, mode: int, size: int) -> None:
        inode = os.fstat(file).st_ino
        calls.append((mode, size, os.lseek(file, 0, os.SEEK_CUR)))
        if mode == 2 and inode in held:
            raise OSError(36, "Resource deadlock avoided")
        (held.add if mode == 2 else held.remove)(inode)

    monkeypatch.setattr(folder.sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace(locking=locking, LK_NBLCK=2, LK_UNLCK=0))
    locked = folder.locked(tmp_path / "a", BUSY)
    with (
        locked,
        pytest.raises(BadInput, match="is flying into it"),
        folder.locked(tmp_path / "a", BUSY),
    ):
        pass
    assert calls == [(2, 1, 0), (2, 1, 0), (0, 1, 0)] and held == set()


def test_without_o_nofollow_a_lock_that_is_a_link_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(folder, "_FLAGS", os.O_RDWR | os.O_CREAT)
    (tmp_path / "lock").symlink_to(tmp_path / "precious")
    with pytest.raises(BadInput, match="lock: is a link"), folder.locked(tmp_path, BUSY):
        pass
    assert not (tmp_path / "precious").exists()


@pytest.mark.long
def test_without_an_interval_timer_a_flight_that_takes_too_long_ends_its_process():
    ran = subprocess.run([sys.executable, "-c", NEVER_ENDS], capture_output=True, text=True, timeout=60, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (1, "in time\n", "")


def test_the_version_is_said_and_is_that_of_the_citation(
    capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sys, "argv", ["rig", "--version"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert (ended.value.code or 0, capsys.readouterr().out) == (0, f"jsbsim-rig {version('jsbsim-rig')}\n")
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited is not None and cited[1] == version("jsbsim-rig")


def program(there: list[bool], reason: str) -> outside.Program:
    """A program that is there as ``there`` says, one answer after the other."""
    return outside.Program("Gadget", lambda: there.pop(0), lambda: reason)


@pytest.mark.parametrize(
    ("there", "options", "code", "last"),
    [
        ([True], [], 0, ""),
        ([False, True], [], 0, "installing Gadget"),
        ([False, False], [], 1, "not run: the tests that need Gadget (no root)"),
        ([False, False], ["--if-possible"], 0, "not run: the tests that need Gadget (no root)"),
    ],
)
def test_what_cannot_be_installed_is_said_and_fails_only_where_it_must(
    there, options, code, last, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    passing = lambda command, **_: subprocess.CompletedProcess(command, 0)  # noqa: E731 # pytest, all green
    monkeypatch.setattr(outside, "PROGRAMS", {"gadget": program(there, "no root")})
    monkeypatch.setattr(outside, "subprocess", types.SimpleNamespace(run=passing))
    assert outside.main(options) == code
    assert (capsys.readouterr().out.splitlines() or [""])[-1] == last


def test_an_installation_that_fails_gives_its_reason_and_no_exception():
    assert outside._ran(["sh", "-c", "echo first; echo 'E: no network'; exit 3"]) == "sh: E: no network"
    assert outside._ran(["sh", "-c", "exit 3"]) == "sh: exit code 3"
    assert outside._ran(["true"]) == ""
    assert "No such file" in outside._ran(["no-such-command-here"])
