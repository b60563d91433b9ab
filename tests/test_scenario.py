import os
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.computer.redundancy.manager_config import SignalConfig
from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.core.frame import SIGNALS
from rig.core.settings import read_toml
from rig.flight.loop import Rig, frames
from rig.scenario import aircraft, scenario
from rig.scenario.aircraft import lay_over
from rig.scenario.scenario import find, from_resolved, load
from rig.world.faults.kinds import Hardover

FAULTS = sorted(bundled("faults").glob("*.toml"))


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", FAULTS, ids=lambda path: path.stem)
def test_every_bundled_scenario_loads(path: Path):
    assert load(path).frames > 0


def test_there_are_at_least_eight_of_them_on_all_four_aircraft():
    assert len(FAULTS) >= 8
    assert {load(path).aircraft for path in FAULTS} == {"f16", "b747", "b737", "b707"}


def test_without_a_name_the_pitch_rate_hardover_is_flown():
    assert find().name == "f16_pitch_rate_hardover.toml"
    assert find("f16_pitch_rate_hardover") == find()


def test_a_bundled_file_is_found_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert find("faults/f16_pitch_rate_hardover.toml") == find()


def test_the_resolved_scenario_is_the_same_flight(tmp_path: Path):
    first = load(None, ["sensors.pitch_rate.noise_std=0.01", "redundancy.manager=mean"])
    again = load(write(tmp_path, first.to_toml()))
    assert again == first
    assert from_resolved(first.resolved(), "log") == first


def test_an_override_reaches_tables_lists_and_the_aircraft():
    out = load(
        None,
        [
            *("faults.0.channels=[2]", 'faults.0.direction="low"', "turbulence=light", "sensors.heading.channels=3"),
            *("redundancy.signals.pitch_rate.threshold=0.2", "airframe.limits.load_factor_max=5"),
        ],
        seed=9,
    )
    (fault,) = out.faults
    assert isinstance(fault, Hardover) and (fault.channels, fault.direction) == ([2], "low")
    assert (out.turbulence, out.seed, out.sensors.heading.channels) == ("light", 9, 3)
    assert out.redundancy.signals.pitch_rate.threshold == 0.2
    assert out.airframe.limits.load_factor_max == 5.0


def test_an_aircraft_of_the_users_own_is_found_by_its_folder(tmp_path: Path):
    own = tmp_path / "mine"
    own.mkdir()
    for name in ("aircraft.toml", "gains.toml", "references.toml"):
        (own / name).write_bytes((aircraft.folder("f16") / name).read_bytes())
    assert load(None, [f"aircraft={own}"]).airframe == load().airframe


def test_seeds_of_the_stages_differ_and_belong_to_the_scenarios_seed():
    one, two = load(seed=1).streams(), load(seed=2).streams()
    states = [tuple(s.generate_state(2)) for streams in (one, two) for s in streams.values()]
    assert len(set(states)) == len(states)
    assert list(one) == list(scenario.STREAMS)


@pytest.mark.parametrize(
    ("sets", "frames", "steps"),
    [
        (["rate_hz=60", "duration_s=0.5166667"], 31, 1),
        (["rate_hz=60", "duration_s=10.01667"], 601, 1),
        (["rate_hz=33.3333", "simulation_rate_hz=100", "duration_s=3"], 100, 3),
        (["rate_hz=16.6667", "duration_s=30"], 500, 1),
        (["rate_hz=100", "duration_s=0.01"], 1, 1),
    ],
)
def test_durations_and_rates_may_be_rounded_decimals(sets: list[str], frames: int, steps: int):
    given = load(None, sets)
    assert (given.frames, given.steps_per_frame) == (frames, steps)


BAD_SETS = [
    ("duratoin_s=5", "duratoin_s: unknown key"),
    ("duration_s=long", "duration_s"),
    ("duration_s=-1", "duration_s: must be above 0, got -1"),
    ("duration_s=nan", "duration_s: must be a finite number"),
    ("duration_s=inf", "duration_s: must be a finite number"),
    ("duration_s=0.005", "whole number of frames"),
    ("duration_s=1.001", "whole number of frames"),
    ("duration_s=0.001", "whole number of frames"),
    ("rate_hz=33.33", "whole number of frames"),
    ("simulation_rate_hz=250", "whole multiple"),
    ("seed=1.5", "seed"),
    ("aircraft=concorde", "unknown aircraft 'concorde', allowed: b707, b737, b747, f16"),
    ("turbulence=mild", "turbulence"),
    ("faults.0.signal=pitchrate", "unknown signal, nearest: pitch_rate, "),
    ("faults.0.channels=[5]", "from 1 to 4"),
    ("faults.0.kind=explode", "faults.0.kind: unknown kind 'explode', nearest: "),
    ("faults.0.end_s=1.0", "must be after start_s"),
    ("faults.3.start_s=1.0", "must be an index from 0 to 0"),
    ("redundancy.manager=median4", "unknown manager, allowed: cross-channel, mean, median"),
    ("redundancy.signals.pitch_rate.threshold=0", "must be above 0"),
    ("redundancy.signals.pitch_rate.trend_frames=9", "must be at most 8"),
    ("sensors.pitch_rate.channels=1", "must be 2 or more"),
    ("sensors.pitchrate.noise_std=1", "pitchrate: unknown key"),
    ("noequals", "must be key=value"),
    # Beyond what a frame counter holds
    ("faults.0.start_s=1e300", "start_s: must be at most 1e+06, got 1e+300"),
    ("faults.0.end_s=1e17", "end_s: must be at most 1e+06, got 1e+17"),
    ("faults.0.repeats=9223372036854775808", "repeats: must be at most 1e+09, got 9223372036854775808"),
    ("redundancy.resets=[{at_s=1e300,signal='heading'}]", "at_s: must be at most 1e+06"),
    ("redundancy.signals.heading.fade_s=1e300", "fade_s: must be at most 1e+06"),
    ("redundancy.signals.heading.persistence=9223372036854775808", "persistence: must be at most 1e+09"),
    ("redundancy.signals.heading.readmit_frames=1_000_000_001", "readmit_frames: must be at most 1e+09"),
    ("control.tolerant.noise.drift_walk_rad_s_sqrt_s=1e300", "drift_walk_rad_s_sqrt_s: must be at most"),
    ("control.tolerant.noise.scale_sigma=1e300", "scale_sigma: must be at most 1000"),
    ("sensors.pitch_rate.bandwidth_hz=1e300", "bandwidth_hz: must be at most"),
    ("airframe.elevator.lag_s=5e-324", "lag_s: must be 0.0001 or more"),
    # What no TOML reader, file system or property tree takes
    ("title=" + "[" * 2000 + "]" * 2000, "--set title: nested more than 100 deep"),
    ("duration_s=" + "9" * 5000, "--set duration_s: not valid TOML: a number has too many digits"),
    ("duration_s=0x" + "f" * 5000, "duration_s: must be a number, got a number of thousands of digits"),
    (".".join("a" * 5000) + "=1", "must have at most 100 parts"),
    ("faults.\N{SUPERSCRIPT TWO}=1", "must be an index from 0 to 0"),
    ("faults." + "9" * 5000 + "=1", "must be an index from 0 to 0"),
    ("aircraft=" + "x" * 300, "unknown aircraft 'xxx"),
    ('aircraft="a\\u0000b"', "unknown aircraft 'a"),
    ('sensors.pitch_rate.noise_file="a\\u0000b"', "sensors.pitch_rate.noise_file: a\\u0000b: no such file"),
    ("sensors.pitch_rate.noise_file=" + "x" * 300, "no such file"),
    ('airframe.properties={"a b"=1.0}', "'a b' is not a property's name"),
    ('airframe.properties={"</property>"=1.0}', "'</property>' is not a property's name"),
    ('airframe.properties={"-1"=1.0}', "'-1' is not a property's name"),
    ('airframe.properties={"1a"=1.0}', "'1a' is not a property's name"),
    # Long values and new lines; the nearest name and where the others are
    ("faults.0.kind=" + "x" * 100_000, "unknown kind 'xxx"),
    ("a\nb=1", "a b: unknown key"),
    (
        "duratoin_s=5",
        "unknown key; nearest: duration_s, gains, actuators; all keys: rig scenario show",
    ),
    ("faults.0.strat_s=5.0", "faults.0.strat_s: unknown key; nearest: start_s"),
    ("sensors.pitch_rate.noise_sdt=5.0", "unknown key; nearest: noise_std"),
    ("faults.0.signal=pitchrate", "nearest: pitch_rate, pitch_angle, "),
    ("redundancy.signal.heading=1", "nearest: signals"),
]


@pytest.mark.parametrize(("text", "says"), BAD_SETS)
def test_bad_settings_are_one_line_that_says_what_is_wrong(text: str, says: str):
    with pytest.raises(BadInput) as caught:
        load(None, [text])
    assert says in str(caught.value)
    assert len(str(caught.value)) < 600 and str(caught.value).isprintable()


def test_files_nested_too_deep_or_with_endless_numbers_are_refused(tmp_path: Path):
    for text, says in (
        ("a = " + "[" * 2000 + "]" * 2000, "nested more than 100 deep"),
        (".".join("a" * 900) + " = 1", "nested more than 100 deep"),
        ("duration_s = " + "9" * 5000, "a number has too many digits"),
    ):
        with pytest.raises(BadInput, match=says):
            load(write(tmp_path, text))


def test_a_name_that_no_file_can_have_is_one_that_is_not_there(tmp_path: Path):
    for name in ("x" * 300, "a\0b", str(tmp_path / ("y" * 5000))):
        with pytest.raises(BadInput, match="no such file") as caught:
            find(name)
        assert len(str(caught.value)) < 600 and str(caught.value).isprintable()


def test_a_mistyped_scenario_is_told_the_nearest_and_the_command_that_lists_them():
    with pytest.raises(
        BadInput, match=r"nearest bundled: f16_pitch_rate_hardover, .*; all \d+: rig scenario list"
    ) as caught:
        find("f16_pitch_hardover")
    assert str(caught.value).count("f16_") == 4  # the name itself and three


def test_times_and_counts_up_to_the_limit_fly():
    most = ["faults.0.start_s=1e6", "redundancy.signals.heading.persistence=1_000_000_000", "duration_s=0.1"]
    which = load(None, most)
    rows = np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])
    assert not rows["acting"].any() and (rows["level"][:, 0] == 4).all()


def test_a_fault_on_a_channel_that_is_not_fitted_is_refused():
    with pytest.raises(BadInput, match="pitch_rate has 3 channels"):
        load(None, ["sensors.pitch_rate.channels=3", "faults.0.channels=[4]"])


def test_two_faults_with_one_id_are_refused(tmp_path: Path):
    fault = '[[faults]]\nid = "a"\nkind = "hardover"\nsignal = "heading"\nchannels = [1]\nstart_s = 1.0\n'
    with pytest.raises(BadInput, match="'a' is given twice"):
        load(write(tmp_path, fault + fault))


def test_files_that_cannot_be_read_are_told_with_name_and_line(tmp_path: Path):
    with pytest.raises(BadInput, match=r"nowhere.toml: no such file"):
        load(tmp_path / "nowhere.toml")
    with pytest.raises(BadInput, match=r"mine.toml: not valid TOML: .*line 2"):
        load(write(tmp_path, 'title = "a"\nduration_s = = 3\n'))
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(BadInput, match=r"pipe.toml: is a pipe"):
        read_toml(tmp_path / "pipe.toml")


def test_an_aircraft_without_gains_says_how_to_get_them(tmp_path: Path):
    (tmp_path / "aircraft.toml").write_bytes((aircraft.folder("f16") / "aircraft.toml").read_bytes())
    with pytest.raises(BadInput, match="rig aircraft design"):
        load(None, [f"aircraft={tmp_path}"])


def test_a_merge_goes_down_tables_and_replaces_lists():
    below = {"a": {"x": 1, "y": [1, 2]}, "b": 1}
    assert aircraft.merge(below, {"a": {"y": [3]}, "c": {"z": 1}}) == {"a": {"x": 1, "y": [3]}, "b": 1, "c": {"z": 1}}
    assert below == {"a": {"x": 1, "y": [1, 2]}, "b": 1}


def test_the_toml_is_what_tomllib_reads():
    assert tomllib.loads(load().to_toml())["aircraft"] == "f16"


def test_a_scenario_on_an_aircraft_without_its_flight_point_names_the_key_and_what_is_allowed():
    wanted = r"history_qf72 with --set: flight_point: f16 has no '35000ft_m084', allowed: 20000ft_m06, .*"
    with pytest.raises(BadInput, match=wanted + r"; for example --set flight_point=20000ft_m06$"):
        load("history_qf72", ["aircraft=f16"])
    assert load("history_qf72", ["aircraft=f16", "flight_point=20000ft_m06"]).aircraft == "f16"


def test_a_star_in_a_key_is_every_fault_or_every_signal():
    fault = '{kind="offset", signal="heading", channels=[1], offset=0.1}'
    sets = [f"faults=[{fault}, {fault}]", "faults.*.start_s=3.5", "sensors.*.channels=3"]
    found = load(None, [*sets, 'redundancy.signals.*.tie_break=["trend"]'])
    assert [fault.start_s for fault in found.faults] == [3.5, 3.5]
    for signal in SIGNALS:
        assert getattr(found.sensors, signal.name).channels == 3
        assert getattr(found.redundancy.signals, signal.name).tie_break == ["trend"]
    assert found.redundancy.signals.heading.threshold == load(None).redundancy.signals.heading.threshold


@pytest.mark.parametrize("key", ["*", "pilot.*", "faults.0.*.x", "redundancy.*.threshold"])
def test_a_star_elsewhere_is_refused_with_where_it_may_stand(key: str):
    with pytest.raises(BadInput, match=r"\* is allowed only for redundancy.signals.\*, sensors.\*"):
        load(None, [f"{key}=1"])


def test_a_star_in_an_empty_list_is_refused():
    with pytest.raises(BadInput, match="faults: \\* is allowed only for"):
        load(None, ["faults=[]", "faults.*.start_s=1"])


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({}, True),
        ({"sensors": {"pitch_rate": {"noise_std": 0.001}}}, False),
        ({"sensors": {"pitch_rate": {"channels": 3}}}, True),  # fewer channels with the same errors
        ({"sensors": {"roll_rate": {"noise_std": 0.001}}}, True),  # another signal
        ({"redundancy": {"signals": {"pitch_rate": {"threshold": 0.1}}}}, True),
        ({"rate_hz": 50.0}, False),
        ({"rate_hz": 200.0}, True),
        ({"rate_hz": 50.0, "redundancy": {"signals": {"pitch_rate": {"slow_tests": {"factor": 2.0}}}}}, True),
        ({"redundancy": {"signals": {"pitch_rate": {"slow_tests": False}}}}, False),
    ],
)
def test_slow_tests_of_the_aircraft_go_with_the_sensors_that_they_were_designed_for(given: dict[str, Any], kept: bool):
    of_aircraft = {"redundancy": {"signals": {"pitch_rate": {"threshold": 0.05, "slow_tests": {"factor": 1.5}}}}}
    table = lay_over(of_aircraft, given, "test")["redundancy"]["signals"]["pitch_rate"]
    assert (SignalConfig.model_validate(table).slow_tests is not None) == kept


@pytest.mark.parametrize(
    ("given", "error"),
    [
        ({"pitch_rate": "attitude"}, 0.004),
        ({"roll_rate": "attitude"}, 0.004),  # of another signal
        ({"pitch_rate": "angle_of_attack"}, 0.0),
        ({"pitch_rate": "none"}, 0.0),
        ({"pitch_rate": 3}, 0.0),  # refused later
    ],
)
def test_the_error_of_a_reference_goes_with_the_source_that_it_was_designed_for(given: dict[str, Any], error: float):
    tests = {"factor": 1.5, "reference_error": 0.004, "reference_frames": 8.0}
    of_aircraft = {"redundancy": {"signals": {"pitch_rate": {"threshold": 0.05, "slow_tests": tests}}}}
    table = lay_over(of_aircraft, {"redundancy": {"references": given}}, "test")["redundancy"]["signals"]["pitch_rate"]
    assert table["slow_tests"] == {"factor": 1.5, "reference_error": error, "reference_frames": 2000.0 * error}
    own = {"references": given, "signals": {"pitch_rate": {"slow_tests": {"reference_error": 0.1}}}}
    table = lay_over(of_aircraft, {"redundancy": own}, "test")["redundancy"]["signals"]["pitch_rate"]
    assert table["slow_tests"]["reference_error"] == 0.1


@pytest.mark.parametrize("given", ["false", "{factor=1.5}"])
def test_a_log_keeps_the_slow_tests_that_it_flew_with(given: str):
    key = f"redundancy.signals.pitch_rate.slow_tests={given}"
    flown = load(None, ["sensors.pitch_rate.noise_std=0.001", key])
    kept = from_resolved(flown.resolved(), "").redundancy.signals.pitch_rate.slow_tests
    assert kept == flown.redundancy.signals.pitch_rate.slow_tests and (kept is None) == (given == "false")


@pytest.mark.parametrize(
    ("given", "got"), [("true", ", got True"), ("1", ", got 1"), ("'on'", ", got 'on'"), ("[]", "")]
)
def test_slow_tests_that_are_neither_a_table_nor_false_are_refused_in_one_line(given: str, got: str):
    with pytest.raises(
        BadInput, match=rf"redundancy\.signals\.pitch_rate\.slow_tests: must be a table, or false{got}$"
    ):
        load(None, [f"redundancy.signals.pitch_rate.slow_tests={given}"])
