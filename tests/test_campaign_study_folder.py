"""The folder of a study: begun, gone on with, refused; also where another command was faster."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rig.core.errors import BadInput
from rig.studies.campaign import study_folder
from rig.studies.campaign.study_folder import Study, write_whole

STUDY = Study("asked.json", "a study's folder", "another study", "rig study is writing", "remove it")
ABOUT = {"format": 2, "seed": 1, "keys": {"a": [1, 2]}}


def test_a_folder_is_begun_once_and_gone_on_with_where_the_same_is_asked(tmp_path: Path):
    for _ in range(2):
        with STUDY.held(tmp_path / "s", ABOUT):
            assert STUDY.read(tmp_path / "s") == ABOUT
    with pytest.raises(
        BadInput, match=r"--out .*s: contains another study: keys.a.1 was 2, is 3; choose another folder or delete it"
    ):
        STUDY.require(tmp_path / "s", {**ABOUT, "keys": {"a": [1, 3]}})


def test_a_folder_of_something_else_is_refused_and_left_as_it_is(tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    held = STUDY.held(tmp_path, ABOUT)
    with pytest.raises(BadInput, match="is not empty and not a study's folder"), held:
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_study_that_another_command_began_meanwhile_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    locked = study_folder.locked

    @contextmanager
    def late(folder: Path, busy: str) -> Iterator[None]:
        with locked(folder, busy):
            write_whole(folder / STUDY.mark, STUDY.written({**ABOUT, "seed": 2}))
            yield

    monkeypatch.setattr(study_folder, "locked", late)
    held = STUDY.held(tmp_path, ABOUT)
    with pytest.raises(BadInput, match="contains another study: seed was 2, is 1"), held:
        pass


def test_drafts_of_a_begun_folder_are_swept_those_of_others_only_where_none_are_named(tmp_path: Path):
    drafts = [tmp_path / f".{name}.0123abcd.part" for name in ("asked.json", "page.html")]
    named = Study(STUDY.mark, STUDY.folder, STUDY.other, STUDY.busy, beside=("search.json",))
    for study, left in ((named, []), (named, [drafts[1]]), (STUDY, [])):  # the first begins it
        for draft in drafts:
            draft.write_text("half")
        with study.held(tmp_path, ABOUT):
            pass
        assert [draft for draft in drafts if draft.exists()] == left
