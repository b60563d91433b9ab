"""The records of a score, as plain data.  docs/reference/scores-and-tables.md defines them; frames count from 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from math import radians
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.core.frame import CHANNELS
from rig.core.settings import Settings
from rig.flight.suspects import Suspect
from rig.verdict.words import FaultWord, IsolationKind

# One signal's fields that a sentence looks at again, frame by frame: frames in which a fault was not yet failed.
COLUMNS: Final = np.dtype(
    [("channels", "f8", (CHANNELS,)), ("valid", "u1", (CHANNELS,)), ("state", "u1", (CHANNELS,)), ("pattern", "u1")]
)
Columns = Callable[[int, int, int], NDArray[Any]]  # signal, first frame, end (excluded): (n,) COLUMNS
Outcome = Literal["detected", "missed", "undetectable", "not executed"]
# The field of Score that lists the healthy channels of each kind.
ISOLATIONS: Final[dict[IsolationKind, str]] = {
    "false alarm": "false_alarms",
    "wrong isolation": "wrong_isolations",
    "failed with its box": "failed_with_box",
    "failed by rule": "failed_by_rule",
}


class Yardstick(Settings):
    """Limits of a failure transient: MIL-F-8785C, as commonly cited."""

    load_factor: float = Field(default=0.5, gt=0)  # g, to both sides
    pitch_rate_rad_s: float = Field(default=radians(10.0), gt=0)
    window_s: float = Field(default=2.0, gt=0)  # after the onset


@dataclass(frozen=True, slots=True)
class Window:
    """Effects of a fault on a channel from its onset up to the next onset on the signal."""

    end_frame: int  # the first that is no part of it
    good_before: int  # channels of the signal without a fault, not failed, in the frame before the onset
    latent_before: int  # channels with a fault that were not failed
    above_threshold_s: float  # for which the vote was off by more than its threshold
    error_max: float  # of the vote, unit of the signal
    correct: bool  # the vote: within its threshold at the end, and before but for a monitor's time
    lost_s: float  # at level 0
    wrong_vote_first: bool  # whether the vote was not correct before the signal was declared lost


@dataclass(frozen=True, slots=True)
class FaultScore:
    """One fault of the scenario on one channel; ``channel`` is None where it sits on no channel of a signal."""

    id: str
    signal: str
    channel: int | None  # from 1
    kind: str
    onset_frame: int | None  # first frame in which it acted on a channel in use
    exceeded_frame: int | None  # first frame in which it acted and its error was above the threshold
    failed_frame: int | None  # first frame in which the channel was failed for it
    outcome: Outcome
    delay_from_onset_frames: int | None  # failed_frame - onset_frame
    delay_from_exceeded_frames: int | None  # failed_frame - exceeded_frame; below 0 when failed before
    decided_by: str | None  # who failed it: comparison, or a rule; who found it, where no channel was failed
    peak_error: float | None  # largest injected error that is a number, in the unit of its place
    exceeded_run_frames: int  # longest run of frames above the threshold
    tolerated: bool  # missed, and above the threshold for fewer frames in a row than the persistence
    index: int  # of the fault in the scenario
    word: FaultWord  # its outcome, with that of healthy channels; not in JSON
    window: Window | None = None  # None where it never began, or sits on no channel of a signal
    load_factor_change: float | None = None  # largest, of the truth since the frame before the onset; None: no number
    load_factor_change_s: float | None = None  # how long after the onset was looked at; None where it never began
    sample: float | None = None  # of the channel when it was failed, else at the onset; not in JSON, as the next
    pattern: str | None = None  # how the channels stood before it was failed, else the worst
    bypassed: tuple[str, ...] = ()  # surfaces that it cost, with servo actuators,
    bypassed_frame: int | None = None  # and the first frame of that
    law_frame: int | None = None  # first in which the fault-tolerant law found it


@dataclass(frozen=True, slots=True)
class Isolation:
    """A channel that was isolated in a frame, and the rule that isolated it."""

    signal: str
    channel: int
    frame: int
    decided_by: str
    faulty: tuple[int, ...] = ()  # channels of the same place, or lanes from 1, that were faulty then


@dataclass(frozen=True, slots=True)
class ActuatorFailure:
    """A channel of a servo actuator that was shut off."""

    channel: int  # from 1
    frame: int
    monitor: str  # current, continuity, spool, position, ram
    cause: str  # "own fault", of its own or of what all channels share; "unit under test"; else words.IsolationKind
    faulty: tuple[int, ...] = ()  # channels of the surface with a fault of their own then


@dataclass(frozen=True, slots=True)
class ActuatorScore:
    """The servo actuator of one surface."""

    failures: list[ActuatorFailure]  # in order of time
    valves_differ: dict[int, int]  # channel, and the first frame in which its shut-off valve was not as commanded
    bypassed_frame: int | None  # the first in which no channel moved it,
    bypassed_frames: int  # and how many they were


@dataclass(frozen=True, slots=True)
class LaneFailed:
    """A computer that failed a test or was voted out."""

    lane: str
    frame: int
    test: str  # what it was failed for
    accusers: tuple[str, ...]  # lanes; none: a test of its own
    cause: str  # "own fault", "unit under test": its software is that, without a fault on it; else words.IsolationKind
    faulty: tuple[str, ...]  # lanes with a fault then


@dataclass(frozen=True, slots=True)
class ComputersScore:
    """Several computers and their links."""

    failures: list[LaneFailed]  # in order of time
    links_failed: dict[str, int]  # "A-B", from A to B, and when first, frame
    backup_frame: int | None  # the first that the back-up flew
    backup_reason: str


@dataclass(frozen=True, slots=True)
class LawFinding:
    """A finding of the fault-tolerant law by its tests of the pitch angle."""

    finding: str  # pitch angle corrected, rate biased
    frame: int  # the first
    signals: tuple[str, ...]  # whose votes faults had moved enough to be the cause; none: the finding was false
    named: str | None = None  # what the law then named the fault: effectiveness, offset, both
    named_frame: int | None = None


@dataclass(frozen=True, slots=True)
class Episode:
    """Frames in a row in which one signal had one split."""

    signal: str
    pattern: str
    first_frame: int
    frames: int
    asked: tuple[str, ...]  # the tie-break rules that were asked in any of its frames
    decided_by: str  # whose answer stood in its last frame; unresolved if none
    failed: tuple[int, ...]  # channels that the rule failed
    verdict: Literal["correct", "wrong", "open"]  # correct: no healthy one was failed wrongly; open: none was
    last: Any = field(default=None, compare=False, repr=False)  # EPISODE, with its last frame; not in JSON


@dataclass(slots=True)
class RuleScore:
    """How often a rule was asked, answered to the end of an episode, and failed the right channels."""

    asked: int = 0
    answered: int = 0
    correct: int = 0
    wrong: int = 0
    open: int = 0  # answered, and no channel was isolated before the split ended


@dataclass(frozen=True, slots=True)
class VoteError:
    """The vote against the truth, and against the vote that healthy channels would have given; unit of the signal."""

    peak: float
    peak_frame: int | None  # None: no vote was a number
    rms: float
    above_threshold_s: float
    above_threshold_after_onset_s: float  # counted from the first onset of any fault
    clean_peak: float
    clean_rms: float
    clean_above_threshold_s: float


@dataclass(frozen=True, slots=True)
class SignalScore:
    """Totals of a signal; by level: 4, 3, 2, 1 channels in use."""

    level_at_end: int
    lost_s: float  # at level 0
    unresolved_s: float
    channel_hours: tuple[float, ...]  # of healthy channels in use, undisturbed, by level
    false_isolations: tuple[int, ...]  # of them failed, by level


@dataclass(frozen=True, slots=True)
class Deviation:
    """Largest differences of the truth from the fault-free baseline's."""

    load_factor: float
    pitch_rate_rad_s: float
    pitch_angle_rad: float
    roll_angle_rad: float


@dataclass(frozen=True, slots=True)
class Transient:
    """Transient within the yardstick's window after an onset."""

    faults: tuple[str, ...]
    onset_frame: int
    frames: int  # of the window that were flown
    peaks: Deviation
    within_limits: bool


@dataclass(frozen=True, slots=True)
class Transients:
    """The flight against its fault-free baseline."""

    limits: dict[str, float]
    windows: tuple[Transient, ...]
    overall: Deviation
    out_of_limits_s: float
    within_limits: bool
    first_difference_frame: int | None  # of the truth


@dataclass(frozen=True, slots=True)
class FlightScore:
    """How the flight went; peaks of the truth."""

    survived: bool
    end_reason: str
    frames: int
    duration_s: float
    load_factor_min: float
    load_factor_max: float
    pitch_rate_max_rad_s: float
    pitch_angle_min_rad: float
    pitch_angle_max_rad: float
    roll_angle_max_rad: float
    angle_of_attack_min_rad: float
    angle_of_attack_max_rad: float
    transients: Transients | None  # None without a baseline


@dataclass(frozen=True, slots=True)
class Coverage:
    """The states of one voter that were seen, and of how many; transitions are ``from>to``."""

    patterns: tuple[str, ...]
    patterns_possible: int
    levels: tuple[int, ...]
    levels_possible: int
    pattern_transitions: tuple[str, ...]
    pattern_transitions_possible: int
    level_transitions: tuple[str, ...]
    level_transitions_possible: int


class LaneHistory(NamedTuple):
    """Lanes that took over the lead, and lanes that were readmitted: frame and name, in order of time."""

    leading: tuple[tuple[int, str], ...] = ()
    readmitted: tuple[tuple[int, str], ...] = ()


class Evidence(NamedTuple):
    """Data that a conclusion needs besides the score."""

    params: NDArray[np.void]  # (S,) config.PARAMS of its manager
    by_unit: bool  # a unit under test voted it
    silent: frozenset[str]  # signals whose channels never had a state
    columns: Columns  # of a signal with a fault
    isolated: tuple[Isolation, ...] = ()  # channels of signals and discretes that were isolated for a fault
    lanes: LaneHistory = LaneHistory()


@dataclass(frozen=True)
class Score:
    """A flight against the truth."""

    faults: list[FaultScore]
    false_alarms: list[Isolation]
    wrong_isolations: list[Isolation]
    failed_with_box: list[Isolation]
    failed_by_rule: list[Isolation]
    episodes: list[Episode]
    tie_break: dict[str, RuleScore]
    tie_break_by_pattern: dict[str, dict[str, RuleScore]]
    unresolved: int  # episodes in whose last frame no rule had an answer
    vote_error: dict[str, VoteError]
    signals: dict[str, SignalScore]
    flight: FlightScore
    coverage: dict[str, Coverage]  # by signal, and "overall"
    wrong_votes_s: dict[str, float]  # of each discrete, time in which its vote was not the truth
    actuators: dict[str, ActuatorScore]  # by surface; empty without servos
    computers: ComputersScore | None  # None: there is one
    law: list[LawFinding]  # of the fault-tolerant law, in order of time
    suspects: list[Suspect]  # every channel that had a state, whether it was ever suspect or not
    evidence: Evidence = field(compare=False, repr=False)

    @property
    def isolations(self) -> list[tuple[IsolationKind, Isolation]]:
        """Return every healthy channel that was isolated, with the kind of its isolation."""
        return [(kind, each) for kind, name in ISOLATIONS.items() for each in getattr(self, name)]

    def as_dict(self) -> dict[str, Any]:
        """Return the score as plain data, as ``rig score --json`` prints it."""
        plain = asdict(replace(self, evidence=None))  # pyright: ignore[reportArgumentType]  # left out
        del plain["evidence"]
        for fault in plain["faults"]:
            del fault["sample"], fault["pattern"], fault["word"]
        for episode in plain["episodes"]:
            del episode["last"]
        plain["suspects"] = [each.as_dict() for each in self.suspects]
        return plain
