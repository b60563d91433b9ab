"""The ``[computers]`` table: how many computers fly, how exact their clocks are, and how they exchange samples."""

from __future__ import annotations

from pydantic import Field, model_validator

from rig.frame import COMPUTERS
from rig.settings import Settings


class Config(Settings):
    """The computers of a flight, lanes A to D: each owns its channel of every signal, discrete and servo."""

    count: int = Field(default=1, ge=1, le=len(COMPUTERS))  # 1: one computer reads all channels
    synchronised: bool = True  # false: the clocks run free
    clock_drift_ppm: float = Field(default=20.0, ge=0, le=10_000)  # uniform, plus or minus; drawn once a flight
    clock_offsets_s: list[float] = [0.0, 0.0, 0.0, 0.0]  # at the first frame: how much earlier a lane samples
    sync_gain: float = Field(default=0.5, gt=0, le=1)  # share of a lane's offset that it takes out in a frame
    exchange_window: float = Field(default=0.2, ge=0, lt=1)  # frames after its own start that a lane reads the link
    exchange_rounds: int = Field(default=2, ge=1, le=2)  # 1: a lane believes what arrived
    max_age_frames: int = Field(default=1, ge=0)  # so long a silent link's last message counts
    link_persistence_s: float = Field(default=0.05, gt=0)  # until a link without messages is failed; one frame or more

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


def refuse_long_offsets(config: Config, rate_hz: float) -> None:
    """ValueError when a lane's clock is a frame or more ahead."""
    for name, offset_s in zip(COMPUTERS, config.clock_offsets_s, strict=True):
        if offset_s * rate_hz >= 1:
            raise ValueError(
                f"computers.clock_offsets_s: lane {name} is a frame or more ahead, {offset_s:g} s at {rate_hz:g} Hz; "
                f"allowed: less than {1 / rate_hz:g} s"
            )
