"""The tools of ``rig mcp``: arguments become a command line of ``rig``, or one line on what is wrong."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rig.cli.mcp_tools import MOST_FLIGHTS, MOST_FRAMES, TOOLS, Places, tool
from rig.core.errors import BadInput
from rig.scenario.scenario import load, names


@pytest.fixture
def places(tmp_path: Path) -> Places:
    for name in ("agent", "given", "secret"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.toml").write_text("")
        (tmp_path / name / "log.mcap").write_text(name)
    (tmp_path / "agent" / "link").symlink_to(tmp_path / "secret")
    return Places(tmp_path / "agent", (tmp_path / "given",))


def command(places: Places, name: str, **arguments: Any) -> list[str]:
    return tool(name).command(arguments, places)


def test_a_flight_is_the_command_with_its_options(places: Places):
    asked = {"overrides": {"duration_s": 2, "faults": [{"kind": "stuck", "signal": "pitch_rate"}]}, "seed": 3}
    made = command(places, "fly", scenario="f16_pitch_rate_hardover", requirements=["handling"], **asked)
    assert made == [
        *("fly", f"--out={places.write}", "--set=duration_s=2"),
        '--set=faults=[{"kind" = "stuck", "signal" = "pitch_rate"}]',
        *("--seed=3", "--requirements=handling", "--", "f16_pitch_rate_hardover"),
    ]


def test_a_diagnosis_is_the_command_with_its_options(places: Places):
    made = command(places, "diagnose", recording="log.mcap", preset="px4", inject=["step", "noise"])
    log = str(places.write / "log.mcap")
    assert made == ["diagnose", "--preset=px4", "--inject=step,noise", "--", log]
    with pytest.raises(BadInput, match=r"config: .* is not in a folder that this server reads"):
        command(places, "diagnose", recording="log.mcap", config="../secret/secret.toml")


def test_every_tool_has_a_line_about_it_and_about_each_argument():
    for each in TOOLS:
        assert each.about.endswith(".") and "\n" not in each.about
        assert each.schema["type"] == "object" and each.schema["additionalProperties"] is False
        assert all(key["description"] for key in each.schema["properties"].values()), each.name
    assert [each.name for each in TOOLS if each.writes] == ["fly", "vote", "search"]


def test_a_text_that_looks_like_an_option_is_none(places: Places):
    made = command(places, "fly", scenario="--allow-code", overrides={"--unit": "x"}, requirements=["--strict"])
    assert made[-2:] == ["--", "--allow-code"]
    assert not {"--allow-code", "--unit", "--strict"} & set(made[: made.index("--")])


def test_a_file_is_looked_for_in_the_written_folder_then_in_those_that_are_read(places: Places):
    given = places.read[0]
    assert command(places, "score", log="log.mcap")[-1] == str(places.write / "log.mcap")
    assert command(places, "fly", scenario="given.toml")[-1] == str(given / "given.toml")
    assert command(places, "explain", log=str(given / "log.mcap")) == ["explain", str(given / "log.mcap"), "baseline"]
    assert command(places, "explain", log="../given/log.mcap", baseline=False)[1:] == [str(given / "log.mcap")]


@pytest.mark.parametrize(
    ("name", "key"),
    [("score", "log"), ("fly", "scenario"), ("vote", "recording"), ("check", "suite"), ("campaign_status", "folder")],
)
@pytest.mark.parametrize("path", ["../secret/secret.toml", "link/secret.toml", "{}/secret/secret.toml", "/etc/passwd"])
def test_a_path_that_leads_elsewhere_is_refused(places: Places, name: str, key: str, path: str):
    with pytest.raises(BadInput, match=f"{key}: .* is not in a folder that this server reads: "):
        command(places, name, **{key: path.format(places.write.parent)})


@pytest.mark.parametrize("path", ["../o.csv", "link/o.csv", "{}/secret/o.csv", "{}/given/o.csv", "a\0b.csv"])
def test_an_output_elsewhere_is_refused(places: Places, path: str):
    with pytest.raises(BadInput, match=r"out: .* is not in the folder that this server writes: "):
        command(places, "vote", recording="log.mcap", out=path.format(places.write.parent))
    with pytest.raises(BadInput, match="out: "):
        command(places, "search", campaign="c", requirement=["vote"], flights=1, out=path.format(places.write.parent))


@pytest.mark.parametrize(
    ("name", "arguments", "told"),
    [
        ("fly", {}, "fly: scenario: missing"),
        ("fly", {"scenario": "a", "unit": "u.toml"}, "fly: unit: unknown key"),
        ("fly", {"scenario": "a", "allow_code": True}, "fly: allow_code: unknown key"),
        ("fly", {"scenario": 3}, "fly: scenario: must be a text, got 3"),
        ("fly", {"scenario": "a", "seed": -1}, "fly: seed: must be 0 or more, got -1"),
        ("fly", {"scenario": "a", "overrides": ["x"]}, "fly: overrides: must be a table"),
        ("fly", {"scenario": "a", "overrides": {"wind": None}}, "wind: must be a number, a text, "),
        ("fly", {"scenario": "a" * 5000}, "fly: scenario: "),
        ("score", {"log": "none.mcap"}, "log: 'none.mcap': no such file in "),
        ("search", {"campaign": "c", "requirement": [], "flights": 1, "out": "s"}, "search: requirement: "),
        ("search", {"campaign": "c", "requirement": ["v"], "flights": 10**6, "out": "s"}, "must be at most 2000"),
        ("search", {"campaign": "c", "requirement": ["v"], "flights": 1, "out": "s", "workers": 99}, "search: workers"),
        ("search", {"campaign": "c", "requirement": ["v"], "flights": 1, "out": "s", "method": "x"}, "search: method"),
    ],
)
def test_wrong_arguments_are_one_line(places: Places, name: str, arguments: dict[str, Any], told: str):
    with pytest.raises(BadInput) as refused:
        command(places, name, **arguments)
    assert told in str(refused.value) and "\n" not in str(refused.value) and len(str(refused.value)) < 600


def test_an_unknown_tool_is_refused_with_the_names_of_all():
    with pytest.raises(BadInput, match=r"'flight': no such tool; nearest: .*; all: scenarios, fly, explain, "):
        tool("flight")


def test_every_bundled_scenario_is_short_enough():
    assert max(load(name).frames for name in names()) <= MOST_FRAMES and MOST_FLIGHTS == 2000


def test_without_the_package_one_line_names_the_extra(
    rig_command: Callable[..., tuple[int, str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delitem(sys.modules, "rig.cli.mcp_server", raising=False)
    for absent in ("mcp", "anyio"):
        monkeypatch.setitem(sys.modules, absent, None)
    line = "error: rig mcp: needs the package mcp: pip install 'jsbsim-rig[mcp]'\n"
    assert rig_command("mcp") == (2, "", line)
    assert list(tmp_path.iterdir()) == []
