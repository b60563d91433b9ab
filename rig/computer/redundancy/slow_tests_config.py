"""Settings of the slow-fault tests of a signal, and what a data sheet adds to them (slow_tests.py)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pydantic import Field

from rig.computer.redundancy.manager_params import told
from rig.core.settings import Settings
from rig.world.sensors.data_sheet import DataSheet

BIAS: Final = 2.0  # bias tolerances that a residual may be: that of a channel and that of the median
NOISE: Final = 0.5  # of the noise of a sample: the least that residuals are measured by
OFF: Final[Mapping[str, float]] = dict.fromkeys(told("slow_tests"), 0.0)


class SlowTests(Settings):
    """A ``[redundancy.signals.<name>.slow_tests]`` table; figures of the sensor that it does not give are the sensor's.

    The reference is asked about halves of the channels only if its error is given.
    """

    factor: float = Field(default=1.0, ge=1)  # on the limits that follow from white noise, of the two means,
    squares_factor: float | None = Field(default=None, ge=1)  # of the mean of squares; ``factor`` when not given
    halves_factor: float | None = Field(default=None, ge=1)  # and of halves of the channels; the same
    reference_error: float = Field(default=0.0, ge=0)  # largest one of a healthy reference without its bias, unit
    reference_frames: float = Field(default=0.0, ge=0)  # and what it is more by in motion, in changes of a frame
    noise_std: float | None = Field(default=None, gt=0)
    bias_tolerance: float | None = Field(default=None, ge=0)
    scale_tolerance: float | None = Field(default=None, ge=0, lt=1)
    skew_frames: float | None = Field(default=None, ge=0)

    def scaled(self, factor: float) -> SlowTests:
        """Return these settings with every amount in the unit of the signal times ``factor``."""
        amounts = ("reference_error", "noise_std", "bias_tolerance")
        given = {name: value * factor for name in amounts if (value := getattr(self, name)) is not None}
        return self.model_copy(update=given)

    def sheet(self, sensor: DataSheet | None) -> DataSheet:
        """Return the figures of the sensor: those of the table; those of ``sensor``, or 0, where it gives none."""
        beside = sensor or DataSheet(0.0, 0.0, 0.0, 0.0)
        own = (self.noise_std, self.bias_tolerance, self.scale_tolerance, self.skew_frames)
        return DataSheet(*(here if given is None else given for given, here in zip(own, beside, strict=True)))

    def with_figures(self, sensor: DataSheet) -> SlowTests:
        """Return these settings with the figures of ``sensor`` where they give none."""
        return self.model_copy(update=self.sheet(sensor)._asdict())


def refusal(tests: SlowTests, threshold: float, sensor: DataSheet | None) -> str:
    """Return why the tests cannot be run, "" if they can; threshold : least one of the signal."""
    sheet = tests.sheet(sensor)
    if not sheet.noise_std > 0.0:
        return "slow_tests: needs noise_std, the noise of a sample, above 0; no sensor states it"
    if BIAS * sheet.bias_tolerance >= threshold:
        return (
            f"slow_tests: biases are learned up to {BIAS:g} bias_tolerance, {BIAS * sheet.bias_tolerance:g}; "
            f"this must be below the threshold of every level, {threshold:g}"
        )
    return ""


def tests_params(tests: SlowTests | None, sensor: DataSheet | None) -> Mapping[str, Any]:
    """Return the fields of PARAMS that the tests read; all 0 for None, and without noise figures."""
    if tests is None or not tests.sheet(sensor).noise_std > 0.0:
        return OFF
    sheet = tests.sheet(sensor)
    return {
        "slow_means": tests.factor,
        "slow_squares": tests.squares_factor or tests.factor,
        "slow_halves": tests.halves_factor or tests.factor,
        "slow_bias": BIAS * sheet.bias_tolerance,
        "slow_scale": sheet.scale_tolerance,
        "slow_noise": NOISE * sheet.noise_std,
        "slow_skew": sheet.skew_frames,
        "slow_reference": tests.reference_error,
        "slow_reference_frames": tests.reference_frames,
    }
