"""A scenario: one flight as data, composed of the settings of each stage.

Loading merges defaults, aircraft, file and overrides as plain tables, and checks them once.  The resolved scenario
holds all settings (also airframe, sensors and gains), so that a log alone can be flown again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
import tomli_w
from numpy.random import SeedSequence
from pydantic import Field, PrivateAttr, model_validator

from rig.computer.analytic.designed import Designed
from rig.computer.control.autopilot import Config as Control
from rig.computer.control.gains_file import Gains
from rig.computer.lanes.computers_table import Config as Computers
from rig.computer.lanes.computers_table import refuse_long_offsets
from rig.computer.redundancy import Config as Redundancy
from rig.computer.redundancy.manager_config import refuse_blind_tests, refuse_short_wait
from rig.core.decimals import slack, slack_of_product
from rig.core.errors import BadInput, RigError
from rig.core.files import NOT_WHOLE, bundled, is_file, is_folder
from rig.core.frame import CHANNELS, COMPUTERS, DISCRETES, MOST_FAULTS, SIGNALS, RowPart, RowParts
from rig.core.kept import kept
from rig.core.renamed import SCENARIOS, now_called
from rig.core.settings import Settings, build, read_toml
from rig.core.text import nearest, quoted
from rig.core.trust import Trust
from rig.scenario import aircraft
from rig.scenario.overrides import (
    OPTION,
    TABLE,
    Overrides,
    named_manager,
    override,
    override_texts,
    parse_set,
    plain_data,
)
from rig.world.actuators.actuators_table import Config as Actuators
from rig.world.actuators.actuators_table import refuse_unfit
from rig.world.faults import Fault, check
from rig.world.faults.places import OF_LANES, OF_SERVOS, needed_lanes, site
from rig.world.faults.scenario_faults import LiveFault, distinct_keys
from rig.world.plant.airframe import AirframeField
from rig.world.plant.pilot import Config as Pilot
from rig.world.plant.wind import Config as Wind
from rig.world.plant.wind import Turbulence
from rig.world.sensors import Suite, data_sheets, fitted
from rig.world.sensors.inertial import Config as Inertial
from rig.world.sensors.noise_file import pin

DEFAULT: Final = "f16_pitch_rate_hardover.toml"
# The order is part of every recorded flight: append, never insert.
STREAMS: Final = ("plant", "sensors", "faults", "inertial", "actuators", "computers")


class Scenario(Settings):
    """All settings that decide a flight. Made by ``rig.load``."""

    keys_are_in: ClassVar[str] = "rig scenario show"

    title: str = ""  # title in lists and reports
    aircraft: str = "f16"  # bundled name, or path of a folder from the present folder or the scenario's
    flight_point: str | None = None  # name of a flight point; None: the first of the aircraft
    duration_s: float = Field(default=60.0, gt=0, le=360_000)  # length, s
    seed: int = Field(default=0, ge=0, lt=2**63)  # seed of all random draws
    rate_hz: float = Field(default=100.0, ge=1, le=1000)  # frames per second
    simulation_rate_hz: float | None = Field(default=None, ge=1, le=10_000)  # plant steps per second; None: rate_hz
    turbulence: Turbulence = "none"  # none, light, moderate, severe
    wind: Wind = Wind()  # table ``[wind]``
    pilot: Pilot = Pilot()  # table ``[pilot]``
    faults: list[Fault] = Field(default=[], max_length=MOST_FAULTS)  # entries of ``[[faults]]``
    live: list[LiveFault] = []  # entries of ``[[live]]``: faults that a key begins and ends
    requirements: list[str] | None = None  # bundled sets, or paths from the present folder or the scenario's
    control: Control = Control()  # table ``[control]``
    actuators: Actuators = Actuators()  # table ``[actuators]``
    computers: Computers = Computers()  # table ``[computers]``
    airframe: AirframeField  # airframe of the aircraft
    sensors: Suite  # pyright: ignore[reportInvalidTypeForm]  # tables ``[sensors.<signal>]``
    inertial: Inertial  # table ``[inertial]``
    redundancy: Redundancy  # table ``[redundancy]``
    gains: Gains  # designed gains of the aircraft
    references: Designed  # designed references of the aircraft
    _trust: Trust = PrivateAttr(default=Trust())  # no setting: no file can grant it

    @model_validator(mode="before")
    @classmethod
    def _resolved_already(cls, data: Any) -> Any:
        """Refuse the keys of a file by themselves: the aircraft's settings must be laid under them."""
        if isinstance(data, dict) and not data.keys() & {"airframe", "gains", "sensors"}:
            raise BadInput(
                "make a Scenario with rig.load: rig.load({'aircraft': 'f16', ...}), or with the path of a file"
            )
        return data

    @model_validator(mode="after")
    def _a_channel_a_lane(self) -> Scenario:
        """Fit no channel without its lane: three computers do not read a fourth channel."""
        count = self.computers.count
        if count == 1:
            return self
        if count < CHANNELS and self.has_servos:
            raise ValueError(
                f"computers.count: must be 1 or {CHANNELS} with servo actuators, which have one computer per channel; "
                f"got {count}"
            )
        return self.model_copy(update={"sensors": fitted(self.sensors, count)})

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        simulation_hz = self.simulation_rate_hz or self.rate_hz
        steps = simulation_hz / self.rate_hz
        rounded = slack(simulation_hz, 1.0 / self.rate_hz) + slack(self.rate_hz, steps / self.rate_hz)
        if not _whole(steps, rounded):
            raise ValueError(
                f"simulation_rate_hz ({self.simulation_rate_hz:g}) must be a whole multiple of "
                f"rate_hz ({self.rate_hz:g})"
            )
        if not _whole(self.duration_s * self.rate_hz, slack_of_product(self.duration_s, self.rate_hz)):
            raise ValueError(
                f"duration_s ({self.duration_s:g}) must be a whole number of frames of 1/{self.rate_hz:g} s"
            )
        points = [point.name for point in self.airframe.flight_points]
        if self.flight_point is not None and self.flight_point not in points:
            raise ValueError(
                f"flight_point: {self.aircraft} has no {self.flight_point!r}, allowed: {', '.join(points)}; "
                f"for example --set flight_point={points[0]}"
            )
        refuse_unfit(self.actuators, self.airframe)
        self._servos_for_their_faults()
        refuse_long_offsets(self.computers, self.rate_hz)
        refuse_short_wait(self.redundancy, self.rate_hz)
        _refuse_blind_tests(self.redundancy, data_sheets(self.sensors, self.rate_hz))
        self._lanes_for_their_faults()
        fitted = {named.name: getattr(self.sensors, named.name).channels for named in (*SIGNALS, *DISCRETES)}
        check(self.faults, fitted)
        labels = {fault.label for fault in self.faults}
        waiting = [entry.fault for entry in self.live if entry.fault.label not in labels]  # a flown one has them
        if len(self.faults) + len(waiting) > MOST_FAULTS:
            raise ValueError(f"live: at most {MOST_FAULTS} faults are allowed, with those of [[faults]]")
        check([*self.faults, *waiting], fitted)
        distinct_keys(self.live)
        return self

    def _servos_for_their_faults(self) -> None:
        for i, fault in enumerate(self.faults):
            if not self.has_servos and site(fault.signal) in OF_SERVOS:
                raise ValueError(f'faults.{i}.signal: {fault.signal} needs servos: [actuators] model = "servo"')

    def _lanes_for_their_faults(self) -> None:
        count = self.computers.count
        for i, fault in enumerate(self.faults):
            if site(fault.signal) in OF_LANES and (count == 1 or max(needed_lanes(fault.signal)) >= count):
                there = f"lanes A to {COMPUTERS[count - 1]}" if count > 1 else "no lanes"
                what = f"{fault.signal} has a lane that is not there"
                raise ValueError(f"faults.{i}.signal: {what}: [computers] count = {count}, {there}")

    @property
    def has_servos(self) -> bool:
        """Return whether servo actuators move the surfaces."""
        return self.actuators.model == "servo"

    @property
    def row_parts(self) -> RowParts:
        """Parts of the rows of a flight, beside those of the frame."""
        there: dict[RowPart, bool] = {"servo": self.has_servos, "computer": self.computers.count > 1}
        return tuple(part for part, is_there in there.items() if is_there)

    @property
    def frames(self) -> int:
        """Frames of a flight that does not end early."""
        return round(self.duration_s * self.rate_hz)

    @property
    def steps_per_frame(self) -> int:
        """JSBSim steps in a frame."""
        return round((self.simulation_rate_hz or self.rate_hz) / self.rate_hz)

    def armed(self) -> Scenario:
        """Return the scenario with the faults of ``live`` among its faults; their keys start them."""
        waiting = [entry.fault for entry in self.live]
        return self.model_copy(update={"faults": [*self.faults, *waiting]}).trusted(self.trust)

    def streams(self) -> dict[str, SeedSequence]:
        """Return one independent seed per stage; an additional stage does not shift the others."""
        return {name: SeedSequence(self.seed, spawn_key=(i,)) for i, name in enumerate(STREAMS)}

    @property
    def trust(self) -> Trust:
        """Permission to run the manager class that the scenario names, and the file of the scenario."""
        return self._trust

    def trusted(self, trust: Trust) -> Scenario:
        """Return the same scenario with another trust."""
        made = self.model_copy()
        made._trust = trust
        return made

    def resolved(self) -> dict[str, Any]:
        """Return all settings as plain data with their defaults, without those that are None."""
        return self.model_dump(exclude_none=True)

    def to_toml(self) -> str:
        """Return the resolved scenario as TOML; the loaded text gives the same flight."""
        return tomli_w.dumps(self.resolved())


_refuse_blind_tests = kept(refuse_blind_tests)  # runs of a campaign share both arguments


def _whole(number: float, rounded: float) -> bool:
    """Return True for a whole number from 1 on, or one that misses it by what decimals were ``rounded``."""
    whole = max(1.0, np.round(number))
    return bool(abs(number - whole) <= max(1e-9 * whole, rounded))


def find(name: str | Path | None = None) -> Path:
    """Return a scenario's file: the given path, or that name in the bundled ``faults`` folder; None: the default."""
    if not isinstance(name, str | Path | None):
        raise BadInput(f"scenario: must be a file's path, a bundled name, a table or a Scenario, got {quoted(name)}")
    wanted = Path(DEFAULT if name is None else name)
    faults = bundled("faults")
    inside = wanted.relative_to("faults") if wanted.parts[:1] == ("faults",) else wanted
    for candidate in (wanted, faults / inside, faults / f"{inside}.toml"):
        if is_file(candidate):
            return candidate
    if new := SCENARIOS.get(wanted.stem):
        raise BadInput(now_called(str(wanted), new))
    bundled_names = names()
    if name is None:
        raise RigError(f"{faults / inside}: {NOT_WHOLE}: no such file")
    if is_folder(wanted):
        raise BadInput(f"{wanted}: is a folder, must be a scenario file or a bundled name")
    near = ", ".join(nearest(wanted.stem, bundled_names))
    raise BadInput(f"{wanted}: no such file; nearest bundled: {near}; all {len(bundled_names)}: rig scenario list")


def names() -> list[str]:
    """Return the names of the bundled scenarios, in alphabetical order."""
    return sorted(path.stem for path in bundled("faults").glob("*.toml"))


Given = str | Path | Mapping[str, Any] | Scenario | None  # a file, a bundled name, the keys of a file, one loaded


def load(
    name: Given = None, overrides: Overrides = (), seed: int | None = None, *, allow_code: bool = False
) -> Scenario:
    """Load and check a scenario without flying it.

    name : file, bundled name, table with the keys of a scenario file, or a loaded scenario; None: the default
    overrides : texts ``key=value`` as for ``--set``, or a table of dotted keys: ``{"faults.0.offset": 0.01}``
    seed : seed of all random draws, over that of the scenario
    allow_code : True permits a manager class that the file names; one that an override names is always permitted
    BadInput: names the file, the key and the allowed values.
    """
    sets, given = override_texts(overrides), TABLE if isinstance(overrides, Mapping) else OPTION
    if isinstance(name, Scenario):
        return _changed(name, sets, seed, allow_code, given)
    if isinstance(name, Mapping):
        data, source, home = plain_data(name, "scenario"), "scenario", Path()
        shown = source
    else:
        path = find(name)
        data, source, home = read_toml(path), str(path), path.parent
        shown = source if source == str(name) else path.stem  # a bundled one by its name
    data = _beside(_overridden(data, sets, seed, given), home)
    within = shown if not sets else f"{shown} with {given.strip(': ')}"
    chosen = data.get("aircraft", "f16")
    if not isinstance(chosen, str):
        raise BadInput(f"{within}: aircraft: must be a name, got {quoted(chosen)}")
    there = aircraft.located(chosen, home)
    merged = aircraft.lay_over(aircraft.tables(there), data, within)
    try:
        made = build(Scenario, {**merged, "sensors": pin(merged.get("sensors"), home)}, within)
    except BadInput:
        aircraft.refuse_bad(there, Scenario)  # what is wrong may be in its file, not in this one
        raise
    return made.trusted(Trust(source, allow_code, named_manager(map(parse_set, sets))))


def _overridden(data: dict[str, Any], sets: Iterable[str], seed: int | None, given: str) -> dict[str, Any]:
    for text in sets:
        data = override(data, text, given)
    return data if seed is None else {**data, "seed": seed}


def _beside(data: dict[str, Any], home: Path) -> dict[str, Any]:
    """Return the keys of a scenario with the paths of requirement files beside its file."""
    names = data.get("requirements")
    if not isinstance(names, list):
        return data
    paths = [
        str(home / name) if isinstance(name, str) and not is_file(Path(name)) and is_file(home / name) else name
        for name in names
    ]
    return {**data, "requirements": paths}


def _changed(scenario: Scenario, sets: Sequence[str], seed: int | None, allow_code: bool, given: str) -> Scenario:
    """Return a loaded scenario with overrides applied to all settings."""
    trust = scenario.trust.allowing(allow_code)
    if not sets and seed is None:
        return scenario.trusted(trust)
    if any(parse_set(text)[0] == "aircraft" for text in sets):
        raise BadInput("aircraft: cannot be changed in a loaded scenario; load it again with this aircraft")
    made = build(Scenario, _overridden(scenario.resolved(), sets, seed, given), "scenario with overrides")
    return made.trusted(replace(trust, named=named_manager(map(parse_set, sets)) or trust.named))


# What scenarios of older logs lack, as those flights had it: an inertial unit without forces, no rule of common mode.
OLDER: Final[dict[str, Any]] = {
    "redundancy": {"common_mode": "report"},
    "inertial": {
        "force_noise_std_m_s2": 0.0,
        "force_bias_tolerance_m_s2": 0.0,
        "force_scale_tolerance": 0.0,
        "force_quantum_m_s2": 0.0,
    },
}


def from_resolved(data: dict[str, Any], source: str, trust: Trust | None = None) -> Scenario:
    """Build a scenario from the result of ``resolved``, without reading a file.

    trust : permission to run the manager class that it names; if not given, none
    """
    return build(Scenario, aircraft.merge(OLDER, data), source).trusted(trust or Trust(source))
