"""Data-sheet classes: every one has a source and flies, and lies under a sensor's own keys."""

import re
from math import pi, sqrt
from pathlib import Path

import pytest

from rig.core.errors import BadInput
from rig.core.frame import SIGNALS
from rig.scenario import aircraft, scenario
from rig.world.sensors.classes import Figures, kind
from rig.world.sensors.data_sheet import Sensor

CLASSES = aircraft.sensor_classes()
NAMES = sorted(CLASSES)
DEG, HOUR, G = pi / 180, 3600.0, 9.80665
BUILT_IN = 'sensors.pitch_rate.class="tactical-grade MEMS"'


def load(*sets):
    return scenario.load(None, list(sets))


@pytest.mark.parametrize("name", NAMES)
def test_a_class_has_a_source_and_figures_that_make_a_sensor(name):
    known = CLASSES[name]
    assert len(known.source) > 20 and known.kinds
    fits = [s.name for s in SIGNALS if kind(s.name) in known.kinds]
    loaded = load(*(f'sensors.{signal}.class="{name}"' for signal in fits))
    for signal in fits:
        sensor, figures = getattr(loaded.sensors, signal), getattr(known, kind(signal))
        assert all(getattr(sensor, key) == value for key, value in figures)


def test_a_class_speaks_of_nothing_but_the_box():
    assert set(Figures.model_fields) < set(Sensor.model_fields)
    for key in ("channels", "low", "high", "skew_frames", "quantum", "mode_rms", "position_error_per_rad"):
        assert key not in Figures.model_fields


def test_a_class_replaces_what_lies_below_and_leaves_the_installation():
    before, after = load().sensors.pitch_rate, load(BUILT_IN).sensors.pitch_rate
    assert after.class_ == "tactical-grade MEMS"
    assert (after.noise_std, after.lag_s) == (0.0, 0.0) != (before.noise_std, before.lag_s)
    assert (after.quantum, after.skew_frames) == (before.quantum, before.skew_frames)
    assert load(BUILT_IN).sensors.roll_rate == load().sensors.roll_rate


def test_explicit_keys_lie_over_the_class():
    sensor = load(BUILT_IN, "sensors.pitch_rate.noise_std=0.002").sensors.pitch_rate
    assert (sensor.noise_std, sensor.scale_tolerance) == (0.002, 0.0005)


def test_an_aircraft_may_name_a_class_and_a_scenario_may_change_it(tmp_path: Path):
    own = tmp_path / "mine"
    own.mkdir()
    for name in ("aircraft.toml", "gains.toml", "references.toml"):
        (own / name).write_bytes((aircraft.folder("f16") / name).read_bytes())
    with (own / "aircraft.toml").open("a") as file:
        file.write('\n[sensors.pitch_rate]\nclass = "MEMS consumer"\nbias_tolerance = 0.01\n')
    assert load(f"aircraft={own}").sensors.pitch_rate.bias_tolerance == 0.01
    assert load(f"aircraft={own}").sensors.pitch_rate.scale_tolerance == 0.03
    assert load(f"aircraft={own}", BUILT_IN).sensors.pitch_rate.bias_tolerance == 4.2e-5


def test_the_resolved_scenario_needs_no_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    first = load(BUILT_IN)
    (tmp_path / "again.toml").write_text(first.to_toml())
    assert scenario.load(tmp_path / "again.toml") == first
    monkeypatch.setattr(aircraft, "sensor_classes", lambda: pytest.fail("looked up"))
    assert scenario.from_resolved(first.resolved(), "log") == first


REFUSED = [
    ('sensors.pitch_rate.class="best"', "sensors.pitch_rate.class: unknown class 'best', nearest: '"),
    ('sensors.heading.class="MEMS consumer"', "'MEMS consumer' has no values for heading, only for rates"),
    ("sensors.pitch_rate.class=3", "sensors.pitch_rate.class: must be a text"),
    ("sensors=3", "sensors: "),
]


@pytest.mark.parametrize(("text", "says"), REFUSED)
def test_a_class_that_does_not_fit_is_refused_in_one_line(text, says):
    with pytest.raises(BadInput) as caught:
        load(text)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_figures_are_those_of_the_sheets_in_si():
    """Converted here from the units of the sheets, which stand beside the values in the table."""
    stim, mpu, hg = (CLASSES[name] for name in ("tactical-grade MEMS", "MEMS consumer", "navigation-grade RLG"))
    near = lambda figure: pytest.approx(figure, rel=5e-3)  # noqa: E731
    assert stim.rates and stim.load_factors and mpu.rates and mpu.load_factors and hg.rates and hg.load_factors
    assert stim.rates.noise_density == near(0.15 * DEG / sqrt(HOUR))
    assert stim.rates.bias_instability_std == near(0.5 * DEG / HOUR / 0.617)
    assert stim.rates.bias_tolerance == near(5 * DEG / HOUR * sqrt(3))
    assert stim.rates.g_sensitivity_tolerance == near(DEG / HOUR)
    assert stim.load_factors.noise_density == near(0.06 / sqrt(HOUR) / G)
    assert mpu.rates.noise_density == near(0.005 * DEG)
    assert mpu.rates.bias_tolerance == near(20 * DEG)
    assert mpu.rates.bias_instability_std == near(4.6 * DEG / HOUR / 0.617)
    assert hg.rates.bias_tolerance == near(0.0035 * DEG / HOUR * sqrt(3))
    assert hg.load_factors.bias_tolerance == near(25e-6 * sqrt(3))


def test_the_page_names_every_class_and_its_source():
    page = (Path(__file__).parent.parent / "docs" / "reference" / "sensors-and-redundancy.md").read_text()
    for name, known in CLASSES.items():
        (row,) = re.findall(rf"^\| `{re.escape(name)}` \|.*$", page, re.MULTILINE)
        assert " ".join(known.source.split()[:3]) in row
