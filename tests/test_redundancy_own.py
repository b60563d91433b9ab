"""A manager of the user's own."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.own import load_manager
from rig.core.errors import BadInput, ManagerFailed
from rig.core.frame import INDEX, SIGNALS, Block, Source, State, nested, new_block
from rig.core.trust import Trust
from rig.flight.loop import Rig, fly_rows, frames
from rig.scenario import scenario

OWN = """
import numpy as np

class Median:
    def __init__(self, params):
        self.last = np.zeros(len(params))

    def step(self, bus, fcc, k):
        use = np.where(bus[k]["valid"] == 1, bus[k]["channels"], np.nan)
        self.last[:] = np.nanmedian(use, axis=1)
        fcc[k]["voted"][:] = self.last
        fcc[k]["level"][:] = 4

class Former:
    def __init__(self, params):
        pass

    def step(self, block, k):
        pass

class Mute:
    def __init__(self, params):
        pass

class Raising:
    raises = ValueError("no median\\nof nothing")

    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        raise self.raises

class Exiting:
    def __init__(self, params):
        raise SystemExit("enough")

class Interrupted:
    def __init__(self, params):
        raise KeyboardInterrupt
"""
COMPILED = """
import numba
import numpy as np

STATE = np.dtype([("vote", "f8"), ("frames", "i8")])

def first_valid(bus, fcc, k, params, state):
    for s in range(len(params)):
        for c in range(params[s]["fitted"]):
            if bus[k]["valid"][s, c] != 0:
                state[s]["vote"] = bus[k]["channels"][s, c]
                break
        state[s]["frames"] += 1
        fcc[k]["voted"][s] = state[s]["vote"]
        fcc[k]["level"][s] = params[s]["fitted"]
        fcc[k]["trend_low"][s] = state[s]["frames"] % 100

vote = numba.njit(first_valid)

@numba.njit
def raising(bus, fcc, k, params, state):
    fcc[k]["voted"][0] = 0.0
    if k == 3:
        raise ValueError("compiled")

@numba.njit
def unknown_field(bus, fcc, k, params, state):
    fcc[k]["truth"][0] = 1.0
"""
FRAMES = """
import numba
import numpy as np

class Counting:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k, frame):
        fcc[k]["voted"][:] = bus[k]["channels"][:, 0]
        fcc[k]["level"][:] = 4
        fcc[k]["trend_high"][:] = frame // 100
        fcc[k]["trend_low"][:] = frame % 100

@numba.njit
def counting(bus, fcc, k, params, state, frame):
    fcc[k]["voted"][:] = bus[k]["channels"][:, 0]
    fcc[k]["level"][:] = 4
    fcc[k]["trend_high"][:] = frame // 100
    fcc[k]["trend_low"][:] = frame % 100

class Votes:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        fcc[k]["voted"][:] = bus[k]["channels"][:, 0]

@numba.njit
def votes(bus, fcc, k, params, state):
    fcc[k]["voted"][:] = bus[k]["channels"][:, 0]

class Silent(Votes):
    def step(self, bus, fcc, k):
        fcc[k]["level"][:] = 4

class Failing(Votes):
    def step(self, bus, fcc, k):
        fcc[k]["state"][:] = 2

class Half(Votes):
    def step(self, bus, fcc, k):
        row = fcc[k]
        row["voted"][:] = bus[k]["channels"][:, 0]
        row["level"][0] = 2
        row["level"][1] = 0
        row["state"][2, 1] = 2
        row["level"][3], row["state"][3] = 0, 0
        row["voted"][4] = bus[k]["channels"][4, 0] if k % 2 else np.nan
"""
FORGETFUL = """
import numpy as np

class Forgetful:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k, frame):
        some = np.arange(16) != (5 if frame % 50 == 49 else 16)
        fcc[k]["voted"][some] = bus[k]["channels"][some, 0]
"""
ALLOWED = Trust(allow_code=True)


def parts(block: Block) -> tuple[Any, Any]:
    return nested(block)["bus"], nested(block)["fcc"]


def test_a_manager_of_the_users_own_flies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    which = scenario.load(None, ["duration_s=2", "faults.0.start_s=1", "redundancy.manager=own_manager:Median"])
    rows = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    q = rows["channels"][:, INDEX["pitch_rate"]]
    assert np.array_equal(rows["voted"][:, INDEX["pitch_rate"]], np.median(q, axis=1))
    assert (rows["discrete_level"] == 4).all() and rows["end"][-1] == 0


@pytest.mark.parametrize(
    "name",
    ["nowhere:Class", "math:Nothing", "math:pi", "own_manager:Mute", "own_manager:Former", "own_manager:Exiting"],
)
def test_a_manager_that_cannot_be_made_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    which = scenario.load(None, [f"redundancy.manager={name}"])
    with pytest.raises(BadInput, match=r"redundancy.manager: "):
        Rig(which)


def test_a_class_of_the_former_form_is_told_the_present_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match=r"has step\(block, k\), expected step\(bus, fcc, k\)$"):
        load_manager("own_manager:Former", np.zeros(1, PARAMS), ALLOWED)


def rows_of(*sets: str) -> Block:
    which = scenario.load(None, ["duration_s=2.5", "faults.0.start_s=1", *sets])
    return fly_rows(which)


def test_a_compiled_function_flies_as_its_python_form_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "compiled_manager.py").write_text(COMPILED)
    monkeypatch.chdir(tmp_path)
    compiled, plain = (rows_of(f"redundancy.manager=compiled_manager:{name}") for name in ("vote", "first_valid"))
    assert np.array_equal(compiled["voted"], compiled["channels"][:, :, 0])
    assert compiled["trend_low"][:, 0].tolist() == [(k + 1) % 100 for k in range(250)]  # its state is its own, and kept
    assert compiled.tobytes() == plain.tobytes()


def test_what_a_compiled_function_raises_names_it_and_the_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "compiled_manager.py").write_text(COMPILED)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ManagerFailed, match=r"'compiled_manager:raising' raised in frame 3: ValueError: compiled"):
        rows_of("redundancy.manager=compiled_manager:raising")


@pytest.mark.parametrize("name", ["Counting", "counting"])
def test_who_takes_a_frame_is_given_its_number_and_not_the_row_of_the_block(name: str, tmp_path: Path, monkeypatch):
    (tmp_path / "frame_manager.py").write_text(FRAMES)
    monkeypatch.chdir(tmp_path)
    flown = rows_of(f"redundancy.manager=frame_manager:{name}")
    assert (100 * flown["trend_high"][:, 0] + flown["trend_low"][:, 0]).tolist() == list(range(250))


def test_a_manager_that_writes_no_vote_is_told_so_in_its_first_frame(tmp_path: Path, monkeypatch):
    (tmp_path / "frame_manager.py").write_text(FRAMES)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        ManagerFailed, match=r"'frame_manager:Silent' wrote no vote in frame 0: of every signal it must"
    ):
        rows_of("redundancy.manager=frame_manager:Silent")
    assert (rows_of("redundancy.manager=frame_manager:Failing")["level"] == 0).all()  # it says so itself


@pytest.mark.parametrize("name", ["Votes", "votes"])
def test_a_manager_that_writes_votes_alone_has_all_channels_in_use(name: str, tmp_path: Path, monkeypatch):
    """In blocks whose memory is used again, and on an aircraft with fewer channels."""
    (tmp_path / "frame_manager.py").write_text(FRAMES)
    monkeypatch.chdir(tmp_path)
    which = scenario.load(
        None,
        ["duration_s=3.5", "faults=[]", f"redundancy.manager=frame_manager:{name}", "sensors.pitch_rate.channels=2"],
    )
    rows = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    assert (rows["level"] == [2] + [4] * 15).all() and (rows["source"] == Source.VOTED).all()
    assert (rows["state"][:, 0] == [State.OK, State.OK, State.ABSENT, State.ABSENT]).all()
    assert (rows["state"][:, 1:] == State.OK).all() and np.array_equal(rows["voted"], rows["channels"][:, :, 0])


def test_what_a_manager_leaves_out_follows_from_what_it_writes(tmp_path: Path, monkeypatch):
    (tmp_path / "frame_manager.py").write_text(FRAMES)
    monkeypatch.chdir(tmp_path)
    rows = rows_of("redundancy.manager=frame_manager:Half")
    level, state = rows["level"], rows["state"]
    ok, failed = [State.OK] * 4, [State.FAILED] * 4
    assert (level[:, :6] == [2, 0, 3, 0, 4, 4]).all()
    assert (state[:, 0] == ok).all() and (state[:, 1] == failed).all() and (state[:, 3] == ok).all()
    assert (state[:, 2] == [State.OK, State.FAILED, State.OK, State.OK]).all()
    assert (rows["source"][:, :6] == [0, Source.DEGRADED, 0, Source.DEGRADED, 0, 0]).all()
    assert np.isnan(rows["voted"][::2, 4]).all() and np.isfinite(rows["voted"][1::2, 4]).all()


def test_what_it_does_not_write_is_not_what_the_memory_of_its_row_held(tmp_path: Path, monkeypatch):
    (tmp_path / "frame_manager.py").write_text(FRAMES)
    monkeypatch.chdir(tmp_path)
    block, fresh = new_block(2), new_block(2)
    block.view(np.uint8)[:] = 3
    for rows in (block, fresh):
        rows["frame"], rows["channels"], rows["valid"] = 0, 1.5, 1
        params = np.zeros(len(SIGNALS), PARAMS)
        params["fitted"] = 4
        load_manager("frame_manager:Votes", params, ALLOWED).step(rows, *parts(rows), 1)
    answers = ("voted", "state", "level", "pattern", "decided_by", "reference_usable", "common_mode")
    for name in (*answers, "trend_high", "trend_low"):
        assert block[name][1].tobytes() == fresh[name][1].tobytes(), name


def test_of_a_signal_that_a_manager_leaves_out_nothing_is_known(tmp_path: Path, monkeypatch):
    (tmp_path / "forgetful_manager.py").write_text(FORGETFUL)
    monkeypatch.chdir(tmp_path)
    rows = rows_of("redundancy.manager=forgetful_manager:Forgetful")
    left_out = np.arange(250) % 50 == 49
    assert np.array_equal(np.isnan(rows["voted"][:, 5]), left_out)
    assert np.array_equal(rows["level"][:, 5] == 0, left_out)
    assert (rows["state"][left_out, 5] == State.ABSENT).all() and (rows["state"][~left_out, 5] == State.OK).all()


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_a_function_that_reaches_for_the_truth_does_not_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "compiled_manager.py").write_text(COMPILED)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match=r"^redundancy.manager: 'compiled_manager:unknown_field' cannot be made: "):
        load_manager("compiled_manager:unknown_field", np.zeros(2, PARAMS), ALLOWED)


def test_what_a_manager_raises_names_class_frame_and_exception_in_one_line(tmp_path: Path, monkeypatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    block = new_block(2)
    block["frame"] = [40, 41]
    with pytest.raises(ManagerFailed) as caught:
        load_manager("own_manager:Raising", np.zeros(1, PARAMS), ALLOWED).step(block, *parts(block), 1)
    assert str(caught.value) == (
        "redundancy.manager: 'own_manager:Raising' raised in frame 41: ValueError: no median of nothing"
    )


def test_an_interrupt_ends_the_program_and_is_no_fault_of_the_manager(tmp_path: Path, monkeypatch):
    (tmp_path / "own_manager.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        load_manager("own_manager:Interrupted", np.zeros(1, PARAMS), ALLOWED)
    manager = load_manager("own_manager:Raising", np.zeros(1, PARAMS), ALLOWED)
    import own_manager  # pyright: ignore[reportMissingImports]  # of the test's own folder

    monkeypatch.setattr(own_manager.Raising, "raises", KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        manager.step(new_block(1), *parts(new_block(1)), 0)
