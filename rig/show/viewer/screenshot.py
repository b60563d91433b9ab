"""A picture of the viewer without a display, for tests and for the documents.

It needs a Vulkan driver; the software driver of Mesa is sufficient (Debian: mesa-vulkan-drivers).
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
from rig.show.viewer.opened import Contents, as_file
from rig.show.viewer.scene import TIMELINE

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

ENDS_S: Final = 2.0  # wait for a viewer that does not reply
LOADED_S: Final = 30.0  # longest wait for the viewer
_NEEDS: Final = "a picture needs a Vulkan driver, at least a software one (Debian: apt-get install mesa-vulkan-drivers)"
SETTLE_S: Final = 0.5  # the viewer draws a change within a few of its frames


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture, and the views and warnings that the viewer reports."""

    png: Path
    views: tuple[str, ...]  # names of all views of the layout
    complaints: tuple[str, ...]  # warnings and errors of the views


def screenshot(opened: Contents, png: Path, time_s: float | None = None) -> Shot:
    """Show ``opened`` at ``time_s`` (if None, at its moment) and write the picture to ``png``, 1920 x 1080.

    BadInput: ``png`` cannot be written.  RigError: the viewer does not start (no Vulkan driver?) or load.
    """
    if png.suffix != ".png":
        raise BadInput(f"{png}: must end in .png")
    with replaced(png) as part, headless() as connect, as_file(opened) as rrd:  # starts while the file is written
        client = connect()
        client.open(str(rrd))
        shot = shoot(client, part, opened.moment_s if time_s is None else time_s)
        return replace(shot, png=png)


@contextmanager
def headless() -> Iterator[Callable[[], ViewerClient]]:
    """Start a viewer without a window, on its own port; yield a call that waits for it and returns its client."""
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
    """Write the picture of ``client`` at ``time_s``, None: at its cursor; RigError: it did not load in time.

    A live stream loads as long as the flight continues, so it needs ``time_s`` of None.
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
    """Wait until the viewer shows views and, unless ``live``, has finished loading."""
    deadline = time.monotonic() + LOADED_S
    while not (state := client.get_state()).views or (state.loading and not live):
        if time.monotonic() > deadline:
            raise RigError(f"the viewer did not load within {LOADED_S:g} s")
        time.sleep(0.05)
