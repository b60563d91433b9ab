"""The flight's manager and voter of discretes over the rows of a recording.

Signals with the same manager are voted together, as in flight, so that rules across signals (an LRU failure) apply
here too.  A log of a flight can be voted with the settings of its scenario (``of_flight``): the decisions are then
those of the flight, to the bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.channels import ChannelFailure, begin_isolated, channel_records
from rig.bench.drive import Decide, Stages, run, write_sources
from rig.bench.rows_of_recording import FIELDS, FLIGHT_FIELDS, Columns, blocks, put, put_discrete, repeat_first
from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.discrete import DiscreteVoter
from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS, PERSISTENCE, fill_discrete
from rig.computer.redundancy.manager_config import PARAMS, fill
from rig.computer.redundancy.managers import MANAGERS, Manager, manager_kind, with_settings
from rig.computer.redundancy.own import OwnManager, load_manager
from rig.core.blocks import room
from rig.core.frame import DISCRETES, SIGNALS, Block, D, Rows, S, State, rows, to_frame
from rig.core.kernels import kernel
from rig.core.settings import in_frames
from rig.core.trust import Trust
from rig.core.units.angles import difference
from rig.flight import loop
from rig.log.recordings.recording import Bytes, Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedDiscrete, RecordedSignal, Reset, VoteRules, commands
from rig.scenario.scenario import Scenario
from rig.world import sensors

_NO_CODE: Final = Trust("the configuration")
_BY_DEFAULT: Final = Baselines()
_NO_RULES: Final = VoteRules()
_OF_DISCRETES: Final = ("voted", "level")


@dataclass(frozen=True, slots=True)
class Voted:
    """The manager's output for one signal; every array (n,), ``state`` one for each channel."""

    settings: RecordedSignal
    voted: Floats
    level: Bytes
    pattern: Bytes
    decided_by: Bytes
    trend_high: Bytes
    trend_low: Bytes
    reference_usable: Bytes
    state: list[Bytes]
    spread: Floats  # largest less smallest of the samples in use, NaN where there are none
    invalid: list[int]  # these three as of ChannelRecords
    suspect: list[int]
    failures: list[ChannelFailure]
    of_flight: dict[str, Bytes] = field(default_factory=dict)  # FLIGHT_FIELDS, by the scenario of a flight


@dataclass(frozen=True, slots=True)
class VotedDiscrete:
    """The voter's output for one discrete; every array (n,), ``state`` one for each channel."""

    settings: RecordedDiscrete
    voted: Bytes  # 0 or 1
    level: Bytes
    state: list[Bytes]
    invalid: list[int]  # these three as of ChannelRecords
    suspect: list[int]
    failures: list[ChannelFailure]
    reset: Bytes | None = None  # commands, of a flight voted by its scenario


@dataclass(frozen=True, slots=True)
class Result:
    """Votes of signals and discretes by name."""

    signals: dict[str, Voted]
    discretes: dict[str, VotedDiscrete] = field(default_factory=dict)
    of_flight: bool = False  # voted by the settings of the flight that was recorded
    rules: VoteRules = _NO_RULES


class _Group(NamedTuple):
    """Signals that one manager votes together."""

    names: tuple[str, ...]
    manager: Manager | OwnManager
    params: NDArray[np.void]
    of_flight: bool = False  # with the second reference, and more of it written


def vote(
    recording: Recording,
    settings: dict[str, RecordedSignal],
    resets: list[Reset],
    trust: Trust = _NO_CODE,
    triads: Mapping[str, Sequence[str]] | None = None,
    rules: VoteRules = _NO_RULES,
    baselines: Baselines = _BY_DEFAULT,
) -> dict[str, Voted]:
    """Vote the signals that have settings.  BadInput: a manager class that ``trust`` does not permit.

    triads : by name, signals that are the axes of one unit: "selection" chooses one channel for all three
    rules : for all signals; its boxes have signals with settings
    baselines : settings of the baseline managers among the managers
    """
    for chosen in settings.values():
        trust.require(chosen.manager)
    params = dict(zip(settings, params_of(recording, settings, rules), strict=True))
    voted: dict[str, Voted] = {}
    for names, as_unit in _groups(settings, triads or {}):
        group = _group(names, settings, np.array([params[name] for name in names]), trust, rules, baselines, as_unit)
        voted |= _vote_group(recording, group, settings, resets)
    return {name: voted[name] for name in settings}


def vote_discretes(
    recording: Recording, settings: dict[str, RecordedDiscrete], resets: list[Reset]
) -> dict[str, VotedDiscrete]:
    """Vote the discretes that have settings, whose fail-safe values are known."""
    return _vote_discretes(recording, settings, resets, DiscreteVoter(discrete_params(recording, settings)))


def params_of(
    recording: Recording, settings: Mapping[str, RecordedSignal], rules: VoteRules = _NO_RULES
) -> NDArray[np.void]:
    """Return (n,) config.PARAMS of the signals that have settings; no split is given up before it can be settled."""
    params = np.zeros(len(settings), PARAMS)
    for row, (name, chosen) in zip(params, settings.items(), strict=True):
        samples = recording.signals[name]
        fill(row, chosen, chosen.limits, len(samples.channels), chosen.wraps, recording.rate_hz)
        # A log of ours has a field for the reference of every signal, NaN where there is none.
        row["referred"] = samples.reference is not None and (
            not recording.in_si or bool(np.isfinite(samples.reference).any())
        )
    params["box"] = box_of_signals(rules.boxes, tuple(settings))
    if rules.unresolved_s > 0:
        frames = in_frames(0, rules.unresolved_s, recording.rate_hz)
        params["unresolved_frames"] = np.maximum(frames, params["split_persistence"])
    return params


def discrete_params(recording: Recording, settings: Mapping[str, RecordedDiscrete]) -> NDArray[np.void]:
    """Return (n,) DISCRETE_PARAMS of the discretes that have settings."""
    params = np.zeros(len(settings), DISCRETE_PARAMS)
    for row, (name, chosen) in zip(params, settings.items(), strict=True):
        assert chosen.fail_safe is not None  # VoteConfig.discretes sees to it
        fitted = len(recording.discretes[name].channels)
        fill_discrete(row, chosen, chosen.fail_safe, fitted, PERSISTENCE, recording.rate_hz)
    return params


def of_flight(recording: Recording, scenario: Scenario) -> Result:
    """Vote a log of a flight by its scenario, with the decisions of the flight.  BadInput: the user's manager."""
    stage = loop.redundancy(scenario)
    signals, discretes = settings_of(scenario)
    resets = _at_rows(scenario, recording)
    group = _Group(tuple(signals), stage.own or stage.manager, stage.manager.params, of_flight=True)
    voted = _vote_group(recording, group, signals, resets)
    of = scenario.redundancy
    rules = VoteRules(of.box_signals, of.box_persistence, of.boxes, of.unresolved_s)
    return Result(voted, _vote_discretes(recording, discretes, resets, stage.discretes, True), True, rules)


def settings_of(scenario: Scenario) -> tuple[dict[str, RecordedSignal], dict[str, RecordedDiscrete]]:
    """Return the settings of a flight's signals and discretes as those of a recording."""
    redundancy, suite = scenario.redundancy, scenario.sensors
    limits = sensors.ranges(suite)
    sheets = sensors.data_sheets(suite, scenario.rate_hz, scenario.computers.apart_frames)
    signals = {
        signal.name: RecordedSignal(
            **getattr(redundancy.signals, signal.name).with_figures(sheets[i]).model_dump(),
            range=[float(limits[i, 0]), float(limits[i, 1])],
            unit=signal.unit,
            wraps=signal.wraps,
            manager=redundancy.manager,
        )
        for i, signal in enumerate(SIGNALS)
    }
    discretes: dict[str, RecordedDiscrete] = {}
    for discrete in DISCRETES:
        given = getattr(redundancy.discretes, discrete.name).model_dump(exclude_none=True)
        discretes[discrete.name] = RecordedDiscrete(**{"fail_safe": discrete.fail_safe, **given})
    return signals, discretes


def _at_rows(scenario: Scenario, recording: Recording) -> list[Reset]:
    """Return the scenario's commands at the times of their rows in the flight."""
    frames = recording.rows - 1
    given: list[Reset] = []
    for reset in scenario.redundancy.resets:
        row = int(np.searchsorted(frames, to_frame(reset.at_s, scenario.rate_hz)))
        if row < len(frames):
            at_s = float(recording.time_s[row])
            given.append(Reset(at_s=at_s, signal=reset.signal, channels=reset.channels))
    return given


def _groups(
    settings: Mapping[str, RecordedSignal], triads: Mapping[str, Sequence[str]]
) -> list[tuple[tuple[str, ...], bool]]:
    """Return the groups of signals that are voted together, and whether they are the axes of a unit.

    All signals of a manager, the axes of a unit; a user's manager votes each alone.
    """
    units = [
        tuple(axes) for axes in triads.values() if all(manager_kind(settings[a].manager).chooses_units for a in axes)
    ]
    others = [name for name in settings if not any(name in axes for axes in units)]
    groups = [(axes, True) for axes in units]
    for manager in dict.fromkeys(settings[name].manager for name in others):
        names = tuple(name for name in others if settings[name].manager == manager)
        groups += [(some, False) for some in ([names] if manager in MANAGERS else [(name,) for name in names])]
    return groups


def _group(
    names: tuple[str, ...],
    settings: Mapping[str, RecordedSignal],
    params: NDArray[np.void],
    trust: Trust,
    rules: VoteRules,
    baselines: Baselines,
    as_unit: bool,
) -> _Group:
    manager = settings[names[0]].manager
    if manager not in MANAGERS:
        # It gets a flight's rows (_vote_group), so there must be settings for all signals of a flight.
        return _Group(names, load_manager(manager, np.repeat(params, S), trust), params)
    with_manager = with_settings(params, manager, baselines, names)
    boxes = {"box_signals": rules.box_signals, "box_persistence": rules.box_persistence}
    made = Manager(manager, with_manager, **boxes, as_unit=as_unit)
    for i, name in enumerate(names):
        begin_isolated(made.state[i], params[i], settings[name].bad_from_start, name)
    return _Group(names, made, params)


def _vote_group(
    recording: Recording, group: _Group, settings: Mapping[str, RecordedSignal], resets: list[Reset]
) -> dict[str, Voted]:
    """Run the signals of a group through their manager."""
    n, names = len(recording.time_s), group.names
    samples = [recording.signals[name] for name in names]
    commanded = [commands(resets, name, recording.time_s) for name in names]
    fields = (*FIELDS, *(FLIGHT_FIELDS if group.of_flight else ()))
    columns, spread = [Columns.of(n, len(signal.channels), fields) for signal in samples], room((len(names), n))
    # A user's manager is compiled for the rows of a flight.
    kind = rows(len(names)) if isinstance(group.manager, Manager) else rows(S, D)
    for part, block in blocks(kind, n):
        for i, signal in enumerate(samples):
            put(block, i, signal, part, group.of_flight)
            block["reset"][:, i] = commanded[i][part]
        repeat_first(block, len(samples))
        _decide(kind, block, group)
        for i, out in enumerate(columns):
            spreads(block, i, group.params[i], spread[i, part])
            out.take(block, i, part)
    return {n: _voted(recording, samples[i], settings[n], columns[i], spread[i]) for i, n in enumerate(names)}


def put_votes(block: Block, i: int, of: Voted, part: slice) -> None:
    """Write the manager's output for ``part``, signal i of the block."""
    for c, column in enumerate(of.state):
        block["state"][:, i, c] = column[part]
    for field_name in FIELDS:
        block[field_name][:, i] = getattr(of, field_name)[part]


def _decide(kind: Rows, block: Block, group: _Group) -> None:
    nested = kind.nested(block)
    if isinstance(group.manager, Manager):
        run(nested, Stages(manager=group.manager.data))
    else:
        run(nested, Stages(), decide=by_class(group.manager, block, nested))
    if group.of_flight:
        write_sources(nested)


def by_class(own: OwnManager, block: Block, nested: NDArray[Any]) -> Decide:
    """Return a user's manager as the decider of the rows of ``block``."""
    bus, fcc = nested["bus"], nested["fcc"]
    return lambda _, k: own.step(block, bus, fcc, k)


def _voted(recording: Recording, samples: Samples, settings: RecordedSignal, out: Columns, spread: Floats) -> Voted:
    records = channel_records(
        recording, samples, settings.limits, out.states, out.fields["decided_by"], settings.bad_from_start
    )
    fields = {name: out.fields[name] for name in FIELDS}
    extra = {name: column for name, column in out.fields.items() if name not in fields}
    return Voted(settings, **fields, state=out.states, spread=spread, **records._asdict(), of_flight=extra)


@kernel
def spreads(rows, i, p, out):
    """Return the spread of the channels in use of signal i: largest minus smallest sample, relative to the vote.

    A sample that is not valid or out of range is not in use; NaN if none is.
    p : one config.PARAMS record; out : (rows,)
    """
    for k in range(len(rows)):
        row = rows[k]
        low, high = np.inf, -np.inf
        for c in range(p["fitted"]):
            sample = row["channels"][i, c]
            if row["state"][i, c] != State.FAILED and row["valid"][i, c] != 0 and p["low"] <= sample <= p["high"]:
                off = difference(sample, row["voted"][i], p["wraps"])
                low, high = min(low, off), max(high, off)
        out[k] = high - low if high >= low else np.nan


def _vote_discretes(
    recording: Recording,
    settings: Mapping[str, RecordedDiscrete],
    resets: list[Reset],
    voter: DiscreteVoter,
    flown: bool = False,
) -> dict[str, VotedDiscrete]:
    n, kind = len(recording.time_s), rows(1, len(settings))
    commanded = {name: commands(resets, name, recording.time_s) for name in settings}
    of = recording.discretes
    out = {name: Columns.of(n, len(of[name].channels), _OF_DISCRETES, "discrete_") for name in settings}
    for part, block in blocks(kind, n):
        for d, (name, reset) in enumerate(commanded.items()):
            put_discrete(block, d, of[name], part)
            block["discrete_reset"][:, d] = reset[part]
        run(kind.nested(block), Stages(discretes=voter.data))
        for d, columns in enumerate(out.values()):
            columns.take(block, d, part)
    return {
        name: VotedDiscrete(
            settings[name],
            **columns.fields,
            state=columns.states,
            **channel_records(recording, of[name], (0.0, 1.0), columns.states)._asdict(),
            reset=commanded[name] if flown else None,
        )
        for name, columns in out.items()
    }
