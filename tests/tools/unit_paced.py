"""Paced flights with a UDP unit that loses, repeats and delays by a seeded plan: do the counts equal the plan?

    python tests/tools/unit_paced.py LIBRARY [--seconds 60] [--rates 100 400 1000]

LIBRARY: libmonitor.so.  Each rate is flown with nothing wrong, alone and with a stream for the viewer, and by the plan.
Misses beyond the plan are the machine's: the share of a frame that an answer may take is 0.8.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from unit_files import udp

import rig
from rig.frame import Unit as Answer
from rig.unit.settings import Unit


def planned(frames: int, period_s: float, seed: int = 1) -> list[Any]:
    """One thing wrong in every hundred frames, for one to three frames, far enough from the next."""
    draw, plan = random.Random(seed), []
    for first in range(100, frames - 100, 100):
        kind = draw.choice(["lost-request", "lost-reply", "double", "delay"])
        at = first + draw.randrange(50)
        last = at if kind == "delay" else at + draw.randrange(3)
        plan.append([kind, at, last, *([1.5 * period_s] if kind == "delay" else [])])
    return plan


def expected(plan: list[Any]) -> dict[str, int]:
    """Frames of each kind."""
    kinds = ("lost-request", "lost-reply", "double", "delay")
    return {kind: sum(last - first + 1 for name, first, last, *_ in plan if name == kind) for kind in kinds}


def fly(folder: Path, tested: Unit, rate_hz: int, seconds: float, rerun: str = "off") -> rig.Flight:
    """A paced flight of the default scenario without faults."""
    sets = [f"rate_hz={rate_hz}", f"duration_s={seconds}", "faults=[]"]
    return rig.fly(overrides=sets, out=folder, unit=tested, realtime_factor=1.0, rerun=rerun)


def told(flight: rig.Flight) -> str:
    """Lateness (of the first and the last third, too), replies and misses of a flight."""
    unit, jitter, late = flight.unit or {}, flight.jitter, flight.recorded.timing["late_us"]
    reply, third = unit["reply"], len(late) // 3
    assert jitter is not None
    grows = f"{np.median(late[:third]):.1f} to {np.median(late[-third:]):.1f}"
    return (
        f"late median {jitter.median_us:.0f}, 99 % {jitter.p99_us:.0f}, worst {jitter.worst_us:.0f} us "
        f"(thirds {grows}); "
        f"reply median {reply['median_us']:.0f}, 99 % {reply['p99_us']:.0f}, 99.9 % {reply['p999_us']:.0f}, "
        f"worst {reply['worst_us']:.0f} us; missed {unit['missed']} of {flight.frames}"
    )


def main() -> None:
    """Print three lines a rate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rates", type=int, nargs="+", default=[100, 400, 1000])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for rate_hz in given.rates:
            tested = udp(folder, [], given.library, max_missed=1000)
            print(f"{rate_hz} Hz, alone: {told(fly(folder, tested, rate_hz, given.seconds))}", flush=True)
            print(f"{rate_hz} Hz, streamed: {told(fly(folder, tested, rate_hz, given.seconds, 'serve'))}", flush=True)
            plan = planned(round(given.seconds * rate_hz), 1.0 / rate_hz)
            flight = fly(folder, udp(folder, plan, given.library, max_missed=1000), rate_hz, given.seconds)
            unit, want, held = flight.unit or {}, expected(plan), flight.rows["unit"] == Answer.HELD
            lost = [k for kind, first, last, *_ in plan if kind.startswith("lost") for k in range(first, last + 1)]
            delayed = [first for kind, first, *_ in plan if kind == "delay"]
            print(
                f"{rate_hz} Hz, planned: lost requests {unit['requests_lost']} (plan {want['lost-request']}), "
                f"lost replies {unit['replies_lost']} (plan {want['lost-reply']}), discarded {unit['discarded']} "
                f"(doubled {want['double']}), planned losses held {int(held[lost].sum())} of {len(lost)}, "
                f"delayed frames held {int(held[delayed].sum())} of {len(delayed)}, late {unit['late']}; "
                f"{told(flight)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
