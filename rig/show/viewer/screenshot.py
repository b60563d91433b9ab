"""A picture of the viewer without a display: what a person would see, for tests and for the documents.

A Vulkan driver is needed; Mesa's software one will do (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rig.core.errors import BadInput, RigError
from rig.core.files import replaced
from rig.show.viewer import viewer
from rig.show.viewer.opened import Opened, as_file
from rig.show.viewer.scene import TIMELINE

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

ENDS_S: Final = 2.0  # for a viewer that does not answer
LOADED_S: Final = 30.0  # patience with the viewer
_NEEDS: Final = "a picture needs a Vulkan driver, a software one will do (Debian: apt-get install mesa-vulkan-drivers)"
SETTLE_S: Final = 0.5  # it draws what it has been told in the next few of its frames


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture and what the viewer says of it."""

    png: Path
    views: tuple[str, ...]  # names of all views of the layout
    complaints: tuple[str, ...]  # warnings and errors of the views


def screenshot(opened: Opened, png: Path, time_s: float | None = None) -> Shot:
    """Show ``opened`` at ``time_s`` (its own moment when None) and write what is seen to ``png``, 1920 x 1080.

    BadInput: ``png`` cannot be written.  RigError: the viewer does not start (no Vulkan driver?) or load.
    """
    if png.suffix != ".png":
        raise BadInput(f"{png}: must end in .png")
    with replaced(png) as part, headless() as connect, as_file(opened) as rrd:  # it gets itself ready meanwhile
        client = connect()
        client.open(str(rrd))
        shot = shoot(client, part, opened.moment_s if time_s is None else time_s)
        return replace(shot, png=png)


@contextmanager
def headless() -> Iterator[Callable[[], ViewerClient]]:
    """Start a viewer without a window, on its own port; yield a call that waits until it is ready, and drives it."""
    port = viewer.free_port()
    process = viewer.launch(["--headless", "--hide-welcome-screen", "--port", str(port)])

    def connect() -> ViewerClient:
        viewer.await_port(process, port, needs=_NEEDS)
        return viewer.connect(port)

    try:
        yield connect
    except (RuntimeError, OSError) as error:
        with suppress(subprocess.TimeoutExpired):
            process.wait(ENDS_S)
            raise RigError(f"the Rerun viewer ended at once (exit code {process.returncode}): {_NEEDS}") from None
        raise RigError(f"the viewer: {str(error).splitlines()[0]}") from None
    finally:
        viewer.stop(process)


def shoot(client: ViewerClient, png: Path, time_s: float | None) -> Shot:
    """Write what ``client`` shows at ``time_s``, None for where it is; RigError when it does not load in time.

    A live stream is loading as long as the flight goes on: of one, None is what can be asked for.
    """
    wait_until_loaded(client, live=time_s is None)
    if time_s is not None:
        client.set_time(TIMELINE, duration=time_s, play_state="paused")
    time.sleep(SETTLE_S)
    png.write_bytes(client.take_screenshot())
    views = client.get_state().views
    complaints = [f"{view.name}: {report.summary}" for view in views for report in view.reports]
    return Shot(png, tuple(view.name for view in views), tuple(complaints))


def wait_until_loaded(client: ViewerClient, live: bool = False) -> None:
    """Wait until the viewer shows views and, unless ``live``, loads nothing any more."""
    deadline = time.monotonic() + LOADED_S
    while not (state := client.get_state()).views or (state.loading and not live):
        if time.monotonic() > deadline:
            raise RigError(f"the viewer did not load within {LOADED_S:g} s")
        time.sleep(0.05)
