"""What the tables of a campaign say: every figure of the report, as plain data."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any, Final

import numpy as np
import polars as pl

from rig.assess.words import BY_DESIGN
from rig.campaign.folder import Folder
from rig.campaign.plan import Plan
from rig.campaign.statistics import detectable, poisson, proportion
from rig.campaign.table import COUNTED
from rig.record.histogram import names

Tables = dict[str, pl.DataFrame]
MOST_LEVELS: Final = 12  # of a magnitude that are shown one by one; more are put into BINS bins
BINS: Final = 8
WORST: Final = 10
_QUANTILES: Final = {"min": 0.0, "median": 0.5, "p95": 0.95, "max": 1.0}


def summary(folder: Folder) -> dict[str, Any]:
    """All figures of a campaign's folder."""
    tables, plan = folder.tables, folder.plan
    faults = acted(tables)
    return {
        "title": plan.campaign.title or str(folder.path),
        "folder": str(folder.path),
        "runs": len(plan),
        "managers": sorted(tables["runs"]["manager"].drop_nulls().unique().to_list()),
        "set": [f"{key}={value}" for key, value in plan.campaign.set.items()],
        "varied": varied(plan),
        "headline": headline(tables),
        "by_kind": rates(faults, ["signal", "kind"]),
        "by_magnitude": rates(faults.filter(pl.col("size").is_not_null()), ["signal", "kind", "size"]),
        "by_pattern": rates(faults, ["pattern"]),
        "by_resolver": by_resolver(tables),
        "by_varied": by_varied(tables, plan),
        "by_place": rates(faults.filter(pl.col("size").is_not_null()), ["signal", "kind", "place", "size"]),
        "false_alarms_by_signal": false_alarms(tables),
        "delays": delays(faults),
        "detectable": smallest(faults),
        "resolvers": resolvers(tables["episodes"]),
        "coverage": coverage(tables["runs"]),
        "replies": replies(tables["runs"]),
        "worst": worst(folder),
    }


def replies(runs: pl.DataFrame) -> dict[str, Any] | None:
    """The reply times of a unit under test, all frames of all runs in the bins of histogram.py; None without one."""
    counted = runs["replies"].drop_nulls()
    if counted.is_empty():
        return None
    counts = np.sum([one.to_numpy() for one in counted], axis=0)
    return {"runs": len(counted), "frames": int(counts.sum()), "bins_us": names(), "counts": counts.tolist()}


def flown(tables: Tables) -> pl.DataFrame:
    """The runs that were flown to an end of their own."""
    return tables["runs"].filter(pl.col("outcome") == "flown")


def acted(tables: Tables) -> pl.DataFrame:
    """The faults that acted on a channel in use, each with the place it was flown at and the size it is shown under."""
    place = pl.format("{} {}", "aircraft", "flight_point").alias("place")
    faults = tables["faults"].join(tables["runs"].select("run", place), on="run", how="left")
    return sized(faults.filter((pl.col("outcome") != "not executed") & pl.col("channel").is_not_null()))


def sized(faults: pl.DataFrame) -> pl.DataFrame:
    """``faults`` with ``size``: the magnitude, or the middle of its bin where there are too many to show."""
    parts = []
    for _, part in faults.group_by(["signal", "kind"], maintain_order=True):
        known = part["magnitude"].drop_nulls()
        values = np.unique(known.to_numpy()) if len(known) else np.array([])
        size = part["magnitude"] if len(values) <= MOST_LEVELS else _binned(part["magnitude"], values)
        parts.append(part.with_columns(size.alias("size")))
    return pl.concat(parts) if parts else faults.with_columns(pl.lit(None, pl.Float64).alias("size"))


def _binned(magnitude: pl.Series, values: Any) -> pl.Series:
    """Each magnitude as the middle of one of BINS bins of about the same number of values."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, BINS + 1))
    middles = np.array([(a + b) / 2.0 for a, b in pairwise(edges)])
    which = np.clip(np.searchsorted(edges, magnitude.to_numpy(), side="right") - 1, 0, BINS - 1)
    return pl.Series("size", np.round(middles, 6)[which]).set(magnitude.is_null(), None)


def headline(tables: Tables) -> dict[str, Any]:
    """The campaign in a few figures."""
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
        **{column: int(runs[column].sum()) for column in COUNTED},
    }


def _share(of: pl.Series) -> dict[str, Any]:
    """How many of the values are true, with the interval; what is null is not."""
    return asdict(proportion(int(of.sum()), len(of)))


def _alarm_rate(runs: pl.DataFrame) -> dict[str, Any]:
    return asdict(poisson(int(runs["false_alarms"].sum()), float(runs["channel_hours"].sum())))


def _groups(rows: pl.DataFrame, by: Sequence[str]) -> Iterator[tuple[dict[str, Any], pl.DataFrame]]:
    """The keys and the rows of every group, sorted by the keys."""
    for key, part in rows.sort(by, nulls_last=True).group_by(by, maintain_order=True):
        yield dict(zip(by, key, strict=True)), part


def rates(faults: pl.DataFrame, by: list[str]) -> list[dict[str, Any]]:
    """Detection and isolation of every group of faults, with intervals.

    detection is of the faults whose error left the threshold, detection_of_all of every one that acted.
    """
    found = []
    for key, part in _groups(faults, by):
        exceeded = part.filter(pl.col("outcome") != "undetectable")
        found.append(
            {
                **key,
                "acted": len(part),
                "detection": _share(exceeded["outcome"] == "detected"),
                "detection_of_all": _share(part["outcome"] == "detected"),
                "right_isolation": _share(exceeded["isolation"] == "right"),
                "wrong_isolation": _share(exceeded["isolation"] == "wrong"),
            }
        )
    return found


def by_resolver(tables: Tables) -> list[dict[str, Any]]:
    """Channels that were failed, by who decided: how many of them were the faulty ones; none that a rule failed."""
    right = tables["faults"].filter(pl.col("outcome") == "detected")["resolver"].to_list()
    by_design = pl.col("kind").is_in(BY_DESIGN).fill_null(value=False)
    wrong = tables["alarms"].filter(~by_design)["resolver"].to_list()
    names = sorted({*right, *wrong} - {None})
    return [
        {
            "resolver": name,
            "faulty": right.count(name),
            "healthy": wrong.count(name),
            "right": asdict(proportion(right.count(name), right.count(name) + wrong.count(name))),
        }
        for name in names
    ]


def varied(plan: Plan) -> list[str]:
    """The keys that vary between the runs."""
    return list(dict.fromkeys(key for choice in plan.choices for key in choice))


def by_varied(tables: Tables, plan: Plan) -> list[dict[str, Any]]:
    """Survival and false alarms at every level of what varies by name or by few numbers."""
    runs, found = flown(tables), []
    for column in varied(plan):
        levels = runs[column].drop_nulls().unique().sort() if column in runs.columns else []
        if not 2 <= len(levels) <= MOST_LEVELS:
            continue
        for level in levels:
            part = runs.filter(pl.col(column) == level)
            row = {"key": column, "level": level, "runs": len(part)}
            found.append({**row, "survival": _share(part["survived"]), "false_alarms": _alarm_rate(part)})
    return found


def false_alarms(tables: Tables) -> list[dict[str, Any]]:
    """Healthy channels that were failed, by signal."""
    alarms = tables["alarms"]
    if alarms.is_empty():
        return []
    return alarms.group_by("kind", "signal").len("count").sort("kind", "signal").to_dicts()


def delays(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Delays of detection by signal and kind: from the onset, and from where the error left the threshold."""
    detected, found = faults.filter(pl.col("outcome") == "detected"), []
    for key, part in _groups(detected, ["signal", "kind"]):
        row = {**key, "detected": len(part)}
        for name in ("delay_from_onset_s", "delay_from_exceeded_s"):
            values = part[name].drop_nulls()
            row[name] = {q: values.quantile(share, "nearest") for q, share in _QUANTILES.items()}
        found.append(row)
    return found


def smallest(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """The smallest detectable magnitude by signal and kind, of all faults that acted."""
    found = []
    for key, part in _groups(faults.filter(pl.col("magnitude").is_not_null()), ["signal", "kind"]):
        detected = (part["outcome"] == "detected").to_numpy()
        fit = detectable(part["magnitude"].to_numpy(), detected)
        row = {**key, "acted": len(part), "detected": int(detected.sum())}
        found.append({**row, "fit": None if fit is None else asdict(fit)})
    return found


def resolvers(episodes: pl.DataFrame) -> list[dict[str, Any]]:
    """The truth table of the resolvers, over all patterns and for each.

    asked: episodes in which it was asked; answered: in whose last frame its answer stood; right: it failed only
    faulty channels; wrong: it failed a healthy one; open: nobody was failed before the pattern went away.
    """
    found = []
    patterns = ["all", *sorted(episodes["pattern"].unique())]
    names = sorted({name for asked in episodes["asked"] for name in asked})
    for pattern in patterns:
        part = episodes if pattern == "all" else episodes.filter(pl.col("pattern") == pattern)
        for name in names:
            asked = int(part["asked"].list.contains(name).sum())
            if asked:
                found.append({"resolver": name, "pattern": pattern, **_answers(part, name, asked)})
    return found


def _answers(episodes: pl.DataFrame, name: str, asked: int) -> dict[str, Any]:
    answered = episodes.filter(pl.col("resolver") == name)
    counts = {verdict: int((answered["verdict"] == verdict).sum()) for verdict in ("right", "wrong", "open")}
    return {
        "asked": asked,
        "answered": len(answered),
        **counts,
        "answered_share": asdict(proportion(len(answered), asked)),
        "right_share": asdict(proportion(counts["right"], counts["right"] + counts["wrong"])),
    }


_SEEN: Final = ("patterns", "levels", "pattern_transitions", "level_transitions")


def coverage(runs: pl.DataFrame) -> list[dict[str, Any]]:
    """Voter states that the campaign's flights met together, by signal, of how many a voter has."""
    seen: dict[str, dict[str, set[Any]]] = {}
    possible: dict[str, dict[str, int]] = {}
    for text in runs["coverage"].drop_nulls().unique():
        for signal, covered in json.loads(text).items():
            sets = seen.setdefault(signal, {name: set() for name in _SEEN})
            for name in _SEEN:
                sets[name] |= set(covered[name])
            possible[signal] = {name: covered[f"{name}_possible"] for name in _SEEN}
    return [
        {
            "signal": signal,
            **{name: sorted(map(str, seen[signal][name])) for name in _SEEN},
            "possible": possible[signal],
        }
        for signal in sorted(seen, key=lambda name: (name != "overall", name))
    ]


def worst(folder: Folder) -> list[dict[str, Any]]:
    """The flights to look at first: not flown, lost, wrong, alarmed, missed, then by the time of a bad vote."""
    runs = folder.tables["runs"]
    order = [
        pl.col("outcome") != "flown",
        ~pl.col("survived").fill_null(value=True),
        *(pl.col(name).fill_null(0) for name in ("wrong_isolations", "false_alarms", "missed")),
        pl.col("vote_above_threshold_s").fill_null(0.0),
    ]
    ranked = runs.sort([*order, pl.col("run")], descending=[True] * len(order) + [False])
    return [_flight(folder, row) for row in ranked.drop("coverage", "digest").head(WORST).to_dicts()]


def _flight(folder: Folder, row: dict[str, Any]) -> dict[str, Any]:
    log = folder.logs / f"run_{row['run']:06d}.mcap"
    return {
        **row,
        "fly": f"rig campaign fly {folder.path} --run {row['run']}",
        "log": str(log) if log.is_file() else None,
    }
