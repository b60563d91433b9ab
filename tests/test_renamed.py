"""Old names: each is refused in one line that says the new one; what the rig wrote with them is still read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from rig.core import renamed
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, State
from rig.log import read_log, schema
from rig.log.info import info
from rig.scenario import scenario
from rig.scenario.scenario import load
from rig.studies.campaign import campaign_file
from rig.studies.campaign.table_parts import with_names_of_now
from rig.studies.campaign.tables import OF
from rig.unit.unit_file import read_unit
from rig.unit.unit_records import OLD_INTERFACES
from rig.verdict.requirements.formula import check_names
from rig.world.faults.grammar import Refused

LOG = Path(__file__).parent / "logs" / "flight_schema_6.mcap"
OF_SIGNAL = "redundancy.signals.pitch_rate"
# Where each old key stood: a file with it, and its place.
SCENARIO_KEYS = {
    "resolvers": (f"{OF_SIGNAL}.resolvers=[]", f"{OF_SIGNAL}.resolvers"),
    "singular_persistence": (f"{OF_SIGNAL}.singular_persistence=3", f"{OF_SIGNAL}.singular_persistence"),
    "singular_persistence_s": (f"{OF_SIGNAL}.singular_persistence_s=0.1", f"{OF_SIGNAL}.singular_persistence_s"),
    "rivals": ("redundancy.rivals.cusum.limit=3.0", "redundancy.rivals"),
    "command_singular_s": ("computers.command_singular_s=0.2", "computers.command_singular_s"),
}
UNIT_KEYS = {"carrier": 'carrier = "udp"', "form": 'form = "flight-computer"'}
VALUES = {
    ("kind", "link_lie"): '{kind="link_lie", signal="ccdl.A-B", start_s=1.0}',
    ("says", "lying"): '{kind="ilm", says="lying", signal="pitch_rate", channels=[1], start_s=1.0}',
}


@pytest.mark.parametrize("old", SCENARIO_KEYS)
def test_an_old_key_of_a_scenario_is_one_line(old: str, rig_command: Any):
    given, place = SCENARIO_KEYS[old]
    code, _, err = rig_command("fly", "--set", given)
    assert code == 2 and err.endswith(f"{place}: is now called {renamed.KEYS[old]}\n") and err.count("\n") == 1


@pytest.mark.parametrize("old", UNIT_KEYS)
def test_an_old_key_of_a_unit_file_is_one_line(old: str, tmp_path: Path):
    path = tmp_path / "unit.toml"
    path.write_text(f'name = "u"\n{UNIT_KEYS[old]}\n')
    with pytest.raises(BadInput) as error:
        read_unit(path)
    assert str(error.value) == f"{path}: {old}: is now called {renamed.KEYS[old]}"


def test_an_old_key_of_a_campaign_and_of_a_configuration_is_one_line(rig_command: Any, tmp_path: Path):
    (tmp_path / "c.toml").write_text('title = "c"\nbase = "f16_pitch_rate_hardover"\nruns = 1\ntwin = true\n')
    code, _, err = rig_command("campaign", "plan", "c.toml")
    assert (code, err) == (2, "error: c.toml: twin: is now called baseline\n")
    (tmp_path / "v.toml").write_text("[default]\nthreshold = 1.0\n[rivals.cusum]\nlimit = 3.0\n")
    (tmp_path / "in.csv").write_text("time_s,x_1,x_2\n0,1,1\n0.1,1,1\n")
    code, _, err = rig_command("vote", "in.csv", "--config", "v.toml", "--out", "o.csv")
    assert (code, err) == (2, "error: v.toml: rivals: is now called baselines\n")
    for table, key in (("default", "resolvers"), ("signal.x", "singular_persistence")):
        (tmp_path / "v.toml").write_text(f"[{table}]\n{key} = 1.0\n[signal.y]\nthreshold = 1.0\n")
        code, _, err = rig_command("vote", "in.csv", "--config", "v.toml", "--out", "o.csv")
        assert (code, err) == (2, f"error: v.toml: {table}.{key}: is now called {renamed.KEYS[key]}\n")
    assert {*SCENARIO_KEYS, *UNIT_KEYS, "twin"} == set(renamed.KEYS)


@pytest.mark.parametrize("key", renamed.GONE)
def test_a_setting_that_is_gone_is_one_line_that_says_what_stands_in_its_place(
    key: str, rig_command: Any, tmp_path: Path
):
    gone = f"{key}: is gone: {renamed.GONE[key]}"
    assert "slow_tests" in gone
    for at in (OF_SIGNAL, "redundancy.signals.*"):
        code, _, err = rig_command("fly", "--set", f"{at}.{key}=0.01")
        assert code == 2 and err.endswith(f"{OF_SIGNAL}.{gone}\n") and err.count("\n") == 1
    case = '[[cases]]\nname = "a"\nscenario = "f16_pitch_rate_hardover"\n'
    (tmp_path / "s.toml").write_text(f'{case}set = {{ "{OF_SIGNAL}.{key}" = 0.01 }}\n')
    code, _, err = rig_command("check", "s.toml")
    assert code == 2 and gone in err and err.count("\n") == 1, err
    (tmp_path / "in.csv").write_text("time_s,x_1,x_2\n0,1,1\n0.1,1,1\n")
    for table in ("default", "signal.x"):
        (tmp_path / "v.toml").write_text(f"[{table}]\nthreshold = 1.0\n{key} = 0.5\n[signal.y]\nthreshold = 1.0\n")
        code, _, err = rig_command("vote", "in.csv", "--config", "v.toml", "--out", "o.csv")
        assert (code, err) == (2, f"error: v.toml: {table}.{gone}\n")
    for line in (f'vary."{OF_SIGNAL}.{key}" = [0.01]', f'set."{OF_SIGNAL}.{key}" = 0.01'):
        (tmp_path / "c.toml").write_text(f'title = "c"\nbase = "f16_pitch_rate_hardover"\nruns = 1\n{line}\n')
        code, _, err = rig_command("campaign", "plan", "c.toml")
        assert code == 2 and gone in err and err.count("\n") == 1, err


@pytest.mark.parametrize(("key", "old"), VALUES)
def test_an_old_value_is_one_line(key: str, old: str):
    with pytest.raises(BadInput, match=f"faults.0.{key}: {old!r} is now called {renamed.VALUES[key][old]!r}$"):
        load(overrides=[f"faults=[{VALUES[key, old]}]"])
    assert set(VALUES) == {(key, old) for key, values in renamed.VALUES.items() for old in values}


def test_old_bundled_names_are_one_line():
    for names, find, there in (
        (renamed.SCENARIOS, scenario.find, scenario.names()),
        (renamed.CAMPAIGNS, campaign_file.find, campaign_file.names()),
    ):
        for old, new in names.items():
            with pytest.raises(BadInput, match=f"^{old} is now called {new}$"):
                find(old)
            assert new in there and old not in there


@pytest.mark.parametrize("old", renamed.COMMANDS)
def test_an_old_command_is_one_line(old: str, rig_command: Any):
    code, _, err = rig_command(*old.split()[1:], "x")
    assert (code, err) == (2, f"error: {old} is now called {renamed.COMMANDS[old]}\n")
    assert rig_command(*renamed.COMMANDS[old].split()[1:], "--help")[0] == 0


COMMANDS_OF = {"--lasting": ["thresholds", "x"], "--no-twin": ["score", "x"], "--seam": ["unit", "check", "x"]}


@pytest.mark.parametrize("old", renamed.OPTIONS)
def test_an_old_option_is_one_line(old: str, rig_command: Any):
    code, _, err = rig_command(*COMMANDS_OF[old], old)
    assert (code, err) == (2, f"error: {old} is now called {renamed.OPTIONS[old]}\n")


def test_an_option_that_is_gone_is_one_line(rig_command: Any):
    for option, instead in renamed.GONE_OPTIONS.items():
        code, _, err = rig_command("thresholds", "x", option)
        assert (code, err) == (2, f"error: {option} is gone: {instead}\n")


def test_an_old_quantity_is_one_line():
    with pytest.raises(Refused, match=r"twin\.voted\.pitch_rate is now called baseline\.voted\.pitch_rate"):
        check_names("always[0, 1] twin.voted.pitch_rate < 1")
    with pytest.raises(BadInput, match=r"^demand is now called autopilot_command$"):
        read_log(LOG).to_polars("demand")


def test_an_old_attribute_of_a_log_is_one_line():
    log = read_log(LOG)
    for old, new in renamed.ATTRIBUTES.items():
        with pytest.raises(AttributeError, match=rf"^Log\.{old} is now called Log\.{new}$"):
            getattr(log, old)
        assert getattr(log, new) is not None
    with pytest.raises(AttributeError, match=r"has no attribute 'line'$"):
        _ = log.line  # pyright: ignore[reportAttributeAccessIssue]


def test_the_table_of_logs_is_that_of_the_messages():
    named = {field.name for fields in (schema.MESSAGES | schema.PART_MESSAGES).values() for field in fields}
    for new in renamed.FIELDS.values():
        assert [name for name in named if name == new or name.startswith(f"{new}_")], new
    assert set(renamed.TOPICS.values()) <= {topic.name for topic in schema.ALL_TOPICS}
    assert set(renamed.MESSAGES.values()) <= set(schema.MESSAGES)
    columns = {column for table in OF.values() for column in table.columns}
    assert {"decided_by", "robustness"} <= columns and not columns & set(renamed.COLUMNS)


def test_a_log_of_before_is_read_with_the_names_of_now(rig_command: Any, tmp_path: Path):
    """flight_schema_6.mcap: four computers and servos, by the last version with the old names."""
    log = read_log(LOG)
    assert log.metadata["schema_version"] == "6" and log.rows["state"].shape[2] == CHANNELS
    assert log.parts is not None and {"servo", "computer"} <= set(log.parts.dtype.names or ())
    assert np.isfinite(log.rows["surface_command"]).all() and (log.rows["state"] == State.FAILED).any()
    assert info(LOG)["topics"]["/autopilot_command"] == log.frames
    path = tmp_path / "log.mcap"
    path.write_bytes(LOG.read_bytes())
    code, out, _ = rig_command("score", path, "--json")
    assert code == 0 and json.loads(out)["faults"][0]["decided_by"] is not None
    code, out, _ = rig_command("replay", path)
    assert code == 0 and "identical" in out
    assert rig_command("report", path)[0] == 0


def test_the_words_of_an_older_table_are_those_of_now():
    held = pl.DataFrame({"run": [0, 1, 2], "isolation": ["right", "wrong", None], "vote_kept": [True, False, None]})
    now = with_names_of_now(held)
    assert now["isolation"].to_list() == ["correct", "wrong", None] and now.columns[2] == "vote_correct"
    episodes = pl.DataFrame({"verdict": ["right", "open"], "reason": ["right", "right"]})
    assert with_names_of_now(episodes).rows() == [("correct", "right"), ("open", "right")]


def test_the_layout_of_a_unit_is_the_one_of_before():
    """So that units that were built before still fly: the names are hashed as they were."""
    assert {interface.version: interface.layout for interface in OLD_INTERFACES} == {
        4: 0x89D5486002180868,
        3: 0x0A5A1850E6B4B34B,
        2: 0x4D75E2CCA0F8866C,
        1: 0xBAEC0C917FEBB05E,
    }


def test_what_a_campaign_kept_is_read_with_the_names_of_now():
    kept = {
        "twin": True,
        "vary": {"redundancy.signals.*.resolvers": [["ilm"]]},
        "cases": {"form": [{"set": {"faults.0": {"kind": "link_lie"}}}]},
        "requirements": [{"id": "a", "formula": "always[0, 1] twin.failed.X.1"}],
    }
    assert renamed.data_now(kept) == {
        "baseline": True,
        "vary": {"redundancy.signals.*.tie_break": [["ilm"]]},
        "cases": {"form": [{"set": {"faults.0": {"kind": "link_byzantine"}}}]},
        "requirements": [{"id": "a", "formula": "always[0, 1] baseline.failed.X.1"}],
    }


def test_settings_that_are_gone_are_dropped_from_what_the_rig_wrote():
    signal = {"threshold": 0.05, "bias_bound": 0.1, "equalise_s": 2.0, "outlier_threshold": 0.01}
    assert renamed.data_now({"redundancy": {"signals": {"pitch_rate": signal}}}) == {
        "redundancy": {"signals": {"pitch_rate": {"threshold": 0.05}}}
    }
