"""The verdict says where ours loses, and nothing that the intervals do not show."""

from typing import Any

from rig.studies.benchmark.ranking import verdict


def group(entrant: str, low: float, high: float, **more: Any) -> dict[str, Any]:
    place = {"reference": "as flown", "signal": "pitch_rate", "kind": "offset", "faults": 1, "trials": 100}
    interval = {"value": (low + high) / 2.0, "low": low, "high": high}
    votes = {"peak_smaller": 30, "peak_larger": 60}
    return {"ours": "cross-channel", **place, "entrant": entrant, **interval, **votes, **more}


def said(table: Any = (), rows: Any = (), silent: Any = (), **more: Any) -> list[str]:
    rest: dict[str, Any] = {"transients": [], "second": [], "lost_differences": []}
    return verdict({"table": table, "differences": rows, "silent": silent, **rest, **more})


def test_the_worst_loss_comes_first_and_what_may_be_chance_is_no_loss():
    rows = [group("cusum", 0.05, 0.15), group("glr", 0.2, 0.4), group("parity", -0.01, 0.2)]
    lines = said(rows=rows)
    assert lines[0].startswith("cross-channel LOSES to glr: pitch_rate, offset, 1 fault, reference as flown")
    assert "+30.0 points (20.0 to 40.0)" in lines[0] and "LOSES to cusum" in lines[1]
    assert not any("parity" in line for line in lines)


def test_states_of_the_reference_that_change_nothing_share_a_sentence():
    rows = [group("parity", 0.1, 0.2, reference=state) for state in ("as flown", "absent", "jumping")]
    rows.append(group("parity", 0.05, 0.2, reference="off"))
    lines = said(rows=rows)
    assert [line.split(": it isolates")[0].split("1 fault, ")[1] for line in lines] == [
        "reference as flown, absent, jumping",
        "reference off",
    ]


def test_without_a_loss_it_says_so_and_names_who_is_behind():
    lines = said(rows=[group("cusum", -0.3, -0.1, kind="all")])
    assert lines[0] == "cross-channel loses in no group: no baseline manager isolates significantly more"
    assert "ahead of cusum" in lines[1] and "-20.0 points" in lines[1]


def test_who_fails_nobody_is_compared_by_its_vote_alone():
    lines = said(rows=[group("median", -1.0, -0.9, kind="all")], silent=["median"])
    assert lines == [
        "median fails nobody: its largest vote error is smaller than that of cross-channel in 30 %, larger in 60 % of "
        "pitch_rate, all kinds, 1 fault, reference as flown"
    ]


def test_a_budget_is_broken_when_chance_would_hardly_make_so_many():
    count = {"entrant": "cusum", "signal": "pitch_rate", "expected": 0.1}
    assert "DOES NOT KEEP THE BUDGET" in said(second=[{**count, "counted": 2}])[-1]  # a chance of 0.5 %
    assert said(second=[{**count, "expected": 1.0, "counted": 2}]) == []  # 26 %
