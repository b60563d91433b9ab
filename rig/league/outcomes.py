"""The table of a league: outcomes by entrant, kind and number of faults; paired differences to ours with intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import polars as pl

from rig.campaign.statistics import mcnemar, paired_difference
from rig.league.entrants import BIASED, OURS
from rig.league.trials import OUTCOMES, STATES

ALL: Final = "all"  # kinds together, each trial counting once
GROUP: Final = ("reference", "signal", "kind", "faults")
_TRIAL: Final = ["combination", "trial", "reference"]


def table(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Return one row for each group and entrant, groups in order, entrants as they were given.

    outcomes are counts; delays of the isolated, s; ``peak``: largest vote error, thresholds, median over the trials
    """
    given = {name: i for i, name in enumerate(rows["entrant"].unique(maintain_order=True))}
    together = rows.with_columns(pl.lit(ALL).alias("kind"))
    counts = (
        pl.concat([rows, together])
        .group_by([*GROUP, "entrant"])
        .agg(
            pl.len().alias("trials"),
            *((pl.col("outcome") == word).sum().alias(word) for word in OUTCOMES),
            pl.col("delay_s").median().alias("delay_median_s"),
            pl.col("delay_s").quantile(0.95, "higher").alias("delay_95_s"),
            pl.col("peak").median().alias("peak_median"),
            pl.col("peak").max().alias("peak_largest"),
        )
        .with_columns(
            pl.col("reference").replace_strict({state: i for i, state in enumerate(STATES)}).alias("_state"),
            pl.col("entrant").replace_strict(given).alias("_place"),
            (pl.col("kind") == ALL).alias("_all"),
        )
        .sort(["_state", "signal", "faults", "_all", "kind", "_place"])
    )
    return counts.drop("_state", "_place", "_all").to_dicts()


def differences(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Return, for each group, its isolated less ours, of every entrant: share, 95 % interval, exact p.

    ours : the row of ours it is compared with, as designed and with learned biases
    ``peak_smaller`` and ``peak_larger`` count the trials in which its largest vote error was smaller or larger.
    """
    return [row for ours in (OURS, BIASED) for row in _differences(rows, ours)]


def _differences(rows: pl.DataFrame, ours: str) -> Iterator[dict[str, Any]]:
    mine = rows.filter(pl.col("entrant") == ours).select(
        *_TRIAL, (pl.col("outcome") == "isolated").alias("ours"), pl.col("peak").alias("peak_ours")
    )
    others = rows.filter(pl.col("entrant") != ours).join(mine, on=_TRIAL, maintain_order="left")
    both = pl.concat([others, others.with_columns(pl.lit(ALL).alias("kind"))])
    for key, part in both.group_by([*GROUP, "entrant"], maintain_order=True):
        first, second = (part["outcome"] == "isolated").to_numpy(), part["ours"].to_numpy()
        yield {
            "ours": ours,
            **dict(zip((*GROUP, "entrant"), key, strict=True)),
            "trials": len(part),
            **paired_difference(first, second)._asdict(),
            "p_value": mcnemar(first, second).p_value,
            "peak_smaller": int((part["peak"] < part["peak_ours"]).sum()),
            "peak_larger": int((part["peak"] > part["peak_ours"]).sum()),
        }
