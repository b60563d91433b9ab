"""All kinds of hostile input, and a run's choice of cases: evenly over the kinds, the same for the same seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from hostile_cases import campaigns, configs, files, flags, folders, kernels, logs, readers, recordings, scenarios
from hostile_cases.case import Case, Draw
from hostile_cases.store import Store

KINDS: Final[dict[str, Callable[[Draw, Store], Case]]] = {
    "scenario": scenarios.scenario,
    "set": scenarios.overridden,
    "file": files.file,
    "aircraft": files.aircraft,
    "campaign": campaigns.campaign,
    "folder": folders.folder,
    "log": logs.log,
    "recording": recordings.recording,
    "config": configs.config,
    "flag": flags.flag,
    "trust": scenarios.trust,
    "kernel": kernels.kernel,
    "reader": readers.reader,
}


def chosen(store: Store, count: int, seed: int = 0, kinds: Sequence[str] = ()) -> list[Case]:
    """``count`` cases, the first of each kind and so on."""
    names = list(kinds) or list(KINDS)
    return [named(store, f"{names[i % len(names)]}/{seed}/{i // len(names)}") for i in range(count)]


def named(store: Store, name: str) -> Case:
    """The case of a name ``kind/seed/number``; ValueError when there is no such kind."""
    kind, seed, number = name.split("/")
    if kind not in KINDS:
        raise ValueError(f"no kind {kind!r}; there are: {', '.join(KINDS)}")
    return KINDS[kind](Draw(kind, int(seed), int(number)), store)
