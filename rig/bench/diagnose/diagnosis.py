"""The diagnosis of a recording, and its summary as ``rig diagnose --json`` prints it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from rig.bench.diagnose.findings import Convention, InFlight, Instance, SignalDiagnosis
from rig.bench.diagnose.one_quantity import QuantityDiagnosis
from rig.bench.diagnose.paragraphs import paragraph, title


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Verdicts on all signals of a recording that have two channels or more."""

    path: str  # the recording
    threshold_of: str  # source of the thresholds: a preset or the configuration
    zero_s: float  # time of the log from which seconds are counted
    quantities: dict[str, QuantityDiagnosis]  # by name; a vector has a signal for each axis
    remarks: tuple[str, ...] = ()  # on the reading of the log
    warnings: tuple[str, ...] = ()  # doubts about the log
    refused: dict[str, str] = field(default_factory=dict)  # quantities without common rows, and the reason
    injected: tuple[dict[str, Any], ...] = ()  # a row for each fault that was tried on copies

    @property
    def signals(self) -> dict[str, SignalDiagnosis]:
        """Return the verdict of each signal."""
        return {name: one for quantity in self.quantities.values() for name, one in quantity.signals.items()}

    @property
    def conventions(self) -> tuple[Convention, ...]:
        """Return all conventions that differ."""
        return tuple(one for quantity in self.quantities.values() for one in quantity.conventions)

    @property
    def summary(self) -> dict[str, Any]:
        """Return the diagnosis as plain data."""
        return {
            "file": self.path,
            "title": title(self.quantities),
            "threshold_of": self.threshold_of,
            "first_s": self.zero_s,
            "signals": {name: _signal(one) for name, one in self.signals.items()},
            "conventions": [_convention(one) for one in self.conventions],
            "quantities": {name: _quantity(one, self.zero_s) for name, one in self.quantities.items()},
            "not_compared": dict(self.refused),
            "remarks": list(self.remarks),
            "warnings": list(self.warnings),
            "injected": list(self.injected),
        }

    def __repr__(self) -> str:
        """Return one line: the most important verdict."""
        return f"<Diagnosis of {', '.join(self.quantities)}: {title(self.quantities)}>"


def _signal(one: SignalDiagnosis) -> dict[str, Any]:
    data = one.as_dict()
    data["remarks"] = list(one.remarks)
    data["in_flight"] = None if one.in_flight is None else _flight(one.in_flight)
    return data


def _flight(one: InFlight) -> dict[str, Any]:
    return {
        "manager": one.manager,
        "threshold": one.threshold,
        "threshold_of": one.threshold_of,
        "persistence_s": one.persistence_s,
        "isolated": one.isolated,
        "at_s": one.at_s,
        "vote_error": one.vote_error,
        "isolations": [asdict(isolation) for isolation in one.isolations],
        "suspects": [asdict(suspect) for suspect in one.suspects],
    }


def _convention(one: Convention) -> dict[str, Any]:
    return {
        "quantity": one.quantity,
        "signal": one.signal or None,
        "channel": one.instance.channel,
        "instance": one.instance.name,
        "device": one.instance.device or None,
        "kind": one.kind,
        "value": one.value,
        "named": one.named,
        "corrected": one.corrected,
        "text": one.text,
    }


def _instance(one: Instance) -> dict[str, Any]:
    return {
        "channel": one.channel,
        "recorded": one.channel if one.recorded is None else one.recorded,
        "instance": one.name,
        "device": one.device or None,
    }


def _quantity(one: QuantityDiagnosis, zero_s: float) -> dict[str, Any]:
    return {
        "signals": list(one.signals),
        "instances": [_instance(instance) for instance in one.instances],
        "rows": one.rows,
        "rate_hz": one.rate_hz,
        "time_s": [one.first_s, one.last_s],
        "remarks": list(one.remarks),
        "text": paragraph(one, zero_s),
    }
