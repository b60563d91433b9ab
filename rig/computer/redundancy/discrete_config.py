"""Settings of the voter of the discretes, and the records that its kernel reads."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, model_validator

from rig.core.frame import DISCRETES, D
from rig.core.settings import Settings, fill, in_frames, refuse_both

PERSISTENCE: Final = 8  # frames, of a discrete without a setting


class DiscreteConfig(Settings):
    """Monitor and vote of one discrete: a ``[redundancy.discretes.<name>]`` table."""

    persistence: int | None = Field(default=None, ge=1)  # frames; ``discrete_persistence`` when not given
    persistence_s: float | None = Field(default=None, gt=0)  # the same in seconds
    readmit_frames: int = Field(default=100, ge=1)  # agreement needed before a reset readmits
    fail_safe: int | None = Field(default=None, ge=0, le=1)  # voted without a majority; as in frame.DISCRETES

    @model_validator(mode="after")
    def _one_form(self) -> DiscreteConfig:
        refuse_both(self, "persistence")
        return self


_FIELDS: dict[str, Any] = {discrete.name: (DiscreteConfig, DiscreteConfig()) for discrete in DISCRETES}
DiscreteConfigs = create_model(
    "DiscreteConfigs", __base__=Settings, __doc__="One DiscreteConfig for every discrete of the frame.", **_FIELDS
)
DISCRETE_PARAMS: Final = np.dtype(
    [
        ("fitted", "i8"),  # channels of the discrete, 2 to 4
        ("fail_safe", "i8"),  # 0 or 1
        ("persistence", "i8"),  # frames
        ("readmit_frames", "i8"),
    ],
    align=True,
)


def discrete_parameters(
    configs: Any, channels: NDArray[np.int64], persistence: int, rate_hz: float
) -> NDArray[np.void]:
    """Return the (D,) DISCRETE_PARAMS records of a ``DiscreteConfigs``.

    channels : (D,) of the sensors; persistence : frames, of a discrete without a setting
    """
    params = np.zeros(D, DISCRETE_PARAMS)
    for row, discrete, fitted in zip(params, DISCRETES, channels, strict=True):
        config: DiscreteConfig = getattr(configs, discrete.name)
        fill_discrete(row, config, discrete.fail_safe, int(fitted), persistence, rate_hz)
    return params


def fill_discrete(
    row: Any, config: DiscreteConfig, fail_safe: int, channels: int, persistence: int, rate_hz: float
) -> None:
    """Write one discrete's settings into its record; ``fail_safe`` and ``persistence`` where it gives none."""
    fill(
        row,
        config,
        fitted=channels,
        fail_safe=fail_safe if config.fail_safe is None else config.fail_safe,
        persistence=in_frames(config.persistence or persistence, config.persistence_s, rate_hz),
    )
