"""``rig vote`` over the log of a flight, by the log's own scenario: the decisions of the flight, to the bit."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import rig
from rig.cli.main import app
from rig.core.frame import INDEX, DecidedBy
from rig.log import read_log

RUNNER = CliRunner()


def _faults(kind: str, signals: Sequence[str], channels: list[int], start_s: float, more: str = "") -> str:
    """Return the override for one fault a signal."""
    text = f'kind="{kind}",channels={channels},start_s={start_s}{more}'
    return f"faults=[{','.join(f'{{signal={json.dumps(name)},{text}}}' for name in signals)}]"


RATES = ("pitch_rate", "roll_rate", "yaw_rate", "normal_load_factor")
HIGH = ',direction="high"'
THREE = ",".join(
    f'{{kind="hardover",signal="pitch_rate",channels=[{channel}],start_s={start_s}{HIGH}}}'
    for channel, start_s in ((3, 0.5), (1, 1.2), (4, 2.0))
)
FLIGHTS: dict[str, list[str]] = {
    "a box": [_faults("hardover", [*RATES, "lateral_load_factor"], [3], 1.0, HIGH)],
    "two boxes at zero": [_faults("scale", RATES, [2, 4], 1.0, ",factor=0.0")],
    "common hardovers": [_faults("hardover", RATES[:3], [1, 2, 3, 4], 1.0, HIGH), 'redundancy.common_mode="fail"'],
    "three faults": [f"faults=[{THREE}]"],
    "a reset": [
        _faults("hardover", ["yaw_rate"], [2], 0.5, f"{HIGH},duration_s=0.5"),
        'redundancy.resets=[{at_s=2.305,signal="yaw_rate",channels=[2]}]',
    ],
    "discretes": [_faults("stuck", ["gear_down"], [1, 2], 1.0)],
}


def _vote_and_diff(log: Path, voted: Path) -> tuple[int, dict[str, Any]]:
    done = RUNNER.invoke(app, ["vote", str(log), "--out", str(voted)])
    assert done.exit_code == 0, done.output
    compared = RUNNER.invoke(app, ["diff", str(log), str(voted), "--json"])
    return compared.exit_code, json.loads(compared.output)


QUICK = ("a box", "common hardovers", "a reset")


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else [pytest.mark.long]) for n in FLIGHTS])
def test_the_log_of_a_flight_is_voted_as_it_was_in_flight(name: str, tmp_path: Path):
    flight = rig.fly("f16_pitch_rate_hardover", overrides=["duration_s=4", *FLIGHTS[name]], out=tmp_path)
    exit_code, compared = _vote_and_diff(Path(flight.log), tmp_path / "voted.mcap")
    assert (exit_code, compared["counts"]["different"], compared["fields"]) == (0, 0, [])
    assert compared["counts"]["equal"] > 16 * 25
    tie_break = set(read_log(flight.log).rows["decided_by"].ravel())
    if name == "a box":
        assert DecidedBy.BOX in tie_break
    if name == "common hardovers":
        assert DecidedBy.COMMON in tie_break


def test_a_long_flight_is_voted_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its rows are read again from the disk, its columns lie in files, and a table is written in parts."""
    flight = rig.fly("f16_pitch_rate_hardover", overrides=["duration_s=2", FLIGHTS["discretes"][0]], out=tmp_path)
    for name, held in (("short", None), ("long", 70)):
        if held is not None:
            monkeypatch.setattr("rig.log.log_file.HELD_BYTES", held)
            monkeypatch.setattr("rig.core.blocks.HELD", held)
            monkeypatch.setattr("rig.bench.write_votes.HELD", held)
        for ending in ("csv", "parquet", "mcap"):
            rig.vote(flight.log, out=tmp_path / f"{name}.{ending}")
    for ending in ("csv", "parquet", "mcap"):
        assert (tmp_path / f"short.{ending}").read_bytes() == (tmp_path / f"long.{ending}").read_bytes()


def test_a_vote_of_a_flight_tells_from_another_flight(tmp_path: Path):
    first, second = (
        rig.fly("f16_pitch_rate_hardover", seed=seed, overrides=["duration_s=2"], out=tmp_path) for seed in (1, 2)
    )
    RUNNER.invoke(app, ["vote", str(first.log), "--out", str(tmp_path / "voted.mcap")])
    compared = RUNNER.invoke(app, ["diff", str(second.log), str(tmp_path / "voted.mcap"), "--json"])
    assert compared.exit_code == 1 and json.loads(compared.output)["counts"]["different"] > 50


def test_faults_are_injected_into_a_flight_by_its_own_settings(tmp_path: Path):
    flight = rig.fly("f16_pitch_rate_hardover", overrides=["duration_s=4", "faults=[]"], out=tmp_path)
    faults = tmp_path / "faults.toml"
    faults.write_text('[[faults]]\nkind = "hardover"\nsignal = "roll_rate"\nchannels = [2]\nstart_s = 1.0\n')
    command = ["vote", str(flight.log), "--inject", str(faults), "--out", str(tmp_path / "o.csv"), "--json"]
    voted = json.loads(RUNNER.invoke(app, command).output)
    assert [one["outcome"] for one in voted["injected"]["faults"]] == ["correct"]
    assert set(voted["signals"]) == set(INDEX) and len(voted["discretes"]) == 3


@pytest.mark.parametrize("made", ["a table", "a vote"])
def test_what_has_no_settings_needs_a_configuration(made: str, tmp_path: Path):
    path = tmp_path / "x.csv"
    path.write_text("time_s,x.1,x.2\n0,1,1\n0.01,1,1\n")
    if made == "a vote":
        (tmp_path / "c.toml").write_text("[default]\nthreshold = 1.0\n")
        command = ["vote", str(path), "--config", str(tmp_path / "c.toml"), "--out", str(tmp_path / "v.mcap")]
        assert RUNNER.invoke(app, command).exit_code == 0
        path = tmp_path / "v.mcap"
    refused = RUNNER.invoke(app, ["vote", str(path), "--out", str(tmp_path / "o.csv")])
    assert refused.exit_code != 0 and not (tmp_path / "o.csv").exists()
    assert "--config is needed" in str(refused.output) + str(refused.exception)


def test_boxes_of_a_configuration_fail_a_channel_on_all_signals(tmp_path: Path):
    rows = ["time_s," + ",".join(f"{s}.{c}" for s in "abcd" for c in (1, 2, 3, 4))]
    for k in range(60):
        value = [5.0 if c == 3 and s != "d" and k >= 20 else 0.0 for s in "abcd" for c in (1, 2, 3, 4)]
        rows.append(",".join(map(str, [k / 100, *value])))
    (tmp_path / "x.csv").write_text("\n".join(rows) + "\n")
    states = {}
    for signals in (0, 3):
        (tmp_path / "c.toml").write_text(f"box_signals = {signals}\nbox_persistence = 4\n[default]\nthreshold = 1.0\n")
        out = tmp_path / f"{signals}.csv"
        command = ["vote", str(tmp_path / "x.csv"), "--config", str(tmp_path / "c.toml"), "--out", str(out), "--json"]
        voted = json.loads(RUNNER.invoke(app, command).output)
        states[signals] = [voted["signals"][s]["level"] for s in "abcd"]
    assert states == {0: [3, 3, 3, 4], 3: [3, 3, 3, 3]}
