"""The length of a block does not show: not in what is flown, and not in what any reader of a flight makes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digests import ways
from test_replay import rewrite

from rig.bench.replay.before_after import diff, side
from rig.bench.replay.verify import verify
from rig.bench.replay.what_if import changed, what_if
from rig.core.frame import Table
from rig.flight.failures import failures
from rig.flight.fly import fly
from rig.flight.recorder import Findings
from rig.flight.suspects import count_suspects, new_counts
from rig.flight.suspects import suspects as counted
from rig.log import read_log
from rig.log.export import export
from rig.log.recordings.flown_log import recorded
from rig.scenario import scenario
from rig.scenario.scenario import Scenario
from rig.show.pages.flight_page import report
from rig.show.viewer import derived, lanes_view, servo_series, state_strips
from rig.show.viewer.facts import Facts, of_resolved
from rig.show.viewer.story import Story
from rig.studies.campaign.flying import fly as fly_in_memory
from rig.verdict.conclusion import conclusion
from rig.verdict.flight_tally import FlightOutcome
from rig.verdict.of_log import score_log
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder
from rig.verdict.requirements.subject import of_flight
from rig.verdict.score_records import Yardstick
from rig.verdict.scoring import score_of
from rig.verdict.unfaulted import MeasuredAgain

# Each stage that draws, or that looks back, in one flight: noise and drift of sensors, wrong monitors, a fault by
# chance, one of noise, one that waits for a vote, and a heading around north.
RANDOM = [
    "turbulence='severe'",
    "sensors.pitch_rate.noise_std=0.01",
    "sensors.pitch_rate.noise_density=1e-3",
    "sensors.pitch_rate.bias_instability_std=1e-3",
    "sensors.pitch_rate.bias_correlation_s=1.0",
    "sensors.pitch_rate.rate_random_walk=1e-3",
    "sensors.pitch_rate.lag_s=0.01",
    "sensors.pitch_rate.latency_s=0.01",
    "sensors.stick_pitch.monitor.false_alarm_per_hour=3600.0",
    "sensors.pitch_rate.skew_frames=0.5",
    "faults=[{kind='offset', signal='pitch_rate', channels=[2], offset=0.3, rate_per_hour=7200.0, duration_s=0.05},"
    "{kind='noise', signal='roll_rate', channels=[1], std=0.1, start_s=0.1},"
    "{kind='hardover', signal='pitch_rate', channels=[3], when='pitch_rate > 0.0'}]",
]
FLIGHTS: dict[str, tuple[str | None, list[str]]] = {
    "random": (None, ["actuators.model='lag'", "computers.count=1", *RANDOM]),
    "servos": (
        None,
        [
            "actuators.model='servo'",
            "computers.count=1",
            "faults=[{kind='coil_hardover', signal='actuator.elevator', channels=[2], start_s=0.5},"
            "{kind='spool_jam', signal='actuator.aileron', start_s=0.5}]",
        ],
    ),
    "computers": ("f16_computer_stop", ["actuators.model='lag'", "computers.count=4", "faults.0.start_s=0.5"]),
    "both": (
        "f16_wrong_command",
        [
            "faults=[{kind='wrong_command', signal='computer.B', surface='elevator', start_s=0.5},"
            "{kind='offset', signal='pitch_rate', channels=[1, 2], offset=0.3, start_s=0.3}]",
        ],
    ),
}
REQUIREMENTS = [
    Requirement(id="count", formula="always[0, 0.2] count.pitch_rate.2 < 1", at="each onset"),
    Requirement(id="vote", formula="always[0, 0.5] abs(error.pitch_rate) <= 0.001", at="each onset"),
]


def given(name: str) -> Scenario:
    base, sets = FLIGHTS[name]
    return scenario.load(base, [*sets, "duration_s=1.5"])


@pytest.mark.parametrize(
    "name", ["both", "random", *(pytest.param(name, marks=pytest.mark.long) for name in ("servos", "computers"))]
)
def test_a_flight_has_one_digest_paced_or_not_logged_or_not_in_blocks_of_any_length(name: str, tmp_path: Path):
    digests = dict(ways(given(name), tmp_path))
    assert len(digests) > 10 and len(set(digests.values())) == 1, digests


@cache
def flown(name: str) -> tuple[Scenario, Table]:
    """A flight and all of its frames, never to be written."""
    which = given(name)
    return which, fly_in_memory(which).table


def events(which: Scenario, parts: list[Table]) -> Any:
    findings = Findings(which)
    for part in parts:
        findings.record(part)
    verdict = findings.verdict
    return findings.events, findings.end(), verdict.digest, verdict.peaks, verdict.failed, findings.execution.executed


def failed(which: Scenario, parts: list[Table]) -> Any:
    before = [None, *(part.rows[-1:] for part in parts)]
    return [each for part, last in zip(parts, before, strict=False) for each in failures(part.rows, last)]


def suspects(which: Scenario, parts: list[Table]) -> Any:
    counts = new_counts()
    for part in parts:
        count_suspects(part.rows, counts)
    return counted(counts, sum(map(len, parts)))


def verdict(which: Scenario, parts: list[Table]) -> Any:
    outcome, again = FlightOutcome(which, 2.0), MeasuredAgain(which)
    for part in parts:
        for measured in again.of(part):
            outcome.add(measured)
    score = score_of(outcome)
    return score, conclusion(which, score)


def requirements(which: Scenario, parts: list[Table]) -> Any:
    recorder = RequirementsRecorder(REQUIREMENTS, of_flight(which))
    for part in parts:
        recorder.record(part)
    return recorder.finish()


def facts(which: Scenario) -> Facts:
    return of_resolved(which.resolved())


def story(which: Scenario, parts: list[Table]) -> Any:
    told = Story(facts(which), which.rate_hz)
    seen = [bool(told.add(part)) for part in parts]
    return any(seen), told.headline("FLOWN"), told.decisive


def strips(which: Scenario, parts: list[Table]) -> Any:
    """Changes of state: path, frame, state."""
    found, first, before = [], 0, None
    for part in parts:
        changes = [*state_strips.changes(part.rows, None if before is None else before.rows, facts(which).faults)]
        for shown in (lanes_view.SHOWN, servo_series.SHOWN):
            changes += shown.changes(part, before) if shown.part in which.row_parts else []
        found += [(c.path, first + int(k), s) for c in changes for k, s in zip(c.rows, c.states, strict=True)]
        first, before = first + len(part), part[-1:]
    return sorted(found, key=str)


@pytest.mark.parametrize("reader", [events, failed, suspects, verdict, requirements, story, strips])
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_reader_says_of_blocks_what_it_says_of_the_whole(name: str, reader: Callable[[Scenario, list[Table]], Any]):
    which, table = flown(name)
    whole = reader(which, [table])
    for size in (1, 7, 64):
        assert reader(which, [table[k : k + size] for k in range(0, len(table), size)]) == whole, size


@pytest.mark.parametrize("name", FLIGHTS)
def test_blocks_are_drawn_as_the_whole(name: str):
    """But for rounding: an angle goes on where it was."""
    which, table = flown(name)
    whole = derived.Derived(facts(which)).values(table.rows)
    for size in (1, 7, 64):
        values = derived.Derived(facts(which))
        parts = [values.values(table.rows[k : k + size]).copy() for k in range(0, len(table), size)]
        np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, atol=1e-3)


# Of a log: what reads it in blocks of so many rows.


def reports(log: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[bytes]:
    for held in (2**40, 0):  # the log is held, or what the pictures show is mapped from a scratch file
        monkeypatch.setattr("rig.log.log_file.HELD_BYTES", held)
        report(log, out / "report.html")
        yield (out / "report.html").read_bytes()


def exports(log: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[bytes]:
    yield from exported(log, out, [("csv", True), ("parquet", False), ("npz", False)])


def exports_of_all_kinds(log: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[bytes]:
    yield from exported(log, out, product(("csv", "parquet", "npz"), (True, False)))


def exported(log: Path, out: Path, kinds: Iterable[tuple[Any, bool]]) -> Iterator[bytes]:
    for to, for_vote in kinds:
        made = set[bytes]()
        for source in (log, read_log(log)):
            assert export(source, to, out / f"log.{to}", for_vote=for_vote).rows == 150
            made.add((out / f"log.{to}").read_bytes())
        yield from made


def replays(log: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """And of a log that claims the votes of another monitor."""
    recording = recorded(log)
    patient = changed(recording, None, ["redundancy.signals.pitch_rate.persistence=40"])
    other = what_if(recording, patient, out / "other.mcap")
    assert other.moved.votes
    yield other.moved
    yield other.path.read_bytes()
    yield diff(side(log), side(other.path), ["pitch_rate.voted=0.001"])
    claimed = recorded(rewrite(log, out / "claimed.mcap", read_log(other.path).rows))
    for one, again in product((recording, claimed), (False, True)):
        found = verify(one, fly=again).as_dict()
        assert found["identical"] == (one is recording) == (not found["decisions"]["moved"])
        yield found


def scores(log: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    yield score_log(log, Yardstick()).as_dict()


@pytest.mark.parametrize(
    ("reader", "name"),
    [
        *((scores, "both"), (exports, "both"), (replays, "random")),
        pytest.param(reports, "both", marks=pytest.mark.long),
        pytest.param(exports_of_all_kinds, "both", marks=pytest.mark.long),
    ],
)
def test_a_log_read_in_small_blocks_says_the_same(
    reader: Callable[..., Iterator[Any]], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    log = fly(given(name), out=tmp_path).log
    whole = list(reader(log, tmp_path, monkeypatch))
    monkeypatch.setattr("rig.core.blocks.ROWS", 13)
    assert list(reader(log, tmp_path, monkeypatch)) == whole
