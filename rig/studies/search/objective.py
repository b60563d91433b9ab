"""The minimised value of a search: robustness of its requirements, then robustness of the vote for states and ties."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

from rig.core.errors import BadInput
from rig.core.text import choices, quoted
from rig.verdict.requirements.requirement import Requirement, find_requirements, load_requirements, names

TIE: Final = 1e-6  # of the robustness of the vote, which is at most 1000: less than any robustness that matters
NONE: Final = 1000.0  # robustness if no requirement applies, or nothing was flown
VOTE: Final = Requirement(
    id="vote-of-search",
    text="Ties: the vote stays within the threshold of the truth, or the signal is lost",
    at="each onset",
    formula="always[0, 60] (abs(error.{signal}) <= threshold.{signal} or state(level.{signal} < 1))",
)


class Measured(NamedTuple):
    """The value of one draw."""

    robustness: float  # least of the requirements; against another setting the difference of two
    vote: float  # least robustness of the vote of the signals with faults
    violated: bool  # against another setting: here, and not there
    violating: tuple[str, ...] = ()  # ids of the requirements that are violated here, and not there

    @property
    def value(self) -> float:
        """Return the minimised number."""
        return self.robustness + TIE * self.vote


def chosen(ids: Sequence[str], files: Sequence[str] = (), own: Sequence[dict[str, Any]] = ()) -> list[Requirement]:
    """Return the requirements of these ids, from ``files``, or from the campaign and then the bundled sets.

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
    """Return the value of a draw from its rows of ``runs``: one, or two with that of the other setting second."""
    asked = list(ids)
    told = [json.loads(row.get("requirements") or "[]") for row in rows]
    robustness, votes = [_least(each, set(asked)) for each in told], [_least(each, {VOTE.id}) for each in told]
    here, *there = [_violated(each) for each in told]
    found = bool(here.intersection(asked)) and not any(other.intersection(asked) for other in there)
    violating = tuple(each for each in asked if each in here) if found else ()
    return Measured(robustness[0] - sum(robustness[1:]), votes[0] - sum(votes[1:]), found, violating)


def deciding(rows: Sequence[Sequence[dict[str, Any]]], ids: Sequence[str]) -> tuple[str, ...]:
    """Return the requirements of a search: those of ``ids`` that not every random draw violates.

    A requirement that every draw violates would hide the others.  Return all of ``ids`` if no other is left.

    rows : of each random draw its flights, one in each setting
    """
    violated = [[_violated(json.loads(row.get("requirements") or "[]")) for row in draw] for draw in rows]
    always = {each for each in ids if any(all(each in one for one in of) for of in zip(*violated, strict=True))}
    return tuple(each for each in ids if each not in always) or tuple(ids)


def _violated(told: Sequence[dict[str, Any]]) -> set[str]:
    return {one["requirement"] for one in told if one["status"] == "violated"}


def _least(told: Sequence[dict[str, Any]], ids: set[str]) -> float:
    robustness = [one["robustness"] for one in told if one["requirement"] in ids]
    return min((one for one in robustness if one is not None), default=NONE)
