"""The keys of a terminal during a flight: each takes effect at once, without Enter."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

from rig.core.errors import BadInput


class Pressable(Protocol):
    """Receiver of the keys."""

    def press(self, key: str) -> None:
        """Take one key."""


def keyboard(enabled: bool) -> Callable[[Pressable], AbstractContextManager[None]] | None:
    """Return the argument ``live`` of a flight; None if not enabled, or if standard input is not a terminal."""
    return pressing if enabled and sys.stdin.isatty() else None


@contextmanager
def pressing(keys: Pressable) -> Iterator[None]:
    """Hand every key of standard input to ``keys`` inside the context; restore the terminal at its end.

    BadInput: standard input is not a terminal.
    """
    try:
        import termios
        import tty

        fd = sys.stdin.fileno()
        before = termios.tcgetattr(fd)
    except (ImportError, OSError, ValueError) as error:
        raise BadInput(f"keys: standard input is not a terminal ({error})") from None
    ended, end = os.pipe()
    thread = threading.Thread(target=_listen, args=(fd, ended, keys), name="keyboard", daemon=True)
    try:
        tty.setcbreak(fd)
        thread.start()
        yield
    finally:
        os.write(end, b"q")
        thread.join()
        termios.tcsetattr(fd, termios.TCSADRAIN, before)
        os.close(ended)
        os.close(end)


def _listen(fd: int, ended: int, keys: Pressable) -> None:
    while ended not in (ready := select.select([fd, ended], [], [])[0]):
        if fd in ready:
            data = os.read(fd, 64)
            if not data:
                return
            for key in data.decode(errors="ignore"):
                keys.press(key)
