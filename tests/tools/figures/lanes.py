"""Four computers measured with every fault of theirs: single ones, one lane after the other, the program of all.

Four lanes with servo actuators in light turbulence; the onset, the lane and the surface of a fault are drawn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import permutations, product
from pathlib import Path
from statistics import median
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from figures import table
from figures.actuators import AIRCRAFT, ONSET_S, flown, transient
from rig.core.frame import COMPUTERS, INDEX, State
from rig.flight.lane_events import ComputerFinder, is_engaged, test_name
from rig.studies.campaign.flying import CampaignFlight
from rig.verdict.score_records import Score
from rig.verdict.scoring import score

FOUR: Final = "computers.count=4"
ONE_ROUND: Final = "computers.exchange_rounds=1"
LIMITS: Final = (0.5, 10.0)  # g, deg/s
DOES: Final = ("does='offset', offset=0.1", "does='hardover'", "does='stuck'")
DOES_ALL: Final = (*DOES, "does='oscillation', amplitude=0.1, frequency_hz=2.0")
SAYS: Final = ("says='zero'", "says='last'", "says='scale', factor=0.8", "says='offset', offset=0.05")
LINKS: Final = (
    "kind='link_loss'",
    "kind='link_frozen'",
    "kind='link_corrupt'",
    "kind='link_byzantine', offset_thresholds=5.0",
)
LANE: Final = "signal='computer.{lane}'"
SINGLE: Final = {  # what a row of the table is about: its faults
    "computer stops": [f"kind='computer_stop', {LANE}{end}" for end in ("", ", duration_s=1.0")],
    "clock gains 10 %": [f"kind='clock_drift', {LANE}, drift_ppm=100000.0"],
    "command wrong": [f"kind='wrong_command', {LANE}, surface='{{surface}}', {does}" for does in DOES_ALL],
    "output off": [f"kind='dac', {LANE}, surface='{{surface}}', {does}" for does in DOES_ALL],
    "input off": [f"kind='adc', {LANE}, {says}" for says in SAYS],
    "program damaged": [f"kind='checksum', {LANE}, factor=0.9"],
    "link, one way": [f"{kind}, signal='ccdl.{{lane}}-{{other}}'" for kind in LINKS],
    "link, a node": [f"{kind}, signal='ccdl.{{lane}}'" for kind in (*LINKS, f"{LINKS[-1]}, different=true")],
    "a bus": ["kind='power_loss', signal='bus.{bus}'"],
}


def four(aircraft: str, *sets: str) -> CampaignFlight:
    """Fly an aircraft with four lanes and servos."""
    return flown(aircraft, FOUR, *sets)


def beginning(faults: Sequence[tuple[str, float]]) -> str:
    """Return the override of faults, each with its onset, s."""
    return f"faults=[{', '.join(f'{{{fault}, start_s={start_s}}}' for fault, start_s in faults)}]"


def findings(flight: CampaignFlight) -> ComputerFinder:
    """Return who was failed, and why the back-up flies."""
    finder = ComputerFinder(flight.scenario.rate_hz)
    assert flight.table.lane is not None
    finder.find(flight.table)
    return finder


# Single faults.


class Outcome(NamedTuple):
    """What became of one fault."""

    lost: bool
    off: tuple[float, float]  # g, deg/s
    found_by: str  # nothing: no channel
    after_s: float
    others: int  # lanes and channels failed that the fault is not on


def lanes_single(onsets: str = "10") -> None:
    """Print who finds each single fault, after how long, and what the aircraft feels of it."""
    rng = np.random.default_rng(34)
    clean = {
        (name, seed): four(name, "duration_s=12", f"seed={seed}", "faults=[]")
        for name in AIRCRAFT
        for seed in range(int(onsets))
    }
    heads = [
        "fault",
        "flights",
        "lost",
        "g, at most",
        "deg/s, at most",
        "found by",
        "s after, median, longest",
        "missed",
        "others failed",
    ]
    table(
        heads,
        (
            _row(name, [_single(fault, *of, clean[of], rng) for fault in kinds for of in clean])
            for name, kinds in SINGLE.items()
        ),
    )


def _single(fault: str, aircraft: str, seed: int, clean: CampaignFlight, rng: np.random.Generator) -> Outcome:
    lane, other = rng.permutation(len(COMPUTERS))[:2]
    surface = ("elevator", "aileron", "rudder")[rng.integers(3)]
    start_s = int(rng.integers(300, 900)) / 100.0
    text = fault.format(lane=COMPUTERS[lane], other=COMPUTERS[other], surface=surface, bus=1 + rng.integers(2))
    flight = four(aircraft, "duration_s=12", f"seed={seed}", beginning([(text, start_s)]))
    found = scored(flight)
    by, after_s = _found(flight, found, start_s)
    others = len(found.false_alarms) + len(found.wrong_isolations)
    return Outcome(not flight.verdict.survived, transient(flight, clean, start_s), by, after_s, others)


def _found(flight: CampaignFlight, found: Score, start_s: float) -> tuple[str, float]:
    """Return who found the flight's fault, and after how long: of one in samples, who failed its lane."""
    one, rate_hz = next((each for each in found.faults if each.channel is None), None), flight.scenario.rate_hz
    if one is not None:
        return one.decided_by or "", (one.delay_from_onset_frames or 0) / rate_hz
    failures = findings(flight).failures
    return (test_name(failures[0].test), failures[0].frame / rate_hz - start_s) if failures else ("", 0.0)


def scored(flight: CampaignFlight) -> Score:
    """Return the score of a flight."""
    return score(flight.scenario, flight.table)


def _row(name: str, flights: Sequence[Outcome]) -> list[str]:
    after = [each.after_s for each in flights if each.found_by]
    g, rate = np.max([each.off for each in flights], axis=0)
    return [
        name,
        str(len(flights)),
        str(sum(each.lost for each in flights)),
        f"{g:.3f}",
        f"{rate:.2f}",
        counted(each.found_by for each in flights if each.found_by),
        f"{median(after):.2f}, {max(after):.2f}",
        str(len(flights) - len(after)),
        str(sum(each.others for each in flights)),
    ]


# One lane after the other.

LOSSES: Final = {  # of each of four lanes in turn
    "command": "kind='wrong_command', signal='computer.{lane}', surface='elevator', does='hardover'",
    "stop": "kind='computer_stop', signal='computer.{lane}'",
    "link": "kind='link_loss', signal='ccdl.{lane}'",
    "output": "kind='dac', signal='computer.{lane}', surface='elevator', does='hardover'",
}
SURE: Final = "computers.wrap_around.coverage=1"  # else one in twenty outputs is not seen


class Row(NamedTuple):
    """What became of four lanes that were lost one after the other."""

    engaged: str  # their number, up to the back-up
    backup: str  # why it flies
    survived: bool
    off: tuple[float, float]  # g, deg/s, after the last fault


def lanes_in_a_row() -> None:
    """Print all orders of four faults that take lane after lane, A first: how many are left, why the back-up flies."""
    heads = ["wrong command is", "flights", "lanes engaged", "back-up flies because", "survived"]
    heads += ["g after the last, of those", "deg/s"]
    found = [(order, _in_a_row(name, order)) for name, order in product(AIRCRAFT, permutations(LOSSES))]
    rows: list[list[str]] = []
    for place, word in enumerate(("first", "second", "third", "last")):
        rows.append([word, *_sums([row for order, row in found if order[place] == "command"])])
    table(heads, rows)


def _in_a_row(aircraft: str, order: Sequence[str]) -> Row:
    faults = [(LOSSES[kind].format(lane=COMPUTERS[i]), 4.0 + 3.0 * i) for i, kind in enumerate(order)]
    flight, before = (four(aircraft, "duration_s=40", SURE, beginning(faults[:n])) for n in (4, 3))
    backup = findings(flight).backup
    assert flight.table.lane is not None
    counts = is_engaged(flight.table[: None if backup is None else backup[0] + 1]).sum(axis=1)
    left = [counts[0], *counts[1:][np.diff(counts) != 0]]
    why = "it does not" if backup is None else backup[1]
    return Row("-".join(map(str, left)), why, flight.verdict.survived, transient(flight, before, faults[3][1]))


def _sums(rows: Sequence[Row]) -> list[str]:
    engaged, backup = (counted(of) for of in zip(*(row[:2] for row in rows), strict=True))
    survivors = [row.off for row in rows if row.survived]
    off = [f"{g:.2f}" for g in np.max(survivors, axis=0)] if survivors else ["", ""]
    return [str(len(rows)), engaged, backup, f"{len(survivors)} of {len(rows)}", *off]


def counted(names: Iterable[str]) -> str:
    """Return names and how often each is there, the most frequent first."""
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common())


# The program of all.

ORDERED_S: Final = (0.2, 0.5, 1.0, 2.0)  # after the onset


def lanes_software() -> None:
    """Print flights in which the program of all lanes drives the elevator hard over, with and without the pilot."""
    print("; ".join(map(_software, AIRCRAFT)))


def _software(aircraft: str) -> str:
    faults = beginning([("kind='software', signal='computer.all', surface='elevator'", ONSET_S)])
    orders = [f"computers.commands=[{{at_s={ONSET_S + after_s}, do='backup'}}]" for after_s in ORDERED_S]
    clean = four(aircraft, "duration_s=40", "faults=[]")
    alone, *helped = (four(aircraft, "duration_s=40", faults, *sets) for sets in ((), *((order,) for order in orders)))
    outcome, failed = scored(alone).faults[0].outcome, len(findings(alone).failures)
    told = [f"{s} s {_became(flight, clean)}" for s, flight in zip(ORDERED_S, helped, strict=True)]
    return f"{aircraft} {outcome}, {failed} lanes failed, {_became(alone, clean)}, back-up after {', '.join(told)}"


def _became(flight: CampaignFlight, clean: CampaignFlight) -> str:
    if not flight.verdict.survived:
        return f"lost at {flight.verdict.frames / flight.scenario.rate_hz - ONSET_S:.1f} s"
    return f"flies with {transient(flight, clean)[0]:.2f} g"


# A byzantine link and a sensor.


def lanes_asymmetric() -> None:
    """Print flights with a byzantine link and a sensor that is off in which good lanes fail different channels."""
    told = "; ".join(f"{_asymmetric(rounds)} with {word}" for rounds, word in ((1, "one round"), (2, "two")))
    print(f"good lanes failed different channels in {told}")


def _asymmetric(rounds: int) -> str:
    names = [name for name in INDEX if name not in ("stick_pitch", "stick_roll", "pedal")]
    ways = [(i, f"ccdl.{COMPUTERS[i]}-{COMPUTERS[j]}", "") for i, j in permutations(range(4), 2)]
    nodes = [(i, f"ccdl.{COMPUTERS[i]}", ", different=true") for i in range(4)]
    flights = [
        (*byzantine, c, name) for byzantine in (*ways, *nodes) for c in range(4) if c != byzantine[0] for name in names
    ]
    return f"{sum(_parted(rounds, *flight) for flight in flights)} of {len(flights)} flights"


def _parted(rounds: int, wrong_lane: int, link: str, more: str, channel: int, name: str) -> bool:
    """Return True if lanes other than the wrong one have failed different channels of a signal after half a second."""
    byzantine = f"kind='link_byzantine', signal='{link}', offset_thresholds=5.0{more}"
    off = f"kind='offset', signal='{name}', channels=[{channel + 1}], offset_thresholds=10.0"
    sets = [f"computers.exchange_rounds={rounds}", "actuators.model=lag", "duration_s=1"]
    flight = four("f16", *sets, beginning([(byzantine, 0.3), (off, 0.3)]))
    assert flight.table.lane is not None
    failed = flight.table.lane["state"][-1][:, INDEX[name]] == State.FAILED
    good = [lane for lane in range(4) if lane != wrong_lane]
    return bool((failed[good] != failed[good[0]]).any())


# Pairs, from a campaign.


def lanes_pairs(folder: str) -> None:
    """Print what a campaign of pairs of faults lost, and in how many flights it failed what was healthy."""
    runs, alarms = (pl.read_parquet(Path(folder) / name / "*.parquet") for name in ("runs", "alarms"))
    lost = runs.filter(~pl.col("survived"))
    pairs = counted(f"{first}, then {second}" for first, second in lost.select("first", "second").iter_rows())
    told = f"lost {lost.height} of {runs.height}{f' ({pairs})' if pairs else ''}"
    print(f"{told}; flights with something healthy failed: {counted(_healthy(alarms))}")


def _healthy(alarms: pl.DataFrame) -> list[str]:
    """Return what healthy was failed in each of the flights in which something was."""
    found = []
    for (_,), rows in alarms.group_by("run", maintain_order=True):
        names = rows["signal"].to_list()
        lane, coil = (any(name.startswith(f"{of}.") for name in names) for of in ("computer", "actuator"))
        what = "a lane" if lane else "a coil" if coil else "a lane's samples" if len(names) > len(INDEX) else "a sensor"
        found.append(what)
    return found
