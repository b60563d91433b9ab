"""The report of a design: one JSON object, and the notes at the head of OUT."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rig.studies.thresholds.data import Data
from rig.studies.thresholds.data_check import SHARE
from rig.studies.thresholds.design import Design, Grid, rounded_up
from rig.studies.thresholds.design_signals import MARKED, RULE, Signal, extrapolation
from rig.studies.thresholds.holdout import Count, total
from rig.studies.thresholds.slow_test_delays import DRIFT, OFFSETS, Delays
from rig.studies.thresholds.slow_test_factors import SlowDesign
from rig.studies.thresholds.tradeoff import Tradeoff

SLOW_FAULTS: Final = ("slow_allowance", "slow_limit", "stale_frames")  # None: off


def summary(data: Data, grid: Grid, signals: Mapping[str, Signal]) -> dict[str, Any]:
    """Return all results as plain data."""
    counts = {name: signal.held_out for name, signal in signals.items() if signal.held_out}
    overall = total(counts)
    return {
        "budget_per_h": grid.budget_per_h,
        "flights": len(data.names),
        "hours": data.hours,
        "rate_hz": data.rate_hz,
        "rule": RULE,
        "signals": {name: _signal(signal, grid.budget_per_h) for name, signal in signals.items()},
        "hold_out": None if overall is None else _count(overall),
        "notes": notes(data, grid, signals),
    }


def notes(data: Data, grid: Grid, signals: Mapping[str, Signal]) -> list[str]:
    """List all notes, a line each; a note that several signals share stands once."""
    lines = list(data.notes)
    factor = extrapolation(grid.budget_per_h, data.hours)
    if factor > MARKED:
        lines.append(
            f"one event at this rate takes {factor:.3g} times the {data.hours:.3g} h of data (marked *; above "
            f"{MARKED:g}, the data do not support the tail); record {1.0 / (MARKED * grid.budget_per_h):.3g} h or more"
        )
    own = [note for signal in signals.values() for note in signal.notes]
    shared: dict[str, list[str]] = {}
    for note in own:
        name, _, text = note.partition(": ")
        shared.setdefault(text if name in signals else note, []).append(name if name in signals else "")
    return lines + [f"{', '.join(names)}: {text}" if any(names) else text for text, names in shared.items()]


def _signal(signal: Signal, budget_per_h: float) -> dict[str, Any]:
    tradeoffs = [_tradeoff(tradeoff) for tradeoff in signal.found] or [None] * len(signal.designs)
    return {
        "unit": signal.settings.unit,
        "flights": signal.flights,
        "hours": signal.hours,
        "left_out": [suspect._asdict() for suspect in signal.left_out],
        "motion": {**signal.motion._asdict(), "still": signal.motion.still},
        "chosen": None if signal.design is None else signal.design.keys(),
        "designs": [
            {**_design(design, budget_per_h, signal.hours), "tradeoff": tradeoff}
            for design, tradeoff in zip(signal.designs, tradeoffs, strict=True)
        ],
        "hold_out": {str(level): _count(count) for level, count in (signal.held_out or {}).items()},
        "slow_tests": None if signal.slow_tests is None else of_slow_tests(signal.slow_tests),
    }


def of_slow_tests(tests: SlowDesign) -> dict[str, Any]:
    """Return the design of slow-fault tests: keys, largest shares with reserves, and delays by size in thresholds."""
    return {
        "keys": tests.keys,
        "largest": tests.shares,
        "reserve": tests.reserves,
        "held_out_beyond": tests.beyond,
        "flights": tests.flights,
        "noise": tests.noise,
        **_delays(tests.delays),
        "allowance": tests.allowance,
        "in_motion": _delays(tests.in_motion),
    }


def _delays(of: Delays) -> dict[str, Any]:
    offsets = {f"{size:g}": delay_s for size, delay_s in zip(OFFSETS, of.offsets, strict=True)}
    return {
        "delay_s": {"offset": offsets, "drift": of.drift, "drift_per_s": DRIFT},
        "smallest_offset": of.smallest,
    }


def _design(design: Design, budget_per_h: float, hours: float) -> dict[str, Any]:
    fields, keys = ("upper", "point", "clusters", "shape"), design.keys()
    levels = {
        str(level): {"threshold": rounded_up(of.upper), **{name: getattr(of, name) for name in fields}}
        for level, of in design.thresholds.items()
    }
    return {
        "filter_s": design.filter_s,
        "persistence": design.persistence,
        "split_persistence": design.in_split,
        "kept": design.kept,
        **{key: keys.get(key) for key in SLOW_FAULTS},
        "extrapolation": extrapolation(budget_per_h, hours),
        "levels": levels,
    }


def _tradeoff(tradeoff: Tradeoff) -> dict[str, Any]:
    return {
        "smallest_offset": tradeoff.smallest_offset,
        "at_twice_the_threshold": tradeoff.at_twice._asdict(),
        "faults": {name: of_kind._asdict() for name, of_kind in {**tradeoff.kinds, **tradeoff.small}.items()},
        "correctly_isolated": tradeoff.share,
    }


def _count(of: Count) -> dict[str, Any]:
    return {"counted": of.counted, "expected": of.expected, "hours": of.hours, "significantly_over": of.over}


def remarks(data: Data, grid: Grid, signals: Mapping[str, Signal]) -> list[str]:
    """Return the head of OUT: how it was made, and for which motion it is valid."""
    lines = [
        f"Thresholds by rig thresholds: {grid.budget_per_h:g} false isolations an hour and signal, "
        f"from {data.hours:.4g} h in {len(data.names)} recordings (docs/explanation/thresholds.md).",
        "Thresholds, persistence and filter are kept." if grid.kept else f"Persistence and filter: {RULE}.",
        f"Valid only for data no more dynamic than the design data ({100 * SHARE:g} % of the rows):",
    ]
    for name, signal in signals.items():
        motion = signal.motion
        if signal.design is not None:
            unit = f" {signal.settings.unit}" if signal.settings.unit else ""
            lines.append(f"motion {name}: {motion.value:.4g}{unit} from its median, {motion.rate_per_s:.4g} a second")
    return lines + [f"note {line}" for line in notes(data, grid, signals)]
