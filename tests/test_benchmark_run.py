"""One benchmark: the same bytes with one and two workers and after an interruption; what it refuses."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmark_flights import HEALTHY, SMALL, small
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core.errors import BadInput
from rig.core.progress import listening
from rig.studies.benchmark import run_benchmark
from rig.studies.benchmark.benchmark_trials import STATES
from rig.studies.benchmark.calibration_data import Healthy
from rig.studies.benchmark.entrants import entrants
from rig.studies.benchmark.prepared import Asked
from rig.studies.benchmark.run_benchmark import STUDY, run
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import run as fly


@pytest.fixture(scope="module", autouse=True)
def read_once() -> Iterator[None]:
    """Healthy flights are read once for the module: what is tested here is what a benchmark makes of them."""
    original, found = run_benchmark.read, dict[tuple[Path, ...], Healthy]()

    def kept(folder: Path, aircraft: Any, signals: Any, *option: Any) -> Healthy:
        if (key := (folder, *option)) not in found:
            found[key] = original(folder, aircraft, signals, *option)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_benchmark, "read", kept)
        yield


@pytest.fixture(scope="module")
def healthy(once: Any) -> Path:
    """Six flights, and beside their folder six others in ``second``."""
    campaign = read(HEALTHY, {"duration_s": 10.0}).model_copy(update={"runs": 6})

    def make(place: Path) -> Path:
        fly(Plan(campaign.model_copy(update={"seed": campaign.seed + 1}), str(HEALTHY)), place / "second", workers=1)
        return fly(Plan(campaign, str(HEALTHY)), place / "out", workers=1).out

    return once("benchmark-healthy", make)


def other(healthy: Path) -> Path:
    return healthy.parent / "second"


def asked(healthy: Path, **more: Any) -> Asked:
    return Asked(entrants("cusum,median"), 1.0, healthy, **{"trials": 4, "flights": 2, **more})


@pytest.fixture(scope="module")
def whole(healthy: Path, once: Any) -> tuple[Path, dict[str, Any]]:
    def make(place: Path) -> tuple[Path, dict[str, Any]]:
        return place / "out", run(small(), asked(healthy, second=other(healthy)), place / "out")

    return once("benchmark", make)


def content(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.long
def test_two_workers_write_the_same_bytes(whole: tuple[Path, Any], healthy: Path, tmp_path: Path):
    run(small(), asked(healthy, second=other(healthy)), tmp_path / "two", workers=2)
    assert content(tmp_path / "two") == content(whole[0])


@pytest.mark.long
def test_an_interrupted_benchmark_goes_on_to_the_same_bytes(whole: tuple[Path, Any], healthy: Path, tmp_path: Path):
    def interrupt(what: str, done: int, total: int) -> None:
        if what == "trials" and done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), listening(interrupt):
        run(small(), asked(healthy, second=other(healthy)), tmp_path / "cut")
    assert len(list((tmp_path / "cut" / "units").iterdir())) == 1 and not (tmp_path / "cut" / "result.json").exists()
    run(small(), asked(healthy, second=other(healthy)), tmp_path / "cut")
    assert content(tmp_path / "cut") == content(whole[0])


@pytest.mark.long
def test_a_killed_benchmark_goes_on_to_the_same_bytes(whole: tuple[Path, Any], healthy: Path, tmp_path: Path):
    """With two workers, killed once levels are written and units have begun to be."""
    begin = "import sys; from pathlib import Path; import test_benchmark_run as t; t.killed(*map(Path, sys.argv[1:]))"
    path = os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])
    command = [sys.executable, "-c", begin, str(healthy), str(tmp_path / "cut")]
    process = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, start_new_session=True)
    units = tmp_path / "cut" / "units"
    while process.poll() is None and not (units.is_dir() and len([*units.glob("0*.parquet")]) >= 1):
        time.sleep(0.02)
    assert process.poll() is None and not (tmp_path / "cut" / "result.json").exists()
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    run(small(), asked(healthy, second=other(healthy)), tmp_path / "cut")
    assert content(tmp_path / "cut") == content(whole[0])


def killed(healthy: Path, out: Path) -> None:
    """Run the benchmark of ``whole`` in a process of its own, slowly, so that it can be killed on its way."""
    with listening(lambda what, *_: time.sleep(1.0 if what == "trials" else 0.0)):
        run(small(), asked(healthy, second=other(healthy)), out, workers=2)


def test_every_trial_has_one_outcome_for_each_entrant_and_all_kinds_add_up(whole: tuple[Path, dict[str, Any]]):
    table = whole[1]["table"]
    for row in table:
        assert row["isolated"] + row["wrong channel"] + row["missed"] + row["prior"] == row["trials"]
    assert {row["reference"] for row in table} == set(STATES)
    one = [row for row in table if (row["reference"], row["faults"], row["manager"]) == ("as flown", 1, "cusum")]
    kinds, together = [row for row in one if row["kind"] != "all"], next(row for row in one if row["kind"] == "all")
    assert sum(row["isolated"] for row in kinds) == together["isolated"]
    assert together["trials"] == 4 * 2
    assert whole[1]["silent"] == ["median"]
    assert json.loads((whole[0] / "result.json").read_text())["table"] == table


def test_the_second_campaign_is_counted_for_those_that_can_fail_somebody(whole: tuple[Path, dict[str, Any]]):
    counted = {row["manager"]: row for row in whole[1]["second"]}
    assert set(counted) == {
        "cross-channel",
        "cross-channel tests",
        "cross-channel tests and sums",
        "cross-channel built-in",
        "cusum",
    }
    assert all(row["expected"] == pytest.approx(row["hours"]) for row in counted.values())  # one an hour


def test_another_benchmark_in_the_folder_is_refused_and_left_alone(
    whole: tuple[Path, Any], healthy: Path, tmp_path: Path
):
    out = shutil.copytree(whole[0], tmp_path / "copy")
    with pytest.raises(BadInput, match=r"--out .*: contains another benchmark: seed was 0, is 7"):
        run(small(), asked(healthy, second=other(healthy), seed=7), out)
    assert content(out) == content(whole[0])


@pytest.mark.long
def test_a_damaged_unit_is_named_with_its_remedy(whole: tuple[Path, Any], healthy: Path, tmp_path: Path):
    out = shutil.copytree(whole[0], tmp_path / "copy")
    unit = sorted((out / "units").iterdir())[1]
    first = (out / "units" / sorted((out / "units").iterdir())[0].name).read_bytes()
    flipped = bytearray(unit.read_bytes())
    flipped[len(flipped) // 3] ^= 4
    flown = next((out / "flights").iterdir()).read_bytes()
    for data in (b"no parquet", bytes(flipped), first, flown):
        unit.write_bytes(data)
        with pytest.raises(BadInput, match=rf"{unit.name}: (it has no|its bytes|it was written).*remove it"):
            run(small(), asked(healthy, second=other(healthy)), out)
    unit.unlink()
    run(small(), asked(healthy, second=other(healthy)), out)
    assert content(out) == content(whole[0])


@pytest.mark.parametrize("name", ["benchmark.json", "levels.json"])
def test_a_damaged_benchmark_or_its_edited_levels_are_refused_in_one_line(
    whole: tuple[Path, Any], healthy: Path, tmp_path: Path, name: str
):
    path = shutil.copytree(whole[0], tmp_path / "copy") / name
    data = path.read_text()
    at = data.index(": 0.") + 4 if name == "levels.json" else data.index('"trials": ') + 10
    edited = data[:at] + str((int(data[at]) + 1) % 10) + data[at + 1 :]  # one digit of a number
    for text in ("[1]", "{}", "1", "[" * 100_000, '{"a": 1e999}', edited):
        path.write_text(text)
        with pytest.raises(BadInput, match=rf"{name}|contains another benchmark") as error:
            run(small(), asked(healthy, second=other(healthy)), path.parent)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("left", ["lock", ".benchmark.json.0123abcd.part", ".levels.json.0123abcd.part"])
def test_a_folder_of_a_first_moment_is_a_benchmarks(tmp_path: Path, left: str):
    (tmp_path / left).touch()
    STUDY.require(tmp_path)


def test_what_is_not_a_benchmark_or_too_short_is_refused_before_anything_is_written(healthy: Path, tmp_path: Path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("x")
    with pytest.raises(BadInput, match="is not empty and not a benchmark's folder"):
        run(small(), asked(healthy), tmp_path / "full")
    for budget, said in (
        (1e-4, "is too short for 0.0001 false isolations an hour; record at least 100 h"),
        (0.0, "--budget"),
    ):
        with pytest.raises(BadInput, match=said):
            run(small(), Asked(entrants("cusum"), budget, healthy), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_the_command_prints_levels_the_table_and_where_ours_loses(
    whole: tuple[Path, Any], healthy: Path, tmp_path: Path
):
    command = [
        "benchmark",
        str(SMALL),
        "--managers",
        "cusum,median",
        "--budget",
        "1",
        "--healthy",
        str(healthy),
    ]
    command += ["--second", str(other(healthy)), "--out", str(whole[0]), "--trials", "4", "--workers", "1"]
    command += ["--flights", "2", "--plot", str(tmp_path / "benchmark.html")]
    shown = CliRunner().invoke(app, command)
    assert shown.exit_code == 0 and "calibrated to 1 false isolations per hour and signal, on 0.0167 h" in shown.output
    assert "microseconds per signal and frame" in shown.output and "flown in closed loop" in shown.output
    page = (tmp_path / "benchmark.html").read_text()
    assert "share isolated" in page and "median delay" in page and whole[1]["verdict"][0] in page
    assert "Calibrated to 1 false isolation an hour" in page
    drawn = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])
    lines = next(figure["data"] for name, figure in drawn.items() if "offset" in name)
    assert len({line["x"][0] for line in lines}) == len(lines)  # no interval lies on another
    data = json.loads(CliRunner().invoke(app, [*command, "--json"]).stdout)
    assert data["verdict"] == whole[1]["verdict"] and all(sentence in shown.output for sentence in data["verdict"])


def faulty(folder: Path, text: str) -> Path:
    path = folder / "campaign.toml"
    path.write_text(f'base = "f16_pitch_rate_hardover"\n{text}')
    return path


@pytest.mark.parametrize(
    ("options", "text", "said"),
    [
        ({"--budget": "1e-5"}, "", "is too short for 1e-05 false isolations an hour; record at least 1e+03 h"),
        ({"--budget": "nan"}, "", "--budget: nan false isolations an hour; must be a number above 0"),
        (
            {"--managers": "benchmark_flights:Nameless"},
            "",
            "calibrate = 'gain': the class has no number above 0 of this name",
        ),
        ({"--managers": "cross-channel"}, "", "--managers: name one or more besides cross-channel"),
        ({}, "[set]\nfaults = []\n", "no fault to detect"),
        ({}, '[set]\n"redundancy.signals.pitch_rate.equalise_bound" = 9.0\n', "equalise_bound: is gone: slow_tests"),
        ({"--plot": "benchmark.txt"}, "", "must end with .html"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    healthy: Path, tmp_path: Path, options: dict[str, str], text: str, said: str, rig_command: Any
):
    campaign = faulty(tmp_path, text) if text else SMALL
    given = {
        "--healthy": str(healthy),
        "--out": str(tmp_path / "out"),
        "--managers": "cusum",
        "--budget": "1",
        **options,
    }
    code, out, err = rig_command(
        "benchmark", str(campaign), "--json", *(word for pair in given.items() for word in pair)
    )
    assert (code, out, err.count("\n")) == (2, "", 1) and said in err and not (tmp_path / "out").exists()


def test_flights_that_calibrate_are_no_second_campaign(healthy: Path, tmp_path: Path):
    with pytest.raises(BadInput, match=r"--second: .*: the flights of --healthy; give others, of another seed"):
        run(small(), asked(healthy, second=healthy), tmp_path / "out")
    assert not (tmp_path / "out").exists()
