"""Draw the outcomes of the next fault from counts, for every number of good channels.

The counts of a kind give a Dirichlet distribution; the shares in the rates file weight the kinds.  The prior is
Jeffreys': one half for all outcomes that are not correct, spread over all kinds of a cell together, and one half for
correct.  (One half for each kind would make an empty table worse by the number of kinds.)  Kinds without a share do not
count.
Source: docs/explanation/reliability.md, 'Intervals'; Jeffreys prior as in Brown, Cai and DasGupta (2001).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import polars as pl
from numpy.random import Generator

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.studies.reliability.chain import Floats
from rig.studies.reliability.tally import LATENT

KEPT, KNOWN, KNOWN_LOST, BAD, BAD_LOST = range(5)  # outcomes; ..._LOST: with the aircraft
OUTCOMES: Final = 5
SETTLE_S: Final = 0.1  # where no fault was settled: the mean of hard faults (docs/explanation/reliability.md)
CellKey = tuple[str, int]  # design, good channels before
WHERE_FLOWN: Final = "lost_aircraft_annunciated", "lost_aircraft_undetected"


@dataclass(frozen=True, slots=True)
class Outcomes:
    """The outcomes of the cells of one manager and signal."""

    draws: dict[CellKey, Floats]  # (draws, OUTCOMES), rows add up to one
    trials: dict[CellKey, int]
    seen: dict[CellKey, int]  # of them not correct
    announced: dict[CellKey, float]  # share of the correct ones whose faulty channel was isolated
    unreached: list[CellKey]  # with a kind without a single trial
    flown: bool  # whether any was flown in closed loop
    settle_s: float  # mean time from onset to settled, of single faults by the shares of their kinds


def outcomes(
    counts: pl.DataFrame,
    kinds: Mapping[str, float],
    source: str,
    rng: Generator | None,
    draws: int = 1,
    level: float = 1.0,
) -> Outcomes:
    """Draw the outcomes of every cell in ``counts``, a table of cells of one signal (docs/explanation/reliability.md).

    kinds : share of each kind of fault; BadInput names a cell of single faults that lacks one
    rng   : None for the mean of every distribution instead of draws
    level : the chance that no manoeuvre is flown between two faults of a flight, 1 if the rates file gives none
    """
    flown = counts.select(pl.col(WHERE_FLOWN).is_null().all()).row(0) != (True, True)
    settle = settling(counts, kinds)
    mean_s = sum(share * settle[kind] for kind, share in kinds.items())
    overtaken = {kind: share * settle[kind] / mean_s for kind, share in kinds.items()}
    result = Outcomes({}, {}, {}, {}, [], flown, mean_s)
    lost = _lost_share(counts.filter(pl.col("kind").is_in(list(kinds))), rng, draws)
    for (design, good), cell in sorted(counts.group_by("design", "good_before"), key=lambda item: item[0]):
        place = str(design), int(good)  # pyright: ignore[reportArgumentType]  # columns of text and whole numbers
        shares = _shares(cell, overtaken if design == "near" else kinds, place, source)
        cell = cell.filter(pl.col("kind").is_in(list(shares)))  # kinds without a share count nowhere
        result.draws[place] = _conditions(cell, shares, lost, rng, draws, level ** (CHANNELS - place[1]))
        result.trials[place] = int(cell["trials"].sum())
        result.seen[place] = int((cell["trials"] - cell["correct"]).sum())
        if bool((cell.group_by("kind").agg(pl.col("trials").sum())["trials"] == 0).any()):
            result.unreached.append(place)
        kept = int(cell["correct"].sum())
        announced = int(cell["announced"].sum())
        result.announced[place] = announced / kept if kept else 0.0
    return result


def _shares(cell: pl.DataFrame, kinds: Mapping[str, float], place: CellKey, source: str) -> dict[str, float]:
    """Return the shares of the kinds of a cell; pairs of faults were flown only for some kinds."""
    flown = set(cell["kind"])  # or planned: a fault that never began is an undetected error
    absent = sorted(set(kinds) - flown)
    if place[0] == "single" and absent:
        raise BadInput(f"{source}: no trial of {absent[0]}, a kind of the rates file, with {place[1]} good channels")
    shares = {kind: share for kind, share in sorted(kinds.items()) if kind in flown}
    if not shares:
        raise BadInput(
            f"{source}: {place[0]} faults with {place[1]} good channels: no kind of the rates file was flown"
        )
    total = sum(shares.values())
    return {kind: share / total for kind, share in shares.items()}


def settling(counts: pl.DataFrame, kinds: Mapping[str, float]) -> dict[str, float]:
    """Return the mean time (s) from onset to settlement of single faults of each kind, over all cells by their trials.

    A kind without a settled fault has the mean of the others.
    """
    settled = counts.filter(pl.col("settle_s_mean").is_not_null() & (pl.col("design") == "single"))
    means = {
        kind: float(np.average(of_kind["settle_s_mean"].to_numpy(), weights=of_kind["trials"].to_numpy()))
        for kind in kinds
        if len(of_kind := settled.filter(pl.col("kind") == kind))
    }
    shares = {kind: kinds[kind] for kind in means}
    others = sum(shares[kind] * means[kind] for kind in means) / sum(shares.values()) if means else SETTLE_S
    return {kind: means.get(kind, others) for kind in kinds}


def _conditions(
    cell: pl.DataFrame,
    shares: Mapping[str, float],
    lost: tuple[Floats, Floats],
    rng: Generator | None,
    draws: int,
    level: float,
) -> Floats:
    """Draw (draws, OUTCOMES) of one cell, with all faults in level flight weighted by the chance of that.

    First faults, and kinds that were not flown in both conditions, are taken together as flown.
    """
    latent = pl.col("condition") == LATENT
    parts = cell.filter(latent), cell.filter(~latent)
    first = int(cell["good_before"][0]) == CHANNELS
    both = set() if first else set(shares) & set(parts[0]["kind"]) & set(parts[1]["kind"])
    prior = 0.25 / len(shares)
    together = _cell(cell, {kind: shares[kind] for kind in shares if kind not in both}, prior, lost, rng, draws)
    in_level, otherwise = (
        _cell(part, {kind: shares[kind] for kind in shares if kind in both}, prior, lost, rng, draws) for part in parts
    )
    return together + level * in_level + (1.0 - level) * otherwise


def _cell(
    cell: pl.DataFrame,
    shares: Mapping[str, float],
    prior: float,
    lost: tuple[Floats, Floats],
    rng: Generator | None,
    draws: int,
) -> Floats:
    """Draw (draws, OUTCOMES) of the kinds in ``shares`` of one cell over all conditions; rows sum to shares."""
    outcomes = np.zeros((draws, OUTCOMES))
    for kind, share in shares.items():
        of_kind = cell.filter(pl.col("kind") == kind)
        kept, known, bad = (float(of_kind[name].sum()) for name in ("correct", "annunciated_loss", "undetected_error"))
        if kept + known + bad == 0.0:
            chance = np.tile((0.0, 0.0, 1.0), (draws, 1))  # earlier faults had cost the signal or the aircraft
        else:
            chance = _dirichlet((kept + 0.5, known + prior, bad + prior), rng, draws)
        outcomes[:, KEPT] += share * chance[:, 0]
        for outcome, column, with_aircraft in ((KNOWN, 1, lost[0]), (BAD, 2, lost[1])):
            outcomes[:, outcome] += share * chance[:, column] * (1.0 - with_aircraft)
            outcomes[:, outcome + 1] += share * chance[:, column] * with_aircraft
    return outcomes


def _dirichlet(counts: tuple[float, ...], rng: Generator | None, draws: int) -> Floats:
    """Draw (draws, outcomes) shares, or return their mean ``draws`` times."""
    if rng is not None:
        return rng.dirichlet(counts, draws)
    return np.tile(np.array(counts) / sum(counts), (draws, 1))


def _lost_share(counts: pl.DataFrame, rng: Generator | None, draws: int) -> tuple[Floats, Floats]:
    """Draw the share (draws,) of annunciated losses, and of undetected errors, that lost the aircraft."""
    shares = []
    for column, outcome in zip(WHERE_FLOWN, ("annunciated_loss", "undetected_error"), strict=True):
        flown = counts.filter(pl.col(column).is_not_null())
        lost, of = float(flown[column].sum()), float(flown[outcome].sum())
        counted = lost + 0.5, of - lost + 0.5
        shares.append(rng.beta(*counted, draws) if rng is not None else _dirichlet(counted, None, draws)[:, 0])
    return shares[0], shares[1]
