"""Requirements on a recording: what was sampled and what it was voted to, as rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rig.bench.rows_of_recording import blocks, put
from rig.bench.vote_rows import Result, discrete_params, params_of
from rig.core.frame import CHANNELS, State, Table, rows
from rig.log.recordings.recording import Recording
from rig.verdict.requirements import Requirement, RequirementsRecorder, Verdict, of_recording
from rig.verdict.requirements.subject import Subject, Watched

_ABSENT: Final = State.ABSENT


def measure_votes(recording: Recording, voted: Result, requirements: Sequence[Requirement]) -> tuple[Verdict, ...]:
    """Return the verdicts on a recording that was voted; instants from its first row.

    BadInput: a requirement on a signal that the recording lacks, or on what only a flight has.
    """
    recorder = RequirementsRecorder(requirements, subject_of(recording, voted))
    kind = rows(len(voted.signals), len(voted.discretes))
    for part, block in blocks(kind, len(recording.time_s)):
        block["state"] = block["discrete_state"] = _ABSENT
        for i, (name, signal) in enumerate(voted.signals.items()):
            put(block, i, recording.signals[name], part, second=False)
            block["voted"][:, i], block["level"][:, i] = signal.voted[part], signal.level[part]
            for c, state in enumerate(signal.state):
                block["state"][:, i, c] = state[part]
        for d, discrete in enumerate(voted.discretes.values()):
            block["discrete_voted"][:, d], block["discrete_level"][:, d] = discrete.voted[part], discrete.level[part]
            for c, state in enumerate(discrete.state):
                block["discrete_state"][:, d, c] = state[part]
        recorder.record(Table(block))
    return recorder.finish()


def subject_of(recording: Recording, voted: Result) -> Subject:
    """Return a recording that was voted as what requirements are measured on."""
    settings = {name: signal.settings for name, signal in voted.signals.items()}
    params = params_of(recording, settings)
    signals = [
        Watched(name, own.si, own.wraps, int(p["fitted"]), float(p["threshold"]), int(p["persistence"]))
        for (name, own), p in zip(settings.items(), params, strict=True)
    ]
    of_discretes = {name: discrete.settings for name, discrete in voted.discretes.items()}
    discretes = [
        Watched(name, "", False, CHANNELS, 1.0, int(p["persistence"]))
        for name, p in zip(of_discretes, discrete_params(recording, of_discretes), strict=True)
    ]
    return of_recording(signals, discretes, recording.rate_hz, len(recording.time_s))
