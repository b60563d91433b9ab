import tomllib
from pathlib import Path

import pytest

from rig import aircraft, scenario
from rig.errors import BadInput
from rig.faults import Hardover
from rig.scenario import find, from_resolved, load

FAULTS = sorted(aircraft.bundled("faults").glob("*.toml"))


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
            "faults.0.channels=[2]",
            'faults.0.direction="low"',
            "turbulence=light",
            "sensors.heading.channels=3",
            "redundancy.signals.pitch_rate.threshold=0.2",
            "airframe.limits.load_factor_max=5",
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


BAD_SETS = [
    ("duratoin_s=5", "duratoin_s: unknown key"),
    ("duration_s=long", "duration_s"),
    ("duration_s=-1", "duration_s: input should be greater than 0, got -1"),
    ("duration_s=nan", "duration_s: input should be a finite number"),
    ("duration_s=inf", "duration_s: input should be a finite number"),
    ("duration_s=0.005", "whole number of frames"),
    ("simulation_rate_hz=250", "whole multiple"),
    ("seed=1.5", "seed"),
    ("aircraft=concorde", "unknown aircraft 'concorde', allowed: b707, b737, b747, f16"),
    ("turbulence=mild", "turbulence"),
    ("faults.0.signal=pitchrate", "unknown signal, allowed: pitch_rate"),
    ("faults.0.channels=[5]", "from 1 to 4"),
    ("faults.0.kind=explode", "'offset', 'drift', 'hardover'"),
    ("faults.0.end_s=1.0", "must be after start_s"),
    ("faults.3.start_s=1.0", "must be an index from 0 to 0"),
    ("redundancy.manager=median4", "unknown manager, allowed: cross-channel, mean, median"),
    ("redundancy.signals.pitch_rate.threshold=0", "greater than 0"),
    ("redundancy.signals.pitch_rate.trend_frames=9", "less than or equal to 8"),
    ("sensors.pitch_rate.channels=1", "greater than or equal to 2"),
    ("sensors.pitchrate.noise_std=1", "pitchrate: unknown key"),
    ("noequals", "must be key=value"),
]


@pytest.mark.parametrize(("text", "says"), BAD_SETS)
def test_bad_settings_are_one_line_that_says_what_is_wrong(text: str, says: str):
    with pytest.raises(BadInput) as caught:
        load(None, [text])
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_fault_on_a_channel_that_is_not_fitted_is_refused():
    with pytest.raises(BadInput, match="pitch_rate has 3 channels"):
        load(None, ["sensors.pitch_rate.channels=3", "faults.0.channels=[4]"])


def test_two_faults_with_one_id_are_refused(tmp_path: Path):
    fault = '[[faults]]\nid = "a"\nkind = "hardover"\nsignal = "heading"\nchannels = [1]\nstart_s = 1.0\n'
    with pytest.raises(BadInput, match="'a' is used twice"):
        load(write(tmp_path, fault + fault))


def test_files_that_cannot_be_read_are_told_with_name_and_line(tmp_path: Path):
    with pytest.raises(BadInput, match=r"nowhere.toml: no such file"):
        load(tmp_path / "nowhere.toml")
    with pytest.raises(BadInput, match=r"mine.toml: not valid TOML: .*line 2"):
        load(write(tmp_path, 'title = "a"\nduration_s = = 3\n'))


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
    wanted = r"history_qf72.toml with --set: flight_point: f16 has no '35000ft_m084', allowed: 20000ft_m06, .*"
    with pytest.raises(BadInput, match=wanted + r"; for example --set flight_point=20000ft_m06$"):
        load("history_qf72", ["aircraft=f16"])
    assert load("history_qf72", ["aircraft=f16", "flight_point=20000ft_m06"]).aircraft == "f16"
