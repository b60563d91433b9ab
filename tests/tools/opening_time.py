"""How long a log takes to open; not a test, run it by hand:

    python tests/tools/opening_time.py logs/flight.mcap [LOG ...]

Three times what ``rig view LOG`` does, each in a process of its own and with a viewer of its own (without a window),
timed from the start of the process: until Python has what it needs, the log is read and checked, the .rrd is written
(the viewer starts meanwhile), the viewer has it all, and the overview stands on the screen at the end of the flight.
The viewer needs a Vulkan driver (docs/viewer.md); where that is a software one, it takes much of the last step.
"""

from __future__ import annotations

import gc
import io
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

PLOTS: Final = ((90, 380), (420, 640))  # rows of the picture in which the signal and its deviation are plotted
COLUMNS: Final = slice(160, 1200)  # right of the legend
LINE: Final = 300  # pixels of a line that crosses a plot, at least


def main() -> None:
    """Open the logs named and print the times."""
    for repeat in range(3):
        print(f"run {repeat + 1}: ", end="", flush=True)
        started = str(time.perf_counter())  # the same clock in every process of this machine
        subprocess.run([sys.executable, __file__, "--from", started, *sys.argv[1:]], check=True)


def once(started: float, logs: list[Path]) -> None:
    """Open the logs as ``rig view`` does, and say when which step was done."""
    gc.disable()
    from rig.view.columns import Columns  # noqa: F401  # what writing needs is counted as Python's
    from rig.view.opened import as_file, read
    from rig.view.screenshot import headless, wait_until_loaded

    done = {"Python": time.perf_counter()}
    opened = read(logs)
    done["read"] = time.perf_counter()
    last_s = max(int(log.rows["frame"][-1]) / log.rate_hz for log in opened.logs)
    with headless() as connect, as_file(opened) as rrd:
        done["written"] = time.perf_counter()
        client = connect()
        client.open(str(rrd))
        wait_until_loaded(client)
        done["loaded"] = time.perf_counter()
        _wait_until_drawn(client, last_s)
        done["drawn"] = time.perf_counter()
    said, before = [], started
    for step, at in done.items():
        said.append(f"{step} {at - before:.2f} s")
        before = at
    print(f"{opened.frames} frames, {', '.join(said)}; in all {before - started:.2f} s", flush=True)


def _wait_until_drawn(client: Any, last_s: float) -> None:
    """Wait until the last frame is there and the vote crosses the overview's plots at the end of the flight."""
    import numpy as np
    from PIL import Image

    from rig.view.scene import TIMELINE
    from rig.view.style import VOTED

    client.set_time(TIMELINE, duration=last_s, play_state="paused")
    time.sleep(0.05)  # a picture asked for at once shows plots that are not drawn yet, and costs half a second
    while True:
        [timeline] = client.get_recording_schema(paths_only=True).timelines
        picture = np.asarray(Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")).astype(int)
        near = np.abs(picture - VOTED).max(axis=-1) < 60
        if (timeline.end or 0) >= round(last_s * 1e9) and all(near[a:b, COLUMNS].sum() > LINE for a, b in PLOTS):
            return


if __name__ == "__main__":
    if sys.argv[1] == "--from":
        once(float(sys.argv[2]), [Path(name) for name in sys.argv[3:]])
    else:
        main()
