"""How often the interval of ``rig campaign run --until`` ever excludes the truth, and how many flights it takes.

python tests/tools/until_coverage.py [RUNS]    # 10,000 without; one line a half-width and proportion

The interval is looked at after every flight, four times as long as it takes to be as narrow as wanted.
"""

from __future__ import annotations

import sys
from math import log
from typing import Final

import numpy as np

from rig.studies.campaign.confidence_sequence import fixed_trials, sequence_trials

SHARES: Final = (0.01, 0.1, 0.5, 0.9)
WIDTHS: Final = (0.05, 0.02)
_AT_A_TIME: Final = 500


def ever_excluded(share: float, half_width: float, runs: int, trials: int, seed: int = 57) -> int:
    """Return in how many ``runs`` of ``trials`` flights the interval excludes ``share`` at any flight."""
    rng, bound, excluded = np.random.default_rng(seed), log(2.0 / 0.05), 0
    for first in range(0, runs, _AT_A_TIME):
        yes = rng.random((min(_AT_A_TIME, runs - first), trials)) < share
        out = np.zeros(len(yes), bool)
        for q in (share + half_width, share - half_width):
            if 0.0 < q < 1.0:  # beyond, the end of the interval never passes the share
                steps = np.where(yes, log(q / share), log((1.0 - q) / (1.0 - share)))
                out |= (np.cumsum(steps, axis=1) >= bound).any(axis=1)
        excluded += int(out.sum())
    return excluded


def main() -> None:
    """Print a line a half-width and proportion."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    print("half-width  proportion  ever excluded       flights  a fixed number")
    for width in WIDTHS:
        for share in SHARES:
            need = sequence_trials(width, share)
            out = ever_excluded(share, width, runs, 4 * need)
            fixed = fixed_trials(width, share)
            print(f"{width:10g}  {share:10g}  {out:5d} of {runs} ({out / runs:.4f})  {need:6d}  {fixed:6d}")


if __name__ == "__main__":
    main()
