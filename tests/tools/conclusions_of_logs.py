"""Conclusions against the rows of their logs: isolations, findings of the fault-tolerant law, the load factor.

    python tests/tools/conclusions_of_logs.py [NAME ...]

Flies the bundled scenarios, all of them if none is named, scores each log and reads its sentences.  The facts are
derived here from the rows alone, without rig.verdict; with several computers only the transient is compared.
Prints a line a scenario and the number of contradictions; exit code 1 where there are any.
"""

import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.core.frame import DISCRETES, SIGNALS, DecidedBy, State, Trust
from rig.flight import loop
from rig.flight.fly import fly
from rig.log import read_log
from rig.scenario.scenario import Scenario, names
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

COMPARISON = "comparison"
WORDS = {  # what isolated a channel, by the rule of the row
    "comparison": "by comparison",
    "ilm": "by the in-line monitors",
    "trend": "by the trend",
    "reference": "by the reference",
    "extremes": "as one of the two extremes",
    "middle": "because it was not the middle channel",
    "box": "with its whole LRU",
    "common": "with all channels: two references disagreed with them",
    "slow": "by a slow-fault rule",
    "slow_means": "by the slow-fault test of means",
    "slow_squares": "by the slow-fault test of mean squares",
    "slow_halves": "by the slow-fault test of halves against the reference",
    "lane": "because its computer was isolated",
    "given_up": "with all channels: no tie-break rule settled the split",
}
ANY = "*"  # signals that a row counts and does not name
PLACES = [*(s.name for s in SIGNALS), *(d.name for d in DISCRETES)]
N_Z = next(i for i, s in enumerate(SIGNALS) if s.name == "normal_load_factor")
_LABEL = re.compile(r"^(.*?), channels? (\d(?:(?:, | and )\d)*): ")
_MORE = re.compile(r"(?:(.*) and (\d+) more|all (\d+)) signals")
_TIME = re.compile(r"(?:from|at) ([\d.]+) s\b")
_AFTER = re.compile(r"isolated (?:at once|after ([\d.]+) (ms|s)( to [\d.]+ m?s)?) ?([^;]*)")
_ANOTHER = re.compile(r"not isolated for it: the channel was isolated at ([\d.]+) s")
_HEALTHY = re.compile(r": healthy, isolated by mistake at ([\d.]+) s (.*) \(faulty: ")
_BY_DESIGN = re.compile(r": isolated at ([\d.]+) s with ")
_LAW = re.compile(r"it used its estimate of the pitch angle from ([\d.]+) s on")
_MOVED = re.compile(
    r"^aircraft: load factor (?:within ([\d.]+) g of|up to ([\d.]+) g from) the flight without the faults?"
)
_COUNT = re.compile(r"(\d+) of \d+ (?:detectable )?faults detected")
_WRONG = re.compile(r"(no|\d+) healthy channels? isolated")


class Isolated(NamedTuple):
    """A channel that became failed."""

    place: str
    channel: int  # from 1
    at_s: float
    by: str  # "": not told


def isolated(rows: Any, rate_hz: float) -> list[Isolated]:
    """Return every change to failed, in order of time."""
    found = []
    for field, places in (("state", SIGNALS), ("discrete_state", DISCRETES)):
        failed = rows[field] == State.FAILED
        became = failed & ~np.concatenate([np.zeros_like(failed[:1]), failed[:-1]])
        for k, i, c in np.argwhere(became):
            by = COMPARISON
            if field == "state" and rows["valid"][k, i, c] and np.isfinite(rows["channels"][k, i, c]):
                decided_by = DecidedBy(rows["decided_by"][k, i])
                by = COMPARISON if decided_by in (DecidedBy.NONE, DecidedBy.UNRESOLVED) else decided_by.name.lower()
            found.append(Isolated(places[i].name, int(c) + 1, k / rate_hz, by))
    return sorted(found, key=lambda each: each.at_s)


def places(sentence: str) -> tuple[list[str], list[int], int]:
    """Return the signals of a sentence, ANY for those that are only counted, its channels, and how many places."""
    label = _LABEL.match(sentence)
    if label is None:
        return [], [], 0
    channels = [int(number) for number in re.findall(r"\d", label[2])]
    if (more := _MORE.fullmatch(label[1])) is not None:
        count = int(more[3]) if more[3] else int(more[2]) + 1
        return [ANY], channels, count * len(channels)
    names = [name.replace(" ", "_") for name in re.split(r", | and ", label[1])]
    names = names if all(name in PLACES for name in names) else []
    return names, channels, len(names) * len(channels)


def rule_of(words: str) -> str:
    """Return the rule that isolated a channel by the words of a sentence; "" if they name none."""
    return next((name for name, told in WORDS.items() if words.strip() == told), "")


def claimed(sentences: Sequence[str]) -> list[Isolated]:
    """Return every isolation that the sentences tell; its time is NaN if they give a range."""
    told: list[Isolated] = []
    for line in sentences:
        names, channels, _ = places(line)
        at_s, by = np.nan, ""
        if (healthy := _HEALTHY.search(line)) is not None:
            at_s, by = float(healthy[1]), rule_of(healthy[2])
        elif (design := _BY_DESIGN.search(line)) is not None:
            at_s = float(design[1])
        elif (other := _ANOTHER.search(line)) is not None:
            at_s = float(other[1])
        elif (after := _AFTER.search(line)) is not None:
            scale = 1e-3 if after[2] == "ms" else 1.0
            at_s = onset_s(line) + scale * float(after[1] or 0.0) if after[3] is None else np.nan
            by = rule_of(after[4])
        else:
            continue
        told += [Isolated(name, c, at_s, by) for name in names for c in channels]
    return told


def onset_s(sentence: str) -> float:
    """Return when the fault of a sentence began."""
    return float(_TIME.findall(sentence)[0])


def contradictions(scenario: Scenario, rows: Any, baseline: Any, sentences: Sequence[str]) -> list[str]:
    """Return what the sentences state and the rows do not have, and what the rows have and no sentence states.

    baseline : rows of the fault-free flight, with which the log was scored
    """
    found = [*_transients(scenario, rows, baseline, sentences)]
    if scenario.computers.count == 1:
        found += [
            *_isolations(scenario, rows, sentences),
            *_law(scenario, rows, sentences),
            *_counts(scenario, sentences),
        ]
    return found


def _isolations(scenario: Scenario, rows: Any, sentences: Sequence[str]) -> Iterator[str]:
    off_s = 0.5 / scenario.rate_hz + 0.011  # times are told to 10 ms
    flown, told = isolated(rows, scenario.rate_hz), claimed(sentences)

    def same(told: Isolated, flown: Isolated) -> bool:
        alike = told.place in (ANY, flown.place) and told.channel == flown.channel
        in_time = bool(np.isnan(told.at_s)) or abs(told.at_s - flown.at_s) <= off_s
        return alike and in_time and told.by in ("", flown.by)

    for each in told:
        if not any(same(each, other) for other in flown):
            yield f"told and not flown: {each}"
    seen: set[tuple[str, int]] = set()
    for each in flown:
        if each[:2] not in seen and not any(same(other, each) for other in told):
            yield f"flown and not told: {each}"
        seen.add(each[:2])


def _law(scenario: Scenario, rows: Any, sentences: Sequence[str]) -> Iterator[str]:
    """Compare what the law corrected while a fault acted on the pitch angle."""
    corrected = rows["trust"] == Trust.CORRECTED
    starts = np.flatnonzero(corrected & ~np.concatenate([[False], corrected[:-1]])) / scenario.rate_hz
    told = [float(found[1]) for line in sentences if (found := _LAW.search(line))]
    for at_s in told:
        if not any(abs(at_s - start) <= 0.011 for start in starts):
            yield f"told that the law corrected at {at_s} s, and it did not"
    acting = np.unpackbits(rows["acting"], axis=1, bitorder="little")
    for i, fault in enumerate(scenario.faults):
        on = [point for point in fault.points if point.place == "pitch_angle" and point.channel is not None]
        frames = np.flatnonzero(acting[:, i])
        if not on or not fault.changes_samples or not len(frames):
            continue
        within = [at_s for at_s in starts if frames[0] <= at_s * scenario.rate_hz <= frames[-1]]
        if within and not any(abs(within[0] - at_s) <= 0.011 for at_s in told):
            yield f"the law corrected at {within[0]} s, and no sentence says so"
        wrong = [line for line in sentences if line.startswith("pitch angle, channel") and "not isolated" in line]
        if within and wrong:
            yield f"the law corrected at {within[0]} s, and it is told: {wrong[0]}"


def _counts(scenario: Scenario, sentences: Sequence[str]) -> Iterator[str]:
    """Compare the first sentence with the others, where all faults sit on channels."""
    if not all(point.place in PLACES for fault in scenario.faults for point in fault.points):
        return
    first, detected, healthy = sentences[0], 0, 0
    for line in sentences[1:]:
        *_, count = places(line)
        if _HEALTHY.search(line):
            healthy += count
        elif (_AFTER.search(line) or "by the fault-tolerant law" in line) and not _ANOTHER.search(line):
            detected += count
    told, wrong = _COUNT.search(first), _WRONG.search(first)
    if detected != (int(told[1]) if told else 0):
        yield f"{detected} detected by the sentences; {first}"
    if wrong is None or healthy != (0 if wrong[1] == "no" else int(wrong[1])):
        yield f"{healthy} healthy channels isolated by the sentences; {first}"


def _transients(scenario: Scenario, rows: Any, baseline: Any, sentences: Sequence[str]) -> Iterator[str]:
    """Compare the load factor with that of the fault-free flight, if a fault acted."""
    n = min(len(rows), len(baseline))
    off = np.abs(rows["truth"][:n, N_Z] - baseline["truth"][:n, N_Z])
    largest = float(off[np.isfinite(off)].max(initial=0.0))
    moved = _MOVED.match(sentences[-1])
    if moved is None:
        if rows["acting"].any():
            yield f"no load factor against the fault-free flight: {sentences[-1]}"
        return
    shown, rounding = (float(moved[1]), 0.0005) if moved[1] else (float(moved[2]), 0.005)
    if abs(max(largest, 0.001) - shown) > rounding + 1e-9:
        yield f"the load factor was off by {largest} g: {sentences[-1]}"


def check(name: str) -> tuple[list[str], int]:
    """Fly a scenario, score its log; return the contradictions, and how many sentences there were."""
    with tempfile.TemporaryDirectory() as folder:
        flight = fly(name, out=folder)
        log, scored = read_log(flight.log), score_log(flight.log, Yardstick())
        scenario = scored.scenario
        baseline = loop.fly_rows(scenario.model_copy(update={"faults": []}), log.frames)
        found = contradictions(scenario, log.rows, baseline, scored.conclusion)
    return found, len(scored.conclusion)


def main() -> int:
    """One line a scenario; the number of contradictions last."""
    asked, contradicting, sentences = sys.argv[1:] or names(), 0, 0
    for name in asked:
        found, count = check(name)
        contradicting, sentences = contradicting + len(found), sentences + count
        print(f"{name:40} {count:3} sentences, {len(found)} contradictions", flush=True)
        for text in found:
            print(f"    {text}", flush=True)
    print(f"{len(asked)} scenarios, {sentences} sentences, {contradicting} contradictions")
    return 1 if contradicting else 0


if __name__ == "__main__":
    sys.exit(main())
