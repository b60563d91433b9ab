"""Output files: whole or as before, never through a link, never two in one name."""

import os
from pathlib import Path

import pytest

from rig.errors import BadInput, RigError
from rig.util.files import draft, is_file, new_folder, numbered, publish, replaced, write_text


def test_a_file_is_there_only_when_its_block_ended_well(tmp_path: Path):
    path = tmp_path / "o.csv"
    with replaced(path) as made:
        made.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]
    for error in (ValueError, KeyboardInterrupt, SystemExit):
        with pytest.raises(error), replaced(path) as made:
            made.write_text("half")
            raise error
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_two_drafts_of_one_file_are_two_files(tmp_path: Path):
    with draft(tmp_path / "a") as one, draft(tmp_path / "a") as two:
        assert one != two and one.exists() and two.exists()
    assert list(tmp_path.iterdir()) == []


def test_a_link_is_replaced_and_not_followed(tmp_path: Path):
    precious, link = tmp_path / "precious", tmp_path / "report.html"
    precious.write_text("precious")
    link.symlink_to(precious)
    write_text(link, "page")
    assert precious.read_text() == "precious" and link.read_text() == "page" and not link.is_symlink()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("folder", "is a folder"),
        ("missing/o.csv", "no such folder"),
        ("pipe", "not a regular file"),
        ("n" * 256, "File name too long"),
        ("a\0b", "null byte"),
    ],
)
def test_what_cannot_be_a_file_is_refused_before_anything_is_done(tmp_path: Path, name: str, says: str):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(BadInput, match=says), draft(tmp_path / name):
        raise AssertionError("the block was entered")
    assert sorted(tmp_path.rglob("*")) == before
    assert not is_file(tmp_path / name)


def test_a_name_of_255_bytes_can_be_written(tmp_path: Path):
    for path in (tmp_path / ("n" * 255), tmp_path / ("\N{GREEK SMALL LETTER ALPHA}" * 127)):
        write_text(path, "text")
        assert path.read_text() == "text"


def test_a_folder_that_is_deleted_meanwhile_is_said(tmp_path: Path):
    (tmp_path / "out").mkdir()
    with (
        pytest.raises(RigError, match=r"o.csv: cannot be written: No such file"),
        replaced(tmp_path / "out" / "o.csv") as made,
    ):
        made.unlink()
        (tmp_path / "out").rmdir()


def test_a_draft_takes_the_next_number_that_is_free_also_when_somebody_was_faster(tmp_path: Path):
    (tmp_path / "a.x").write_text("first")
    (tmp_path / "a_2.x").symlink_to("nowhere")
    names = numbered(tmp_path, "a", ".x")
    third = next(names)
    assert third == tmp_path / "a_3.x"
    third.write_text("of somebody who was faster")
    with draft(third) as made:
        made.write_text("mine")
        assert publish(made, [third, *(next(names) for _ in range(1))]) == tmp_path / "a_4.x"
    assert (tmp_path / "a_4.x").read_text() == "mine" and third.read_text() == "of somebody who was faster"


def test_a_new_folder_goes_when_its_block_fails_and_stays_with_what_others_put_there(tmp_path: Path):
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a" / "b"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a" / "b"):
        (tmp_path / "a" / "theirs").touch()
        raise RuntimeError
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["theirs"]
    with new_folder(tmp_path / "a" / "c"):
        pass
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a" / "c"):
        raise RuntimeError
    assert (tmp_path / "a" / "c").is_dir()
