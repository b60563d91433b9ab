"""Suspect channels, counted: what comes and goes is failed by no persistence, and is told nevertheless."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_verdict_parts import flight, offset

from rig.core.frame import CHANNELS, DISCRETES, INDEX, SIGNALS, Block, State, Table, new_block
from rig.flight.suspects import Suspect, count_suspects, doubted, new_counts, suspects
from rig.studies.campaign.tables import rows as campaign_rows
from rig.verdict.conclusion import conclusion
from rig.verdict.score_records import Score
from rig.verdict.score_tables import SUSPECTS, tables
from rig.verdict.scoring import score

Q = INDEX["pitch_rate"]
# Off in seven frames of eight from frame 10 on: never as long as the persistence of eight.
SEVEN_OF_EIGHT = offset([2], 0.1, 0.3, duration_s=0.07, repeat_every_s=0.08)


def healthy(frames: int) -> Block:
    rows = new_block(frames)
    rows["valid"] = rows["discrete_valid"] = 1
    return rows


def counted(rows: Block, size: int = 1000) -> dict[tuple[str, int], Suspect]:
    counts = new_counts()
    for k in range(0, len(rows), size):
        count_suspects(rows[k : k + size], counts)
    return {(each.signal, each.channel): each for each in suspects(counts, len(rows))}


def told(found: Score) -> list[object]:
    """The only row of the table of suspects."""
    (row,) = tables(found, 100.0)["suspects"].rows
    return [column.of(row) for column in SUSPECTS]


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_the_counts_of_any_blocks_are_those_of_the_rule(seed: int, size: int):
    rng, rows = np.random.default_rng(seed), new_block(40)
    for state, valid in (("state", "valid"), ("discrete_state", "discrete_valid")):
        rows[state] = rng.choice([*State], rows[state].shape, p=[0.5, 0.2, 0.1, 0.2])
        rows[valid] = rng.integers(0, 2, rows[valid].shape)
    rows["channels"] = rng.choice([0.0, np.nan, np.inf], rows["channels"].shape)
    found = counted(rows, size)
    usable = (rows["valid"] != 0) & np.isfinite(rows["channels"])
    by_rule = [
        *doubted(rows["state"], usable).sum(axis=0),
        *doubted(rows["discrete_state"], rows["discrete_valid"] != 0).sum(axis=0),
    ]
    failed = [*(rows["state"] == 2).any(axis=0), *(rows["discrete_state"] == 2).any(axis=0)]
    for item, of_item, out in zip((*SIGNALS, *DISCRETES), by_rule, failed, strict=True):
        for c in range(CHANNELS):
            assert found[item.name, c + 1] == (item.name, c + 1, of_item[c], 40, out[c])


def test_a_channel_is_suspect_by_its_state_or_in_use_without_a_sample_but_not_once_it_is_failed():
    state = np.array([State.OK, State.SUSPECT, State.FAILED, State.ABSENT], np.uint8)
    assert doubted(state, np.ones(4, bool)).tolist() == [False, True, False, False]
    assert doubted(state, np.zeros(4, bool)).tolist() == [True, True, False, False]


def test_a_channel_that_is_not_fitted_is_not_listed():
    rows = healthy(5)
    rows["state"][:, Q, 3] = State.ABSENT
    assert ("pitch_rate", 4) not in counted(rows) and ("pitch_rate", 3) in counted(rows)


@pytest.mark.parametrize(
    ("rows", "of", "failed", "slow_faults"),
    [
        (0, 2000, False, False),
        (9, 100, False, False),  # no more than what persistence forgives once
        (10, 100, False, True),
        (19, 2000, False, False),
        (20, 2000, False, True),
        (2000, 2000, False, True),
        (1750, 2000, True, False),
    ],
)
def test_many_rows_and_no_failure_deserve_a_sentence(rows: int, of: int, failed: bool, slow_faults: bool):
    assert Suspect("gyro", 2, rows, of, failed).slow_faults == slow_faults


def test_it_is_told_with_count_and_share():
    assert Suspect("gyro", 2, 1750, 2000, False).text("rows") == "in 1750 of 2000 rows (87.5 %), never isolated"
    assert Suspect("gyro", 2, 7, 2000, True).text() == "in 7 of 2000 frames (0.35 %)"


def test_a_fault_shorter_than_the_persistence_for_ever_is_told_in_the_score_and_in_the_conclusion():
    which, rows = flight([SEVEN_OF_EIGHT], 200, exact=True)
    found = score(which, Table(rows))
    off = sum((k - 10) % 8 < 7 for k in range(10, 200))  # frames in which the fault acts: 167
    suspect = {(s.signal, s.channel): s.rows for s in found.suspects}
    assert suspect.pop(("pitch_rate", 2)) == off and not any(suspect.values())
    assert found.faults[0].outcome == "missed" and found.faults[0].tolerated
    assert f"pitch rate, channel 2: suspect in {off} of 200 frames (83.5 %), never isolated" in conclusion(which, found)
    assert told(found) == ["pitch rate, channel 2", off, "83.5 %", "never"]
    plain = next(each for each in found.as_dict()["suspects"] if each["rows"])
    assert plain == {
        **{"signal": "pitch_rate", "channel": 2, "rows": off, "of": 200, "failed": False},
        "share": pytest.approx(off / 200),
    }


def test_a_channel_that_is_failed_is_in_the_table_and_in_no_sentence():
    which, rows = flight([offset([2], 0.1, 0.3)], 100, exact=True)
    found = score(which, Table(rows))
    assert told(found) == ["pitch rate, channel 2", 7, "7 %", "yes"]
    assert not any("suspect" in line for line in conclusion(which, found))


@pytest.mark.parametrize("manager", ["cross-channel", "mean"])
def test_samples_that_are_flagged_in_every_second_frame_are_counted_by_all_managers(manager: str):
    gaps = {"kind": "intermittent", "signal": "pitch_rate", "channels": [4], "start_s": 0.2, "in_gaps": "invalid"}
    which, rows = flight([{**gaps, "gap_s": 0.01, "contact_s": 0.01}], 200, f"redundancy.manager={manager}")
    [suspect] = [each for each in score(which, Table(rows)).suspects if each.rows]
    assert (suspect.signal, suspect.channel, suspect.rows, suspect.failed) == ("pitch_rate", 4, 90, False)


def test_an_intermittent_discrete_is_told_too():
    gaps = {"kind": "intermittent", "signal": "gear_down", "channels": [3], "start_s": 0.2, "in_gaps": "invalid"}
    which, rows = flight([{**gaps, "gap_s": 0.01, "contact_s": 0.01}], 200)
    assert "gear down, channel 3: suspect in 90 of 200 frames (45 %), never isolated" in conclusion(
        which, score(which, Table(rows))
    )


def test_fly_campaign_and_report_tell_it(rig_command, tmp_path: Path):
    from rig.scenario import scenario
    from rig.studies.campaign.flying import fly

    often = "start_s=1, duration_s=0.07, repeat_every_s=0.08"
    fault = f'faults=[{{kind="offset", signal="roll_rate", channels=[1], offset=1.0, {often}}}]'
    sets = ["duration_s=3", fault]
    told = rig_command("fly", "--set", sets[0], "--set", sets[1], "--out", str(tmp_path))[1]
    assert "suspect  roll_rate channel 1 in 175 of 300 frames (58.3 %), never isolated" in told
    assert "  roll rate, channel 1   suspect in 175 of 300 frames (58.3 %), never isolated" in told
    log = next(tmp_path.glob("*.mcap"))
    found = json.loads(rig_command("report", str(log), "--json")[1])
    page = log.with_suffix(".html").read_text()
    assert "Suspect channels" in page and "channels suspect in many frames, never isolated" in page
    assert [each["rows"] for each in found["suspects"] if each["rows"]] == [175]
    flown = fly(scenario.load(None, sets))
    (row,) = campaign_rows("runs", 0, flown.scenario, score(flown.scenario, flown.table), flown)
    assert row["suspect_channels"] == 1
