"""A campaign file: the varied values, and separately how the campaign runs.

Everything but the ``[run]`` table decides the flights and so the rows of the table.  ``[run]`` sets the workers, the
size of a batch and the logs that are kept; it may change between two calls on one folder.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from rig.core.errors import BadInput
from rig.core.files import bundled, is_file
from rig.core.renamed import CAMPAIGNS, now_called
from rig.core.settings import Settings, build, read_toml
from rig.core.text import quoted

Sampling = Literal["grid", "stratified", "random", "latin-hypercube", "sobol"]
MOST_RUNS: Final = 1_000_000
NAME_BYTES: Final = 255  # of a file's name, as file systems have it
EXACT: Final = 2**53  # up to which a double holds every whole number


class Levels(Settings):
    """A list of equally likely values."""

    values: list[Any] = Field(min_length=1)

    @model_validator(mode="after")
    def _storable(self) -> Levels:
        for value in self.values:
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ValueError("values: a whole number must have at most 64 bits")
        return self


class Range(Settings):
    """A range of values from ``low`` to ``high``, uniform, or uniform in the logarithm."""

    low: float
    high: float
    log: bool = False
    whole: bool = False  # whole numbers, both ends included
    levels: int | None = Field(default=None, ge=1, le=MOST_RUNS)  # of a grid: as many, evenly from end to end

    @model_validator(mode="after")
    def _ordered(self) -> Range:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low:g}) must be below high ({self.high:g})")
        if self.log and self.low <= 0 <= self.high:
            raise ValueError(f"low ({self.low:g}) must be above 0 on a logarithmic scale, or high below 0")
        if not math.isfinite(self.high - self.low) or (self.log and not math.isfinite(self.high / self.low)):
            raise ValueError(f"low ({self.low:g}) and high ({self.high:g}) are too far apart for a double")
        if self.whole and max(-self.low, self.high) > EXACT:
            raise ValueError(f"low ({self.low:g}) and high ({self.high:g}) must be within +-2^53 for whole numbers")
        return self


class Distribution(Settings):
    """A distribution of scipy.stats, by name, cut off at ``low`` and ``high``."""

    distribution: str
    low: float
    high: float
    parameters: dict[str, float] = {}  # of scipy.stats: loc, scale and its own shapes
    levels: int | None = Field(default=None, ge=1, le=MOST_RUNS)  # of a grid: the middles of as many equal shares

    @model_validator(mode="after")
    def _known(self) -> Distribution:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low:g}) must be below high ({self.high:g})")
        low, high = self.shares()
        if not low < high:
            raise ValueError(f"{self.distribution} has no probability between {self.low:g} and {self.high:g}")
        return self

    def shares(self) -> tuple[float, float]:
        """Return the probability below ``low`` and below ``high``."""
        try:
            with np.errstate(all="ignore"):  # what comes of extreme parameters is refused by its value
                return tuple(map(float, self.frozen().cdf([self.low, self.high])))  # type: ignore[return-value]
        except TypeError as error:
            raise ValueError(f"parameters: {error}") from None

    def frozen(self) -> Any:
        """Return the distribution with its parameters."""
        return self._family()(**self.parameters)

    def _family(self) -> Any:
        import scipy.stats  # half a second, which no worker needs

        family = getattr(scipy.stats, self.distribution, None)
        if family is None or not isinstance(family, scipy.stats.rv_continuous):
            raise ValueError(f"distribution: scipy.stats has no continuous distribution {quoted(self.distribution)}")
        return family


Vary = Levels | Range | Distribution


class Case(Settings):
    """A case: keys that take their values together, under a name, and keys that vary within the case."""

    name: str = Field(min_length=1)
    set: dict[str, Any] = {}
    vary: dict[str, Vary] = {}


_Logs = re.compile(r"all|failures|none|sample:[1-9][0-9]{0,8}")


def _logs(text: str) -> str:
    if not is_logs(text):
        raise ValueError("logs must be all, failures, none or sample:N")
    return text


def is_logs(text: str) -> bool:
    """Return True if ``text`` is a choice of logs that are kept."""
    return _Logs.fullmatch(text) is not None


class How(Settings):
    """The ``[run]`` table; no key of it changes a row."""

    workers: int = Field(default=2, ge=1, le=1024)
    batch: int = Field(default=10, ge=1)  # flights of one part
    logs: Annotated[str, AfterValidator(_logs)] = "none"
    timeout_s: float = Field(default=300.0, gt=0, le=1e9)  # of one flight, by the wall clock


class Campaign(Settings):
    """A campaign: the flights, and how they are flown. ``base`` is the table of the base scenario."""

    keys_are_in: ClassVar[str] = "docs/how-to/campaigns-and-worst-case.md"

    title: str = ""
    base: dict[str, Any]
    set: dict[str, Any] = {}  # dotted keys laid over the base scenario in every run
    sampling: Sampling = "grid"
    runs: int | None = Field(default=None, ge=1, le=MOST_RUNS)  # a grid's: each of its points once
    seed: int = Field(default=0, ge=0, lt=2**63)
    requirements: list[dict[str, Any]] | None = None  # a file names sets and files; here their tables
    baseline: bool = False  # fly every run without its faults as well, for the transients
    vary: dict[str, Vary] = {}
    cases: dict[str, list[Case]] = {}
    run: How = How()

    @model_validator(mode="after")
    def _whole(self) -> Campaign:
        if self.sampling != "grid" and self.runs is None:
            raise ValueError(f"runs: is needed with sampling = {self.sampling!r}")
        keys = [*self.set, *(key for key, _ in self.varied()), *(key for case in self.all_cases() for key in case.set)]
        if "seed" in keys:
            raise ValueError("seed: must not vary; the campaign's seed and the run's number give each run its seed")
        names = [*self.vary, *self.cases, *{key for case in self.all_cases() for key in case.vary}]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]}: is varied in two places")
        for name, cases in self.cases.items():
            labels = [case.name for case in cases]
            if not labels or len(set(labels)) < len(labels):
                raise ValueError(f"cases.{name}: needs at least one case, each with a different name")
        if self.sampling == "grid":
            self._check_levels()
        return self

    def _check_levels(self) -> None:
        for key, vary in self.varied():
            if not isinstance(vary, Levels) and vary.levels is None:
                raise ValueError(f"vary.{key}.levels: is needed in a grid")
        axes = [sum(_points(case.vary) for case in cases) for cases in self.cases.values()]
        if max(axes, default=0) > MOST_RUNS or (self.runs is None and math.prod(axes) * _points(self.vary) > MOST_RUNS):
            raise ValueError(f"vary: the grid has more than {MOST_RUNS} points; use fewer levels or another sampling")

    def all_cases(self) -> list[Case]:
        """Return the cases of all groups."""
        return list(chain(*self.cases.values()))

    def varied(self) -> Iterator[tuple[str, Vary]]:
        """Yield every key that varies by itself, also within cases."""
        return chain(self.vary.items(), *(case.vary.items() for case in self.all_cases()))

    def what(self) -> dict[str, Any]:
        """Return everything that decides the table as plain data; ``from_what`` reads it back."""
        return self.model_dump(mode="json", exclude={"run"}, exclude_none=True)


def _points(vary: dict[str, Vary]) -> int:
    """Return the number of points of a grid of these keys."""
    return math.prod(len(v.values) if isinstance(v, Levels) else v.levels or 1 for v in vary.values())


def find(name: str | Path) -> Path:
    """Return the path of a campaign file: the given path, or the name in the bundled ``faults/campaigns``."""
    wanted, home = Path(name), bundled("faults") / "campaigns"
    for candidate in (wanted, home / wanted.name, home / f"{wanted.name}.toml"):
        if is_file(candidate):
            return candidate
    if new := CAMPAIGNS.get(wanted.stem):
        raise BadInput(now_called(str(wanted), new))
    raise BadInput(f"{wanted}: no such file; bundled: {', '.join(names())}")


def names() -> list[str]:
    """Return the names of the bundled campaigns, in alphabetical order."""
    return sorted(path.stem for path in (bundled("faults") / "campaigns").glob("*.toml"))


def read(name: str | Path, sets: dict[str, Any] | None = None) -> Campaign:
    """Read a campaign file, with ``sets`` (dotted keys) over its ``[set]``.  BadInput: a wrong key or value."""
    path = find(name)
    data = read_toml(path)
    source = str(path)
    base = data.pop("base", None)
    if not isinstance(base, str):
        raise BadInput(f"{source}: base: give the file or the bundled name of a scenario")
    fixed = data.get("set", {})
    if not isinstance(fixed, dict):
        raise BadInput(f"{source}: set: must be a table of keys")
    table, home = _base(base, path)
    named = [*_names(table.pop("requirements", []), source), *_names(data.pop("requirements", []), source)]
    required = {"requirements": _requirements(named, (path.parent, home))} if named else {}
    return from_what({**data, **required, "base": table, "set": {**fixed, **(sets or {})}}, source)


def _names(given: Any, source: str) -> list[str]:
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        raise BadInput(f"{source}: requirements: must be a list of bundled sets and files")
    return given


def _requirements(names: list[str], homes: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the requirements of sets and files, also from the folders ``homes``, as tables that a campaign keeps."""
    from rig.verdict.requirements.requirement import load_requirements

    places = (Path(), *homes)
    paths = [next((place / name for place in places if is_file(place / name)), name) for name in names]
    return [each.model_dump(exclude_none=True) for each in load_requirements(paths)]


def _base(name: str, path: Path) -> tuple[dict[str, Any], Path]:
    """Read the table of the base scenario; return it with its folder.

    The search looks beside the campaign file, in the working directory, and among the bundled scenarios.
    """
    from rig.scenario.scenario import find as find_scenario

    if not name.isprintable() or max(map(len, map(os.fsencode, Path(name).parts)), default=0) > NAME_BYTES:
        raise BadInput(f"{path}: base: must be the file of a scenario, got {name[:60]!r}")
    beside = path.parent / name
    try:
        file = beside if is_file(beside) else find_scenario(name)
        return read_toml(file), file.parent
    except BadInput as error:
        raise BadInput(f"{path}: base: {error}") from None


def from_what(data: dict[str, Any], source: str) -> Campaign:
    """Build a campaign from plain data, of a file or of ``Campaign.what``."""
    data = dict(data)
    data["vary"] = read_vary(data.get("vary", {}), f"{source}: vary")
    cases = data.get("cases", {})
    if not isinstance(cases, dict) or not all(isinstance(group, list) for group in cases.values()):
        raise BadInput(f"{source}: cases: must be [[cases.<name>]] tables")
    data["cases"] = {name: [_case(case, f"{source}: cases.{name}") for case in group] for name, group in cases.items()}
    return build(Campaign, data, source)


def _case(data: Any, source: str) -> Any:
    if not isinstance(data, dict):
        raise BadInput(f"{source}: must be tables")
    return {**data, "vary": read_vary(data.get("vary", {}), f"{source}.vary")}


def read_vary(data: Any, source: str) -> dict[str, Vary]:
    """Return the varied values of a table by dotted key, which may be in quotes or in nested tables.  BadInput."""
    if not isinstance(data, dict):
        raise BadInput(f"{source}: must be a table of keys")
    return dict(_leaves(data, "", source))


def _leaves(data: dict[str, Any], above: str, source: str) -> Iterator[tuple[str, Vary]]:
    for key, value in data.items():
        name = f"{above}{key}"
        where = f"{source}.{name}"
        if isinstance(value, list):
            yield name, build(Levels, {"values": value}, where)
        elif not isinstance(value, dict):
            raise BadInput(f"{where}: must be a list, a range (low, high) or a distribution, got {quoted(value)}")
        elif isinstance(value.get("values"), list) and len(value) == 1:
            yield name, build(Levels, value, where)
        elif isinstance(value.get("distribution"), str):
            yield name, build(Distribution, value, where)
        elif any(isinstance(value.get(end), (int, float)) for end in ("low", "high")):
            yield name, build(Range, value, where)
        else:
            yield from _leaves(value, f"{name}.", source)
