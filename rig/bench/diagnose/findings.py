"""Results of a diagnosis: conventions, faults, and the verdict of each signal."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

from rig.flight.suspects import share_text

EARLY_S: Final = 0.5  # a fault is dated by means, which a decision on rows may precede
Verdict = Literal["none", "channel", "one_of", "unknown"]
Kind = Literal["departs", "frozen", "end of range", "no samples"]
Matrix = tuple[tuple[float, ...], ...]
ConventionKind = Literal["unit", "axes", "mounting", "delay", "offset"]


@dataclass(frozen=True, slots=True)
class Instance:
    """One sensor: the channel of ``rig vote``, from 1, its topic or column, and the device id if the log has one."""

    channel: int
    name: str
    device: str = ""
    recorded: int | None = None  # number in the recording, if CONFIG names the channels that vote and it is another

    @property
    def who(self) -> str:
        """Return the channel, its name and device, as in a sentence."""
        return f"channel {self.channel} ({'' if self.recorded is None else 'recorded as '}{self})"

    @property
    def label(self) -> str:
        """Return the channel, in a plot; with the name if the recording has another number."""
        return f"channel {self.channel}" if self.recorded is None else self.who

    def __str__(self) -> str:
        """Return the name and the device."""
        return f"{self.name} ({self.device})" if self.device else self.name


@dataclass(frozen=True, slots=True)
class Convention:
    """A constant property of one instance that is no fault in flight."""

    quantity: str  # of the instance
    instance: Instance  # channel, topic and device
    kind: ConventionKind  # of the convention
    value: float | str  # factor, axes, deg, s, or unit of the signal
    text: str  # the same in words
    named: bool = True  # False: one of two instances
    corrected: bool = True  # it was corrected before the comparison
    signal: str = ""  # of an offset
    angle: bool = False  # of a mounting, estimated: no whole axes
    matrix: Matrix | None = None  # from what it measures to what the others do


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of one channel of a signal; ``difference`` in SI units, ``time_s`` in the time of the log."""

    signal: str
    kind: Kind
    channel: int | None  # None: one of two; 0: not known
    time_s: float
    difference: float
    text: str


@dataclass(frozen=True, slots=True)
class Isolation:
    """An isolation by the manager of a vote in flight; seconds since the first row."""

    channel: int
    instance: str  # its topic or column
    at_s: float
    why: str  # the rule, as rig vote names it


@dataclass(frozen=True, slots=True)
class Doubted:
    """A channel that the manager suspects in many rows and never isolates, as rig vote tells it."""

    channel: int
    instance: str  # its topic or column
    at_s: float  # of the first of these rows, s since the first row
    rows: int  # in which it was suspect
    of: int  # rows in all

    @property
    def text(self) -> str:
        """Return how often, in words."""
        return share_text(self.rows, self.of)


@dataclass(frozen=True, slots=True)
class InFlight:
    """Decisions of the manager on the rows as joined, with the settings of the preset or the configuration."""

    manager: str  # name of the manager
    threshold: float  # unit of the signal
    threshold_of: str  # a preset, or the configuration
    persistence_s: float  # of a miscompare until isolation
    isolated: bool  # the channel of the verdict was isolated, since the fault or before its date
    at_s: float | None  # of that isolation, s since the first row
    vote_error: float | None  # largest distance of the vote from the other channels since the fault
    isolations: tuple[Isolation, ...] = ()  # all of them
    suspects: tuple[Doubted, ...] = ()  # channels that are suspect in many rows and never isolated


@dataclass(frozen=True, slots=True)
class SignalDiagnosis:
    """The verdict of one signal."""

    quantity: str  # of the signal
    verdict: Verdict  # of the log
    unit: str  # of all amounts here
    channel: int | None = None  # the wrong one, from 1
    instance: str | None = None  # its topic or column
    device: str | None = None  # its device id
    kind: Kind | None = None  # of the fault
    since_s: float | None = None  # s since the first row
    time_s: float | None = None  # the same in the time of the log
    difference: float | None = None  # of the fault; without one the largest that lasted
    in_thresholds: float | None = None  # the difference, relative to what counts then
    threshold: float | None = None  # of the comparison of half-second means
    smallest_told: float | None = None  # a step below this would not be detected
    in_flight: InFlight | None = None  # decisions of the manager on the rows as joined
    text: str = ""  # the fault in words
    remarks: tuple[str, ...] = ()  # why no verdict is possible

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain data."""
        return asdict(self)


@dataclass(slots=True)
class Findings:
    """Results of the steps of a diagnosis of one quantity."""

    conventions: list[Convention] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
