"""What the tests share: rows of one signal through a manager, a quiet and short scenario."""

from __future__ import annotations

import fcntl
import functools
import gc
import os
import pickle
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from hypothesis import settings
from numpy.typing import NDArray

from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import Manager, vote_signals, with_settings
from rig.core.frame import CHANNELS, Block, State, nested, new_block
from rig.core.kernels import kernel

FEWER = float(os.environ.get("RIG_FEWER_EXAMPLES", "1"))  # a mutation run divides the number of examples by it
os.environ.pop("COLUMNS", None)  # workers of pytest have one: tables are as wide as in a pipe without it
# The first example may compile, on a busy machine.
settings.register_profile("rig", deadline=None, max_examples=max(1, round(100 / FEWER)))
settings.load_profile("rig")
typer.main.get_command = functools.cache(typer.main.get_command)  # the tree of commands is made once, not for each


@pytest.hookimpl(hookwrapper=True)
def pytest_xdist_auto_num_workers() -> Iterator[None]:
    """With ``-n auto`` one worker more than processors: a fifth of the tests' time is waiting for other processes."""
    outcome: Any = yield
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" not in os.environ:
        outcome.force_result(outcome.get_result() + 1)


def pytest_collection_finish() -> None:
    """Leave modules and collected tests out of every later garbage collection: they stay until the end."""
    gc.freeze()


@dataclass(frozen=True)
class Voted:
    """One signal of a block that went through a manager."""

    rows: Block
    signal: int = 0

    def __getattr__(self, name: str) -> NDArray[Any]:
        return self.rows[name][:, self.signal]

    def failed_at(self) -> list[int | None]:
        """The frame, counted from 1, in which each channel is first reported failed."""
        failed = self.state == State.FAILED
        return [int(np.argmax(column)) + 1 if column.any() else None for column in failed.T]


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], Any]], Any]:
    """once(name, make) -> what ``make`` returns and leaves in a folder, made by one worker of pytest for all."""
    base = tmp_path_factory.getbasetemp()
    shared = (base if "PYTEST_XDIST_WORKER" not in os.environ else base.parent) / "once"

    def made(name: str, make: Callable[[Path], Any]) -> Any:
        folder, value = shared / name, shared / f"{name}.pickle"
        shared.mkdir(exist_ok=True)
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not value.exists():
                shutil.rmtree(folder, ignore_errors=True)  # of one who failed
                folder.mkdir()
                value.write_bytes(pickle.dumps(make(folder)))
            return pickle.loads(value.read_bytes())

    return made


@pytest.fixture
def rig_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """rig_command(arguments of ``rig``) -> exit code, stdout, stderr; in a folder of its own.

    The line that kernels are compiled is left out: the first test that needs them would have it.
    """
    from rig.cli import main as cli  # not for the tests that need no command
    from rig.cli.working import COMPILING

    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rig", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out, said.err.replace(f"{COMPILING}\n", "")

    return run


@pytest.fixture
def rig(rig_command: Callable[..., tuple[int, str, str]]) -> Any:
    """rig(arguments of ``rig vote``) -> exit code, stdout, stderr; in a folder of its own."""
    return lambda *arguments: rig_command("vote", *arguments)


@pytest.fixture
def vote() -> Callable[..., Voted]:
    """vote(samples (n, 4), manager=..., reference=..., second=..., common=..., ilm=..., valid=..., **settings)."""
    return vote_samples


def vote_samples(
    samples: Any,
    *,
    manager: str = "cross-channel",
    reference: Any = None,
    second: Any = None,
    reference_airspeed_m_s: float = 0.0,
    second_threshold: float | None = None,
    common: tuple[int, bool] | None = None,
    ilm: Any = None,
    valid: Any = None,
    wraps: bool = False,
    limits: tuple[float, float] = (-1000.0, 1000.0),
    channels: int = CHANNELS,
    threshold: float = 1.0,
    resets: Any = (),
    lanes: Any = None,
    params: Any = (),
    told: dict[str, Any] | None = None,
    **settings: Any,
) -> Voted:
    """Run ``samples`` through a manager of one signal.

    lanes : (n, 4), which computers are failed; params : fields of PARAMS that no setting of a signal gives
    told : the manager's table in [redundancy.baselines]
    """
    samples, more = np.asarray(samples, float), dict(params)
    params = np.zeros(1, PARAMS)
    fill(params[0], SignalConfig(threshold=threshold, **settings), limits, channels, wraps, 100.0)
    params["reference_airspeed_m_s"] = reference_airspeed_m_s
    for name, value in more.items():
        params[name] = value
    block = new_block(len(samples))
    block["channels"][:, 0] = samples
    block["valid"][:, 0] = 1 if valid is None else valid
    block["ilm"][:, 0] = 2 if ilm is None else ilm
    block["reference"][:, 0] = np.nan if reference is None else reference
    block["second_reference"][:, 0] = np.nan if second is None else second
    if common is not None:  # frames, and whether the signal is lost then
        params["common_persistence"], params["common_fails"] = common
    if second_threshold is not None:
        params["second_threshold"] = second_threshold
    for frame, channel in resets:
        block["reset"][frame, 0] |= 1 << (channel - 1)
    if told is not None:
        params = with_settings(params, manager, Baselines.model_validate({manager.replace("-", "_"): told}))
    stage = Manager(manager, params)
    failed = np.zeros((len(samples), CHANNELS), np.uint8)
    failed[:] = 0 if lanes is None else lanes
    _vote_rows(nested(block), failed, stage.data)
    return Voted(block)


@kernel
def _vote_rows(rows, failed, data):
    """Vote every row; failed : (n, CHANNELS), which computers are."""
    for k in range(len(rows)):
        for c in range(CHANNELS):
            data.lanes[c] = failed[k, c]
        vote_signals(rows[k]["bus"], rows[k]["fcc"], data)


def constant(*values: float, frames: int = 30) -> NDArray[np.float64]:
    """The same four samples in every frame."""
    return np.tile(np.array(values, float), (frames, 1))


def rows(*stretches: tuple[int, Any]) -> NDArray[np.float64]:
    """Frames from (how many, the four samples or one value) stretches."""
    return np.concatenate([np.tile(np.array(value, float), (n, 1) if np.ndim(value) else n) for n, value in stretches])
