"""A picture of the viewer without a display: what a person would see, for tests and for the documents.

The viewer is driven through rerun.experimental, which may change with any release: here alone.
A Vulkan driver is needed; Mesa's software one will do (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rerun.experimental import ViewerClient

from rig.errors import BadInput, RigError
from rig.view import viewer
from rig.view.blueprint import OVERVIEW
from rig.view.columns import TIMELINE
from rig.view.opened import log_to_rrd

LOADED_S: Final = 30.0  # patience with the viewer
SETTLE_S: Final = 0.5  # it draws what it has been told in the next few of its frames


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture and what the viewer says of it."""

    png: Path
    views: tuple[str, ...]  # names of all views of the layout
    complaints: tuple[str, ...]  # warnings and errors of the views


def screenshot(source: Path, png: Path, time_s: float, tab: str = OVERVIEW) -> Shot:
    """Show ``source`` (.mcap or .rrd) at ``time_s`` and write what is seen to ``png``, 1920 x 1080.

    tab : of the layout, for an .mcap; an .rrd opens with the tab that it was saved with
    BadInput: no such file or tab.  RigError: the viewer does not start (no Vulkan driver?) or load.
    """
    if not source.is_file():
        raise BadInput(f"{source}: no such file")
    with tempfile.TemporaryDirectory() as folder:
        shown = source.resolve()
        if source.suffix == ".mcap":
            shown = Path(folder) / "log.rrd"
            log_to_rrd(source, shown, tab)
        port = viewer.free_port()
        process = viewer.start(["--headless", "--hide-welcome-screen", "--port", str(port)], port)
        try:
            client = ViewerClient.connect(f"rerun+http://{viewer.LOOPBACK}:{port}/proxy")
            return _shoot(client, shown, png, time_s)
        except (RuntimeError, OSError) as error:
            raise RigError(f"{source}: no picture: {str(error).splitlines()[0]}") from None
        finally:
            viewer.stop(process)


def _shoot(client: ViewerClient, shown: Path, png: Path, time_s: float) -> Shot:
    client.open(str(shown))
    deadline = time.monotonic() + LOADED_S
    while not (state := client.get_state()).views or state.loading:
        if time.monotonic() > deadline:
            raise RigError(f"{shown}: the viewer did not load it within {LOADED_S:g} s")
        time.sleep(0.05)
    client.set_time(TIMELINE, duration=time_s, play_state="paused")
    time.sleep(SETTLE_S)
    png.write_bytes(client.take_screenshot())
    views = client.get_state().views
    complaints = [f"{view.name}: {report.summary}" for view in views for report in view.reports]
    return Shot(png, tuple(view.name for view in views), tuple(complaints))
