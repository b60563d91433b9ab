"""Run open-loop trials on several processes and write their folder, which cells.py describes and reads."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rig.campaign.config import from_what
from rig.campaign.plan import Plan, rig_identity
from rig.campaign.pool import each
from rig.errors import BadInput
from rig.reliability.cells import FORMAT, TABLES
from rig.reliability.tally import Cells
from rig.reliability.trials import Batch, Tally, TrialRunner, added_up, shared_out
from rig.util.files import new_folder, replaced, reported
from rig.util.outputs import TRIALS

Report = Callable[[int, int], None]  # trials done, of how many


def fly_trials(
    plan: Plan, out: Path, runs: int, seed: int, workers: int, good: list[int], report: Report | None = None
) -> dict[str, Any]:
    """Run trials and write their folder, whole or not at all; return the content of ``trials.json``.

    BadInput before the first trial; RigError: the disk.
    """
    _new(out)
    units = shared_out(plan, runs, seed, good)
    manager = plan[units[0].number].scenario().redundancy.manager
    count, done, tallies = sum(unit.trials for unit in units), 0, []
    for unit, tally in zip(units, _tallies(plan, units, workers), strict=True):
        tallies.append(tally)
        done += unit.trials
        if report is not None:
            report(done, count)
    about = {"format": FORMAT, **_identity(plan, seed), "manager": manager, "trials": count, "good_before": good}
    _write(out, added_up(tallies, manager), about)
    return about


def _tallies(plan: Plan, units: Sequence[Batch], workers: int) -> Iterator[Tally]:
    """Return the units' tallies in their order, by ``workers`` processes or, for one, by this; Ctrl-C ends it."""
    if workers == 1:
        return map(TrialRunner(plan), units)
    return each(_fly, units, workers, 4, initializer=_begin, initargs=(plan.campaign.what(), plan.source))


def _begin(what: dict[str, Any], source: str) -> None:
    """Begin a worker."""
    global _flight
    _flight = TrialRunner(Plan(from_what(what, source), source))


_flight: Callable[[Batch], Tally] | None = None  # of a worker


def _fly(unit: Batch) -> Tally:
    assert _flight is not None
    return _flight(unit)


def _identity(plan: Plan, seed: int) -> dict[str, Any]:
    what = json.dumps(plan.identity(), sort_keys=True).encode()
    sha256 = hashlib.sha256(what).hexdigest()
    return {"campaign": plan.campaign.title, "campaign_sha256": sha256, "seed": seed, "rig": rig_identity()}


def _new(out: Path) -> None:
    """Raise BadInput unless a folder can be made at ``out``: nothing there, or an empty folder."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(f"--out {out}: folder exists and is not empty")


def _write(out: Path, cells: Cells, about: dict[str, Any]) -> None:
    """Write tables first, ``trials.json`` last."""
    with reported(f"--out {out}"), new_folder(out):
        for name, table in zip(TABLES, (cells.counts, cells.false_isolations), strict=True):
            memory = io.BytesIO()
            table.write_parquet(memory)
            with replaced(out / f"{name}.parquet") as draft:
                draft.write_bytes(memory.getvalue())
        with replaced(out / TRIALS) as draft:
            draft.write_text(json.dumps(about, indent=1), encoding="utf-8")
