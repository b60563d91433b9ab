"""The design: regulators against known solutions, gains.toml against a fresh design."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.computer.control import gains_file as gains
from rig.core.errors import BadInput, RigError
from rig.design import backup_design as backup
from rig.design.backup_design import regulator
from rig.design.design_gains import design
from rig.design.loop_requirements import Requirements
from rig.world.plant import airframe

AIRCRAFT = Path(__file__).parent.parent / "aircraft"
NAMES = ("f16", "b747", "b737", "b707")


def test_the_regulator_of_a_double_integrator_is_the_known_one() -> None:
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    k = regulator(a, b, np.diag([1.0, 0.0]), np.eye(1))
    assert k[0] == pytest.approx([1.0, np.sqrt(2.0)], rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_one_point_designed_afresh_is_the_one_in_the_file(name: str) -> None:
    """Points are designed one by one, so one of them stands for the file; the file has them all."""
    config = airframe.read(AIRCRAFT / name / "aircraft.toml")
    written = gains.read(AIRCRAFT / name / "gains.toml")
    assert {point.name for point in written.points} == {point.name for point in config.flight_points}
    alone = config.model_copy(update={"flight_points": [config.point()]})
    fresh = design(alone)
    expected = next(point for point in written.points if point.name == config.point().name)
    for key, value in flat(fresh.points[0].model_dump()).items():
        written_value = flat(expected.model_dump())[key]
        if "margins" in key:  # found by bisection to 1e-3 dB or degrees; 40 and 120 mean "beyond"
            assert value == pytest.approx(written_value, rel=1e-6, abs=2e-3), key
        elif key == "name":
            assert value == written_value
        else:
            assert value == pytest.approx(written_value, rel=1e-9), key
    assert fresh.max_load_factor == pytest.approx(written.max_load_factor, rel=1e-9)
    assert fresh.max_alpha_rad == pytest.approx(written.max_alpha_rad, rel=1e-9)


def flat(data: dict[str, Any], prefix: str = "") -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in data.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
    return found


@pytest.mark.parametrize("name", NAMES)
def test_writing_and_reading_give_the_same_numbers_and_bytes(name: str, tmp_path: Path) -> None:
    written = gains.read(AIRCRAFT / name / "gains.toml")
    gains.write(written, tmp_path / "gains.toml")
    assert (tmp_path / "gains.toml").read_bytes() == (AIRCRAFT / name / "gains.toml").read_bytes()
    assert gains.read(tmp_path / "gains.toml") == written


def test_an_aircraft_that_only_moves_up_and_down_gets_no_lateral_law() -> None:
    """Aileron and rudder rest whatever roll, yaw and sideslip the sensors say."""
    point = gains.read(AIRCRAFT / "b707" / "gains.toml").points[0]
    lateral = [name for name in gains.COLUMNS if name.startswith(("aileron", "rudder", "roll_angle", "heading"))]
    assert len(lateral) == 9 and {getattr(point, name) for name in lateral} == {0.0}
    assert set(point.autopilot_margins) == {"elevator", "throttle"}
    assert point.max_roll_rate_rad_s > 0.0 and point.max_sideslip_rad > 0.0


@pytest.mark.long
def test_margins_out_of_reach_are_refused_with_the_point_and_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = backup.candidates()[:1]
    monkeypatch.setattr(backup, "candidates", lambda: slow)
    config = airframe.read(AIRCRAFT / "f16" / "aircraft.toml")
    alone = config.model_copy(update={"flight_points": [config.point("20000ft_m08")]})
    with pytest.raises(RigError, match=r"20000ft_m08: stick elevator phase \d+\.\d of 75 deg"):
        design(alone, Requirements(phase_margin_deg=75.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("[[points]]", "[points]", 1), "points|TOML|valid"),
        (lambda text: text.replace("rate_hz = 100.0", "rate_hz = -1.0"), "rate_hz"),
        (lambda text: text.replace("elevator_alpha =", "elevator_beta =", 1), "elevator"),
        (lambda text: text + text[text.index("[[points]]") :], "rising dynamic pressure"),
    ],
)
def test_a_gains_file_that_cannot_be_used_says_why(change: Callable[[str], str], message: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    path.write_text(change((AIRCRAFT / "f16" / "gains.toml").read_text()))
    with pytest.raises(BadInput, match=message):
        gains.read(path)
