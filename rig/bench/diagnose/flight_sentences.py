"""Sentences on the manager in flight: isolations and suspect channels, of signals with and without a fault."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from rig.bench.channels import FROM_START, INVALID
from rig.bench.diagnose.findings import EARLY_S, InFlight, Instance, Isolation, SignalDiagnosis

_PLAIN: Final = (FROM_START, INVALID)  # rules that compare nothing


def of_fault(flight: InFlight, signal: SignalDiagnosis, instances: Sequence[Instance]) -> str:
    """Return the sentence on a signal with a fault."""
    unit = f" {signal.unit}" if signal.unit else ""
    if not signal.channel:
        isolated = " and ".join(_firsts(flight, instances))
        return f"{_manager(flight, unit)} isolates {isolated or 'no channel'}."
    others = ", ".join(_firsts(flight, instances, but=signal.channel))
    also = f"; it also isolates {others}" if others else ""
    error = f"; the vote is off by at most {flight.vote_error:.3g}{unit}" if flight.vote_error is not None else ""
    if flight.at_s is None:
        return f"{_manager(flight, unit)} does not isolate it{_suspected(flight, signal.channel)}{error}{also}."
    rule = next(i.why for i in flight.isolations if (i.channel, i.at_s) == (signal.channel, flight.at_s))
    early_s = (signal.since_s or 0.0) - flight.at_s
    if early_s > EARLY_S:  # the vote is then of the others alone
        error = f", {early_s:.2f} s before the beginning above"
    return f"{_manager(flight, unit)} isolates it at {flight.at_s:.2f} s by {rule}{error}{also}."


def without_fault(signals: Mapping[str, SignalDiagnosis], instances: Sequence[Instance]) -> Iterator[str]:
    """Yield the sentences on signals without a fault: what is isolated, and what is suspect."""
    managers: dict[str, dict[str, InFlight]] = {}
    for name, signal in signals.items():
        if (flight := signal.in_flight) is not None and (flight.isolations or flight.suspects):
            unit = f" {signal.unit}" if signal.unit else ""
            managers.setdefault(_manager(flight, unit), {})[name] = flight
    for manager, flights in managers.items():
        isolated = [f"{' and '.join(_firsts(f, instances))} on {name}" for name, f in flights.items() if f.isolations]
        if isolated:
            yield f"{manager} isolates {'; '.join(isolated)}."
        suspected = [f"{text} on {name}" for name, flight in flights.items() for text in _suspects(flight, instances)]
        if suspected:
            who = "It also" if isolated else manager
            yield f"{who} suspects, without isolating, {'; '.join(suspected)}."
    flights = [flight for each in managers.values() for flight in each.values()]
    if any(f.suspects or any(i.why not in _PLAIN for i in f.isolations) for f in flights):
        yield (
            "The manager compares row by row. Noise, oscillations, faults that come and go and constant offsets count "
            "there, and not in the comparison of means."
        )


def in_title(signals: Iterable[SignalDiagnosis], counts: Mapping[str, int]) -> str:
    """Return what the manager does although no channel is found to depart; "": nothing.

    counts : channels of each quantity; where all of them are suspect, no channel is told
    """
    flights = [(one.quantity, one.in_flight) for one in signals if one.in_flight is not None]
    isolated = [(i, quantity) for quantity, flight in flights for i in flight.isolations if i.why != FROM_START]
    if isolated:
        first, quantity = min(isolated, key=lambda each: each[0].at_s)
        names = dict.fromkeys(i.instance for i, of in isolated if (of, i.at_s) == (quantity, first.at_s))
        return f"the manager isolates {' and '.join(names)} ({quantity}) at {first.at_s:.2f} s"
    single = [each for each in flights if len(each[1].suspects) < counts[each[0]]]
    suspects = [(one, quantity) for quantity, flight in single for one in flight.suspects]
    if suspects:
        most, quantity = max(suspects, key=lambda each: each[0].rows)
        return f"the manager suspects {most.instance} ({quantity}), first at {most.at_s:.2f} s, and isolates no channel"
    return ""


def _manager(flight: InFlight, unit: str) -> str:
    return f"In flight the manager {flight.manager} (threshold {flight.threshold:g}{unit} of the {flight.threshold_of})"


def _firsts(flight: InFlight, instances: Sequence[Instance], but: int | None = None) -> Iterator[str]:
    """Yield the first isolation of each channel but one."""
    firsts: dict[int, Isolation] = {}
    for isolation in flight.isolations:
        firsts.setdefault(isolation.channel, isolation)
    for channel, first in firsts.items():
        if channel != but:
            yield f"{instances[channel - 1].who} at {first.at_s:.2f} s by {first.why}"


def _suspects(flight: InFlight, instances: Sequence[Instance]) -> Iterator[str]:
    """Yield the suspect channels, those of the same rows together."""
    alike: dict[str, list[Instance]] = {}
    for one in flight.suspects:
        alike.setdefault(f"{one.text}, first at {one.at_s:.2f} s,", []).append(instances[one.channel - 1])
    for text, some in alike.items():
        who = "all channels" if len(some) == len(instances) else " and ".join(one.who for one in some)
        yield f"{who} {text}"


def _suspected(flight: InFlight, channel: int) -> str:
    one = next((one for one in flight.suspects if one.channel == channel), None)
    return "" if one is None else f", but suspects it {one.text}, first at {one.at_s:.2f} s"
