"""The settings of a baseline manager besides the calibrated one: as many choices as the built-in manager has.

``rig thresholds`` gives the built-in manager sums with one of three limits, or none; on recordings tests with one of
two or three factors, and one of four persistences.  A baseline manager with the variant ``tuned`` gets as many: a
learned bias or none, three values of one more setting, and the same persistences.  Each choice is calibrated to the
same rate.  The one that isolates most faults injected into the calibrating flights is chosen; of equals the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, Final

from rig.studies.benchmark.entrants import LEARNED_BIAS, PERSISTENCE, Entrant

KNOBS: Final[Mapping[str, tuple[str, tuple[float, ...]]]] = {  # the published value first
    "cusum": ("limit", (24.0, 60.0, 120.0)),
    "innovation": ("limit", (24.0, 60.0, 120.0)),
    "glr": ("window", (100, 50, 25)),
    "bayes": ("noise", (2.0, 1.0, 4.0)),
    "window_median": ("window", (25, 15, 51)),
    "gate_mean": ("integral_frames", (200.0, 50.0, 800.0)),
}


def choices_of(
    entrant: Entrant, given: Mapping[str, Any], bias: float, persistences: Sequence[int] = ()
) -> Iterator[dict[str, Any]]:
    """Yield the settings of each choice, with those ``given`` to all.

    bias : bound of a learned bias, thresholds; persistences : frames, none: that of the signal
    """
    name, values = KNOBS.get(entrant.manager, ("", (0.0,)))
    for frames, bound, value in product(persistences or (0,), (0.0, bias), values):
        own = {name: value} if name else {}
        yield {**given, LEARNED_BIAS: bound, **own, **({PERSISTENCE: frames} if frames else {})}


def in_words(entrant: Entrant, chosen: Mapping[str, Any]) -> str:
    """Return a choice as a note has it."""
    name, _ = KNOBS.get(entrant.manager, ("", ()))
    said = [f"{name} {chosen[name]:g}"] if name else []
    said += [f"persistence {chosen[PERSISTENCE]}"] if PERSISTENCE in chosen else []
    bound = chosen.get(LEARNED_BIAS, 0.0)
    return ", ".join([*said, f"a learned bias of up to {bound:.3g} thresholds" if bound else "no learned bias"])
