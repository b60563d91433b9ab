"""What a search makes least: the margin of its requirements; where they say yes or no, or agree, that of the vote."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

from rig.assess.requirements import Requirement, find_requirements, load_requirements
from rig.assess.requirements.requirement import names
from rig.errors import BadInput
from rig.text import choices, quoted

TIE: Final = 1e-6  # of the margin of the vote, which is at most 1000: less than any margin that matters
NONE: Final = 1000.0  # margin where no requirement applies, or nothing was flown
VOTE: Final = Requirement(
    id="vote-of-search",
    text="Ties: the vote stays within the threshold of the truth, or the signal is lost",
    at="each onset",
    formula="always[0, 60] (abs(error.{signal}) <= threshold.{signal} or state(level.{signal} < 1))",
)


class Measured(NamedTuple):
    """One draw: what it is worth."""

    margin: float  # least of the requirements; against another setting the difference of two
    vote: float  # least margin of the vote of the signals with faults
    violated: bool  # against another setting: here, and not there

    @property
    def value(self) -> float:
        """Return the number that is made least."""
        return self.margin + TIE * self.vote


def chosen(ids: Sequence[str], files: Sequence[str] = (), own: Sequence[dict[str, Any]] = ()) -> list[Requirement]:
    """Return the requirements of these ids: of ``files``, else a campaign's ``own`` before the bundled sets.

    BadInput: unknown id.
    """
    known = {each.id: each for each in load_requirements(list(files) or [*map(find_requirements, names())])}
    if not files:
        known |= {each["id"]: Requirement.model_validate(each) for each in own}
    for name in ids:
        if name not in known:
            raise BadInput(f"--requirement {quoted(name)}: unknown, {choices(name, list(known))}")
    return [known[name] for name in dict.fromkeys(ids)]


def measured(rows: Sequence[dict[str, Any]], ids: Iterable[str]) -> Measured:
    """Return what a draw is worth, by its rows of ``runs``: one, or two with the other setting's behind."""
    ids = set(ids)
    told = [json.loads(row.get("requirements") or "[]") for row in rows]
    margins, votes = [_least(each, ids) for each in told], [_least(each, {VOTE.id}) for each in told]
    violated = [any(one["status"] == "violated" for one in each if one["requirement"] in ids) for each in told]
    return Measured(margins[0] - sum(margins[1:]), votes[0] - sum(votes[1:]), violated[0] and not any(violated[1:]))


def _least(told: Sequence[dict[str, Any]], ids: set[str]) -> float:
    margins = [one["margin"] for one in told if one["requirement"] in ids]
    return min((margin for margin in margins if margin is not None), default=NONE)
