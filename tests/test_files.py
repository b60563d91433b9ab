"""Output files: whole or as before, never through a link, never two in one name."""

import os
import socket
from pathlib import Path

import pytest

from rig.core.errors import BadInput, RigError
from rig.core.files import draft, is_file, is_unused, new_folder, numbered, publish, replaced, sweep, write_text


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


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


@pytest.mark.parametrize(
    "target", ["/proc/self/fd/{fd}", "/dev/fd/{fd}", "/dev/null", "/dev/nothing", "fifo", "socket"]
)
@pytest.mark.parametrize("links", [1, 3])
def test_a_link_to_what_is_no_file_is_refused_and_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str, links: int
):
    """Also where the system says that a regular file is there: a descriptor whose output goes to one."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo("fifo")
    _socket(Path("socket"))
    with (tmp_path / "output").open("w") as output:
        led = target.format(fd=output.fileno())
        for number in range(links):
            Path(f"link{number}").symlink_to(led if number == 0 else f"link{number - 1}")
        path = tmp_path / f"link{links - 1}"
        with pytest.raises(BadInput, match="not a regular file") as error:
            write_text(path, "text")
        assert str(error.value).startswith(str(path)) and path.is_symlink()
        if target.startswith("/dev/fd"):
            with pytest.raises(BadInput, match="not a regular file"):
                write_text(Path(led), "text")
    assert (tmp_path / "output").read_text() == ""


def test_a_link_to_nothing_and_a_file_of_shared_memory_are_written(tmp_path: Path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    write_text(tmp_path / "link", "text")
    assert not (tmp_path / "link").is_symlink() and not (tmp_path / "nothing").exists()


DRAFTS = (".campaign.json.0123abcd.part", f".{'x' * 40}.00000000.part", ".levels.json.ffffffff.part")


@pytest.mark.parametrize("names", [(), ("lock",), *((name,) for name in DRAFTS), ("lock", *DRAFTS)])
def test_a_folder_that_a_kill_left_in_its_first_moment_is_unused(tmp_path: Path, names: tuple[str, ...]):
    for name in names:
        (tmp_path / name).write_text("" if name == "lock" else "half")
    assert is_unused(tmp_path) and is_unused(tmp_path / "new")
    sweep(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name for name in names if name == "lock"]


@pytest.mark.parametrize("name", ["a.txt", "locks", ".part", "a.0123abcd.part", ".a.0123abc.part", ".a.0123abcd.tmp"])
def test_a_folder_with_a_file_of_somebody_is_not_unused(tmp_path: Path, name: str):
    (tmp_path / name).write_text("")
    assert not is_unused(tmp_path) and not is_unused(tmp_path / name)
    sweep(tmp_path)
    assert (tmp_path / name).exists()


def test_a_file_with_text_a_link_and_a_folder_are_no_locks(tmp_path: Path):
    lock = tmp_path / "lock"
    lock.write_text("a key")
    assert not is_unused(tmp_path)
    lock.unlink()
    lock.mkdir()
    assert not is_unused(tmp_path)
    lock.rmdir()
    lock.symlink_to(os.devnull)
    assert not is_unused(tmp_path)


def test_drafts_of_other_files_are_not_swept_where_names_are_given(tmp_path: Path):
    for name in DRAFTS:
        (tmp_path / name).touch()
    sweep(tmp_path, "campaign.json", "x" * 60)
    assert [path.name for path in tmp_path.iterdir()] == [".levels.json.ffffffff.part"]
