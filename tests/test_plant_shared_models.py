"""A model that one flight hands on to the next: the frames are those of a model that was loaded for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from one_stage import fly, hold

from rig.core.frame import Block
from rig.world.plant import airframe, jsbsim, loading, shared_models, wind

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
PLANES = {name: airframe.read(AIRCRAFT / name / "aircraft.toml") for name in ("f16", "b747", "b737")}
POINTS = [  # the first of each aircraft in the quick tests
    pytest.param(name, point.name, marks=[pytest.mark.long] if i else [])
    for name, plane in PLANES.items()
    for i, point in enumerate(plane.flight_points)
]
GUSTY = wind.Config(gusts=[wind.Gust(start_s=0.5, duration_s=1.0, north_m_s=5.0, down_m_s=3.0)])


@pytest.fixture(autouse=True)
def none_wait() -> Iterator[None]:
    """No test begins on a model of another, or of a flight in another file."""
    shared_models._waiting.clear()
    shared_models._alike.clear()
    yield
    shared_models._waiting.clear()
    shared_models._alike.clear()


def plant(name: str, point: str | None = None, air: wind.Config | None = None, **given: object) -> jsbsim.Plant:
    plane = PLANES[name]
    settings = (plane.point(point), air or wind.Config(), given.get("turbulence", "none"), 100.0, 1, 1)
    return jsbsim.Plant(plane, *settings)  # pyright: ignore[reportArgumentType]


def flown(flying: jsbsim.Plant, frames: int = 150) -> Block:
    """Fly with all four controls moved from frame to frame."""
    k = np.arange(frames)
    return fly(flying, hold(flying, frames) + 0.01 * np.stack([k % 9 - 4, k % 7 - 3, k % 5 - 2, k % 3 - 1], axis=1))


def loads(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Return a list that grows by one when a model is loaded."""
    made: list[object] = []

    def load(*given: object) -> object:
        made.append(given)
        return loading.load(*given)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(shared_models, "load", load)
    return made


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_a_shared_model_gives_the_frames_of_a_fresh_one(name: str, point: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fresh = flown(plant(name, point)).tobytes()
    made = loads(monkeypatch)
    for _ in range(4):
        flying = plant(name, point, GUSTY)
        flown(flying)
        flying.give_back()
        again = plant(name, point)
        assert flown(again).tobytes() == fresh
        again.give_back()
    assert len(made) == 3  # the first, one to compare with, and the one that was then flown


def test_a_model_that_was_in_turbulence_is_not_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    made = loads(monkeypatch)
    for _ in range(3):
        flying = plant("f16", turbulence="light")
        flown(flying)
        flying.give_back()
    assert len(made) == 3


def test_a_model_that_begins_with_other_frames_is_not_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    made = loads(monkeypatch)

    def another(fdm: object, plane: airframe.Config) -> bool:
        done = loading.begin_again(fdm, plane)  # pyright: ignore[reportArgumentType]
        fdm["fcs/throttle-cmd-norm"] *= 1.0 + 1e-15  # pyright: ignore[reportIndexIssue]
        return done

    monkeypatch.setattr(shared_models, "begin_again", another)
    fresh = flown(plant("f16")).tobytes()
    for _ in range(3):
        flying = plant("f16")
        assert flown(flying).tobytes() == fresh
        flying.give_back()
    assert len(made) == 1 + 3 + 1  # one more to compare with


def test_only_so_many_models_wait() -> None:
    plane = loading.jsbsim_airframe(PLANES["f16"])
    steps = np.linspace(0.005, 0.01, shared_models.MOST + 2)
    for step in steps:
        given = (plane, plane.point(None), float(step), wind.CALM, False)
        shared_models.give_back(shared_models.key(*given), shared_models.trimmed(*given), plane)
    assert [of[2] for of in shared_models._waiting] == steps[2:].tolist()


@pytest.mark.parametrize("name", PLANES)
def test_turbulence_on_a_shared_model_is_that_on_a_fresh_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fresh = flown(plant(name, turbulence="severe"), 400).tobytes()
    made = loads(monkeypatch)
    for _ in range(3):
        flying = plant(name)
        flown(flying)
        flying.give_back()
    again = plant(name, turbulence="severe")
    assert flown(again, 400).tobytes() == fresh
    assert len(made) == 3  # of the first flight, to compare with, of the second
