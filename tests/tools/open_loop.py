"""Open-loop trials against flights: `python tests/tools/open_loop.py 1056` compares so many runs of `reliability`.

Of every run that leaves two good channels: was the vote kept in both, and the same channel isolated, in the same frame?
Earlier faults count too.  What follows a vote that is not kept does not count in a trial, and is told apart.
"""

import sys

import numpy as np
from trial_vs_flight import TrialVsFlight, trial_vs_flight

from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.cell_trials import leaves_two_good, planned


def told(found: list[TrialVsFlight]) -> str:
    """How many isolate the same channels, and in the same frames."""
    channels = sum(bool(((one.flight >= 0) == (one.trial >= 0)).all()) for one in found)
    frames = sum(bool((one.flight == one.trial).all()) for one in found)
    return f"channels equal in {channels} of {len(found)}, frames too in {frames}"


def main(most: int, manager: str) -> None:
    """Print what differs, and how many agree."""
    plan = Plan(read("reliability", {"redundancy.manager": manager}), "reliability.toml")
    numbers = [n for n in range(len(plan)) if leaves_two_good(*planned(plan, n))]
    chosen = np.random.default_rng(0).permutation(numbers)[:most].tolist()
    found = [trial_vs_flight(plan[number].scenario()) for number in chosen]
    for number, one in zip(chosen, found, strict=True):
        if (one.flight != one.trial).any() or one.flight_kept != one.trial_kept:
            print(number, plan.choices[number], one, flush=True)
    agree = [one for one in found if one.flight_kept == one.trial_kept]
    print(f"{manager}: {len(found)} flights; vote kept or not in both: {len(agree)}")
    print(f"kept: {told([one for one in agree if one.trial_kept])}")
    print(f"not kept: {told([one for one in agree if not one.trial_kept])}")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "cross-channel")
