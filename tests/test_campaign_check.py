"""``rig check``: suites, their reference decisions, JUnit XML."""

import json
import re
from types import SimpleNamespace

import pytest
from junitparser import Failure, JUnitXml, Skipped
from unit_files import needs_a_compiler, unit

from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.studies.campaign import suite_check
from rig.studies.campaign.suite import read_suite
from rig.studies.campaign.suite_check import DECISIONS, FAULTS, difference

OWN = """
[[requirements]]
id = "vote"
at = "each onset"
formula = "always[0.1, 1] abs(error.{signal}) <= threshold.{signal}"

[[requirements]]
id = "found"
at = "each onset"
formula = "eventually[0, 0.5] count.{signal}.3 >= 1"

[[requirements]]
id = "lost"
at = "each loss"
formula = "lost"
"""
SUITE = """
requirements = ["own.toml"]
[[cases]]
name = "short"
scenario = "f16_pitch_rate_hardover"
set = { duration_s = 3.0, "faults.0.start_s" = 1.0THRESHOLD }
"""


def write(tmp_path, threshold=""):
    (tmp_path / "own.toml").write_text(OWN)
    (tmp_path / "suite.toml").write_text(SUITE.replace("THRESHOLD", threshold))


def junit_tests(path):
    return {test.name: test for suite in JUnitXml.fromfile(str(path)) for test in suite}


def test_a_suite_is_met_and_read_by_junitparser(rig_command, tmp_path):
    write(tmp_path)
    code, out, err = rig_command("check", "suite.toml", "--junit", "out.xml")
    assert code == 0, out + err
    found = junit_tests("out.xml")
    assert set(found) == {"vote pitch_rate", "found pitch_rate", "lost", DECISIONS}
    assert [type(result) for result in found["lost"].result] == [Skipped]  # no loss: not applicable
    assert [type(result) for result in found[DECISIONS].result] == [Skipped]  # no reference yet
    vote = found["vote pitch_rate"]
    assert vote.classname == "short" and vote.result == [] and str(vote.system_out).startswith("rig fly ")
    known = {each.attrib["name"]: each.attrib["value"] for each in vote._elem.iter("property")}
    assert known["id"] == "vote" and 0.0 < float(known["robustness"]) < 1.0 and known["command"] == vote.system_out
    assert JUnitXml.fromfile("out.xml").tests == 4


def test_update_keeps_the_decisions_and_says_what_moved(rig_command, tmp_path):
    write(tmp_path)
    code, out, _ = rig_command("check", "suite.toml", "--update", "--json")
    assert code == 0 and json.loads(out)["moved"] == {"short": ["+ 1.07 s pitch_rate.3 isolated by comparison"]}
    assert read_suite("suite.toml").decisions() == {"short": ["1.07 s pitch_rate.3 isolated by comparison"]}
    assert rig_command("check", "suite.toml")[0] == 0
    write(tmp_path, ', "redundancy.signals.pitch_rate.persistence" = 20')
    code, out, _ = rig_command("check", "suite.toml", "--json")
    decided = next(one for one in json.loads(out)["tests"] if one["id"] == DECISIONS)
    assert code == 1 and decided["result"] == "differs"
    by = "pitch_rate.3 isolated by comparison"
    assert decided["text"] == f"- 1.07 s {by}; + 1.19 s {by}"
    code, out, _ = rig_command("check", "suite.toml", "--update", "--json")
    assert code == 0 and len(json.loads(out)["moved"]["short"]) == 2
    assert rig_command("check", "suite.toml")[0] == 0


def test_one_changed_threshold_fails_with_the_id_and_the_margin(rig_command, tmp_path):
    """With a threshold of 2 rad/s a hardover of 1.5 rad/s is not found, where repeated samples are not counted."""
    q = "redundancy.signals.pitch_rate"
    write(tmp_path, f', "{q}.threshold" = 2.0, "{q}.stale_frames" = 0')
    code, out, _ = rig_command("check", "suite.toml", "--junit", "out.xml")
    (failure,) = junit_tests("out.xml")["found pitch_rate"].result
    assert (
        code == 1 and isinstance(failure, Failure) and failure.message.startswith("found pitch_rate: robustness -1 at")
    )
    assert "found pitch_rate" in out and "robustness -1" in out


def test_logs_and_campaigns_are_cases_too(rig_command, tmp_path):
    write(tmp_path)
    rig_command("fly", "f16_pitch_rate_hardover", "--set", "duration_s=3.0", "--set", "faults.0.start_s=1.0")
    (log,) = (tmp_path / "logs").glob("*.mcap")
    (tmp_path / "c.toml").write_text(
        'base = "f16_pitch_rate_hardover"\n[set]\nduration_s = 3.0\n[vary]\n"faults.0.start_s" = [1.0, 2.0, 2.5]\n'
    )
    (tmp_path / "both.toml").write_text(
        f'requirements = ["own.toml"]\n[[cases]]\nlog = "logs/{log.name}"\n'
        '[[cases]]\ncampaign = "c.toml"\nruns = 2\nwithout = ["lost"]\n'
    )
    code, out, err = rig_command("check", "both.toml", "--update", "--json")
    assert code == 0, err
    assert read_suite("both.toml").decisions() == {
        log.stem: ["1.07 s pitch_rate.3 isolated by comparison"],
        "c": [f"run {n}: {at} s pitch_rate.3 isolated by comparison" for n, at in ((0, "1.070"), (1, "2.070"))],
    }
    tests = [SimpleNamespace(**one) for one in json.loads(out)["tests"]]
    assert [(one.case, one.id) for one in tests if one.case == "c"] == [("c", "vote"), ("c", "found"), ("c", DECISIONS)]
    assert "of run" in next(one.text for one in tests if one.case == "c" and one.id == "vote")


@pytest.mark.parametrize(
    ("suite", "says"),
    [
        ("", "cases"),
        ('[[cases]]\nscenario = "no_such"\n', "suite.toml: cases: scenario: no_such: no such file"),
        ('[[cases]]\nlog = "no.mcap"\n', "suite.toml: cases: log: no.mcap: no such log"),
        ('[[cases]]\nlog = "a"\nscenario = "b"\n', "a case needs exactly one of scenario, log, campaign"),
        ('[[cases]]\nscenario = "f16_stuck_together"\nruns = 2\n', "runs: is allowed only for campaign"),
        ('[[cases]]\nscenario = "f16_stuck_together"\nwithout = ["x"]\n', "without: the case has no requirement 'x'"),
        ('[[cases]]\nscenario = "f16_stuck_together"\n' * 2, "f16_stuck_together: two cases have this name"),
        (
            '[[cases]]\nscenario = "f16_stuck_together"\nset = { "canard" = 1 }\n',
            "suite.toml: f16_stuck_together: .*canard",
        ),
        ('[[cases]]\nscenario = "f16_stuck_together"\nrequirements = ["x"]\n', "x: no such requirements file"),
    ],
)
def test_a_bad_suite_is_one_line(rig_command, tmp_path, suite, says):
    (tmp_path / "suite.toml").write_text(suite)
    code, out, err = rig_command("check", "suite.toml", "--junit", "out.xml")
    assert (code, out, err.count("\n")) == (2, "", 1) and re.search(says, err), err
    assert not (tmp_path / "out.xml").exists()


def test_no_output_over_an_input(rig_command, tmp_path):
    write(tmp_path)
    for name in ("suite.toml", "suite.decisions.toml"):
        code, _, err = rig_command("check", "suite.toml", "--junit", name)
        assert code == 2 and "is the input" in err


def test_the_bundled_suite_keeps_decisions_of_every_case():
    from rig.scenario.scenario import names

    suite = read_suite("bundled")
    kept = suite.decisions()
    assert kept is not None and {case.called for case in suite.cases} == set(kept) <= {*names(), "smoke"}
    assert len(kept) > 90


def test_what_moved_is_what_is_gone_and_what_is_new():
    assert difference(["a", "b"], ["b", "c"]) == ["- a", "+ c"]


NOT_ACTING = """
[[cases]]
name = "late"
scenario = "f16_pitch_rate_hardover"
set = { duration_s = 1.0, "faults.0.start_s" = 8.0 }
KEY
[[cases]]
name = "of a campaign"
campaign = "c.toml"
KEY
[[cases]]
name = "a log"
log = "logs/late.mcap"
KEY
"""


def test_a_fault_that_is_not_executed_fails_its_case_unless_it_may_not_act(rig_command, tmp_path):
    (tmp_path / "c.toml").write_text(
        'base = "f16_pitch_rate_hardover"\nruns = 2\n[set]\nduration_s = 1.0\n[vary]\n"faults.0.start_s" = [0.5, 8.0]\n'
    )
    late = ("--set", "duration_s=1.0", "--set", "faults.0.start_s=8.0", "--set", "title=late")
    (tmp_path / "late.toml").write_text((bundled("faults") / "f16_pitch_rate_hardover.toml").read_text())
    rig_command("fly", "late.toml", *late, "--out", "logs")
    (log,) = (tmp_path / "logs").glob("*.mcap")
    log.rename(tmp_path / "logs" / "late.mcap")
    (tmp_path / "suite.toml").write_text(NOT_ACTING.replace("KEY", ""))
    code, out, err = rig_command("check", "suite.toml", "--junit", "out.xml")
    assert code == 1 and "FAIL: 6 tests, 3 failed" in out, out + err
    faults = [test for suite in JUnitXml.fromfile("out.xml") for test in suite if test.name == FAULTS]
    assert [test.classname for test in faults] == ["late", "of a campaign", "a log"]
    assert all(isinstance(test.result[0], Failure) and test.result[0].type == "did not act" for test in faults)
    assert "never triggered; may_not_act = true permits it" in faults[0].result[0].message
    assert "run 1: hardover pitch_rate.3; may" in faults[1].result[0].message  # run 0 has its fault
    (tmp_path / "suite.toml").write_text(NOT_ACTING.replace("KEY", "may_not_act = true"))
    code, out, err = rig_command("check", "suite.toml", "--junit", "out.xml")
    assert code == 0, out + err
    faults = [test for suite in JUnitXml.fromfile("out.xml") for test in suite if test.name == FAULTS]
    assert len(faults) == 3 and all(isinstance(test.result[0], Skipped) for test in faults)


@needs_a_compiler
def test_a_reference_keeps_what_its_unit_read_and_another_is_told(rig_command, tmp_path):
    write(tmp_path)
    first = unit(tmp_path, "first_valid", environment={"VOTER": "a"})
    code, out, _ = rig_command("check", "suite.toml", "--unit", first.unit_file, "--update", "--json")
    assert json.loads(out)["unit_differs"] == [] and list(read_suite("suite.toml").decisions() or {}) == ["short"], code
    assert "not as in the reference" not in rig_command("check", "suite.toml", "--unit", first.unit_file)[1]
    unit(tmp_path, "first_valid", environment={"VOTER": "b"})
    told = rig_command("check", "suite.toml", "--unit", first.unit_file)[1]
    assert 'unit: not as in the reference: environment.VOTER was "a", is "b"' in told
    found = json.loads(rig_command("check", "suite.toml", "--json")[1])
    assert found["unit_differs"] == ["a unit made the reference, now a manager votes"]


@needs_a_compiler
def test_a_file_that_changes_while_a_suite_flies_ends_it(tmp_path, monkeypatch):
    write(tmp_path)
    (tmp_path / "gains.txt").write_text("1")
    tested = unit(tmp_path, "first_valid", files=["gains.txt"])
    measured = suite_check._measured

    def changes(*arguments):
        (tmp_path / "gains.txt").write_text("2")
        return measured(*arguments)

    with monkeypatch.context() as patched, pytest.raises(BadInput, match=r"gains\.txt: is not the file"):
        patched.setattr(suite_check, "_measured", changes)
        list(suite_check.check(read_suite(tmp_path / "suite.toml"), tested))


def test_no_case_has_the_name_of_the_unit_in_the_reference(rig_command, tmp_path):
    write(tmp_path)
    (tmp_path / "suite.toml").write_text(SUITE.replace("THRESHOLD", "").replace('"short"', '"unit under test"'))
    code, out, err = rig_command("check", "suite.toml")
    assert (code, out) == (2, "") and "cases: unit under test: no case may have this name; rename it" in err
