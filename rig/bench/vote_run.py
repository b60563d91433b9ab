"""One ``rig vote``: read, inject faults, align, vote, write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import polars as pl

from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.injection_score import summary as scores
from rig.bench.rows_of_recording import blocks, put
from rig.bench.shown_votes import shown_votes
from rig.bench.vote_rows import (
    Result,
    discrete_params,
    of_flight,
    params_of,
    put_votes,
    settings_of,
    vote,
    vote_discretes,
)
from rig.bench.vote_summary import summary
from rig.bench.write_votes import output, table, write, write_units_beside
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.frame import CHANNELS, State, Table, rows
from rig.core.progress import tell
from rig.core.trust import Trust
from rig.log.recordings.alignment import AlignOptions, run_alignment
from rig.log.recordings.flown_log import Recorded, recorded, refuse_link
from rig.log.recordings.formats.contents import OpenLog
from rig.log.recordings.formats.known import names, open_log
from rig.log.recordings.formats.presets import config as preset_config
from rig.log.recordings.injection_file import read_injection
from rig.log.recordings.max_change import limited
from rig.log.recordings.own_logs import is_flight, of_log
from rig.log.recordings.read import ENDINGS, load
from rig.log.recordings.recording import Recording
from rig.log.recordings.vote_config import RecordedDiscrete, RecordedSignal, VoteConfig, config_of, read_config
from rig.verdict.requirements.along import plain
from rig.verdict.requirements.requirement import Requirement, load_requirements
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder, Verdict
from rig.verdict.requirements.subject import Subject, Watched, of_recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Options:
    """Additional processing of the recording."""

    align: AlignOptions | None = None  # None: not aligned
    faults: str | None = None  # a file, or a bundled scenario, of [[faults]] to inject
    repair: bool = False
    allow_code: bool = False
    requirements: tuple[str, ...] = ()  # bundled sets and files
    preset: str | None = None  # of a log of another system; None: that of its format


class Laps:
    """Duration of each stage, s."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = perf_counter()

    def __call__(self, stage: str) -> None:
        """End ``stage`` and begin the next."""
        now = perf_counter()
        self.seconds[stage], self._clock = now - self._clock, now
        tell(f"{stage}: done")


class Asked(NamedTuple):
    """The recording to vote, and its settings."""

    recording: Recording
    signals: dict[str, RecordedSignal]
    discretes: dict[str, RecordedDiscrete]
    config: VoteConfig  # empty for a flight voted by its own scenario
    flown: Recorded | None = None


def run(recorded: Path, config: Path | None, out: Path, options: Options) -> dict[str, Any]:
    """Vote ``recorded`` and write ``out``, which exists only after success; return the summary.

    config : settings of the signals; None: those of the scenario in ``recorded``, the log of a flight
    """
    lap = Laps()
    with output(out, [recorded, config, options.faults, *options.requirements]) as part:
        asked = load_requirements(options.requirements)
        made = vote_file(recorded, config, options, lap)
        measured = measure_votes(made.recording, made.voted, asked) if asked else ()
        write(part, out, made.recording, made.voted)
        lap("write")
    write_units_beside(out, made.voted)
    requirements = {"requirements": [plain(verdict) for verdict in measured]} if asked else {}
    return {"out": str(out), **made.summary, **requirements, "seconds": lap.seconds}


class Votes(NamedTuple):
    """The votes on a recording."""

    recording: Recording  # the recording as it was voted
    voted: Result  # votes by signal and discrete
    summary: dict[str, Any]  # summary, as ``rig vote --json`` prints it

    def to_polars(self) -> pl.DataFrame:
        """Return a table with a row for each recorded row and the columns of the output of ``rig vote``."""
        return table(self.recording, self.voted)

    def plot(self, signal: str | None = None) -> Figure:
        """Return a figure of channels, vote and each channel minus the vote in thresholds; time since the first row.

        signal : signal or discrete; None: all, a row of the figure each
        A long recording is drawn by its extremes.  BadInput: unknown signal.
        """
        from rig.show.notebook.vote_plot import figure_of
        from rig.show.votes.shown_signal import chosen

        return figure_of(chosen(shown_votes(self.recording, self.voted), signal))

    def __repr__(self) -> str:
        """Return one line: rows, signals, isolated channels at the end, long suspect ones, open splits."""
        groups = {**self.summary["signals"], **self.summary["discretes"]}
        failed = [
            f"{name}.{c['channel']}" for name, g in groups.items() for c in g["channels"] if c["state"] == "failed"
        ]
        told = "; ".join(
            [f"isolated {', '.join(failed) or 'no channel'}", *self.summary["suspects"], *self.summary["undecided"]]
        )
        return f"<Votes {self.summary['rows']} rows of {', '.join(groups)}: {told}>"


def vote_file(recorded: Path, config: Path | dict[str, Any] | None, options: Options, lap: Laps) -> Votes:
    """Vote ``recorded``; BadInput: it or its settings.

    config : settings of the signals, a file or its tables; None: those of the scenario in ``recorded``
    Faults are injected into the recording before its alignment, because a fault is in the sensor.
    """
    if config is not None and options.preset is not None:
        raise BadInput("--preset, --config: only one of them")
    test = None if options.faults is None else read_injection(options.faults)
    asked = read_asked(recorded, config, options)
    recording, signals, discretes = asked.recording, asked.signals, asked.discretes
    lap("read")
    injection = None
    if test is not None:
        file, source = test
        injection = inject(recording, file.faults, signals, discretes, seed=file.seed, source=source)
        recording = injection.recording
        lap("inject")
    recording = limited(recording, signals)  # a fault in the sensor may be too fast as well
    alignment = None
    if options.align is not None:
        injected = [] if injection is None else injection.injected
        recording, alignment = run_alignment(recording, signals, options.align, asked.config.triads, injected)
        lap("align")
    voted = _vote(asked, recording, config, options)
    lap("vote")
    data = summary(recording, voted, alignment)
    if asked.flown is not None and asked.flown.unit:
        data["remark"] = "a unit under test voted in this flight; this vote uses the manager of its scenario"
    if test is not None and injection is not None:
        corrections = None if alignment is None else alignment.corrections
        scored = score(injection, recording, voted, corrections)
        data["injected"] = scores(scored, test[1], test[0].seed)
        for fault in data["injected"]["faults"]:
            onset_s = fault["onset_s"]
            fault["since_first_row_s"] = None if onset_s is None else onset_s - data["time_s"][0]
    return Votes(recording, voted, data)


def read_asked(recorded: Path, config: Path | dict[str, Any] | None, options: Options) -> Asked:
    """Return the recording with the settings of its signals, as of ``vote_file``; BadInput as there."""
    return _by_scenario(recorded, options) if config is None else _by_config(recorded, config, options)


def _named(config: Path | dict[str, Any] | None) -> str:
    """Return the name of the configuration in messages."""
    return str(config) if isinstance(config, Path) else "config"


def _by_config(recorded: Path, config: Path | dict[str, Any], options: Options, log: OpenLog | None = None) -> Asked:
    source = _named(config)
    settings = read_config(config) if isinstance(config, Path) else config_of(config, Path(source))
    recording, signals = load(recorded, settings, source, options.repair, log)
    settings.refuse_short_wait(signals, recording.rate_hz, source)
    return Asked(recording, signals, settings.discretes(recording.discretes, source), settings)


def _by_scenario(path: Path, options: Options) -> Asked:
    """Read a flight with its settings, or a log by its preset.  BadInput: other recordings need a configuration."""
    if (log := open_log(path)) is not None:
        return _by_config(path, preset_config(log.contents, path, options.preset), options, log)
    if options.preset is not None:
        raise BadInput(f"{path}: --preset is for logs of {names()}")
    if path.suffix not in ENDINGS and is_file(path):
        raise BadInput(f"{path}: no log of {names()}, and no recording by its ending: {', '.join(ENDINGS)}")
    if path.suffix != ".mcap" or not is_flight(path):
        raise BadInput(f"{path}: --config is needed: only the log of a flight holds the settings of its signals")
    flown = recorded(path, options.allow_code)
    refuse_link(flown.scenario)
    signals, discretes = settings_of(flown.scenario)
    return Asked(of_log(flown.log, path, options.repair), signals, discretes, VoteConfig(), flown)


def _vote(asked: Asked, recording: Recording, config: Path | dict[str, Any] | None, options: Options) -> Result:
    settings = asked.config
    if asked.flown is not None:
        return of_flight(recording, asked.flown.scenario)
    settings.refuse_late_resets(recording.time_s, _named(config))
    trust, rules = Trust(str(_named(config)), options.allow_code), settings.rules
    signals = vote(recording, asked.signals, settings.resets, trust, settings.triads, rules, settings.baselines)
    return Result(signals, vote_discretes(recording, asked.discretes, settings.resets), rules=rules)


def measure_votes(recording: Recording, voted: Result, requirements: Sequence[Requirement]) -> tuple[Verdict, ...]:
    """Return the verdicts on a voted recording; instants count from its first row.

    BadInput: a requirement on a signal that the recording lacks, or on a quantity that only a flight has.
    """
    recorder = RequirementsRecorder(requirements, _subject(recording, voted))
    kind = rows(len(voted.signals), len(voted.discretes))
    for part, block in blocks(kind, len(recording.time_s)):
        block["state"] = block["discrete_state"] = State.ABSENT
        for i, (name, signal) in enumerate(voted.signals.items()):
            put(block, i, recording.signals[name], part, second=False)
            put_votes(block, i, signal, part)
        for d, discrete in enumerate(voted.discretes.values()):
            block["discrete_voted"][:, d], block["discrete_level"][:, d] = discrete.voted[part], discrete.level[part]
            for c, state in enumerate(discrete.state):
                block["discrete_state"][:, d, c] = state[part]
        recorder.record(Table(block))
    return recorder.finish()


def _subject(recording: Recording, voted: Result) -> Subject:
    """Return a voted recording as the subject of requirements."""
    settings = {name: signal.settings for name, signal in voted.signals.items()}
    signals = [
        Watched(name, own.si, own.wraps, int(p["fitted"]), float(p["threshold"]), int(p["persistence"]))
        for (name, own), p in zip(settings.items(), params_of(recording, settings), strict=True)
    ]
    of_discretes = {name: discrete.settings for name, discrete in voted.discretes.items()}
    discretes = [
        Watched(name, "", False, CHANNELS, 1.0, int(p["persistence"]))
        for name, p in zip(of_discretes, discrete_params(recording, of_discretes), strict=True)
    ]
    return of_recording(signals, discretes, recording.rate_hz, len(recording.time_s))
