"""The votes of ``rig vote`` on a recording, for the sentences on what the manager does in flight.

The recording is voted as ``rig vote`` votes it: the samples as read, and all settings of CONFIG or of the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from rig.bench.vote_rows import Voted, of_flight, vote
from rig.bench.vote_run import Asked
from rig.computer.redundancy.managers import DEFAULT, MANAGERS
from rig.log.recordings.max_change import limited
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig

Votes = dict[str, Voted]


@dataclass(slots=True)
class FlightVotes:
    """A recording with the vote on its rows, all in SI units."""

    recording: Recording
    vote: Callable[[Recording], Votes]
    _unchanged: Votes = field(default_factory=dict)  # made once, for all quantities

    def voted(self, converted: Mapping[tuple[str, int], Floats]) -> Votes:
        """Return the votes on all signals.

        converted : by signal and channel, from 0, samples (n,) in place of the recorded ones
        """
        if not converted:
            self._unchanged = self._unchanged or self.vote(self.recording)
            return self._unchanged
        signals = dict(self.recording.signals)
        for (name, c), column in converted.items():
            channels = list(signals[name].channels)
            channels[c] = column
            signals[name] = replace(signals[name], channels=channels)
        return self.vote(replace(self.recording, signals=signals))


def of_asked(asked: Asked) -> FlightVotes:
    """Return the votes on a recording by its CONFIG, or by the scenario of the flight that it is the log of."""
    if (flown := asked.flown) is not None:
        return FlightVotes(asked.recording, lambda recording: of_flight(recording, flown.scenario).signals)
    return FlightVotes(asked.recording, _by_config(asked.signals, asked.config))


def of_quantity(recording: Recording, settings: Mapping[str, RecordedSignal], config: VoteConfig) -> FlightVotes:
    """Return the votes on one quantity of a log, on its own rows.

    Boxes have signals on other rows, so their rule is left out.
    """
    triads = {name: axes for name, axes in config.triads.items() if all(axis in settings for axis in axes)}
    alone = config.model_copy(update={"triads": triads, "boxes": {}, "box_signals": 0})
    return FlightVotes(recording, _by_config(settings, alone))


def _by_config(settings: Mapping[str, RecordedSignal], config: VoteConfig) -> Callable[[Recording], Votes]:
    """Return the vote by CONFIG; a manager of the user's, whose code is not run here, is replaced by the default."""
    known = {
        name: own if own.manager in MANAGERS else own.model_copy(update={"manager": DEFAULT})
        for name, own in settings.items()
    }

    def voted(recording: Recording) -> Votes:
        return vote(
            limited(recording, known),
            known,
            config.resets,
            triads=config.triads,
            rules=config.rules,
            baselines=config.baselines,
        )

    return voted
