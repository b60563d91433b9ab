"""A campaign's folder that was copied, cut, mixed or made by somebody else: one line, and what heals it."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.frame import SIGNALS
from rig.studies.campaign import table_parts as parts
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.campaign_page import report
from rig.studies.campaign.campaign_summary import by_rule, compare, headline
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.tables import OF, RUNS, TABLES, Rows

CAMPAIGN = """
base = "f16_pitch_rate_hardover"
runs = 6
[vary]
duration_s = [1.0, 2.0]
"""
FIRST = "000000-000002"


def rows(numbers: range) -> Rows:
    """The rows of a part: each run with one fault found; the second of a part also with an alarm and an episode."""
    counts = dict.fromkeys(("missed", "undetectable", "not_executed", "wrong_isolations"), 0)
    odd = {number: int(number % 3 == 1) for number in numbers}
    return {
        "runs": [
            {"run": n, "seed": n, "outcome": "flown", "detected": 1, "unresolved": odd[n], "false_alarms": odd[n]}
            | counts
            for n in numbers
        ],
        "faults": [{"run": n, "fault": 0, "channel": 1, "outcome": "detected"} for n in numbers],
        "alarms": [{"run": n, "signal": "pitch_rate", "channel": 2, "time_s": 0.5} for n in numbers if odd[n]],
        "episodes": [{"run": n, "begin_s": 0.5, "decided_by": "unresolved"} for n in numbers if odd[n]],
        "signals": [{"run": n, "signal": signal.name} for n in numbers for signal in SIGNALS],
    }


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six runs in two parts, written and not flown."""
    place = tmp_path_factory.mktemp("written")
    (place / "c.toml").write_text(CAMPAIGN)
    folder = Folder.of(place / "out", Plan(read(place / "c.toml"), "c.toml"))
    with folder.held():
        for numbers in (range(3), range(3, 6)):
            folder.write(rows(numbers))
    return place


@pytest.fixture
def out(written: Path, tmp_path: Path) -> Path:
    """A copy of them, with their campaign beside it."""
    return Path(shutil.copytree(written, tmp_path, dirs_exist_ok=True)) / "out"


def test_whole_parts_are_all_runs_once(out: Path):
    assert open_folder(out).done() == set(range(6))
    assert [len(frame) for frame in open_folder(out).tables.values()] == [6, 6, 2, 2, 6 * len(SIGNALS)]


def rewrite(path: Path, change: Callable[[pl.DataFrame], pl.DataFrame], place: str = "") -> None:
    """Change a table, under a new checksum; ``place``: that of another file."""
    of_file = pl.read_parquet_metadata(path)["place"]
    of_campaign, _ = of_file.split(" ")
    path.write_bytes(sealed.table(change(pl.read_parquet(path)), f"{of_campaign} {place}" if place else of_file))


def flip(path: Path, bit: int) -> None:
    data = bytearray(path.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    path.write_bytes(bytes(data))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def folder_there(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "is missing"),
    "cut": (cut, "its bytes were changed after it was written"),
    "empty": (empty, "it has no checksum"),
    "a bit": (lambda path: flip(path, 300), "its bytes were changed after it was written"),
    "without a checksum": (lambda path: pl.read_parquet(path).write_parquet(path), "it has no checksum"),
    "of another place": (
        lambda path: shutil.copy(path.with_name("000003-000005.parquet"), path),
        "it was written for another place",
    ),
    "a folder": (folder_there, "is not a file"),
    "a column renamed": (lambda path: rewrite(path, lambda f: f.rename({"run": "flight"})), "column 'run' is not"),
    "a column more": (lambda path: rewrite(path, lambda f: f.with_columns(more=1)), "column 'more' is not"),
    "a column of another type": (
        lambda path: rewrite(path, lambda f: f.cast({"run": pl.Int32})),
        "column 'run' is not",
    ),
    "no rows": (lambda path: rewrite(path, lambda f: f.clear()), "the rows do not match"),
    "other runs": (
        lambda path: rewrite(path, lambda f: f.with_columns(run=pl.lit(5, pl.Int64))),
        "the rows do not match",
    ),
    "rows twice": (lambda path: rewrite(path, lambda f: pl.concat([f, f])), "the rows do not match"),
}


@pytest.mark.parametrize("name", ["faults", "alarms", "episodes", "signals"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_part_is_named_and_flown_again_when_its_runs_are_removed(out: Path, name: str, damage: str):
    act, says = DAMAGES[damage]
    path = out / name / f"{FIRST}.parquet"
    act(path)
    with pytest.raises(BadInput) as error:
        open_folder(out).done()
    said = str(error.value)
    assert said.startswith(f"{path}: {says}") and "\n" not in said and len(said) < 600
    heal = f"rm {out}/runs/{FIRST}.parquet && rig campaign run FILE --out {out}"
    if damage == "a folder":
        heal = heal.replace("rm ", "rm -r ").replace(" &&", f" {path} &&")
        path.rmdir()
    assert said.endswith(f"; to fly its runs again: {heal}")
    (out / "runs" / f"{FIRST}.parquet").unlink()
    folder = open_folder(out)
    with folder.held():
        assert folder.done() == {3, 4, 5}
        folder.write(rows(range(3)))
    assert open_folder(out).done() == set(range(6))


@pytest.mark.parametrize("damage", ["cut", "empty", "a bit", "a folder", "a column renamed"])
def test_a_damaged_part_of_runs_is_named(out: Path, damage: str):
    act, says = DAMAGES[damage]
    path = out / "runs" / f"{FIRST}.parquet"
    act(path)
    with pytest.raises(BadInput, match=f"{FIRST}.parquet: {says}") as error:
        open_folder(out).done()
    assert f"rm {'-r ' if path.is_dir() else ''}{path} &&" in str(error.value)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_number_that_is_not_finite_is_named_and_one_that_is_absent_is_not(out: Path, value: float):
    part = out / "alarms" / f"{FIRST}.parquet"
    rewrite(part, lambda frame: frame.with_columns(time_s=pl.lit(None, pl.Float64)))
    assert open_folder(out).done() == set(range(6))
    rewrite(part, lambda frame: frame.with_columns(time_s=pl.lit(value)))
    with pytest.raises(BadInput, match="a number is not finite"):
        open_folder(out).done()


def test_a_part_of_a_version_without_these_columns_has_none_and_the_same_hash(out: Path):
    path, table_sha256 = out / "runs" / f"{FIRST}.parquet", open_folder(out).status()["table_sha256"]
    added = [name for table in OF.values() for name, column in table.columns.items() if column.added]
    rewrite(path, lambda frame: frame.drop(added, strict=False))
    assert all(open_folder(out).tables["runs"][name].null_count() == 6 for name in added if name in RUNS)
    assert open_folder(out).status()["table_sha256"] == table_sha256
    assert headline(open_folder(out).tables)["failed_with_box"] == 0


def test_channels_that_a_rule_failed_are_counted_with_the_alarms_and_blame_no_rule(out: Path):
    box = rows(range(3))
    box["runs"][0] |= {"failed_with_box": 2}
    alarm = {"run": 0, "kind": "failed with its box", "channel": 2, "time_s": 0.5, "decided_by": "box"}
    box["alarms"] += [{**alarm, "signal": name} for name in ("heading", "pitch_rate")]
    for name in TABLES:
        (out / name / f"{FIRST}.parquet").unlink()
    open_folder(out).write(box)
    tables = open_folder(out).tables
    assert headline(tables)["failed_with_box"] == 2 and headline(tables)["false_alarms"]["count"] == 2
    assert not any(row["decided_by"] == "box" for row in by_rule(tables))


def test_reply_times_that_are_not_in_these_bins_are_named(out: Path):
    path = out / "runs" / f"{FIRST}.parquet"
    rewrite(path, lambda frame: frame.with_columns(pl.Series("replies", [[1, 2]] * 3)))
    with pytest.raises(BadInput, match="reply times have other bins than this version"):
        _ = open_folder(out).tables


def test_a_part_copied_under_another_name_is_not_counted_but_named(out: Path):
    for name in ("runs", "faults", "alarms", "episodes", "signals"):
        shutil.copy(out / name / f"{FIRST}.parquet", out / name / "copy.parquet")
    said = f"copy.parquet: it was written for another place, so it is a copy.*rm {out}/runs/copy"
    with pytest.raises(BadInput, match=said):
        open_folder(out).done()
    (out / "runs" / "copy.parquet").unlink()
    folder = open_folder(out)
    with folder.held():
        assert folder.done() == set(range(6))
    assert not list(out.glob("*/copy.parquet"))


def test_parts_that_overlap_and_runs_that_are_none_of_the_campaigns_are_named(out: Path, tmp_path: Path):
    folder = open_folder(out)
    folder.write(rows(range(2, 4)))
    with pytest.raises(BadInput, match=r"000002-000003.parquet: run 2 is also in runs/000000-000002.parquet"):
        folder.done()
    (out / "runs" / "000002-000003.parquet").unlink()
    for name in ("runs", "faults", "alarms", "episodes", "signals"):
        beyond = Path(shutil.copy(out / name / f"{FIRST}.parquet", out / name / "000006-000008.parquet"))
        rewrite(beyond, lambda frame: frame.with_columns(run=pl.col("run") + 6), f"{name}/{beyond.name}")
    with pytest.raises(BadInput, match=r"000006-000008.parquet: a run is twice there, or not one of the campaign's 6"):
        folder.done()


@pytest.mark.parametrize("left", ["lock", ".campaign.json.0123abcd.part", ".worst.toml.0123abcd.part"])
def test_a_folder_that_a_kill_left_in_its_first_moment_is_flown_into(tmp_path: Path, left: str):
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / left).touch()
    folder = Folder.of(tmp_path / "out", Plan(read(tmp_path / "c.toml"), "c.toml"))
    with folder.held():
        folder.write(rows(range(3)))
    assert not list(tmp_path.rglob("*.part")) and open_folder(folder.path).done() == {0, 1, 2}


def test_a_part_of_another_campaign_is_refused(out: Path, tmp_path: Path):
    other = Folder.of(tmp_path / "other", Plan(read(tmp_path / "c.toml").model_copy(update={"seed": 5}), "c.toml"))
    with other.held():
        other.write(rows(range(3)))
    shutil.copy(other.path / "faults" / f"{FIRST}.parquet", out / "faults" / f"{FIRST}.parquet")
    with pytest.raises(BadInput, match="it was written for another place, so it is a copy"):
        open_folder(out).done()


def test_a_campaign_of_an_earlier_version_is_read_with_a_note_and_not_flown_into(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    table_sha256 = open_folder(out).status()["table_sha256"]
    about = json.loads((out / "campaign.json").read_text())
    del about["seal"], about["place"]
    (out / "campaign.json").write_text(json.dumps({**about, "format": 1}))
    for path in out.rglob("*.parquet"):
        pl.read_parquet(path).write_parquet(path)
    assert open_folder(out).status()["table_sha256"] == table_sha256
    assert "its tables have no checksum" in " ".join(capsys.readouterr().err.split())
    with pytest.raises(BadInput, match="was flown by an earlier version of rig; choose another folder"):
        Folder.of(out, Plan(read(tmp_path / "c.toml"), "c.toml"))


def test_every_command_that_reads_the_tables_says_the_same(out: Path, tmp_path: Path):
    (out / "faults" / f"{FIRST}.parquet").unlink()
    shutil.copytree(out, tmp_path / "other")
    acts: list[Callable[[], object]] = [
        lambda: open_folder(out).status(),
        lambda: report(open_folder(out), tmp_path / "r.html"),
        lambda: compare(open_folder(out), open_folder(tmp_path / "other")),
    ]
    for act in acts:
        with pytest.raises(BadInput, match=f"faults/{FIRST}.parquet: is missing"):
            act()
    assert not (tmp_path / "r.html").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "cannot be read"),
        ("5", "is damaged: it is not a table"),
        ('{"format": 2, "campaign": {}}', "is damaged: it has no checksum"),
        ('{"format": 1}', "is damaged: it has no table 'campaign'"),
        ('{"format": 1, "campaign": 5}', "is damaged: it has no table 'campaign'"),
        ('{"format": 1, "campaign": {}}', "base: missing"),
        ('{"format": 1, "campaign": {"base": {}, "vary": 5}}', "vary: must be a table"),
        ('{"format": 9, "campaign": {}}', "not of this version"),
        ("[" * 100_000, "cannot be read"),
    ],
)
def test_a_campaign_json_that_is_damaged_is_said_in_one_line(out: Path, text: str, says: str):
    (out / "campaign.json").write_text(text)
    with pytest.raises(BadInput, match=says) as error:
        open_folder(out)
    assert "campaign.json" in str(error.value) and "\n" not in str(error.value)


def test_a_lock_that_is_a_link_is_refused_and_its_target_keeps_its_text(out: Path, tmp_path: Path):
    precious = tmp_path / "precious"
    precious.write_text("precious")
    (out / "lock").unlink()
    (out / "lock").symlink_to(precious)
    with pytest.raises(BadInput, match="lock: is a link and is not followed"), open_folder(out).held():
        pass
    (out / "lock").unlink()
    os.link(precious, out / "lock")
    with open_folder(out).held():
        pass
    assert precious.read_text() == "precious"


def test_only_drafts_and_orphans_are_swept_and_nothing_behind_a_link(out: Path, tmp_path: Path):
    stays = [out / "faults" / "notes.txt", out / "faults" / "folder" / "a.parquet", out / "logs" / "run_000001.mcap"]
    goes = [out / "runs" / ".x.1234.part", out / "runs" / "x.tmp", out / "faults" / "orphan.parquet"]
    goes.append(out / "logs" / ".run_000001.mcap.1234.part")
    (out / "runs" / "y.tmp").mkdir()
    for path in (*stays, *goes):
        path.parent.mkdir(exist_ok=True)
        path.write_text("text")
    with open_folder(out).held():
        assert all(path.exists() for path in stays) and not any(path.exists() for path in goes)
    shutil.move(out / "alarms", tmp_path / "elsewhere")
    (tmp_path / "elsewhere" / "mine.parquet").write_text("mine")
    (out / "alarms").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BadInput, match="alarms: is a link"), open_folder(out).held():
        pass
    assert (tmp_path / "elsewhere" / "mine.parquet").exists()


def test_the_name_of_a_part_is_that_of_its_first_and_last_run():
    assert parts.name_of([7, 3, 12]) == "000003-000012"
