"""Progress of a command on standard error: a line with a bar on a terminal; in a pipe only the compilation.

The first flight after an installation compiles its kernels in separate processes.  Other commands and later flights
compile only missing kernels.  An interruption ends the compilation at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

from rig.core.console import Screen
from rig.core.progress import listening, tell

if TYPE_CHECKING:
    from rig.studies.campaign.compile_ahead import Ahead

COMPILING: Final = "compiling kernels (once per installation)"
PATIENCE_S: Final = 3.0  # less is not worth a line
_EVENT: Final = "numba:compile"  # of each kernel that is not in the cache


@contextmanager
def working(what: str, enabled: bool = True, *, steps: bool = False, compiles: bool = True) -> Iterator[None]:
    """Show on standard error the step ``what`` of a command and its progress; show nothing when not ``enabled``.

    A terminal shows a spinner with the text of progress.tell and the time.  A pipe gets one plain line if kernels must
    be compiled, and with ``steps`` one line for each step of minutes of work.
    compiles : False for a block that needs no kernel, nor the 80 MB of the compiler
    """
    compilation = _compilation if compiles else nullcontext
    with bar(enabled, SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()) as shown:
        if shown is None:
            with listening(_Lines().step) if steps and enabled else nullcontext(), compilation(_Line(enabled)):
                yield
            return
        display = _Display(shown, what)
        with listening(display.step), compilation(display):
            yield


@contextmanager
def bar(enabled: bool, *columns: ProgressColumn) -> Iterator[Progress | None]:
    """Show a progress bar on standard error if it is a terminal; yield None in a pipe or when not enabled."""
    screen = Screen(stderr=True)
    if not enabled or not screen.is_terminal:
        yield None
        return
    with Progress(*columns, console=screen, transient=True) as shown:
        yield shown


class _Line:
    """One plain line for a compilation that takes a while."""

    def __init__(self, enabled: bool) -> None:
        self._due, self._silent, self._began = enabled, not enabled, 0.0

    def ahead(self, done: int, total: int) -> None:
        """Print the line: most kernels of a flight must be compiled."""
        if self._due:
            Screen(stderr=True).print(COMPILING, soft_wrap=True)
        self._due = False
        if self._silent:
            tell(COMPILING, done, total)  # to who called the command

    def here(self, count: int) -> None:
        """Print the line when the first kernel has taken some seconds."""
        now = time.monotonic()
        self._began = self._began or now
        if now - self._began > PATIENCE_S:
            self.ahead(count, 0)


class _Lines:
    """A line for each step that is new."""

    def __init__(self) -> None:
        self._last = ""

    def step(self, what: str, done: int, total: int) -> None:
        """Print the step, and its number of the total if known."""
        if what != self._last:
            self._last = what
            Screen(stderr=True).print(f"{what} ({done + 1} of {total})" if total else what, soft_wrap=True)


class _Display:
    """One task of a progress display."""

    def __init__(self, shown: Progress, what: str) -> None:
        self._shown, self._task = shown, shown.add_task(what, total=None)

    def step(self, what: str, done: int, total: int) -> None:
        """Show the step, and its share if known."""
        self._show(what, done, total or None)

    def ahead(self, done: int, total: int) -> None:
        """Show how many kernels of a flight are compiled."""
        self._show(f"{COMPILING} ({done} of {total})", done, total)

    def here(self, count: int) -> None:
        """Show that kernels are being compiled."""
        self._show(f"{COMPILING} ({count} started)", 0, None)

    def _show(self, what: str, done: int, total: int | None) -> None:
        self._shown.tasks[0].total = total  # update() takes None for "as it is"
        self._shown.update(self._task, description=what, completed=done)


@contextmanager
def _compilation(shown: _Line | _Display) -> Iterator[None]:
    """Have what a flight needs compiled ahead within; show it, and what is compiled in this process."""
    from numba.core import event

    from rig.core.interrupt import at_once
    from rig.core.kernel_cache import before_compiling

    class Listener(event.Listener):
        count, depth = 0, 0
        until_done = ExitStack()

        def on_start(self, event: Any) -> None:
            if self.depth == 0:
                self.until_done.enter_context(at_once())
            self.count, self.depth = self.count + 1, self.depth + 1
            shown.here(self.count)

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                self.until_done.close()

    with before_compiling(_ahead(shown.ahead)), event.install_listener(_EVENT, Listener()):
        yield


def _ahead(show: Callable[[int, int], None]) -> Callable[[Callable[..., object], Path], None]:
    """Return what compiles a flight's kernels when one is missing; a command that compiles nothing imports nothing."""

    @cache
    def ahead() -> Ahead:
        from rig.studies.campaign.compile_ahead import Ahead

        return Ahead(show)

    return lambda function, path: ahead().compile_missing(function, path)
