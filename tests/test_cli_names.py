"""Names that a user types: completion, lists, schemas, help in groups, log names that tell overrides apart."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest

from rig.cli import complete
from rig.cli.catalogue import of_file
from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.log.info import overrides
from rig.log.of_flight import LONGEST_TAG, named, new_log, tag
from rig.scenario import scenario
from rig.scenario.scenario import find, load


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        ([], ""),
        (["redundancy.manager=mean"], "manager-mean"),
        (["seed=3", "redundancy.manager=mean"], "manager-mean"),
        (["duration_s=2.5", "faults=[]"], "duration_s-2.5_faults-none"),
        (["redundancy.signals.pitch_rate.persistence=4"], "pitch_rate_persistence-4"),
        (["faults.0.start_s=1.0", "redundancy.manager=mine:Mid"], "start_s-1_manager-mine_Mid"),
        (["faults=[{kind='offset', signal='pitch_rate', channels=[1], offset=0.1, start_s=0}]"], "offset-pitch_rate"),
        (
            [
                "redundancy.signals.pitch_rate.persistence=4",
                "faults=[{kind='hardover', signal='pitch_rate', channels=[1], start_s=0}]",
            ],
            "hardover-pitch_rate_and-1",
        ),
        ([f"redundancy.box_signals={i}" for i in range(1, 6)], "box_signals-1_box_signals-2_and-3"),
        ([f"title={'x' * 60}"], f"title-{'x' * 34}"),
        (["title=a/b ../c"], "title-a_b_c"),
    ],
)
def test_a_tag_names_the_overrides(sets, says):
    assert tag(sets) == says


def test_a_unit_under_test_is_part_of_the_name(tmp_path: Path):
    sets = ["redundancy.manager=mean", "duration_s=1"]
    with new_log(tmp_path, "first", load(None, sets), "", None, sets, "my monitor") as writer:
        assert writer.path.name == "first_seed1_my_monitor_manager-mean_duration_s-1.mcap"


def test_logs_of_settings_that_the_name_does_not_tell_apart_are_numbered(tmp_path: Path):
    flown = load(None, ["duration_s=1"])
    long = [[f"title={'x' * LONGEST_TAG}{end}"] for end in ("a", "b")]
    assert tag(long[0]) == tag(long[1])
    logs = []
    for each in long:
        with new_log(tmp_path, "s", flown, "", overrides=each) as writer:
            logs.append(writer.path.name)
    assert logs == [f"s_seed1_{tag(long[0])}.mcap", f"s_seed1_{tag(long[0])}_2.mcap"]


def test_a_log_of_an_own_aircraft_says_which():
    assert (
        named("hardover", "../my_c172") == "my_c172_hardover" and named("my_c172_gust", "../my_c172") == "my_c172_gust"
    )
    assert named("mine", "f16") == named("mine", ".") == "mine"


def test_overrides_are_told_from_the_file_and_what_was_flown():
    text = find().read_text()
    flown = load(None, ["redundancy.manager=mean", "faults.0.start_s=3.0", "duration_s=5"], seed=9).resolved()
    assert overrides(text, load(None).resolved()) == []
    assert sorted(overrides(text, flown) or []) == ["duration_s=5.0", "faults.0.start_s=3.0", "redundancy.manager=mean"]
    assert overrides("no toml [", flown) is None


def test_the_log_the_header_and_info_name_manager_and_overrides(rig_command):
    short = ["--set", "duration_s=2", "--set", "faults=[]"]
    _, out, _ = rig_command("fly", *short, "--set", "redundancy.manager=median")
    log = Path(next(line.split()[1] for line in out.splitlines() if line.startswith("log ")))
    assert log.name == "f16_pitch_rate_hardover_seed1_duration_s-2_faults-none_manager-median.mcap"
    assert out.splitlines()[0].endswith("seed 1, manager median, duration_s=2, faults=[], redundancy.manager=median")
    found = json.loads(rig_command("info", str(log), "--json")[1])
    assert found["manager"] == "median" and "redundancy.manager=median" in found["overrides"]
    said = rig_command("info", str(log))[1]
    assert "manager  median" in said and "set      " in said and "duration_s=2.0" in said


def test_names_are_completed():
    assert complete.scenarios("f16_split_1_1_1") == ["f16_split_1_1_1", "f16_split_1_1_1_1"]
    assert complete.aircraft("b7") == ["b707", "b737", "b747"]
    assert complete.kinds("hard") == ["hardover"] and complete.campaigns("smo") == ["smoke"]
    assert "overview" in complete.tabs("over")
    assert complete.sets("redundancy.manager=me") == ["redundancy.manager=mean", "redundancy.manager=median"]
    assert complete.sets("aircraft=f") == ["aircraft=f16"] and "duration_s=" in complete.sets("d")


def test_the_shell_is_given_the_completions():
    environment = {"_RIG_COMPLETE": "complete_bash", "COMP_WORDS": "rig fly f16_split_2_2_l", "COMP_CWORD": "2"}
    command = [sys.executable, "-c", "from rig.cli.main import app; app(prog_name='rig')"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.split() == ["f16_split_2_2_level"]


def test_scenarios_are_listed_with_aircraft_and_title(rig_command):
    said = rig_command("scenario", "list")[1]
    lines = [" ".join(line.split()) for line in said.splitlines()]
    assert "b737_gear_down_inverted b737 B737 gear switches" in lines
    assert len(lines) == 1 + len(scenario.names())


@pytest.mark.parametrize(("kind", "files"), [("scenario", "*.toml"), ("campaign", "campaigns/*.toml")])
def test_every_bundled_file_is_valid_by_its_schema(kind, files):
    checker = jsonschema.Draft202012Validator(json.loads(of_file(kind)))
    found = sorted(bundled("faults").glob(files))
    assert len(found) > 5
    wrong = {path.name: [e.message for e in checker.iter_errors(tomllib.loads(path.read_text()))] for path in found}
    assert {name: errors for name, errors in wrong.items() if errors} == {}


def test_schemas_refuse_what_is_mistyped(rig_command):
    checker = jsonschema.Draft202012Validator(json.loads(rig_command("scenario", "schema")[1]))
    assert not checker.is_valid({"duratoin_s": 5.0}) and not checker.is_valid({"turbulence": "hard"})
    assert not checker.is_valid({"faults": [{"kind": "offset"}]})  # where it sits is missing
    unit = jsonschema.Draft202012Validator(json.loads(rig_command("unit", "schema")[1]))
    assert unit.is_valid({"name": "x", "path": "x.so"}) and not unit.is_valid({"path": "x.so"})
    campaign = jsonschema.Draft202012Validator(json.loads(rig_command("campaign", "schema")[1]))
    assert campaign.is_valid({"base": "x"}) and not campaign.is_valid({"base": "x", "runs": "many"})


def test_help_stands_in_groups_and_nothing_is_cut_off(rig_command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = rig_command("--help")[1]
    panels = ("Fly", "View and report", "Score and replay", "Recorded data", "Many flights", "Reference")
    at = [said.index(f" {panel} ─") for panel in panels]
    assert at == sorted(at) and "Example: rig fly" in said
    assert "..." not in said.replace("[ARGS]...", "") and "…" not in said


def test_an_unknown_key_says_the_nearest_and_what_is_allowed():
    with pytest.raises(
        BadInput, match=r"pilot\.autopilot_engagd: unknown key; nearest: autopilot_engaged; allowed: auto"
    ):
        load(None, ["pilot.autopilot_engagd=false"])
    with pytest.raises(BadInput, match=r"unknown key; nearest: persistence, \w+, \w+; all keys: rig scenario show"):
        load(None, ["redundancy.signals.pitch_rate.persistance=4"])


def test_an_unknown_campaign_says_the_nearest(rig_command):
    code, _, err = rig_command("campaign", "plan", "smok")
    assert code == 2 and "smok: no such file; bundled: " in err and "smoke" in err
