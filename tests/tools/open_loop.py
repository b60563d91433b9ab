"""Open-loop trials against flights: `python tests/tools/open_loop.py 300` compares so many runs of `reliability`.

Of every run with 4 or 3 good channels: was the same channel isolated, in the same frame?  Earlier faults count too.
"""

import sys

import numpy as np

from rig.campaign.config import read
from rig.campaign.plan import Plan
from rig.reliability.beside import beside
from rig.reliability.trials import planned


def main(most: int, manager: str) -> None:
    """Print what differs, and how many agree."""
    plan = Plan(read("reliability", {"redundancy.manager": manager}), "reliability.toml")
    numbers = [n for n in range(len(plan)) if planned(plan, n)[0] >= 3]
    chosen = np.random.default_rng(0).permutation(numbers)[:most].tolist()
    channels = frames = 0
    for number in chosen:
        found = beside(plan[number].scenario())
        same_channels = bool(((found.flight >= 0) == (found.trial >= 0)).all())
        same_frames = bool((found.flight == found.trial).all())
        channels, frames = channels + same_channels, frames + same_frames
        if not same_frames:
            print(number, plan.choices[number], found.flight.tolist(), found.trial.tolist(), flush=True)
    print(f"{manager}: of {len(chosen)} flights, channels equal in {channels}, frames too in {frames}")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "cross-channel")
