"""Progress of a command on standard error: a line with a bar on a terminal; in a pipe the compilation alone.

The first command after an installation compiles the kernels, which takes most of a minute and is kept on disk.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

from rig.util.console import Screen
from rig.util.progress import listening

COMPILING: Final = "compiling the kernels once, about 40 s"
_EVENT: Final = "numba:compile"  # of each kernel that is not in the cache


@contextmanager
def working(what: str, enabled: bool = True) -> Iterator[None]:
    """Show on standard error that a command is at ``what``, and how far; nothing when not ``enabled``.

    On a terminal a spinner with what is told (progress.tell) and the time.  Else one plain line, when kernels have
    to be compiled.
    """
    if not enabled:
        yield
        return
    with bar(enabled, SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()) as shown:
        if shown is None:
            with _compilation(_print_once):
                yield
            return
        display = _Display(shown, what)
        with listening(display.step), _compilation(display.compiled):
            yield


@contextmanager
def bar(enabled: bool, *columns: ProgressColumn) -> Iterator[Progress | None]:
    """Show a progress bar on standard error while it is a terminal; None in a pipe or when not enabled."""
    screen = Screen(stderr=True)
    if not enabled or not screen.is_terminal:
        yield None
        return
    with Progress(*columns, console=screen, transient=True) as shown:
        yield shown


def _print_once(count: int) -> None:
    """Print that kernels are compiled, when the first one is."""
    if count == 1:
        Screen(stderr=True).print(COMPILING, soft_wrap=True)


class _Display:
    """One task of a progress display."""

    def __init__(self, shown: Progress, what: str) -> None:
        self._shown, self._task = shown, shown.add_task(what, total=None)

    def step(self, what: str, done: int, total: int) -> None:
        """Show the step; its share where it is known."""
        self._show(what, done, total or None)

    def compiled(self, count: int) -> None:
        """Show that kernels are being compiled."""
        self._show(f"{COMPILING} ({count} begun)", 0, None)

    def _show(self, what: str, done: int, total: int | None) -> None:
        self._shown.tasks[0].total = total  # update() takes None for "as it is"
        self._shown.update(self._task, description=what, completed=done)


@contextmanager
def _compilation(begun: Any) -> Iterator[None]:
    """Call ``begun`` with 1, 2, ... whenever a kernel is compiled within."""
    from numba.core import event

    class Listener(event.Listener):
        count = 0

        def on_start(self, event: Any) -> None:
            self.count += 1
            begun(self.count)

        def on_end(self, event: Any) -> None:
            """Do nothing: the next step or kernel is shown in its turn."""

    with event.install_listener(_EVENT, Listener()):
        yield
