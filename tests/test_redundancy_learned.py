"""The learned monitor of docs/examples/manager: in the loop, and what a burst does to its features."""

import importlib.util
import shutil
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import rig

EXAMPLES = Path("docs/examples/manager").resolve()


@pytest.fixture
def learned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    for name in ("learned.py", "learned.json"):
        shutil.copy(EXAMPLES / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    spec = importlib.util.spec_from_file_location("learned", tmp_path / "learned.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "learned", module)
    spec.loader.exec_module(module)
    return module


def test_it_fails_the_faulty_channel_of_a_flight_alone(learned: ModuleType, tmp_path: Path):
    sets = {"redundancy.manager": "learned:Learned", "duration_s": 3.0, "faults.0.start_s": 2.0}
    flight = rig.fly("f16_pitch_rate_hardover", overrides=sets, out=tmp_path / "logs")
    assert flight.survived and flight.failed == {"pitch_rate": [3]}


def test_a_burst_of_less_than_its_persistence_moves_no_mean(learned: ModuleType):
    rng = np.random.default_rng(1)
    with_burst, without = learned.Features(1), learned.Features(1)
    for k in range(300):
        residual = 0.02 * rng.standard_normal((1, 4))
        hit = residual.copy()
        if 200 <= k < 207:
            hit[0, 1] += 100.0
        after, plain = with_burst.update(hit), without.update(residual)
        if k >= 200:
            assert np.abs(after - plain)[..., 1:].max() < 0.02 and after[0, 1, 0] < 0.1
    faded = [with_burst.update(np.array([[0.0, 100.0, 0.0, 0.0]])) for _ in range(8)]
    assert faded[-1][0, 1, 0] == 3.0
