"""Open-loop trials: drawn records are those of the stage, the same isolations as in flight, no matter who runs them."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from trial_vs_flight import trial_vs_flight
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core import sealed
from rig.core.errors import BadInput
from rig.scenario.overrides import set_key
from rig.scenario.scenario import load
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.study_folder import locked
from rig.studies.reliability.campaign_cells import cells
from rig.studies.reliability.cell_trials import (
    SHARES,
    Batch,
    Tally,
    TrialRunner,
    added_up,
    combinations,
    planned,
    shared_out,
)
from rig.studies.reliability.cell_trials import fly_trials as run_trials
from rig.studies.reliability.drawn import Drawn, cell, draw, records, refill
from rig.studies.reliability.one_signal import faults_of, one_signal, recording, setting_key
from rig.studies.reliability.trials_folder import fly_trials
from rig.world.faults.effects import Act

RELIABILITY = "faults/campaigns/reliability.toml"


def plan(**sets: Any) -> Plan:
    campaign = read(RELIABILITY, {key.replace("__", "."): value for key, value in sets.items()})
    return Plan(campaign, "reliability.toml")


@pytest.fixture(scope="module")
def bundled() -> Plan:
    return plan()


def of_form(made: Plan, form: str, design: str, more: int = 0) -> int:
    """The number of a run with a form and a design, pitch rate in a manoeuvre."""
    wanted = {"form": form, "signal": "pitch_rate", "condition": "manoeuvre"}
    found = [
        n
        for n, choice in enumerate(made.choices)
        if str(choice["design"]).startswith(design) and all(choice[k] == v for k, v in wanted.items())
    ]
    return found[more]


FORMS = ("hardover", "stuck", "offset up", "offset down", "drift up", "drift down", "oscillation", "noise", "dropout")


@pytest.mark.parametrize("form", [*FORMS, "intermittent high", "intermittent low"])
@pytest.mark.parametrize("design", ["single 3", "near 4"])
def test_drawn_records_are_those_that_the_stage_makes_of_a_scenario_with_these_values(
    bundled: Plan, form: str, design: str
):
    number = of_form(bundled, form, design)
    other = Plan(bundled.campaign.model_copy(update={"seed": 77}), "other")  # the same cases, other values
    made, scenario = cell(bundled, number), other[number].scenario()
    expected = faults_of(scenario, "pitch_rate")
    values = {place: other.choices[number][f"faults.{place[0]}.{place[1]}"] for place in made.varied}
    assert values and any(bundled.choices[number][f"faults.{i}.{key}"] != v for (i, key), v in values.items())
    ups = [1.0] * len(scenario.faults)
    for target in expected.targets[expected.targets["act"] == Act.SET]:
        ups[target["fault"]] = float(target["value"] == target["high"])
    drawn = Drawn({place: np.array([v, v]) for place, v in values.items()}, np.array([ups, ups]) > 0.5)
    schedule, targets = records(made, drawn)
    assert all((schedule[j] == expected.schedule).all() and (targets[j] == expected.targets).all() for j in (0, 1))


@pytest.mark.parametrize("manager", ["cross-channel", "cross-voter"])
def test_a_trial_isolates_the_channels_of_its_flight_in_the_same_frames(manager: str):
    made = plan(redundancy__manager=manager)
    forms = {"single 4": ("offset up", "noise"), "single 3": ("drift down", "stuck"), "near 4": ("oscillation",)}
    runs = [of_form(made, f, design, 1) for design, all_of in forms.items() for f in all_of]
    runs += [of_form(made, "intermittent high", "alike 4"), of_form(made, "dropout", "near 4")]
    isolated = 0
    for number in runs:
        found = trial_vs_flight(made[number].scenario())
        np.testing.assert_array_equal(found.trial, found.flight, err_msg=str(made.choices[number]))
        assert found.trial_kept == found.flight_kept
        isolated += int((found.flight >= 0).sum())
    assert isolated >= len(runs)


ALIKE = {
    "design": "alike 4, channel 4",
    "form": "stuck",
    "signal": "static_pressure",
    "condition": "manoeuvre",
}


def test_a_vote_that_is_not_correct_in_flight_is_not_correct_in_the_trial(bundled: Plan):
    """Two alike, stuck on static pressure in a climb, and no reference: the split is given up, the vote off by then."""
    number = next(n for n, each in enumerate(bundled.choices) if ALIKE.items() <= each.items())
    data = set_key({**bundled[number].data, "seed": 7521671657455518360}, "faults.0.start_s", 2.6715478619507285, "")
    data = set_key(data, "redundancy.signals.static_pressure.stale_frames", 0, "")
    data = set_key(data, "redundancy.references.static_pressure", "none", "")
    found = trial_vs_flight(replace(bundled[number], data=data).scenario())
    assert not found.trial_kept and not found.flight_kept
    assert (found.flight >= 0).all() and (found.trial >= 0).all()


def test_a_signal_that_is_lost_after_its_vote_was_not_correct_is_no_annunciated_loss():
    made_of = plan(redundancy__manager="cross-voter")
    made = cell(made_of, of_form(made_of, "hardover", "alike 4"))
    drawn = draw(made, 20, recording(made.scenario, 1), np.random.default_rng(2))

    def lost(allowed: int) -> int:
        noise, normal = np.random.default_rng(3), np.random.default_rng(4)
        results, _, _ = run_trials(made, drawn._replace(allowed=allowed), lambda: refill(drawn, noise, normal))
        return int((results["lost"] != 0).sum())

    assert lost(drawn.allowed) > 0
    assert lost(-1) == 0, "as if the vote had been off too long from the first frame on"


@pytest.mark.parametrize(("design", "counted"), [("single", [3, 4]), ("near", [4]), ("alike", [4])])
def test_trials_before_which_healthy_channels_were_failed_count_only_where_two_good_ones_remain(
    design: str, counted: list[int]
):
    counts, nothing = np.ones((5, 5), np.int64), np.zeros(5, np.int64)
    tally = Tally(("pitch_rate", 4, design, "hardover", "level"), counts, nothing, nothing, 100.0)
    assert added_up([tally], "m").counts["good_before"].to_list() == counted


def test_units_share_out_all_trials_over_every_combination(bundled: Plan):
    units = shared_out(bundled, 200_000, 5)
    assert {unit.number for unit in units} == {n for n in combinations(bundled) if planned(bundled, n) in SHARES}
    of_place: dict[tuple[int, str], int] = {}
    for unit in units:
        place = planned(bundled, unit.number)
        of_place[place] = of_place.get(place, 0) + unit.trials
    assert sum(of_place.values()) >= 200_000
    assert {place: n / 200_000 for place, n in of_place.items()} == pytest.approx(SHARES, rel=0.03)
    assert len({(unit.number, unit.chunk) for unit in units}) == len(units)


def test_neither_order_nor_company_decides_what_a_unit_draws(bundled: Plan):
    numbers = [of_form(bundled, form, design) for form in ("noise", "hardover") for design in ("single 4", "alike 4")]
    units = [Batch(number, chunk, 40, 3) for number in numbers for chunk in (0, 1)]
    one = added_up([*map(TrialRunner(bundled), units)], "m")
    other = TrialRunner(plan())
    two = added_up([other(unit) for unit in reversed(units)], "m")
    assert one.counts.equals(two.counts) and one.false_isolations.equals(two.false_isolations)
    assert one.counts["trials"].sum() == 320
    different = added_up([TrialRunner(bundled)(Batch(u.number, u.chunk, 40, 4)) for u in units], "m")
    assert not different.counts.equals(one.counts)


def test_hardovers_with_four_good_are_out_after_eight_frames_and_the_vote_is_kept(bundled: Plan):
    found = added_up([TrialRunner(bundled)(Batch(of_form(bundled, "hardover", "single 4"), 0, 200, 1))], "m")
    (row,) = found.counts.to_dicts()
    assert (row["good_before"], row["trials"], row["correct"]) == (4, 200, 200)
    assert row["settle_s_mean"] == pytest.approx(0.07) and row["lost_aircraft_undetected"] is None
    # Ten healthy frames on four channels, then the linger of ten has just passed when the trial ends: three, one frame.
    assert found.false_isolations.rows()[0] == ("pitch_rate", 4, pytest.approx(200 * 40 / 360_000), 0)


def test_a_mean_is_bad_after_a_hardover():
    made = plan(redundancy__manager="mean")
    (row,) = added_up(
        [TrialRunner(made)(Batch(of_form(made, "hardover", "single 4"), 0, 50, 1))], "mean"
    ).counts.to_dicts()
    assert (row["undetected_error"], row["correct"], row["settle_s_mean"]) == (50, 0, None)


@pytest.mark.parametrize("good", [[2], [4, 1], [3, 2, 1]])
def test_levels_two_and_one_are_refused_with_the_reason(bundled: Plan, good: list[int]):
    with pytest.raises(BadInput, match=r"--good-before [12]: .* the aircraft follows the vote .*; fly the campaign"):
        shared_out(bundled, 100, 1, good)


def test_two_faults_among_three_good_channels_are_left_to_flights(bundled: Plan, tmp_path: Path):
    """One good channel of three is outvoted, and the aircraft follows the others."""
    assert {planned(bundled, unit.number) for unit in shared_out(bundled, 1000, 1, [3])} == {(3, "single")}
    (tmp_path / "c.toml").write_text(SMALL.replace("single 4, channel 2", "near 3, channel 2"))
    with pytest.raises(BadInput, match="no case has 4 or 3 good channels and leaves two of them good"):
        shared_out(Plan(read(tmp_path / "c.toml"), "c.toml"), 100, 1)


@pytest.mark.parametrize(
    ("name", "sets", "said"),
    [
        ("smoke", {}, "not a campaign like `reliability`: it has no cases.design"),
        ("reliability", {"redundancy.manager": "mine:Own"}, "redundancy.manager: 'mine:Own'"),
        ("reliability", {"sensors.pitch_rate.g_sensitivity_tolerance": 0.001}, "sensors.pitch_rate: .* cross-axis"),
    ],
)
def test_what_trials_do_not_know_is_refused_in_one_line(tmp_path: Path, name: str, sets: dict[str, Any], said: str):
    with pytest.raises(BadInput, match=said) as caught:
        fly_trials(Plan(read(name, sets), name), tmp_path / "out", 100, 1, 1, [4])
    assert "\n" not in str(caught.value) and not (tmp_path / "out").exists()


SMALL = """
base = "f16_pitch_rate_hardover"
sampling = "stratified"
runs = 2
[set]
duration_s = 2.0
faults = [{ id = "tested", kind = "hardover", signal = "pitch_rate", channels = [2] }]
[vary]
"faults.0.start_s" = { low = 0.5, high = 1.0 }
[[cases.design]]
name = "single 4, channel 2"
[[cases.condition]]
name = "level"
[[cases.condition]]
name = "climb"
set = { "pilot.manoeuvres" = [{ kind = "step", axis = "altitude", start_s = 0.2, amplitude = 30.0 }] }
"""


def run(*argv: str) -> Any:
    return CliRunner().invoke(app, ["reliability", "trials", *argv])


@pytest.mark.long
def test_the_command_writes_the_same_folder_of_cells_by_any_worker(tmp_path: Path):
    (tmp_path / "c.toml").write_text(SMALL)
    told = {}
    for workers in ("1", "2"):
        out = tmp_path / workers
        argv = [str(tmp_path / "c.toml"), "--out", str(out), "--runs", "1500", "--good-before", "4", "--json"]
        done = run(*argv, "--workers", workers, "--seed", "9")
        assert done.exit_code == 0, done.output
        told[workers] = {key: value for key, value in json.loads(done.stdout).items() if key != "out"}
    one, two = (cells(tmp_path / workers) for workers in ("1", "2"))
    assert one.counts.equals(two.counts) and one.false_isolations.equals(two.false_isolations)
    assert told["1"] == told["2"] and told["1"]["trials"] == 1500 and told["1"]["seed"] == 9
    assert one.manager == "cross-channel" and one.counts["trials"].to_list() == [750, 750]


def test_a_folder_that_is_there_is_not_written_to(tmp_path: Path):
    (tmp_path / "there").write_text("x")
    done = run("reliability", "--out", str(tmp_path), "--runs", "10")
    assert isinstance(done.exception, BadInput) and "folder exists and is not empty" in str(done.exception)


def flip(path: Path, bit: int) -> None:
    data = bytearray(path.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    path.write_bytes(bytes(data))


def rewrite(path: Path, change: Callable[[pl.DataFrame], pl.DataFrame]) -> None:
    """Change a table, under a new checksum."""
    place = pl.read_parquet_metadata(path)["place"]
    path.write_bytes(sealed.table(change(pl.read_parquet(path)), place))


def test_two_at_once_are_not_both_taken_and_a_killed_one_goes_on(tmp_path: Path):
    (tmp_path / "c.toml").write_text(SMALL)
    out, made = tmp_path / "out", Plan(read(tmp_path / "c.toml"), "c.toml")
    with (
        locked(out, "x"),
        pytest.raises(BadInput, match="another rig reliability trials is running into it"),
    ):
        fly_trials(made, out, 4, 1, 1, [4])
    assert [path.name for path in out.iterdir()] == ["lock"]
    (out / ".cells.parquet.0123abcd.part").write_text("half")
    fly_trials(made, out, 4, 1, 1, [4])
    whole = {path.name: path.read_bytes() for path in out.iterdir()}
    assert set(whole) == {"lock", "cells.parquet", "false_isolations.parquet", "trials.json"}
    (out / "trials.json").unlink()  # as a kill before the last file leaves it
    fly_trials(made, out, 4, 1, 1, [4])
    assert {path.name: path.read_bytes() for path in out.iterdir()} == whole
    (out / "trials.json").unlink()
    (out / "cells.parquet").write_text("of the user")
    with pytest.raises(BadInput, match="folder exists and is not empty"):
        fly_trials(made, out, 4, 1, 1, [4])


def test_trials_of_an_earlier_version_are_read_with_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "c.toml").write_text(SMALL)
    out = tmp_path / "out"
    fly_trials(Plan(read(tmp_path / "c.toml"), "c.toml"), out, 4, 1, 1, [4])
    before = cells(out)
    about = json.loads((out / "trials.json").read_text())
    del about["seal"], about["place"]
    (out / "trials.json").write_text(json.dumps({**about, "format": 1}))
    for name in ("cells", "false_isolations"):
        pl.read_parquet(out / f"{name}.parquet").write_parquet(out / f"{name}.parquet")
    assert cells(out).counts.equals(before.counts)
    assert "earlier version of rig; its tables have no checksum" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda folder: (folder / "cells.parquet").unlink(), "cells.parquet: is missing"),
        (lambda folder: (folder / "cells.parquet").write_bytes(b"x"), "cells.parquet: it has no checksum"),
        (lambda folder: flip(folder / "cells.parquet", 700), "cells.parquet: its bytes were changed"),
        (lambda folder: flip(folder / "false_isolations.parquet", 90), "isolations.parquet: its bytes were changed"),
        (
            lambda folder: (folder / "false_isolations.parquet").write_bytes((folder / "cells.parquet").read_bytes()),
            "false_isolations.parquet: it was written for another place",
        ),
        (
            lambda folder: rewrite(
                folder / "cells.parquet", lambda f: f.with_columns(good_before=pl.col("trials") // 0)
            ),
            "cells.parquet: a value of good_before is missing",
        ),
        (lambda folder: flip(folder / "trials.json", 8 * 20), "trials.json: (is damaged|cannot be read)"),
        (lambda folder: (folder / "trials.json").write_text("{}"), "trials.json: is damaged"),
        (lambda folder: (folder / "trials.json").write_text("{"), "trials.json: cannot be read"),
    ],
)
def test_a_damaged_folder_is_refused_in_one_line(tmp_path: Path, damage: Any, said: str):
    (tmp_path / "c.toml").write_text(SMALL)
    fly_trials(Plan(read(tmp_path / "c.toml"), "c.toml"), tmp_path / "out", 4, 1, 1, [4])
    damage(tmp_path / "out")
    with pytest.raises(BadInput, match=said) as caught:
        cells(tmp_path / "out")
    assert "\n" not in str(caught.value)


_HEEDS = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored from the first
from rig.cli.main import main
main()
"""


@pytest.mark.long
def test_ctrl_c_leaves_nothing(tmp_path: Path):
    out = tmp_path / "out"
    argv = [
        sys.executable,
        "-c",
        _HEEDS,
        "reliability",
        "trials",
        "reliability",
        "--runs",
        "100000000",
        "--out",
        str(out),
    ]
    process = subprocess.Popen(argv, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        for _ in range(1200):
            if out.exists():
                break
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130 and b"Traceback" not in said and not out.exists()


def test_combinations_of_the_same_settings_share_no_memory_and_other_settings_have_parameters_of_their_own():
    def of(**redundancy: object):
        data = {"faults": [], "redundancy": {"signals": {"pitch_rate": {"threshold": 0.05, **redundancy}}}}
        return one_signal(load(data), "pitch_rate", setting_key({**data, "seed": 3, "title": "x"}))

    first, again, other = of(), of(), of(persistence=17)
    for one, two in ((first.params, again.params), (first.manager.params, again.manager.params)):
        assert all(np.array_equal(one[name], two[name]) for name in one.dtype.names or ())
    for one, two in ((first.memory, again.memory), (first.params, again.params), (first.line, again.line)):
        assert not np.shares_memory(one, two)
    assert not np.shares_memory(first.manager.params, again.manager.params)
    assert (first.manager.params["persistence"], other.manager.params["persistence"]) == (8, 17)
    assert (
        setting_key({"seed": 1, "faults": [1]})
        == setting_key({"seed": 2, "title": "t"})
        != setting_key({"rate_hz": 1.0})
    )


SLOW = {"kind": "slow drift", "form": "up", "condition": "severe turbulence", "signal": "pitch_rate"}


def test_slow_drifts_are_tried_until_they_are_found_in_cells_of_their_own():
    made = Plan(read("reliability-slow"), "reliability-slow.toml")
    numbers = {
        str(choice["design"])[:8].strip(" ,"): n
        for n, choice in enumerate(made.choices)
        if SLOW.items() <= choice.items() and planned(made, n) in SHARES
    }
    for number in (numbers["single 4"], numbers["near 4"], numbers["alike 4"]):
        found = trial_vs_flight(made[number].scenario())
        np.testing.assert_array_equal(found.trial >= 0, found.flight >= 0)
        assert (found.trial >= 0).any() and found.trial_kept and found.flight_kept
    unit = Batch(numbers["single 4"], 0, 40, 3)
    [row] = added_up([TrialRunner(made)(unit)], "cross-channel").counts.to_dicts()
    assert (row["kind"], row["trials"], row["announced"]) == ("slow drift", 40, 40)
    assert row["settle_s_mean"] > 1.0  # a hardover takes 0.07
