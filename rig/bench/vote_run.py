"""One ``rig vote``: read, inject faults, align, vote, write."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from rig.bench.discrete_vote import vote_all
from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.injection_score import summary as scores
from rig.bench.vote import vote
from rig.bench.vote_summary import summary
from rig.bench.write_votes import Result, output, write
from rig.recordings.alignment import AlignOptions, run_alignment
from rig.recordings.injection_file import read_injection
from rig.recordings.read import read
from rig.recordings.settings import read_config
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


def run(recorded: Path, config: Path, out: Path, options: Options) -> dict[str, Any]:
    """Vote ``recorded`` and write ``out``, which is there only when all went well; the summary.

    Faults are put into the recording as it was read, as a fault is in the sensor: alignment sees them.
    """
    lap = Laps()
    with output(out, recorded) as part:
        settings = read_config(config)
        test = None if options.faults is None else read_injection(options.faults)
        recording = read(recorded, settings, options.repair)
        signals = settings.signals(recording.signals, str(config))
        discretes = settings.discretes(recording.discretes, str(config))
        lap("read")
        injected = []
        if test is not None:
            file, source = test
            injection = inject(recording, file.faults, signals, discretes, seed=file.seed, source=source)
            recording, injected = injection.recording, injection.injected
            lap("inject")
        alignment = None
        if options.align is not None:
            recording, alignment = run_alignment(recording, signals, options.align, settings.triads, injected)
            lap("align")
        resets, trust = settings.resets, Trust(str(config), options.allow_code)
        voted = Result(vote(recording, signals, resets, trust, settings.triads), vote_all(recording, discretes, resets))
        lap("vote")
        write(part, out, recording, voted)
        lap("write")
    found = {"out": str(out), **summary(recording, voted, alignment), "seconds": lap.seconds}
    if test is not None:
        corrections = None if alignment is None else alignment.corrections
        found["injected"] = scores(score(injected, recording, voted, corrections), test[1], test[0].seed)
    return found
