"""The flight that a conclusion is about: its scenario, its score, and how near its channels were to each other.

``agreement`` finds the frames in which a channel miscompared, and the channel nearest to it: why a monitor isolated
it or did not.  It is computed from the samples with the thresholds of the flight, as the cross-channel comparison sees
them when no low-pass is set before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import MANAGERS, manager_kind
from rig.core.blocks import cuts
from rig.core.frame import DISCRETES, INDEX, SIGNALS, SURFACES, Pattern, State
from rig.core.units.angles import differences
from rig.core.units.quantities import duration, unit_of_name
from rig.scenario.scenario import Scenario
from rig.verdict.score_records import FaultScore, Score
from rig.world.faults.places import number, site

Bools = NDArray[np.bool_]
_FEW: Final = 3  # signals that are listed by name
_UNIT_ENDS: Final = {"rad/s": "_rad_s", "rad": "_rad", "m/s2": "_m_s2", "m/s": "_m_s", "m": "_m"}


class Context(NamedTuple):
    """A scored flight."""

    scenario: Scenario
    score: Score

    @property
    def params(self) -> NDArray[np.void]:
        """(S,) config.PARAMS of its manager."""
        return self.score.evidence.params

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.scenario.rate_hz

    @property
    def decider(self) -> str:
        """Name the voter that isolates channels."""
        if self.score.evidence.by_unit:
            return "the unit under test"
        return f"the manager {self.scenario.redundancy.manager}"

    def compares(self, fault: FaultScore) -> bool:
        """Return True if channels were compared with each other, which can be done again."""
        own = not self.score.evidence.by_unit
        return fault.signal in INDEX and own and manager_kind(self.scenario.redundancy.manager).compares

    def isolates(self, signal: str) -> bool:
        """Return False if no channel of a signal is ever isolated, as by the mean."""
        own = signal in INDEX and not self.score.evidence.by_unit
        return not own or manager_kind(self.scenario.redundancy.manager).isolates

    @property
    def limit(self) -> str:
        """Name what an error of a channel is measured by: some managers have no isolation threshold."""
        manager = self.scenario.redundancy.manager
        without = not self.score.evidence.by_unit and manager in MANAGERS and not manager_kind(manager).has_threshold
        return "error limit" if without else "isolation threshold"

    def silent(self, signal: str) -> bool:
        """Return True if no channel of a signal ever had a state, as from a unit that returns surfaces alone."""
        return signal in self.score.evidence.silent

    def unit(self, fault: FaultScore) -> str:
        """Return the SI unit of a fault's errors; "" where they have none, as those of a discrete."""
        return error_unit(fault)

    def threshold(self, fault: FaultScore) -> float | None:
        """Return what the monitor of the fault's signal allows with all channels in use; None where no signal is."""
        if fault.signal not in INDEX:
            return None
        return float(self.params[INDEX[fault.signal]]["threshold"])


def error_unit(fault: FaultScore) -> str:
    """Return the SI unit of a fault's errors, that of its place; "" where they have none, as those of a discrete."""
    if fault.signal in INDEX:
        return SIGNALS[INDEX[fault.signal]].unit
    where = site(fault.signal)
    if where == "surface":
        return unit_of_name(SURFACES[number(fault.signal)]) or "1"
    if where == "inertial":
        return unit_of_name(fault.signal)
    return SIGNALS[number(fault.signal)].unit if where == "reference" else ""


def named(name: str) -> str:
    """Return a signal or a discrete as it is written: ``pitch rate``."""
    return name.replace("_", " ")


def place(name: str) -> str:
    """Return a place as it is written: ``actuator.elevator`` is the elevator servo, ``ccdl.A-B`` link A-B."""
    head, dot, rest = name.partition(".")
    if not dot:
        return named(name)
    quantity = rest.removesuffix(_UNIT_ENDS[unit_of_name(rest)]) if unit_of_name(rest) else rest
    return {
        "actuator": f"{named(rest)} servo",
        "surface": f"{named(rest)} surface",
        "hydraulics": f"hydraulic system {rest}",
        "bus": f"electrical bus {rest}",
        "ccdl": f"link {rest}" if "-" in rest else f"links from {rest}",
        "computer": "all computers" if rest == "all" else f"computer {rest}",
        "inertial": f"inertial unit, {named(quantity)}",
        "reference": f"reference of {named(rest)}",
    }.get(head, named(name))


def place_label(name: str, numbers_from_1: Sequence[int | None]) -> str:
    """Return a place with its channels: ``pitch rate, channels 3 and 4``."""
    numbers = sorted(number for number in numbers_from_1 if number is not None)
    return f"{place(name)}, {channels(numbers)}" if numbers else place(name)


def signals_label(names: Sequence[str], numbers_from_1: Sequence[int]) -> str:
    """Return several signals with the channels: ``all 19 signals, channel 2``, ``heading and 3 more, channel 2``."""
    if len(names) in (len(SIGNALS), len(SIGNALS) + len(DISCRETES)):
        label = f"all {len(names)} signals"
    elif len(names) > _FEW:
        label = f"{named(names[0])} and {len(names) - 1} more signals"
    else:
        label = listed([place(name) for name in names])
    return f"{label}, {channels([*numbers_from_1])}" if numbers_from_1 else label


def after(frames: int | None, rate_hz: float) -> str:
    """Return a delay: ``after 70 ms``; ``at once`` of none."""
    return f"after {duration(frames, rate_hz)}" if frames else "at once"


def listed(names: Sequence[str]) -> str:
    """Return names as people list them: ``elevator, aileron and rudder``; "" of none."""
    if not names:
        return ""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def channels(numbers_from_1: Sequence[int]) -> str:
    """Return several: ``channels 1 and 2``; ``no channel`` of none."""
    if not numbers_from_1:
        return "no channel"
    return f"channel{'s' if len(numbers_from_1) > 1 else ''} {listed([*map(str, numbers_from_1)])}"


class Agreement(NamedTuple):
    """One channel over m frames: ``alone``: near no other channel in use; the ``nearest`` one, its ``distance``.

    nearest : (m,) channel from 0, -1 where none can be compared; distance : (m,) unit of the signal, infinite there
    usable : (m,) it can be compared; out : (m,) it is isolated; many : (m,) usable channels; pattern : (m,)
    """

    alone: Bools
    nearest: NDArray[np.intp]
    distance: NDArray[np.float64]
    usable: Bools
    out: Bools
    many: NDArray[np.intp]
    pattern: NDArray[np.uint8]

    def of(self, frames: slice) -> Agreement:
        """Return that of some of the frames."""
        parts: list[Any] = [column[frames] for column in self]
        return Agreement(*parts)


def comparable(samples: NDArray[np.float64], valid: Bools, out: Bools, p: NDArray[np.void]) -> Bools:
    """Return whether each of ``samples`` can be compared; out : channels that were out in the row before.

    p : the signal's config.PARAMS
    """
    with np.errstate(invalid="ignore"):
        return valid & ~out & (samples >= p["low"]) & (samples <= p["high"])


def agreement(columns: NDArray[Any], c: int, first: int, end: int, p: NDArray[np.void]) -> Agreement:
    """Compare channel ``c`` (from 0) of a signal with the others in the frames ``first`` to ``end`` (excluded).

    columns : (n,) kept.COLUMNS of the signal; p : its config.PARAMS
    """
    samples, valid = columns["channels"][first:end], columns["valid"][first:end] != 0
    before = columns["state"][np.maximum(np.arange(first, end) - 1, 0)]  # failed in this frame: compared in it
    out = (before == State.FAILED) | (before == State.ABSENT)
    compared = comparable(samples, valid, out, p)
    off = np.abs(differences(samples, samples[:, c : c + 1], bool(p["wraps"])))
    off = np.where(compared & compared[:, c : c + 1], off, np.inf)
    off[:, c] = np.inf
    nearest = off.argmin(axis=1)
    distance = off[np.arange(len(off)), nearest]
    alone = ~compared[:, c] | ~(distance <= allowed(compared.sum(axis=1), p))
    nearest = np.where(np.isfinite(distance), nearest, -1)
    many, pattern = compared.sum(axis=1), columns["pattern"][first:end]
    return Agreement(alone, nearest, distance, compared[:, c], out[:, c], many, pattern)


def agreement_of(fault: FaultScore, context: Context, first: int, end: int) -> Agreement:
    """Compare the channel of ``fault`` with the others in the frames ``first`` to ``end`` (excluded), in blocks."""
    s, c = INDEX[fault.signal], (fault.channel or 1) - 1
    columns, p = context.score.evidence.columns, context.params[s]
    parts: list[Agreement] = []
    for part in cuts(end - first):
        begin = max(first + part.start - 1, 0)  # with the frame before
        kept = columns(s, begin, first + part.stop)
        parts.append(agreement(kept, c, first + part.start - begin, len(kept), p))
    return Agreement(*map(np.concatenate, zip(*parts, strict=True)))


def in_split(pattern: NDArray[np.uint8]) -> Bools:
    """Return where a Pattern has no majority."""
    return (pattern >= Pattern.P2_2) & (pattern <= Pattern.P1_1)


def allowed(compared: NDArray[np.intp], p: NDArray[np.void]) -> NDArray[np.float64]:
    """Return (m,) thresholds by the number of ``compared`` samples, unit of the signal; p : its config.PARAMS."""
    by_number = np.array([p["threshold_duplex"]] * 3 + [p["threshold_triplex"], p["threshold"]])
    return by_number[compared]


def longest_run(flags: Bools) -> int:
    """Return how many ``flags`` in a row are set, at most."""
    edges = np.flatnonzero(np.diff([False, *flags, False]))
    return int((edges[1::2] - edges[::2]).max(initial=0))
