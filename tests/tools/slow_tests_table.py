"""Small faults found, by place and state of the reference: the built-in manager without and with slow-fault tests.

    python tests/tools/slow_tests_table.py WORST.toml TRIALS CAMPAIGN...

WORST.toml : largest error of each reference; campaigns as of rig benchmark, whose aircraft have the tests
"""

import sys
import tomllib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl
from numpy.random import SFC64, Generator

from rig.computer.redundancy.managers import Manager
from rig.computer.redundancy.slow_tests_config import OFF
from rig.studies.benchmark.benchmark_trials import _whole, became, shared_out, streams_of, with_reference
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.cell_trials import Recordings, fly_trials
from rig.studies.reliability.drawn import Cell, cell, draw, refill

STATES = ("as flown", "off", "absent")


def managers(made: Cell) -> dict[str, Manager]:
    """The rows of the table."""
    bare = made.one.manager.params.copy()
    for key in OFF:
        bare[key] = 0.0
    return {"without": Manager("cross-channel", bare), "with": made.one.manager}


def trials(campaign: Path, worst: dict[str, float], count: int) -> Iterator[dict[str, Any]]:
    """A record of each trial, manager and state of the reference."""
    plan = Plan(read(campaign, {}), str(campaign))
    recordings = Recordings(plan)
    for unit in shared_out(plan, count, 0):
        made, choice = cell(plan, unit.number, named=False), plan.choices[unit.number]
        name, streams = made.scenario.faults[made.tested].signal, streams_of(unit)
        drawn = _whole(draw(made, unit.trials, recordings(unit, made, ""), Generator(SFC64(streams[0]))))
        for state in STATES:
            seen = with_reference(made, drawn, state, worst[name])
            for who, manager in managers(made).items():
                told = made._replace(one=made.one._replace(manager=manager))
                again = partial(refill, seen, *(Generator(SFC64(child)) for child in streams[1:]))
                outcomes = became(made, drawn.onset, fly_trials(told, seen, again)[0])["outcome"]
                place = {"place": choice["design"], "signal": name, "state": state, "manager": who}
                yield from ({**place, "outcome": str(outcome)} for outcome in outcomes)


def main() -> None:
    """See above."""
    worst = tomllib.loads(Path(sys.argv[1]).read_text())
    rows = (row for name in sys.argv[3:] for row in trials(Path(name), worst, int(sys.argv[2])))
    table = pl.DataFrame(list(rows))
    print("isolated, % (healthy channel failed)")
    for (place, state), part in table.group_by("place", "state", maintain_order=True):
        rows = part.group_by("manager", maintain_order=True)
        print(f"{place:22} {state:10}", *(f"{who}: {share(of)}" for (who,), of in rows), sep="  ")
    flown = table.filter(pl.col("state") == STATES[0])
    for (who, signal), part in flown.group_by("manager", "signal", maintain_order=True):
        print(f"{who:10} {signal:22} {share(part)}")


def share(part: pl.DataFrame) -> str:
    """Isolated, and healthy channels failed, in percent."""
    words = part["outcome"].to_list()
    isolated, missed = (words.count(word) for word in ("isolated", "missed"))
    return f"{100 * isolated / len(words):5.1f} ({100 * (len(words) - isolated - missed) / len(words):4.1f})"


if __name__ == "__main__":
    main()
