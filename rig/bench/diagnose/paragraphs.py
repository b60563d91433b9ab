"""The diagnosis in words: one paragraph for each quantity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rig.bench.diagnose.findings import Instance, SignalDiagnosis
from rig.bench.diagnose.flight_sentences import in_title, of_fault, without_fault
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
    result = "no verdict is possible"
    if any(one.verdict == "none" for one in signals):
        result = "no channel departs from the others"
    decided = in_title(signals, {name: len(one.instances) for name, one in quantities.items()})
    return f"{result}, but {decided}" if decided else result


def paragraph(one: QuantityDiagnosis, zero_s: float) -> str:
    """Return the paragraph of one quantity."""
    head = f"{one.name}: {len(one.instances)} channels at {one.rate_hz:.3g} Hz."
    return " ".join([head, *_conventions(one), *_verdicts(one, zero_s), *(f"{_capital(r)}." for r in one.remarks)])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _conventions(one: QuantityDiagnosis) -> Iterator[str]:
    for each in one.conventions:
        who = _capital(each.instance.who)
        who = who if each.named else f"{who}, or the other one,"
        yield f"{who}: {each.text}{'; corrected' if each.corrected and each.kind not in ('offset',) else ''}."


def _verdicts(one: QuantityDiagnosis, zero_s: float) -> Iterator[str]:
    faulty = {name: signal for name, signal in one.signals.items() if signal.since_s is not None}
    alike: dict[tuple[object, ...], list[str]] = {}
    for name, signal in faulty.items():
        alike.setdefault((signal.verdict, signal.channel, signal.kind, signal.since_s), []).append(name)
    for names in alike.values():
        yield from _fault(names, faulty[names[0]], one.instances, zero_s)
    healthy = {name: signal for name, signal in one.signals.items() if signal.verdict == "none"}
    if healthy:
        yield from _healthy(healthy)
    yield from without_fault({name: each for name, each in one.signals.items() if name not in faulty}, one.instances)


def _fault(names: list[str], signal: SignalDiagnosis, instances: Sequence[Instance], zero_s: float) -> Iterator[str]:
    on, unit = ", ".join(names), f" {signal.unit}" if signal.unit else ""
    since = f"{signal.since_s or 0.0:.2f} s after the first row"
    if abs(zero_s) >= LONG_AGO_S:
        since += f" (at {digits(signal.time_s or 0.0)} s)"
    if signal.verdict == "channel":
        who = _capital(instances[(signal.channel or 1) - 1].who)
        yield f"{who} is wrong on {on}, beginning {since}: it {signal.text}."
    elif signal.verdict == "one_of":
        yield f"One of the two is wrong on {on}, beginning {since}: {signal.text}; two alone do not show which."
    else:
        yield f"The channels of {on} differ, beginning {since}: {signal.text}. The log does not show which is wrong."
    if signal.smallest_told is not None:
        yield f"A step below {signal.smallest_told:.3g}{unit} would not be detected."
    if signal.in_flight is not None:
        yield of_fault(signal.in_flight, signal, instances)


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
