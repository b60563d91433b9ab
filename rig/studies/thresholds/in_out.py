"""Read CONFIG, a configuration of ``rig vote`` with or without thresholds, and write OUT, or tables of a scenario.

OUT keeps everything else of CONFIG: mapping, ranges, discretes, resets, and signals that are not designed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import tomli_w

from rig.core.errors import BadInput
from rig.core.settings import in_frames, read_toml
from rig.core.text import plain
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig, read_config
from rig.studies.thresholds.design import Design
from rig.studies.thresholds.slow_test_factors import DESIGNED

PLACEHOLDER: Final = 1.0  # threshold of a CONFIG that names none: what is asked for is not needed to begin


def start(path: Path) -> tuple[VoteConfig, dict[str, Any]]:
    """Read CONFIG with a threshold for every signal, and its tables unchanged. BadInput as for ``rig vote``."""
    config, raw = read_config(path), read_toml(path)
    if config.default is None and not config.signal:
        raise BadInput(f"{path}: no signal to design; add [default] or [signal.<name>]")
    default = None if config.default is None else {"threshold": PLACEHOLDER, **config.default}
    signal = {name: table if default else {"threshold": PLACEHOLDER, **table} for name, table in config.signal.items()}
    return config.model_copy(update={"default": default, "signal": signal}), raw


def recorded_toml(
    raw: Mapping[str, Any],
    chosen: Mapping[str, Design],
    settings: Mapping[str, RecordedSignal],
    rate_hz: float,
    referenced: Iterable[str],
    remarks: Iterable[str],
    slow_tests: Mapping[str, Mapping[str, float] | None] = MappingProxyType({}),
) -> str:
    """Return OUT for ``rig vote``: ``raw`` with the designs ``chosen`` in the tables of their signals.

    slow_tests : designed keys of that table; other keys of it stay, the figures of the sensor among them; None: off

    Signals in ``referenced`` keep the threshold of their reference; its default is the threshold of the channels.
    """
    kept = any(design.kept for design in chosen.values())
    tables, replaced = dict(raw), {key for design in chosen.values() for key in design.slow_faults}
    if not kept:
        replaced.add("persistence_s")
    if (default := raw.get("default")) is not None:
        default = default if kept else _in_frames(default, rate_hz)
        tables["default"] = {key: value for key, value in default.items() if key not in replaced}
    signals = {name: dict(table) for name, table in raw.get("signal", {}).items()}
    for name, design in chosen.items():
        own = {key: value for key, value in signals.get(name, {}).items() if key not in replaced}
        before = {**tables.get("default", {}), **own}
        if kept and "threshold" not in before:
            raise BadInput(f"signal.{name}: --keep-thresholds needs a threshold in CONFIG")
        new = _new(design, settings[name])
        if not kept and name in referenced and "reference_threshold" not in before and "threshold" in before:
            new["reference_threshold"] = before["threshold"]
        if name in slow_tests:
            new["slow_tests"] = _tests(before.get("slow_tests"), slow_tests[name])
        signals[name] = {**own, **new}
    tables["signal"] = signals
    return _text(tables, remarks)


def scenario_toml(
    chosen: Mapping[str, Design],
    settings: Mapping[str, RecordedSignal],
    remarks: Iterable[str],
    slow_tests: Mapping[str, Mapping[str, float] | None] = MappingProxyType({}),
) -> str:
    """Return OUT for a scenario: tables ``[redundancy.signals.<name>]``."""
    signals: dict[str, Any] = {}
    for name, design in chosen.items():
        given = settings[name]
        signals[name] = _new(design, given)
        if not design.kept:
            signals[name]["reference_threshold"] = given.reference_threshold or given.threshold
        if name in slow_tests:
            signals[name]["slow_tests"] = _tests(None, slow_tests[name])
    return _text({"redundancy": {"signals": signals}}, remarks)


def _tests(given: Any, designed: Mapping[str, float] | None) -> dict[str, Any] | bool:
    """Return the table ``slow_tests`` of OUT: that ``given``, with the designed keys; False: off."""
    if designed is None:
        return False
    figures = {key: value for key, value in (given or {}).items() if key not in DESIGNED}
    return {**figures, **designed}


def _new(design: Design, given: RecordedSignal) -> dict[str, Any]:
    """Return the keys of a design; a split persistence that CONFIG gives does not change."""
    keys = dict(design.keys())
    if "split_persistence" in given.model_fields_set or given.split_persistence_s is not None:
        keys.pop("split_persistence")
    if design.slow_faults.get("stale_frames") == 0 and given.stale_frames:
        keys["stale_frames"] = 0  # the settings that the flights were flown with are not asked for any more
    return keys


def _in_frames(default: Mapping[str, Any], rate_hz: float) -> dict[str, Any]:
    """Return [default] with its persistence in rows: a signal's persistence in rows cannot stand beside seconds."""
    table = dict(default)
    if (seconds := table.pop("persistence_s", None)) is not None:
        table["persistence"] = in_frames(1, seconds, rate_hz)
    return table


def _text(tables: Mapping[str, Any], remarks: Iterable[str]) -> str:
    head = "".join(f"# {plain(' '.join(line.split()))}\n" for line in remarks)
    return f"{head}\n{tomli_w.dumps(tables)}"
