"""Compute results from flown campaigns and a rates file, and list their assumptions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import polars as pl

from rig.core.errors import BadInput
from rig.studies.reliability.campaign_cells import cells
from rig.studies.reliability.per_hour import Result, cases, results
from rig.studies.reliability.rates_file import Rates, SignalRates
from rig.studies.reliability.tally import Cells, together


def run(
    folders: Sequence[Path], rates: Rates, name: str, channels: Sequence[int], hours: float, checks: int
) -> list[Result]:
    """Return the results of every manager in ``folders``, campaigns or trials, for the signal ``name``.

    Folders of the same manager are added up.  BadInput names the missing folder, signal or cell.
    """
    given = rates.signals[name]
    chosen = cases(given, channels, hours, checks)
    source = ", ".join(map(str, folders))
    of_all: list[Result] = []
    for manager, parts in by_manager(folders).items():
        whole = together(manager, parts)
        require(whole, name, max(channels), given, source)
        of_all += results(whole, name, given, chosen, rates.layers)
    return of_all


def by_manager(folders: Sequence[Path]) -> dict[str, list[Cells]]:
    """Read the counts of all folders, by manager, in the order given."""
    counts: dict[str, list[Cells]] = {}
    for of_folder in map(cells, folders):
        counts.setdefault(of_folder.manager, []).append(of_folder)
    return counts


def require(whole: Cells, signal: str, channels: int, given: SignalRates, source: str) -> None:
    """Raise BadInput if the counts lack a cell that the chain needs."""
    here = whole.counts.filter(pl.col("signal") == signal)
    if here.is_empty():
        signals = ", ".join(sorted(set(whole.counts["signal"])))
        raise BadInput(f"{source}: {whole.manager}: no trial of {signal}; flown signals: {signals}")
    flown = {(str(design), int(good)) for design, good in here.select("design", "good_before").iter_rows()}
    needed = [("single", good) for good in range(channels, 0, -1)]
    if any(beta > 0.0 for beta in given.beta):
        needed += [("alike", good) for good in range(channels, 1, -1)]
    for design, good in needed:
        if (design, good) not in flown:
            raise BadInput(
                f"{source}: {whole.manager}: no {design} fault of {signal} with {good} good channels was flown"
            )


def assumptions(rates: Rates, name: str, results: Sequence[Result]) -> list[str]:
    """Return the conditions under which the numbers are valid, one line each."""
    given = rates.signals[name]
    rate = " or ".join(f"{rate:g}" for rate in given.per_hour)
    beta = " or ".join(f"{100 * beta:g} %" for beta in given.beta)
    kinds = ", ".join(f"{kind} {100 * share:g} %" for kind, share in given.kinds.items())
    lines = [
        f"a channel fails {rate} times an hour ({given.source})",
        f"kinds of faults: {kinds} ({given.kinds_source})",
        f"common mode: {beta} of the faults hit two channels alike ({given.beta_source}); all others are independent",
        _false_isolations(given),
        _manoeuvres(given),
        f"the result covers one signal, {name}; software, power and wiring are not included",
        "aircraft, flight points, manoeuvres and fault sizes are those of the campaign",
        "detected faults are repaired before the next flight; undetected faults remain until a full check",
    ]
    lines += [f"layer {layer.name}: coverages are given, not measured ({layer.source})" for layer in rates.layers]
    for manager in dict.fromkeys(result.manager for result in results):
        of_manager = (result for result in results if result.manager == manager)
        unreached = list(dict.fromkeys(cell for result in of_manager for cell in result.unreached))
        if unreached:
            lines.append(
                f"{manager}: some faults of {'; '.join(unreached)} never began, because earlier faults had lost the "
                "signal or the aircraft; they count as undetected errors"
            )
    if any("lost_aircraft" not in result.estimates for result in results):
        lines.append("the loss of the aircraft is not computed: the trials were open loop")
    return lines


def _manoeuvres(given: SignalRates) -> str:
    if given.manoeuvre_every_h is None:
        return "assumed: no manoeuvre is flown between two faults of a flight, and one is flown after them"
    return f"a manoeuvre every {given.manoeuvre_every_h:g} h reveals stuck channels ({given.manoeuvre_source})"


def _false_isolations(given: SignalRates) -> str:
    if given.false_isolations_per_channel_hour is None:
        return "false isolations are as frequent as in the campaign, which has few hours below level 4"
    return (
        f"false isolations: {given.false_isolations_per_channel_hour:g} per channel hour "
        f"({given.false_isolations_source})"
    )
