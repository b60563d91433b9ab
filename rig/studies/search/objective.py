"""The minimised value of a search: robustness of its requirements; for states and ties the vote, and a slope.

A requirement that is a yes or no has the same robustness almost everywhere.  Its slope is the robustness of the same
formula with persistence counts, numbers of channels and the distance to the airframe's limits in place of yes and no.
The verdict stays that of the requirement.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.text import choices, quoted
from rig.verdict.requirements.requirement import Requirement, find_requirements, load_requirements, names

TIE: Final = 1e-6  # of what settles ties, which is at most about 1000: less than any robustness that matters
NONE: Final = 1000.0  # robustness if no requirement applies, or nothing was flown
VOTE: Final = Requirement(
    id="vote-of-search",
    text="Ties: the vote stays within the threshold of the truth, or the signal is lost",
    at="each onset",
    formula="always[0, 60] (abs(error.{signal}) <= threshold.{signal} or state(level.{signal} < 1))",
)
_SLOPE: Final = "-slope-of-search"  # after the id of a requirement
STEEPEST: Final = 5.0  # of a slope: of a count, a number of channels, or the way to a limit
_FAILED: Final = re.compile(r"(?<![\w.])failed\.(\w+|{signal})\.(\d+|{channel})")
_LOST: Final = re.compile(r"(?<![\w.])lost(?![\w.])")
_LEVEL: Final = re.compile(r"(?<![\w.])level\.(\w+|{signal})")
_STATE: Final = re.compile(r"(?<![\w.])state\s*(?=\()")
_IN_USE: Final = " - ".join([str(CHANNELS), *(rf"count.\1.{c}" for c in range(1, CHANNELS + 1))])
_COMPARES: Final = re.compile(r"[<>]|[!=]=")


class Measured(NamedTuple):
    """The value of one draw."""

    robustness: float  # least of the requirements; against another setting the difference of two
    tie: float  # least robustness of the vote of the signals with faults, plus the least slope of the requirements
    violated: bool  # against another setting: here, and not there
    violating: tuple[str, ...] = ()  # ids of the requirements that are violated here, and not there

    @property
    def value(self) -> float:
        """Return the minimised number."""
        return self.robustness + TIE * self.tie


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


def beside(requirements: Sequence[Requirement]) -> list[Requirement]:
    """Return what is measured beside the requirements of a search: the vote, and the slopes."""
    return [VOTE, *(slope for each in requirements if (slope := slope_of(each)) is not None)]


def slope_of(requirement: Requirement) -> Requirement | None:
    """Return a requirement with numbers in place of yes and no; None of one that has them, or has no yes or no."""
    text, about = requirement.formula, requirement.model_dump(include={"at", "signals"})
    if "count." in text or "departure" in text:
        return None
    sloping = _FAILED.sub(r"(count.\1.\2 >= 1)", text)
    sloping = _LOST.sub("(departure < 0)", sloping)
    if not _COMPARES.search(_without_states(text)):
        sloping = _STATE.sub("", sloping)
        if requirement.at == "each loss":  # the way there
            sloping, about["at"] = "always[0, 60] level.{signal} >= 1", "each onset"
        sloping = _LEVEL.sub(rf"min(level.\1, {_IN_USE})", sloping)
    if sloping == text:
        return None
    try:
        return Requirement(id=requirement.id[: 80 - len(_SLOPE)] + _SLOPE, formula=sloping, **about)
    except ValueError:  # too long with what it has instead
        return None


def _without_states(text: str) -> str:
    """Return a formula without its states and what is in them."""
    while (found := _STATE.search(text)) is not None:
        end, depth = found.end(), 0
        while end < len(text):
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
            if depth == 0:
                break
        text = text[: found.start()] + text[end:]
    return text


def measured(rows: Sequence[dict[str, Any]], ids: Iterable[str]) -> Measured:
    """Return the value of a draw from its rows of ``runs``: one, or two with that of the other setting second."""
    asked = list(ids)
    told = [json.loads(row.get("requirements") or "[]") for row in rows]
    robustness, ties = [_least(each, set(asked)) for each in told], [_tie(each, asked) for each in told]
    here, *there = [_violated(each) for each in told]
    found = bool(here.intersection(asked)) and not any(other.intersection(asked) for other in there)
    violating = tuple(each for each in asked if each in here) if found else ()
    return Measured(robustness[0] - sum(robustness[1:]), ties[0] - sum(ties[1:]), found, violating)


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


def _tie(told: Sequence[dict[str, Any]], ids: Sequence[str]) -> float:
    slopes = {each[: 80 - len(_SLOPE)] + _SLOPE for each in ids}
    slope = min(max(_least(told, slopes), -STEEPEST), STEEPEST)
    return _least(told, {VOTE.id}) + slope


def _least(told: Sequence[dict[str, Any]], ids: set[str]) -> float:
    robustness = [one["robustness"] for one in told if one["requirement"] in ids]
    return min((one for one in robustness if one is not None), default=NONE)
