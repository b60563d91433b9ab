"""Confirm minimal cut sets with new seeds: fly every order and every proper subset, on every aircraft and flight point.

A row is one sequence in one condition on one aircraft.  It agrees unless Fisher's exact test of its counts against
those of the enumeration is below LEVEL divided by the number of rows (Bonferroni).
Source: docs/explanation/reliability.md, 'Confirming'; Fisher (1922).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from scipy.stats import fisher_exact

from rig.core import sealed
from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.outputs import CONFIRMED, SETS
from rig.core.trust import Trust
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import Result
from rig.studies.campaign.statistics import jeffreys
from rig.studies.campaign.study_folder import FORMAT, locked, write_whole
from rig.studies.safety.cutset_plan import NO_CODE, STUDY, Asked, fly_all, plan
from rig.studies.safety.cutsets import Counted, of_campaign
from rig.studies.safety.sequences import CONDITIONS, Modes

LEVEL: Final = 0.01
_NO_NAME: Final = re.compile(r"\W")
SHOWN: Final = ("modes", "condition", "gap", "lost", "interval", "wrong_vote_first", "announced_first", "aircraft_lost",
                "orders", "subsets")  # fmt: skip # of a set, in sets.json


@dataclass(frozen=True, slots=True)
class Row:
    """One sequence: the counts of the enumeration, and the losses in the new flights."""

    aircraft: str
    point: str  # "" for the aircraft's own
    condition: str
    modes: Modes
    of_set: Modes
    before: tuple[int, int]  # lost, flown
    again: tuple[int, int]
    p_value: float
    agrees: bool

    @property
    def shows(self) -> str:
        """Return the interval of the probability from the new flights alone."""
        low, high = jeffreys(*self.again)
        return f"p < {high:.2g} only" if self.again[0] == 0 else f"p from {low:.2g} to {high:.2g}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        given = {name: getattr(self, name) for name in _KEYS}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in given.items()}


_KEYS: Final = (
    *("aircraft", "point", "condition", "p_value", "agrees", "shows"),
    *("modes", "of_set", "before", "again"),
)
CONFIRMED_ROWS: Final = (  # of ``as_dict``
    Column("", lambda row: "" if row["agrees"] else "disagrees", type=str),
    Column("aircraft", lambda row: f"{row['aircraft']} {row['point']}".strip(), page=None),
    Column("aircraft", lambda row: f"{row['aircraft']} {row['point']}", worth=0, type=str),
    *(Column("condition", worth=7, type=str), Column("modes by onset", lambda row: ", ".join(row["modes"]), type=str)),
    Column("enumerated", lambda row: "{} of {}".format(*row["before"])),
    Column("again", lambda row: "{} of {}".format(*row["again"])),
    Column("shows", worth=8, type=str, page="the new flights show"),
    Column("Fisher", "p_value", ".2g", worth=8, page="p-value"),
)


@dataclass(frozen=True, slots=True)
class Claim:
    """A minimal set of the enumeration, with the counts of all sequences behind it."""

    condition: str
    modes: Modes
    sequences: dict[Modes, tuple[int, int]]


def write_sets(out: Path, found: dict[str, Any]) -> None:
    """Write the minimal sets of an enumeration, which ``confirm`` flies with new seeds."""
    write_whole(out / SETS, sealed.to_json(found))


def read_sets(out: Path) -> dict[str, Any]:
    """Read the minimal sets of a folder.  BadInput: they are missing or damaged."""
    path = out / SETS
    if not is_file(path):
        raise BadInput(f"{out}: {SETS} is missing; finish rig reliability cutsets --out {out} first")
    data = STUDY.read(out, SETS)
    lacking = [key for key, kind in (("flown", dict), ("sets", list)) if not isinstance(data.get(key), kind)]
    lacking += [key for each in data.get("sets", []) for key in SHOWN if not isinstance(each, dict) or key not in each]
    if lacking:
        raise BadInput(f"{path}: is damaged: {lacking[0]} is missing")
    return data


def read_rows(out: Path) -> list[dict[str, Any]]:
    """Read the rows of the confirmation; none if there was no confirmation.  BadInput: the file is damaged."""
    path = out / CONFIRMED
    rows = STUDY.read(out, CONFIRMED).get("rows") if is_file(path) else []
    if not isinstance(rows, list) or not all(isinstance(row, dict) and set(_KEYS) <= set(row) for row in rows):
        raise BadInput(f"{path}: is damaged: the rows are not those of rig reliability confirm")
    return rows


def claims(out: Path) -> list[Claim]:
    """Return the minimal sets of a folder with the counts behind them.  BadInput as of ``read_sets``."""
    path, data = out / SETS, read_sets(out)
    try:
        return [_claim(each) for each in data["sets"]]
    except (KeyError, TypeError, ValueError, IndexError, StopIteration) as error:
        raise BadInput(f"{path}: is damaged: {' '.join(str(error).split())[:80]}") from None


def _claim(data: dict[str, Any]) -> Claim:
    rows = [*data["orders"], *data["subsets"]]
    counts = {tuple(map(str, row["modes"])): (int(row["lost"][0]), int(row["lost"][1])) for row in rows}
    condition = next(
        slug for slug, each in CONDITIONS.items() if [each.name, each.gap] == [data["condition"], data["gap"]]
    )
    return Claim(condition, tuple(map(str, data["modes"])), counts)


def plans(
    asked: Asked,
    found: Sequence[Claim],
    aircraft: Sequence[str],
    points: Sequence[str],
    flights: int,
    seed: int,
    trust: Trust = NO_CODE,
) -> dict[str, Plan]:
    """Return the campaigns by the name of their folder: one a condition, aircraft and flight point."""
    if seed == asked.seed:
        raise BadInput(f"--seed {seed}: the enumeration has this seed; new flights need another")
    made: dict[str, Plan] = {}
    for name in aircraft:
        for point in points or ("",):
            new = replace(
                asked,
                aircraft=name,
                flights=flights,
                seed=seed,
                set={**asked.set, **({"flight_point": point} if point else {})},
            )
            for condition in dict.fromkeys(claim.condition for claim in found):
                of_condition = [claim for claim in found if claim.condition == condition]
                wanted = sorted({each for claim in of_condition for each in claim.sequences}, key=lambda s: (len(s), s))
                made[_folder(name, point, condition)] = plan(new, condition, trust, wanted)
    return made


def _folder(aircraft: str, point: str, condition: str) -> str:
    """Return the name of a campaign's folder; the user's aircraft is named by its path."""
    return "-".join(filter(None, (_NO_NAME.sub("_", aircraft), point, condition)))


def fly(out: Path, made: dict[str, Plan], workers: int) -> list[Result]:
    """Fly the missing flights of the campaigns, in folders below ``out``/confirm."""
    with locked(out, STUDY.busy):
        return fly_all(made, out / "confirm", workers)


def rows(out: Path, signal: str, found: Sequence[Claim], made: dict[str, Plan]) -> list[Row]:
    """Compare the new flights with the claims; rows that disagree come first, then by p-value."""
    compared = [row for name, each in made.items() for row in _rows(out / "confirm" / name, signal, found, each, name)]
    level = LEVEL / max(len(compared), 1)
    tested = [replace(row, agrees=row.p_value >= level) for row in compared]
    return sorted(tested, key=lambda row: (row.agrees, row.p_value, row.condition, row.modes))


def _rows(folder: Path, signal: str, found: Sequence[Claim], made: Plan, name: str) -> list[Row]:
    base, counted = made.campaign, of_campaign(folder, signal)
    aircraft, point = str(base.base["aircraft"]), str(base.set.get("flight_point", ""))
    return [
        _row(aircraft, point, claim, modes, before, counted[modes])
        for claim in found
        if name == _folder(aircraft, point, claim.condition)
        for modes, before in claim.sequences.items()
        if modes in counted
    ]


def _row(aircraft: str, point: str, claim: Claim, modes: Modes, before: tuple[int, int], now: Counted) -> Row:
    again = now.lost, now.flown
    test: Any = fisher_exact([[lost, flown - lost] for lost, flown in (before, again)])
    p_value = float(test.pvalue)
    return Row(aircraft, point, claim.condition, modes, claim.modes, before, again, p_value, True)


def write_rows(out: Path, found: Sequence[Row]) -> None:
    """Write the comparison beside the sets."""
    data = {"format": FORMAT, "rows": [row.as_dict() for row in found]}
    write_whole(out / CONFIRMED, sealed.to_json(data))
