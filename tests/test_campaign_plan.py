"""What varies, how it is sampled, and what is refused before anything is flown."""

import re
from pathlib import Path

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import find, read
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.sampling import seed_of

BASE = 'base = "f16_pitch_rate_hardover"\n'
NORMAL = 'distribution = "norm", parameters = { loc = 0.2, scale = 0.1 }'


def plan(tmp_path: Path, text: str) -> Plan:
    path = tmp_path / "campaign.toml"
    path.write_text(BASE + text)
    return Plan(read(path), "campaign.toml")


def column(made: Plan, key: str) -> list[object]:
    return [choice.get(key) for choice in made.choices]


def test_a_grid_has_every_combination_once_and_goes_around_again_with_new_seeds(tmp_path: Path):
    text = '[vary]\nduration_s = [1.0, 2.0]\n"faults.0.start_s" = { low = 1.0, high = 100.0, log = true, levels = 3 }\n'
    once = plan(tmp_path, text)
    pairs = list(zip(column(once, "duration_s"), column(once, "faults.0.start_s"), strict=True))
    assert pairs == [(d, pytest.approx(s)) for d in (1.0, 2.0) for s in (1.0, 10.0, 100.0)]
    again = plan(tmp_path, "runs = 8\n" + text)
    assert again.choices[6] == again.choices[0]
    assert again[6].data["seed"] != again[0].data["seed"]


def test_cases_lay_their_keys_together_and_vary_within_themselves(tmp_path: Path):
    made = plan(
        tmp_path,
        """
        [[cases.kind]]
        name = "offset"
        set = { "faults.0" = { kind = "offset", signal = "roll_rate", channels = [1], start_s = 1.0, offset = 0.0 } }
        vary = { "faults.0.offset" = [0.1, 0.2] }
        [[cases.kind]]
        name = "hardover"
        [vary]
        turbulence = ["none", "light"]
        """,
    )
    assert len(made) == 6
    scenarios = [made[number].scenario() for number in range(6)]
    assert [s.faults[0].kind for s in scenarios] == ["offset"] * 4 + ["hardover"] * 2
    assert [getattr(s.faults[0], "offset", None) for s in scenarios] == [0.1, 0.1, 0.2, 0.2, None, None]
    assert [s.turbulence for s in scenarios] == ["none", "light"] * 3
    assert scenarios[0].faults[0].signal == "roll_rate" and scenarios[4].faults[0].signal == "pitch_rate"


@pytest.mark.parametrize("sampling", ["random", "latin-hypercube", "sobol"])
def test_samples_lie_within_their_bounds_and_cover_them(tmp_path: Path, sampling: str):
    made = plan(
        tmp_path,
        f"""
        sampling = "{sampling}"
        runs = 200
        [vary]
        "faults.0.start_s" = {{ low = 2.0, high = 4.0 }}
        duration_s = {{ low = 1, high = 5, whole = true }}
        "wind.north_m_s" = {{ {NORMAL}, low = 0.0, high = 0.3 }}
        turbulence = ["none", "light"]
        """,
    )
    start = np.array(column(made, "faults.0.start_s"), float)
    assert 2.0 <= start.min() < 2.2 and 3.8 < start.max() < 4.0
    assert set(column(made, "duration_s")) == {1, 2, 3, 4, 5}
    wind = np.array(column(made, "wind.north_m_s"), float)
    assert wind.min() >= 0.0 and wind.max() <= 0.3
    assert np.median(wind) == pytest.approx(0.1819, abs=0.02)  # of the normal law cut off at both bounds
    assert 60 < column(made, "turbulence").count("light") < 140


def test_a_latin_hypercube_has_one_sample_in_every_share(tmp_path: Path):
    made = plan(tmp_path, 'sampling = "latin-hypercube"\nruns = 50\n[vary]\nduration_s = { low = 0.0, high = 50.0 }\n')
    assert sorted(int(float(str(d))) for d in column(made, "duration_s")) == list(range(50))


def test_seeds_are_those_of_the_campaign_and_the_number_alone(tmp_path: Path):
    few = plan(tmp_path, "seed = 5\nruns = 3\n")
    many = plan(tmp_path, "seed = 5\nruns = 30\n[run]\nworkers = 7\nbatch = 3\n")
    assert [few[n].data["seed"] for n in range(3)] == [many[n].data["seed"] for n in range(3)]
    assert len({seed_of(many.campaign, n) for n in range(30)}) == 30
    assert seed_of(plan(tmp_path, "seed = 6\n").campaign, 0) != few[0].data["seed"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[vary]\n"faults.0.ofset" = [0.1]\n', "campaign.toml: run 0: faults.0.ofset: unknown key"),
        ("[vary]\nspeed = [1.0]\n", "campaign.toml: run 0: speed: unknown key"),
        ('[vary]\n"faults.1.start_s" = [1.0]\n', "vary: '1' must be an index from 0 to 0"),
        ("[vary]\nduration_s = [60.0, -1.0]\n", "run 1: duration_s: must be above 0"),
        ('[vary]\nflight_point = ["nowhere"]\n', "run 0: flight_point: f16 has no 'nowhere'"),
        ('[vary]\naircraft = ["zeppelin"]\n', "unknown aircraft 'zeppelin'"),
        ('[vary."faults.0.start_s"]\ndistribution = "norm"\n', "vary.faults.0.start_s: low: missing"),
        (
            '[vary]\nduration_s = { distribution = "nrm", low = 1, high = 2, levels = 2 }\n',
            "no continuous distribution",
        ),
        ('[vary]\nduration_s = { distribution = "norm", low = 1, high = 2, parameters = { k = 1 } }\n', "parameters"),
        ("[vary]\nduration_s = { low = 2.0, high = 1.0, levels = 2 }\n", r"low \(2\) must be below high \(1\)"),
        ("[vary]\nduration_s = { low = 1.0, high = 2.0 }\n", "vary.duration_s.levels: is needed in a grid"),
        ("[vary]\nduration_s = 3.0\n", "must be a list, a range"),
        ("[vary]\nduration_s = []\n", "vary.duration_s: values: list should have at least 1 item"),
        ('sampling = "random"\n', "runs: is needed"),
        ("runs = 0\n", "runs: must be 1 or more"),
        ("[vary]\nseed = [1]\n", "seed: must not vary"),
        ("[run]\nlogs = 'some'\n", "logs must be all, failures, none or sample:N"),
        ("[run]\nworker = 3\n", "run.worker: unknown key"),
        ("[[cases.a]]\nname = 'x'\n[[cases.a]]\nname = 'x'\n", "each with a different name"),
        ("[vary]\na = [1]\n[[cases.b]]\nname = 'x'\nvary = { a = [1] }\n", "a: is varied in two places"),
        ("set = 5\n", "campaign.toml: set: must be a table of keys"),
        ("set = []\n", "set: must be a table of keys"),
        ('set = "x"\n', "set: must be a table of keys"),
        ("[vary]\nduration_s = { low = 1.0, high = 2.0, levels = 1000000000 }\n", "must be at most 1000000"),
        (
            "[vary]\na = { low = 1.0, high = 2.0, levels = 1001 }\nb = { low = 1.0, high = 2.0, levels = 1000 }\n",
            "vary: the grid has more than 1000000 points",
        ),
        ("[vary]\nduration_s = { low = -1e308, high = 1e308, levels = 3 }\n", "too far apart for a double"),
        ("[vary]\nduration_s = { low = 1e-300, high = 1e300, log = true, levels = 3 }\n", "too far apart"),
        ("[vary]\nduration_s = { low = 1, high = 1e300, whole = true, levels = 3 }\n", "must be within"),
        (
            "[vary]\nduration_s = [9223372036854775808]\n",
            "vary.duration_s: values: a whole number must have at most 64 bits",
        ),
        (f"[vary]\n{'.'.join('a' * 400)} = [1]\n", "nested more than 100 deep"),
        ("[run]\ntimeout_s = 1e300\n", "run.timeout_s: must be at most"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(tmp_path: Path, text: str, says: str):
    with pytest.raises(BadInput, match=says) as error:
        plan(tmp_path, text).check()
    assert "campaign.toml" in str(error.value) and "\n" not in str(error.value)


def test_a_base_that_is_missing_is_refused(tmp_path: Path):
    (tmp_path / "c.toml").write_text('base = "nowhere"\n')
    with pytest.raises(BadInput, match="base: nowhere: no such file"):
        read(tmp_path / "c.toml")
    (tmp_path / "c.toml").write_text("runs = 3\n")
    with pytest.raises(BadInput, match="base: "):
        read(tmp_path / "c.toml")


@pytest.mark.parametrize("name", ["n" * 300, "a\\u0000b", "a\\nb", "\\u001b[2J"])
def test_a_base_that_no_file_can_be_named_is_refused_in_one_printable_line(tmp_path: Path, name: str):
    (tmp_path / "c.toml").write_text(f'base = "{name}"\n')
    with pytest.raises(BadInput, match="base: must be the file of a scenario") as error:
        read(tmp_path / "c.toml")
    assert str(error.value).isprintable() and len(str(error.value)) < 300
    with pytest.raises(BadInput, match="no such file"):
        read("n" * 300)


def test_a_grid_of_more_points_than_runs_makes_no_more_than_the_runs(tmp_path: Path):
    axes = "".join(f"{key} = {{ low = 1.0, high = 2.0, levels = 100000 }}\n" for key in "abc")
    made = plan(tmp_path, f"runs = 5\n[vary]\n{axes}")
    assert column(made, "c") == pytest.approx([1.0 + i / 99_999 for i in range(5)])
    assert {made.choices[i]["a"] for i in range(5)} == {1.0}


@pytest.mark.parametrize(
    ("name", "runs"), [("smoke", 60), ("pitch-rate", 960), ("splits", 2268), ("false-alarm", 90), ("aircraft", 400)]
)
def test_every_bundled_campaign_can_be_flown(name: str, runs: int):
    made = Plan(read(name), str(find(name)))
    made.check()
    assert len(made) == runs


def test_a_campaign_read_back_from_plain_data_is_the_same(tmp_path: Path):
    from rig.studies.campaign.campaign_file import from_what

    made = Plan(read("splits"), "x")
    back = Plan(from_what(made.campaign.what(), "y"), "y")
    assert back.choices == made.choices and back[7].data == made[7].data


GRID = """
title = "Pitch-rate offset at two flight points"
base = "f16_pitch_rate_offset_in_manoeuvre"
sampling = "grid"
runs = 200
seed = 1
requirements = ["redundancy"]
baseline = false

[set]
duration_s = 12.0

[vary]
flight_point = ["20000ft_m06", "10000ft_m08"]
"faults.0.offset" = { low = 0.02, high = 0.5, log = true, levels = 10 }

[vary."faults.0.start_s"]
distribution = "norm"
parameters = { loc = 5.0, scale = 1.0 }
low = 3.0
high = 7.0
levels = 3

[[cases.manoeuvre]]
name = "level"
set = { "pilot.manoeuvres" = [] }

[[cases.manoeuvre]]
name = "3-2-1-1"
vary = { "pilot.manoeuvres.0.amplitude" = [0.2, 0.4] }

[run]
workers = 2
batch = 10
logs = "failures"
timeout_s = 300.0
"""


def test_a_grid_of_values_ranges_a_distribution_and_cases_can_be_flown(tmp_path: Path):
    (tmp_path / "campaign.toml").write_text(GRID)
    made = Plan(read(tmp_path / "campaign.toml"), "campaign.toml")
    made.check()
    assert len(made) == 200 and set(column(made, "manoeuvre")) == {"level", "3-2-1-1"}
    assert len({tuple(map(str, choice.items())) for choice in made.choices}) == 3 * 2 * 10 * 3


def test_the_example_in_the_docs_can_be_flown(tmp_path: Path):
    page = (Path(__file__).parent.parent / "docs" / "how-to" / "campaigns-and-worst-case.md").read_text()
    (text,) = re.findall(r"```toml title=.*?\n(.*?)```", page, re.DOTALL)
    (tmp_path / "campaign.toml").write_text(text)
    made = Plan(read(tmp_path / "campaign.toml"), "campaign.toml")
    made.check()
    assert len(made) == 8 and set(column(made, "manoeuvre")) == {"level", "3-2-1-1"}


STRATIFIED = """
sampling = "stratified"
runs = 12
[vary]
"faults.0.start_s" = { low = 1.0, high = 5.0 }
[[cases.kind]]
name = "up"
set = { "faults.0.kind" = "offset", "faults.0.direction" = 0 }
vary = { "faults.0.offset" = { low = 0.1, high = 1.0, log = true } }
[[cases.kind]]
name = "down"
vary = { "faults.0.offset" = { low = -1.0, high = -0.1, log = true } }
[[cases.weather]]
name = "calm"
[[cases.weather]]
name = "rough"
[[cases.weather]]
name = "worse"
"""


def test_stratified_runs_go_around_all_cases_and_draw_what_varies_for_each(tmp_path: Path):
    made = plan(tmp_path, STRATIFIED)
    around = [(kind, weather) for kind in ("up", "down") for weather in ("calm", "rough", "worse")]
    assert list(zip(column(made, "kind"), column(made, "weather"), strict=True)) == around * 2
    starts = column(made, "faults.0.start_s")
    assert len(set(starts)) == 12 and all(1.0 <= start <= 5.0 for start in starts)  # type: ignore[operator]


def test_a_logarithmic_range_may_lie_below_zero(tmp_path: Path):
    made = plan(tmp_path, STRATIFIED.replace("runs = 12", "runs = 600"))
    down = np.array([c["faults.0.offset"] for c in made.choices if c["kind"] == "down"])
    assert down.min() >= -1.0 and down.max() <= -0.1
    assert 0.4 < np.mean(down < -(0.1**0.5)) < 0.6  # half of them on either side of the geometric middle


def test_every_cell_of_the_campaign_reliability_is_planned():
    made = Plan(read("reliability"), "reliability.toml")
    designs = {str(choice["design"]).split(",")[0] for choice in made.choices}
    assert designs == {f"single {n}" for n in (1, 2, 3, 4)} | {f"{d} {n}" for d in ("near", "alike") for n in (2, 3, 4)}
    assert len({tuple(c[g] for g in ("design", "form", "signal", "condition")) for c in made.choices}) == len(made)
    scenario = made[1500].scenario()
    assert scenario.faults[0].label == "tested" and scenario.duration_s == 8.0
