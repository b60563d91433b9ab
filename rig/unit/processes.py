"""What the rig starts for a unit, what it printed, how it ended; nothing is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.errors import BadInput
from rig.text import one_line
from rig.unit.host import LOOKS

MOST_OUTPUT: Final = 4096  # bytes of what it printed that are shown
END_S: Final = 1.0  # to end by itself when it is told that the session is over
_HOSTS: Final = {"library": "host.py", "exec": "host.py", "fmu": "fmu_host.py"}


class Started:
    """A process of the unit: the host of a library, or a command."""

    def __init__(
        self,
        kind: str,
        arguments: Iterable[str],
        fds: tuple[int, ...] = (),
        folder: Path | None = None,
        looks: int = 0,
    ) -> None:
        """Start the host of ``kind`` with ``arguments``; BadInput when the system cannot.

        fds : that it inherits; folder : in which it runs; looks : for a message, before it sleeps
        """
        self._command = kind == "exec"
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 # lives as long as the process
        host = str(Path(__file__).with_name(_HOSTS[kind]))
        command = [sys.executable, "-I", host, kind, str(os.getpid()), *arguments]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                pass_fds=fds,
                cwd=folder,
                env={**os.environ, LOOKS: str(looks)},
                start_new_session=True,  # a Ctrl-C is the rig's
            )
        except OSError as error:
            raise BadInput(f"the unit's process cannot be started: {error.strerror}") from None

    def how_it_ended(self, wait_s: float = 0.0) -> str | None:
        """None while it runs."""
        try:
            code = self._process.wait(wait_s) if wait_s else self._process.poll()
        except subprocess.TimeoutExpired:
            return None
        if code is None:
            return None
        if code < 0:
            return f"killed by signal {-code} ({signal.Signals(-code).name})"
        return f"exited with status {code}"

    def stop(self) -> None:
        """End it, and all that it has started in its session.

        The host of a library sees that its socket is closed; a command that waits for a datagram does not.
        """
        if self._command:
            self._signal(signal.SIGTERM)
        self.how_it_ended(END_S)
        self._signal(signal.SIGKILL)
        self._process.wait()

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def printed(self) -> str:
        """The end of what it has written to its standard output and error."""
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - MOST_OUTPUT))
        return self._output.read().decode(errors="replace")

    def forget(self) -> None:
        """Let go of what it printed."""
        self._output.close()

    def last_line(self) -> str:
        """The last line that it printed, for a message."""
        lines = [line for line in self.printed().splitlines() if line.strip()]
        return one_line(lines[-1]) if lines else ""
