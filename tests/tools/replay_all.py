"""``make replay``: every bundled scenario flown to its end, replayed and flown again; 1 when one is not the same."""

import sys
import tempfile
from time import perf_counter

from rig.bench.replay.verify import verify
from rig.core.files import bundled
from rig.flight.fly import fly
from rig.log.recordings.flown_log import recorded


def main() -> int:
    """One line a scenario."""
    worst = 0
    for path in sorted(bundled("faults").glob("*.toml")):
        with tempfile.TemporaryDirectory() as folder:
            recording = recorded(fly(path, out=folder).log)
            began = perf_counter()
            replayed = verify(recording).comparison
            middle = perf_counter()
            flown = verify(recording, fly=True).comparison
            took = middle - began, perf_counter() - middle
        for how, found, seconds in zip(("replay", "--fly"), (replayed, flown), took, strict=True):
            word = "identical" if found.identical else "DIFFERENT"
            worst |= not found.identical
            counted = f"{found.frames} frames, {len(found.fields)} fields, {seconds:.2f} s"
            print(f"{path.stem:40} {how:7} {word} ({counted})", flush=True)
    return worst


if __name__ == "__main__":
    sys.exit(main())
