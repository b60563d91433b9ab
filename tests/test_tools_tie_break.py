"""The table of tie-break rules: what counts as correct, wrong and undecided."""

from __future__ import annotations

from pathlib import Path

import polars as pl
from figures import tie_break


def test_a_signal_that_is_given_up_is_undecided_and_a_healthy_channel_that_a_rule_isolates_is_wrong(tmp_path: Path):
    """A signal that is given up isolates its healthy channels too, so its flights have wrong isolations as well."""
    flights = [  # detected, missed, wrong isolations, decided by
        (2, 0, 0, None, "correct"),
        (2, 0, 2, "given_up", "undecided"),
        (0, 2, 0, None, "undecided"),
        (2, 0, 1, "extremes", "wrong"),
    ]
    detected, missed, wrong, rules, expected = (list(column) for column in zip(*flights, strict=True))
    runs = {"run": range(4), "outcome": ["flown"] * 4, "detected": detected, "missed": missed}
    runs |= {"wrong_isolations": wrong, "false_alarms": [0] * 4, "pattern": ["2:2, good low"] * 4}
    of_rules = [(run, rule) for run, rule in enumerate(rules) if rule]
    alarms = {"run": [run for run, _ in of_rules], "decided_by": [rule for _, rule in of_rules]}
    for name, columns in (("runs", {**runs, "faults.*.signal": ["pitch_rate"] * 4}), ("alarms", alarms)):
        (tmp_path / name).mkdir()
        pl.DataFrame(columns).write_parquet(tmp_path / name / "0.parquet")
    assert tie_break.flown(str(tmp_path)).sort("run")["result"].to_list() == expected
