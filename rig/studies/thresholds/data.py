"""Read all recordings of INPUT as flights of each signal, with the settings that the design starts from.

Each recording is one block, that is, one flight.  INPUT of ``rig thresholds`` may be

a file                                a table, an MCAP file (a flight log, or any file with a [mapping]), or the log of
                                      another system; the folder of a ROS 2 bag too
a folder with the sources of [mapping]  one recording made by several recorders
a folder of a campaign                the logs of the campaign
any other folder                      each file and each folder of sources in it, in the order of their names
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.computer.redundancy.manager_config import SignalConfig
from rig.computer.redundancy.managers import KINDS
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.errors import BadInput, BadLog
from rig.core.files import is_file, is_folder
from rig.core.frame import SIGNALS
from rig.core.outputs import CAMPAIGN
from rig.core.renamed import data_now
from rig.core.settings import build
from rig.log.recordings.alignment import AlignOptions, run_alignment
from rig.log.recordings.formats.known import is_log, open_log
from rig.log.recordings.formats.presets import config as preset_config
from rig.log.recordings.max_change import limited
from rig.log.recordings.read import ENDINGS
from rig.log.recordings.read import load as load_one
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig
from rig.log.scan import About, iter_parts
from rig.studies.thresholds.design import DataBlock
from rig.world.sensors import Suite, data_sheets

MANAGER: Final = next(kind.name for kind in KINDS if kind.compares)
SAME_RATE: Final = 0.02  # by which rates may differ
LOGS: Final = "logs"


@dataclass(frozen=True, slots=True)
class Data:
    """The flights of ``signals`` by name, one a recording; ``settings`` from CONFIG; ``notes``, a line each."""

    names: list[str]  # of the recordings
    rate_hz: float
    hours: float
    signals: dict[str, list[DataBlock]]
    settings: dict[str, RecordedSignal]
    referenced: set[str] = field(default_factory=set)  # signals with a reference in the recording
    notes: list[str] = field(default_factory=list)
    healthy: set[str] = field(default_factory=set)  # flights of scenarios without faults, in which no channel is faulty
    slow_tests: dict[str, SlowTests] = field(default_factory=dict)  # of CONFIG, figures of the sensors among them, SI


def load(
    inputs: Iterable[Path], config: VoteConfig, source: str, repair: bool = False, aligned: AlignOptions | None = None
) -> Data:
    """Read all inputs. BadInput in one line: no recording, a fault in a flight, or recordings that differ.

    Slow-fault tests of the settings stand apart: thresholds are designed without them.
    aligned : how each recording is aligned, as in ``rig vote``; None: not at all
    """
    paths = recordings(inputs, config)
    data: Data | None = None
    for path in paths:
        ours = without_faults(path)
        recording, settings = load_one(path, config, source, repair)
        settings = _monitored(settings, source)
        recording = limited(recording, settings)
        notes = [*recording.remarks, *recording.warnings]
        notes += [
            f"{repair.source}: dropped {repair.dropped} rows whose time repeats or is out of order"
            for repair in recording.repairs
        ]
        if aligned is not None:
            recording, _ = run_alignment(recording, settings, aligned, config.triads)
        if data is None:
            used = {name for name in settings if recording.signals[name].reference is not None}
            tested = {name: given.slow_tests for name, given in settings.items() if given.slow_tests is not None}
            untested = {name: given.model_copy(update={"slow_tests": None}) for name, given in settings.items()}
            flights: dict[str, list[DataBlock]] = {name: [] for name in settings}
            data = Data([], recording.rate_hz, 0.0, flights, untested, used, slow_tests=tested)
        _add(data, path, recording)
        data.notes.extend(notes)
        data.healthy.update({str(path)} if ours else ())
    assert data is not None
    hours = sum(flight.hours for flight in next(iter(data.signals.values())))
    return replace(data, hours=hours)


def _monitored(settings: dict[str, RecordedSignal], source: str) -> dict[str, RecordedSignal]:
    """Return the signals whose channels are compared with each other. BadInput: there is none."""
    kept = {name: chosen for name, chosen in settings.items() if chosen.manager == MANAGER}
    if not kept:
        raise BadInput(f'{source}: no signal has the manager "{MANAGER}"; no other manager has a threshold to design')
    return kept


def _add(data: Data, path: Path, recording: Recording) -> None:
    """Add one flight to every signal. BadInput: its rate or its channels differ."""
    rate = recording.rate_hz
    if abs(rate - data.rate_hz) > SAME_RATE * data.rate_hz:
        raise BadInput(
            f"{path}: {rate:.4g} rows a second, {data.names[0]} has {data.rate_hz:.4g}; "
            "persistence counts rows, so design each rate separately"
        )
    for name, flights in data.signals.items():
        if name not in recording.signals:
            raise BadInput(f"{path}: no signal {name!r}, but {data.names[0]} has one")
        samples = columns(recording.signals[name], data.settings[name])
        if flights and len(samples) != len(flights[0].samples):
            raise BadInput(f"{path}: {name} has {len(samples)} channels, {data.names[0]} has {len(flights[0].samples)}")
        flights.append(DataBlock(str(path), samples, data.rate_hz, recording.signals[name].reference))
    data.names.append(str(path))


def columns(samples: Samples, settings: RecordedSignal) -> Any:
    """Return the channels (C, n), NaN for each sample that the manager would not compare."""
    low, high = settings.limits
    values = np.array(samples.channels)
    good = (values >= low) & (values <= high)
    if samples.valid is not None:
        good &= np.array(samples.valid) != 0
    values[~good] = np.nan
    values[[c - 1 for c in settings.bad_from_start if c <= len(values)]] = np.nan
    return values


def without_faults(path: Path) -> bool:
    """Return True if the file is a flight log of rig. BadInput: its scenario has faults."""
    scenario = _scenario(path)
    if scenario.get("faults"):
        count = len(scenario["faults"])
        raise BadInput(
            f"{path}: the scenario has {count} fault{'s' * (count > 1)}; design on flights without (--set faults=[])"
        )
    return bool(scenario)


def _scenario(path: Path) -> dict[str, Any]:
    """Return the scenario of a flight log; empty for any other file."""
    about = About()
    if path.suffix == ".mcap":
        with suppress(BadLog, OSError, StopIteration):
            next(iter(iter_parts(path, about)))
    with suppress(ValueError, RecursionError):
        scenario = json.loads(about.metadata.get("scenario") or "{}")
        return data_now(scenario) if isinstance(scenario, dict) else {}
    return {}


def of_preset(paths: Sequence[Path]) -> dict[str, Any] | None:
    """Return the tables of CONFIG by the preset of the first recording; None: it is no log of another system."""
    log = open_log(paths[0]) if is_log(paths[0]) else None
    return None if log is None else preset_config(log.contents, paths[0])


def of_scenario(paths: Sequence[Path], slow_tests: bool = False) -> VoteConfig:
    """Return the settings of the first log's scenario, if all of INPUT is flight logs of rig.

    slow_tests : with the figures of the sensors in tables of that name; False: without such tables
    BadInput: a file is no flight log of rig, or another manager flew.
    """
    for path in paths:
        scenario = _scenario(path)
        redundancy = scenario.get("redundancy", {})
        if not redundancy.get("signals"):
            raise BadInput(f"{path}: not a flight log of rig; give the settings with --config, as for rig vote")
        if redundancy.get("manager", MANAGER) != MANAGER:
            raise BadInput(f"{path}: flown with the manager {redundancy['manager']}, which has no threshold to design")
    signals: dict[str, Any] = {}
    flown = _scenario(paths[0])
    for name, table in flown["redundancy"]["signals"].items():
        signals[name] = {
            key: value for key, value in table.items() if key in SignalConfig.model_fields and value is not None
        }
        signals[name].pop("split_persistence", None)  # resolved: always there, also if not given
        signals[name].pop("slow_tests", None)
    for name, figures in _figures(flown, str(paths[0])).items() if slow_tests else ():
        signals[name]["slow_tests"] = figures
    return VoteConfig(signal=signals)


def _figures(flown: dict[str, Any], source: str) -> dict[str, dict[str, float]]:
    """Return the figures of each sensor of a scenario that states its noise, as keys of ``slow_tests``."""
    suite = build(Suite, flown.get("sensors", {}), f"{source}: sensors")
    sheets = zip(SIGNALS, data_sheets(suite, float(flown["rate_hz"])), strict=True)
    return {signal.name: sheet._asdict() for signal, sheet in sheets if sheet.noise_std > 0.0}


def recordings(inputs: Iterable[Path], config: VoteConfig) -> list[Path]:
    """List the recordings of all inputs, each once. BadInput: an input does not exist, or a folder has none."""
    return list(dict.fromkeys(path for given in inputs for path in _of(given, config)))


def _of(given: Path, config: VoteConfig) -> list[Path]:
    try:
        if not is_folder(given) or _holds_sources(given, config) or is_log(given):
            return [given]
        campaign = is_file(given / CAMPAIGN)
        inside = sorted(_inside(given / LOGS if campaign else given, config), key=_by_number)
    except (OSError, ValueError) as error:
        raise BadInput(f"{given}: cannot be read: {getattr(error, 'strerror', error)}") from None
    if not inside and campaign:
        raise BadInput(f'{given}: the campaign kept no logs; fly it with logs = "all"')
    if not inside:
        wanted = f" nor a folder with {_first(config)}" if config.mapping else ""
        kinds = f"a file of type {', '.join(ENDINGS)}, nor a log of another system"
        raise BadInput(f"{given}: no recording found: neither {kinds}{wanted}")
    return inside


def _inside(folder: Path, config: VoteConfig) -> Iterator[Path]:
    for path in folder.iterdir() if is_folder(folder) else ():
        known = _holds_sources(path, config) if is_folder(path) else path.suffix in ENDINGS
        if known or is_log(path):
            yield path


def _holds_sources(folder: Path, config: VoteConfig) -> bool:
    """Return True if the first source of the mapping is a file in the folder."""
    return bool(config.mapping) and is_file(folder / _first(config))


def _first(config: VoteConfig) -> str:
    return next(iter(config.mapping.values())).rpartition(":")[0] or "the mapped table"


def _by_number(path: Path) -> tuple[list[int | str], str]:
    """Return a key that sorts path_2 before path_10."""
    parts = re.split(r"([0-9]+)", path.name)
    return [int(part) if part.isdecimal() and part.isascii() else part for part in parts], path.name
