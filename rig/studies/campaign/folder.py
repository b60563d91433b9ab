"""The output folder of a campaign: its identity, its parts, the runs done, the runs that could not be flown, the voter.

    campaign.json               the campaign and the version of rig that flies it
    runs/000010-000019.parquet  a part, and the same name in faults/, alarms/, episodes/ and signals/
    logs/run_000012.mcap        the logs that are kept
    until.json                  the proportion at which the campaign stops, if there is one

A part is written under another name and renamed, the one in ``runs`` last: a run is done when its row is there.  A run
that could not be flown has a row with the reason; it does not count as done, and the next command flies it again.
Every file but the logs has a checksum of its bytes (core/sealed.py); files of format 1, an earlier version, have none.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import DRAFT
from rig.core.notes import note
from rig.core.outputs import BESIDE_RUNS, CAMPAIGN, UNTIL
from rig.core.renamed import data_now
from rig.core.trust import Trust
from rig.studies.campaign import table_parts as parts
from rig.studies.campaign import tables as table
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.searched import SearchedPlan
from rig.studies.campaign.study_folder import FORMAT, UNSEALED, Study, write_whole
from rig.studies.campaign.tables import TABLES, Rows
from rig.unit.unit_facts import differences, voted_by, what_it_reads
from rig.unit.unit_file import Unit

NOT_FLOWN: Final = ("crashed", "timed out", "failed", "unit dead", "unit refused")  # outcomes of a run


class _Campaign(Study):
    def read(self, out: Path, name: str = "") -> dict[str, Any]:
        """Return ``campaign.json``.  BadInput: it is not of a campaign."""
        content = super().read(out, name)
        if not isinstance(content.get("campaign"), dict):
            raise BadInput(f"{out / self.mark}: is damaged: it has no table 'campaign'; {self.remedy}")
        return content


STUDY: Final = _Campaign(
    mark=CAMPAIGN,
    folder="a campaign's folder",
    other="runs of another campaign",
    busy="rig campaign run is flying",
    remedy="take it from a copy, or fly into another folder",
    beside=(*BESIDE_RUNS, UNTIL),
)


class Folder:
    """The output of one campaign; ``open_folder`` opens an existing one, ``Folder.of`` one to fly into."""

    def __init__(self, path: Path, plan: Plan, unit: Unit | None = None) -> None:
        """Hold path and plan; ``unit``: under test, in place of the built-in manager."""
        self.path = path
        self.plan = plan
        self.unit = unit

    @property
    def logs(self) -> Path:
        """Return the folder of logs."""
        return self.path / "logs"

    @classmethod
    def of(cls, path: Path, plan: Plan, unit: Unit | None = None) -> Folder:
        """Return the folder to fly ``plan`` into: a new one, or one of the same campaign. Writes nothing.

        BadInput: the folder is of another campaign, or of something else; the difference is named.
        """
        folder = cls(path, plan, unit)
        if folder.is_begun and folder.kept["format"] == UNSEALED:
            raise BadInput(f"--out {path}: was flown by an earlier version of rig; choose another folder")
        STUDY.require(path, folder.about)
        return folder

    @property
    def is_begun(self) -> bool:
        """Return True if there is a campaign in the folder."""
        return STUDY.is_begun(self.path)

    @cached_property
    def about(self) -> dict[str, Any]:
        """Return the content of ``campaign.json`` for the plan."""
        unit = {} if self.unit is None else {"unit": self.unit.identity()}
        return {"format": FORMAT, "rig": rig_identity(), **self.plan.identity(), **unit}

    @property
    def mark(self) -> str:
        """Return the hash of the identity, the same for the same plan and unit, whatever the folder."""
        return sealed.identity(json.dumps(self.about, sort_keys=True).encode())

    @property
    def kept(self) -> dict[str, Any]:
        """Return the content of ``campaign.json``, as it was when the first run was flown.  BadInput."""
        return STUDY.read(self.path)

    def require(self, unit: Unit | None) -> None:
        """Raise BadInput if the campaign was flown with a unit other than ``unit``, or another build of it."""
        was = self.kept.get("unit")
        if was is None and unit is not None:
            raise BadInput(f"{self.path}: was flown without a unit under test")
        if was is not None and (unit is None or unit.build() != was.get("sha256")):
            differs = [] if unit is None else differences(was, unit.identity())
            given = f"{unit.source} is another build: {differs[0]}" if unit else "give its file by --unit"
            raise BadInput(f"{self.path}: was flown with the unit under test {was.get('name')!r}: {given}")

    @contextmanager
    def held(self) -> Iterator[None]:
        """Make the folder if there is none, and hold it alone; remove incomplete files before and after."""
        with STUDY.held(self.path, self.about):
            self._sweep()
            yield
            self._sweep()  # a worker that died leaves its draft

    def _sweep(self) -> None:
        """Remove drafts, and files of parts whose ``runs`` is not there; nothing else, and nothing behind a link."""
        whole = set(parts.names(self.path))
        for name in (*TABLES, "logs"):
            folder = self.path / name
            if folder.is_symlink() and name in TABLES:
                raise BadInput(f"{folder}: is a link; a campaign's tables must be folders in the campaign's folder")
            for path in folder.glob("*"):
                half = path.suffix in (DRAFT, ".tmp")
                orphan = name in TABLES and path.suffix == ".parquet" and path.stem not in whole
                if (half or orphan) and not path.is_dir():
                    path.unlink()

    def done(self) -> set[int]:
        """Return the runs that are complete in all tables. BadInput names an incomplete part, and the remedy."""
        return set(self.read()["runs"]["run"].to_list())

    def read(self) -> dict[str, pl.DataFrame]:
        """Read all tables as they are now; BadInput as ``done``."""
        return parts.read(self.path, self.plan, self._identity)

    @cached_property
    def _identity(self) -> str | None:
        """Return the mark of the parts of this campaign; None if they have no checksum."""
        about = self.kept
        if about["format"] == UNSEALED:
            note(f"{self.path}: was flown by an earlier version of rig; its tables have no checksum")
            return None
        return sealed.identity(json.dumps(about, sort_keys=True).encode())

    def write(self, rows: Rows) -> None:
        """Write one part: all tables, ``runs`` last. RigError: the disk is full."""
        name = f"{parts.name_of([row['run'] for row in rows['runs']])}.parquet"
        for kind in sorted(TABLES, key=lambda kind: kind == "runs"):
            place = f"{self._identity} {kind}/{name}"
            write_whole(self.path / kind / name, sealed.table(table.frame(self.plan, kind, rows[kind]), place))

    @cached_property
    def tables(self) -> dict[str, pl.DataFrame]:
        """Read all tables, sorted by run; a part whose ``runs`` is missing does not count. BadInput as ``done``."""
        return self.read()

    def take_out(self, below: int) -> set[int]:
        """Remove the runs that could not be flown, ``below`` a number, from the tables; return the runs that stay.

        The folder is held.  A part that also has other runs is written again with the others; a kill between the two
        steps costs only the time of these.  BadInput as ``done``.
        """
        tables = self.read()
        runs = tables["runs"]
        again = set(runs.filter((pl.col("outcome") != "flown") & (pl.col("run") < below))["run"].to_list())
        for name in parts.names(self.path) if again else ():
            path = self.path / "runs" / f"{name}.parquet"
            there = set(pl.read_parquet(path.read_bytes(), columns=["run"])["run"].to_list())
            if there & again:
                path.unlink()
                if kept := there - again:
                    self.write({kind: tables[kind].filter(pl.col("run").is_in(kept)).to_dicts() for kind in TABLES})
        return set(runs["run"].to_list()) - again

    def voters(self) -> list[str]:
        """Return the managers that voted, or the unit under test and its build.  BadInput as ``done``.

        In an older folder the unit is that of ``campaign.json``.
        """
        unit = self.kept.get("unit")
        managers = sorted(self.tables["runs"]["manager"].drop_nulls().unique().to_list())
        if unit is None or any("unit " in name for name in managers):
            return managers
        return sorted({voted_by(name, unit) for name in managers or [""]})

    @property
    def by(self) -> str:
        """Return the voters as a line: ``manager mean, median``, ``unit mvs 0a1b2c3d4e5f``.  BadInput as ``done``."""
        voters = self.voters()
        of_units = any("unit " in name for name in voters)
        return ", ".join(voters) if of_units or not voters else f"manager {', '.join(voters)}"

    @property
    def unit_reads(self) -> str:
        """Return files and environment of the unit under test that flew, as a line; empty without one."""
        return what_it_reads(self.kept.get("unit") or {})

    def status(self) -> dict[str, Any]:
        """Return the state of the campaign: all runs, the runs done, the result, the hash of the tables so far."""
        runs = self.tables["runs"]
        return {
            "folder": str(self.path),
            "title": self.plan.campaign.title,
            "runs": len(self.plan),
            "done": int((runs["outcome"] == "flown").sum()),
            "outcomes": dict(runs["outcome"].value_counts().iter_rows()),
            "aircraft_lost": int((~runs["survived"].fill_null(value=True)).sum()),
            "logs": sum(1 for _ in self.logs.glob("*.mcap")),
            "identity": sealed.identity(json.dumps(self.kept, sort_keys=True).encode()),
            "table_sha256": table.sha256(self.tables),
        }


def open_folder(path: Path, allow_code: bool = False) -> Folder:
    """Open the campaign in a folder. BadInput: there is none.

    allow_code : a manager class that the campaign names may be run
    """
    file = path / CAMPAIGN
    if not STUDY.is_begun(path):
        raise BadInput(f"{path}: not a campaign's folder: {CAMPAIGN} is missing")
    held, trust = STUDY.read(path), Trust(str(file), allow_code)
    plan: Plan = Plan(from_what(data_now(held["campaign"]), str(file)), str(file), trust)
    search = data_now(held.get("search"))
    if search is not None:
        plan = SearchedPlan(plan.campaign, str(file), trust, search)
    folder = Folder(path, plan)
    if isinstance(plan, SearchedPlan):
        plan.choose(folder.tables["runs"])
    return folder


def not_flown(runs: pl.DataFrame) -> dict[str, Any]:
    """Return how many runs of a table were not flown, with the number, outcome and reason of the first."""
    rows = runs.filter(pl.col("outcome").is_in(NOT_FLOWN)).sort("run")  # an open-loop trial is no run
    first = None if rows.is_empty() else f"run {rows['run'][0]}: {rows['outcome'][0]}: {rows['reason'][0]}"
    return {"not_flown": len(rows), "first_reason": first}
