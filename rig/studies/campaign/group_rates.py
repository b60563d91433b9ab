"""Rates, delays and smallest magnitudes of groups of a campaign's faults and runs; plain data."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any, Final

import numpy as np
import polars as pl

from rig.flight.time_histogram import names as bin_names
from rig.studies.campaign.statistics import detectable, poisson, proportion
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.robustness import number_of
from rig.verdict.words import BY_DESIGN

Tables = dict[str, pl.DataFrame]
OF_RUN: Final = "run "  # before a column of ``runs`` that stands beside a fault: its own have no blank
DELAYS: Final = ("delay_from_onset_s", "delay_from_exceeded_s")
MOST_LEVELS: Final = 12  # of a magnitude that are shown one by one; more are put into BINS bins
BINS: Final = 8
_QUANTILES: Final = {"min": 0.0, "median": 0.5, "p95": 0.95, "max": 1.0}


def flown(tables: Tables) -> pl.DataFrame:
    """Return the runs that were flown to their end."""
    return tables["runs"].filter(pl.col("outcome") == "flown")


def acted(tables: Tables, names: Sequence[str] = ()) -> pl.DataFrame:
    """Return the faults that acted on a channel in use, each with its place and its displayed size.

    names : columns of ``runs`` shown beside them, with the prefix OF_RUN
    """
    runs, where = tables["runs"], pl.format("{} {}", "aircraft", "flight_point")
    place = pl.format("{}, {}", where, "manager") if runs["manager"].drop_nulls().n_unique() > 1 else where
    beside = {f"{OF_RUN}{name}": pl.col(name) for name in names}
    faults = tables["faults"].join(runs.select("run", place=place, **beside), on="run", how="left")
    return sized(faults.filter((pl.col("outcome") != "not executed") & pl.col("channel").is_not_null()))


def sized(faults: pl.DataFrame) -> pl.DataFrame:
    """Add ``size`` to faults: the magnitude, or the middle of its bin if there are too many to show."""
    parts = []
    for _, part in faults.group_by(["signal", "kind"], maintain_order=True):
        magnitudes = part["magnitude"].drop_nulls()
        values = np.unique(magnitudes.to_numpy()) if len(magnitudes) else np.array([])
        size = part["magnitude"] if len(values) <= MOST_LEVELS else _binned(part["magnitude"], values)
        parts.append(part.with_columns(size.alias("size")))
    return pl.concat(parts) if parts else faults.with_columns(pl.lit(None, pl.Float64).alias("size"))


def _binned(magnitude: pl.Series, values: Any) -> pl.Series:
    """Replace each magnitude by the middle of one of BINS bins of about the same number of values."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, BINS + 1))
    middles = np.array([(a + b) / 2.0 for a, b in pairwise(edges)])
    which = np.clip(np.searchsorted(edges, magnitude.to_numpy(), side="right") - 1, 0, BINS - 1)
    return pl.Series("size", np.round(middles, 6)[which]).set(magnitude.is_null(), None)


def _counted(count: int, trials: int) -> dict[str, Any]:
    """Return the share of the trials, with the interval."""
    return asdict(proportion(count, trials))


def share_of(values: pl.Series) -> dict[str, Any]:
    """Return the share of true values, with the interval; null is not true."""
    return _counted(int(values.sum()), len(values))


def alarm_rate(runs: pl.DataFrame) -> dict[str, Any]:
    """Return the false alarms a channel hour of runs, with the interval."""
    return asdict(poisson(int(runs["false_alarms"].sum()), float(runs["channel_hours"].sum())))


def groups(
    rows: pl.DataFrame, by: Sequence[str], names: Sequence[str] = ()
) -> Iterator[tuple[dict[str, Any], pl.DataFrame]]:
    """Yield the keys and the rows of every group, sorted by the keys.

    names : columns of ``runs`` beside the faults that vary by name, which are never pooled: the key ``of`` names the
        level of those that differ in a group
    """
    for key, part in rows.sort(by, nulls_last=True).group_by(by, maintain_order=True):
        found = dict(zip(by, key, strict=True))
        several = [name for name in (f"{OF_RUN}{each}" for each in names) if part[name].n_unique() > 1]
        if not several:
            yield ({**found, "of": ""} if names else found), part
            continue
        for of, rest in part.sort(several, nulls_last=True, maintain_order=True).group_by(several, maintain_order=True):
            levels = zip(several, of, strict=True)
            yield {**found, "of": ", ".join(_level(name.removeprefix(OF_RUN), value) for name, value in levels)}, rest


def _level(name: str, value: Any) -> str:
    """Return a level of a varied key, with the key's name if the level alone is not clear."""
    return value if isinstance(value, str) and not value.startswith("[") else f"{name} {value}"


def rates(faults: pl.DataFrame, by: list[str], names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return detection and isolation of every group of faults, with intervals; ``names`` as of ``groups``.

    detection counts the faults whose error exceeded the threshold, detection_of_all every fault that acted.
    """
    return [{**key, **fault_rates(part)} for key, part in groups(faults, by, names)]


def fault_rates(faults: pl.DataFrame) -> dict[str, Any]:
    """Return the number of faults that acted, and their detection and isolation."""
    exceeded = faults.filter(pl.col("outcome") != "undetectable")
    return {
        "acted": len(faults),
        "detection": share_of(exceeded["outcome"] == "detected"),
        "detection_of_all": share_of(faults["outcome"] == "detected"),
        "correct_isolation": share_of(exceeded["isolation"] == "correct"),
        "wrong_isolation": share_of(exceeded["isolation"] == "wrong"),
    }


def by_rule(tables: Tables) -> list[dict[str, Any]]:
    """Return the isolated channels by rule, and how many of them were faulty."""
    correct = tables["faults"].filter(pl.col("outcome") == "detected")["decided_by"].to_list()
    by_design = pl.col("kind").is_in(BY_DESIGN).fill_null(value=False)
    wrong = tables["alarms"].filter(~by_design)["decided_by"].to_list()
    names = sorted({*correct, *wrong} - {None})
    return [
        {
            "decided_by": name,
            "faulty": correct.count(name),
            "healthy": wrong.count(name),
            "correct": _counted(correct.count(name), correct.count(name) + wrong.count(name)),
        }
        for name in names
    ]


def delays(faults: pl.DataFrame, names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return detection delays by signal, kind and ``names``: from the onset, and from exceeding the threshold."""
    return [
        {**key, "detected": len(part), **{name: quantiles(part[name].drop_nulls()) for name in DELAYS}}
        for key, part in groups(faults.filter(pl.col("outcome") == "detected"), ["signal", "kind"], names)
    ]


def quantiles(values: pl.Series) -> dict[str, float | None]:
    """Return the smallest, the median, the 95 % and the largest delay; None without delays."""
    return {name: values.quantile(share, "nearest") for name, share in _QUANTILES.items()}


def false_alarms(tables: Tables) -> list[dict[str, Any]]:
    """Return the number of isolated healthy channels by signal."""
    alarms = tables["alarms"]
    if alarms.is_empty():
        return []
    return alarms.group_by("kind", "signal").len("count").sort("kind", "signal").to_dicts()


def smallest(faults: pl.DataFrame, names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return the smallest detectable magnitude by signal, kind and ``names``, over all faults that acted."""
    return [
        {**key, **_smallest(part["magnitude"].to_numpy(), (part["outcome"] == "detected").to_numpy())}
        for key, part in groups(faults.filter(pl.col("magnitude").is_not_null()), ["signal", "kind"], names)
    ]


def _smallest(magnitudes: Any, detected: Any) -> dict[str, Any]:
    fit = detectable(magnitudes, detected)
    return {"acted": len(detected), "detected": int(detected.sum()), "fit": None if fit is None else asdict(fit)}


def tie_break(episodes: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the truth table of the tie-break rules, over all patterns and for each.

    asked: episodes in which the rule was used; answered: its decision was valid in the last frame; correct: it isolated
    only faulty channels; wrong: it isolated a healthy one; open: the split ended before an isolation.
    """
    rows = []
    for pattern in ["all", *sorted(episodes["pattern"].unique())]:
        part = episodes if pattern == "all" else episodes.filter(pl.col("pattern") == pattern)
        for name in sorted({name for asked in part["asked"] for name in asked}):
            asked = int(part["asked"].list.contains(name).sum())
            rows.append({"decided_by": name, "pattern": pattern, **_answers(part, name, asked)})
    return rows


def _answers(episodes: pl.DataFrame, name: str, asked: int) -> dict[str, Any]:
    answered = episodes.filter(pl.col("decided_by") == name)
    counts = {verdict: int((answered["verdict"] == verdict).sum()) for verdict in ("correct", "wrong", "open")}
    return {
        "asked": asked,
        "answered": len(answered),
        **counts,
        "answered_share": _counted(len(answered), asked),
        "correct_share": _counted(counts["correct"], counts["correct"] + counts["wrong"]),
    }


def by_kind(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return, for each kind of fault of an actuator, how many were detected, by which monitor, and after how long.

    ``valve`` detects a fault of a shut-off valve and isolates no channel.  Any other fault is detected when its channel
    is shut off.
    """
    acted = faults.filter(pl.col("signal").str.starts_with("actuator.") & pl.col("onset_s").is_not_null())
    figures = []
    for (kind,), part in acted.sort("kind").group_by("kind", maintain_order=True):
        monitors, delays = part["decided_by"].drop_nulls(), part["delay_from_onset_s"].drop_nulls()
        counts = monitors.value_counts().sort("count", descending=True).rows()
        found = asdict(proportion(len(monitors), len(part)))
        by = ", ".join(f"{name} {count}" for name, count in counts)
        delay = {"median_s": delays.median(), "longest_s": delays.max()}
        figures.append({"kind": kind, "acted": len(part), "found": found, "by": by, **delay})
    return figures


def by_requirement(runs: pl.DataFrame, requirements: Sequence[Requirement]) -> list[dict[str, Any]]:
    """Return for each requirement the share of applicable runs that meet it, and the run with the least robustness.

    A run meets a requirement if it meets it on every signal.
    """
    given = [(run, json.loads(text)) for run, text in runs.select("run", "requirements").drop_nulls().rows()]
    figures = []
    for each in requirements:
        mine = {
            run: [v for v in of if v["requirement"] == each.id and v["robustness"] is not None] for run, of in given
        }
        mine = {run: of for run, of in mine.items() if of}
        met = sum(all(verdict["status"] == "met" for verdict in of) for of in mine.values())
        every = [(verdict["robustness"], run, verdict) for run, of in mine.items() for verdict in of]
        robustness, run, least = min(every, key=lambda one: one[:2], default=(None, None, {}))
        figures.append(
            {
                "requirement": each.id,
                "text": each.text,
                "met": asdict(proportion(met, len(mine))),
                "robustness": None if robustness is None else number_of(robustness),
                "least_run": run,
                "signal": least.get("signal"),
                "instant_s": least.get("instant_s"),
            }
        )
    return figures


def replies(runs: pl.DataFrame) -> dict[str, Any] | None:
    """Return the reply times of a unit under test over all frames of all runs, by bins; None without a unit."""
    counted = runs["replies"].drop_nulls()
    if counted.is_empty():
        return None
    counts = np.sum([bins.to_numpy() for bins in counted], axis=0)
    return {"runs": len(counted), "frames": int(counts.sum()), "bins_us": bin_names(), "counts": counts.tolist()}
