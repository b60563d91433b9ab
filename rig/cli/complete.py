"""Completion by the shell: bundled names, kinds of faults, tabs, and keys of ``--set``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any, Final

_SETS: Final = ("aircraft=", "duration_s=", "redundancy.manager=", "turbulence=", "faults=[]", "seed=")


def _begin(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _completion(module: str, names: Callable[[Any], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes by ``names`` of a ``module``, which is imported when a shell asks."""

    def complete(incomplete: str) -> list[str]:
        return _begin(names(import_module(module)), incomplete)

    return complete


scenarios = _completion("rig.scenario.scenario", lambda module: module.names())
aircraft = _completion("rig.scenario.aircraft", lambda module: module.names())
campaigns = _completion("rig.studies.campaign.campaign_file", lambda module: module.names())
requirements = _completion("rig.verdict.requirements.requirement", lambda module: module.names())
kinds = _completion("rig.world.faults.fault_catalogue", lambda module: (entry.kind for entry in module.entries()))
tabs = _completion("rig.show.viewer.blueprint", lambda module: module.TABS)


def sets(incomplete: str) -> list[str]:
    """Return the keys of ``--set`` that are changed most often, and the values of those that have named values."""
    from rig.computer.redundancy.managers import MANAGERS
    from rig.scenario.aircraft import names

    values = {"aircraft=": names(), "redundancy.manager=": MANAGERS}
    for key, allowed in values.items():
        if incomplete.startswith(key):
            return _begin((f"{key}{value}" for value in allowed), incomplete)
    return _begin(_SETS, incomplete)
