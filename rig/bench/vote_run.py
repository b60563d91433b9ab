"""One ``rig vote``: read, inject faults, align, vote, write."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.injection_score import summary as scores
from rig.bench.vote import Result, of_flight, settings_of, vote, vote_discretes
from rig.bench.vote_summary import summary
from rig.bench.write_votes import output, write
from rig.errors import BadInput
from rig.recordings.alignment import AlignOptions, run_alignment
from rig.recordings.flown import Recorded, recorded
from rig.recordings.injection_file import read_injection
from rig.recordings.own_logs import is_flight, of_log
from rig.recordings.read import read
from rig.recordings.recording import Recording
from rig.recordings.settings import RecordedDiscrete, RecordedSignal, VoteConfig, read_config
from rig.util.progress import tell
from rig.util.trust import Trust


@dataclass(frozen=True, slots=True)
class Options:
    """What is done with the recording besides the vote."""

    align: AlignOptions | None = None  # None: not aligned
    faults: str | None = None  # a file, or a bundled scenario, of [[faults]] to inject
    repair: bool = False
    allow_code: bool = False


class Laps:
    """How long each stage took, s."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = perf_counter()

    def __call__(self, stage: str) -> None:
        """End ``stage`` and begin the next."""
        now = perf_counter()
        self.seconds[stage], self._clock = now - self._clock, now
        tell(f"{stage}: done")


class _Asked(NamedTuple):
    """What is voted, and by which settings."""

    recording: Recording
    signals: dict[str, RecordedSignal]
    discretes: dict[str, RecordedDiscrete]
    config: VoteConfig  # empty for a flight voted by its own scenario
    flown: Recorded | None = None


def run(recorded: Path, config: Path | None, out: Path, options: Options) -> dict[str, Any]:
    """Vote ``recorded`` and write ``out``, which is there only when all went well; the summary.

    config : settings of the signals; None: those of the scenario in ``recorded``, the log of a flight
    Faults are put into the recording as it was read, as a fault is in the sensor: alignment sees them.
    """
    lap = Laps()
    with output(out, recorded) as part:
        test = None if options.faults is None else read_injection(options.faults)
        asked = _by_scenario(recorded, options) if config is None else _by_config(recorded, config, options)
        recording, signals, discretes = asked.recording, asked.signals, asked.discretes
        lap("read")
        injected = []
        if test is not None:
            file, source = test
            injection = inject(recording, file.faults, signals, discretes, seed=file.seed, source=source)
            recording, injected = injection.recording, injection.injected
            lap("inject")
        alignment = None
        if options.align is not None:
            recording, alignment = run_alignment(recording, signals, options.align, asked.config.triads, injected)
            lap("align")
        voted = _vote(asked, recording, config, options)
        lap("vote")
        write(part, out, recording, voted)
        lap("write")
    about = {"out": str(out), **summary(recording, voted, alignment), "seconds": lap.seconds}
    if asked.flown is not None and asked.flown.unit:
        about["remark"] = "a unit under test voted in this flight; here the manager of its scenario does"
    if test is not None:
        corrections = None if alignment is None else alignment.corrections
        about["injected"] = scores(score(injected, recording, voted, corrections), test[1], test[0].seed)
    return about


def _by_config(recorded: Path, config: Path, options: Options) -> _Asked:
    settings = read_config(config)
    recording = read(recorded, settings, options.repair)
    signals = settings.signals(recording.signals, str(config))
    return _Asked(recording, signals, settings.discretes(recording.discretes, str(config)), settings)


def _by_scenario(path: Path, options: Options) -> _Asked:
    """Read a flight with its own settings.  BadInput: a recording that has none needs a configuration."""
    if path.suffix != ".mcap" or not is_flight(path):
        raise BadInput(f"{path}: --config is needed: only the log of a flight holds the settings of its signals")
    flown = recorded(path, options.allow_code)
    signals, discretes = settings_of(flown.scenario)
    return _Asked(of_log(flown.log, path, options.repair), signals, discretes, VoteConfig(), flown)


def _vote(asked: _Asked, recording: Recording, config: Path | None, options: Options) -> Result:
    settings = asked.config
    if asked.flown is not None:
        return of_flight(recording, asked.flown.scenario)
    trust, boxes = Trust(str(config), options.allow_code), (settings.box_signals, settings.box_persistence)
    signals = vote(recording, asked.signals, settings.resets, trust, settings.triads, boxes)
    return Result(signals, vote_discretes(recording, asked.discretes, settings.resets))
