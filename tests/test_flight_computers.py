"""Events of several computers: which lane was failed by whom for what, who leads, why the back-up flies."""

from functools import cache

import pytest

from rig.core.frame import Table
from rig.flight import lane_events as computers
from rig.flight.loop import Rig, frames
from rig.flight.recorder import Findings
from rig.scenario import scenario

FOUR = ["computers.count=4", "turbulence=none"]
WRONG = 'kind="wrong_command", signal="computer.B", surface="elevator"'


@cache
def found(*faults: str, commands: str = "", seconds: float = 1.0, more: tuple[str, ...] = ()) -> Findings:
    """The findings of an F-16 with four computers, whose faults begin at 0.3 s."""
    tables = ", ".join(f"{{{fault}{'' if 'start_s' in fault else ', start_s=0.3'}}}" for fault in faults)
    sets = [*FOUR, f"duration_s={seconds}", f"faults=[{tables}]", f"computers.commands=[{commands}]", *more]
    which = scenario.load(None, sets)
    rig, findings = Rig(which), Findings(which)
    for rows, timing in frames(rig, which):
        for lanes in rig.beside(len(rows)):
            findings.record(Table(rows, lanes, timing))
    return findings


def events(findings: Findings) -> list[tuple[int, str, str]]:
    return [
        (event.frame, event.name, event.text)
        for event in findings.events
        if event.name.startswith(("lane", "leading", "link", "back-up", "actuator"))
    ]


def test_a_wrong_command_is_told_with_the_lanes_that_found_it_and_after_how_long():
    # five frames beyond the threshold, those of 0.30 to 0.34 s; failed a frame later
    told = "B: by lanes A, C and D in the vote of commands, 50 ms after the onset of its fault"
    assert events(found(WRONG)) == [(35, "lane failed", told)]
    assert found(WRONG).computers.failed_at() == {"B": 0.35}


def test_a_lane_that_stops_leads_no_more_and_its_links_fail():
    assert events(found('kind="computer_stop", signal="computer.A"')) == [
        (30, "leading lane", "B: leads instead of A"),
        (31, "lane failed", "A: by its own watchdog, 10 ms after the onset of its fault"),
        (34, "link failed", "A: to all others"),
    ]


def test_a_lane_that_starts_again_is_readmitted_by_command_when_it_has_agreed_long_enough():
    stop = 'kind="computer_stop", signal="computer.B", duration_s=0.1'
    orders = '{at_s=0.6, do="readmit", lane="B"}, {at_s=1.5, do="readmit", lane="B"}'
    told = events(found(stop, commands=orders, seconds=1.6))
    assert [each for each in told if each[1].startswith("lane") and each[0] > 35] == [
        (40, "lane restarting", "B: running again, not engaged"),
        (60, "lane not readmitted", "B: it has not agreed with the leading lane for long enough"),
        (150, "lane readmitted", "B: by command"),
    ]
    assert (40, "link back", "B: to all others") in told


def test_a_lane_that_the_pilot_switches_off_was_not_failed():
    findings = found(commands='{at_s=0.5, do="disengage", lane="A"}')
    assert events(findings) == [
        (50, "lane disengaged", "A: by command"),
        (50, "leading lane", "B: leads instead of A"),
    ]
    assert not findings.computers.failures


@pytest.mark.parametrize(
    ("faults", "commands", "why"),
    [
        ((), '{at_s=0.5, do="backup"}', computers.BY_COMMAND),
        (tuple(f'kind="computer_stop", signal="computer.{name}"' for name in "ABCD"), "", computers.NONE_ENGAGED),
    ],
)
def test_the_back_up_says_why_it_flies(faults: tuple[str, ...], commands: str, why: str):
    findings = found(*faults, commands=commands)
    assert findings.computers.backup is not None and findings.computers.backup[1] == why
    assert [text for _, name, text in events(findings) if name == computers.BACKUP] == [why]


def test_a_vote_that_no_rule_settles_leads_to_the_back_up():
    two = tuple(f'kind="wrong_command", signal="computer.{name}", surface="elevator"' for name in "CD")
    findings = found(*two)
    assert findings.computers.backup is not None and findings.computers.backup[1] == computers.UNRESOLVED


def test_a_link_that_comes_back_is_told():
    told = events(found('kind="link_loss", signal="ccdl.A-B", duration_s=0.2'))
    assert told == [(34, "link failed", "A: to lane B"), (50, "link back", "A: to lane B")]


def test_nothing_is_told_of_healthy_lanes_nor_of_one_computer():
    assert events(found()) == [] == events(found(more=("computers.count=1",)))
