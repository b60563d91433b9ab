"""Stop a campaign when a proportion is known: the interval is looked at after runs that the file alone decides.

A look is at the first runs in their order, all of them done and none beyond handed out, so neither the number of
workers nor an interruption decides which runs are flown.  The interval (confidence_sequence.py) holds at every look.
Looks are after whole rounds of a grid or of the combinations of cases: the mean proportion of each is the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from math import ceil
from typing import Any, Final

import polars as pl
from pydantic import Field

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.outputs import UNTIL
from rig.core.settings import Settings, build
from rig.studies.campaign.campaign_file import Campaign
from rig.studies.campaign.confidence_sequence import fixed_trials, is_known, sequence_interval, sequence_trials
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.group_rates import Tables
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.sampling import round_of
from rig.studies.campaign.study_folder import write_whole
from rig.studies.campaign.trials_of_runs import require_names, trials

_BLOCK: Final = 20  # least runs between two looks
_GROWTH: Final = 0.05  # of the runs so far, between two looks
_FORM: Final = "half-width=0.02"
_REMEDY: Final = "remove it, or give --until again"


class Until(Settings):
    """The proportion that is wanted, and how narrow: ``until.json``."""

    half_width: float = Field(gt=0, lt=0.5)
    of: str
    by: str | None = None
    runs: int = Field(ge=1)  # the limit

    def looks(self, campaign: Campaign) -> Iterator[int]:
        """Yield the numbers of runs after which the interval is looked at; the last is the limit.

        The first is the least at which the width can be reached.
        """
        whole = round_of(campaign) or 1
        at = whole * ceil(sequence_trials(self.half_width, 0.0) / whole)
        while at < self.runs:
            yield at
            at += whole * ceil(max(_BLOCK, _GROWTH * at) / whole)
        yield self.runs


def read_until(text: str | None, of: str | None, by: str | None, plan: Plan, runs: int) -> Until | None:
    """Return the ``--until`` of the command line, with its ``--of`` and ``--by``; None without it.  BadInput."""
    if text is None:
        if of is not None or by is not None:
            raise BadInput(f"--{'by' if of is None else 'of'}: needs --until {_FORM}")
        return None
    if of is None:
        raise BadInput("--until: needs --of COLUMN, whose proportion is wanted, as --of detected")
    require_names(plan, of, by)
    require_independent(plan.campaign, runs)
    return Until(half_width=width_of(text), of=of, by=by, runs=runs)


def width_of(text: str) -> float:
    """Return the half-width of ``half-width=0.02``.  BadInput: another word, or not above 0 and below 0.5."""
    word, _, number = text.partition("=")
    try:
        width = float(number) if word.strip() == "half-width" else -1.0
    except ValueError:
        width = -1.0
    if not 0.0 < width < 0.5:
        raise BadInput(f"--until {text}: must be half-width=H with H above 0 and below 0.5, as {_FORM}")
    return width


def require_independent(campaign: Campaign, runs: int) -> None:
    """Raise BadInput unless the first runs of a campaign are a sample of all of it, whatever their number."""
    whole = round_of(campaign)
    if whole is None:
        text = "the runs of a latin hypercube or of Sobol points depend on each other"
        raise BadInput(f"--until: {text}; use sampling = 'random', 'stratified' or 'grid'")
    if runs < whole:
        text = f"needs a whole round of the campaign, {whole} runs, and may fly {runs}"
        raise BadInput(f"--until: {text}; raise runs, or use sampling = 'random'")


def _counted(until: Until, found: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the share of each group of trials, with its interval, and whether it is known."""
    sums = found.group_by("group").agg(count=pl.col("yes").sum(), of=pl.len()).sort("group")
    rows = []
    for group, count, of in sums.iter_rows():
        rate = sequence_interval(int(count), int(of), until.half_width)
        half = None if rate.low is None or rate.high is None else (rate.high - rate.low) / 2.0
        rows.append({"group": group, **asdict(rate), "half_width": half, "known": is_known(rate, until.half_width)})
    return rows


def stand(until: Until, folder: Folder, tables: Tables) -> dict[str, Any]:
    """Return where a campaign stands: the runs to fly now (``flights``), and the groups at the last look.

    known : every group is as narrow as wanted, and the campaign stops after ``flights`` runs
    finished : it is known, or all runs are there
    """
    there, whole = tables["runs"]["run"].to_numpy(), round_of(folder.plan.campaign) or 1
    found = trials(tables, until.of, until.by)
    state: dict[str, Any] = {**until.model_dump(), "flights": 0, "known": False, "finished": False, "groups": []}
    for look in until.looks(folder.plan.campaign):
        if int((there < look).sum()) < look:
            return {**state, "flights": look}
        groups = _counted(until, found.filter(pl.col("run") < look - look % whole))
        known = bool(groups) and all(row["known"] for row in groups)
        state |= {"flights": look, "known": known, "finished": known or look >= until.runs, "groups": groups}
        if known:
            break
    return state


def keep(until: Until | None, folder: Folder) -> None:
    """Write ``until.json`` into a held folder, or remove the one of an earlier call."""
    path = folder.path / UNTIL
    if until is not None:
        write_whole(path, sealed.to_json(until.model_dump(), _place(folder)))
    elif is_file(path):
        path.unlink()


def kept(folder: Folder) -> dict[str, Any] | None:
    """Return where the campaign of a folder stands; None if it flies all runs.  BadInput: ``until.json`` is damaged."""
    path = folder.path / UNTIL
    if not is_file(path):
        return None
    until = build(Until, sealed.read_json(path, _REMEDY, _place(folder)), str(path))
    require_names(folder.plan, until.of, until.by)
    return stand(until, folder, folder.tables)


def _place(folder: Folder) -> str:
    mark = sealed.identity(json.dumps(folder.kept, sort_keys=True).encode())
    return f"{mark} {UNTIL}"


def flights_needed(text: str, share: float, plan: Plan, runs: int | None) -> dict[str, Any]:
    """Return how many flights of each group ``--until`` takes at a ``share`` of true ones.  BadInput.

    fixed : how many an exact interval takes whose number of flights is chosen before; price : their ratio
    worst : at a share of 0.5
    """
    count, width = plan.count(runs), width_of(text)
    require_independent(plan.campaign, count)
    need, fixed, worst = sequence_trials(width, share), fixed_trials(width, share), sequence_trials(width)
    needed = {"flights": need, "worst": worst, "fixed": fixed, "price": need / fixed}
    return {"half_width": width, "proportion": share, **needed, "runs": count}
