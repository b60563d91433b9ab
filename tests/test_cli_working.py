"""Progress of commands: on a terminal alone, on standard error; elsewhere one line when kernels are compiled."""

import io
import signal
from typing import Any, cast

import numpy as np
import pytest
from rich.progress import Progress, Task

from rig.cli import working as module
from rig.cli.working import COMPILING, working
from rig.core.console import Screen
from rig.core.interrupt import interruptible
from rig.core.progress import listening, tell


def compiled(name: str) -> None:
    """Compile a kernel that no cache holds."""
    import numba

    space: dict[str, Any] = {}
    exec(f"def {name}(x):\n    return x + 1.0\n", space)  # a function that is nowhere on disk
    made: Any = numba.njit(space[name])
    assert made(np.float64(1.0)) == 2.0


class Terminal(Screen):
    """A terminal on which can be read what was shown."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, width=100)
        self.file, self._force_terminal = io.StringIO(), True
        shown.append(self)


shown: list[Terminal] = []


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> list[Terminal]:
    shown.clear()
    monkeypatch.setattr(module, "Screen", Terminal)
    return shown


def test_what_is_told_reaches_the_listener_alone():
    heard: list[tuple[str, int, int]] = []
    tell("before")
    with listening(lambda *told: heard.append(told)):
        tell("within", 1, 3)
    tell("after")
    assert heard == [("within", 1, 3)]


def test_on_a_terminal_the_step_and_its_share_are_shown(terminal: list[Terminal]):
    with working("starting"):
        tell("flying", 30, 60)
        (task,) = _tasks(terminal)
        assert (task.description, task.completed, task.total) == ("flying", 30, 60)
        tell("scoring")
        assert (task.description, task.total) == ("scoring", None)


def test_on_a_terminal_the_compilation_is_shown_with_its_count(terminal: list[Terminal]):
    with working("starting"):
        compiled("one")
        (task,) = _tasks(terminal)
        assert task.description.startswith(f"{COMPILING} (")


def _tasks(terminal: list[Terminal]) -> list[Task]:
    """Of the display that is running: rich gives no way to it from the console but this."""
    (live,) = terminal[0]._live_stack
    return cast("Progress", live._get_renderable.__self__).tasks  # pyright: ignore


def test_in_a_pipe_one_plain_line_says_that_kernels_are_compiled_when_it_takes_a_while(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    with working("starting"):
        compiled("two")
        compiled("three")
    assert capsys.readouterr() == ("", "")  # a moment is not worth a line
    monkeypatch.setattr(module, "PATIENCE_S", 0.0)
    with working("starting"):
        tell("flying", 1, 2)
        compiled("four")
        compiled("five")
        compiled("six")
    said = capsys.readouterr()
    assert said.out == "" and said.err == f"{COMPILING}\n"


def test_a_signal_ends_a_compilation_although_a_flight_would_only_be_asked_to_end(monkeypatch: pytest.MonkeyPatch):
    pressed = lambda self, count: signal.raise_signal(signal.SIGTERM)  # noqa: E731 # while a kernel is compiled
    monkeypatch.setattr(module._Line, "here", pressed)
    with interruptible() as stop:
        before = signal.getsignal(signal.SIGTERM)
        with pytest.raises(SystemExit) as end, working("starting"):
            compiled("seven")
        assert end.value.code == 143 and not stop.requested
        assert signal.getsignal(signal.SIGTERM) is before


def test_in_a_pipe_nothing_is_said_when_nothing_is_compiled(capsys: pytest.CaptureFixture[str]):
    with working("starting"):
        tell("flying", 1, 2)
    assert capsys.readouterr() == ("", "")


def test_where_one_json_object_is_asked_for_nothing_is_said(capsys: pytest.CaptureFixture[str]):
    with working("starting", enabled=False):
        tell("flying", 1, 2)
        compiled("eight")
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("paced", [(), ("--realtime-factor", "10")], ids=["as fast as it can", "paced"])
def test_a_flight_tells_how_far_it_is(paced: tuple[str, ...], rig_command):
    heard: list[tuple[str, int, int]] = []
    with listening(lambda *told: heard.append(told)):
        code, _, err = rig_command("fly", "--set", "duration_s=3", "--set", "faults=[]", *paced)
    assert code == 0 and "flying" not in err
    assert ("flying", 300, 300) in heard
