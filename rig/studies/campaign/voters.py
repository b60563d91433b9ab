"""Who voted the flights of a campaign: managers, or a unit under test and its build."""

from __future__ import annotations

from rig.studies.campaign.folder import Folder
from rig.unit.unit_file import voted_by


def voters(folder: Folder) -> list[str]:
    """Return who voted the flights of a folder; of an older one the unit is that of ``campaign.json``.  BadInput."""
    unit = folder.kept.get("unit")
    managers = sorted(folder.tables["runs"]["manager"].drop_nulls().unique().to_list())
    if unit is None or any("unit " in name for name in managers):
        return managers
    return sorted({voted_by(name, unit) for name in managers or [""]})


def named(voters: list[str]) -> str:
    """Return voters as a line: ``manager mean, median``, ``unit mvs 0a1b2c3d4e5f``."""
    of_units = any("unit " in name for name in voters)
    return ", ".join(voters) if of_units or not voters else f"manager {', '.join(voters)}"
