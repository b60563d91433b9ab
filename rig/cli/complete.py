"""What the shell completes: names of scenarios, aircraft, kinds of faults, campaigns, tabs, and keys of ``--set``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

_SETS: Final = ("aircraft=", "duration_s=", "redundancy.manager=", "turbulence=", "faults=[]", "seed=")


def _begin(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def scenarios(incomplete: str) -> list[str]:
    """Bundled scenarios."""
    from rig.scenario import names

    return _begin(names(), incomplete)


def aircraft(incomplete: str) -> list[str]:
    """Bundled aircraft."""
    from rig.aircraft import names

    return _begin(names(), incomplete)


def kinds(incomplete: str) -> list[str]:
    """Kinds of faults."""
    from rig.faults.catalogue import entries

    return _begin((entry.kind for entry in entries()), incomplete)


def campaigns(incomplete: str) -> list[str]:
    """Bundled campaigns."""
    from rig.campaign.config import names

    return _begin(names(), incomplete)


def tabs(incomplete: str) -> list[str]:
    """Tabs of ``rig view``."""
    from rig.view.blueprint import TABS

    return _begin(TABS, incomplete)


def sets(incomplete: str) -> list[str]:
    """Keys of ``--set`` that are changed the most, and the values of those that have names."""
    from rig.aircraft import names
    from rig.computer.redundancy.managers import MANAGERS

    values = {"aircraft=": names(), "redundancy.manager=": MANAGERS}
    for key, known in values.items():
        if incomplete.startswith(key):
            return _begin((f"{key}{value}" for value in known), incomplete)
    return _begin(_SETS, incomplete)
