"""How far a long piece of work is: the library tells it, the command that was asked for the work shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[str, int, int], None]  # what is done; how much of it, of how much (0: not known)
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def tell(what: str, done: int = 0, total: int = 0) -> None:
    """Tell whoever listens in this context that ``done`` of ``total`` parts of ``what`` are done; nobody may."""
    listener = _listener.get()
    if listener is not None:
        listener(what, done, total)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Give ``listener`` what is told within."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)
