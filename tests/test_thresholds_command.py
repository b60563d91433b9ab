"""``rig thresholds``: what it reads, writes and refuses; OUT is a configuration that ``rig vote`` takes."""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w

from rig.core.errors import BadInput
from rig.core.settings import read_toml
from rig.log.recordings.alignment import AlignOptions
from rig.log.recordings.vote_config import read_config
from rig.studies.thresholds.data import of_scenario, recordings
from rig.studies.thresholds.design import Design, Threshold
from rig.studies.thresholds.in_out import recorded_toml, scenario_toml, start

QUAD = Path(__file__).parents[2] / "shared" / "data" / "quad_imu_horizontal"
Command = Callable[..., tuple[int, str, str]]
QUICK = ["--persistence", "4", "--levels", "4", "--filter", "0"]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)


def record(folder: str, flights: int, seconds: float = 30.0, names: tuple[str, ...] = ("gyro",), seed: int = 0) -> None:
    """Tables of four channels at 100 Hz: a common motion and white noise of 1."""
    Path(folder).mkdir(exist_ok=True)
    n = round(100 * seconds)
    for k in range(flights):
        rng = np.random.default_rng([seed, k])
        columns: dict[str, Any] = {"time_s": np.arange(n) / 100.0}
        for name in names:
            motion = 20.0 * np.sin(np.arange(n) / 80.0)
            columns |= {f"{name}.{c}": motion + rng.normal(size=n) for c in range(1, 5)}
        pl.DataFrame(columns).write_parquet(f"{folder}/path_{k + 1}.parquet")


def config(**tables: Any) -> None:
    Path("c.toml").write_text(tomli_w.dumps(tables or {"default": {"fade_s": 0.1}}))


def test_out_is_a_whole_configuration_and_the_design_is_told(rig_command: Command):
    record("data", 10)
    config()
    wanted = ["data", "--config", "c.toml", "--budget", "20", "--out", "o.toml", *QUICK]
    code, out, _ = rig_command("thresholds", *wanted, "--json", "--plot", "p.html")
    assert code == 0
    found = json.loads(out)
    signal = found["signals"]["gyro"]
    assert found["flights"] == 10 and found["hours"] == pytest.approx(1 / 12) and found["notes"] == []
    made = signal["designs"][0]
    assert made["extrapolation"] == pytest.approx(12 / 20)
    assert made["levels"]["4"]["clusters"] >= 40
    assert made["tradeoff"]["smallest_offset"] > 0
    assert signal["hold_out"]["4"]["expected"] == pytest.approx(20 / 12)
    written = read_config(Path("o.toml"))
    assert written.default == {"fade_s": 0.1}
    assert written.signal["gyro"] == signal["chosen"] and written.signal["gyro"]["persistence"] == 4
    assert "20 false isolations an hour" in Path("o.toml").read_text().splitlines()[0]
    page = Path("p.html").read_text()
    assert page.count("plotly.js v") == 1 and page.count('class="figure"') == 3 and found["rule"] in page
    assert not re.findall("<(?:script|link|img)[^>]*https?:", page)
    first = Path("o.toml").read_bytes()
    code, out, _ = rig_command("thresholds", *wanted)
    assert code == 0 and Path("o.toml").read_bytes() == first
    assert "faults injected into the same data" in out and "hold-out" in out and "motion of the data" in out


def test_a_flight_with_a_fault_is_told_and_left_out(rig_command: Command):
    record("data", 10)
    table = pl.read_parquet("data/path_3.parquet")
    faulty = table.with_columns(pl.when(pl.col("time_s") > 12).then(pl.col("gyro.2") + 15).otherwise(pl.col("gyro.2")))
    faulty.with_columns(**{"gyro.2": faulty["gyro.2"]}).write_parquet("data/path_3.parquet")
    config()
    wanted = ["data", "--config", "c.toml", "--budget", "20", "--out", "o.toml", *QUICK, "--json"]
    left_out, kept = (json.loads(rig_command("thresholds", *wanted, *more)[1]) for more in ([], ["--keep"]))
    (told,) = left_out["signals"]["gyro"]["left_out"]
    assert (told["flight"], told["channel"]) == (2, 2)
    assert any("path_3.parquet: gyro.2 stands out: for 1 s from " in note for note in left_out["notes"])
    thresholds = [found["signals"]["gyro"]["chosen"]["threshold"] for found in (left_out, kept)]
    assert thresholds[0] < 4 < thresholds[1]


REMARKS = {
    "one flight": (1, 300.0, ["--budget", "20"], "only one flight: split into 16 parts, which differ less"),
    "few flights": (3, 60.0, ["--budget", "20"], "3 flights; with fewer than 9"),
    "beyond the data": (10, 30.0, ["--budget", "0.01"], "1.2e+03 times the 0.0833 h of data"),
    "little data": (2, 10.0, ["--budget", "100"], "events, not 40 or more"),
}


@pytest.mark.parametrize("case", REMARKS)
def test_what_the_data_do_not_support_is_told(case: str, rig_command: Command):
    flights, seconds, more, wanted = REMARKS[case]
    record("data", flights, seconds)
    config()
    code, out, err = rig_command("thresholds", "data", "--config", "c.toml", "--out", "o.toml", *QUICK, *more, "--json")
    assert code == 0, err
    assert any(wanted in note for note in json.loads(out)["notes"]), json.loads(out)["notes"]


def test_data_to_be_monitored_that_move_more_are_told(rig_command: Command):
    record("data", 9)
    record("other", 1)
    table = pl.read_parquet("other/path_1.parquet")
    table.with_columns(pl.exclude("time_s") * 4.0).write_parquet("other/path_1.parquet")
    config()
    wanted = ["data", "--config", "c.toml", "--budget", "20", "--out", "o.toml", *QUICK, "--json"]
    notes = json.loads(rig_command("thresholds", *wanted, "--monitored", "other")[1])["notes"]
    assert any(note.startswith("gyro: 95 % of its motion is within") for note in notes)
    assert json.loads(rig_command("thresholds", *wanted, "--monitored", "data")[1])["notes"] == []


def _same_channels() -> None:
    record("data", 2)
    for path in Path("data").iterdir():
        table = pl.read_parquet(path)
        table.with_columns(**{f"gyro.{c}": table["gyro.1"] for c in (2, 3, 4)}).write_parquet(path)


def _all_faulty() -> None:
    record("data", 2)
    for path in Path("data").iterdir():
        pl.read_parquet(path).with_columns(pl.lit(None, pl.Float64).alias("gyro.2")).write_parquet(path)


def _other_rate() -> None:
    record("data", 2)
    table = pl.read_parquet("data/path_2.parquet")
    table.with_columns(pl.col("time_s") * 2.0).write_parquet("data/path_2.parquet")


BAD: dict[str, tuple[Any, dict[str, Any], list[str], str]] = {
    "no config": (None, {}, ["--config", "none.toml"], "none.toml: no such file"),
    "no settings": (None, {"time_column": "t"}, [], "c.toml: no signal to design; add [default] or [signal.<name>]"),
    "an unknown signal": (None, {"signal": {"gyr": {}}}, [], "signal 'gyr' is not in the input; allowed: gyro"),
    "another manager": (None, {"default": {"manager": "mean"}}, [], 'no signal has the manager "cross-channel"'),
    "an empty folder": (lambda: Path("data").mkdir(), {}, [], "data: no recording found: neither a file of type .csv"),
    "nothing there": (lambda: None, {}, [], "data: no such file"),
    "no budget": (None, {}, ["--budget", "0"], "--budget: must be 1e-12 or more false isolations per hour, got 0.0"),
    "a budget beyond numbers": (
        None,
        {},
        ["--budget", "5e-324"],
        "--budget: must be 1e-12 or more false isolations per hour",
    ),
    "a budget of nan": (
        None,
        {},
        ["--budget", "nan"],
        "--budget: must be 1e-12 or more false isolations per hour, got nan",
    ),
    "no frames": (None, {}, ["--persistence", "8,0"], "--persistence: must be whole numbers from 1 to 10000"),
    "a level of one": (None, {}, ["--levels", "4,1"], "--levels: must be whole numbers from 2 to 4"),
    "a filter of words": (None, {}, ["--filter", "long"], "--filter: must be seconds from 0 to 1000"),
    "a rule that is gone": (
        None,
        {},
        ["--slow-faults", "bias,slow"],
        "--slow-faults: the rule bias is gone: --slow-tests learns the biases of channels",
    ),
    "an unknown rule": (None, {}, ["--slow-faults", "sums"], "must be none alone, or of slow, stale, got"),
    "nothing to design": (
        None,
        {},
        ["--keep-thresholds", "--slow-faults", "none"],
        "--keep-thresholds: nothing is left to design; add --slow-tests, or rules to --slow-faults",
    ),
    "nothing to keep": (None, {}, ["--keep-thresholds"], "signal.gyro: --keep-thresholds needs a threshold in CONFIG"),
    "a stretch without align": (None, {}, ["--align-to", "3"], "--align-to, --align-matrix: need --align"),
    "channels that are one": (_same_channels, {}, [], "gyro: the channels do not differ in 0.0167 h"),
    "a fault everywhere": (_all_faulty, {}, [], "gyro: a channel stands out in every flight"),
    "flights too short": (lambda: record("data", 2, 0.5), {}, [], "gyro: too few events in 0.000278 h of 2 flights"),
    "another rate": (_other_rate, {}, [], "path_2.parquet: 50 rows a second, data/path_1.parquet has 100"),
    "no such folder": (None, {}, ["--out", "none/o.toml"], "none/o.toml: no such folder: none"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_nothing_is_written(case: str, rig_command: Command):
    make, tables, more, wanted = BAD[case]
    (make or (lambda: record("data", 2, 5.0)))()
    config(**tables)
    options = ["--config", "c.toml", "--budget", "20", "--out", "o.toml", *QUICK, *more]
    code, out, err = rig_command("thresholds", "data", *options)
    assert (code, out) == (2, "")
    assert wanted in err and err.count("\n") == 1
    assert not Path("o.toml").exists()


def test_a_full_disk_is_said_of_the_output(monkeypatch: pytest.MonkeyPatch, rig_command: Command):
    """And not of the file beside it that would have become it; the page is not there either."""

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    record("data", 10)
    config()
    monkeypatch.setattr(Path, "write_text", full)
    options = ["--config", "c.toml", "--budget", "20", "--out", "o.toml", "--plot", "o.html", *QUICK]
    code, _, error = rig_command("thresholds", "data", *options)
    assert (code, error) == (1, "failed: o.toml: cannot be written: No space left on device\n")
    assert sorted(path.name for path in Path.cwd().iterdir()) == ["c.toml", "data"]


DESIGN = Design(0.1, 24, 24, {4: Threshold(4, 2.0, 1.0, 40, 0.1), 3: Threshold(3, 3.0, 1.0, 40, 0.1)})


def test_everything_else_of_the_configuration_is_kept():
    mapping = {"a.1": "one.csv:x", "a.2": "two.csv:x"}
    given = {
        "default": {"threshold": 9.0, "persistence_s": 0.055, "fade_s": 0.2},
        "signal": {"a": {"range": [-3.0, 3.0], "split_persistence": 5}},
        "mapping": mapping,
        "discrete": {"gear": {"fail_safe": 1}},
        "resets": [{"at_s": 1.0, "signal": "a"}],
    }
    config(**given)
    using, raw = start(Path("c.toml"))
    settings = using.signals(["a", "b"], "c.toml")
    Path("o.toml").write_text(recorded_toml(raw, {"a": DESIGN}, settings, 100.0, {"a"}, ["two\nlines"]))
    assert Path("o.toml").read_text().startswith("# two lines\n\n")
    written = read_toml(Path("o.toml"))
    for key in ("mapping", "discrete", "resets"):
        assert written[key] == given[key]
    chosen = read_config(Path("o.toml")).signals(["a", "b"], "o.toml")
    assert (chosen["a"].threshold, chosen["a"].threshold_triplex, chosen["a"].persistence) == (2.0, 3.0, 24)
    assert (chosen["a"].range, chosen["a"].split_persistence, chosen["a"].fade_s) == ([-3.0, 3.0], 5, 0.2)
    assert chosen["a"].reference_threshold == 9.0  # as before: the design is not of the reference
    assert (chosen["b"].threshold, chosen["b"].persistence) == (9.0, 6)


def test_the_tables_of_a_scenario_fly(tmp_path: Path):
    from rig.scenario.scenario import load

    given = {"pitch_rate": load(None).redundancy.signals.pitch_rate}
    Path("o.toml").write_text(scenario_toml({"pitch_rate": DESIGN}, given, ["remark"]))
    table = read_toml(Path("o.toml"))["redundancy"]["signals"]["pitch_rate"]
    sets = [f"redundancy.signals.pitch_rate.{key}={value}" for key, value in table.items()]
    flown = load(None, sets).redundancy.signals.pitch_rate
    assert (flown.threshold, flown.threshold_triplex, flown.filter_s, flown.persistence) == (2.0, 3.0, 0.1, 24)
    assert flown.reference_threshold == given["pitch_rate"].threshold


KEPT = replace(DESIGN, kept=True, slow_faults={"slow_limit": 3.0, "slow_allowance": 0.1, "stale_frames": 12})


def test_thresholds_that_are_kept_stay_as_they_were_written():
    config(default={"threshold": 9.0, "persistence_s": 0.055, "slow_limit": 1.0, "slow_allowance": 0.5})
    using, raw = start(Path("c.toml"))
    tests = {"a": {"factor": 1.5}}
    text = recorded_toml(raw, {"a": KEPT}, using.signals(["a"], ""), 100.0, {"a"}, [], tests)
    Path("o.toml").write_text(text)
    written = read_toml(Path("o.toml"))
    assert written["default"] == {"threshold": 9.0, "persistence_s": 0.055}
    new = {"slow_limit": 3.0, "slow_allowance": 0.1, "stale_frames": 12}
    assert written["signal"]["a"] == {**new, "slow_tests": tests["a"]}


def test_of_a_scenario_too_and_nothing_of_its_reference_is_written():
    from rig.scenario.scenario import load

    given = {"pitch_rate": load(None).redundancy.signals.pitch_rate}
    Path("o.toml").write_text(scenario_toml({"pitch_rate": KEPT}, given, []))
    table = read_toml(Path("o.toml"))["redundancy"]["signals"]["pitch_rate"]
    assert table == {"slow_limit": 3.0, "slow_allowance": 0.1, "stale_frames": 12}


def test_a_threshold_that_is_kept_must_be_there():
    config(default={"fade_s": 0.1})
    using, raw = start(Path("c.toml"))
    with pytest.raises(BadInput, match=r"signal\.a: --keep-thresholds needs a threshold in CONFIG"):
        recorded_toml(raw, {"a": KEPT}, using.signals(["a"], ""), 100.0, (), [])


@pytest.mark.parametrize("rules", ["slow,stale", "none"])
def test_the_command_keeps_thresholds_and_designs_the_rest(rules: str, rig_command: Command):
    record("data", 10)
    figures = {"noise_std": 1.0, "bias_tolerance": 0.5}
    config(default={"threshold": 6.0, "persistence": 10, "slow_tests": figures})
    wanted = ["data", "--config", "c.toml", "--budget", "20", "--out", "o.toml", "--levels", "4", "--keep-thresholds"]
    wanted += ["--slow-faults", rules, "--slow-tests", "--plot", "p.html"]
    code, out, err = rig_command("thresholds", *wanted, "--json")
    assert code == 0, err
    found, written = json.loads(out)["signals"]["gyro"], read_toml(Path("o.toml"))
    assert written["default"] == {"threshold": 6.0, "persistence": 10, "slow_tests": figures}
    assert found["slow_tests"]["keys"]["factor"] == written["signal"]["gyro"]["slow_tests"]["factor"]
    assert found["designs"][0]["kept"] and found["designs"][0]["levels"]["4"]["threshold"] == 6.0
    assert ("stale_frames" in written["signal"]["gyro"]) == (rules != "none")
    assert read_config(Path("o.toml")).signals(["gyro"], "o.toml")["gyro"].threshold == 6.0
    assert "Thresholds, persistence and filter are kept." in Path("o.toml").read_text()
    assert rig_command("thresholds", *wanted)[0] == 0


def test_the_matrix_of_a_triad_is_taken_off_before_the_design():
    from rig.studies.thresholds.data import load

    rng, n, axes = np.random.default_rng(1), 3000, ("x", "y", "z")
    motion = np.array([20.0 * np.sin(np.arange(n) / (40.0 + 25.0 * k)) for k in range(3)])
    turned = motion + 0.02 * np.array([motion[1], -motion[0], 0.0 * motion[2]])
    columns: dict[str, Any] = {"time_s": np.arange(n) / 100.0}
    for k, axis in enumerate(axes):
        columns |= {f"{axis}.{c}": (turned if c == 2 else motion)[k] + rng.normal(0.0, 0.01, n) for c in range(1, 5)}
    pl.DataFrame(columns).write_parquet("one.parquet")
    config(default={"threshold": 1.0}, triads={"gyro": list(axes)})
    using = read_config(Path("c.toml"))
    apart = []
    for matrix in (False, True):
        data = load([Path("one.parquet")], using, "c.toml", aligned=AlignOptions(matrix=matrix))
        (flight,) = data.signals["x"]
        apart.append(float(np.nanstd(flight.samples[1] - flight.samples[0])))
    assert apart[1] < apart[0] / 3


def test_a_folder_is_one_recording_or_holds_some():
    for k in (1, 2, 10):
        Path(f"data/path_{k}").mkdir(parents=True)
        Path(f"data/path_{k}/one.csv").touch()
    Path("data/README.md").touch()
    config(default={}, mapping={"a.1": "one.csv:x", "a.2": "one.csv:y"})
    using, _ = start(Path("c.toml"))
    inside = [Path(f"data/path_{k}") for k in (1, 2, 10)]
    assert recordings([Path("data")], using) == inside
    assert recordings([inside[1], Path("data")], using) == [inside[1], inside[0], inside[2]]


def test_alignment_without_an_end_is_found_in_the_stretch_of_rig_vote():
    from rig.log.recordings.align import align
    from rig.log.recordings.read import read
    from rig.studies.thresholds.data import load

    record("data", 1)
    (path,) = Path("data").iterdir()
    late = pl.when(pl.col("time_s") > 8.0).then(5.0).otherwise(0.0)  # most of the recording, none of the first 6 s
    pl.read_parquet(path).with_columns(pl.col("gyro.2") + late).write_parquet(path)
    config(default={"threshold": 1.0})
    using = read_config(Path("c.toml"))
    recording = read(path, using, False)
    settings = using.signals(recording.signals, "")
    first, whole = (align(recording, settings, 0.0, end)[0].signals["gyro"].channels for end in (6.0, None))
    (found,) = load([path], using, "c.toml", aligned=AlignOptions()).signals["gyro"]
    assert np.array_equal(found.samples, np.array(first)) and not np.array_equal(found.samples, np.array(whole))


def test_logs_of_ours_need_no_configuration(rig_command: Command):
    from rig.flight.fly import fly

    healthy = fly(None, overrides=["faults=[]", "duration_s=20.0"], out=Path("logs"))
    faulty = fly(None, overrides=["duration_s=1.0"], out=Path("faulty"))
    assert of_scenario([healthy.log]).signal["pitch_rate"]["threshold"] == 0.05
    options = ["--budget", "4000", "--out", "o.toml", "--persistence", "2", "--levels", "4", "--filter", "0", "--json"]
    code, out, err = rig_command("thresholds", "logs", *options, "--slow-faults", "none")
    assert code == 0, err
    written = read_toml(Path("o.toml"))["redundancy"]["signals"]
    assert written["pitch_rate"]["persistence"] == 2
    assert written["pitch_rate"]["threshold"] == json.loads(out)["signals"]["pitch_rate"]["chosen"]["threshold"]
    code, _, err = rig_command("thresholds", str(faulty.log), "--budget", "20", "--out", "p.toml")
    assert code == 2 and "the scenario has 1 fault;" in err and not Path("p.toml").exists()


@pytest.mark.long
@pytest.mark.skipif(not QUAD.is_dir(), reason="the recordings are not here")
def test_a_design_on_real_flights_is_met_by_others(rig_command: Command):
    """Nine flights design, five others fly; a setting for another mission fails channels in the same five."""
    from rig.bench.vote_rows import vote
    from rig.log.recordings.align import align
    from rig.log.recordings.read import read

    mapping = {f"gyro_{a}.{c}": f"IMU_{c}.csv:Gyr_{a.upper()}" for a in "xyz" for c in range(1, 5)}
    config(default={}, mapping=mapping, time_column="time")
    paths = sorted(QUAD.glob("path_*"))
    using = [
        *("--config", "c.toml", "--align", "--align-to", "6", "--repair-time", "--persistence", "24", "--filter"),
        "0",
    ]
    options = [
        *map(str, paths[:9]),
        *using,
        "--budget",
        "10",
        "--filter",
        "0",
        "--levels",
        "4",
        "--out",
        "o.toml",
        "--json",
    ]
    assert rig_command("thresholds", *options)[0] == 0
    designed, failed = read_config(Path("o.toml")), {"designed": 0, "10 deg/s, 8": 0}
    fixed = designed.model_copy(update={"signal": {}, "default": {"threshold": 10.0, "persistence": 8}})
    for path in paths[9:]:
        recording = read(path, designed, repair=True)
        moved, _ = align(recording, designed.signals(recording.signals, ""), end_s=6.0)
        for name, chosen in zip(failed, (designed, fixed), strict=True):
            voted = vote(moved, chosen.signals(moved.signals, ""), [])
            failed[name] += sum(len(signal.failures) for signal in voted.values())
    assert failed["designed"] <= 1 < failed["10 deg/s, 8"]


@pytest.mark.filterwarnings("error")
def test_a_signal_without_a_valid_sample_is_one_line_and_no_warning(rig_command: Command):
    rows = {"time_s": np.arange(3000) / 100.0, **{f"gyro.{c}": np.full(3000, np.nan) for c in range(1, 5)}}
    pl.DataFrame(rows).write_parquet("n.parquet")
    config()
    code, said, error = rig_command("thresholds", "n.parquet", "--config", "c.toml", "--budget", "3", "--out", "o.toml")
    assert (code, said, error.count("\n")) == (2, "", 1) and "gyro" in error and not Path("o.toml").exists()
