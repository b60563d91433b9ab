"""Requirements of a campaign: their settings, columns of its tables, and the share of runs that meet each."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any, Final

import polars as pl

from rig.assess.requirements import Requirement, Verdict, number_of, plain, violated
from rig.campaign.statistics import proportion

RUNS: Final[dict[str, Any]] = {
    "violated": pl.Int64,  # verdicts; empty without requirements
    "least_margin": pl.Float64,
    "requirements": pl.String,  # JSON: requirement, signal, status, margin (of a state +-1000), instant_s of verdicts
}


def run_columns(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return the columns of RUNS."""
    if not verdicts:
        return {}
    fields = [{name: value for name, value in plain(verdict).items() if name != "values"} for verdict in verdicts]
    margins = [each["margin"] for each in fields if each["margin"] is not None]
    for each, verdict in zip(fields, verdicts, strict=True):
        each["margin"] = verdict.margin if isfinite(verdict.margin) else None  # to be compared with others
    return {
        "violated": len(violated(verdicts)),
        "least_margin": min(margins, default=None),
        "requirements": json.dumps(fields, sort_keys=True),
    }


def by_requirement(runs: pl.DataFrame, requirements: Sequence[Requirement]) -> list[dict[str, Any]]:
    """Return, of each requirement, the share of runs that meet it where it applies, and the run with the least margin.

    A run meets it where it does on every signal.
    """
    flights: dict[str, list[tuple[float, bool, int, dict[str, Any]]]] = {each.id: [] for each in requirements}
    for number, text in runs.select("run", "requirements").drop_nulls().rows():
        for id_, ones in _by_id(json.loads(text)).items():
            least = min(ones, key=lambda verdict: verdict["margin"])
            flights[id_].append((least["margin"], all(verdict["status"] == "met" for verdict in ones), number, least))
    return [_row(each, flights[each.id]) for each in requirements]


def _by_id(verdicts: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for verdict in verdicts:
        if verdict["margin"] is not None:
            groups.setdefault(verdict["requirement"], []).append(verdict)
    return groups


def _row(requirement: Requirement, flights: list[tuple[float, bool, int, dict[str, Any]]]) -> dict[str, Any]:
    least = min(flights, key=lambda flight: (flight[0], flight[2]), default=None)
    return {
        "requirement": requirement.id,
        "text": requirement.text,
        "met": asdict(proportion(sum(met for _, met, *_ in flights), len(flights))),
        "least_margin": None if least is None else number_of(least[0]),
        "least_run": None if least is None else least[2],
        "signal": None if least is None else least[3]["signal"],
        "instant_s": None if least is None else least[3]["instant_s"],
    }
