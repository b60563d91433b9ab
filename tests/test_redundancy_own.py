"""A manager of the user's own."""

from pathlib import Path

import numpy as np
import pytest

from rig import scenario
from rig.computer.redundancy.config import PARAMS
from rig.computer.redundancy.own import load_manager
from rig.errors import BadInput, ManagerFailed
from rig.frame import INDEX, new_block
from rig.loop import Rig, frames
from rig.trust import Trust

OWN = """
import numpy as np

class Median:
    def __init__(self, params):
        self.last = np.zeros(len(params))

    def step(self, block, k):
        row = block[k]
        use = np.where(row["valid"] == 1, row["channels"], np.nan)
        self.last[:] = np.nanmedian(use, axis=1)
        row["voted"][:] = self.last
        row["level"][:] = 4

class Mute:
    def __init__(self, params):
        pass

class Raising:
    def __init__(self, params):
        self.raises = ValueError("no median\\nof nothing")

    def step(self, block, k):
        raise self.raises

def interrupted(params):
    raise KeyboardInterrupt
"""
ALLOWED = Trust(allow_code=True)


def test_a_manager_of_the_users_own_flies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    which = scenario.load(None, ["duration_s=2", "faults.0.start_s=1", "redundancy.manager=own_manager:Median"])
    rows = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    q = rows["channels"][:, INDEX["pitch_rate"]]
    assert np.array_equal(rows["voted"][:, INDEX["pitch_rate"]], np.median(q, axis=1))
    assert (rows["discrete_level"] == 4).all() and rows["end"][-1] == 0


@pytest.mark.parametrize("name", ["nowhere:Class", "math:Nothing", "math:pi", "own_manager:Mute"])
def test_a_manager_that_cannot_be_made_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    which = scenario.load(None, [f"redundancy.manager={name}"])
    with pytest.raises(BadInput, match=r"redundancy.manager: "):
        Rig(which)


def test_what_a_manager_raises_names_class_frame_and_exception_in_one_line(tmp_path: Path, monkeypatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    block = new_block(2)
    block["frame"] = [40, 41]
    with pytest.raises(ManagerFailed) as caught:
        load_manager("own_manager:Raising", np.zeros(1, PARAMS), ALLOWED).step(block, 1)
    assert str(caught.value) == (
        "redundancy.manager: 'own_manager:Raising' raised in frame 41: ValueError: no median of nothing"
    )


def test_an_interrupt_ends_the_program_and_is_no_fault_of_the_manager(tmp_path: Path, monkeypatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        load_manager("own_manager:interrupted", np.zeros(1, PARAMS), ALLOWED)
    manager = load_manager("own_manager:Raising", np.zeros(1, PARAMS), ALLOWED)
    manager.made.raises = KeyboardInterrupt()  # type: ignore[attr-defined]
    with pytest.raises(KeyboardInterrupt):
        manager.step(new_block(1), 0)
