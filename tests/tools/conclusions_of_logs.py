"""Conclusions against the rows of their logs: who was isolated, when and by whom, what the fault-tolerant law found,
and the load factor against the fault-free flight.

    python tests/tools/conclusions_of_logs.py [NAME ...]

Flies the bundled scenarios, all of them if none is named, scores each log and reads its sentences.  What they must say
is derived here from the rows alone, without rig.verdict; of several computers the transient is.  Prints a line a
scenario and the number of contradictions; exit code 1 where there are any.
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
WORDS = {  # how a fault's sentence ends, by the rule of the row
    "ilm": "by the in-line monitors",
    "trend": "by the trend",
    "reference": "by the reference",
    "extremes": "as one of the extremes",
    "middle": "for not being the middle one",
    "box": "with its whole box",
    "common": "with all channels: two references agreed against them",
    "slow": "by the sum of its small deviations",
    "lane": "because its computer is failed",
    "given_up": "with all channels: no rule had answered the split",
}
PLACES = [*(s.name for s in SIGNALS), *(d.name for d in DISCRETES)]
N_Z = next(i for i, s in enumerate(SIGNALS) if s.name == "normal_load_factor")
_WHERE = re.compile(rf"^({'|'.join(PLACES)}) channels? (\d(?:(?:, | and )\d)*) ")
_TIME = re.compile(r"(?:from|at) ([\d.]+) s")
_FAILED = re.compile(r"was failed (?:([\d.]+) (ms|s) later|at ([\d.]+) s)([^;]*)")
_ANOTHER = re.compile(r"was not found: the channel was failed at ([\d.]+) s for another fault")
_HEALTHY = re.compile(r"^(\w+) channel (\d) was healthy and was failed at ([\d.]+) s by (\w+)")
_BY_DESIGN = re.compile(r"^channel (\d) was failed .*, at ([\d.]+) s on (.*)$")
_LAW = re.compile(r"the fault-tolerant law .*estimate of the pitch angle from ([\d.]+) s on")
_MOVED = re.compile(r"the load factor stayed within ([\d.e+-]+) g of the fault-free flight's for ([\d.e+-]+) s")
_COUNT = re.compile(r"(\d+) of (\d+) detectable faults detected")
_WRONG = re.compile(r"(no|\d+) healthy channels? failed")


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


def claimed(sentences: Sequence[str]) -> list[Isolated]:
    """Return every isolation that the sentences tell."""
    told: list[Isolated] = []
    for line in sentences:
        if (healthy := _HEALTHY.match(line)) is not None:
            told.append(Isolated(healthy[1], int(healthy[2]), float(healthy[3]), healthy[4]))
        elif (design := _BY_DESIGN.match(line)) is not None:
            told += [Isolated(name, int(design[1]), float(design[2]), "") for name in design[3].split(", ")]
        elif (where := _WHERE.match(line)) is not None:
            head, _, result = line.partition("; ")
            channels = [int(number) for number in re.findall(r"\d", where[2])]
            if (other := _ANOTHER.search(result)) is not None:
                told += [Isolated(where[1], c, float(other[1]), "") for c in channels]
            elif (failed := _FAILED.search(result)) is not None:
                scale = 1e-3 if failed[2] == "ms" else 1.0
                at_s = float(failed[3]) if failed[3] else onset_s(head) + scale * float(failed[1])
                by = next((name for name, words in WORDS.items() if failed[4].strip() == words), COMPARISON)
                told += [Isolated(where[1], c, at_s, by) for c in channels]
    return told


def onset_s(head: str) -> float:
    """Return when the fault of a sentence began."""
    return float(_TIME.findall(head)[-1])


def contradictions(scenario: Scenario, rows: Any, baseline: Any, sentences: Sequence[str]) -> list[str]:
    """Return what the sentences say that the rows do not, and what the rows hold and no sentence says.

    baseline : rows of the fault-free flight, with which the log was scored
    """
    found = [*_transients(scenario.rate_hz, rows, baseline, sentences)]
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

    def same(a: Isolated, b: Isolated) -> bool:
        alike = a[:2] == b[:2] and abs(a.at_s - b.at_s) <= off_s
        return alike and (a.by == b.by or "" in (a.by, b.by))

    for each in told:
        if not any(same(each, other) for other in flown):
            yield f"told and not flown: {each}"
    seen: set[tuple[str, int]] = set()
    for each in flown:
        if each[:2] not in seen and not any(same(each, other) for other in told):
            yield f"flown and not told: {each}"
        seen.add(each[:2])


def _law(scenario: Scenario, rows: Any, sentences: Sequence[str]) -> Iterator[str]:
    """What the law corrected while a fault acted on the pitch angle."""
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
        wrong = [line for line in sentences if line.startswith("pitch_angle channel") and "; it was not found" in line]
        if within and wrong:
            yield f"the law corrected at {within[0]} s, and it is told: {wrong[0]}"


def _counts(scenario: Scenario, sentences: Sequence[str]) -> Iterator[str]:
    """The last sentence against those before it, where all faults sit on channels."""
    if not all(point.place in PLACES for fault in scenario.faults for point in fault.points):
        return
    last, detected = sentences[-1], 0
    for line in sentences[:-1]:
        where, result = _WHERE.match(line), line.partition("; ")[2]
        if where is not None and "was healthy" not in line and "no majority" not in line:
            found = "was found by the fault-tolerant law" in result or _FAILED.search(result)
            detected += len(re.findall(r"\d", where[2])) if found and not _ANOTHER.search(result) else 0
    count, wrong = _COUNT.search(last), _WRONG.search(last)
    healthy = sum(" was healthy and was failed " in line for line in sentences)
    if detected != (int(count[1]) if count else 0):
        yield f"{detected} detected by the sentences; {last}"
    if wrong is None or healthy != (0 if wrong[1] == "no" else int(wrong[1])):
        yield f"{healthy} healthy channels failed by the sentences; {last}"


def _transients(rate_hz: float, rows: Any, baseline: Any, sentences: Sequence[str]) -> Iterator[str]:
    """The load factor against the fault-free flight, wherever a sentence states it."""
    n = min(len(rows), len(baseline))
    off = np.abs(rows["truth"][:n, N_Z] - baseline["truth"][:n, N_Z])
    for line in sentences:
        if (moved := _MOVED.search(line)) is None:
            if "load factor" in line.partition("; ")[2] and "departure" not in line:
                yield f"a load factor that is not against the fault-free flight: {line}"
            continue
        first = round(onset_s(line.partition("; ")[0]) * rate_hz)
        part = off[first : first + round(float(moved[2]) * rate_hz) + 1]
        largest = float(part[np.isfinite(part)].max(initial=0.0))
        if abs(largest - float(moved[1])) > 0.006 * largest + 1e-9:
            yield f"the load factor was off by {largest} g: {line}"


def check(name: str) -> tuple[list[str], int]:
    """Fly a scenario, score its log; return the contradictions, and how many sentences there were."""
    with tempfile.TemporaryDirectory() as folder:
        flight = fly(name, out=folder)
        log, scored = read_log(flight.log), score_log(flight.log, Yardstick())
        scenario = scored.scenario
        baseline = loop.fly_rows(scenario.model_copy(update={"faults": []}), log.frames)
        found = contradictions(scenario, log.rows, baseline, scored.conclusion)
    if any("the load factor" in line for line in flight.conclusion):
        found.append("rig fly tells of a load factor, and has no fault-free flight")
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
