"""``rig.fly`` and ``rig.Flight``: a flight for programs and notebooks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property, wraps
from typing import TYPE_CHECKING, ParamSpec

from rig.flight import flight_result as result
from rig.flight import fly as assembly
from rig.show.notebook.log import Log, read_log
from rig.show.viewer.stream import Streams

if TYPE_CHECKING:
    from matplotlib.figure import Figure

P = ParamSpec("P")


class Flight(result.Flight):
    """The result of a flight; its frames are read from the log when they are first used."""

    @cached_property
    def recorded(self) -> Log:
        """The log, read at the first use."""
        return read_log(self.log)

    def plot(self, name: str) -> Figure:
        """Return a figure of channels, voted value and truth of one signal; BadInput: unknown signal."""
        return self.recorded.plot(name)

    def _repr_html_(self) -> str:
        """Return a small table for a notebook: scenario, verdict, failed channels, conclusion, digest, log."""
        return self.recorded._repr_html_(self.overrides, self.log, self.conclusion)


def _shown(fly: Callable[P, result.Flight]) -> Callable[P, Flight]:
    """Return ``fly`` with a result that a notebook can show, and with the conclusion."""

    @wraps(fly)
    def flown(*args: P.args, **kwargs: P.kwargs) -> Flight:
        from rig.verdict.of_log import FlightConclusion

        kwargs.setdefault("outcome", FlightConclusion())
        kwargs.setdefault("streams", Streams())
        flight = fly(*args, **kwargs)
        return Flight(**{field.name: getattr(flight, field.name) for field in fields(flight)})

    return flown


fly = _shown(assembly.fly)
