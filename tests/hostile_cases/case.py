"""A case: one command with one hostile input; it is decided by kind, seed and number alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import TypeVar

T = TypeVar("T")
Make = Callable[[Path], None]


def nothing(folder: Path) -> None:
    """A case that needs no file."""


@dataclass(frozen=True)
class Case:
    """A command, the files that it finds in its working folder, and a way to say what is hostile about it."""

    kind: str
    number: int
    argv: tuple[str, ...]
    about: str  # what is hostile, for people
    make: Make = nothing  # writes the files; called in the case's own process and folder
    call: Callable[[], int] | None = None  # in place of the command: exit code
    refused: str = ""  # pattern of what is named when exit code 2 must come; empty: any other code may
    may_run_code: bool = False  # the command line gives leave to import what the input names
    seed: int = 0

    @property
    def name(self) -> str:
        """What ``--only`` takes."""
        return f"{self.kind}/{self.seed}/{self.number}"


@dataclass(frozen=True)
class Draw:
    """The choices of one case: the leaf in turn, so that N cases see N leaves; the rest at random."""

    kind: str
    seed: int
    number: int
    rng: Random = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "rng", Random(f"{self.seed}/{self.kind}/{self.number}"))

    def turn(self, things: Sequence[T], what: str = "") -> T:
        """The next of ``things`` in an order drawn from the seed."""
        order = list(range(len(things)))
        Random(f"{self.seed}/{self.kind}/{what}").shuffle(order)
        return things[order[self.number % len(things)]]

    def case(
        self,
        argv: list[str] | tuple[str, ...],
        about: str,
        make: Make = nothing,
        leave: bool = False,
        refused: str = "",
    ) -> Case:
        """The case of these choices; ``leave``: the command line itself allows named code to run."""
        words = tuple(argv)
        return Case(self.kind, self.number, words, about, make, refused=refused, may_run_code=leave, seed=self.seed)
