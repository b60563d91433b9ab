"""Slow-fault tests of an aircraft from healthy flights that are flown here, without logs: a scenario with their tables.

    python tests/tools/slow_tests_design.py CAMPAIGN FIRST LAST AIRCRAFT [SCENARIO]

Flies the runs of AIRCRAFT from FIRST to LAST - 1, and prints what rig thresholds --slow-tests prints of their logs, at
the thresholds that the aircraft has; SCENARIO gets the tables.
"""

import sys
from pathlib import Path
from typing import Any

import tomli_w

from rig.cli.show_slow_tests import show_slow_tests
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.frame import SIGNALS
from rig.flight import loop
from rig.scenario import aircraft
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.thresholds.design_report import of_slow_tests
from rig.studies.thresholds.slow_test_factors import RESERVE, Measured, SlowDesign, bare_tests, slow_design, watched
from rig.verdict.monitored_places import monitor
from rig.world import sensors

NAMES = [signal.name for signal in SIGNALS]
HEAD = """\
# {aircraft} with slow-fault tests on all signals, designed by tests/tools/slow_tests_design.py: {reserve:g} times the
# largest share of each limit in {flights} healthy flights ({hours:.3g} h) of the campaign "healthy",
# with manoeuvres and up to severe turbulence.
"""


def measured(plan: Plan, number: int) -> tuple[dict[str, Measured], Any, float]:
    """What each signal of a flight is measured to be, the scenario, and its hours."""
    run = plan[number]
    scenario = run.scenario(aircraft.tables(run.aircraft))
    rows, params = loop.fly_rows(scenario), monitor(scenario)
    of_signals = {
        name: watched((rows["channels"][:, s], rows["reference"][:, s]), params[s], bare_tests(figures(scenario, s)))
        for s, name in enumerate(NAMES)
    }
    return of_signals, scenario, len(rows) / scenario.rate_hz / 3600.0


def figures(scenario: Any, s: int) -> SlowTests:
    """The figures of the sensor of signal ``s``."""
    return SlowTests.model_validate(sensors.data_sheets(scenario.sensors, scenario.rate_hz)[s]._asdict())


def designed(flights: list[dict[str, Measured]], scenario: Any) -> dict[str, SlowDesign]:
    """The design of each signal."""
    params = monitor(scenario)
    beside = [(float(p["threshold"]), int(p["fitted"])) for p in params]
    return {
        name: slow_design([of[name] for of in flights], figures(scenario, s), beside[s], scenario.rate_hz)
        for s, name in enumerate(NAMES)
    }


def main() -> None:
    """See above."""
    campaign, first, last, name = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    plan = Plan(read(Path(campaign), {}), campaign)
    found = [measured(plan, number) for number in range(first, last) if plan[number].aircraft == name]
    made = designed([of for of, _, _ in found], found[0][1])
    told = {name: {"unit": SIGNALS[s].unit, "slow_tests": of_slow_tests(made[name])} for s, name in enumerate(NAMES)}
    show_slow_tests(told)
    if len(sys.argv) > 5:
        head = HEAD.format(aircraft=name, reserve=RESERVE, flights=len(found), hours=sum(of[2] for of in found))
        signals = {name: {"slow_tests": of.keys} for name, of in made.items()}
        tables = {"aircraft": name, "redundancy": {"signals": signals}}
        Path(sys.argv[5]).write_text(head + "\n" + tomli_w.dumps(tables))


if __name__ == "__main__":
    main()
