"""The process that the rig starts for a unit: its output and its end; no process is left behind."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput
from rig.core.interrupt import signal_name
from rig.core.text import one_line
from rig.unit.environment import declared, kept
from rig.unit.guard import END_S, MOST_SHOWN, REMOVED, remove
from rig.unit.host import LOOKS
from rig.unit.unit_file import Unit

_HERE: Final = Path(__file__).parent
_HOSTS: Final = {"library": "host.py", "fmu": "fmu_host.py"}
_AS_TOLD: Final = ("exited with status 0", "killed by signal 15 (SIGTERM)")
_REMOVED_S: Final = 60.0  # in which its folder is removed
_AFTER_END_S: Final = 0.05  # in which a command that has been told of the end may still go wrong


class UnitProcess:
    """A process of the unit behind its guard (guard.py): the host of a library, or a command."""

    def __init__(
        self,
        kind: str,
        arguments: Iterable[str],
        fds: tuple[int, ...] = (),
        folder: Path | None = None,
        looks: int = 0,
        *,
        unit: Unit | None = None,
        beside: tuple[Path, ...] = (),
    ) -> None:
        """Start the host of ``kind`` or, for "exec", the command ``arguments``.  BadInput: the system cannot start it.

        fds : descriptors that it inherits; folder : its working folder; looks : for a message, before it sleeps
        unit : whose environment it has; beside : folders that are removed with its own
        """
        self._is_command = kind == "exec"
        what, given = ["exec"] if self._is_command else [str(_HERE / _HOSTS[kind])], [*arguments]
        if self._is_command:
            what.append(shutil.which(given[0]) or given[0])
        command = [sys.executable, "-I", str(_HERE / "guard.py"), str(os.getpid()), *what, *given]
        try:
            self._output = tempfile.TemporaryFile()  # noqa: SIM115 # lives as long as the process
            own = Path(tempfile.gettempdir(), f"rig-unit-{secrets.token_hex(8)}")
            self._folders = [os.fsencode(path) for path in (own, *beside)]
            variables = {} if unit is None else declared(unit.environment, unit.folder, own)
            with tempfile.TemporaryFile() as orders:
                orders.write(_orders(variables, self._folders))
                orders.seek(0)
                self._process = subprocess.Popen(
                    command,
                    stdin=orders,
                    stdout=self._output,
                    stderr=subprocess.STDOUT,
                    pass_fds=fds,
                    cwd=folder,
                    env={**kept(), LOOKS: str(looks)},
                    start_new_session=True,  # a Ctrl-C is the rig's
                )
        except OSError as error:
            raise BadInput(f"the unit's process cannot be started: {error.strerror}") from None

    def how_it_ended(self, wait_s: float = 0.0) -> str | None:
        """Return the kind of its end, None while it runs."""
        try:
            code = self._process.wait(wait_s) if wait_s else self._process.poll()
        except subprocess.TimeoutExpired:
            return None
        if code is None:
            return None
        if code < 0:
            return f"killed by signal {signal_name(-code)}"
        return f"exited with status {code}"

    def stop(self) -> str:
        """End it and all its processes; return the kind of its end if it is not the requested one, otherwise "".

        The host of a library detects that its socket is closed; a command that waits for a datagram does not.
        """
        if self._output.closed:  # and stopped before
            return ""
        ended = self.how_it_ended(_AFTER_END_S if self._is_command else END_S)
        if ended is None and self._is_removed:
            ended = self.how_it_ended(_REMOVED_S)
        if ended is None:
            self._process.terminate()  # its guard kills it, and all below it, after END_S
            ended = self.how_it_ended(3 * END_S)
            if not self._is_command or ended is None or "SIGKILL" in ended:
                ended = f"did not end within {END_S:g} s and was killed"
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)  # where no guard could look for them
        self._process.wait()
        remove(self._folders)  # where no guard has
        return "" if ended in _AS_TOLD else ended

    @property
    def _is_removed(self) -> bool:
        """Return True while the guard removes the unit's folder: the unit has ended."""
        return os.path.lexists(self._folders[0] + REMOVED)

    def printed(self) -> str:
        """Return the end of its standard output and error; nothing once it is forgotten."""
        if self._output.closed:
            return ""
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - MOST_SHOWN))
        return self._output.read().decode(errors="replace")

    def forget(self) -> None:
        """Discard its output."""
        self._output.close()

    def last_line(self) -> str:
        """Return the last line of its output, for an error."""
        lines = [line for line in self.printed().splitlines() if line.strip()]
        return one_line(lines[-1]) if lines else ""


def _orders(variables: Mapping[str, str], folders: Iterable[bytes]) -> bytes:
    """Return the orders of a guard, as it reads them."""
    pairs = (f"{name}={value}".encode() for name, value in variables.items())
    return b"\0".join([*pairs, b"", *folders])
