"""A manager of the user's own."""

from pathlib import Path

import numpy as np
import pytest

from rig import scenario
from rig.errors import BadInput
from rig.frame import INDEX
from rig.loop import Rig, frames

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
"""


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
