"""The process between the rig and a unit: all processes of the unit end with it, and with the rig.

    python -I guard.py PARENT exec COMMAND ...      becomes the command
    python -I guard.py PARENT FILE ARGUMENT ...     runs a host: host.py, fmu_host.py

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
from contextlib import suppress
from pathlib import Path

MOST_SHOWN = 4096  # bytes of what a process printed that are shown
MOST_KEPT = 1 << 16  # bytes of it that are kept
END_S = 1.0  # to end by itself when it is asked to
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_HELD = {signal.SIGTERM, signal.SIGCHLD}
_KEEP_SIZE, _PUNCH_HOLE = 1, 2  # of fallocate
_CUT_S = 0.01  # between two looks at how much was printed
_LOOKS = 2000  # for what is left, a millisecond each


def main(arguments: list[str]) -> None:
    """Run the unit in a child and guard it; return only in the child, when a host has ended."""
    parent, kind, *rest = arguments
    _set_process(_PR_SET_CHILD_SUBREAPER, 1)
    _set_process(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        raise SystemExit(1)
    signal.pthread_sigmask(signal.SIG_BLOCK, _HELD)
    import fcntl

    fcntl.fcntl(1, fcntl.F_SETFL, fcntl.fcntl(1, fcntl.F_GETFL) | os.O_APPEND)  # where it is cut, it goes on
    unit = os.fork()
    if unit == 0:
        _set_process(_PR_SET_PDEATHSIG, signal.SIGKILL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HELD)
        _run(kind, rest)
        return
    os.closerange(3, 256)  # the unit's own socket, which must close when the unit ends
    threading.Thread(target=_keep_cutting, daemon=True).start()
    status = _watch(unit)
    _end_all()
    _cut()
    _end_like(status)


def _set_process(option: int, value: int) -> None:
    with suppress(OSError, AttributeError):  # Linux alone has it
        ctypes.CDLL(None).prctl(option, value)


def _run(kind: str, arguments: list[str]) -> None:
    if kind != "exec":
        sys.argv = [kind, *arguments]
        runpy.run_path(kind, run_name="__main__")
        return
    try:
        os.execvp(arguments[0], arguments)
    except OSError as error:
        script = isinstance(error, FileNotFoundError) and os.path.isfile(arguments[0])  # noqa: PTH113 # which never raises
        cause = "the interpreter that its first line names is missing" if script else error.strerror
        sys.exit(f"{arguments[0]}: {cause}")


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
