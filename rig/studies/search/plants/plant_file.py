"""The plan of a search over a plant: what varies, for how long it runs, and what it must keep."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import Field, model_validator

from rig.core.errors import BadInput
from rig.core.settings import Settings, build, read_toml
from rig.core.text import choices, quoted
from rig.studies.campaign.campaign_file import Levels, Range, Vary, read_vary
from rig.verdict.requirements.requirement import MOST, Requirement

MOST_FRAMES: Final = 1_000_000  # of one simulation
MOST_NUMBERS: Final = 1_000  # that vary
RESERVED: Final = ("seed", "duration_s", "time")  # arguments of the function, and the column of times


class SignalRange(Settings):
    """A signal of equal pieces: each constant at a value, or linear between the values at its ends."""

    low: float
    high: float
    pieces: int = Field(ge=1, le=MOST_NUMBERS)
    shape: Literal["constant", "linear"] = "constant"

    @model_validator(mode="after")
    def _ordered(self) -> SignalRange:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low:g}) must be below high ({self.high:g})")
        if not isfinite(self.high - self.low):
            raise ValueError(f"low ({self.low:g}) and high ({self.high:g}) are too far apart for a double")
        return self

    @property
    def count(self) -> int:
        """Return the number of values: one for each constant piece, and both ends of linear ones."""
        return self.pieces + (self.shape == "linear")


class PlantPlan(Settings):
    """The ranges of a plant's inputs and the requirements on its columns."""

    keys_are_in: ClassVar[str] = "docs/how-to/search-any-plant.md"

    title: str = ""
    duration_s: float = Field(gt=0.0, le=1e6)
    rate_hz: float = Field(default=100.0, gt=0.0, le=1e6)  # of the frames at which requirements are measured
    parameters: dict[str, Vary] = {}
    signals: dict[str, SignalRange] = {}
    repeats: int = Field(default=1, ge=1, le=1000)  # simulations of a point, each with another seed
    timeout_s: float = Field(default=60.0, gt=0.0, le=1e6)  # of one simulation, by the wall clock
    requirements: list[Requirement] = Field(min_length=1, max_length=MOST)

    @model_validator(mode="after")
    def _whole(self) -> PlantPlan:
        if self.duration_s * self.rate_hz > MOST_FRAMES:
            raise ValueError(f"duration_s times rate_hz: must be at most {MOST_FRAMES} frames")
        for name in (*self.parameters, *self.signals):
            _require_argument(name)
        if twice := [name for name in self.signals if name in self.parameters]:
            raise ValueError(f"signals.{twice[0]}: is a parameter too")
        if not self.numbers:
            raise ValueError("parameters, signals: nothing varies; a search needs a range (low, high) or a signal")
        if self.numbers > MOST_NUMBERS:
            raise ValueError(f"parameters, signals: {self.numbers} numbers vary; at most {MOST_NUMBERS} are allowed")
        _require_of_plants(self.requirements)
        return self

    @property
    def numbers(self) -> int:
        """Return the number of dimensions."""
        ranges = sum(not isinstance(of, Levels) for of in self.parameters.values())
        return ranges + sum(of.count for of in self.signals.values())

    @property
    def frames(self) -> int:
        """Return the number of frames of a whole simulation."""
        return int(self.duration_s * self.rate_hz * (1.0 + 1e-12)) + 1

    def chosen(self, ids: tuple[str, ...]) -> list[Requirement]:
        """Return the requirements of these ids, in their order; all if there are none.  BadInput: unknown id."""
        known = {each.id: each for each in self.requirements}
        for name in ids:
            if name not in known:
                raise BadInput(f"--requirement {quoted(name)}: unknown, {choices(name, known)}")
        return [known[name] for name in dict.fromkeys(ids)] or list(self.requirements)


def _require_argument(name: str) -> None:
    if not name.isidentifier() or keyword.iskeyword(name) or name in RESERVED:
        raise ValueError(f"{quoted(name)}: must be the name of an argument of the function, not {', '.join(RESERVED)}")


def _require_of_plants(requirements: list[Requirement]) -> None:
    ids = [each.id for each in requirements]
    for i, each in enumerate(requirements):
        if each.id in ids[:i]:
            raise ValueError(f"requirements.{i}.id: {each.id} is already used")
        if each.at != "start" or each.signals is not None or "{" in each.formula:
            raise ValueError(f"requirements.{i}: at, signals and {{signal}} are of flights; a plant is measured at 0 s")


def read_plan(plan: Path | str | Mapping[str, Any]) -> PlantPlan:
    """Return the plan of a TOML file, or of its tables.  BadInput: one line with file and key."""
    if isinstance(plan, Mapping):
        return _built(dict(plan), "plan")
    return _built(read_toml(Path(plan)), str(plan))


def _built(data: dict[str, Any], source: str) -> PlantPlan:
    parameters = data.get("parameters", {})
    vary = read_vary(parameters, f"{source}: parameters")
    for name, of in vary.items():
        if isinstance(of, Range) and of.levels is not None:
            raise BadInput(f"{source}: parameters.{name}.levels: is of campaigns; a search has no grid")
    return build(PlantPlan, {**data, "parameters": vary}, source)
