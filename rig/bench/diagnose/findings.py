"""Results of a diagnosis: conventions, faults, and the verdict of each signal."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

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

    def __str__(self) -> str:
        """Return the name and the device."""
        return f"{self.name} ({self.device})" if self.device else self.name


@dataclass(frozen=True, slots=True)
class Convention:
    """A constant property of one instance that is no fault in flight.

    value : factor of a unit, degrees of a mounting, seconds of a delay, an offset in the unit of the signal, or axes
    named : False: one of two instances, and the log cannot tell which
    corrected : it was taken off before the comparison
    """

    quantity: str
    instance: Instance
    kind: ConventionKind
    value: float | str
    text: str
    named: bool = True
    corrected: bool = True
    signal: str = ""  # of an offset
    angle: bool = False  # of a mounting, estimated: no whole axes
    matrix: Matrix | None = None  # of a unit, axes, a mounting: from what it measures to what the others do


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of one channel of a signal; ``difference`` in SI units, ``time_s`` in the time of the log."""

    signal: str
    kind: Kind
    channel: int | None  # None: one of two; 0: cannot be told
    time_s: float
    difference: float
    text: str


@dataclass(frozen=True, slots=True)
class Isolation:
    """An isolation by the manager of a vote in flight; seconds since the first row."""

    channel: int
    at_s: float


@dataclass(frozen=True, slots=True)
class InFlight:
    """Decisions of the manager on the rows as joined, with the threshold of the preset or the configuration.

    isolated : the channel of the verdict, or for "one_of" any channel, was isolated at or after the fault
    vote_error : largest distance of the vote from the other channels since the fault, unit of the signal
    """

    manager: str
    threshold: float
    threshold_of: str
    persistence_s: float
    isolated: bool
    at_s: float | None
    vote_error: float | None
    isolations: tuple[Isolation, ...] = ()


@dataclass(frozen=True, slots=True)
class SignalDiagnosis:
    """The verdict of one signal.  Amounts are in ``unit``; times in seconds since the first row, and of the log.

    difference : of the fault; without one the largest difference that lasted
    in_thresholds : ``difference`` in units of ``threshold``
    smallest_told : a step below this could not be told
    """

    quantity: str
    verdict: Verdict
    unit: str
    channel: int | None = None
    instance: str | None = None
    device: str | None = None
    kind: Kind | None = None
    since_s: float | None = None
    time_s: float | None = None
    difference: float | None = None
    in_thresholds: float | None = None
    threshold: float | None = None
    smallest_told: float | None = None
    in_flight: InFlight | None = None
    text: str = ""
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain data."""
        return asdict(self)


@dataclass(slots=True)
class Findings:
    """Results of the steps of a diagnosis of one quantity."""

    conventions: list[Convention] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
