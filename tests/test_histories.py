"""Incident reconstructions with every manager: docs/results/measured/references.md is compared with these flights."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.core.frame import Table
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.verdict.score_records import Score
from rig.verdict.scoring import score

PAGE = Path(__file__).parent.parent / "docs" / "results" / "measured" / "references.md"
SIGNALS = {
    "history_qf72": "angle_of_attack",
    "history_xl888t": "angle_of_attack",
    "history_afti_flight_44": "roll_rate",
    "history_blocked_pitot": "dynamic_pressure",
}
ORDERS = {
    "built-in (ILM, trend, reference)": ["ilm", "trend", "reference"],
    "built-in (reference first)": ["reference", "ilm", "trend"],
    "built-in (trend alone)": ["trend"],
}
MANAGERS = ("mean", "median", "cross-voter", "selection")


def settings(manager: str, signal: str) -> str:
    if manager in ORDERS:
        return f"redundancy.signals.{signal}.tie_break={ORDERS[manager]}"
    return f"redundancy.manager={manager}"


def fly(name: str, manager: str, *sets: str) -> Score:
    which = scenario.load(name, [settings(manager, SIGNALS[name]), *sets])
    return score(which, Table(np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])))


def row(name: str, manager: str, found: Score) -> str:
    """The line of docs/results/measured/references.md."""
    detected = [fault for fault in found.faults if fault.outcome == "detected"]
    delays = ", ".join(str(fault.delay_from_exceeded_frames) for fault in detected)
    wrong = ", ".join(f"{w.channel} at {w.frame / 100:.2f} s" for w in found.wrong_isolations)
    peak = found.vote_error[SIGNALS[name]].peak
    cells = (f"`{name}`", manager, f"{len(detected)} of {len(found.faults)}", delays, wrong, f"{peak:.3g}")
    return f"| {' | '.join(cells)} | {'yes' if found.flight.survived else 'no'} |"


def flights() -> Iterator[Any]:
    """Each history with one manager, and one history with each, are quick."""
    quick = {*zip(SIGNALS, (*list(ORDERS)[:3], "selection"), strict=True)}
    quick |= {(next(iter(SIGNALS)), manager) for manager in MANAGERS}
    for name, manager in product(SIGNALS, (*ORDERS, *MANAGERS)):
        yield pytest.param(name, manager, marks=() if (name, manager) in quick else pytest.mark.long)


@pytest.mark.parametrize(("name", "manager"), [*flights()])
def test_a_history_ends_as_the_page_says(name: str, manager: str):
    assert row(name, manager, fly(name, manager)) in PAGE.read_text()


def test_a_majority_that_is_wrong_outvotes_the_good_channel():
    """Two vanes frozen alike of three whose samples may repeat, and three pitot lines closed of four: no comparison can
    know better."""
    repeats = "redundancy.signals.angle_of_attack.stale_frames=0"
    for name, good in (("history_xl888t", 3), ("history_blocked_pitot", 4)):
        found = fly(name, "built-in (reference first)", repeats)
        assert [w.channel for w in found.wrong_isolations] == [good]
        assert {fault.outcome for fault in found.faults} == {"missed"}


if __name__ == "__main__":
    print("| scenario | manager | detected | delay, frames | wrong isolations | vote error | survived |")  # noqa: T201
    print("|---|---|---|---|---|---|---|")  # noqa: T201
    for each in SIGNALS:
        for who in (*ORDERS, *MANAGERS):
            print(row(each, who, fly(each, who)))  # noqa: T201 # the table of docs/results/measured/references.md
