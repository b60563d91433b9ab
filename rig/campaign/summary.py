"""Figures from the tables of one campaign, every one of its report, and from two on the same seeds; plain data."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any, Final

import numpy as np
import polars as pl

from rig.assess.words import BY_DESIGN
from rig.campaign import servos
from rig.campaign.folder import Folder, difference
from rig.campaign.plan import Plan
from rig.campaign.requirements import by_requirement
from rig.campaign.statistics import detectable, mcnemar, poisson, proportion
from rig.campaign.table import COUNTED, SUSPECTS, replies
from rig.errors import BadInput
from rig.util.files import is_file

Tables = dict[str, pl.DataFrame]
MOST_LEVELS: Final = 12  # of a magnitude that are shown one by one; more are put into BINS bins
BINS: Final = 8
WORST: Final = 10
_LONG: Final = ("coverage", "digest", "requirements")  # columns of no table for people
_QUANTILES: Final = {"min": 0.0, "median": 0.5, "p95": 0.95, "max": 1.0}
_SEEN: Final = ("patterns", "levels", "pattern_transitions", "level_transitions")
# What is compared of two campaigns, by run and by fault.
_BY_RUN: Final = {
    "survived": pl.col("survived"),
    "no false alarm": pl.col("false_alarms") == 0,
    "no wrong isolation": pl.col("wrong_isolations") == 0,
    "no fault missed": pl.col("missed") == 0,
}
_BY_FAULT: Final = {
    "fault detected": pl.col("outcome") == "detected",
    "fault rightly isolated": pl.col("isolation") == "right",
}


def summary(folder: Folder) -> dict[str, Any]:
    """Return all figures of a campaign's folder."""
    tables, plan = folder.tables, folder.plan
    faults = acted(tables)
    with_size = faults.filter(pl.col("size").is_not_null())
    return {
        "title": plan.campaign.title or str(folder.path),
        "folder": str(folder.path),
        "runs": len(plan),
        "managers": sorted(tables["runs"]["manager"].drop_nulls().unique().to_list()),
        "set": [f"{key}={value}" for key, value in plan.campaign.set.items()],
        "varied": varied(plan),
        "headline": headline(tables),
        "by_kind": rates(faults, ["signal", "kind"]),
        "by_magnitude": rates(with_size, ["signal", "kind", "size"]),
        "by_pattern": rates(faults, ["pattern"]),
        "by_resolver": by_resolver(tables),
        "by_varied": by_varied(tables, plan),
        "by_place": rates(with_size, ["signal", "kind", "place", "size"]),
        "false_alarms_by_signal": false_alarms(tables),
        "delays": delays(faults),
        "detectable": smallest(faults),
        "resolvers": resolvers(tables["episodes"]),
        "coverage": coverage(tables["runs"]),
        "requirements": by_requirement(tables["runs"], plan.requirements),
        "servos": servos.by_kind(tables["faults"]),
        "replies": replies(tables["runs"]),
        "worst": worst(folder),
    }


def flown(tables: Tables) -> pl.DataFrame:
    """Return the runs that were flown to an end of their own."""
    return tables["runs"].filter(pl.col("outcome") == "flown")


def acted(tables: Tables) -> pl.DataFrame:
    """Return the faults that acted on a channel in use, each with its place and the size it is shown under."""
    place = pl.format("{} {}", "aircraft", "flight_point").alias("place")
    faults = tables["faults"].join(tables["runs"].select("run", place), on="run", how="left")
    return sized(faults.filter((pl.col("outcome") != "not executed") & pl.col("channel").is_not_null()))


def sized(faults: pl.DataFrame) -> pl.DataFrame:
    """Add ``size`` to faults: the magnitude, or the middle of its bin where there are too many to show."""
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


def headline(tables: Tables) -> dict[str, Any]:
    """Return the campaign in a few figures."""
    runs, faults = flown(tables), acted(tables)
    exceeded = faults.filter(pl.col("outcome") != "undetectable")
    return {
        "done": len(tables["runs"]),
        "outcomes": dict(tables["runs"]["outcome"].value_counts().sort("outcome").iter_rows()),
        "flight_h": float(runs["duration_s"].sum()) / 3600.0,
        "survival": _share(runs["survived"]),
        "faults": len(tables["faults"]),
        "not_executed": int((tables["faults"]["outcome"] == "not executed").sum()),
        "undetectable": len(faults) - len(exceeded),
        "detection": _share(exceeded["outcome"] == "detected"),
        "right_isolation": _share(exceeded["isolation"] == "right"),
        "wrong_isolation": _share(exceeded["isolation"] == "wrong"),
        "false_alarms": _alarm_rate(runs),
        "false_alarm_runs": int((runs["false_alarms"] > 0).sum()),
        **{column: int(runs[column].sum()) for column in (*COUNTED, SUSPECTS)},
        "suspect_runs": int((runs[SUSPECTS] > 0).sum()),
    }


def _counted(count: int, trials: int) -> dict[str, Any]:
    """Return so many of the trials, with the interval."""
    return asdict(proportion(count, trials))


def _share(values: pl.Series) -> dict[str, Any]:
    """Return how many of the values are true, with the interval; what is null is not."""
    return _counted(int(values.sum()), len(values))


def _alarm_rate(runs: pl.DataFrame) -> dict[str, Any]:
    return asdict(poisson(int(runs["false_alarms"].sum()), float(runs["channel_hours"].sum())))


def _groups(rows: pl.DataFrame, by: Sequence[str]) -> Iterator[tuple[dict[str, Any], pl.DataFrame]]:
    """Yield the keys and the rows of every group, sorted by the keys."""
    for key, part in rows.sort(by, nulls_last=True).group_by(by, maintain_order=True):
        yield dict(zip(by, key, strict=True)), part


def rates(faults: pl.DataFrame, by: list[str]) -> list[dict[str, Any]]:
    """Return detection and isolation of every group of faults, with intervals.

    detection is of the faults whose error left the threshold, detection_of_all of every one that acted.
    """
    return [{**key, **_rates(part)} for key, part in _groups(faults, by)]


def _rates(faults: pl.DataFrame) -> dict[str, Any]:
    exceeded = faults.filter(pl.col("outcome") != "undetectable")
    return {
        "acted": len(faults),
        "detection": _share(exceeded["outcome"] == "detected"),
        "detection_of_all": _share(faults["outcome"] == "detected"),
        "right_isolation": _share(exceeded["isolation"] == "right"),
        "wrong_isolation": _share(exceeded["isolation"] == "wrong"),
    }


def by_resolver(tables: Tables) -> list[dict[str, Any]]:
    """Count channels that were failed, by resolver: how many were the faulty ones; none that a rule failed."""
    right = tables["faults"].filter(pl.col("outcome") == "detected")["resolver"].to_list()
    by_design = pl.col("kind").is_in(BY_DESIGN).fill_null(value=False)
    wrong = tables["alarms"].filter(~by_design)["resolver"].to_list()
    names = sorted({*right, *wrong} - {None})
    return [
        {
            "resolver": name,
            "faulty": right.count(name),
            "healthy": wrong.count(name),
            "right": _counted(right.count(name), right.count(name) + wrong.count(name)),
        }
        for name in names
    ]


def varied(plan: Plan) -> list[str]:
    """Return the keys that vary between the runs."""
    return list(dict.fromkeys(key for choice in plan.choices for key in choice))


def by_varied(tables: Tables, plan: Plan) -> list[dict[str, Any]]:
    """Return survival and false alarms at every level of what varies by name or by few numbers."""
    runs = flown(tables)
    rows = []
    for column in varied(plan):
        levels = runs[column].drop_nulls().unique().sort() if column in runs.columns else []
        if not 2 <= len(levels) <= MOST_LEVELS:
            continue
        for level in levels:
            part = runs.filter(pl.col(column) == level)
            rates = {"survival": _share(part["survived"]), "false_alarms": _alarm_rate(part)}
            rows.append({"key": column, "level": level, "runs": len(part), **rates})
    return rows


def false_alarms(tables: Tables) -> list[dict[str, Any]]:
    """Count healthy channels that were failed, by signal."""
    alarms = tables["alarms"]
    if alarms.is_empty():
        return []
    return alarms.group_by("kind", "signal").len("count").sort("kind", "signal").to_dicts()


def delays(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return delays of detection by signal and kind: from the onset, and from where the error left the threshold."""
    detected = faults.filter(pl.col("outcome") == "detected")
    names = ("delay_from_onset_s", "delay_from_exceeded_s")
    return [
        {**key, "detected": len(part), **{name: _quantiles(part[name].drop_nulls()) for name in names}}
        for key, part in _groups(detected, ["signal", "kind"])
    ]


def _quantiles(values: pl.Series) -> dict[str, float | None]:
    return {name: values.quantile(share, "nearest") for name, share in _QUANTILES.items()}


def smallest(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the smallest detectable magnitude by signal and kind, of all faults that acted."""
    return [
        {**key, **_smallest(part["magnitude"].to_numpy(), (part["outcome"] == "detected").to_numpy())}
        for key, part in _groups(faults.filter(pl.col("magnitude").is_not_null()), ["signal", "kind"])
    ]


def _smallest(magnitudes: Any, detected: Any) -> dict[str, Any]:
    fit = detectable(magnitudes, detected)
    return {"acted": len(detected), "detected": int(detected.sum()), "fit": None if fit is None else asdict(fit)}


def resolvers(episodes: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the truth table of the resolvers, over all patterns and for each.

    asked: episodes in which it was asked; answered: in whose last frame its answer stood; right: it failed only
    faulty channels; wrong: it failed a healthy one; open: nobody was failed before the pattern went away.
    """
    rows = []
    for pattern in ["all", *sorted(episodes["pattern"].unique())]:
        part = episodes if pattern == "all" else episodes.filter(pl.col("pattern") == pattern)
        for name in sorted({name for asked in part["asked"] for name in asked}):
            asked = int(part["asked"].list.contains(name).sum())
            rows.append({"resolver": name, "pattern": pattern, **_answers(part, name, asked)})
    return rows


def _answers(episodes: pl.DataFrame, name: str, asked: int) -> dict[str, Any]:
    answered = episodes.filter(pl.col("resolver") == name)
    counts = {verdict: int((answered["verdict"] == verdict).sum()) for verdict in ("right", "wrong", "open")}
    return {
        "asked": asked,
        "answered": len(answered),
        **counts,
        "answered_share": _counted(len(answered), asked),
        "right_share": _counted(counts["right"], counts["right"] + counts["wrong"]),
    }


def coverage(runs: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the voter states that the campaign's flights met together, by signal, of how many a voter has."""
    seen: dict[str, dict[str, set[Any]]] = {}
    possible: dict[str, dict[str, int]] = {}  # of the flights whose voter has most
    for text in runs["coverage"].drop_nulls().unique():
        for signal, covered in json.loads(text).items():
            sets = seen.setdefault(signal, {name: set() for name in _SEEN})
            most = possible.setdefault(signal, dict.fromkeys(_SEEN, 0))
            for name in _SEEN:
                sets[name] |= set(covered[name])
                most[name] = max(most[name], covered[f"{name}_possible"])
    return [
        {
            "signal": signal,
            **{name: sorted(map(str, seen[signal][name])) for name in _SEEN},
            "possible": possible[signal],
        }
        for signal in sorted(seen, key=lambda name: (name != "overall", name))
    ]


def worst(folder: Folder) -> list[dict[str, Any]]:
    """Return the flights to look at first: not flown, lost, wrong, alarmed, missed, then by the time of a bad vote."""
    runs = folder.tables["runs"]
    order = [
        pl.col("outcome") != "flown",
        ~pl.col("survived").fill_null(value=True),
        *(pl.col(name).fill_null(0) for name in ("wrong_isolations", "false_alarms", "missed")),
        pl.col("vote_above_threshold_s").fill_null(0.0),
    ]
    ranked = runs.sort([*order, pl.col("run")], descending=[True] * len(order) + [False])
    return [
        _worst_flight(folder, row) for row in ranked.drop("coverage", "digest", "requirements").head(WORST).to_dicts()
    ]


def _worst_flight(folder: Folder, row: dict[str, Any]) -> dict[str, Any]:
    log = folder.logs / f"run_{row['run']:06d}.mcap"
    fly = f"rig campaign fly {folder.path} --run {row['run']}"
    return {**row, "fly": fly, "log": str(log) if is_file(log) else None}


def compare(first: Folder, second: Folder) -> dict[str, Any]:
    """Pair the outcomes of the runs that both have flown. BadInput when their seeds are not the same."""
    (runs, faults), (other_runs, other_faults) = _compared(first), _compared(second)
    runs = runs.join(other_runs, on=["run"], suffix="_second")
    if runs.is_empty():
        raise BadInput(f"{first.path} and {second.path} have no flown run in common")
    if (runs["seed"] != runs["seed_second"]).any():
        raise BadInput(f"{first.path} and {second.path} were not flown on the same seeds; nothing can be paired")
    faults = faults.join(other_faults, on=["run", "fault", "channel"], suffix="_second")
    faults = faults.filter((pl.col("outcome") != "not executed") & (pl.col("outcome_second") != "not executed"))
    return {
        "first": str(first.path),
        "second": str(second.path),
        "differs": difference(first.plan.identity(), second.plan.identity()),
        "runs": len(runs),
        "faults": len(faults),
        "outcomes": [
            *(_paired(runs, name, "run") for name in _BY_RUN),
            *(_paired(faults, name, "fault") for name in _BY_FAULT),
        ],
    }


def _compared(folder: Folder) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Return the runs that were flown and the faults on channels, with the outcomes that are compared."""
    runs = flown(folder.tables)
    faults = folder.tables["faults"].filter(pl.col("channel").is_not_null())
    return runs.with_columns(**_BY_RUN), faults.with_columns(**_BY_FAULT)


def _paired(pairs: pl.DataFrame, name: str, unit: str) -> dict[str, Any]:
    a, b = pairs[name].to_numpy().astype(bool), pairs[f"{name}_second"].to_numpy().astype(bool)
    return {
        "outcome": name,
        "unit": unit,
        "first": _counted(int(a.sum()), len(a)),
        "second": _counted(int(b.sum()), len(b)),
        "pairs": asdict(mcnemar(a, b)),
    }
