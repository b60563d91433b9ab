"""How many flights a second a campaign flies; not a test, run it by hand on an idle machine:

    python tests/campaign_throughput.py [RUNS]

Flights of 20 s at 100 Hz with every log kept, by one worker and by two, beside what ``rig bench`` says of a frame in
the same minutes: what a worker could do if a flight were nothing but its frames, log included, and the share of time
that bare JSBSim would take.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

FRAMES = 2000
CAMPAIGN = """
title = "Throughput"
base = "f16_pitch_rate_hardover"
sampling = "random"
runs = {runs}
seed = 1
set = {{ duration_s = 20.0, "faults.0.start_s" = 5.0 }}
vary = {{ "faults.0.channels.0" = [1, 2, 3, 4] }}
run = {{ batch = 10, logs = "all" }}
"""


def rig(*arguments: str) -> dict[str, Any]:
    """What a command prints with --json."""
    said = subprocess.run([sys.executable, "-m", "rig.cli", *arguments, "--json"], capture_output=True, check=True)
    return json.loads(said.stdout)


def main(runs: int) -> None:
    """Bench, one worker, two workers, bench again; print the comparison."""
    benches = [rig("bench")]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "throughput.toml")
        file.write_text(CAMPAIGN.format(runs=runs))
        flown = {n: rig("campaign", "run", str(file), "--out", f"{folder}/{n}", "--workers", str(n)) for n in (1, 2)}
    benches.append(rig("bench"))
    frame_us, bare_us = (sum(bench[key] for bench in benches) / 2 for key in ("frame_us", "bare_us"))
    ratios = ", ".join(f"{bench['ratio']:.2f}" for bench in benches)
    allowed = 1e6 / (frame_us * FRAMES)
    print(f"rig bench         {frame_us:.2f} us a frame, {bare_us:.2f} us bare JSBSim, ratio {ratios}")
    print(f"its frame allows  {allowed:.2f} flights of 20 s a second")
    for workers, found in flown.items():
        rate = found["flights_per_s"] / workers
        share = f"{rate / allowed:.0%} of that, bare JSBSim {rate * FRAMES * bare_us / 1e6:.0%}"
        print(f"{workers} worker(s)       {found['done']} of {found['runs']}, {rate * workers:.2f} a second")
        print(f"                  {rate:.2f} a second a core, {share}")
    one, two = flown.values()
    equal = "equal" if one["table_sha256"] == two["table_sha256"] else "DIFFERENT"
    print(f"two to one        {two['flights_per_s'] / one['flights_per_s']:.2f}; {equal} tables")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
