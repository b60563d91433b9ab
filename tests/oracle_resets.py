"""Readmission by command, once more from the requirement alone: oracle.py with failed channels that come back.

A failed channel agrees in a frame in which its sample can be compared and lies within the threshold of the vote, both
behind the filter where there is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from oracle import Frame, Oracle


@dataclass
class ResettableOracle(Oracle):
    """One signal; ``command`` comes before the ``step`` of its frame."""

    readmit_frames: int = 100
    agreed: list[int] = field(default_factory=lambda: [0] * 4)  # frames in a row, of a failed channel

    def command(self, channels: set[int]) -> None:
        """Readmit those of the commanded channels that have agreed long enough."""
        for c in channels & self.failed:
            if self.agreed[c] >= self.readmit_frames:
                self.failed.remove(c)
                self.counts[c] = self.agreed[c] = 0

    def step(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, second: float | None = None
    ) -> Frame:
        out = set(self.failed)
        frame = super().step(samples, ilm, reference, second)
        voted = self.smooth("vote", frame.voted) or 0.0
        for c, x in enumerate(samples):
            agrees = x is not None and self.s.apart(self.memory[c], voted) <= self.s.threshold
            self.agreed[c] = self.agreed[c] + 1 if c in out and agrees else 0
        return frame
