"""FMUs of other tools, with variables of their own names, that a unit file maps to the records."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from importlib import metadata
from math import floor, log10
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_unit_fmu import _nothing_is_left_behind, changed, needs_fmpy  # noqa: F401 # a fixture of this file, too
from unit_files import HERE, kept

import rig
from rig.core.errors import BadInput, UnitRefused
from rig.core.frame import SIGNALS, UnitStatus
from rig.unit import header
from rig.unit.fmu_mapping import OF_ITS_SIGNAL
from rig.unit.unit_file import read_unit
from rig.unit.unit_records import RULES_CONFIG, SIGNAL_CONFIG, SLOW_FAULTS_CONFIG

TOOLS = {"2": "pythonfmu", "3": "pythonfmu3"}
VERSIONS = tuple(TOOLS)
OVERRIDES = ("duration_s=1", "faults.0.start_s=0.3")
SHORT = ("duration_s=0.2", "faults=[]")
NAMES = ["rate_q", "rate_p", "rate_r", "n_z", "n_y", "n_x", "alpha", "beta"]
NAMES += ["p_static", "p_dynamic", "stick_x", "stick_y", "pedals", "theta", "phi", "psi"]


@cache
def made(version: str) -> Path:
    """The median voter of tests/units, packed by the tool of this version of FMI."""
    pytest.importorskip(TOOLS[version])
    pytest.importorskip("fmpy")
    source = HERE / f"median_fmi{version}.py"

    def make(folder: Path) -> Path:
        command = [sys.executable, "-m", TOOLS[version], "build", "-f", str(source), "-d", str(folder)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return folder / "Median.fmu"

    return kept("Median.fmu", [TOOLS[version], metadata.version(TOOLS[version]), source.read_bytes()], make)


def tables(version: str) -> tuple[dict[str, str], dict[str, str]]:
    """Inputs and outputs of the mapping."""
    inputs, outputs = {}, {}
    for i, signal in enumerate(SIGNALS):
        own = f"{NAMES[i]}_*" if version == "2" else f"samples[{i + 1},*]"
        inputs[f"channels.{signal.name}.*"] = own
        outputs[f"voted.{signal.name}"] = NAMES[i] if version == "2" else f"votes[{i + 1}]"
    return inputs, outputs


def unit_of(folder: Path, path: Path, inputs: dict[str, str], outputs: dict[str, str], **more: dict[str, Any]) -> Any:
    """The unit of a file; more : tables of other names."""
    lines = ['name = "median"', 'transport = "fmu"', f'path = "{path}"']
    for name, table in {"inputs": inputs, "outputs": outputs, **more}.items():
        lines += [f"[fmu.{name}]", *(f'"{key}" = {json.dumps(value)}' for key, value in table.items())]
    (folder / "unit.toml").write_text("\n".join(lines))
    return read_unit(folder / "unit.toml")


def fly(folder: Path, path: Path, version: str, *overrides: str) -> rig.Flight:
    return rig.fly(overrides=[*OVERRIDES, *overrides], out=folder, unit=unit_of(folder, path, *tables(version)))


@needs_fmpy
@pytest.mark.parametrize("version", VERSIONS)
def test_a_median_voter_of_another_tool_flies_by_its_own_names(tmp_path: Path, version: str):
    flight = fly(tmp_path, made(version), version)
    rows = flight.rows
    assert (rows["unit"] == UnitStatus.ANSWERED).all() and len(rows) == 100
    assert np.array_equal(rows["voted"], np.median(rows["channels"], axis=2))
    assert flight.survived and flight.unit is not None and flight.unit["reproducible"]


@needs_fmpy
def test_degrees_are_converted_both_ways(tmp_path: Path):
    """A voter that sees degrees per second votes as one that sees radians, but for rounding."""
    degrees = changed(made("2"), tmp_path, r'(name="rate_q[^>]*>\s*<Real)', r'\1 unit="deg/s"')
    feet = changed(degrees.rename(tmp_path / "degrees.fmu"), tmp_path, r'(name="n_z_[^>]*>\s*<Real)', r'\1 unit="m/s2"')
    rows = fly(tmp_path, feet, "2").rows
    expected = np.median(rows["channels"], axis=2)
    assert np.allclose(rows["voted"][:, 0], expected[:, 0], rtol=1e-14, atol=0.0)
    assert np.allclose(rows["voted"][:, 3], expected[:, 3] * 9.80665, rtol=1e-14, atol=0.0), "its output has no unit"


def of_config(flight: rig.Flight, name: str, key: str) -> float:
    return flight.scenario.resolved()["redundancy"]["signals"][name][key]


@needs_fmpy
def test_config_and_constants_reach_an_fmu_of_fmi_2(tmp_path: Path):
    """A real parameter in degrees, a whole one, constants of a parameter and of an input."""
    path = changed(made("2"), tmp_path, r'(name="bias"[^>]*>\s*<Real)', r'\1 unit="deg/s"')
    inputs, outputs = tables("2")
    parameters = {"signal.pitch_rate.threshold": "bias", "signal.heading.persistence": "turns"}
    given = {"parameters": parameters, "constants": {"gain": 1.5, "shift": 0.01}}
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, path, inputs, outputs, **given))
    expected = np.median(flight.rows["channels"], axis=2)
    expected[:, 0] += np.degrees(of_config(flight, "pitch_rate", "threshold"))
    expected[:, 3] *= 1.5
    expected[:, 13] += 0.01
    expected[:, 15] += 1e-3 * of_config(flight, "heading", "persistence")
    assert len(expected) == 20
    np.testing.assert_allclose(flight.rows["voted"], expected, rtol=1e-12, atol=1e-12)


@needs_fmpy
def test_config_and_constants_reach_an_array_of_fmi_3(tmp_path: Path):
    inputs, outputs = tables("3")
    parameters = {"signal.pitch_rate.threshold": "bias[1]", "trim_surface.elevator_rad": "bias[3]"}
    parameters |= {"slow_faults.pitch_rate.stale_frames": "bias[5]", "rules.heading.unresolved_frames": "bias[6]"}
    given = {"parameters": parameters, "constants": {"bias[14]": 0.02}}
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, made("3"), inputs, outputs, **given))
    added = flight.rows["voted"][0] - np.median(flight.rows["channels"][0], axis=1)
    assert added[0] == pytest.approx(of_config(flight, "pitch_rate", "threshold"))
    assert added[13] == pytest.approx(0.02) and 0.0 < abs(added[2]) < 0.5
    assert added[4] == pytest.approx(of_config(flight, "pitch_rate", "stale_frames"))
    assert added[5] == pytest.approx(100.0), "frames: 1 s of redundancy.unresolved_s"
    assert np.flatnonzero(added).tolist() == [0, 2, 4, 5, 13]


def test_units_of_config_are_those_of_the_page():
    page = {name for name, text in header._MEANINGS.items() if text.startswith("unit of the signal")}
    of_signals = (SIGNAL_CONFIG, SLOW_FAULTS_CONFIG, RULES_CONFIG)
    assert page & {name for dtype in of_signals for name in dtype.names or ()} == set(OF_ITS_SIGNAL)


BAD_PARAMETERS = {
    "no such variable": (
        {"parameters": {"rate_hz": "fs"}},
        "fmu.parameters: rate_hz: the FMU has no variable fs; nearest: ",
    ),
    "no such element": (
        {"parameters": {"signal.pitch_rate.treshold": "bias"}},
        "fmu.parameters: signal.pitch_rate.treshold: no such element; nearest: signal.pitch_rate.threshold, ",
    ),
    "a text": ({"parameters": {"aircraft": "bias"}}, "fmu.parameters: aircraft: no such element; "),
    "an output": (
        {"parameters": {"rate_hz": "rate_q"}},
        "fmu.parameters: rate_hz: rate_q has causality output, must be parameter or input",
    ),
    "no whole number": (
        {"parameters": {"signal.heading.threshold": "turns"}},
        "signal.heading.threshold: turns has type Integer, must be Real, Float64, Float32",
    ),
    "two for one": (
        {"parameters": {"signal.heading.threshold": "bias", "signal.pitch_rate.threshold": "bias"}},
        "fmu: bias is mapped 2 times",
    ),
    "a setting that is gone": (
        {"parameters": {"signal.*.outlier_threshold": "bias_*"}},
        "fmu.parameters: signal.*.outlier_threshold: is gone: slow_tests ",
    ),
    "one that has another name in the records": (
        {"parameters": {"slow_faults.heading.bias_gain": "bias"}},
        "fmu.parameters: slow_faults.heading.bias_gain: is gone: slow_tests learns the biases",
    ),
    "a reserved element": (
        {"parameters": {"signal.heading.reserved_0": "bias"}},
        "fmu.parameters: signal.heading.reserved_0: no such element; nearest: ",
    ),
    "a constant as well": (
        {"parameters": {"signal.heading.threshold": "bias"}, "constants": {"bias": 1}},
        "fmu: bias is mapped 2 times",
    ),
    "an input of every frame": (
        {"constants": {"rate_q_1": 0.5}},
        "fmu: rate_q_1 is mapped 2 times",
    ),
    "a constant without a variable": (
        {"constants": {"gian": 2.0}},
        "fmu.constants: the FMU has no variable gian; nearest: gain",
    ),
    "a constant of another type": (
        {"constants": {"turns": 2.5}},
        "fmu.constants: turns has type Integer, which cannot hold 2.5",
    ),
    "a constant out of range": (
        {"constants": {"turns": 3e9}},
        "fmu.constants: turns has type Integer, which cannot hold 3e+09",
    ),
    "a constant output": (
        {"constants": {"rate_q": 1.0}},
        "fmu.constants: rate_q has causality output, must be parameter or input",
    ),
}


@needs_fmpy
@pytest.mark.parametrize("case", BAD_PARAMETERS)
def test_a_parameter_that_does_not_fit_is_refused_in_one_line(tmp_path: Path, case: str):
    given, said = BAD_PARAMETERS[case]
    with pytest.raises(BadInput) as error:
        rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, made("2"), *tables("2"), **given))
    text = str(error.value)
    assert said in text and text.startswith(f"{tmp_path}/unit.toml: median: ") and "\n" not in text
    assert list(tmp_path.glob("*.mcap")) == []


@needs_fmpy
def test_a_parameter_in_another_unit_or_array_is_refused_in_one_line(tmp_path: Path):
    metres = changed(made("2"), tmp_path, r'(name="bias"[^>]*>\s*<Real)', r'\1 unit="m"')
    given = {"parameters": {"signal.pitch_rate.threshold": "bias"}}
    with pytest.raises(BadInput, match=r"threshold: bias is in m: 'm' is not a unit of this quantity; allowed: rad/s"):
        rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, metres, *tables("2"), **given))
    inputs, outputs = tables("3")
    first = inputs.pop("channels.heading.*").replace("*", "1")
    with pytest.raises(BadInput, match=r"fmu\.parameters: samples is in fmu\.inputs, which sets it in each frame"):
        given = {"parameters": {"rate_hz": first}}
        rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, made("3"), inputs, outputs, **given))


@needs_fmpy
def test_a_number_of_config_that_the_variable_cannot_have_ends_the_start_in_one_line(tmp_path: Path):
    """A count of frames beyond a Boolean."""
    flag = changed(made("2"), tmp_path, r'(name="turns".*?<)Integer', r"\1Boolean")
    given = {"parameters": {"signal.heading.persistence": "turns"}}
    said = r"signal\.heading\.persistence is \d+, must be from 0 to 1 for type Boolean"
    with pytest.raises(UnitRefused, match=said) as error:
        rig.fly(overrides=SHORT, out=tmp_path, unit=unit_of(tmp_path, flag, *tables("2"), **given))
    assert "\n" not in str(error.value) and list(tmp_path.glob("*.mcap")) == []


def _without(table: dict[str, str], key: str) -> dict[str, str]:
    return {name: value for name, value in table.items() if name != key}


INPUTS, OUTPUTS = tables("2")
CHANNEL = "channels.pitch_rate.*"
WRONG = {
    "no such variable": (
        {**INPUTS, CHANNEL: "rate_x_*"},
        OUTPUTS,
        "fmu.inputs: channels.pitch_rate.1: the FMU has no variable rate_x_1; nearest: rate_",
    ),
    "no such element": (
        {**INPUTS, "channels.pich_rate.1": "rate_q_1"},
        OUTPUTS,
        "fmu.inputs: channels.pich_rate.1: no such element; nearest: channels.pitch_rate.1, ",
    ),
    "stars": ({**INPUTS, CHANNEL: "rate_q"}, OUTPUTS, "'rate_q' must have as many * as its key, 1"),
    "twice": ({**INPUTS, "channels.pitch_rate.2": "rate_q_1"}, OUTPUTS, "fmu: rate_q_1 is mapped 2 times"),
    "an output as input": (
        {**INPUTS, "channels.pitch_rate.2": "rate_q"},
        OUTPUTS,
        "fmu.inputs: channels.pitch_rate.2: rate_q has causality output, must be input",
    ),
    "a vote less": (
        INPUTS,
        _without(OUTPUTS, "voted.heading"),
        "fmu.outputs: voted.heading not mapped: role redundancy needs it",
    ),
    "a group in parts": (
        INPUTS,
        {**OUTPUTS, "level.*": "rate_q*"},
        "fmu.outputs: level.pitch_rate: the FMU has no variable rate_qpitch_rate; nearest: ",
    ),
    "half a group": (
        INPUTS,
        {**OUTPUTS, "level.pitch_rate": "rate_q"},
        "fmu.outputs: state.pitch_rate.1 and 78 more not mapped: other fields of its group are mapped",
    ),
}


@needs_fmpy
@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path: Path, case: str):
    inputs, outputs, said = WRONG[case]
    with pytest.raises(BadInput) as error:
        rig.fly(overrides=OVERRIDES, out=tmp_path, unit=unit_of(tmp_path, made("2"), inputs, outputs))
    text = str(error.value)
    assert said in text and text.startswith(f"{tmp_path}/unit.toml: median: ") and "\n" not in text
    assert list(tmp_path.glob("*.mcap")) == []


STEP = "canHandleVariableCommunicationStepSize"
OTHERS = {
    "a unit of another quantity": (
        "2",
        (r'(name="rate_q_1"[^>]*>\s*<Real)', r'\1 unit="m"'),
        "channels.pitch_rate.1: rate_q_1 is in m: 'm' is not a unit of this quantity; allowed: rad/s, deg/s, rpm",
    ),
    "an unknown unit": ("3", ('name="samples"', 'name="samples" unit="furlong?"'), "samples[1,1] is in furlong?: "),
    "a text": ("2", ('(name="rate_q_1".*?<)Real', r"\1String"), "rate_q_1 has type String, must be Real, Float64"),
    "only smaller steps": (
        "2",
        (f'{STEP}="true"(.*?)<LogCat', rf'{STEP}="false"\1<DefaultExperiment stepSize="0.001"/><LogCat'),
        f"the FMU accepts only steps of 0.001 s ({STEP} is false), a frame has 0.01 s",
    ),
    "larger steps inside": (
        "3",
        (f'{STEP}="true"', f'{STEP}="true" fixedInternalStepSize="0.02"'),
        "the FMU makes steps of 0.02 s (fixedInternalStepSize), a frame has 0.01 s, no multiple of it",
    ),
    "steps beyond counting": (
        "3",
        (f'{STEP}="true"', f'{STEP}="true" fixedInternalStepSize="5e-324"'),
        "its step size is 4.94066e-324 s, must be 1e-09 or more",
    ),
    "steps of no size": (
        "2",
        (f'{STEP}="true"(.*?)<LogCat', rf'{STEP}="false"\1<DefaultExperiment stepSize="nan"/><LogCat'),
        "its step size is nan s, must be 1e-09 or more",
    ),
    "an array beyond the memory": (
        "3",
        ('<Dimension start="16"', '<Dimension start="100000000000"'),
        "an array has at most 1048576 elements, samples has (100000000000, 4)",
    ),
    "a reference of 64 bits": (
        "2",
        ('valueReference="1"', 'valueReference="4294967297"'),
        "4294967297 does not fit in",
    ),
    "a library elsewhere": (
        "2",
        ('modelIdentifier="[^"]*"', 'modelIdentifier="../../../../tmp/evil"'),
        "modelIdentifier '../../../../tmp/evil' is not the name of a library",
    ),
}


@needs_fmpy
@pytest.mark.parametrize("case", OTHERS)
def test_an_fmu_of_another_kind_is_refused_in_one_line(tmp_path: Path, case: str):
    version, (pattern, text), said = OTHERS[case]
    with pytest.raises((BadInput, UnitRefused)) as error:
        fly(tmp_path, changed(made(version), tmp_path, pattern, text), version)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert list(tmp_path.glob("*.mcap")) == []


@needs_fmpy
def test_an_fmu_that_makes_several_steps_a_frame_flies(tmp_path: Path):
    several = changed(made("3"), tmp_path, f'{STEP}="true"', f'{STEP}="true" fixedInternalStepSize="1e-3"')
    assert fly(tmp_path, several, "3").survived


ROUNDED = {  # at so many frames a second: version of FMI, the only step or the one inside, whether it makes a frame
    "as tools print it": (60, "2", "only", "0.0166667", True),
    "to five digits": (60, "3", "inside", "1.6667e-2", True),
    "half a frame": (60, "3", "inside", "0.008333", True),
    "of a rounded rate": (66.6667, "2", "only", "0.015", True),
    "another step": (60, "2", "only", "0.017", False),
    "another step inside": (60, "3", "inside", "0.017", False),
    "one digit off": (60, "3", "inside", "0.0166668", False),
    "of digits that are zero": (60, "3", "inside", "0.016700", False),
}

ALIKE = ("to five digits", "half a frame", "another step inside", "of digits that are zero")


@needs_fmpy
@pytest.mark.parametrize(
    "case", [pytest.param(one, marks=[pytest.mark.long] if one in ALIKE else []) for one in ROUNDED]
)
def test_a_step_that_is_a_rounded_decimal_makes_a_frame_of_a_rate_that_has_none(tmp_path: Path, case: str):
    rate_hz, version, place, step, flies = ROUNDED[case]
    pattern, text = f'{STEP}="true"', f'{STEP}="true" fixedInternalStepSize="{step}"'
    if place == "only":
        pattern = f'{STEP}="true"(.*?)<LogCat'
        text = rf'{STEP}="false"\1<DefaultExperiment stepSize="{step}"/><LogCat'
    path = changed(made(version), tmp_path, pattern, text)
    of_rate = f"rate_hz={rate_hz}", "duration_s=0.3"
    if flies:
        flight = fly(tmp_path, path, version, *of_rate)
        assert (flight.rows["unit"] == UnitStatus.ANSWERED).all() and flight.frames == round(0.3 * rate_hz)
        return
    with pytest.raises(UnitRefused, match=f"steps of {float(step):g} s .*, a frame has 0.0166666667 s") as error:
        fly(tmp_path, path, version, *of_rate)
    assert "\n" not in str(error.value)


@needs_fmpy
@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 70.0, 90.0, 120.0, 144.0])
@pytest.mark.parametrize("steps", [1, 2, 5])
def test_a_step_of_four_digits_or_more_makes_a_frame_and_one_a_unit_of_the_last_of_them_off_does_not(
    rate_hz: float, steps: int
):
    from rig.unit.fmu_host import makes_a_frame

    for digits in (4, 5, 6, 9):
        step_s = f"{1.0 / rate_hz / steps:#.{digits}g}"
        assert makes_a_frame(step_s, steps, rate_hz)
        if digits < 6:  # within a millionth of a frame it is the same step
            off = 1.5 * 10.0 ** (floor(log10(float(step_s))) + 1 - digits)
            assert not makes_a_frame(f"{float(step_s) + off:#.{digits}g}", steps, rate_hz)


def test_a_mapping_is_of_the_transport_fmu_alone(tmp_path: Path):
    unit_of(tmp_path, Path(__file__), {}, OUTPUTS)
    path = tmp_path / "unit.toml"
    path.write_text(path.read_text().replace('"fmu"', '"library"', 1))
    with pytest.raises(BadInput, match="fmu: the transport library has no variables to map"):
        read_unit(path)


@pytest.mark.parametrize("value", ["x", True, [1]])
def test_a_constant_is_a_number(tmp_path: Path, value: object):
    with pytest.raises(BadInput, match=r"unit\.toml: fmu\.constants\.gain: must be a number"):
        unit_of(tmp_path, Path(__file__), {}, OUTPUTS, constants={"gain": value})
