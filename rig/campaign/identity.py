"""Which rig flies: the packages and the sources that decide a row."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from rig.util.versions import versions

# What looks at flights, or hands them out, decides nothing in them.
ROOMS = ("bench", "campaign", "cli", "design", "public", "recordings", "reliability", "replay", "studies", "view")
BESIDE = (*ROOMS, "flight/frame_cost.py", "__main__.py", "faults/catalogue.py")
FLIES = ("campaign/flying.py", "campaign/rows.py")


@cache
def rig_identity() -> str:
    """Versions and a hash of the sources, as one line."""
    home = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(home.rglob("*.py")):
        name = path.relative_to(home).as_posix()
        if name in FLIES or not (name in BESIDE or name.partition("/")[0] in BESIDE):
            digest.update(f"{name}\0".encode() + path.read_bytes())
    packages = ", ".join(
        f"{name} {versions()[f'version {name}']}" for name in ("jsbsim-rig", "jsbsim", "numpy", "numba")
    )
    return f"{packages}, sources {digest.hexdigest()[:16]}"
