"""The instances of each quantity: their samples as recorded, and on common rows, in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.findings import Instance
from rig.bench.diagnose.flight_votes import FlightVotes, of_asked, of_quantity
from rig.bench.vote_run import Asked, Options, read_asked
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.text import choices, quoted
from rig.core.units.angles import near, unwrapped
from rig.log.foreign import Source
from rig.log.recordings.formats.contents import LogContents, OpenLog
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.formats.presets import PRESETS
from rig.log.recordings.formats.presets import config as preset_config
from rig.log.recordings.join import joined, whole
from rig.log.recordings.recording import Recording
from rig.log.recordings.recording import Samples as Channels
from rig.log.recordings.stamps import Clock, Floats, clock, rows_a_second
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig, config_of, read_config

AXES: Final = "xyz"
_KINDS: Final = (("gyro", "rad/s", ("gyr", "omega")), ("accel", "m/s^2", ("acc",)))


class Samples(NamedTuple):
    """Samples of one channel as recorded, (m,) each."""

    time_s: Floats
    values: Floats


@dataclass(slots=True)
class Group:
    """The instances of one quantity: ``x`` (axes, C, n) on the common rows ``time_s`` (n,), NaN without a sample.

    own : by axis and channel, samples as recorded
    """

    name: str
    settings: dict[str, RecordedSignal]  # of each signal, an axis
    instances: tuple[Instance, ...]
    time_s: Floats
    x: Floats
    own: list[list[Samples]]
    remarks: list[str] = field(default_factory=list)
    votes: FlightVotes | None = None  # None: nothing is voted, as of copies

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the names of the signals, one for each axis."""
        return tuple(self.settings)

    @property
    def rate_hz(self) -> float:
        """Return the common rows a second."""
        return rows_a_second(self.time_s)

    @property
    def first(self) -> RecordedSignal:
        """Return the settings of the first signal; the axes of a vector share a unit."""
        return next(iter(self.settings.values()))

    @property
    def floor(self) -> float:
        """Return the difference from where on it matters: the smallest threshold of the axes, SI."""
        return min(own.threshold for own in self.settings.values())

    @property
    def kind(self) -> str:
        """Return "gyro" or "accel" for vectors of these, "vector" for another, "scalar"."""
        if len(self.settings) != len(AXES):
            return "scalar"
        for kind, si, names in _KINDS:
            if self.first.si == si or (not self.first.si and self.name.lower().startswith(names)):
                return kind
        return "vector"

    def shown(self, value: float) -> str:
        """Return an amount in the unit of the signal, as text."""
        return f"{self.first.shown(value):.3g} {self.first.unit or ''}".rstrip()


class Read(NamedTuple):
    """A recording as a diagnosis needs it."""

    groups: list[Group]
    threshold_of: str  # of what the thresholds are: the preset px4, the configuration
    remarks: list[str]
    warnings: list[str]
    refused: dict[str, str]  # quantities that have no common rows, and why


def read_groups(path: Path, config: Path | dict | None, preset: str | None) -> Read:
    """Return the instances of all quantities of a recording.

    BadInput: unreadable, an unknown preset, nothing to compare, settings that do not fit.
    """
    if preset is not None and preset not in PRESETS:
        raise BadInput(f"--preset: unknown preset {quoted(preset)}; {choices(preset, PRESETS)}")
    if preset is not None and config is not None:
        raise BadInput("--preset, --config: only one of them")
    log = open_log(path)
    if config is None and log is not None:
        tables = preset_config(log.contents, path, preset)
        name = f"preset {log.contents.preset}"
        return _of_log(path, log, config_of(tables, path), str(path), name)
    if config is not None and log is not None:
        settings = read_config(config) if isinstance(config, Path) else config_of(config, Path("config"))
        if _is_of(log.contents, settings):
            return _of_log(path, log, settings, str(config if isinstance(config, Path) else "config"), "configuration")
    asked = read_asked(path, config, Options(None, None, repair=True, preset=preset))
    of = "configuration" if asked.flown is None else "scenario of the flight"
    return _of_recording(asked, of)


def _is_of(contents: LogContents, settings: VoteConfig) -> bool:
    topics = {topic.name for topic in contents.topics}
    return bool(settings.mapping) and any(place.rpartition(":")[0] in topics for place in settings.mapping.values())


def _of_log(path: Path, log: OpenLog, config: VoteConfig, source: str, of: str) -> Read:
    """Return the groups of a log of another system, each on the rows of its own slowest instance."""
    places = _places(path, config)
    settings = config.signals(places, source)
    contents, sources = log.contents, _Sources(path, log)
    remarks = [f"{contents.format} log", *contents.remarks]
    made, refused = list[Group](), dict[str, str]()
    for name, signals in grouped(settings, config.triads).items():
        try:
            made.append(_joined_group(name, {s: settings[s] for s in signals}, places, sources, config))
        except BadInput as error:
            refused[name] = str(error)
    if not made:
        raise BadInput(next(iter(refused.values())))
    return Read(made, of, remarks, [*contents.damage, *sources.repairs()], refused)


def _places(path: Path, config: VoteConfig) -> dict[str, list[tuple[str, str]]]:
    """Return the topic and the field of each channel that votes, by signal.  BadInput: fewer than two."""
    found: dict[str, dict[int, tuple[str, str]]] = {}
    for column, place in config.mapping.items():
        signal, _, channel = column.rpartition(".")
        topic, _, field_name = place.rpartition(":")
        if channel.isdecimal() and not signal.endswith(".ilm"):
            found.setdefault(signal, {})[int(channel)] = topic, field_name
    return {
        signal: [channels[c] for c in _numbers(path, signal, sorted(channels), _chosen(path, config, signal))]
        for signal, channels in found.items()
    }


def _chosen(path: Path, config: VoteConfig, signal: str) -> list[int] | None:
    """Return the recorded channels that vote by CONFIG; None: all."""
    voting = config.voting(path)
    return voting.get(signal, voting.get(""))


def _numbers(path: Path, signal: str, there: list[int], chosen: list[int] | None) -> list[int]:
    """Return the channels that vote, of those that are ``there``: ``chosen``, or all.  BadInput."""
    if chosen is not None:
        if missing := [c for c in chosen if c not in there]:
            raise BadInput(f"{path}: signal.{signal}.channels: no channel {missing[0]} in [mapping]")
        return chosen
    if there != list(range(1, len(there) + 1)) or len(there) > CHANNELS:
        raise BadInput(f"[mapping] {signal}: channels must be 1 to {CHANNELS} without a gap")
    if len(there) < 2:
        raise BadInput(f"{path}: signal {quoted(signal)} has one channel: nothing to compare")
    return there


class _Sources:
    """The topics of a log, read as they are needed."""

    def __init__(self, path: Path, log: OpenLog) -> None:
        self.path, self.contents = path, log.contents
        self._log = log
        self._clocks: list[Clock] = []

    def read(self, wanted: Mapping[str, set[str]]) -> tuple[dict[str, Source], dict[str, Clock]]:
        """Return the fields ``wanted`` of topics, and their clocks without rows whose time steps back."""
        sources: dict[str, Source] = {}
        for name, fields in wanted.items():
            topic = self.contents.named(self.path, name)
            for missing in sorted(fields - set(topic.units)):
                raise BadInput(
                    f"{self.path}: topic {name!r} has no field {quoted(missing)}; {choices(missing, topic.units)}"
                )
            sources[name] = whole(f"{self.path}: {name}", self._log.source(topic, sorted(fields)))
        clocks = {name: clock(f"{self.path}: {name}", s.time_s, repair=True) for name, s in sources.items()}
        self._clocks += clocks.values()
        return sources, clocks

    def device(self, name: str) -> str:
        """Return the device id of a topic."""
        return self.contents.named(self.path, name).device

    def repairs(self) -> list[str]:
        """Return a line for each topic of which rows were dropped."""
        repairs = dict.fromkeys((own.source, own.repair.dropped) for own in self._clocks if own.repair is not None)
        return [
            f"{source}: {dropped} rows whose time repeats or steps back were left out" for source, dropped in repairs
        ]


def grouped(settings: Mapping[str, RecordedSignal], triads: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Return the signals of each quantity: the axes of a triad, or one."""
    of_triads = {name: tuple(axes) for name, axes in triads.items() if all(axis in settings for axis in axes)}
    taken = {axis for axes in of_triads.values() for axis in axes}
    return {**of_triads, **{name: (name,) for name in settings if name not in taken}}


def _joined_group(
    name: str,
    settings: dict[str, RecordedSignal],
    places: Mapping[str, list[tuple[str, str]]],
    sources: _Sources,
    config: VoteConfig,
) -> Group:
    wanted: dict[str, set[str]] = {}
    for signal in settings:
        for topic, field_name in places[signal]:
            wanted.setdefault(topic, set()).add(field_name)
    read, clocks = sources.read(wanted)
    of_signals = {signal: [topic for topic, _ in places[signal]] for signal in settings}
    rows, taken = joined(str(sources.path), read, clocks, of_signals)
    first = next(iter(settings))
    numbers = _chosen(sources.path, config, first) or range(1, len(places[first]) + 1)
    instances = tuple(
        Instance(c, topic, sources.device(topic), None if number == c else number)
        for c, ((topic, _), number) in enumerate(zip(places[first], numbers, strict=True), 1)
    )
    x = np.array([[taken(*place) * own.scale for place in places[signal]] for signal, own in settings.items()])
    own_samples = [
        [Samples(clocks[t].time_s, clocks[t].of(read[t].fields[f]) * own.scale) for t, f in places[signal]]
        for signal, own in settings.items()
    ]
    samples = {signal: Channels(list(axis.copy())) for signal, axis in zip(settings, x, strict=True)}
    votes = of_quantity(Recording(rows.time_s, samples), settings, config)
    return _in_range(Group(name, settings, instances, rows.time_s, x, own_samples, votes=votes))


def _of_recording(asked: Asked, of: str) -> Read:
    """Return the groups of a recording whose channels have common rows.  BadInput: no signal."""
    recording, settings, votes = asked.recording, asked.signals, of_asked(asked)
    made: list[Group] = []
    for name, signals in grouped(settings, asked.config.triads).items():
        counts = {(len(recording.signals[signal].channels), recording.signals[signal].numbers) for signal in signals}
        parts = {name: signals} if len(counts) == 1 else {signal: (signal,) for signal in signals}
        for part, axes in parts.items():
            x = np.array([recording.signals[signal].channels for signal in axes])
            own = [[Samples(recording.time_s, column) for column in axis] for axis in x]
            instances = tuple(_instance(part, c, recording.signals[axes[0]]) for c in range(x.shape[1]))
            own_settings = {s: settings[s] for s in axes}
            group = Group(part, own_settings, instances, recording.time_s, x, own, votes=votes)
            made.append(_in_range(group))
    if not made:
        raise BadInput("config: no signal with two channels or more: nothing to compare")
    repairs = [
        f"{r.source}: {r.dropped} rows whose time repeats or steps back were left out" for r in recording.repairs
    ]
    return Read(made, of, list(recording.remarks), [*recording.warnings, *repairs], {})


def _instance(name: str, c: int, samples: Channels) -> Instance:
    """Return channel ``c``, from 0, of the vote, named as its column in the recording."""
    number = samples.number(c)
    return Instance(c + 1, f"{name}.{number}", recorded=None if number == c + 1 else number)


def _in_range(group: Group) -> Group:
    """Return the group with NaN in place of samples out of range, and angles that wrap unrolled."""
    for a, own in enumerate(group.settings.values()):
        low, high = own.limits
        x = group.x[a]
        group.x[a] = np.where((x >= low) & (x <= high), x, np.nan)
        if own.wraps:
            base = group.x[a, 0].copy()
            good = np.isfinite(base)
            base[good] = np.unwrap(base[good])
            base[~good] = np.interp(group.time_s[~good], group.time_s[good], base[good]) if good.any() else 0.0
            group.x[a] = near(group.x[a], base)
            group.own[a] = [Samples(time_s, unwrapped(values)) for time_s, values in group.own[a]]
    return group
