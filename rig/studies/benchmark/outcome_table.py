"""The table of a benchmark: outcomes by manager, kind and number of faults; paired differences with intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, Final

import numpy as np
import polars as pl

from rig.core.column import Column
from rig.studies.benchmark.benchmark_trials import STATES
from rig.studies.benchmark.entrants import DESIGNED
from rig.studies.benchmark.fault_places import in_order
from rig.studies.campaign.statistics import (
    Difference,
    clustered_difference,
    detectable,
    mcnemar,
    paired_difference,
)
from rig.verdict.words import INJECTED, PRIOR

ISOLATED: Final = pl.col("outcome") == "isolated"
LOST: Final = pl.col("lost")
HARMED: Final = pl.col("outcome").is_in(("wrong channel", PRIOR))  # a healthy channel was isolated
ALL: Final = "all"  # kinds together, each trial counting once
GROUP: Final = ("reference", "signal", "place", "kind", "faults")
SIZES: Final = (0.5, 0.95)
BINS: Final = 8
ALIKE: Final = 0.01  # thresholds: vote errors that differ by less count as equal
RECORDING: Final = "recording"  # column of trials on recordings: those of one are alike
_TRIAL: Final = ["combination", "trial", "reference"]


def _percent(title: str, word: str, **more: Any) -> Column:
    """Return the column of an outcome's share of the trials."""
    return Column(title, lambda row: 100 * row[word] / row["trials"], ".1f", "%", **more)


OUTCOMES: Final = (
    *(Column("place"), Column("manager"), _percent("isolated", "isolated")),
    *(Column("vote error", "peak_median", ".2f"), Column("its 95 %", "peak_95", ".2f")),
    *(_percent(word, word) for word in ("wrong channel", "missed")),
    _percent("before", PRIOR, worth=8),
    *(Column("delay", "delay_median_s", ".2f", "s"), Column("95 %", "delay_95_s", ".2f", "s", worth=7)),
    *(
        Column(f"{100 * of:g} %", lambda row, i=i: row["sizes"] and row["sizes"][i]["value"], ".2f", worth=7)
        for i, of in enumerate(SIZES)
    ),
)
RECORDED: Final = (*OUTCOMES[1:3], *OUTCOMES[5:9])  # of recordings, whose true value is not known
LOSSES: Final = (*OUTCOMES, Column("aircraft lost", "lost"))  # of flights in closed loop
DIFFERENCES: Final = (
    *(Column("signal"), Column("manager"), Column("trials")),
    Column("isolated, minus built-in", lambda row: 100 * row["value"], "+.1f", "points"),
    Column("95 %", lambda row: f"{100 * row['low']:.1f} to {100 * row['high']:.1f}"),
)


def table(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Return one row for each group and manager: groups in order, managers as they were given.

    Outcomes are counts.  Delays are of isolated faults, s.  ``peak``: largest vote error of a trial, thresholds, its
    median, 95 % and largest over the trials, None where the vote is no number, as in ``no_number`` of the trials;
    ``lost``: aircraft lost, in flights; ``sizes``: with the reference as flown, see the function ``sizes``.
    """
    key, by_key = (*GROUP, "manager"), dict[tuple[Any, ...], Any]()
    if "lost" not in rows.columns:
        sized = rows.filter(pl.col("size").is_not_null() & (pl.col("reference") == STATES[0]))
        by_key = {of: sizes(part) for of, part in sized.group_by(key, maintain_order=True)}
    return [{**row, "sizes": by_key.get(tuple(row[name] for name in key))} for row in _counts(rows)]


def sizes(rows: pl.DataFrame) -> list[dict[str, Any]] | None:
    """Return the sizes, in thresholds, that are isolated with the probabilities SIZES, with 95 % intervals.

    None if all or none were isolated.  The fit is logistic over the logarithm (campaign/statistics.py).
    """
    isolated = (rows["outcome"] == "isolated").to_numpy()
    fit = detectable(rows["size"].to_numpy(), isolated, SIZES)
    return None if fit is None else [asdict(magnitude) for magnitude in fit.magnitudes]


def by_size(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the shares isolated over the size, in bins of its logarithm, with each bin's mean size, thresholds."""
    sized = rows.filter(pl.col("size").is_not_null() & (pl.col("size") > 0.0))
    found: list[dict[str, Any]] = []
    for _, part in sized.group_by(["kind"], maintain_order=True):
        logarithms = part["size"].log().to_numpy()
        low = float(logarithms.min())
        places = (logarithms - low) / max(float(logarithms.max()) - low, 1e-12) * BINS
        bins = pl.Series("bin", np.clip(places, 0, BINS - 1).astype(np.int64))
        group = ["signal", "place", "kind", "faults", "manager"]
        shares = part.with_columns(bins).group_by([*group, "bin"], maintain_order=True)
        found += (
            shares.agg(pl.col("size").mean(), trials=pl.len(), isolated=ISOLATED.sum())
            .sort("bin", maintain_order=True)
            .drop("bin")
            .to_dicts()
        )
    return found


def curve(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Return delay and share isolated, a row for each signal, place, manager and false-isolation rate."""
    group = ["signal", "place", "faults", "manager", "budget_per_h"]
    found = rows.group_by(group, maintain_order=True).agg(
        trials=pl.len(),
        isolated=ISOLATED.sum(),
        delay_median_s=pl.col("delay_s").median(),
        delay_95_s=pl.col("delay_s").quantile(0.95, "higher"),
    )
    return found.sort("budget_per_h", maintain_order=True).to_dicts()


def _counts(rows: pl.DataFrame) -> list[dict[str, Any]]:
    given = {name: i for i, name in enumerate(rows["manager"].unique(maintain_order=True))}
    places = in_order(rows["place"].unique(maintain_order=True).to_list())
    together = rows.with_columns(pl.lit(ALL).alias("kind"))
    counts = (
        pl.concat([rows, together])
        .group_by([*GROUP, "manager"])
        .agg(
            pl.len().alias("trials"),
            *((pl.col("outcome") == word).sum().alias(word) for word in (*INJECTED, PRIOR)),
            pl.col("delay_s").median().alias("delay_median_s"),
            pl.col("delay_s").quantile(0.95, "higher").alias("delay_95_s"),
            pl.col("peak").median().alias("peak_median"),
            pl.col("peak").quantile(0.95, "higher").alias("peak_95"),
            pl.col("peak").max().alias("peak_largest"),
            pl.col("peak").is_infinite().sum().alias("no_number"),
            *([pl.col("lost").sum()] if "lost" in rows.columns else []),
        )
        .with_columns(
            _finite("peak_median", "peak_95", "peak_largest"),
            pl.col("reference").replace_strict({state: i for i, state in enumerate(STATES)}).alias("_state"),
            pl.col("place").replace_strict(places).alias("_place"),
            pl.col("manager").replace_strict(given).alias("_manager"),
            (pl.col("kind") == ALL).alias("_all"),
        )
        .sort(["_state", "signal", "_place", "faults", "_all", "kind", "_manager"])
    )
    return counts.drop("_state", "_place", "_manager", "_all").to_dicts()


def differences(rows: pl.DataFrame, what: pl.Expr = ISOLATED) -> list[dict[str, Any]]:
    """Return for each group and manager its share isolated minus the built-in manager's, 95 % interval and p-value.

    what : counted in each trial, true or false; in flights also whether the aircraft is lost
    ``built_in`` names the row that is compared with: as designed, with tests, with tests and sums.
    ``harmed`` has the same of trials in which a healthy channel is isolated.
    ``peak_smaller`` and ``peak_larger`` count the trials in which the largest vote error was smaller or larger, by
    ALIKE or more; ``peak_median`` and ``peak_built_in`` are the medians.
    """
    counted = rows.with_columns(what.alias("_what"), HARMED.alias("_harmed"))
    return [row for ours in DESIGNED for row in _differences(counted, ours)]


def _differences(rows: pl.DataFrame, ours: str) -> Iterator[dict[str, Any]]:
    mine = rows.filter(pl.col("manager") == ours).select(
        *_TRIAL,
        pl.col("_what").alias("built_in"),
        pl.col("_harmed").alias("harmed_built_in"),
        pl.col("peak").alias("peak_built_in"),
    )
    others = rows.filter(pl.col("manager") != ours).join(mine, on=_TRIAL, maintain_order="left")
    both = pl.concat([others, others.with_columns(pl.lit(ALL).alias("kind"))])
    for key, part in both.group_by([*GROUP, "manager"], maintain_order=True):
        difference, p_value = _difference(part, "_what", "built_in")
        yield {
            "built_in": ours,
            **dict(zip((*GROUP, "manager"), key, strict=True)),
            "trials": len(part),
            **difference._asdict(),
            "p_value": p_value,
            "harmed": _difference(part, "_harmed", "harmed_built_in")[0]._asdict(),
            **_votes(part),
        }


def _difference(part: pl.DataFrame, first: str, second: str) -> tuple[Difference, float]:
    """Return the difference of two columns, and its p-value; of recordings by recording."""
    one, other = part[first].to_numpy(), part[second].to_numpy()
    if RECORDING in part.columns:
        return clustered_difference(one, other, part[RECORDING].to_numpy())
    return paired_difference(one, other), mcnemar(one, other).p_value


def _votes(part: pl.DataFrame) -> dict[str, Any]:
    off = part["peak"] - part["peak_built_in"]
    return {
        "peak_smaller": int((off <= -ALIKE).sum()),
        "peak_larger": int((off >= ALIKE).sum()),
        **part.select(_finite("peak", "peak_built_in").median()).rename({"peak": "peak_median"}).row(0, named=True),
    }


def _finite(*columns: str) -> pl.Expr:
    """Return the columns with nothing where they are infinite: a vote was no number."""
    return pl.when(pl.col(columns).is_finite()).then(pl.col(columns))
