"""The diagnosis in words: one paragraph for each quantity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rig.bench.diagnose.findings import InFlight, SignalDiagnosis
from rig.bench.diagnose.one_quantity import QuantityDiagnosis
from rig.log.recordings.stamps import LONG_AGO_S, digits


def title(quantities: Mapping[str, QuantityDiagnosis]) -> str:
    """Return the result in one line."""
    signals = [one for quantity in quantities.values() for one in quantity.signals.values()]
    named = sorted((one for one in signals if one.verdict == "channel"), key=lambda one: one.since_s or 0.0)
    if named:
        first = named[0]
        return f"{first.instance} ({first.quantity}) is wrong from {first.since_s or 0.0:.2f} s on"
    if any(one.verdict == "one_of" for one in signals):
        first = min((one for one in signals if one.verdict == "one_of"), key=lambda one: one.since_s or 0.0)
        return f"one of the two {first.quantity} channels is wrong from {first.since_s or 0.0:.2f} s on"
    if any(one.verdict == "none" for one in signals):
        return "no channel departs from the others"
    return "no verdict is possible"


def paragraph(one: QuantityDiagnosis, zero_s: float) -> str:
    """Return the paragraph of one quantity."""
    head = f"{one.name}: {len(one.instances)} channels at {one.rate_hz:.3g} Hz."
    return " ".join([head, *_conventions(one), *_verdicts(one, zero_s), *(f"{_capital(r)}." for r in one.remarks)])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _conventions(one: QuantityDiagnosis) -> Iterator[str]:
    for each in one.conventions:
        who = f"Channel {each.instance.channel} ({each.instance})"
        who = who if each.named else f"{who}, or the other one,"
        yield f"{who}: {each.text}{'; corrected' if each.corrected and each.kind not in ('offset',) else ''}."


def _verdicts(one: QuantityDiagnosis, zero_s: float) -> Iterator[str]:
    faulty = {name: signal for name, signal in one.signals.items() if signal.since_s is not None}
    alike: dict[tuple[object, ...], list[str]] = {}
    for name, signal in faulty.items():
        alike.setdefault((signal.verdict, signal.channel, signal.kind, signal.since_s), []).append(name)
    for names in alike.values():
        yield from _fault(names, faulty[names[0]], zero_s)
    healthy = {name: signal for name, signal in one.signals.items() if signal.verdict == "none"}
    if healthy:
        yield from _healthy(healthy)


def _fault(names: list[str], signal: SignalDiagnosis, zero_s: float) -> Iterator[str]:
    on = ", ".join(names)
    since = f"{signal.since_s or 0.0:.2f} s after the first row"
    if abs(zero_s) >= LONG_AGO_S:
        since += f" (at {digits(signal.time_s or 0.0)} s)"
    if signal.verdict == "channel":
        yield f"Channel {signal.channel} ({signal.instance}) is wrong on {on}, beginning {since}: it {signal.text}."
    elif signal.verdict == "one_of":
        yield f"One of the two is wrong on {on}, beginning {since}: {signal.text}; two alone do not show which."
    else:
        yield f"The channels of {on} differ, beginning {since}: {signal.text}. The log does not show which is wrong."
    if signal.smallest_told is not None:
        yield f"A step below {signal.smallest_told:.3g} {signal.unit} would not be detected.".replace(" .", ".")
    if signal.in_flight is not None:
        yield _in_flight(signal.in_flight, signal)


def _in_flight(flight: InFlight, signal: SignalDiagnosis) -> str:
    unit = f" {signal.unit}" if signal.unit else ""
    manager = (
        f"In flight the manager {flight.manager} (threshold {flight.threshold:g}{unit} of the {flight.threshold_of})"
    )
    others = [i for i in flight.isolations if i.channel != signal.channel]
    healthy = (
        f"; it also isolates channel {others[0].channel} at {others[0].at_s:.2f} s" if others and signal.channel else ""
    )
    error = f"; the vote is off by at most {flight.vote_error:.3g}{unit}" if flight.vote_error is not None else ""
    if flight.isolated:
        return f"{manager} isolates it at {flight.at_s:.2f} s{error}{healthy}."
    return f"{manager} does not isolate it{error}{healthy}."


def _healthy(signals: dict[str, SignalDiagnosis]) -> Iterator[str]:
    worst = max(signals, key=lambda name: signals[name].in_thresholds or 0.0)
    one = signals[worst]
    unit = f" {one.unit}" if one.unit else ""
    on = ", ".join(signals)
    smallest = ", ".join(f"{s.smallest_told:.3g}" for s in signals.values() if s.smallest_told is not None)
    yield (
        f"No channel departs on {on}: the largest sustained difference is {one.difference or 0.0:.3g}{unit} "
        f"({one.in_thresholds or 0.0:.2g} thresholds, on {worst}); differences above {smallest}{unit} would have "
        "counted. This is a bound on one log, not a rate."
    )
    flown = [(name, i) for name, s in signals.items() if s.in_flight for i in s.in_flight.isolations]
    if flown:
        name, first = flown[0]
        yield f"In flight the manager would have isolated channel {first.channel} of {name} at {first.at_s:.2f} s."
