"""How far a campaign is."""

from __future__ import annotations

from typing import Any

from rig.campaign import table
from rig.campaign.folder import Folder


def status(folder: Folder) -> dict[str, Any]:
    """Runs, what is done, the result, the hash of the tables so far."""
    runs = folder.tables["runs"]
    counts = dict(runs["outcome"].value_counts().iter_rows()) if len(runs) else {}
    return {
        "folder": str(folder.path),
        "title": folder.plan.campaign.title,
        "runs": len(folder.plan),
        "done": len(runs),
        "outcomes": counts,
        "aircraft_lost": int((~runs["survived"].fill_null(value=True)).sum()) if len(runs) else 0,
        "logs": sum(1 for _ in folder.logs.glob("*.mcap")),
        "table_sha256": table.sha256(folder.tables),
    }
