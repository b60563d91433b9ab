"""The process between the rig and a unit: all processes of the unit end with it, and with the rig.

    python -I guard.py PARENT exec PROGRAM COMMAND ...      becomes the command
    python -I guard.py PARENT FILE ARGUMENT ...             runs a host: host.py, fmu_host.py

Its standard input has strings with NUL between them: NAME=VALUE of each variable of the unit, an empty one, and
folders.  It makes the first folder, which the unit finds in RIG_UNIT_FOLDER, and removes all of them when the unit has
ended.  The variables are those of the unit alone.  If there are any, a host is a new program: LD_PRELOAD needs one.

The unit runs in a child of the guard.  The kernel gives processes that the unit leaves behind, also in other sessions,
to the guard as their nearest subreaper, so that it can find and kill them.  The guard ends as the unit has ended: with
its exit status, or by its signal.  The kernel sends SIGTERM when the rig is gone; the guard passes it to the unit, and
kills the unit END_S later.
"""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

MOST_SHOWN = 4096  # bytes of what a process printed that are shown
MOST_KEPT = 1 << 16  # bytes of it that are kept
END_S = 1.0  # to end by itself when it is asked to
FOLDER = "RIG_UNIT_FOLDER"  # in the environment of a unit: its own folder, empty when it starts
REMOVED = b".removed"  # ends the name of a folder while it is removed
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_HELD = {signal.SIGTERM, signal.SIGCHLD}
_KEEP_SIZE, _PUNCH_HOLE = 1, 2  # of fallocate
_CUT_S = 0.01  # between two looks at how much was printed
_LOOKS = 2000  # for what is left, a millisecond each


def main(arguments: list[str]) -> None:
    """Run the unit in a child and guard it; return only in the child, when a host has ended."""
    parent, kind, *rest = arguments
    variables, folders = _read_orders()
    signal.pthread_sigmask(signal.SIG_BLOCK, _HELD)
    _set_process(_PR_SET_CHILD_SUBREAPER, 1)
    _set_process(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        remove(folders)
        raise SystemExit(1)
    try:
        os.mkdir(folders[0], 0o700)  # noqa: PTH102 # pathlib takes no bytes
    except OSError as error:
        sys.exit(f"the folder of the unit, {os.fsdecode(folders[0])}, cannot be made: {error.strerror}")
    import fcntl

    fcntl.fcntl(1, fcntl.F_SETFL, fcntl.fcntl(1, fcntl.F_GETFL) | os.O_APPEND)  # where it is cut, it goes on
    unit = os.fork()
    if unit == 0:
        _set_process(_PR_SET_PDEATHSIG, signal.SIGKILL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HELD)
        os.environb[FOLDER.encode()] = folders[0]
        _run(kind, rest, variables)
        return
    os.closerange(3, 256)  # the unit's own socket, which must close when the unit ends
    threading.Thread(target=_keep_cutting, daemon=True).start()
    status = _watch(unit)
    _end_all()
    _cut()
    remove(folders)
    _end_like(status)


def _read_orders() -> tuple[dict[bytes, bytes], list[bytes]]:
    """Return the variables and the folders of standard input, which the unit does not get."""
    orders = sys.stdin.buffer.read().split(b"\0")
    nowhere = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nowhere, 0)
    os.close(nowhere)
    end = orders.index(b"")
    pairs = (text.partition(b"=") for text in orders[:end])
    return {name: value for name, _, value in pairs}, orders[end + 1 :]


def _set_process(option: int, value: int) -> None:
    with suppress(OSError, AttributeError):  # Linux alone has it
        ctypes.CDLL(None).prctl(option, value)


def _run(kind: str, arguments: list[str], variables: dict[bytes, bytes]) -> None:
    if kind != "exec" and not variables:
        sys.argv = [kind, *arguments]
        runpy.run_path(kind, run_name="__main__")
        return
    program, *command = arguments if kind == "exec" else [sys.executable, sys.executable, "-I", kind, *arguments]
    try:
        os.execve(program, command, {**os.environb, **variables})
    except OSError as error:
        script = isinstance(error, FileNotFoundError) and os.path.isfile(program)  # noqa: PTH113 # which never raises
        cause = "the interpreter that its first line names is missing" if script else error.strerror
        sys.exit(f"{command[0]}: {cause}")


def _keep_cutting() -> None:
    """Give back the disk of what a unit printed long ago, for as long as it prints.

    The unit writes into the file itself, so that what it has printed is there when it answers.
    """
    while True:
        _cut()
        time.sleep(_CUT_S)


def _cut() -> None:
    """Make a hole of all but the end of standard output, a file; empty it where the file system makes none."""
    status = os.fstat(1)
    if status.st_blocks * 512 <= MOST_KEPT:
        return
    hole = ctypes.c_int64(0), ctypes.c_int64(status.st_size - MOST_KEPT)
    fallocate = getattr(ctypes.CDLL(None), "fallocate", None)  # Linux alone has it
    if fallocate is None or fallocate(1, _KEEP_SIZE | _PUNCH_HOLE, *hole) != 0:
        os.ftruncate(1, 0)


def _watch(unit: int) -> int:
    """Wait for the end of the unit; return its status, of os.wait."""
    until = None
    while until is None or time.monotonic() < until:
        if until is None:
            number = signal.sigwait(_HELD)
        else:
            told = signal.sigtimedwait(_HELD, max(0.0, until - time.monotonic()))
            number = 0 if told is None else told.si_signo
        status = _reaped(unit)
        if status is not None:
            return status
        if number == signal.SIGTERM and until is None:
            until = time.monotonic() + END_S
            _signal_all(signal.SIGTERM)
    os.kill(unit, signal.SIGKILL)
    return os.waitpid(unit, 0)[1]


def _reaped(unit: int) -> int | None:
    """Wait for all processes that have ended; return the status of the unit if it is one of them."""
    status = None
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = ended[1] if ended[0] == unit else status
    return status


def _end_all() -> None:
    """Kill what the unit has left; what was forked meanwhile is found in the next look."""
    for _ in range(_LOOKS):
        _signal_all(signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(1e-3)


def _signal_all(number: int) -> None:
    for pid in _descendants():
        with suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)


def _descendants() -> set[int]:
    """Return the processes below this one, by /proc."""
    parents = {}
    for name in os.listdir("/proc") if os.path.isdir("/proc") else []:  # noqa: PTH112, PTH208 # thousands of names
        if name.isdecimal():
            with suppress(OSError, IndexError):
                parents[int(name)] = int(Path(f"/proc/{name}/stat").read_bytes().rsplit(b")", 1)[1].split()[1])
    found = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {os.getpid()}


def remove(folders: Iterable[bytes]) -> None:
    """Remove folders with all that the unit has left there, whatever it is; nothing behind a link."""
    import shutil  # slow to import, and only needed at the end

    for folder in folders:
        with suppress(OSError):
            os.rename(folder, folder + REMOVED)  # noqa: PTH104 # the rig sees that it goes, and waits
        for path in (folder + REMOVED, folder):
            for permit in (lambda _: None, _permit):
                permit(path)
                shutil.rmtree(path, ignore_errors=True)
                with suppress(OSError):
                    os.unlink(path)  # noqa: PTH108 # a link that the unit has put in its place


def _permit(folder: bytes) -> None:
    """Permit this user to remove what is in ``folder``."""
    if os.path.isdir(folder) and not os.path.islink(folder):  # noqa: PTH112, PTH114 # they take no bytes
        os.chmod(folder, 0o700)  # noqa: PTH101
        for name in os.listdir(folder):  # noqa: PTH208
            _permit(os.path.join(folder, name))  # noqa: PTH118


def _end_like(status: int) -> None:
    """End with the exit status of the unit, or by its signal."""
    if os.WIFSIGNALED(status):
        import resource  # of POSIX, as this whole end

        number = os.WTERMSIG(status)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the unit's own core is enough
        with suppress(OSError, ValueError):  # SIGKILL has no handler, nor have the signals that the C library keeps
            signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
        os.kill(os.getpid(), number)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


if __name__ == "__main__":
    main(sys.argv[1:])
