"""Requirements as settings: bundled sets and files of ``[[requirements]]``, checked when they are read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal

from pydantic import Field, PrivateAttr, field_validator

from rig.core.errors import BadInput
from rig.core.files import bundled, is_file
from rig.core.settings import Settings, build, read_toml
from rig.verdict.requirements.formula import check_grammar, check_names
from rig.world.faults.grammar import Refused

MOST: Final = 200  # of a file
Scale = Annotated[float, Field(gt=0.0, le=1e12)]


class Requirement(Settings):
    """A formula that must hold at some instants, of some signals."""

    keys_are_in: ClassVar[str] = "docs/how-to/requirements-and-ci.md"

    id: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]{0,79}$")
    text: str = ""
    source: str = ""
    at: Literal["start", "each onset", "each loss"] = "start"
    formula: str
    signals: list[str] | Literal["*"] | None = None  # those with faults when not given
    scale: Scale | Annotated[list[Scale], Field(min_length=1)] | None = None  # robustness 1; of each comparison
    _file: str = PrivateAttr(default="")

    @field_validator("formula")
    @classmethod
    def _readable(cls, formula: str) -> str:
        try:
            check_grammar(formula)
        except Refused as refused:
            raise ValueError(f"column {refused.column}: {refused}") from None
        return formula

    def require_of_flights(self) -> None:
        """Raise BadInput if its formula names what no flight and no recording has; other subjects check their own."""
        try:
            check_names(self.formula)
        except Refused as refused:
            raise BadInput(f"{self.where}: formula: column {refused.column}: {refused}") from None

    @property
    def names_baseline(self) -> bool:
        """Return whether the formula names the same flight without faults."""
        return "baseline." in self.formula

    @property
    def where(self) -> str:
        """File and id, for messages."""
        return f"{self._file}: {self.id}" if self._file else f"requirement {self.id}"


class _File(Settings):
    keys_are_in: ClassVar[str] = "docs/how-to/requirements-and-ci.md"

    title: str = ""
    requirements: list[Requirement] = Field(min_length=1, max_length=MOST)


def names() -> list[str]:
    """Return the names of the bundled sets."""
    return sorted(path.stem for path in (bundled("faults") / "requirements").glob("*.toml"))


def find_requirements(name: str | Path) -> Path:
    """Return the file of requirements of that path, or of that bundled name."""
    wanted, home = Path(name), bundled("faults") / "requirements"
    for candidate in (wanted, home / f"{wanted.name}.toml", home / wanted.name):
        if is_file(candidate):
            return candidate
    raise BadInput(f"{wanted}: no such requirements file; bundled: {', '.join(names())}")


def load_requirements(names: Sequence[str | Path]) -> tuple[Requirement, ...]:
    """Return the requirements on flights of bundled sets and files, in their order; BadInput names file and key."""
    loaded: dict[str, Requirement] = {}
    for path in dict.fromkeys(map(find_requirements, names)):
        for made in build(_File, read_toml(path), str(path)).requirements:
            if made.id in loaded:
                raise BadInput(f"{path}: {made.id}: the id is already used in {loaded[made.id]._file}")
            made._file = str(path)
            made.require_of_flights()
            loaded[made.id] = made
    return tuple(loaded.values())
