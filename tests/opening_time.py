"""How long a log takes to open; not a test, run it by hand:

    python tests/opening_time.py logs/flight.mcap [LOG ...]

A viewer without a window runs already.  Timed: reading and checking the log, writing its .rrd, and until the viewer has
all of it (asked for its last frame) and has drawn it.  The viewer needs a Vulkan driver (docs/viewer.md).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from rig.view.opened import as_file, read
from rig.view.screenshot import headless, wait_until_loaded


def main() -> None:
    """Open the logs named and print the times."""
    with headless() as client:
        for repeat in range(3):
            began = time.perf_counter()
            opened = read([Path(name) for name in sys.argv[1:]])
            was_read = time.perf_counter()
            with as_file(opened) as rrd:
                written = time.perf_counter()
                client.open(str(rrd))
                last_ns = max(round(int(log.rows["frame"][-1]) * 1e9 / log.rate_hz) for log in opened.logs)
                while (client.get_recording_schema(paths_only=True).timelines[0].end or 0) < last_ns:
                    time.sleep(0.01)
                wait_until_loaded(client)
                loaded = time.perf_counter()
                client.take_screenshot()
                drawn = time.perf_counter()
            steps = zip(
                ("read", "written", "loaded", "drawn"),
                (began, was_read, written, loaded),
                (was_read, written, loaded, drawn),
                strict=True,
            )
            said = ", ".join(f"{name} {end - start:.2f} s" for name, start, end in steps)
            print(f"run {repeat + 1}: {opened.frames} frames, {said}; in all {drawn - began:.2f} s", flush=True)
            client.close("all")


if __name__ == "__main__":
    main()
