"""The voter of a discrete once more, in plain Python and from the requirement alone."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class DiscreteSettings:
    fail_safe: int = 0
    persistence: int = 8
    readmit_frames: int = 100
    channels: int = 4


@dataclass
class DiscreteOracle:
    """One discrete; samples are True, False or None for one that its flag or its own monitor declares bad."""

    s: DiscreteSettings
    failed: set[int] = field(default_factory=set)
    wrong: list[int] = field(default_factory=lambda: [0] * 4)
    right: list[int] = field(default_factory=lambda: [0] * 4)

    def step(self, samples: list[bool | None], reset: set[int]) -> tuple[int, list[str], int]:
        """Vote, states and level of a frame; ``reset`` are the channels commanded to be readmitted in it."""
        s, fitted = self.s, range(self.s.channels)
        back = {c for c in reset & self.failed if self.right[c] >= s.readmit_frames}
        self.failed -= back
        for c in back:
            self.wrong[c] = self.right[c] = 0
        votes = [samples[c] for c in fitted if c not in self.failed and samples[c] is not None]
        yes, no = votes.count(True), votes.count(False)
        vote = s.fail_safe if yes == no else int(yes > no)
        for c in fitted:
            same = samples[c] is not None and int(bool(samples[c])) == vote
            self.right[c] = self.right[c] + 1 if same and c in self.failed else 0
            self.wrong[c] = 0 if same else self.wrong[c] + 1
        self.failed |= {c for c in fitted if self.wrong[c] >= s.persistence}
        states = ["failed" if c in self.failed else "suspect" if self.wrong[c] else "ok" for c in fitted]
        return vote, states + ["absent"] * (4 - s.channels), s.channels - len(self.failed)
