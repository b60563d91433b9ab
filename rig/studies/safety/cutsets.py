"""Count the outcomes of fault sequences, with probabilities and intervals, and find the minimal cut sets.

The first event decides how a flight loses the signal: an undetected error (wrong vote) or an annunciated loss.  A set
is minimal if the lower end of its interval is above the upper ends of the intervals of all its proper subsets.
Source: docs/explanation/reliability.md, 'Cut sets'; Jeffreys' interval as in Brown, Cai and DasGupta (2001).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from itertools import combinations
from operator import add
from pathlib import Path
from typing import Any

import polars as pl

from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.outputs import CAMPAIGN
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.statistics import jeffreys
from rig.studies.reliability.tally import declared_lost
from rig.studies.safety.cutset_plan import Asked, read_asked
from rig.studies.safety.sequences import CONDITIONS, Modes

WRONG, ANNOUNCED = "wrong vote", "announced loss"


@dataclass(frozen=True, slots=True)
class Counted:
    """The flights of a sequence or set, and the event that came first."""

    flown: int
    wrong_vote: int = 0
    announced: int = 0
    aircraft_lost: int = 0

    @property
    def lost(self) -> int:
        """Return the number of flights that lost the signal."""
        return self.wrong_vote + self.announced

    def __add__(self, other: Counted) -> Counted:
        return Counted(*map(add, astuple(self), astuple(other)))

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        low, high = jeffreys(self.lost, self.flown)
        return {
            "lost": [self.lost, self.flown],
            "p": (self.lost + 0.5) / (self.flown + 1.0),
            "interval": [low, high],
            "wrong_vote_first": self.wrong_vote,
            "announced_first": self.announced,
            "aircraft_lost": self.aircraft_lost,
        }


@dataclass(frozen=True, slots=True)
class CutSet:
    """A minimal set of modes in a condition, with all its orders."""

    condition: str
    gap: str
    modes: Modes  # by onset, of the order that loses the most
    whole: Counted
    orders: dict[Modes, Counted]
    subsets: dict[Modes, Counted]  # all orders of its proper subsets

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        orders, parts = (
            [{"modes": list(modes), **counted.as_dict()} for modes, counted in of.items()]
            for of in (self.orders, self.subsets)
        )
        return {
            "modes": list(self.modes),
            "condition": self.condition,
            "gap": self.gap,
            **self.whole.as_dict(),
            "orders": orders,
            "subsets": parts,
        }


Counts = dict[Modes, Counted]


def of_folder(out: Path) -> tuple[Asked, dict[str, Counts]]:
    """Return the options and, by condition, the counts of every flown sequence.

    BadInput: the folder does not exist, a condition was not flown, or a table is damaged.
    """
    asked = read_asked(out)
    return asked, {condition: of_campaign(out / condition, asked.signal) for condition in asked.conditions}


def of_campaign(folder: Path, signal: str) -> Counts:
    """Count the flights of a condition, by sequence."""
    if not is_file(folder / CAMPAIGN):
        raise BadInput(f"{folder}: not flown yet; repeat the same rig reliability command")
    flown = lost_flights(open_folder(folder).tables, signal)
    grouped = flown.group_by("sequence").agg(
        flown=pl.len(),
        wrong_vote=(pl.col("first") == WRONG).sum(),
        announced=(pl.col("first") == ANNOUNCED).sum(),
        aircraft_lost=(~pl.col("survived")).sum(),
    )
    return {tuple(row.pop("sequence").split(", ")): Counted(**row) for row in grouped.sort("sequence").to_dicts()}


def lost_flights(tables: Mapping[str, pl.DataFrame], signal: str) -> pl.DataFrame:
    """Return run, sequence, survived and ``first``: the event that lost the signal first, null if none did."""
    runs = tables["runs"].filter(pl.col("outcome") == "flown").select("run", "sequence", "survived")
    windows = tables["faults"].filter((pl.col("signal") == signal) & pl.col("vote_correct").is_not_null())
    wrong = ~pl.col("vote_correct") | pl.col("wrong_vote_first").fill_null(value=False)
    last = pl.col("onset_s") == pl.col("onset_s").max().over("run")
    # A window that ends with the next onset may end within the time that a monitor has: only the last one is asked.
    word = pl.when(declared_lost()).then(pl.lit(ANNOUNCED)).when(wrong & last).then(pl.lit(WRONG))
    of_windows = (
        windows.with_columns(word=word).filter(pl.col("word").is_not_null()).sort("run", "onset_s")
        .group_by("run", maintain_order=True).agg(first=pl.col("word").first())
    )  # fmt: skip
    of_signal = tables["signals"].filter(pl.col("signal") == signal).select("run", declared=pl.col("lost_s") > 0)
    joined = runs.join(of_windows, on="run", how="left").join(of_signal, on="run", how="left")
    fallback = pl.when(pl.col("declared").fill_null(value=False)).then(pl.lit(ANNOUNCED))
    return joined.with_columns(first=pl.coalesce("first", fallback)).drop("declared").sort("run")


def minimal(asked: Asked, counted: Mapping[str, Counts]) -> list[CutSet]:
    """Return the minimal sets of all conditions, the most frequent loss first."""
    found = [each for condition, counts in counted.items() for each in _minimal(condition, counts)]
    return sorted(found, key=lambda each: (len(each.modes), -each.whole.lost / each.whole.flown, each.modes))


def by_set(counts: Counts) -> dict[Modes, Counts]:
    """Return the orders of each set, by its modes in alphabetical order."""
    sets: dict[Modes, Counts] = {}
    for modes, counted in sorted(counts.items()):
        sets.setdefault(tuple(sorted(modes)), {})[modes] = counted
    return sets


def total(counts: Mapping[Modes, Counted]) -> Counted:
    """Return the sum of counts."""
    return sum(counts.values(), Counted(0))


def _minimal(condition: str, counts: Counts) -> Iterator[CutSet]:
    sets, when = by_set(counts), CONDITIONS[condition]
    ends = {modes: jeffreys(total(orders).lost, total(orders).flown) for modes, orders in sets.items()}
    for modes, orders in sets.items():
        within = sorted(part for part in subsets(modes) if part in ends)
        above = max((ends[part][1] for part in within), default=0.0)
        if ends[modes][0] > above:
            worst = max(orders, key=lambda order: orders[order].lost / orders[order].flown)
            yield CutSet(
                when.name,
                when.gap,
                worst,
                total(orders),
                orders,
                {o: c for part in within for o, c in sets[part].items()},
            )


def subsets(modes: Sequence[str]) -> set[Modes]:
    """Return the proper, non-empty subsets of a set of modes."""
    return {tuple(sorted(part)) for size in range(1, len(modes)) for part in combinations(modes, size)}
