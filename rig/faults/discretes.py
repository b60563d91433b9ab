"""Kinds of faults that only a discrete can have; ``stuck``, ``dropout``, ``intermittent`` and ``ilm`` suit it too."""

from __future__ import annotations

from typing import ClassVar, Literal

from rig.faults.settings import Act, Corrupted, DutyCycle, Effect, Pulses, quantity


class Inverted(Corrupted):
    """y = 1 - x. A switch wired to the wrong one of its two contacts, a swapped polarity."""

    sites = ("discrete",)
    kind: Literal["inverted"]
    effect: ClassVar[Effect] = Effect(Act.INVERT)


class Toggling(Corrupted):
    """y = 1 - x and x in turn. A chattering relay, a bouncing microswitch, a proximity sensor at its limit."""

    sites = ("discrete",)
    kind: Literal["toggling"]
    period_s: float = quantity("s", "from one wrong value to the next: half of it wrong, half right", gt=0)
    random: bool = quantity("", "both halves are means of exponentially distributed times", False)
    effect: ClassVar[Effect] = Effect(Act.INVERT)

    @property
    def pulses(self) -> Pulses:
        """Wrong and right in turn; at least a frame each."""
        return Pulses(DutyCycle.TELEGRAPH if self.random else DutyCycle.CYCLE, self.period_s / 2, self.period_s / 2)
