"""Every key of the settings is on its page of the reference, with its default, and no other key is."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from rig.computer.analytic.pitch_filter import Noise
from rig.computer.analytic.reference_sources import Config as References
from rig.computer.control.autopilot import Config as Control
from rig.computer.fdi.pitch_test_state import Config as Tolerant
from rig.computer.lanes.computers_table import Config as Computers
from rig.computer.redundancy.baseline_managers.baseline_settings import Baseline, Baselines, LearnedBias
from rig.computer.redundancy.discrete_config import DiscreteConfig
from rig.computer.redundancy.manager_config import Config as Redundancy
from rig.computer.redundancy.manager_config import SignalConfig
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.world.actuators.actuators_table import Config as Actuators
from rig.world.sensors.data_sheet import Monitor, Sensor
from rig.world.sensors.inertial import Config as Inertial

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "docs" / "reference"
BUNDLED = tomllib.loads((ROOT / "aircraft" / "defaults.toml").read_text())
SENSORS, COMPUTERS, CONTROL = "sensors-and-redundancy.md", "computers-and-actuators.md", "control.md"
BASELINES = {  # those with keys of their own
    name: kind
    for name in Baselines.model_fields
    if (kind := type(getattr(Baselines(), name))).model_fields.keys() - Baseline.model_fields.keys()
}
# The page and heading of each table of keys, with the settings that it lists.
TABLES: dict[tuple[str, str], type[BaseModel]] = {
    (SENSORS, "[sensors.<signal>]"): Sensor,
    (SENSORS, "In-line monitor of sticks and pedal"): Monitor,
    (SENSORS, "[inertial]"): Inertial,
    (SENSORS, "[redundancy]"): Redundancy,
    (SENSORS, "[redundancy.signals.<name>]"): SignalConfig,
    (SENSORS, "[redundancy.signals.<name>.slow_tests]"): SlowTests,
    (SENSORS, "[redundancy.discretes.<name>]"): DiscreteConfig,
    (SENSORS, "[redundancy.references]"): References,
    (SENSORS, "Every [redundancy.baselines.<name>]"): Baseline,
    (SENSORS, "Learned bias"): LearnedBias,
    **{(SENSORS, name): kind for name, kind in BASELINES.items()},
    (COMPUTERS, "[computers]"): Computers,
    (COMPUTERS, "Tests of a lane"): Computers,
    (COMPUTERS, "[actuators]"): Actuators,
    (COMPUTERS, "Monitors of a channel"): Actuators,
    (CONTROL, "[control]"): Control,
    (CONTROL, "[control.tolerant]"): Tolerant,
    (CONTROL, "[control.tolerant.noise]"): Noise,
}
# Tables whose page shows the keys of inner tables as inner.key, and where.
INNER = {Computers: "Tests of a lane", Actuators: "Monitors of a channel"}
GIVEN = {  # the bundled values of keys that have no default of their own
    Inertial: BUNDLED["inertial"],
    Monitor: BUNDLED["sensors"]["stick_pitch"]["monitor"],
}


def table(page: str, heading: str) -> dict[str, str]:
    """The keys of the table below a heading, each with its default."""
    text = (REFERENCE / page).read_text()
    (section,) = (
        part
        for part in re.split(r"^#+ ", text, flags=re.MULTILINE)[1:]
        if part.partition("\n")[0].replace("`", "") == heading
    )
    (rows,) = re.findall(r"^\| key \| unit \| default \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", section, re.MULTILINE)
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows.splitlines()]
    keys = {re.sub(r"[` *]", "", row[0]): row[2].strip("`") for row in cells}
    assert len(keys) == len(cells), "a key has two rows"
    assert all(len(row) == 4 for row in cells)
    return keys


def defaults(place: tuple[str, str], settings: type[BaseModel]) -> dict[str, Any]:
    """The keys that a table has to show, each with its default: None if it has none, a model if it is a table."""
    shared = set(Baseline.model_fields) if settings is not Baseline and issubclass(settings, Baseline) else set()
    found: dict[str, Any] = {
        field.alias or name: None if field.is_required() else field.default
        for name, field in settings.model_fields.items()
        if name not in shared
    }
    if settings in INNER:
        inner = {name: default for name, default in found.items() if isinstance(default, BaseModel)}
        if place[1] == INNER[settings]:
            return {
                f"{name}.{key}": given for name, model in inner.items() for key, given in model.model_dump().items()
            }
        return {name: default for name, default in found.items() if name not in inner}
    return found | GIVEN.get(settings, {})


def value(shown: str) -> Any:
    """The value that a cell of a table shows; the text itself if it is none."""
    try:
        return tomllib.loads(f"x = {shown}")["x"]
    except tomllib.TOMLDecodeError:
        return shown


PLACES = [pytest.param(place, settings, id="-".join(place)) for place, settings in TABLES.items()]


@pytest.mark.parametrize(("place", "settings"), PLACES)
def test_a_table_of_the_reference_has_every_key_and_no_other(place: tuple[str, str], settings: type[BaseModel]):
    assert set(table(*place)) == set(defaults(place, settings))


@pytest.mark.parametrize(("place", "settings"), PLACES)
def test_a_table_of_the_reference_shows_the_defaults(place: tuple[str, str], settings: type[BaseModel]):
    """A default is shown as TOML; of a key without one there are words, and nothing of a table."""
    for name, default in defaults(place, settings).items():
        shown = table(*place)[name]
        if isinstance(default, BaseModel):
            assert shown == "", name
        elif default is None or (default == {} and shown == "aircraft"):
            assert shown and not isinstance(value(shown), int | float), name
        else:
            assert value(shown) == default, name


def test_every_table_of_keys_is_compared():
    """A table that nothing compares would not be noticed when its settings change."""
    shown = [
        (page, part.partition("\n")[0].replace("`", ""))
        for page in (SENSORS, COMPUTERS, CONTROL)
        for part in re.split(r"^#+ ", (REFERENCE / page).read_text(), flags=re.MULTILINE)[1:]
        if "\n| key | unit | default |" in part
    ]
    assert sorted(shown) == sorted(TABLES)
