"""Run open-loop trials on several processes and write their folder, which campaign_cells.py describes and reads."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import LOCK, is_file, is_unused, new_folder, reported, sweep
from rig.core.outputs import TRIALS
from rig.core.progress import tell
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.pool import by_workers
from rig.studies.campaign.study_folder import FORMAT, locked, write_whole
from rig.studies.reliability.campaign_cells import TABLES, place
from rig.studies.reliability.cell_trials import TrialRunner, added_up, shared_out

_FILES: Final = {name: f"{name}.parquet" for name in TABLES}


def fly_trials(plan: Plan, out: Path, runs: int, seed: int, workers: int, good: list[int]) -> dict[str, Any]:
    """Run trials and write their folder, whole or not at all; return the content of ``trials.json``.

    BadInput before the first trial; RigError: the disk.
    """
    _require_new(out)
    units = shared_out(plan, runs, seed, good)
    manager = plan[units[0].number].scenario().redundancy.manager
    count, done, tallies = sum(unit.trials for unit in units), 0, []
    what = json.dumps(plan.identity(), sort_keys=True).encode()
    about = {
        "format": FORMAT,
        "campaign": plan.campaign.title,
        "campaign_sha256": hashlib.sha256(what).hexdigest(),
        "seed": seed,
        "rig": rig_identity(),
        "manager": manager,
        "trials": count,
        "good_before": good,
    }
    with _held(out):
        for unit, tally in zip(units, by_workers(TrialRunner, (plan,), units, workers, 4), strict=True):
            tallies.append(tally)
            done += unit.trials
            tell("trials", done, count)
        cells = added_up(tallies, manager)
        for name, table in zip(_FILES, (cells.counts, cells.false_isolations), strict=True):
            write_whole(out / _FILES[name], sealed.table(table, place(about, name)))
        write_whole(out / TRIALS, sealed.to_json(about))  # the last: a folder without it is unfinished
    return about


def _require_new(out: Path) -> None:
    """Raise BadInput unless ``out`` is free, or holds only the rest of a killed command, without ``trials.json``."""
    if not is_unused(out, _is_left):
        raise BadInput(f"--out {out}: the folder exists and is not empty")


def _is_left(path: Path) -> bool:
    """Return True for a whole table of trials."""
    return path.name in _FILES.values() and is_file(path) and not sealed.fault(path.read_bytes())


@contextmanager
def _held(out: Path) -> Iterator[None]:
    """Make the folder and hold it alone; after an error, restore it."""
    with ExitStack() as stack:
        with reported(f"--out {out}", BadInput):
            stack.enter_context(new_folder(out))
        stack.enter_context(locked(out, "rig reliability trials is running"))
        mine = [LOCK]
        try:
            _require_new(out)  # another command may have been faster
            mine += _FILES.values()
            sweep(out)
            yield
        except BaseException:
            for name in mine:
                with suppress(OSError):  # of a system that does not remove what is open
                    (out / name).unlink(missing_ok=True)
            raise
