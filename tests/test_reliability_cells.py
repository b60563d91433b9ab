"""Cells of a campaign's tables: hand-built tables with known counts, and what is refused."""

import random
from collections import Counter
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from rig.core.errors import BadInput
from rig.core.frame import SIGNALS
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.campaign_cells import cells, of_tables
from rig.studies.reliability.tally import CELL, Cells

Row = dict[str, Any]
STICKS = {"stick_pitch", "stick_roll", "pedal"}
RUN = {"outcome": "flown", "manager": "median", "survived": True, "condition": "level"}
FAULT = {"signal": "pitch_rate", "kind": "offset", "channel": 1, "outcome": "detected", "good_before": 4}
FAULT |= {"vote_correct": True, "lost_s": 0.0, "wrong_vote_first": False, "delay_from_onset_s": 0.08}
FAULT_TYPES = {
    "delay_from_onset_s": pl.Float64,
    "good_before": pl.Int64,
    "vote_correct": pl.Boolean,
    "lost_s": pl.Float64,
}


def tables(*trials: tuple[str, Row, list[Row]]) -> dict[str, pl.DataFrame]:
    """Runs with their design, what differs of the run, and of each of its faults."""
    runs = [{**RUN, "run": i, "design": f"{design}, channel 1", **run} for i, (design, run, _) in enumerate(trials)]
    faults = [
        {**FAULT, "run": i, "id": "tested", **fault} for i, (_, _, of_run) in enumerate(trials) for fault in of_run
    ]
    level = {f"channel_hours_level_{k}": 0.25 * k for k in (4, 3, 2, 1)}
    level |= {f"false_isolations_level_{k}": int(k == 3) for k in (4, 3, 2, 1)}
    signals = [{"run": i, "signal": "pitch_rate", **level} for i in range(len(runs))]
    made = {"runs": pl.DataFrame(runs), "faults": pl.DataFrame(faults, schema_overrides=FAULT_TYPES)}
    return {**made, "signals": pl.DataFrame(signals)}


BAD, LOST = {"vote_correct": False}, {"vote_correct": False, "lost_s": 0.3}
TRIALS = [
    ("single 4", {}, [{}]),
    ("single 4", {}, [{"delay_from_onset_s": 0.10}]),
    ("single 4", {}, [{"delay_from_onset_s": None, "outcome": "missed"}]),  # kept, not settled
    ("single 4", {"survived": False}, [BAD]),
    ("single 4", {}, [BAD]),
    ("single 4", {"survived": False}, [LOST]),
    ("single 4", {}, [{"outcome": "not executed"}]),  # its channel was out already: no trial
    ("single 4", {"outcome": "crashed"}, []),
    ("single 3", {}, [{"good_before": 3, "lost_s": 0.1}]),
    ("single 2", {}, [{"good_before": 1}, {"id": "earlier", "channel": 2, **BAD}]),  # a healthy one was failed before
    ("alike 4", {}, [{"delay_from_onset_s": 0.08}, {"channel": 2, "delay_from_onset_s": 0.2}]),
    ("near 4", {}, [BAD, {"id": "second", "channel": 2, "good_before": 3}]),  # the window of the second decides
    ("near 4", {}, [{}, {"id": "second", "channel": 2, "good_before": 3, **LOST}]),
    ("near 4", {}, [BAD, {"id": "second", "channel": 2, "outcome": "not executed"}]),
]


def row(found: Cells, design: str, good: int) -> Row:
    (one,) = found.counts.filter((pl.col("design") == design) & (pl.col("good_before") == good)).to_dicts()
    return one


def test_trials_are_counted_by_what_became_of_the_signal():
    found = of_tables(tables(*TRIALS), "T")
    one = row(found, "single", 4)
    counts = {key: one[key] for key in ("trials", "correct", "annunciated_loss", "undetected_error")}
    assert counts == {"trials": 6, "correct": 3, "annunciated_loss": 1, "undetected_error": 2}
    assert (one["lost_aircraft_annunciated"], one["lost_aircraft_undetected"]) == (1, 1)
    assert one["settle_s_mean"] == pytest.approx(0.09) and found.manager == "median"
    assert {name: one[name] for name in CELL} == dict(
        zip(CELL, ("pitch_rate", 4, "single", "offset", "level"), strict=True)
    )


def test_a_wrong_vote_before_the_declared_loss_makes_it_an_undetected_error():
    found = of_tables(tables(("single 4", {}, [LOST]), ("single 4", {}, [{**LOST, "wrong_vote_first": True}])), "T")
    one = row(found, "single", 4)
    assert (one["trials"], one["annunciated_loss"], one["undetected_error"]) == (2, 1, 1)


def test_a_trial_counts_where_the_signal_stood_not_where_it_was_planned():
    found = of_tables(tables(*TRIALS), "T")
    assert row(found, "single", 1)["correct"] == 1 and row(found, "single", 3)["annunciated_loss"] == 1


def test_two_alike_are_one_trial_settled_with_the_later_of_them():
    one = row(of_tables(tables(*TRIALS), "T"), "alike", 4)
    assert (one["trials"], one["announced"], one["settle_s_mean"]) == (1, 1, pytest.approx(0.2))


def test_of_two_near_faults_the_window_of_the_second_decides_and_the_good_are_those_before_the_first():
    one = row(of_tables(tables(*TRIALS), "T"), "near", 4)
    assert (one["trials"], one["correct"], one["annunciated_loss"], one["undetected_error"]) == (3, 1, 1, 1)


def test_a_cell_in_which_nothing_settled_has_no_mean():
    one = row(of_tables(tables(("single 4", {}, [BAD])), "T"), "single", 4)
    assert (one["announced"], one["settle_s_mean"]) == (0, None)


def test_the_order_of_the_rows_changes_nothing():
    made, found = tables(*TRIALS), of_tables(tables(*TRIALS), "T")
    for seed in range(10):
        order = {name: random.Random(seed).sample(range(len(t)), len(t)) for name, t in made.items()}
        mixed = of_tables({name: made[name][rows] for name, rows in order.items()}, "T")
        assert mixed.counts.equals(found.counts) and mixed.false_isolations.equals(found.false_isolations)


def test_false_isolations_have_their_hours_by_level():
    found = of_tables(tables(*TRIALS[:4]), "T").false_isolations
    assert found.rows() == [
        ("pitch_rate", 4, 4.0, 0),
        ("pitch_rate", 3, 3.0, 4),
        ("pitch_rate", 2, 2.0, 0),
        ("pitch_rate", 1, 1.0, 0),
    ]


def changed(name: str, **columns: Any) -> dict[str, pl.DataFrame]:
    made = tables(*TRIALS)
    return {**made, name: made[name].with_columns(**columns)}


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (
            changed("runs", manager=pl.Series(["mean", *["median"] * (len(TRIALS) - 1)])),
            "several managers \\(mean, median",
        ),
        ({**tables(*TRIALS), "runs": tables(*TRIALS)["runs"].drop("design")}, "the runs have no 'design'"),
        (changed("faults", id=pl.lit("other")), "no run has a fault with id = 'tested'"),
        (changed("runs", outcome=pl.lit("crashed")), "not a flown campaign"),
        (changed("runs", design=pl.lit("double 4")), "design 'double': must begin with one of single, near, alike"),
    ],
)
def test_what_is_no_such_campaign_is_refused_in_one_line(made: dict[str, pl.DataFrame], said: str):
    with pytest.raises(BadInput, match=f"^T: .*{said}") as caught:
        of_tables(made, "T")
    assert "\n" not in str(caught.value)


def test_a_folder_that_is_no_campaign_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match="not a campaign's folder"):
        cells(tmp_path)


def test_what_was_planned_and_never_came_to_be_is_a_row_without_a_trial():
    one = row(of_tables(tables(*TRIALS), "T"), "single", 2)  # planned so; a healthy channel was failed before
    assert [one[key] for key in ("trials", "correct", "annunciated_loss", "undetected_error", "announced")] == [0] * 5


SLOW = {"kind": "slow drift"}


@pytest.mark.parametrize(("case", "kind", "counted"), [("slow drift", "drift", "slow drift"), ("up", "drift", "drift")])
def test_a_case_names_the_kind_of_its_cell_by_words_before_it(case: str, kind: str, counted: str):
    fault = {"kind": kind}
    earlier = {"id": "earlier", "channel": 2, "kind": "drift", "good_before": 4}
    made = tables(("single 3", {"kind": case}, [{**fault, "good_before": 3}, earlier]))
    assert row(of_tables(made, "T"), "single", 3)["kind"] == counted


def test_what_was_planned_of_a_kind_of_its_own_and_never_came_to_be_has_its_row():
    made = tables(("single 4", SLOW, [{"kind": "drift"}]), ("single 2", SLOW, [{"kind": "drift", "good_before": None}]))
    assert [row(of_tables(made, "T"), "single", good)["trials"] for good in (4, 2)] == [1, 0]
    assert set(of_tables(made, "T").counts["kind"]) == {"slow drift"}


def test_the_bundled_campaigns_give_cells_of_drifts_and_of_slow_drifts():
    """Seven designs, both signs, four conditions of every signal; three thresholds and 15 s within a flight."""
    plan = Plan(read("reliability-slow"), "reliability-slow.toml")
    assert Counter(choice["kind"] for choice in plan.choices) == {"slow drift": 728}
    assert {choice["signal"] for choice in plan.choices} == {signal.name for signal in SIGNALS} - STICKS
    rates = [abs(choice["faults.0.rate_thresholds_per_s"]) for choice in plan.choices]
    assert 0.05 <= min(rates) < 0.06 and 1.9 < max(rates) <= 2.0
    for run in (plan[k] for k in range(0, len(plan), 8)):
        scenario = run.scenario()
        tested = next(fault for fault in scenario.faults if fault.label == "tested")
        assert tested.magnitude is not None and tested.magnitude.thresholds and tested.start_s is not None
        assert tested.start_s + 3.0 / abs(tested.magnitude.value) + 15.0 <= scenario.duration_s
