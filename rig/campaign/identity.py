"""Which rig flies: the packages and the sources that decide a row."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import rig
from rig.versions import versions

# What looks at flights, or hands them out, decides nothing in them.
_BESIDE = ("campaign", "catalogue", "recorded", "view", "replay", "watch", "export", "study")
_FILES = ("cli.py", "show.py", "bench.py", "__main__.py")


@cache
def rig_identity() -> str:
    """Versions and a hash of the sources, as one line."""
    home = Path(rig.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(home.rglob("*.py")):
        name = path.relative_to(home)
        flies = name.parts[0] not in _BESIDE or name.parts[:2] in (("campaign", "flying.py"), ("campaign", "rows.py"))
        if flies and name.name not in _FILES:
            digest.update(f"{name}\0".encode() + path.read_bytes())
    packages = ", ".join(
        f"{name} {versions()[f'version {name}']}" for name in ("jsbsim-rig", "jsbsim", "numpy", "numba")
    )
    return f"{packages}, sources {digest.hexdigest()[:16]}"
