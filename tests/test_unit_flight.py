"""A unit under test in flight: by every transport, whatever it does."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from unit_files import faulty, library, needs_a_compiler, udp, unit, written

import rig
from rig.bench.replay.verify import verify
from rig.core.errors import BadInput, RigError
from rig.core.frame import SIGNALS, DecidedBy, Law, State, UnitStatus
from rig.flight.pace import realtime
from rig.log import read_log
from rig.log.info import info
from rig.log.recordings.flown_log import recorded
from rig.unit import startup
from rig.unit.transport import SocketLink
from rig.unit.unit_file import Unit
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

pytestmark = needs_a_compiler
SHORT = ("duration_s=2", "faults.0.start_s=0.5")


def fly(out: Path, tested: Unit | None, *sets: str, **more: Any) -> rig.Flight:
    return rig.fly(overrides=(*SHORT, *sets), out=out, unit=tested, **more)


def children() -> list[str]:
    """The processes that this one has started and that still run."""
    found = []
    for name in (path.name for path in Path("/proc").iterdir() if path.name.isdigit()):
        try:
            stat = Path(f"/proc/{name}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(stat[1]) == os.getpid() and stat[0] != "Z":
            found.append(name)
    return found


@pytest.fixture(autouse=True)
def _nothing_is_left_behind():
    before = set(children())
    yield
    assert set(children()) <= before


def test_the_monitor_in_c_flies_the_bits_of_ours_by_every_transport(tmp_path: Path):
    ours = fly(tmp_path, None).rows
    transports = [unit(tmp_path, "monitor"), unit(tmp_path, "monitor", isolate=False), udp(tmp_path, [], "monitor")]
    flights = [fly(tmp_path, tested) for tested in transports]
    assert len({flight.digest for flight in flights}) == 1
    rows = flights[0].rows
    assert (rows["unit"] == UnitStatus.ANSWERED).all() and (rows["unit_age"] == 0).all()
    differ = {
        name for name in rows.dtype.names or () if not np.array_equal(rows[name], ours[name], equal_nan=name[0] != "_")
    }
    assert differ == {"unit"}
    assert flights[0].failed == {"pitch_rate": [3]}


def test_a_unit_that_says_only_its_votes_leaves_the_discretes_to_the_rig(tmp_path: Path):
    flight = fly(tmp_path, unit(tmp_path))
    rows = flight.rows
    assert flight.survived and flight.failed == {}
    assert np.array_equal(rows["voted"], rows["channels"][:, :, 0])
    assert (rows["discrete_state"] == State.OK).all()
    assert flight.unit is not None and flight.unit["answered"] == 200 and flight.unit["reproducible"]


def test_an_answer_flown_a_frame_later_has_that_age(tmp_path: Path):
    rows = fly(tmp_path, unit(tmp_path, latency_frames=2)).rows
    assert rows["unit_age"].tolist() == [0, 1, *[2] * 198]
    assert np.array_equal(rows["voted"][2:], rows["channels"][:-2, :, 0])


def test_a_flight_computer_flies_its_own_surfaces(tmp_path: Path):
    flight = fly(tmp_path, unit(tmp_path, "autopilot", role="flight-computer"))
    rows = flight.rows
    assert (rows["law"] == Law.EXTERNAL).all()
    assert np.isnan(rows["voted"]).all() and (rows["state"] == State.ABSENT).all()
    assert np.array_equal(rows["surface"], rows["surface_command"])
    assert np.ptp(rows["surface"][:, 0]) > 0
    assert flight.survived and flight.not_executed == []


DEATHS = {
    "segv": "killed by signal 11 (SIGSEGV)",
    "abort": "killed by signal 6 (SIGABRT)",
    "exit": "exited with status 3",
    "error": "failed: rig_unit_step returned 5",
}


@pytest.mark.parametrize("fault", DEATHS)
def test_a_dead_unit_ends_the_flight_in_one_line_with_a_whole_log(tmp_path: Path, fault: str):
    tested = faulty(tmp_path, fault)
    with pytest.raises(RigError) as said:
        fly(tmp_path, tested)
    assert f"unit.toml: faulty, frame 50: {DEATHS[fault]}" in str(said.value)
    (log,) = tmp_path.glob("*.mcap")
    assert info(log)["damage"] is None and len(rig.read_log(log).rows) == 50


def test_a_child_that_is_slow_to_start_is_still_heard_when_it_refuses(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(startup, "_AGAIN_S", 0.001)
    with pytest.raises(BadInput, match="refuses the flight: rig_unit_open returned 7"):
        fly(tmp_path, faulty(tmp_path, "open"))


def test_a_library_in_this_process_that_fails_is_not_called_again(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("FAULT", "error")
    with pytest.raises(RigError, match="faulty, frame 50: failed: rig_unit_step returned 5"):
        fly(tmp_path, unit(tmp_path, "faulty", isolate=False))
    held = fly(tmp_path, unit(tmp_path, "faulty", isolate=False, on_dead="hold"))
    assert held.rows["unit"].tolist() == [UnitStatus.ANSWERED] * 50 + [UnitStatus.DEAD] * 150
    assert (held.recorded.timing["reply_us"][:50] > 0).all()


def test_an_answer_that_comes_after_the_short_look_for_it_is_flown(tmp_path: Path):
    """5 ms later, twice, and once before another message that is none: the same bits, and all of it counted."""
    plan = [["delay", 20, 21, 0.005], ["double", 40, 40]]
    plain, slow = fly(tmp_path, udp(tmp_path, [])), fly(tmp_path, udp(tmp_path, plan))
    assert slow.digest == plain.digest
    assert slow.unit is not None and (slow.unit["answered"], slow.unit["discarded"]) == (200, 1)
    reply = slow.recorded.timing["reply_us"]
    assert (reply[[20, 21]] > 4500).all() and np.median(reply) < 4500


def test_a_unit_that_hangs_is_dead_after_its_time_limit(tmp_path: Path):
    with pytest.raises(RigError, match=r"frame 50: has not answered within timeout_s = 0.3 s"):
        fly(tmp_path, faulty(tmp_path, "hang", timeout_s=0.3))


def test_without_a_time_limit_a_unit_that_is_stopped_flies_the_same(tmp_path: Path):
    """As in a debugger: 3 s, with a time limit of 2 s it would be dead."""
    digest = fly(tmp_path, unit(tmp_path, "faulty", timeout_s=0)).digest
    assert fly(tmp_path, faulty(tmp_path, "sleep", timeout_s=0)).digest == digest


def test_a_unit_that_dies_again_in_the_same_frame_is_dead(tmp_path: Path):
    with pytest.raises(RigError, match="after a restart: killed by signal 11"):
        fly(tmp_path, faulty(tmp_path, "segv", on_dead="restart"))


@pytest.mark.parametrize("then", ["hold", "backup"])
def test_a_dead_unit_may_leave_the_flight_to_others(tmp_path: Path, then: str):
    environment = {"FAULT": "segv", "FAULT_FRAME": "150"}
    flight = fly(tmp_path, unit(tmp_path, "faulty", on_dead=then, environment=environment))
    rows = flight.rows
    assert flight.survived and len(rows) == 200 and rows["unit"][-1] == UnitStatus.DEAD
    assert flight.unit is not None and flight.unit["dead_frame"] == 150
    assert [event.name for event in flight.events if event.name.startswith("unit")] == ["unit dead"]
    if then == "hold":
        assert (rows["voted"][150:] == rows["voted"][149]).all() and rows["unit_age"][-1] == 50
    else:
        assert flight.failed == {"pitch_rate": [3]}, "our manager found what the unit did not"


def test_a_unit_that_ends_is_started_again(tmp_path: Path):
    """It dies in frame 60 if its mark is not there yet."""
    mark = tmp_path / "died"
    flight = fly(tmp_path, udp(tmp_path, [["die", 60, 60, str(mark)]], on_dead="restart"))
    assert flight.unit is not None and flight.unit["restarts"] == 1 and not flight.unit["reproducible"]
    assert np.flatnonzero(flight.rows["unit"] == UnitStatus.RESTARTED).tolist() == [60]
    assert flight.rows["unit"][-1] == UnitStatus.ANSWERED and flight.survived


def test_what_a_unit_prints_is_kept_and_shown(tmp_path: Path):
    assert fly(tmp_path, faulty(tmp_path, "print")).printed == "hello from the unit\n"


def test_a_state_out_of_its_enum_is_refused_and_the_last_answer_flown(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "state"))
    rows = flight.rows
    assert np.flatnonzero(rows["unit"] != UnitStatus.ANSWERED).tolist() == [50]
    assert rows["unit"][50] == UnitStatus.REFUSED and rows["unit_age"][50] == 1
    assert np.array_equal(rows["voted"][50], rows["voted"][49])
    assert flight.unit is not None and flight.unit["refused"] == 1


def test_a_vote_that_is_no_number_goes_into_the_log_as_it_is(tmp_path: Path):
    rows = fly(tmp_path, faulty(tmp_path, "nan vote")).rows
    assert np.argwhere(np.isnan(rows["voted"])).tolist() == [[50, 15]]
    assert np.isfinite(rows["surface"]).all()


def test_a_library_that_changes_how_this_process_rounds_is_refused(tmp_path: Path, monkeypatch):
    expected = 1.0 / 3.0
    monkeypatch.setenv("FAULT", "rounding")
    with pytest.raises(RigError, match="changed the floating-point rounding of this process"):
        fly(tmp_path, unit(tmp_path, "faulty", isolate=False))
    assert 1.0 / float("3") == expected
    fly(tmp_path, faulty(tmp_path, "rounding"))  # in its own process it harms no other


REFUSED = {
    "open": ({"FAULT": "open"}, "faulty", "refuses the flight: rig_unit_open returned 7"),
    "no library": ({}, "faulty.c", "cannot be loaded as a library"),
    "no function": ({}, "libm", "has no function rig_unit_open; a unit needs rig_unit_open, rig_unit_step, rig"),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("isolate", [True, False])
def test_what_cannot_be_flown_is_refused_in_one_line(tmp_path: Path, monkeypatch, case: str, isolate: bool):
    environment, name, said = REFUSED[case]
    for key, value in environment.items():
        monkeypatch.setenv(key, value)
    own = {"environment": environment} if isolate else {}
    path = library("faulty")
    if name == "faulty.c":
        path = Path(__file__).parent / "units/faulty.c"
    elif name == "libm":
        path = next(path for path in Path("/lib").rglob("libm.so.6"))
    tested = written(tmp_path, {"name": "u", "path": str(path), "isolate": isolate, **own})
    with pytest.raises(BadInput) as error:
        fly(tmp_path, tested)
    wanted = said if isolate or case != "open" else "rig_unit_open returned 7"
    assert str(error.value).startswith(f"{tmp_path}/unit.toml: u") and wanted in str(error.value)
    assert list(tmp_path.glob("*.mcap")) == []


@pytest.mark.parametrize(
    "kind",
    [
        "long",
        "crc",
        *(pytest.param(k, marks=pytest.mark.long) for k in ("short", "stale", "foreign", "layout", "magic")),
    ],
)
def test_no_other_message_is_flown_as_the_answer(tmp_path: Path, kind: str):
    with pytest.raises(RigError, match=r"frame 60: has not answered within timeout_s = 0.3 s"):
        fly(tmp_path, udp(tmp_path, [[kind, 60, 60]], timeout_s=0.3))
    assert len(rig.read_log(next(tmp_path.glob("*.mcap"))).rows) == 60


def test_a_doubled_answer_counts_once(tmp_path: Path):
    flight = fly(tmp_path, udp(tmp_path, [["double", 60, 62]]))
    assert flight.unit is not None and flight.unit["discarded"] == 3 and flight.unit["answered"] == 200


def test_a_unit_built_for_other_records_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match=r"planned was built for layout [0-9a-f]{16}, .*: write the header again"):
        fly(tmp_path, udp(tmp_path, [["built for another layout", 0, 0]]))


def test_a_command_that_is_no_unit_is_refused_in_one_line(tmp_path: Path):
    silent = written(tmp_path, {"name": "u", "transport": "udp", "command": ["sleep", "60"], "start_s": 0.3})
    with pytest.raises(BadInput, match=r"u did not send READY within start_s = 0.3 s"):
        fly(tmp_path, silent)
    missing = written(tmp_path, {"name": "u", "transport": "udp", "command": ["no-such-program"]})
    with pytest.raises(BadInput, match="u: command: no-such-program: no such program beside the unit file or in PATH"):
        fly(tmp_path, missing)


PLAN = [["lost-request", 50, 52], ["lost-reply", 80, 84], ["delay", 120, 120, 0.03], ["double", 150, 150]]


def test_paced_misses_are_held_and_told_apart(tmp_path: Path):
    """A frame lasts 20 ms, its answer has 16: a delay of 30 ms misses its frame and holds the next one up too."""
    tested = udp(tmp_path, PLAN, on_miss="fault")
    flight = fly(tmp_path, tested, "rate_hz=50", "duration_s=4", realtime_factor=1.0)
    found, rows = flight.unit, flight.rows
    assert found is not None and flight.survived
    held = set(np.flatnonzero(rows["unit"] == UnitStatus.HELD).tolist())
    assert {50, 51, 52, 80, 81, 82, 83, 84, 120} <= held
    assert (found["requests_lost"], found["replies_lost"]) == (3, 5)
    assert found["late"] == found["missed"] - 8 >= 1, "what came too late was never flown"
    assert rows["unit_age"][[49, 50, 51, 52, 53]].tolist() == [0, 1, 2, 3, 0]
    assert np.array_equal(rows["voted"][84], rows["voted"][79])
    assert [event.frame for event in flight.events if event.name == "unit missed"] == [min(held)]
    assert not found["reproducible"]
    scored = score_log(flight.log, Yardstick(), baseline=False)
    told = {frame for miss in scored.misses for frame in range(miss.first_frame, miss.last_frame + 1)}
    assert {50, 51, 52, 80, 81, 82, 83, 84} <= told <= held, "a loaded machine misses others too"
    assert scored.times["lateness"] and scored.times["replies"]


OVERTAKEN = [["late-reply", 30, 31], ["late-request", 60, 60], ["lost-reply", 90, 91], ["late-reply", 198, 198]]


def test_answers_that_later_ones_overtake_are_late_and_not_lost(tmp_path: Path):
    """The last of them comes behind the answer to the last frame.  A loaded machine makes others late, too."""
    flight = fly(tmp_path, udp(tmp_path, OVERTAKEN), "rate_hz=50", "duration_s=4", realtime_factor=1.0)
    found, rows = flight.unit, flight.rows
    assert found is not None and flight.frames == 200
    assert (rows["unit"][[30, 31, 60, 90, 91, 198]] == UnitStatus.HELD).all()
    assert (found["requests_lost"], found["replies_lost"], found["discarded"]) == (0, 2, 0)
    assert found["late"] == found["missed"] - 2 >= 4
    assert (rows["unit_age"][rows["unit"] == UnitStatus.ANSWERED] == 0).all(), "no late answer was flown"


def test_an_answer_that_the_rig_itself_reads_too_late_is_not_flown(tmp_path: Path, monkeypatch):
    """It came after 10 ms of 16, but the machine gave the rig no time until the frame was over."""
    wait, due = SocketLink.receive, []

    def slow(link: SocketLink, into: memoryview, until_s: float) -> int:
        count = wait(link, into, until_s)
        if count and int.from_bytes(into[24:32], "little") == 30:  # the delayed answer
            due.append(until_s)
            time.sleep(max(0.0, until_s - time.perf_counter()) + 0.001)
        return count

    tested = udp(tmp_path, [["delay", 30, 30, 0.01]])
    monkeypatch.setattr(SocketLink, "receive", slow)
    flight = fly(tmp_path, tested, "rate_hz=50", realtime_factor=1.0)
    assert flight.unit is not None and due
    assert flight.rows["unit"][30] == UnitStatus.HELD
    assert flight.unit["late"] == flight.unit["missed"] >= 1
    assert flight.unit["replies_lost"] == flight.unit["requests_lost"] == flight.unit["discarded"] == 0


def test_a_unit_may_not_miss_more_in_a_row_than_it_is_allowed(tmp_path: Path):
    with pytest.raises(RigError, match="frame 53: sent no valid answer for max_missed = 3 consecutive frames"):
        fly(tmp_path, udp(tmp_path, [["lost-reply", 50, 99]], max_missed=3), "rate_hz=50", realtime_factor=1.0)


def test_the_first_miss_may_end_the_flight(tmp_path: Path):
    """A busy machine may make an answer before the lost one late."""
    with pytest.raises(RigError, match=r"frame \d+: missed its deadline of 0.8 frame") as ended:
        fly(tmp_path, udp(tmp_path, [["lost-reply", 50, 99]], on_miss="end"), "rate_hz=50", realtime_factor=1.0)
    assert int(str(ended.value).split("frame ")[1].split(":")[0]) <= 50


def test_the_log_names_the_unit_and_what_became_of_it(tmp_path: Path):
    import json

    flight = fly(tmp_path, unit(tmp_path))
    kept = flight.recorded.metadata
    about = json.loads(kept["unit"])
    assert about["name"] == "first_valid" and about["transport"] == "library" and len(about["sha256"]) == 64
    assert json.loads((flight.recorded.result or {})["unit"])["answered"] == 200


def test_a_python_class_is_a_transport_too(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine_unit.py").write_text(
        "class Mine:\n    def __init__(self, params): pass\n"
        "    def step(self, bus, fcc, k):\n"
        "        fcc[k]['voted'][:] = bus[k]['channels'][:, 1]\n"
        "        fcc[k]['level'][:] = 4\n"
    )
    flight = fly(tmp_path, written(tmp_path, {"name": "m", "transport": "python", "manager": "mine_unit:Mine"}))
    assert np.array_equal(flight.rows["voted"], flight.rows["channels"][:, :, 1])


def test_real_time_is_asked_for_told_and_given_back(tmp_path: Path):
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    flight = fly(tmp_path, None, "duration_s=0.2", "faults=[]", realtime=True)
    assert flight.realtime.keys() == {"scheduling", "memory", "core"}
    assert flight.jitter is not None and flight.wall_s >= 0.19
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before


def test_a_system_that_refuses_is_quoted(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with realtime(True) as got:
        assert got["scheduling"] == "refused: Operation not permitted"
    with realtime(False) as got:
        assert got == {}


WHAT_LASTS = (
    ["slow_allowance=0.002", "slow_limit=0.0002"],
    ["stale_frames=2"],
)  # of pitch rate


@needs_a_compiler
@pytest.mark.parametrize("settings", WHAT_LASTS, ids=["slow", "stale"])
def test_the_monitor_in_c_is_told_what_lasts_and_flies_the_bits_of_ours(tmp_path: Path, settings: list[str]):
    keys = [f"redundancy.signals.pitch_rate.{one}" for one in settings]
    flights = [
        fly(tmp_path, tested, *sets) for tested, sets in ((None, keys), (unit(tmp_path, "monitor"), keys), (None, []))
    ]
    ours, theirs, off = (
        [flight.rows[field].tobytes() for field in ("state", "decided_by", "voted")] for flight in flights
    )
    assert ours == theirs != off


SMALL = (
    ("pitch_rate", 2, 'kind="offset",offset=0.004'),
    ("roll_rate", 3, 'kind="noise",std=0.006'),
)  # rad/s, below every threshold
TESTED = (
    *(f"redundancy.signals.{signal.name}.slow_tests.factor=1.5" for signal in SIGNALS),
    "duration_s=7",
    "faults=[{}]".format(
        ",".join(f'{{signal="{name}",channels=[{c}],start_s=5.5,{error}}}' for name, c, error in SMALL)
    ),
)


def test_slow_fault_tests_isolate_in_closed_loop_by_name_and_the_monitor_in_c_in_the_same_frame(tmp_path: Path):
    built_in = rig.fly(overrides=TESTED, out=tmp_path)
    tested = unit(tmp_path, "monitor")
    in_c = rig.fly(overrides=TESTED, out=tmp_path / "unit", unit=tested)
    for field in ("state", "level", "pattern", "decided_by", "voted"):
        assert built_in.rows[field].tobytes() == in_c.rows[field].tobytes(), field
    decided_by = set(built_in.rows["decided_by"].ravel().tolist())
    assert built_in.failed == {name: [c] for name, c, _ in SMALL}
    assert decided_by == {DecidedBy.NONE, DecidedBy.SLOW_MEANS, DecidedBy.SLOW_SQUARES}
    assert verify(recorded(built_in.log)).comparison.identical  # rig replay
    scored = score_log(built_in.log, Yardstick(), baseline=False)
    assert {fault.decided_by for fault in scored.score.faults} == {"slow_means", "slow_squares"}
    said = [event.text for event in read_log(built_in.log).events if "slow" in event.text]
    assert len(said) == 2 and any(text.endswith("slow_means") for text in said), said
