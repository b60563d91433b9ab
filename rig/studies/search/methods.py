"""The methods of a search by their names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.text import quoted
from rig.studies.search.cma_es import cma
from rig.studies.search.regions import forest_version, regions
from rig.studies.search.rounds import Schedule, at_random

METHODS: Final[dict[str, Callable[..., Schedule]]] = {"regions": regions, "cma": cma, "random": at_random}


def require_method(name: str) -> None:
    """Raise BadInput for a name that is no method's."""
    if name not in METHODS:
        raise BadInput(f"--method {quoted(name)}: must be one of {', '.join(METHODS)}")


def decides(name: str) -> dict[str, Any]:
    """Return what decides the draws of a method beside its arguments, for the identity of a search."""
    return {"forest": forest_version()} if name == "regions" else {}
