"""``rig thresholds``: design every signal from recordings and a false-isolation rate."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from rig.computer.redundancy.slow_tests_config import SlowTests, refusal
from rig.core.errors import BadInput
from rig.core.progress import tell
from rig.core.threads import cores, on_threads
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.data_check import Envelope, Suspect, envelope, suspects
from rig.studies.thresholds.design import EXACT, DataBlock, Design, Grid, Threshold, designs, with_sums
from rig.studies.thresholds.holdout import Count, holdout
from rig.studies.thresholds.pieces import four, parameters
from rig.studies.thresholds.residual_series import residuals
from rig.studies.thresholds.slow_fault_limits import LIMITS
from rig.studies.thresholds.slow_test_factors import (
    FACTORS,
    Measured,
    SlowDesign,
    bare_tests,
    keys_of,
    settled,
    slow_design,
    watched,
)
from rig.studies.thresholds.tail import CLUSTERS
from rig.studies.thresholds.tradeoff import Pieces, Tradeoff, pieces, ranked, tradeoff

RULE: Final = (
    "isolates most injected faults, and meets the rate on held-out flights; ties: shorter persistence, then shorter "
    "filter, then no sums"
)
MARKED: Final = 100.0  # extrapolation from which a design is marked
FEW: Final = 9  # flights below which budgets did not hold
WEAK: Final = 0.5  # share of the injected faults below which a design is told to be weak
STRETCHES: Final = 16  # that a single flight is cut into
_SHORTEST_S: Final = 10.0  # of a stretch


@dataclass(frozen=True, slots=True)
class Signal:
    """The designs of one signal; ``chosen`` is the place in ``designs``, None if no design is possible."""

    settings: RecordedSignal
    flights: int
    hours: float
    left_out: list[Suspect]
    motion: Envelope
    designs: list[Design] = field(default_factory=list)
    found: list[Tradeoff] = field(default_factory=list)
    chosen: int | None = None
    held_out: dict[int, Count] | None = None
    notes: list[str] = field(default_factory=list)
    slow_tests: SlowDesign | None = None
    without_tests: bool = False  # those of CONFIG do not fit the design

    @property
    def design(self) -> Design | None:
        """Return the chosen design."""
        return None if self.chosen is None else self.designs[self.chosen]

    def in_unit(self) -> Signal:
        """Return the signal with every amount in the unit of CONFIG instead of SI."""
        shown = self.settings.shown

        def in_unit(thresholds: dict[int, Threshold]) -> dict[int, Threshold]:
            return {
                level: replace(
                    threshold,
                    upper=shown(threshold.upper),
                    point=shown(threshold.point),
                    tail=None if threshold.tail is None else threshold.tail.in_unit(shown),
                )
                for level, threshold in thresholds.items()
            }

        designs = [
            replace(
                design,
                thresholds=in_unit(design.thresholds),
                slow_faults={
                    key: shown(value) if value and key != EXACT else value for key, value in design.slow_faults.items()
                },
            )
            for design in self.designs
        ]
        tradeoffs = [
            replace(
                tradeoff, smallest_offset=None if tradeoff.smallest_offset is None else shown(tradeoff.smallest_offset)
            )
            for tradeoff in self.found
        ]
        settings, motion = self.settings.scaled(1.0 / self.settings.scale), self.motion.in_unit(self.settings.scale)
        tests = None if self.slow_tests is None else self.slow_tests.in_unit(self.settings.scale)
        return replace(self, settings=settings, motion=motion, designs=designs, found=tradeoffs, slow_tests=tests)


def design(data: Data, grid: Grid, keep: bool = False, slow_tests: bool = False) -> dict[str, Signal]:
    """Design every signal. BadInput: no signal can be designed, or tests are asked for and no noise is stated.

    keep : keep flights with a channel that stands out; slow_tests : also design the slow-fault tests
    """
    if slow_tests and not data.slow_tests:
        raise BadInput(
            f"--slow-tests: no signal states slow_tests.noise_std, the noise of a sample; give it in CONFIG for "
            f"{', '.join(data.signals)}"
        )
    names, signals = list(data.signals), dict[str, Signal]()
    work = on_threads(names, lambda name: of_signal(name, data, grid, keep, slow_tests), cores())
    with closing(work) as results:
        for name, made in zip(names, results, strict=True):
            signals[name] = made
            tell(f"designed {name}", len(signals), len(names))
    if all(signal.chosen is None for signal in signals.values()):
        raise BadInput(next(note for signal in signals.values() for note in signal.notes[::-1]))
    return signals


def of_signal(name: str, data: Data, grid: Grid, keep: bool, slow_tests: bool = False) -> Signal:
    """Design one signal of the data; slow_tests : also its slow-fault tests, if the data state the noise of a sample.

    The tests are on in the trade-off and in the hold-out, and the sums add up their residuals.
    """
    figures = data.slow_tests.get(name)
    made = _designed(name, data, grid, keep, figures if slow_tests else None)
    if (chosen := made.design) is None:
        return made
    if figures is None and slow_tests:
        why = "no slow-fault tests: CONFIG states no slow_tests.noise_std, the noise of a sample"
        return replace(made, notes=[*made.notes, f"{name}: {why}"])
    if figures is None:
        return made
    settings = chosen.settings(made.settings)
    if why := _refused(figures, settings):
        return _without_tests(name, _designed(name, data, grid, keep, None) if slow_tests else made, why)
    if not slow_tests:
        return made
    left_out = set() if keep else {suspect.flight for suspect in made.left_out}
    flights = [flight for f, flight in enumerate(data.signals[name]) if f not in left_out]
    measured, channels = _watched(flights, settings, figures, data.rate_hz), len(flights[0].samples)
    if measured is None or exceeds(made.held_out):
        without = _designed(name, data, grid, keep, None)
        if measured is None:
            return _without_tests(name, without, "no factors hold on the data that they follow from")
        if _counted(without) < _counted(made):
            return _without_tests(name, without, f"with them held-out flights have {_counted(made)} false isolations")
    tested = slow_design(measured, figures, (settings.threshold, channels), data.rate_hz)
    return replace(made, notes=[*made.notes, *(f"{name}: {note}" for note in tested.notes)], slow_tests=tested)


def _refused(figures: SlowTests, settings: RecordedSignal) -> str:
    """Return why the tests do not fit the thresholds, in the unit of CONFIG; "" if they do."""
    scale = settings.scale
    why = refusal(figures.scaled(1.0 / scale), settings.least_threshold / scale, None)
    return why.removeprefix("slow_tests: ")


def _without_tests(name: str, made: Signal, why: str) -> Signal:
    """Return the design with a note that it has no slow-fault tests, and those of CONFIG off."""
    return replace(made, notes=[*made.notes, f"{name}: no slow-fault tests: {why}"], without_tests=True)


def _counted(made: Signal) -> int:
    """Return the false isolations of held-out flights, at all levels."""
    return sum(count.counted for count in (made.held_out or {}).values())


def _watched(
    flights: Sequence[DataBlock], settings: RecordedSignal, figures: SlowTests, rate_hz: float
) -> list[Measured] | None:
    """Return what the tests show in the flights with factors that hold; None: none do."""
    (params,) = parameters(settings, len(flights[0].samples), rate_hz)

    def measure(factors: Mapping[str, float]) -> list[Measured]:
        tests = bare_tests(figures, factors)
        return [watched((four(flight.samples.T), flight.reference), params, tests) for flight in flights]

    return settled(measure, settings.threshold)


def _tested(flights: list[DataBlock], given: RecordedSignal, figures: SlowTests) -> RecordedSignal:
    """Return the settings with tests whose factors, which no threshold changes, hold; without a reference."""
    measured = _watched(flights, given, figures, flights[0].rate_hz)
    if measured is None:
        return given
    keys = keys_of(measured, given.threshold)
    tests = figures.model_copy(update={name: keys[name] for name in FACTORS})
    return given.model_copy(update={"slow_tests": tests})


def _designed(name: str, data: Data, grid: Grid, keep: bool, figures: SlowTests | None) -> Signal:
    """Return the design of a signal beside slow-fault tests of a sensor with these ``figures``; None: without tests."""
    flights, given = data.signals[name], data.settings[name]
    suspected = [
        suspect
        for suspect in suspects(flights, given.wraps, max(grid.persistence), given.scale)
        if flights[suspect.flight].name not in data.healthy
    ]
    left_out = {suspect.flight for suspect in suspected} if not keep else set()
    used = [flight for f, flight in enumerate(flights) if f not in left_out]
    notes = [_stands_out(name, flights[suspect.flight].name, suspect, keep) for suspect in suspected]
    motion, hours = envelope(used or flights, given.wraps), sum(flight.hours for flight in used)
    if not used:
        notes.append(_nothing_left(name, flights, suspected[0]))
        return Signal(given, 0, 0.0, suspected, motion, notes=notes)
    blocks = _blocks(name, used, notes)
    tested = given if figures is None else _tested(used, given, figures)
    made = designs(blocks, given, grid, zlib.crc32(name.encode()))
    if not made:
        notes.append(_nothing(name, used, hours, motion))
        return Signal(given, len(used), hours, suspected, motion, notes=notes)
    notes += _remarks(name, made, motion, grid.budget_per_h, hours)
    cut = pieces(used, given=tested)
    if cut is None:
        notes.append(f"{name}: flights are too short for the trade-off; the shortest persistence is chosen")
        return Signal(given, len(used), hours, suspected, motion, made, [], 0, None, notes)
    size = max(motion.value, motion.noise)
    tradeoffs = [tradeoff(cut, design, tested, size) for design in made]
    tried: dict[int, dict[int, Count] | None] = {}
    summed = _sums(blocks, tested, grid, zlib.crc32(name.encode()))
    for i in _in_order(made, tradeoffs, lambda i: summed(made[i]), cut, tested, size):
        tried[i] = holdout(blocks, tested, grid, made[i])
        if not exceeds(tried[i]):
            break
    chosen = next((i for i in tried if not exceeds(tried[i])), None)
    if chosen is None:
        chosen = next(i for i in tried if not made[i].spreads)
        what = "the thresholds that are kept" if grid.kept else "every design"
        notes.append(f"{name}: {what} exceeded the rate on held-out flights; record more flights")
    elif len(tried) > 1:
        what = f"{len(tried) - 1} design{'s' * (len(tried) > 2)} that isolate{'s' * (len(tried) == 2)} more faults"
        notes.append(f"{name}: {what} rejected: exceeded the rate on held-out flights")
    if (share := tradeoffs[chosen].share) < WEAK:
        notes.append(f"{name}: the design isolates only {100.0 * share:.0f} % of the injected faults")
    return Signal(given, len(used), hours, suspected, motion, made, tradeoffs, chosen, tried[chosen], notes)


def exceeds(held_out: dict[int, Count] | None) -> bool:
    """Return True if at any level the held-out flights have more false isolations than the rate allows."""
    return held_out is not None and any(count.over for count in held_out.values())


def _in_order(
    made: list[Design],
    tradeoffs: list[Tradeoff],
    summed: Callable[[int], list[Design]],
    cut: Pieces,
    given: RecordedSignal,
    size: float,
) -> Iterator[int]:
    """Yield the places of designs, the best first; before each, its variants with CUSUM that isolate more faults.

    Designs with CUSUM are added to ``made`` and ``tradeoffs`` when their turn comes.
    """
    for i in ranked(made, tradeoffs):
        begin = len(made)
        made += summed(i)
        tradeoffs += [tradeoff(cut, design, given, size) for design in made[begin:]]
        better = [k for k in range(begin, len(made)) if tradeoffs[k].share_with_small > tradeoffs[i].share_with_small]
        yield from sorted(better, key=lambda k: -tradeoffs[k].share_with_small)
        yield i


def _sums(
    flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, number: int
) -> Callable[[Design], list[Design]]:
    """Return a function of a design: with each CUSUM limit, if noise exceeds the channels' mean residuals of a flight.

    given : with the slow-fault tests, if there are some
    """
    if "slow" not in grid.slow_faults:
        return lambda design: []
    found = residuals([(flight.samples, flight.reference) for flight in flights], given, flights[0].rate_hz)
    return lambda design: with_sums(flights, given, design, found, LIMITS, grid, number) if found.noisy else []


def _blocks(name: str, flights: list[DataBlock], notes: list[str]) -> Sequence[DataBlock]:
    """Return the flights; a single flight is cut into parts, which differ less than flights do."""
    if len(flights) >= FEW:
        return flights
    if len(flights) > 1:
        notes.append(
            f"{name}: {len(flights)} flights; with fewer than {FEW}, rates were exceeded 2 to 4 times; record more"
        )
        return flights
    flight = flights[0]
    count = min(STRETCHES, int(flight.hours * 3600.0 / _SHORTEST_S))
    parts = ", too short to be split" if count < 2 else f": split into {count} parts, which differ less than flights do"
    notes.append(f"{name}: only one flight{parts}; record at least {FEW} flights")
    if count < 2:
        return flights
    return [DataBlock(flight.name, part, flight.rate_hz) for part in np.array_split(flight.samples, count, axis=1)]


def stands_out(name: str, flight: str, suspect: Suspect) -> str:
    """Return the words for a channel of a flight that stands out of a signal."""
    return f"{flight}: {name}.{suspect.channel} stands out: {suspect.why}"


def _stands_out(name: str, flight: str, suspect: Suspect, keep: bool) -> str:
    what = "kept as requested, which raises the thresholds" if keep else "the flight is left out for this signal"
    return f"{stands_out(name, flight, suspect)}; {what}"


def _nothing_left(name: str, flights: Sequence[DataBlock], suspect: Suspect) -> str:
    first = f"{flights[suspect.flight].name}: {name}.{suspect.channel}: {suspect.why}"
    correct = "unit or range in CONFIG, or --align" if "not valid" in suspect.why else "--align"
    return f"{name}: a channel stands out in every flight, first in {first}; correct it ({correct}) or leave it out"


def _nothing(name: str, flights: Sequence[DataBlock], hours: float, motion: Envelope) -> str:
    if motion.noise == 0.0:
        return f"{name}: the channels do not differ in {hours:.3g} h, so no threshold can be measured"
    return f"{name}: too few events in {hours:.3g} h of {len(flights)} flights; record more flights"


def _remarks(name: str, made: Sequence[Design], motion: Envelope, budget_per_h: float, hours: float) -> list[str]:
    """List the limits of the data behind a design of this signal."""
    lines: list[str] = []
    if made[0].kept:
        return lines
    clusters = [threshold.clusters for design in made for threshold in design.thresholds.values()]
    few = min(clusters)
    if few < CLUSTERS:
        lines.append(f"{name}: only {few} events, not {CLUSTERS} or more; the thresholds are rough; record more")
    if motion.still:
        lines.append(f"{name}: does not move; the thresholds are valid only at rest")
    if few <= budget_per_h * hours:
        lines.append(f"{name}: {budget_per_h:g} an hour is above the event rate of the data; lower the rate")
    return lines


def extrapolation(budget_per_h: float, hours: float) -> float:
    """Return how many times longer the data would have to be for one event at the rate."""
    return 1.0 / (budget_per_h * hours) if hours > 0 else float("inf")
