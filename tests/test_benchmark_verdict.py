"""The verdict names where a baseline manager isolates more, and claims nothing that the intervals do not show."""

from typing import Any

from rig.studies.benchmark.ranking import verdict


def group(entrant: str, low: float, high: float, **more: Any) -> dict[str, Any]:
    place = {"reference": "as flown", "signal": "pitch_rate", "place": "alone", "kind": "offset", "trials": 100}
    interval = {"value": (low + high) / 2.0, "low": low, "high": high}
    votes = {"peak_smaller": 30, "peak_larger": 60, "peak_median": 0.2, "peak_built_in": 0.1}
    harmed = {"harmed": {"value": 0.0, "low": -0.1, "high": 0.1}}
    return {"built_in": "cross-channel", **place, "manager": entrant, **interval, **harmed, **votes, **more}


def said(table: Any = (), rows: Any = (), silent: Any = (), **more: Any) -> list[str]:
    rest: dict[str, Any] = {"transients": [], "second": [], "lost_differences": []}
    return verdict({"table": table, "differences": rows, "silent": silent, **rest, **more})


def test_the_worst_loss_comes_first_and_what_may_be_chance_is_no_loss():
    rows = [group("cusum", 0.05, 0.15), group("glr", 0.2, 0.4), group("parity", -0.01, 0.2)]
    lines = said(rows=rows)
    assert lines == [
        "cross-channel LOSES, of 1 group: 1 in which another manager isolates more",
        "LOSS: glr isolates 30.0 points more than cross-channel (95 %: 20.0 to 40.0): "
        "pitch_rate, alone, offset, reference as flown",
        "LOSS: cusum isolates 10.0 points more than cross-channel (95 %: 5.0 to 15.0): "
        "pitch_rate, alone, offset, reference as flown",
    ]


def test_votes_that_are_no_number_are_named():
    row = group("own:Voter", 0.0, 0.0, kind="all") | {"no_number": 6, "prior": 0, "wrong channel": 0}
    assert said([row])[-1].startswith("own:Voter VOTES NO NUMBER in 6 of 100 trials: pitch_rate, alone, all kinds")
    assert not any("NO NUMBER" in line for line in said([row | {"no_number": 0}]))


def test_states_of_the_reference_that_change_nothing_share_a_sentence():
    rows = [group("parity", 0.1, 0.2, reference=state) for state in ("as flown", "absent", "jumping")]
    rows.append(group("parity", 0.05, 0.2, reference="off"))
    lines = said(rows=rows)
    assert [line.split("offset, ")[1] for line in lines[1:]] == [
        "reference as flown, absent, jumping",
        "reference off",
    ]


def test_without_a_loss_the_verdict_names_the_managers_that_isolate_less():
    lines = said(rows=[group("cusum", -0.3, -0.1, kind="all")])
    assert lines == [
        "no baseline manager isolates significantly more than cross-channel in any group",
        "cross-channel isolates 20.0 points more than cusum (95 %: 10.0 to 30.0): "
        "pitch_rate, alone, all kinds, reference as flown",
    ]


def test_the_same_difference_is_one_sentence_for_all_variants():
    rows = [group("cusum", -0.3, -0.1, kind="all", built_in=name) for name in ("cross-channel", "cross-channel tests")]
    assert said(rows=rows) == [
        "no baseline manager isolates significantly more than cross-channel, cross-channel tests in any group",
        "cross-channel, cross-channel tests isolate 20.0 points more than cusum (95 %: 10.0 to 30.0): "
        "pitch_rate, alone, all kinds, reference as flown",
    ]


def test_a_difference_that_may_be_chance_is_called_not_significant():
    rows = [group(f"cross-channel {name}", -0.1, 0.1, kind="all") for name in ("tests", "tests and sums")]
    assert said(rows=rows) == [
        "cross-channel tests, cross-channel tests and sums against cross-channel: "
        "+0.0 points isolated (95 %: -10.0 to +10.0), not significant: "
        "pitch_rate, alone, all kinds, reference as flown"
    ]


def test_the_bursts_of_a_manager_share_a_sentence():
    burst = {"manager": "parity", "signal": "pitch_rate", "bursts": 12, "failed": 12}
    sizes = [{"frames": 1, "thresholds": 10.0}, {"frames": 4, "thresholds": 2.0}]
    assert said(transients=[{**burst, **size} for size in sizes]) == [
        "parity ISOLATES A CHANNEL FOR A TRANSIENT: pitch_rate: 12 of 12 bursts of 1 frame and 10 thresholds; "
        "12 of 12 bursts of 4 frames and 2 thresholds"
    ]


def test_a_manager_that_isolates_no_channel_is_compared_by_its_vote_alone():
    lines = said(rows=[group("median", -1.0, -0.9, kind="all")], silent=["median"])
    assert lines == [
        "median isolates no channel; its largest vote error is smaller than that of cross-channel in 30 % of trials, "
        "larger in 60 %: pitch_rate, alone, all kinds, reference as flown"
    ]


def test_a_budget_is_broken_when_chance_would_hardly_make_so_many():
    count = {"manager": "cusum", "signal": "pitch_rate", "expected": 0.1}
    assert "EXCEEDS THE FALSE-ISOLATION RATE" in said(second=[{**count, "counted": 2}])[-1]  # a chance of 0.5 %
    assert said(second=[{**count, "expected": 1.0, "counted": 2}]) == []  # 26 %


def test_a_manager_that_fails_fewer_healthy_channels_is_a_loss():
    fewer = {"harmed": {"value": -0.1, "low": -0.15, "high": -0.05}}
    assert said(rows=[group("parity", -0.1, 0.1, **fewer)]) == [
        "cross-channel LOSES, of 1 group: 1 in which another isolates fewer healthy channels",
        "no baseline manager isolates significantly more than cross-channel in any group",
        "LOSS: parity isolates a healthy channel in 10.0 points fewer of the trials than cross-channel "
        "(95 %: 5.0 to 15.0): pitch_rate, alone, offset, reference as flown",
    ]


def test_a_smaller_vote_error_is_a_loss_if_a_sign_test_says_so_even_of_a_manager_that_isolates_no_channel():
    votes = {"peak_median": 0.08, "peak_built_in": 0.1}
    rows = [group("median", -0.1, 0.1, peak_smaller=60, peak_larger=30, **votes)]  # of 90, 60: p = 0.002
    rows.append(group("mean", -0.1, 0.1, peak_smaller=50, peak_larger=40, **votes))  # p = 0.34
    lines = said(rows=rows, silent=["median", "mean"])
    assert lines[0] == "cross-channel LOSES, of 1 group: 1 in which another has the smaller vote error"
    assert lines[1:2] == [
        "LOSS: median has a smaller vote error than cross-channel in 60 % of trials, a larger one in 30 % "
        "(median 0.08 instead of 0.10 thresholds): pitch_rate, alone, offset, reference as flown"
    ]
