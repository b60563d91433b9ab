"""Named data-sheet classes: ``class = "tactical-grade MEMS"`` lays a class's figures under a sensor's own keys.

The table is ``aircraft/sensor_classes.toml``.  A class describes the box: it replaces the values of the tables below it
for noise, bias, scale, alignment and dynamics.  Values of the installation stay: channels, range,
skew, quantum, position error, structural mode.
"""

from __future__ import annotations

from typing import Any, Final

from pydantic import Field

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS
from rig.core.settings import Settings
from rig.core.text import choices, quoted
from rig.world.sensors.data_sheet import FILE_KEYS, NOISE_KEYS

_KIND: Final = {
    "angle_of_attack": "vanes",
    "angle_of_sideslip": "vanes",
    "static_pressure": "static_pressure",
    "dynamic_pressure": "dynamic_pressure",
    "heading": "heading",
}


class Figures(Settings):
    """Data sheet of one kind of sensor: the keys of settings.Sensor that belong to the box."""

    noise_std: float = Field(default=0.0, ge=0)
    noise_density: float = Field(default=0.0, ge=0)
    bias_instability_std: float = Field(default=0.0, ge=0)
    bias_correlation_s: float = Field(default=0.0, ge=0)
    rate_random_walk: float = Field(default=0.0, ge=0)
    bias_tolerance: float = Field(default=0.0, ge=0)
    scale_tolerance: float = Field(default=0.0, ge=0)
    misalignment_tolerance_rad: float = Field(default=0.0, ge=0)
    g_sensitivity_tolerance: float = Field(default=0.0, ge=0)
    lag_s: float = Field(default=0.0, ge=0)
    bandwidth_hz: float = Field(default=0.0, ge=0, le=1e6)
    damping: float = Field(default=0.7071, gt=0)
    latency_s: float = Field(default=0.0, ge=0)


class SensorClass(Settings):
    """One class: the source of its figures, and the figures for each kind of signal that it measures."""

    source: str = Field(min_length=1)
    rates: Figures | None = None
    load_factors: Figures | None = None
    vanes: Figures | None = None
    static_pressure: Figures | None = None
    dynamic_pressure: Figures | None = None
    attitude: Figures | None = None
    heading: Figures | None = None

    @property
    def kinds(self) -> list[str]:
        """The kinds of signal that it measures."""
        return [name for name in SensorClass.model_fields if name != "source" and getattr(self, name) is not None]


def kind(signal: str) -> str:
    """Return the kind of figures of a class that ``signal`` has."""
    group = next(s.group for s in SIGNALS if s.name == signal)
    return _KIND.get(signal, group.replace(" ", "_"))


def under(below: dict[str, Any], above: dict[str, Any], classes: dict[str, SensorClass], source: str) -> dict[str, Any]:
    """Return the ``[sensors]`` table ``below`` as it must be for ``above`` to be laid over it.

    Where ``above`` names a class, that class's figures are put in; where it names a noise file, the drawn noise is
    taken out.  BadInput: no such class, or none for that signal.
    """
    made = dict(below)
    for signal, table in above.items():
        if signal not in INDEX or not isinstance(table, dict) or not isinstance(made.get(signal), dict):
            continue  # a discrete; all else is refused later, with its key
        if isinstance(table.get("class"), str):
            figures = _figures(table["class"], signal, classes, f"{source}: sensors.{signal}.class")
            kept = {key: value for key, value in made[signal].items() if key not in FILE_KEYS}
            made[signal] = {**kept, **figures}
        if isinstance(table.get("noise_file"), str):
            made[signal] = {**made[signal], **dict.fromkeys(NOISE_KEYS, 0.0)}
    return made


def _figures(name: str, signal: str, classes: dict[str, SensorClass], where: str) -> dict[str, Any]:
    if name not in classes:
        known = choices(name, map(repr, classes), "docs/reference/sensors-and-redundancy.md")
        raise BadInput(f"{where}: unknown class {quoted(name)}, {known}")
    figures: Figures | None = getattr(classes[name], kind(signal), None)
    if figures is None:
        raise BadInput(f"{where}: {name!r} has no values for {signal}, only for {', '.join(classes[name].kinds)}")
    return figures.model_dump()
