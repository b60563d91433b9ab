"""All figures of the report of a campaign, and the comparison of two campaigns on the same seeds; plain data."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any, Final

import polars as pl

from rig.core.column import COUNT, INSTANT, LEVEL, RATE, SECONDS, SHARE, Column
from rig.core.difference import difference
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.studies.campaign.folder import Folder, not_flown
from rig.studies.campaign.group_rates import (
    DELAYS,
    Tables,
    acted,
    alarm_rate,
    by_kind,
    by_requirement,
    by_rule,
    delays,
    false_alarms,
    flown,
    rates,
    replies,
    share_of,
    smallest,
    tie_break,
)
from rig.studies.campaign.statistics import mcnemar, median_interval, paired_difference
from rig.studies.campaign.tables import COUNTED, RUNS, SUSPECTS
from rig.studies.campaign.until import kept
from rig.studies.campaign.varied import by_name, by_varied, varied
from rig.unit.unit_facts import voted_by

WORST: Final = 10
# The columns that rank the worst flights.
RANKED: Final = [RUNS[key] for key in ("wrong_isolations", "false_alarms", "missed", "vote_above_threshold_s")]
# The columns of the tables of a report, by their names in ``summary``.
TABLES: Final[dict[str, tuple[Column, ...]]] = {
    "by_kind": (
        *(Column("signal", type=str), Column("kind", type=str), Column("of", type=str), Column("acted")),
        Column("detected of detectable", "detection", SHARE),
        Column("correctly isolated", "correct_isolation", SHARE),
        Column("wrongly isolated", "wrong_isolation", SHARE),
    ),
    "by_pattern": (
        *(Column("pattern", type=str, empty="no pattern"), Column("acted"), Column("detected", "detection", SHARE)),
        Column("wrongly isolated", "wrong_isolation", SHARE),
    ),
    "by_rule": (
        *(Column("decided by", "decided_by", type=str), Column("faulty isolated", "faulty")),
        *(Column("healthy isolated", "healthy"), Column("correct", format=SHARE)),
    ),
    "by_varied": (
        Column("varied key", "key", type=str, page="key"),
        *(Column("level", format=LEVEL, type=str), Column("of", worth=8, type=str, page="manager")),
        Column("runs", worth=5),
        Column("detected of acted", "detection_of_all", COUNT),
        Column("of detectable", "detection", COUNT, page="detected of detectable"),
        Column("delay, median s", "delay_from_onset_s.median", SECONDS),
        Column("95 %, s", "delay_from_onset_s.p95", SECONDS, worth=0),
        Column("survived", "survival", COUNT, worth=7),
        Column("false alarms an h", "false_alarms", RATE, worth=6, page="false alarms a channel hour"),
    ),
    "false_alarms_by_signal": (Column("what", "kind", type=str), Column("signal", type=str), Column("count")),
    "tie_break": (
        *(Column("decided_by", page="decided by", type=str), Column("pattern", type=str), Column("asked", worth=4)),
        *(Column("decided", "answered", worth=6), Column("correct", worth=7), Column("wrong", worth=8)),
        *(Column("open", worth=5), Column("decided of asked", "answered_share", SHARE, worth=0)),
        Column("correct of decided", "correct_share", SHARE),
    ),
    "coverage": (
        *(Column("signal", type=str), Column("patterns", lambda row: ", ".join(row["patterns"]), type=str)),
        *(Column("of", "possible.patterns"), Column("levels", lambda row: ", ".join(row["levels"]), type=str)),
        Column("of", "possible.levels"),
        *(
            Column(title, lambda row, name=name: f"{len(row[name])} of {row['possible'][name]}")
            for title, name in (("transitions of patterns", "pattern_transitions"), ("of levels", "level_transitions"))
        ),
    ),
    "until": (
        *(Column("group", lambda row: row["group"] or "all", type=str), Column("proportion", lambda row: row, SHARE)),
        *(Column("half-width", "half_width", ".4f"), Column("known", lambda row: "yes" if row["known"] else "no")),
    ),
    "requirements": (
        *(Column("requirement", type=str, hint="text"), Column("met", format=SHARE, page="runs that meet it")),
        *(Column("least robustness", "robustness", format=".3g"), Column("in run", "least_run")),
        *(Column("on", "signal", worth=5, type=str), Column("at s", "instant_s", INSTANT, worth=4, page="at, s")),
    ),
    "servos": (
        *(Column("fault of an actuator", "kind"), Column("acted", worth=4), Column("detected", "found", format=SHARE)),
        *(Column("by", worth=7), Column("median s", format=SECONDS, worth=6)),
        Column("longest s", format=SECONDS, worth=5),
    ),
}
_SEEN: Final = ("patterns", "levels", "pattern_transitions", "level_transitions")
# What is compared of two campaigns, by run and by fault.
_BY_RUN: Final = {
    "survived": pl.col("survived"),
    "no false alarm": pl.col("false_alarms") == 0,
    "no wrong isolation": pl.col("wrong_isolations") == 0,
}
_BY_FAULT: Final = {
    "fault detected": pl.col("outcome") == "detected",
    "fault correctly isolated": pl.col("isolation") == "correct",
}
_ALL: Final = "every fault detected"  # of the runs with a fault
_DETECTABLE: Final = pl.col("outcome") != "undetectable"
_KEPT: Final = ("format",)  # of ``campaign.json``: no part of an identity


def summary(folder: Folder) -> dict[str, Any]:
    """Return all figures of a campaign's folder."""
    tables, plan = folder.tables, folder.plan
    names = by_name(plan, tables["runs"])
    faults = acted(tables, names)
    with_size = faults.filter(pl.col("size").is_not_null())
    return {
        "title": plan.campaign.title or str(folder.path),
        "folder": str(folder.path),
        "runs": len(plan),
        "managers": folder.voters(),
        "by": folder.by,
        "reads": folder.unit_reads,
        "set": [f"{key}={value}" for key, value in plan.campaign.set.items()],
        "varied": varied(plan),
        "by_name": names,
        "headline": headline(tables),
        "until": kept(folder),
        "by_kind": rates(faults, ["signal", "kind"], names),
        "by_magnitude": rates(with_size, ["signal", "kind", "size"]),
        "by_pattern": rates(faults, ["pattern"]),
        "by_rule": by_rule(tables),
        "by_varied": by_varied(tables, plan),
        "by_place": rates(with_size, ["signal", "kind", "place", "size"]),
        "false_alarms_by_signal": false_alarms(tables),
        "delays": delays(faults, names),
        "detectable": smallest(faults, names),
        "tie_break": tie_break(tables["episodes"]),
        "coverage": coverage(tables["runs"]),
        "requirements": by_requirement(tables["runs"], plan.requirements),
        "servos": by_kind(tables["faults"]),
        "replies": replies(tables["runs"]),
        "worst": worst(folder),
    }


def until_words(state: dict[str, Any]) -> str:
    """Return where a campaign stands that stops when a proportion is known: ``until.stand`` in words."""
    by = f" by {state['by']}" if state["by"] else ""
    wanted = f"half-width {state['half_width']:g} of {state['of']}{by}"
    if state["known"]:
        return f"{wanted}: stopped after {state['flights']} of {state['runs']} flights"
    if state["finished"]:
        none = f"; no flight has {state['of']}" if not state["groups"] else ""
        return f"{wanted}: not reached in {state['runs']} flights{none}"
    return f"{wanted}: not yet, next look after {state['flights']} of at most {state['runs']} flights"


def headline(tables: Tables) -> dict[str, Any]:
    """Return the headline figures of a campaign."""
    runs, faults = flown(tables), acted(tables)
    exceeded = faults.filter(pl.col("outcome") != "undetectable")
    return {
        "done": len(runs),
        **not_flown(tables["runs"]),
        "outcomes": dict(tables["runs"]["outcome"].value_counts().sort("outcome").iter_rows()),
        "flight_h": float(runs["duration_s"].sum()) / 3600.0,
        "survival": share_of(runs["survived"]),
        "faults": len(tables["faults"]),
        "not_executed": int((tables["faults"]["outcome"] == "not executed").sum()),
        "undetectable": len(faults) - len(exceeded),
        "detection": share_of(exceeded["outcome"] == "detected"),
        "correct_isolation": share_of(exceeded["isolation"] == "correct"),
        "wrong_isolation": share_of(exceeded["isolation"] == "wrong"),
        "false_alarms": alarm_rate(runs),
        "false_alarm_runs": int((runs["false_alarms"] > 0).sum()),
        **{column: int(runs[column].sum()) for column in (*COUNTED, SUSPECTS)},
        "suspect_runs": int((runs[SUSPECTS] > 0).sum()),
    }


def coverage(runs: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the voter states that the campaign's flights reached, by signal, and the number that a voter has."""
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
    """Return the flights to look at first: not flown, lost, wrong isolation, false alarm, missed, undetected error."""
    runs = folder.tables["runs"]
    order = [
        pl.col("outcome") != "flown",
        ~pl.col("survived").fill_null(value=True),
        *(pl.col(column.key).fill_null(0) for column in RANKED),
    ]
    ranked = runs.sort([*order, pl.col("run")], descending=[True] * len(order) + [False])
    flights = ranked.drop("coverage", "digest", "requirements").head(WORST).to_dicts()
    for row in flights:
        log = folder.logs / f"run_{row['run']:06d}.mcap"
        row["fly"] = f"rig campaign fly {folder.path} --run {row['run']}"
        row["log"] = str(log) if is_file(log) else None
    return flights


def compare(first: Folder, second: Folder) -> dict[str, Any]:
    """Pair the outcomes of the runs flown in both campaigns, and of the faults that acted in both.

    A fault counts whether or not its error exceeded the threshold, because the thresholds may differ: every share is
    of the same faults.  BadInput: the seeds differ.
    """
    (runs, faults), (other_runs, other_faults) = _compared(first), _compared(second)
    runs = runs.join(other_runs, on=["run"], suffix="_second")
    if runs.is_empty():
        raise BadInput(f"{first.path} and {second.path} have no flown run in common")
    if (runs["seed"] != runs["seed_second"]).any():
        raise BadInput(f"{first.path} and {second.path} were not flown on the same seeds; nothing can be paired")
    faults = faults.join(other_faults, on=["run", "fault", "channel"], suffix="_second")
    faults = faults.filter((pl.col("outcome") != "not executed") & (pl.col("outcome_second") != "not executed"))
    by = {"first": first.by, "second": second.by}
    whole = faults.group_by("run").agg(pl.col("fault detected", "fault detected_second").all())
    whole = whole.rename({"fault detected": _ALL, "fault detected_second": f"{_ALL}_second"})
    found = faults.filter(pl.col("fault detected") & pl.col("fault detected_second"))
    return {
        "first": str(first.path),
        "second": str(second.path),
        "by": by,
        "differs": _differs(first, second),
        "runs": len(runs),
        "faults": len(faults),
        "runs_with_faults": len(whole),
        "detectable": _counts(faults, "detectable"),
        "outcomes": [
            *(_paired(runs, name, "run") for name in _BY_RUN),
            *([_paired(whole, _ALL, "run with a fault")] if len(whole) else []),
            *(_paired(faults, name, "fault") for name in _BY_FAULT if len(faults)),
        ],
        "delays": [_delay(found, name) for name in DELAYS],
    }


def _differs(first: Folder, second: Folder) -> list[str]:
    """Return the differences of two campaigns, a line each: campaign, aircraft, version of rig, code, unit."""
    was, now = ({key: value for key, value in folder.kept.items() if key not in _KEPT} for folder in (first, second))
    for one, other in ((was, now), (now, was)):
        if "unit" in one and "unit" not in other:
            one["unit"] = voted_by("", one["unit"])  # one line in place of its settings
    return difference(was, now)


def _compared(folder: Folder) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Return the flown runs and the faults on channels, with the compared outcomes."""
    runs = flown(folder.tables)
    faults = folder.tables["faults"].filter(pl.col("channel").is_not_null())
    return runs.with_columns(**_BY_RUN), faults.with_columns(**_BY_FAULT, detectable=_DETECTABLE)


def _counts(pairs: pl.DataFrame, name: str) -> dict[str, int]:
    a, b = pairs[name], pairs[f"{name}_second"]
    return {"first": int(a.sum()), "second": int(b.sum()), "both": int((a & b).sum())}


def _paired(pairs: pl.DataFrame, name: str, unit: str) -> dict[str, Any]:
    a, b = pairs[name].cast(pl.Boolean), pairs[f"{name}_second"].cast(pl.Boolean)
    first, second = a.to_numpy(), b.to_numpy()
    return {
        "outcome": name,
        "unit": unit,
        "first": share_of(a),
        "second": share_of(b),
        "difference": paired_difference(first, second)._asdict(),
        "pairs": asdict(mcnemar(first, second)),
    }


def _delay(found: pl.DataFrame, name: str) -> dict[str, Any]:
    """Return the delays of faults detected in both: the medians, and the median difference with its interval."""
    pairs = found.filter(pl.col(name).is_not_null() & pl.col(f"{name}_second").is_not_null())
    a, b = pairs[name], pairs[f"{name}_second"]
    return {
        "delay": name,
        "faults": len(pairs),
        "first_median_s": a.median(),
        "second_median_s": b.median(),
        "difference_s": None if pairs.is_empty() else median_interval((a - b).to_numpy())._asdict(),
        "sooner_first": int((a < b).sum()),
        "sooner_second": int((a > b).sum()),
    }
