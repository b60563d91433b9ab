"""A user's own manager in ``rig vote``: the documented ones, and what they are given."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w
from conftest import constant

EXAMPLE, TUTORIAL = Path("docs/examples/manager/mine.py").resolve(), Path("docs/tutorials/own-voter.md").resolve()
OF_ALL = """
import numpy as np

class Counted:
    def __init__(self, params):
        assert len(params) == 16 and (params["fitted"] == params["fitted"][0]).all()

    def step(self, bus, fcc, k):
        assert bus[k]["channels"].shape == (16, 4) and fcc[k]["voted"].shape == (16,)
        assert (bus[k]["channels"] == bus[k]["channels"][0]).all()
        assert (bus[k]["valid"] == bus[k]["valid"][0]).all() and (bus[k]["ilm"] == bus[k]["ilm"][0]).all()
        assert np.isfinite(fcc[k]["reference"]).all() and (bus[k]["reset"] == bus[k]["reset"][0]).all()
        fcc[k]["voted"][:] = bus[k]["channels"][:, 0]
"""


@pytest.fixture
def documented(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the managers of the documentation into the folder of the command: ``mine`` and ``voter``."""
    classes = re.search(r'```python title="voter.py"\n(.*?)```', TUTORIAL.read_text(), re.DOTALL)
    assert classes is not None
    (tmp_path / "mine.py").write_text(EXAMPLE.read_text())
    (tmp_path / "voter.py").write_text(classes[1])
    for name in ("mine", "voter"):  # another test may have imported its own
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.fixture
def run(tmp_path: Path, rig: Any) -> Any:
    """run(columns, manager) -> the table written, the JSON printed."""

    def voted(columns: dict[str, Any], manager: str) -> tuple[pl.DataFrame, dict[str, Any]]:
        pl.DataFrame(columns).write_csv(tmp_path / "in.csv")
        settings: dict[str, Any] = {"default": {"threshold": 1.0, "manager": manager}}
        if "gear.1" in columns:
            settings["discrete"] = {"gear": {"fail_safe": 0}}
        (tmp_path / "c.toml").write_text(tomli_w.dumps(settings))
        code, out, said = rig("in.csv", "--config", "c.toml", "--out", "o.csv", "--json", "--allow-code")
        assert code == 0, said
        return pl.read_csv(tmp_path / "o.csv"), json.loads(out)

    return voted


def two_signals() -> dict[str, Any]:
    """Return x with four channels, of which the third is off, and y with three, beside a discrete."""
    samples = constant(0, 0.2, 50, 0.1)
    of_x = {f"x.{c + 1}": samples[:, c] for c in range(4)}
    of_y = {f"y.{c + 1}": np.full(30, 3.0 + 0.1 * c) for c in range(3)}
    of_gear = {f"gear.{c + 1}": np.ones(30) for c in range(4)}
    return {"time_s": np.arange(30) / 100, **of_x, **of_y, **of_gear}


def of_signal(name: str) -> dict[str, Any]:
    """Return one of the two signals alone."""
    return {key: cells for key, cells in two_signals().items() if key == "time_s" or key.startswith(f"{name}.")}


def failed(found: dict[str, Any]) -> dict[str, list[int]]:
    """Return the channels that are isolated at the end, by signal."""
    return {
        name: [channel["channel"] for channel in signal["channels"] if channel["state"] == "failed"]
        for name, signal in found["signals"].items()
    }


@pytest.mark.usefixtures("documented")
def test_the_shipped_class_votes_and_monitors_one_signal_several_and_beside_discretes(run: Any):
    assert failed(run(of_signal("x"), "mine:Smoothed")[1]) == {"x": [3]}
    table, found = run(two_signals(), "mine:Smoothed")
    assert failed(found) == {"x": [3], "y": []}
    assert table["x.voted"][-1] == pytest.approx(0.1) and (table["y.voted"] == 3.1).all()
    assert (table["y.level"] == 3).all() and (table["gear.voted"] == 1).all()


@pytest.mark.usefixtures("documented")
def test_the_class_of_the_tutorial_votes_one_signal_several_and_beside_discretes(run: Any):
    assert (run(of_signal("y"), "voter:Median")[0]["y.voted"] == 3.1).all()
    table, found = run(two_signals(), "voter:Median")
    assert failed(found) == {"x": [], "y": []}
    assert table["x.voted"].to_numpy() == pytest.approx(0.15) and (table["y.voted"] == 3.1).all()
    assert (table["y.level"] == 3).all() and (table["gear.voted"] == 1).all()


@pytest.mark.usefixtures("documented")
def test_the_shipped_function_votes_each_signal(run: Any):
    table, _ = run(two_signals(), "mine:first_valid")
    assert (table["x.voted"] == 0).all() and (table["y.voted"] == 3).all() and (table["y.level"] == 3).all()


def test_a_manager_is_given_as_many_signals_as_in_flight_each_with_the_samples(run: Any, tmp_path: Path):
    (tmp_path / "of_all.py").write_text(OF_ALL)
    flags = {f"x.ilm.{c}": np.arange(30) % 2 for c in range(1, 5)}
    run({**of_signal("x"), **flags, "x.ref": np.zeros(30)}, "of_all:Counted")
