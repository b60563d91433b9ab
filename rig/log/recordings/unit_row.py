"""Units that a table gives in its second row, for the signals to which CONFIG gives none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS
from rig.core.text import quoted
from rig.core.units.conversion import conversion
from rig.log.recordings.vote_config import VoteConfig


class Stated(NamedTuple):
    """The units of signals, by name, and what is told of them."""

    units: dict[str, str]
    remarks: list[str]


def stated(path: str, units: Mapping[str, str], config: VoteConfig) -> Stated:
    """Return the units of the signals that ``units``, by column, give and CONFIG does not.

    A unit that is not known is told and not used.  BadInput: channels of a signal in several units.
    """
    of_signals: dict[str, dict[str, str]] = {}
    for column, unit in units.items():
        signal, _, channel = column.rpartition(".")
        if channel.isdecimal():
            of_signals.setdefault(signal, {})[column] = unit
    made = Stated({}, [])
    for signal, given in of_signals.items():
        own = {**(config.default or {}), **config.signal.get(signal, {})}
        if not own or signal in config.discrete:
            continue
        named = ", ".join(f"{column} in {unit}" for column, unit in given.items())
        if "unit" in own:
            if set(given.values()) != {own["unit"]}:
                made.remarks.append(f"{path}: row of units: {named}; the unit of CONFIG is taken, {own['unit']}")
            continue
        if len(set(given.values())) > 1:
            raise BadInput(f"{path}: row of units: {named}: a signal has one unit, which CONFIG can give")
        unit = next(iter(given.values()))
        try:
            conversion(unit, SIGNALS[INDEX[signal]].unit if signal in INDEX else None)
        except ValueError:
            made.remarks.append(f"{path}: row of units: {quoted(unit)} of {signal} is not used: not known for it")
            continue
        made.units[signal] = unit
        made.remarks.append(f"{path}: {signal} and its amounts in CONFIG are in {unit}, by the row of units")
    return made
