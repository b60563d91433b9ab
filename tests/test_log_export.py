"""A log as a table, and what a log says of itself."""

import json
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from pyarrow.parquet import ParquetFile, read_schema
from test_log_writer import write

import rig
from rig.cli import main as cli
from rig.core.errors import BadInput
from rig.core.frame import INDEX, Pattern, State
from rig.flight.fly import fly
from rig.log import export as module
from rig.log.columns import COLUMNS
from rig.log.export import export
from rig.log.info import info
from rig.log.writer import LogWriter

Q = INDEX["pitch_rate"]
# A channel flagged invalid for a while, then a hardover: what rig vote has to see in the table too.
FAULTS = (
    "faults=[{kind='dropout', signal='pitch_rate', channels=[2], start_s=0.5, end_s=0.52},"
    "{kind='hardover', signal='pitch_rate', channels=[3], start_s=1.0, seen_by_ilm=true},"
    "{kind='offset', signal='heading', channels=[1], start_s=1.2, offset=0.5}]"
)


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    return fly(overrides=["duration_s=3", FAULTS], out=tmp_path_factory.mktemp("logs")).log


def test_the_command_does_without_the_compiler(flown: Path, tmp_path: Path):
    """Which takes a fifth of the memory in which a log of any length is exported."""
    loaded = "print('numba' in sys.modules, 'polars' in sys.modules)"
    code = f"import sys; from rig.cli.main import main\ntry: main()\nfinally: {loaded}"
    command = [sys.executable, "-c", code, "export", str(flown), "--to", "csv", "--out", str(tmp_path / "a.csv")]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "False True"


@pytest.mark.parametrize("to", ["csv", "parquet", "npz"])
def test_numbers_come_back_bit_for_bit(flown, tmp_path, to):
    log, out = rig.read_log(flown), tmp_path / f"a.{to}"
    names = export(log, to, out).columns
    read = {"csv": pl.read_csv, "parquet": pl.read_parquet, "npz": np.load}[to]
    table = read(out)
    assert len(names) == len(set(names)) == len(COLUMNS) + 1
    for name, values in {
        "time_s": log.time_s,
        "pitch_rate.3": log.rows["channels"][:, Q, 2],
        "pitch_rate.voted": log.rows["voted"][:, Q],
        "heading.ref": log.rows["reference"][:, INDEX["heading"]],
        "flight.altitude_m": log.rows["flight"][:, 0],
        "pitch_rate.level": log.rows["level"][:, Q],
    }.items():
        assert np.array_equal(np.asarray(table[name], values.dtype), values, equal_nan=values.dtype.kind == "f")


def test_enums_are_words_in_a_table_and_numbers_in_npz(flown, tmp_path):
    log = rig.read_log(flown)
    for to in ("parquet", "npz"):
        export(log, to, tmp_path / f"a.{to}", ["pitch_rate"])
    states, patterns = (
        pl.read_parquet(tmp_path / "a.parquet")[f"pitch_rate.{n}"].to_list() for n in ("state.3", "pattern")
    )
    assert states == [State(v).name.lower() for v in log.rows["state"][:, Q, 2]] and "failed" in states
    assert patterns == [Pattern(v).label for v in log.rows["pattern"][:, Q]] and "isolated" in patterns
    assert np.load(tmp_path / "a.npz")["pitch_rate.state.3"].tolist() == log.rows["state"][:, Q, 2].tolist()


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_an_export_for_vote_is_voted_as_it_was_in_flight(flown, tmp_path, to, rig_command):
    """Every vote, state, level, pattern and rule of the flight, from the table alone."""
    recording, table, out = rig.read_log(flown), tmp_path / f"a.{to}", tmp_path / "voted.parquet"
    code, _, err = rig_command("export", flown, "--to", to, "--for-vote", "--out", table)
    assert (code, err) == (0, "")
    (tmp_path / "vote.toml").write_text(config(recording))
    assert rig_command("vote", table, "--config", tmp_path / "vote.toml", "--out", out)[0] == 0
    voted = pl.read_parquet(out)
    for name in INDEX:
        signal = recording.signal(name)
        assert voted[f"{name}.voted"].to_numpy().tobytes() == np.ascontiguousarray(signal.voted).tobytes(), name
        assert voted[f"{name}.level"].to_list() == signal.level.tolist()
        assert voted[f"{name}.pattern"].to_list() == [Pattern(v).label for v in signal.pattern]
        for c in range(4):
            assert voted[f"{name}.state.{c + 1}"].to_list() == [State(v).name.lower() for v in signal.state[:, c]]


def config(recording) -> str:
    """The flight's own settings as a CONFIG of rig vote: measured reference thresholds, figures of the sensors."""
    import tomli_w

    from rig.flight import loop
    from rig.scenario.scenario import from_resolved
    from rig.world.sensors import data_sheets

    which = from_resolved(json.loads(recording.metadata["scenario"]), "log")
    params = loop.redundancy(which).manager.params
    sheets = data_sheets(which.sensors, which.rate_hz)
    tables: dict[str, Any] = {}
    for name, s in INDEX.items():
        own = getattr(which.redundancy.signals, name).with_figures(sheets[s])
        tables[name] = own.model_dump(exclude_none=True)
        tables[name]["reference_threshold"] = float(params[s]["reference_threshold"])
    return tomli_w.dumps({"signal": tables})


def test_an_export_for_vote_leaves_flagged_samples_empty(flown, tmp_path):
    log = rig.read_log(flown)
    names = export(log, "csv", tmp_path / "a.csv", ["pitch_rate"], for_vote=True).columns
    assert names == [
        "time_s",
        *(f"pitch_rate.{c}" for c in range(1, 5)),
        "pitch_rate.ref",
        *(f"pitch_rate.ilm.{c}" for c in range(1, 5)),
    ]
    second = pl.read_csv(tmp_path / "a.csv")["pitch_rate.2"].to_numpy()
    assert np.flatnonzero(np.isnan(second)).tolist() == [50, 51]
    export(log, "csv", tmp_path / "a.csv", ["pitch_rate"])
    assert pl.read_csv(tmp_path / "a.csv")["pitch_rate.valid.2"].to_numpy().tolist().count(0) == 2


def test_a_table_written_group_by_group_is_the_same_table(flown, tmp_path, monkeypatch):
    whole = {to: export(flown, to, tmp_path / f"whole.{to}") for to in ("csv", "parquet")}
    monkeypatch.setattr(module, "GROUP_BYTES", 100_000)  # some thirty frames
    for to, of_whole in whole.items():
        assert export(flown, to, tmp_path / f"groups.{to}") == of_whole
    assert (tmp_path / "groups.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    groups, at_once = (pl.read_parquet(tmp_path / f"{name}.parquet") for name in ("groups", "whole"))
    assert groups.schema == at_once.schema and groups.equals(at_once)
    assert ParquetFile(tmp_path / "groups.parquet").num_row_groups > 5


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_a_group_that_is_written_is_not_held(flown, tmp_path, monkeypatch, to):
    """The memory of an export: the group that is made and the one that is written."""
    made, most = [], []
    in_blocks = module.in_blocks

    def counted(*arguments):
        for block in in_blocks(*arguments):
            made.append(weakref.ref(block[0]))
            most.append(sum(one() is not None for one in made))
            yield block

    monkeypatch.setattr(module, "in_blocks", counted)
    monkeypatch.setattr(module, "GROUP_BYTES", 100_000)
    export(flown, to, tmp_path / f"groups.{to}")
    assert len(made) > 5 and max(most) <= 2


def test_a_log_without_frames_is_a_table_without_rows(flown, tmp_path):
    log = rig.read_log(flown)
    with LogWriter(tmp_path / "a.mcap", log.rate_hz, log.metadata, log.attachments.items()) as writer:
        writer.close({})
    assert export(tmp_path / "a.mcap", "csv", tmp_path / "a.csv", ["pitch_rate"]).rows == 0
    assert pl.read_csv(tmp_path / "a.csv").height == 0


def test_a_damaged_log_is_no_table(flown, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(flown.read_bytes()[:-5000])
    with pytest.raises(BadInput, match=r"cut\.mcap"):
        export(cut, "csv", tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == [cut]


def test_only_what_is_asked_for_is_written(flown, tmp_path, rig_command):
    code, out, _ = rig_command(
        "export", flown, "--to", "npz", "--signals", "heading, flight", "--out", "a.npz", "--json"
    )
    found = json.loads(out)
    assert code == 0 and found["rows"] == 300
    assert {name.split(".")[0] for name in found["columns"]} == {"time_s", "heading", "flight"}
    assert set(np.load("a.npz")) == set(found["columns"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--to", "xls"], "--to xls: allowed: csv, parquet, npz"),
        (["--to", "csv", "--signals", "haeding"], "unknown 'haeding', nearest: heading"),
        (["--to", "csv", "--signals", "flight", "--for-vote"], "unknown 'flight', nearest: "),
        (["--to", "csv", "--out", "nowhere/a.csv"], "no such folder"),
    ],
)
def test_a_wrong_export_is_one_line_exit_code_2_and_nothing_written(flown, tmp_path, arguments, says, rig_command):
    before = sorted(flown.parent.iterdir())
    code, out, err = rig_command("export", flown, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1) and says in err
    assert list(tmp_path.iterdir()) == [] and sorted(flown.parent.iterdir()) == before


def test_a_log_tells_what_was_flown_and_that_it_is_whole(flown, rig_command):
    found, log = info(flown), rig.read_log(flown)
    assert (found["title"], found["aircraft"], found["seed"]) == ("F-16 pitch-rate hardover", "f16", 1)
    assert (found["frames"], found["duration_s"], found["rate_hz"], found["faults"]) == (300, 3.0, 100.0, 3)
    assert found["result"] == log.result and found["result"]["survived"] == "True"
    assert found["topics"]["/signal/heading"] == 300 and found["topics"]["/events"] == len(log.events)
    assert found["events"]["fault on"] == 3 and found["events"]["channel failed"] == 2
    assert found["health"] == "whole, every checksum matches" and found["damage"] is None
    assert found["versions"]["jsbsim"] == log.metadata["version jsbsim"]
    code, text, _ = rig_command("info", flown)
    assert code == 0 and log.result and log.result["digest"] in text and "survived" in text
    code, text, _ = rig_command("info", flown, "--json")
    assert code == 0 and json.loads(text) == json.loads(json.dumps(found))


def test_a_cut_log_tells_what_is_left_of_it(flown, tmp_path, rig_command):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(flown.read_bytes()[: flown.stat().st_size * 4 // 5])  # behind the first chunk
    code, text, err = rig_command("info", cut, "--json")
    found = json.loads(text)
    assert code == 2 and err.count("\n") == 1 and "truncated at byte" in err
    assert found["frames"] == 200 and found["damage"].startswith("truncated at byte") and found["result"] is None


def test_unknown_owners_are_refused_before_anything_is_written(flown, tmp_path):
    with pytest.raises(BadInput, match="unknown 'mach'"):
        export(rig.read_log(flown), "csv", tmp_path / "a.csv", ["mach"])
    assert list(tmp_path.iterdir()) == []


def exported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["rig", "export", *options])
    with pytest.raises(SystemExit) as end:
        cli.main()
    return int(end.value.code or 0), capsys.readouterr().err


@pytest.mark.parametrize("ending", ["csv", "parquet", "npz"])
def test_the_format_is_that_of_the_ending_and_units_are_with_the_columns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], ending: str
):
    write(tmp_path / "a.mcap", 40)
    out = tmp_path / f"t.{ending}"
    assert exported(monkeypatch, capsys, str(tmp_path / "a.mcap"), "--out", str(out))[0] == 0
    if ending == "parquet":
        schema = read_schema(out)
        units = {name: (schema.field(name).metadata or {}).get(b"unit", b"").decode() for name in schema.names}
    else:
        units = json.loads(Path(f"{out}.units.json").read_text())
    wanted = {"time_s": "s", "pitch_rate.voted": "rad/s", "heading.2": "rad", "static_pressure.ref": "Pa"}
    assert {name: units[name] for name in wanted} == wanted
    assert not units.get("pitch_rate.state.1") and not units.get("pitch_rate.level")
    assert (tmp_path / f"t.{ending}.units.json").exists() == (ending != "parquet")


def test_a_table_of_several_groups_keeps_units_and_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write(tmp_path / "a.mcap", 400)
    monkeypatch.setattr(module, "GROUP_BYTES", 1 << 12)
    export(tmp_path / "a.mcap", "parquet", tmp_path / "t.parquet", ["pitch_rate"])
    assert ParquetFile(tmp_path / "t.parquet").num_row_groups > 1
    assert read_schema(tmp_path / "t.parquet").field("pitch_rate.voted").metadata[b"unit"] == b"rad/s"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "--to, --out: one is needed"),
        (["--out", "t.txt"], "--out t.txt: must end in .csv, .parquet, .npz"),
        (["--to", "csv", "--out", "t.parquet"], "--out t.parquet: must end in .csv, the format of --to"),
        (["--to", "csv", "--layout", "foxglove"], "--to, --layout: only one of them at a time"),
    ],
)
def test_a_format_that_is_not_said_or_said_twice_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    message: str,
):
    write(tmp_path / "a.mcap", 4)
    monkeypatch.chdir(tmp_path)
    code, err = exported(monkeypatch, capsys, "a.mcap", *options)
    assert code == 2 and message in err and [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
