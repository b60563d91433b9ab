"""A campaign's output folder: whose it is, its parts, what is done.

    campaign.json               the campaign and the rig that flies it
    runs/000010-000019.parquet  a part, and the same name in faults/, alarms/, episodes/ and signals/
    logs/run_000012.mcap        the logs that are kept

A part is written beside and renamed, the one in ``runs`` last: a run is done when its row is there.
Every file but the logs has a checksum of its bytes (core/sealed.py); those of format 1, an earlier version, have none.
One command flies into a folder at a time, on every system: it holds the file ``lock``.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core import sealed
from rig.core.errors import BadInput, RigError
from rig.core.files import DRAFT, LOCK, is_file, is_unused, replaced, reported, sweep
from rig.core.notes import note
from rig.core.outputs import BESIDE_RUNS, CAMPAIGN
from rig.core.trust import Trust
from rig.studies.campaign import table_parts as parts
from rig.studies.campaign import tables as table
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.searched import SearchedPlan
from rig.studies.campaign.tables import TABLES, Rows
from rig.unit.unit_file import Unit

_FORMAT: Final = 2
_UNSEALED: Final = 1  # its files have no checksum
_REMEDY: Final = "take it from a copy, or fly into another folder"
_FLAGS: Final = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)  # no child process inherits what os.open gives


class Folder:
    """One campaign's output; ``open_folder`` for one that is there, ``Folder.of`` to fly into."""

    def __init__(self, path: Path, plan: Plan, unit: Unit | None = None) -> None:
        """Hold path and plan; ``unit``: under test, in the place of our manager."""
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

        BadInput: the folder is another campaign's, or something else's; the difference is named.
        """
        folder, file = cls(path, plan, unit), path / CAMPAIGN
        if is_file(file):
            was = _read(file)
            if was["format"] == _UNSEALED:
                raise BadInput(f"--out {path}: was flown by an earlier version of the rig; fly into another folder")
            differs = difference(was, folder.about())
            if differs:
                raise BadInput(f"--out {path}: holds runs of another campaign: {differs[0]}")
            return folder
        if not is_unused(path):
            raise BadInput(f"--out {path}: not a campaign's folder, and not empty")
        return folder

    def about(self) -> dict[str, Any]:
        """Return the content of ``campaign.json``."""
        unit = {} if self.unit is None else {"unit": self.unit.identity()}
        return {"format": _FORMAT, "rig": rig_identity(), **self.plan.identity(), **unit}

    @property
    def kept(self) -> dict[str, Any]:
        """Return the content of ``campaign.json``, as it was when the first run was flown.  BadInput."""
        return _read(self.path / CAMPAIGN)

    def require(self, unit: Unit | None) -> None:
        """Raise BadInput when the campaign was flown with another unit than ``unit``, or another build of it."""
        was = _read(self.path / CAMPAIGN).get("unit")
        if was is None and unit is not None:
            raise BadInput(f"{self.path}: was flown without a unit under test")
        if was is not None and (unit is None or unit.build() != was.get("sha256")):
            given = "give its file by --unit" if unit is None else f"{unit.source} is another build"
            raise BadInput(f"{self.path}: was flown with the unit under test {was.get('name')!r}: {given}")

    @contextmanager
    def held(self) -> Iterator[None]:
        """Make the folder when there is none, and hold it alone; before and after, what was half written is removed."""
        with locked(self.path):
            self._sweep()
            if not is_file(self.path / CAMPAIGN):
                write_whole(self.path / CAMPAIGN, sealed.to_json(self.about()))
            yield
            self._sweep()  # a worker that died leaves its draft

    def _sweep(self) -> None:
        """Remove drafts, and files of parts whose ``runs`` is not there; nothing else, and nothing behind a link."""
        sweep(self.path, *([CAMPAIGN, *BESIDE_RUNS] if is_file(self.path / CAMPAIGN) else []))
        whole = set(parts.names(self.path))
        for name in (*TABLES, "logs"):
            folder = self.path / name
            if folder.is_symlink() and name in TABLES:
                raise BadInput(f"{folder}: is a link: a campaign's tables are folders of its own")
            for path in folder.glob("*"):
                half = path.suffix in (DRAFT, ".tmp")
                orphan = name in TABLES and path.suffix == ".parquet" and path.stem not in whole
                if (half or orphan) and not path.is_dir():
                    path.unlink()

    def done(self) -> set[int]:
        """Return the runs that are whole in all tables. BadInput names a part that is not, and the remedy."""
        return set(self.read()["runs"]["run"].to_list())

    def read(self) -> dict[str, pl.DataFrame]:
        """Read all tables as they are now; BadInput as ``done``."""
        return parts.read(self.path, self.plan, self._identity)

    @cached_property
    def _identity(self) -> str | None:
        """Return what the parts of this campaign are marked with; None where they have no checksum."""
        about = _read(self.path / CAMPAIGN)
        if about["format"] == _UNSEALED:
            note(f"{self.path}: was flown by an earlier version of the rig: its tables have no checksum")
            return None
        return sealed.identity(json.dumps(about, sort_keys=True).encode())

    def write(self, rows: Rows) -> None:
        """Write one part: all tables, ``runs`` last. RigError when the disk does not take it."""
        name = f"{parts.name_of([row['run'] for row in rows['runs']])}.parquet"
        for kind in sorted(TABLES, key=lambda kind: kind == "runs"):
            place = f"{self._identity} {kind}/{name}"
            write_whole(self.path / kind / name, sealed.table(table.frame(self.plan, kind, rows[kind]), place))

    @cached_property
    def tables(self) -> dict[str, pl.DataFrame]:
        """Read all tables, sorted by run; a part whose ``runs`` is missing does not count. BadInput as ``done``."""
        return self.read()

    def status(self) -> dict[str, Any]:
        """Return how far the campaign is: runs, what is done, the result, the hash of the tables so far."""
        runs = self.tables["runs"]
        return {
            "folder": str(self.path),
            "title": self.plan.campaign.title,
            "runs": len(self.plan),
            "done": int((runs["outcome"] == "flown").sum()),
            "outcomes": dict(runs["outcome"].value_counts().iter_rows()),
            "aircraft_lost": int((~runs["survived"].fill_null(value=True)).sum()),
            "logs": sum(1 for _ in self.logs.glob("*.mcap")),
            "table_sha256": table.sha256(self.tables),
        }


def open_folder(path: Path, allow_code: bool = False) -> Folder:
    """Open the campaign in a folder. BadInput when there is none.

    allow_code : a manager class that it names may be run
    """
    file = path / CAMPAIGN
    if not is_file(file):
        raise BadInput(f"{path}: not a campaign's folder: {CAMPAIGN} is missing")
    held, trust = _read(file), Trust(str(file), allow_code)
    plan: Plan = Plan(from_what(held["campaign"], str(file)), str(file), trust)
    search = held.get("search")
    if search is not None:
        plan = SearchedPlan(plan.campaign, str(file), trust, search)
    folder = Folder(path, plan)
    if isinstance(plan, SearchedPlan):
        plan.choose(folder.tables["runs"])
    return folder


def _read(path: Path) -> dict[str, Any]:
    """Read ``campaign.json``; BadInput when it is nothing of ours."""
    content = sealed.read_json(path, _REMEDY, formats=(_FORMAT, _UNSEALED))
    if not isinstance(content.get("campaign"), dict):
        raise BadInput(f"{path}: is damaged: it has no table 'campaign'; {_REMEDY}")
    return content


def write_whole(path: Path, data: bytes) -> None:
    """Write beside, onto the disk, and rename: after any interruption all of it is there or nothing.  RigError."""
    try:
        with reported(path):
            path.parent.mkdir(exist_ok=True)
            with replaced(path) as draft, draft.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
    except BadInput as error:
        raise RigError(str(error)) from None


def difference(was: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return what two identities differ in, a line each."""
    before, after = dict(_flat(was)), dict(_flat(now))
    return [
        f"{key} was {_shown(before, key)}, is {_shown(after, key)}"
        for key in sorted({*before, *after})
        if before.get(key, _NOTHING) != after.get(key, _NOTHING)
    ]


_NOTHING: Final = object()


def _shown(flat: dict[str, Any], key: str) -> str:
    return json.dumps(flat[key]) if key in flat else "not there"


def _flat(data: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every leaf of plain data with its dotted key."""
    if isinstance(data, dict | list):
        items = data.items() if isinstance(data, dict) else enumerate(data)
        for key, value in items:
            yield from _flat(value, f"{above}.{key}" if above else str(key))
    else:
        yield above, data


@contextmanager
def locked(folder: Path, who: str = "rig campaign run is flying") -> Iterator[None]:
    """Make the folder and hold its file ``lock``, which is not written to, and not followed when it is a link.

    who : holds it, in the words of a message to another
    The system releases the lock of a process that ends, whatever ends it.
    BadInput: another process holds the lock, it is a link, or the folder is not writable.
    """
    file = _opened(folder, folder / LOCK)
    try:
        try:
            _lock(file, hold=True)
            now = (folder / LOCK).lstat()
        except OSError:  # held by another, or removed since
            raise BadInput(f"--out {folder}: another {who} into it") from None
        if not os.path.samestat(now, os.fstat(file)):  # another has removed it, and a third has made a new one
            raise BadInput(f"--out {folder}: another {who} into it")
        try:
            yield
        finally:
            _lock(file, hold=False)
    finally:
        os.close(file)


def _opened(folder: Path, path: Path) -> int:
    """Return a descriptor of the lock file; BadInput as ``locked``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_symlink():  # made a link since: O_NOFOLLOW, where the system has it
            return os.open(path, _FLAGS, 0o666)
    except OSError as error:
        raise BadInput(f"--out {folder}: cannot be written: {error.strerror}") from None
    raise BadInput(f"{path}: is a link, and is not followed: remove it")


def _lock(file: int, hold: bool) -> None:
    """Lock the file for this descriptor, at once or not at all, or unlock it. OSError: somebody holds it.

    Closing the descriptor unlocks it too, but on Windows only some time later.
    """
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK if hold else msvcrt.LK_UNLCK, 1)  # the first byte, which need not be there
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if hold else fcntl.LOCK_UN)
