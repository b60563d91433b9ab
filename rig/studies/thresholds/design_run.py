"""Run one design from its options: read recordings, design thresholds, write OUT and the page."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from rig.core.files import draft, replaced, reported
from rig.core.outputs import require_apart, require_ending, require_page
from rig.log.recordings.alignment import AlignOptions
from rig.log.recordings.vote_config import VoteConfig, config_of
from rig.studies.thresholds import thresholds_page
from rig.studies.thresholds.data import Data, load, of_preset, of_scenario, recordings
from rig.studies.thresholds.data_check import beyond, envelope
from rig.studies.thresholds.design import Grid
from rig.studies.thresholds.design_report import remarks, summary
from rig.studies.thresholds.design_signals import Signal, design
from rig.studies.thresholds.in_out import recorded_toml, scenario_toml, start


@dataclass(frozen=True)
class Options:
    """The options of ``rig thresholds``."""

    inputs: list[Path]
    config: Path | None
    out: Path
    page: Path | None
    grid: Grid
    repair_time: bool
    align: AlignOptions | None
    keep: bool
    monitored: list[Path]
    slow_tests: bool = False


def run(options: Options) -> dict[str, Any]:
    """Read, design and write; return the summary and the seconds of each step."""
    page = options.page
    require_apart({"--out": options.out, "--plot": page}, [*options.inputs, options.config, *options.monitored])
    require_page("--plot", page)
    require_ending("--out", options.out, "a configuration", ".toml")
    with replaced(options.out) as part, draft(page) if page else nullcontext():  # the page can be written as well
        began = perf_counter()
        settings, raw = _settings(options)
        reading = (settings, str(options.config or options.inputs[0]), options.repair_time, options.align)
        data = load(options.inputs, *reading)
        read = perf_counter()
        made = design(data, options.grid, options.keep, options.slow_tests)
        signals = {name: each.in_unit() for name, each in made.items()}
        if options.monitored:
            _note_motion(data, signals, load(options.monitored, *reading))
        result = summary(data, options.grid, signals)
        with reported(options.out):
            part.write_text(_toml(options, raw, data, signals), encoding="utf-8", newline="\n")
        if page is not None:
            chosen = {name: each.threshold for name, signal in signals.items() if (each := signal.design) is not None}
            thresholds_page.write(page, result, chosen)
    return {"out": str(options.out), **result, "seconds": {"read": read - began, "design": perf_counter() - read}}


def _settings(options: Options) -> tuple[VoteConfig, dict[str, Any] | None]:
    """Return the settings to begin with, and the tables of CONFIG or of a preset; None: of a scenario."""
    if options.config is not None:
        return start(options.config)
    paths = recordings(options.inputs, VoteConfig())
    if (tables := of_preset(paths)) is not None:
        return config_of(tables, paths[0]), tables
    return of_scenario(paths, options.slow_tests), None


def _note_motion(data: Data, signals: Mapping[str, Signal], monitored: Data) -> None:
    """Add a note to ``data`` for each signal that moves more in the data to be ``monitored``."""
    motion = {
        name: envelope(flights, (given := monitored.settings[name]).wraps).in_unit(given.scale)
        for name, flights in monitored.signals.items()
    }
    data.notes.extend(beyond({name: signal.motion for name, signal in signals.items()}, motion))


def _toml(options: Options, raw: dict[str, Any] | None, data: Data, signals: Mapping[str, Signal]) -> str:
    """Return OUT: CONFIG with the thresholds, or without CONFIG the tables of a scenario."""
    chosen = {name: made for name, signal in signals.items() if (made := signal.design) is not None}
    settings = {name: signal.settings for name, signal in signals.items()}
    head = remarks(data, options.grid, signals)
    tests = {
        name: None if signal.slow_tests is None else signal.slow_tests.keys
        for name, signal in signals.items()
        if signal.slow_tests is not None or signal.without_tests
    }
    if raw is None:
        return scenario_toml(chosen, settings, head, tests)
    return recorded_toml(raw, chosen, settings, data.rate_hz, data.referenced, head, tests)
