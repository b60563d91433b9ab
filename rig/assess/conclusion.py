"""The conclusion of a flight as a person would say it: a sentence for each fault, each pattern, each wrong isolation,
and one for the flight.

Made from the log and its score alone, so that every command that shows a flight prints the same sentences.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.context import Context, channel
from rig.assess.fault_sentence import fault_sentences
from rig.assess.pattern_sentence import pattern_sentences
from rig.assess.record import BY_DESIGN, Isolation, Score
from rig.frame import Block
from rig.scenario import Scenario
from rig.units.quantities import seconds

NEXT: Final = ("score", "view", "replay")  # commands that take a log


def conclusion(scenario: Scenario, rows: Block, params: NDArray[np.void], score: Score) -> list[str]:
    """Return the sentences: faults, patterns without a majority, healthy channels that were failed, the flight.

    rows : (n,) of the log; params : (S,) config.PARAMS of its manager (scoring.monitor)
    """
    about = Context(scenario, rows, params, score)
    return [
        *fault_sentences(about),
        *pattern_sentences(about),
        *_healthy(score.false_alarms, "although no channel of it was faulty", about),
        *_healthy(score.wrong_isolations, "although another channel was the faulty one", about),
        *_by_design(score, about),
        _flight(about),
    ]


def next_commands(log: Path) -> list[str]:
    """Return the commands that show more of a log, as they are typed."""
    return [f"rig {command} {quote(str(log))}" for command in NEXT]


def _healthy(found: Sequence[Isolation], although: str, about: Context) -> list[str]:
    return [
        f"{channel(one.signal, one.channel)} was healthy and was failed at {seconds(one.frame, about.rate_hz)} "
        f"by {one.resolver}, {although}"
        for one in found
    ]


def _by_design(score: Score, about: Context) -> Iterator[str]:
    """Healthy channels that a rule failed for faults elsewhere: one sentence for each channel number and frame."""
    whys = {"failed with its box": "with its box, which was faulty on others", "failed by rule": "by rule: common mode"}
    groups: dict[tuple[str, int, int], list[str]] = {}
    for kind, each in score.isolations:
        if kind in BY_DESIGN:
            groups.setdefault((whys[kind], each.channel, each.frame), []).append(each.signal)
    for (why, number, frame), signals in groups.items():
        yield f"channel {number} was failed {why}, at {seconds(frame, about.rate_hz)} on {', '.join(signals)}"


def _flight(about: Context) -> str:
    flight, score = about.score.flight, about.score
    ended = seconds(flight.frames, about.rate_hz)
    if not flight.survived:
        head = f"the aircraft was lost at {ended}: {flight.end_reason}"
    else:
        head = f"the aircraft survived ({flight.end_reason}, {ended})"
    lost = [name for name, one in score.signals.items() if one.level_at_end == 0 and not about.silent(name)]
    if lost:
        head += f"; no channel left of {', '.join(lost)}"
    return f"{head}; {_counted(about)}"


def _counted(about: Context) -> str:
    """How many of the detectable faults, counted by channel, were detected, and what was failed wrongly."""
    outcomes = [fault.outcome for fault in about.score.faults]
    if not outcomes:
        found = "no fault was in the scenario"
    else:
        detected = outcomes.count("detected")
        possible = detected + outcomes.count("missed")
        found = f"{detected} of {possible} detectable faults detected" if possible else "no fault could be detected"
    wrong = len(about.score.false_alarms) + len(about.score.wrong_isolations)
    by_design = "".join(
        f", {count} {kind}" for kind in BY_DESIGN if (count := [k for k, _ in about.score.isolations].count(kind))
    )
    return f"{found}, {wrong or 'no'} healthy channel{'s' if wrong > 1 else ''} failed{by_design}"
