"""The conformance vectors' flights as the records of a unit under test: CONFIG, INPUT and the OUTPUT that must come."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from oracle import Frame
from vector_flights import FRAMES, Flown, FlownDiscrete

from rig.computer.redundancy.box import BOXES
from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS
from rig.computer.redundancy.manager_params import PARAMS, told
from rig.core.frame import CHANNELS, SURFACES, D, DecidedBy, Ilm, Pattern, S, State
from rig.unit.session import configuration
from rig.unit.unit_records import FROM_UNIT, INPUT, OUTPUT, TO_UNIT, Kind, Role, Said, blank
from rig.unit.vectors import Case

RATE_HZ = 100.0
MISSING = ("nan", "infinity", "-infinity", "above", "below", "flag")  # how a sample cannot be compared
ILM = {"bad": Ilm.BAD, "good": Ilm.GOOD, "absent": Ilm.ABSENT}
PATTERNS = {pattern.label: int(pattern) for pattern in Pattern}
# Fields of PARAMS that the oracle's settings have by the same name.
SAME = (
    *("threshold", "reference_threshold", "second_threshold", "common_persistence", "common_fails", "persistence"),
    *(
        "split_persistence",
        "trend_frames",
        "stale_frames",
        "slow_allowance",
        "slow_limit",
        "weighted",
    ),
    *told("rules"),
    *told("slow_tests"),
)
SAID = Said.VOTED | Said.STATE | Said.PATTERN | Said.TREND | Said.DISCRETES


@dataclass
class Session:
    """One case before it is written: what each of the signals and discretes is given and must answer."""

    requirement: str
    signals: Sequence[Flown]
    discretes: Sequence[FlownDiscrete]
    answers: Sequence[Sequence[Frame]] = ()  # of the signals, where they are not each one's own
    box_signals: int = 0
    box_persistence: int = 1
    missing: Sequence[str] = MISSING
    frames: int = FRAMES
    draw: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self.draw = random.Random(self.requirement)

    def case(self) -> Case:
        """The session as records."""
        inputs = blank(INPUT, TO_UNIT, Kind.FRAME).repeat(self.frames)
        expected = blank(OUTPUT, FROM_UNIT, Kind.REPLY).repeat(self.frames)
        for records in (inputs, expected):
            records["frame"] = np.arange(self.frames)
            records["time_s"] = records["frame"] / RATE_HZ
        expected["stepped"], expected["said"] = np.arange(self.frames) + 1, int(SAID)
        answers = self.answers or [flown.answers for flown in self.signals]
        for i, (flown, frames) in enumerate(zip(self.signals, answers, strict=True)):
            self.give(inputs, i, flown)
            expect(expected, i, flown, frames)
        for d, one in enumerate(self.discretes):
            self.give_discrete(inputs, d, one)
            expect_discrete(expected, d, one)
        return Case(self.requirement, self.config(), inputs, expected)

    def config(self) -> NDArray[Any]:
        params, discretes, boxes = np.zeros(S, PARAMS), np.zeros(D, DISCRETE_PARAMS), np.zeros(1, BOXES)
        for row, flown in zip(params, self.signals, strict=True):
            configure(row, flown)
        for row, one in zip(discretes, self.discretes, strict=True):
            row["fitted"], row["fail_safe"] = one.settings.channels, one.settings.fail_safe
            row["persistence"], row["readmit_frames"] = one.settings.persistence, one.settings.readmit_frames
        boxes["signals"], boxes["persistence"] = self.box_signals, self.box_persistence
        limits = np.array([(-0.5, 0.5)] * (len(SURFACES) - 1) + [(0.0, 1.0)])
        names = ("vectors", "vectors")
        return configuration(RATE_HZ, Role.REDUNDANCY, params, discretes, boxes, np.zeros(len(SURFACES)), limits, names)

    def give(self, inputs: NDArray[Any], i: int, flown: Flown) -> None:
        """Write what signal ``i`` is given."""
        kinds = [self.draw.choice(self.missing) for _ in range(CHANNELS)]
        flight = flown.flight
        for k in range(self.frames):
            kinds = [self.draw.choice(self.missing) if self.draw.random() < 0.1 else kind for kind in kinds]
            there = [x for x in flight.samples[k] if x is not None]
            for c, x in enumerate(flight.samples[k]):
                usual = there[0] if there else 0.5 * (flown.low + flown.high)
                value, valid = (x, 1) if x is not None else missing(kinds[c], flown, usual)
                inputs["channels"][k, i, c], inputs["valid"][k, i, c] = value, valid
        inputs["ilm"][:, i] = [[ILM[flag] for flag in row] for row in flight.ilm]
        inputs["reference"][:, i] = np.array(flight.references, float)
        inputs["second_reference"][:, i] = np.array(flight.seconds, float)
        inputs["reset"][:, i] = [sum(1 << c for c in reset) for reset in flown.resets]

    def give_discrete(self, inputs: NDArray[Any], d: int, one: FlownDiscrete) -> None:
        """Write what discrete ``d`` is given: one that is declared bad is so by its flag, its monitor or both."""
        inputs["discrete_reset"][:, d] = [sum(1 << c for c in reset) for reset in one.resets]
        for k, row in enumerate(one.samples):
            for c, x in enumerate(row):
                flag, monitor = (1, Ilm.ABSENT) if k % 2 else (1, Ilm.GOOD)
                if x is None:
                    flag, monitor = self.draw.choice([(0, Ilm.GOOD), (0, Ilm.BAD), (1, Ilm.BAD)])
                    x = self.draw.random() < 0.5
                inputs["discrete_channels"][k, d, c] = x
                inputs["discrete_valid"][k, d, c], inputs["discrete_ilm"][k, d, c] = flag, monitor


def missing(kind: str, flown: Flown, usual: float) -> tuple[float, int]:
    """Value and flag of a sample that cannot be compared; ``usual``: a value that could be."""
    beyond = flown.settings.threshold / 2
    values = {"nan": np.nan, "infinity": np.inf, "-infinity": -np.inf}
    values |= {"above": flown.high + beyond, "below": flown.low - beyond}
    return values.get(kind, usual), 0 if kind == "flag" else 1


def configure(row: Any, flown: Flown) -> None:
    """Write the settings of a signal into its PARAMS record: no fade."""
    s = flown.settings
    for name in SAME:
        row[name] = getattr(s, name)
    row["threshold_triplex"], row["threshold_duplex"], row["filter_gain"] = s.within(3), s.within(2), s.filter_share
    row["reference_airspeed_m_s"] = flown.airspeed_m_s
    row["low"], row["high"], row["readmit_frames"] = flown.low, flown.high, flown.readmit_frames
    row["deviation"], row["deviation_frames"] = 2.5 * s.threshold, 5.0 * s.threshold * RATE_HZ
    row["fitted"], row["wraps"] = s.channels, s.turn > 0
    row["tie_break"][: len(s.tie_break)] = [DecidedBy[name.upper()] for name in s.tie_break]


def expect(expected: NDArray[Any], i: int, flown: Flown, answers: Sequence[Frame]) -> None:
    """Write what signal ``i`` must answer."""
    unfitted = ["absent"] * (CHANNELS - flown.settings.channels)
    for k, frame in enumerate(answers):
        expected["voted"][k, i], expected["level"][k, i] = frame.voted, frame.level
        expected["state"][k, i] = [State[name.upper()] for name in frame.states + unfitted]
        expected["pattern"][k, i], expected["decided_by"][k, i] = (
            PATTERNS[frame.pattern],
            DecidedBy[frame.decided_by.upper()],
        )
        expected["trend_high"][k, i], expected["trend_low"][k, i] = frame.trend
        expected["reference_usable"][k, i], expected["common_mode"][k, i] = frame.usable, frame.common


def expect_discrete(expected: NDArray[Any], d: int, one: FlownDiscrete) -> None:
    """Write what discrete ``d`` must answer."""
    for k, (voted, states, level) in enumerate(one.answers):
        expected["discrete_voted"][k, d], expected["discrete_level"][k, d] = voted, level
        expected["discrete_state"][k, d] = [State[name.upper()] for name in states]
