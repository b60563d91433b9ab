"""Requirements in commands: flown, scored, on the page, in the viewer, on recordings and in campaigns."""

import json
import re

import numpy as np
import polars as pl
import pytest

from rig.core.errors import BadInput
from rig.core.frame import Table
from rig.flight.loop import fly_rows
from rig.scenario.scenario import load
from rig.show.pages.requirement_figures import Robustness
from rig.verdict.requirements.along import events, measure_scored
from rig.verdict.requirements.measure import check_log, check_rows, fly_requirements
from rig.verdict.requirements.requirement import load_requirements
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder
from rig.verdict.requirements.subject import of_flight

SHORT = {"duration_s": 4.0, "faults.0.start_s": 2.0}
SETS = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
TIGHT = """
[[requirements]]
id = "tight"
at = "each onset"
formula = "always[0, 1] abs(error.{signal}) <= 0.001 * threshold.{signal}"

[[requirements]]
id = "kept"
at = "each onset"
formula = "always[0, 1] abs(truth.{signal} - baseline.truth.{signal}) <= threshold.{signal}"
"""


@pytest.fixture(scope="module")
def tight(tmp_path_factory):
    path = tmp_path_factory.mktemp("requirements") / "tight.toml"
    path.write_text(TIGHT)
    return path


@pytest.fixture(scope="module")
def flown(tmp_path_factory, tight):
    """A log, and what ``rig fly --json`` printed of its requirements."""
    from rig.flight.fly import fly
    from rig.verdict.requirements.along import MeasuredConclusion

    out, outcome = tmp_path_factory.mktemp("logs"), MeasuredConclusion([tight])
    flight = fly(load("f16_pitch_rate_hardover", SHORT), out=out, outcome=outcome)
    return flight, outcome.verdicts(flight.log)


def test_flown_logged_and_in_memory_it_is_one_verdict(flown, tight):
    flight, verdicts = flown
    required = load_requirements([tight])
    scenario = load("f16_pitch_rate_hardover", SHORT)
    rows, baseline = fly_rows(scenario), fly_rows(scenario.model_copy(update={"faults": []}))
    assert [one.status for one in verdicts] == ["violated", "met"]
    assert verdicts == check_log(flight.log, required)
    assert verdicts == fly_requirements(scenario, required)
    assert verdicts == check_rows(rows, scenario, required, baseline)
    off = np.abs(rows["voted"][200:301, 0] - rows["truth"][200:301, 0])
    assert verdicts[0].robustness == pytest.approx((0.001 * 0.05 - off.max()) / 0.05, rel=1e-12)
    assert verdicts[0].instant_s == pytest.approx((200 + off.argmax()) / 100)
    apart = np.abs(rows["truth"][200:301, 0] - baseline["truth"][200:301, 0]).max()
    assert verdicts[1].robustness == pytest.approx(1.0 - apart / 0.05, rel=1e-12)


def test_departure_is_one_in_trim_and_minus_the_share_not_flown_of_a_lost_aircraft():
    scenario = load("f16_elevator_hardover", {"turbulence": "none"})
    text = "always[0, 60] departure >= 0"
    rows = fly_rows(scenario)
    recorder = RequirementsRecorder([_required(text)], of_flight(scenario), lines=True)
    recorder.record(Table(rows))
    verdict, line = recorder.finish()[0], recorder.lines()["one", ""]
    assert line[0] == pytest.approx(1.0) and rows["end"][-1] != 0
    assert line[-1] <= -(1.0 - len(rows) / scenario.frames)
    assert verdict.status == "violated" and verdict.robustness <= -1.0


def test_an_onset_is_the_first_frame_of_each_fault_and_acting_every_frame_of_one():
    """So the transients of all onsets can be excused in one formula."""
    once = {"kind": "offset", "signal": "yaw_rate", "channels": [2], "offset": 0.5, "start_s": 3.0, "duration_s": 0.5}
    repeated = {**once, "start_s": 1.0, "duration_s": 0.2, "repeat_every_s": 1.0, "repeats": 1}
    scenario = load("f16_pitch_rate_hardover", {"duration_s": 4.0, "faults": [repeated, once]})
    rows = fly_rows(scenario)
    required = [
        _required("onset").model_copy(update={"id": "onset"}),
        _required("acting").model_copy(update={"id": "acting"}),
        _required("always[0, 4] state(once[0, 0.1] onset) or not acting or level.yaw_rate == 3", signals=["yaw_rate"]),
    ]
    recorder = RequirementsRecorder(required, of_flight(scenario), lines=True)
    for k in range(0, len(rows), 64):  # blocks
        recorder.record(Table(rows[k : k + 64]))
    verdicts, lines = recorder.finish(), recorder.lines()
    assert np.flatnonzero(lines["onset", ""] > 0).tolist() == [100, 300]
    acts = [*range(100, 120), *range(200, 220), *range(300, 350)]
    assert np.flatnonzero(lines["acting", ""] > 0).tolist() == acts
    assert verdicts[2].status == "met"  # in 70 ms, and the first fault's channel stays out


def _required(formula, **keys):
    from rig.verdict.requirements.requirement import Requirement

    return Requirement(id="one", formula=formula, **keys)


def test_a_flight_of_a_scenario_with_requirements_prints_them_and_strict_ends_with_1(rig_command, tight):
    arguments = ["fly", "f16_pitch_rate_hardover", *SETS, "--requirements", str(tight)]
    code, out, _ = rig_command(*arguments)
    assert code == 0 and "tight" in out and "violated" in out
    conclusion = out[out.index("SURVIVED  ") : out.index("requirements\n")]
    code, plain, _ = rig_command("fly", "f16_pitch_rate_hardover", *SETS)
    assert conclusion == plain[plain.index("SURVIVED  ") : plain.index("next     rig")]
    code, out, _ = rig_command(*arguments, "--strict", "--json")
    told = json.loads(out)["requirements"]
    assert code == 1 and [one["status"] for one in told] == ["violated", "met"]
    assert told[0]["values"]["threshold.pitch_rate"] == {"value": 0.05, "unit": "rad/s"}


def test_a_scenario_names_its_requirements_beside_its_file(rig_command, tight, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "own.toml").write_text(TIGHT)
    keys = 'requirements = ["own.toml"]\nduration_s = 3.0\n[[faults]]\nkind = "hardover"\nsignal = "pitch_rate"\n'
    (tmp_path / "sub" / "mine.toml").write_text(f"{keys}channels = [1]\nstart_s = 1.0\n")
    code, out, _ = rig_command("fly", "sub/mine.toml", "--strict", "--json")
    flight = json.loads(out)
    assert code == 1 and [one["requirement"] for one in flight["requirements"]] == ["tight", "kept"]
    code, out, _ = rig_command("score", flight["log"], "--json")
    assert code == 0 and json.loads(out)["requirements"] == flight["requirements"]
    (tmp_path / "sub" / "own.toml").unlink()
    code, out, _ = rig_command("score", flight["log"], "--no-baseline")
    assert code == 0 and "requirements of the scenario are not measured" in " ".join(out.split())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["fly", "--requirements", "no_such"], "no_such: no such requirements file; bundled: handling, redundancy"),
        (["fly", "--requirements", "bad.toml"], "bad.toml: one: formula: column 5: 'error.canard': the flight has no"),
        (
            ["score", "x.mcap", "--requirements", "bad2.toml"],
            r"bad2.toml: requirements\.0\.formula: .*ends before",
        ),
        (
            ["campaign", "plan", "campaign.toml"],
            "campaign.toml: run 0: requirement one: formula: column 5",
        ),
    ],
)
def test_bad_requirements_are_one_line_and_nothing_is_written(rig_command, tmp_path, words, says):
    (tmp_path / "bad.toml").write_text('[[requirements]]\nid = "one"\nformula = "abs(error.canard) < 1"\n')
    (tmp_path / "bad2.toml").write_text('[[requirements]]\nid = "one"\nformula = "always[2, 1] lost"\n')
    (tmp_path / "campaign.toml").write_text('base = "f16_pitch_rate_hardover"\nrequirements = ["bad.toml"]\n')
    before = sorted(tmp_path.rglob("*"))
    code, out, err = rig_command(*words)
    assert (code, out, err.count("\n")) == (2, "", 1) and re.search(says, err), err
    assert sorted(tmp_path.rglob("*")) == before


def test_the_page_has_verdicts_and_a_picture_of_margins(rig_command, flown, tight, tmp_path):
    flight, verdicts = flown
    code, _, _ = rig_command("report", str(flight.log), "--out", "page.html", "--requirements", str(tight))
    page = (tmp_path / "page.html").read_text()
    assert (
        code == 0
        and 'id="requirements"' in page
        and "measured by rig score, which flies the fault-free baseline: kept" in page
    )
    from rig.log import LogFile

    robustness = Robustness.of(LogFile.open(flight.log), flight.scenario, [str(tight)])
    name, line = robustness.lines[0]
    rows = flight.rows
    expected = (0.001 * 0.05 - np.abs(rows["voted"][:, 0] - rows["truth"][:, 0])) / 0.05
    assert name == "tight pitch_rate" and np.allclose(line.values, expected, atol=1e-12)
    assert robustness.verdicts == verdicts[:1]


def test_an_event_stands_where_a_requirement_is_violated(flown):
    flight, verdicts = flown
    (event,) = events(verdicts, flight.scenario.rate_hz)
    assert event.frame == round(verdicts[0].instant_s * 100) and event.name == "requirement violated"
    assert event.text.startswith("tight pitch_rate: robustness -")


def test_what_names_the_baseline_is_left_out_where_none_is_flown(flown, tight):
    from rig.verdict.of_log import score_log
    from rig.verdict.score_records import Yardstick

    flight, _ = flown
    scored = score_log(flight.log, Yardstick(), baseline=False)
    assert measure_scored(scored, (), False, None, False) == ((), "")
    with pytest.raises(BadInput, match=r"baseline.truth.pitch_rate: the flight has no baseline here"):
        measure_scored(scored, load_requirements([tight]), False, None, False)


RECORDED = "time_s,q.1,q.2,q.3\n" + "".join(f"{k / 100:.2f},{0.1 if k > 20 else 0.0},0.0,0.0\n" for k in range(60))


def test_a_recording_has_what_was_sampled_and_voted(rig_command, tmp_path):
    (tmp_path / "r.csv").write_text(RECORDED)
    (tmp_path / "c.toml").write_text("[signal.q]\nthreshold = 0.03\npersistence = 8\n")
    requirement = '[[requirements]]\nid = "one"\nscale = 1.0\nformula = "{}"\n'
    (tmp_path / "one.toml").write_text(requirement.format("always[0, 60] (level.{signal} >= 3 or failed.q.1)"))
    off = "always[0, 60] abs(channel.{signal}.1 - voted.{signal}) <= 0.02"
    (tmp_path / "two.toml").write_text(requirement.format(off))
    out = ["--config", "c.toml", "--out", "v.csv", "--json"]
    code, said, _ = rig_command("vote", "r.csv", *out, "--requirements", "one.toml")
    assert code == 0 and json.loads(said)["requirements"][0]["status"] == "met"
    code, said, _ = rig_command("vote", "r.csv", *out, "--requirements", "two.toml")
    told = json.loads(said)["requirements"][0]
    assert told["status"] == "violated" and told["robustness"] == pytest.approx(-0.08)
    assert told["instant_s"] == pytest.approx(0.21)
    (tmp_path / "v.csv").unlink()
    for formula, says in [("error.q < 1", "the recording has no error"), ("voted.p < 1", "no signal 'p', allowed: q")]:
        (tmp_path / "bad.toml").write_text(requirement.format(formula))
        code, said, err = rig_command("vote", "r.csv", *out, "--requirements", "bad.toml")
        assert (code, err.count("\n")) == (2, 1) and says in err and not (tmp_path / "v.csv").exists()


@pytest.mark.long
def test_a_campaign_measures_every_run(rig_command, tmp_path, tight):
    (tmp_path / "own.toml").write_text(TIGHT)
    keys = 'base = "f16_pitch_rate_hardover"\nsampling = "grid"\nrequirements = ["own.toml"]\n[set]\nduration_s = 3.0\n'
    (tmp_path / "c.toml").write_text(f'{keys}"faults.0.start_s" = 1.0\n[vary]\n"turbulence" = ["none", "light"]\n')
    code, out, err = rig_command("campaign", "run", "c.toml", "--out", "folder", "--workers", "1", "--json")
    assert code == 0, err
    (tmp_path / "own.toml").unlink()  # a folder keeps what it was measured by
    runs = pl.read_parquet("folder/runs/*.parquet").sort("run")
    assert runs["violated"].to_list() == [1, 1] and (runs["robustness"] < 0).all()
    code, out, err = rig_command("campaign", "report", "folder", "--json")
    tight_row, kept = json.loads(out)["requirements"]
    assert code == 0, err
    assert tight_row["met"]["count"] == 0 and kept["met"]["count"] == 2 and kept["met"]["of"] == 2
    assert tight_row["least_run"] == int(runs["robustness"].arg_min() or 0)
    assert tight_row["robustness"] == runs["robustness"].min()
