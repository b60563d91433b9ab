"""Each question has one room that answers it: who runs the computer over rows, and what became of a fault."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from trial_vs_flight import trial_vs_flight

import rig
from rig import scenario
from rig.assess import Yardstick, score_log
from rig.assess.outcome import NEVER
from rig.assess.words import PUBLIC
from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.vote import of_flight, settings_of
from rig.campaign.rows import fault_rows
from rig.flight.assembly import fly
from rig.log import read_log
from rig.recordings.own_logs import of_log
from rig.reliability.tally import TESTED
from rig.report.flight import report

HOME = Path(rig.__file__).parent
# The kernels that decide on a row, and the files that may call them besides their own room.
DECIDES = {"vote_signals", "manage", "manage_signal"}
CALLERS = {
    "lanes/think.py",  # a flight
    "bench/run.py",  # all rows that are not being flown
    "flight/frame_cost.py",  # times the stages of a flight one by one
    "actuators/monitors.py",  # position sensors of a ram, no signal of a row
    "lanes/command.py",  # commands of several computers, no signal either
}


def _calls(names: set[str]) -> Iterator[str]:
    for path in sorted(HOME.rglob("*.py")):
        room = path.relative_to(HOME).as_posix()
        if room.startswith("computer/redundancy/"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names:
                yield room


def test_the_managers_kernel_is_called_by_the_loop_and_the_bench_alone():
    called = list(_calls(DECIDES))
    assert set(called) == CALLERS
    assert called.count("bench/run.py") == called.count("lanes/think.py") == 1


def test_all_drivers_of_the_bench_go_through_one_step():
    kernels = {
        path.relative_to(HOME).as_posix()
        for path in sorted(HOME.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == "rig.bench.run"
    }
    expected = {"bench/vote.py", "bench/inject.py", "bench/trials.py", "bench/splitting.py", "bench/unit_check.py"}
    assert expected | {"replay/vote_again.py", "thresholds/monitored.py"} <= kernels


def test_one_kernel_over_rows_and_one_word_decide_what_became_of_a_fault():
    """Flights and recordings are added up by one kernel; a single signal's trials and pieces by the inner ones."""
    assert set(_calls({"add_rows"})) == {"assess/flight_outcome.py"}
    inner = {"mark_failed", "mark_wrong", "count_healthy"}
    assert set(_calls(inner)) == {"assess/outcome_rows.py", "bench/trials.py", "thresholds/monitored.py"}
    of_faults = {f"assess/{name}.py" for name in ("flight_outcome", "lane_outcome", "scoring")}
    assert set(_calls({"fault_word"})) == {*of_faults, "thresholds/tradeoff.py"}


CASES = {  # a fault of the pitch rate, from 1 s on: its word
    "a hardover": ('kind="hardover",channels=[3]', "isolated"),
    "below the threshold": ('kind="offset",channels=[3],offset=0.002', "no effect"),
    "shorter than the persistence": ('kind="hardover",channels=[3],duration_s=0.03', "missed"),
    "a pair against the reference": ('kind="hardover",channels=[1,2],direction="low"', "isolated"),
}


@pytest.mark.parametrize("name", CASES)
def test_score_campaign_report_injection_and_trial_have_the_same_word_for_a_fault(name: str, tmp_path: Path):
    keys, expected = CASES[name]
    fault = f'{{id="{TESTED}",signal="pitch_rate",start_s=1.0,{keys}}}'
    which, healthy = (scenario.load(None, ["duration_s=2.0", f"faults=[{some}]"]) for some in (fault, ""))
    flight, clean = (fly(each, out=tmp_path / str(i)) for i, each in enumerate((which, healthy)))
    scored = score_log(flight.log, Yardstick(), twin=False)
    words = [each.word for each in scored.score.faults]
    assert set(words) == {expected}
    assert [row["isolation"] for row in fault_rows(0, which, scored.score)] == [PUBLIC["campaign"][w] for w in words]
    told = [each["outcome"] for each in report(flight.log, tmp_path / "page.html")["faults"]]
    assert told == [each.outcome for each in scored.score.faults]

    (signals, discretes), log = settings_of(healthy), read_log(clean.log)
    tables = [fault.model_dump(exclude_none=True) for fault in which.faults]
    found = inject(of_log(log, clean.log), tables, signals, discretes, seed=which.seed)
    injected = score(found, found.recording, of_flight(found.recording, healthy))
    assert [each.outcome for each in injected] == [PUBLIC["injection"][word] for word in words]
    failed = [each.failed_frame for each in scored.score.faults]
    for one, frame, word in zip(injected, failed, words, strict=True):
        if word == "isolated":
            assert frame is not None and one.failed_at_s == frame / which.rate_hz

    trial = trial_vs_flight(which)
    windows = [each.window for each in scored.score.faults if each.window is not None]
    assert [trial.trial[(each.channel or 0) - 1] for each in scored.score.faults] == [
        NEVER if f is None else f for f in failed
    ]
    assert {window.kept and window.lost_s == 0.0 for window in windows} == {trial.trial_kept}
