"""The ``[computers]`` table: how many computers fly, how exact their clocks are, how they exchange and test themselves.

Shares of commands are of the stroke, from stop to stop.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from rig.core.frame import COMPUTERS
from rig.core.settings import Settings


class OwnTest(Settings):
    """A test that a lane makes of itself; it fails itself."""

    tolerance: float = Field(default=0.02, gt=0)  # share of full scale
    persistence_s: float = Field(default=0.03, gt=0)  # at least one frame
    coverage: float = Field(default=0.95, ge=0, le=1)  # chance that it sees a fault, drawn once a fault


class Watchdog(Settings):
    """The test that a lane still computes."""

    persistence_s: float = Field(default=0.02, gt=0)
    coverage: float = Field(default=1.0, ge=0, le=1)


class Checksum(Settings):
    """The test of a lane's program, at the end of every period."""

    coverage: float = Field(default=1.0, ge=0, le=1)


class Command(Settings):
    """A command of the pilot to the lanes."""

    at_s: float = Field(ge=0)
    do: Literal["readmit", "disengage", "backup"]
    lane: Literal["A", "B", "C", "D"] | None = None

    @model_validator(mode="after")
    def _of_a_lane(self) -> Command:
        if (self.lane is None) != (self.do == "backup"):
            why = "the back-up is not a lane" if self.do == "backup" else "is missing"
            raise ValueError(f"lane: {why}; {self.do} {'has none' if self.do == 'backup' else 'needs one'}")
        return self


class Config(Settings):
    """The computers of a flight, lanes A to D: each owns its channel of every signal, discrete and servo."""

    count: int = Field(default=1, ge=1, le=len(COMPUTERS))  # 1: one computer reads all channels
    synchronised: bool = True  # false: the clocks run free
    clock_drift_ppm: float = Field(default=20.0, ge=0, le=10_000)  # uniform, plus or minus; drawn once a flight
    clock_offsets_s: list[float] = [0.0, 0.0, 0.0, 0.0]  # at the first frame: how much earlier a lane samples
    sync_gain: float = Field(default=0.5, gt=0, le=1)  # share of a lane's offset that it takes out in a frame
    exchange_window: float = Field(default=0.2, ge=0, lt=1)  # frames after its own start that a lane reads the link
    exchange_rounds: int = Field(default=2, ge=1, le=2)  # 1: a lane uses what arrived
    max_age_frames: int = Field(default=1, ge=0)  # so long a silent link's last message counts
    link_persistence_s: float = Field(default=0.05, gt=0)  # until a link without messages is failed; one frame or more
    sync_window: float = Field(default=0.05, gt=0, lt=0.5)  # frames: largest offset of synchronised clocks,
    sync_persistence_s: float = Field(default=0.05, gt=0)  # beyond which for so long a lane is accused
    output: Literal["voted", "own"] = "voted"  # own: each lane drives its coils with its own command
    equalise: bool = True  # integrators go to the mid value of the engaged lanes'
    command_threshold: float = Field(default=0.05, gt=0, le=1)  # of the vote of commands
    command_persistence_s: float = Field(default=0.05, gt=0)
    command_split_s: float = Field(default=0.1, gt=0)  # an unresolved vote of commands leads to the back-up
    wrap_around: OwnTest = OwnTest()
    reference_voltage: OwnTest = OwnTest()
    watchdog: Watchdog = Watchdog()
    checksum: Checksum = Checksum()
    checksum_period_s: float = Field(default=1.0, gt=0)
    false_alarm_per_hour: float = Field(default=0.0, ge=0)  # of each lane's own tests
    rejoin_s: float = Field(default=1.0, gt=0)  # of agreement before a lane may be readmitted
    commands: list[Command] = []

    @property
    def apart_frames(self) -> float:
        """Return by how many frames the computers read their channels apart, at most: their clocks may run free."""
        return 0.0 if self.synchronised or self.count == 1 else 1.0

    @model_validator(mode="after")
    def _rounds_need_one_time(self) -> Config:
        if self.exchange_rounds > 1 and not self.synchronised:
            raise ValueError("exchange_rounds: 2 needs synchronised = true; with false allowed: 1")
        return self

    @model_validator(mode="after")
    def _an_offset_a_lane(self) -> Config:
        given = self.clock_offsets_s
        if len(given) != len(COMPUTERS) or not all(offset >= 0 for offset in given):
            raise ValueError(f"clock_offsets_s: {len(COMPUTERS)} times of 0 or more, one a lane, got {given}")
        return self

    @model_validator(mode="after")
    def _commands_to_lanes(self) -> Config:
        there = COMPUTERS[: self.count] if self.count > 1 else ()
        for i, command in enumerate(self.commands):
            if not there:
                raise ValueError(f"commands.{i}: one computer has no lanes; allowed with count of 2 or more")
            if command.lane is not None and command.lane not in there:
                raise ValueError(f"commands.{i}.lane: there is no lane {command.lane}, allowed: {', '.join(there)}")
        return self


def refuse_long_offsets(config: Config, rate_hz: float) -> None:
    """ValueError when a lane's clock is a frame or more ahead."""
    for name, offset_s in zip(COMPUTERS, config.clock_offsets_s, strict=True):
        if offset_s * rate_hz >= 1:
            raise ValueError(
                f"computers.clock_offsets_s: lane {name} is a frame or more ahead, {offset_s:g} s at {rate_hz:g} Hz; "
                f"allowed: less than {1 / rate_hz:g} s"
            )
