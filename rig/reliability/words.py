"""Results in the words of a page or a terminal."""

from __future__ import annotations

from typing import Final

from rig.reliability.result import Contribution, Estimate, Result

TITLES: Final = {
    "bad_vote": "bad vote, not declared",
    "known_loss": "known loss of the signal",
    "lost_aircraft": "lost aircraft",
}
WORTH_SAYING = 0.01  # of a result
MOST = 3  # parts of what decides one


def interval(found: Estimate) -> str:
    """Return a probability with its interval, or its upper end where the data give no lower one."""
    if found.low is None:
        return f"< {found.high:.2e}"
    return f"{found.median:.2e} ({found.low:.2e} to {found.high:.2e})"


def decided_by(one: Result) -> str:
    """Return what makes a result, the largest first, and what would make its interval narrower."""
    parts = [_part(share) for share in one.contributions if share.share >= WORTH_SAYING]
    return "; ".join(parts[:MOST]) if parts else "all channels failing"


def _part(one: Contribution) -> str:
    seen = f", {one.seen} of {one.trials} not kept, {one.trials_to_halve} more halve the interval" if one.trials else ""
    return f"{one.cell} {100 * one.share:.0f} %{seen}"
