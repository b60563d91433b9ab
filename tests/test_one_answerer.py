"""Each question has one room that answers it: who runs the computer over rows, and what became of a fault."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import get_args

import pytest
from trial_vs_flight import trial_vs_flight
from words import nodes

import rig
from rig.bench.inject import inject
from rig.bench.injection_score import score
from rig.bench.vote_rows import of_flight, settings_of
from rig.computer.redundancy.managers import MANAGERS
from rig.flight.fly import fly
from rig.log import read_log
from rig.log.recordings.own_logs import of_log
from rig.scenario import scenario
from rig.show.pages.flight_page import report
from rig.studies.campaign.tables import rows as campaign_rows
from rig.studies.reliability.tally import TESTED
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick
from rig.verdict.signal_kernels import NEVER
from rig.verdict.words import PRIOR, PUBLIC, FaultWord, IsolationKind, VoteWord
from rig.world.faults import KINDS

HOME = Path(rig.__file__).parent
# The kernels that decide on a row, and the files that may call them besides their own room.
DECIDES = {"vote_signals", "manage", "manage_signal"}
CALLERS = {
    "computer/lanes/think.py",  # a flight
    "bench/drive.py",  # all rows that are not being flown
    "flight/cost.py",  # times the stages of a flight one by one
    "studies/thresholds/residual_series.py",  # reads the residuals that the sums are designed on, frame by frame
    "studies/thresholds/slow_test_factors.py",  # reads the statistics of the slow-fault tests frame by frame
    "computer/servo_monitors.py",  # position sensors of a ram, no signal of a row
    "computer/lanes/command.py",  # commands of several computers, no signal either
}
# What runs rows through the stages, in a room of its own: rows that are recorded, drawn or made.
DRIVERS = {
    *(
        f"{name}.py"
        for name in (
            "bench/inject",
            "bench/baseline_statistics",
            "bench/splitting",
            "bench/one_signal_trials",
            "bench/unit_check",
            "bench/vote_rows",
        )
    ),
    "bench/rows_of_recording.py",  # the length of a block alone
    *(
        "studies/benchmark/own_class.py",
        "bench/replay/vote_again.py",
        "studies/search/open_loop.py",
        "studies/thresholds/pieces.py",
    ),
}
# Words of an outcome that mean other things too: sides, missed frames, columns.
PLAIN = {"right", "wrong", "missed", "none", "kept", "correct"}
# Where a word of an outcome stands in a file that makes none: a heading, or another thing of that name.
NAMED = {
    *(("studies/benchmark/outcome_table.py", word) for word in ("isolated", "wrong channel")),  # headings
    *((f"studies/campaign/campaign_{name}.py", "detected") for name in ("page", "summary")),
    *(("cli/fly.py", "isolated"), ("cli/replay.py", "isolated"), ("cli/studies.py", "detected")),  # labels
    *(("cli/show_campaign.py", word) for word in ("wrong isolation", "detected")),
    ("world/faults/trigger.py", "isolated"),  # a pattern
    ("world/faults/systems.py", "false alarm"),  # of an in-line monitor
}


@cache
def _nodes() -> list[tuple[str, ast.AST]]:
    trees = {path.relative_to(HOME).as_posix(): ast.parse(path.read_text()) for path in sorted(HOME.rglob("*.py"))}
    return [(room, node) for room, tree in trees.items() for node in nodes(tree)]


@cache
def _called() -> list[tuple[str, ast.Call]]:
    return [(room, node) for room, node in _nodes() if isinstance(node, ast.Call)]


def _calls(names: set[str]) -> Iterator[str]:
    for room, node in _called():
        if room.startswith("computer/redundancy/"):
            continue
        if isinstance(node.func, ast.Name) and node.func.id in names:
            yield room


def _texts(node: ast.AST) -> Iterator[str]:
    """Yield the strings that stand right below a node, but for those that are compared or are keys."""
    keys = node.keys if isinstance(node, ast.Dict) else []
    if not isinstance(node, ast.Compare | ast.Subscript):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Constant) and isinstance(child.value, str) and child not in keys:
                yield child.value


def test_the_managers_kernel_is_called_by_the_loop_and_the_bench_alone():
    called = list(_calls(DECIDES))
    assert set(called) == CALLERS
    assert called.count("bench/drive.py") == called.count("computer/lanes/think.py") == 1


def test_all_drivers_of_the_bench_go_through_one_step():
    imports = ((room, node) for room, node in _nodes() if isinstance(node, ast.ImportFrom))
    assert {room for room, node in imports if node.module == "rig.bench.drive"} == DRIVERS


def test_a_class_of_the_users_votes_in_the_loop_and_on_the_bench_alone():
    calls = [room for room, node in _called() if ast.unparse(node.func) == "own.step"]
    assert sorted(calls) == ["bench/vote_rows.py", "flight/loop.py"]
    assert set(_calls({"by_class"})) == {
        f"{name}.py"
        for name in ("bench/vote_rows", "bench/unit_check", "studies/benchmark/own_class", "bench/replay/vote_again")
    }
    assert set(_calls({"load_manager"})) == {
        "bench/vote_rows.py",
        "bench/unit_check.py",
        "studies/benchmark/own_class.py",
    }


def test_one_kernel_over_rows_and_one_word_decide_what_became_of_a_fault():
    """Flights and recordings are added up by one kernel; a single signal's trials and pieces by the inner ones."""
    assert set(_calls({"add_rows"})) == {"verdict/flight_tally.py"}
    inner = {"mark_failed", "mark_wrong", "count_healthy"}
    assert set(_calls(inner)) == {"verdict/row_kernel.py", "bench/one_signal_trials.py", "studies/thresholds/pieces.py"}
    of_faults = {
        f"{name}.py" for name in ("verdict/flight_tally", "verdict/lane_tally", "verdict/law_tally", "verdict/scoring")
    }
    assert set(_calls({"fault_word"})) == of_faults
    assert set(_calls({"fault_words"})) == {"verdict/signal_kernels.py", "studies/thresholds/tradeoff.py"}
    assert set(_calls({"trial_words"})) == {
        "studies/benchmark/injected.py",
        "studies/benchmark/benchmark_trials.py",
    }


def test_no_other_room_makes_a_word_of_an_outcome():
    """Others compare with a word, or count by it."""
    words = {PRIOR, *(word for literal in (FaultWord, VoteWord, IsolationKind) for word in get_args(literal))}
    words |= {name for names in PUBLIC.values() for name in names.values()}
    found = {(room, text) for room, node in _nodes() for text in _texts(node) if text in words - PLAIN}
    assert {(room, word) for room, word in found if not room.startswith("verdict/")} == NAMED


# Where names of managers or of kinds of faults stand outside their family.
CHOSEN = {
    "studies/safety/sequences.py",  # the modes of a cut set
    "bench/diagnose/range_ends.py",  # a delay is a convention there
    "bench/diagnose/paragraphs.py",
    "bench/diagnose/trial_faults.py",  # faults of a recorded log
}


def _compares(node: ast.AST, names: set[str]) -> bool:
    """Return True for a ``kind`` or ``manager`` compared with a name, and for a list of two names or more."""
    if isinstance(node, ast.Compare):
        others = [other for each in node.comparators for other in getattr(each, "elts", [each])]
        texts = {other.value for other in others if isinstance(other, ast.Constant)}
        return isinstance(node.left, ast.Attribute) and node.left.attr in ("kind", "manager") and bool(texts & names)
    listed = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else []
    return len(listed) > 1 and all(isinstance(each, ast.Constant) and each.value in names for each in listed)


def test_no_other_module_compares_names_of_managers_or_of_kinds_of_faults():
    found = {room for room, node in _nodes() if _compares(node, {*KINDS, *MANAGERS})}
    assert {room for room in found if not room.startswith(("world/faults/", "computer/redundancy/"))} == CHOSEN


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
    scored = score_log(flight.log, Yardstick(), baseline=False)
    words = [each.word for each in scored.score.faults]
    assert set(words) == {expected}
    assert [row["isolation"] for row in campaign_rows("faults", 0, which, scored.score)] == [
        PUBLIC["campaign"][w] for w in words
    ]
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
    assert {window.correct and window.lost_s == 0.0 for window in windows} == {trial.trial_kept}
