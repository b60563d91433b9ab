"""A unit that answers its votes alone, the least that it must: it is flown on them as our own manager is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_unit_fmu import _nothing_is_left_behind, fmu, needs_fmpy  # noqa: F401 # a fixture of this file, too
from unit_files import SOURCES, build, compiled, needs_a_compiler, udp, unit, written

import rig
from rig.bench.replay.verify import verify
from rig.bench.unit_check import check
from rig.core.errors import BadInput
from rig.core.frame import SIGNALS, Law, Pattern, Source, State, UnitStatus
from rig.log.recordings.flown_log import recorded
from rig.unit.port import RECEIVED, complete, new_port
from rig.unit.running_unit import running
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import OUTPUT, Role, Said
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

SHORT = ("duration_s=3", "faults.0.start_s=1")
OF_UNIT = {"unit"}  # the field that no manager of ours fills
Start = Callable[[Path], Unit]

# As managers.average and baselines.plain_median vote, but for what no channel of these flights does.
MANAGERS = """
import numpy as np
from rig.core.units.angles import difference, limit

STATE = np.dtype([("vote", "f8"), ("started", "u1")])


class Median:
    def __init__(self, params):
        self.params, self.state = params, np.zeros(len(params), STATE)

    def step(self, bus, fcc, k):
        median(bus, fcc, k, self.params, self.state)


def ranked(bus, k, s, p, st):
    x = np.empty(4)
    n = 0
    for c in range(p["fitted"]):
        sample = bus[k]["channels"][s, c]
        if bus[k]["valid"][s, c] != 0 and p["low"] <= sample <= p["high"]:
            if st["started"] == 0:
                st["vote"], st["started"] = sample, 1
            x[n] = st["vote"] + difference(sample, st["vote"], 1) if p["wraps"] else sample
            n += 1
    return np.sort(x[:n])


def median(bus, fcc, k, params, state):
    for s in range(len(params)):
        p, st = params[s], state[s]
        x = ranked(bus, k, s, p, st)
        n = len(x)
        if n > 0:
            voted = x[n // 2] if n % 2 else x[n // 2 - 1] + 0.5 * (x[n // 2] - x[n // 2 - 1])
            st["vote"] = limit(voted, p["low"], p["high"], p["wraps"])
        fcc[k]["voted"][s] = st["vote"]


def mean(bus, fcc, k, params, state):
    for s in range(len(params)):
        p, st = params[s], state[s]
        x = ranked(bus, k, s, p, st)
        if len(x) > 0:
            total = 0.0
            for i in range(len(x)):
                total += x[i]
            st["vote"] = limit(min(max(total / len(x), x[0]), x[-1]), p["low"], p["high"], p["wraps"])
        fcc[k]["voted"][s] = st["vote"]
"""


def as_python(name: str) -> Start:
    def start(folder: Path) -> Unit:
        (folder / "votes_alone.py").write_text(MANAGERS)
        return written(folder, {"name": "m", "transport": "python", "manager": f"votes_alone:{name}"})

    return start


def as_udp(folder: Path) -> Unit:
    command = [str(build("median_udp")), "--rig", "{address}"]
    return written(folder, {"name": "m", "transport": "udp", "command": command})


def as_fmu(version: Any) -> Start:
    return lambda folder: written(folder, {"name": "m", "transport": "fmu", "path": str(fmu(version, "median"))})


def mapped(folder: Path, outputs: dict[str, str], name: str = "median", version: Any = "2") -> Unit:
    """The FMU of an example by a mapping, as one of another tool: channels, limits, and these outputs."""
    inputs, parameters = {}, {"rate_hz": "rate_hz"}
    for i, signal in enumerate(SIGNALS, 1):
        inputs[f"channels.{signal.name}.*"] = f"channels[{i},*]"
        inputs[f"valid.{signal.name}.*"] = f"valid[{i},*]"
        for key in ("low", "high", "fitted", "wraps"):
            parameters[f"signal.{signal.name}.{key}"] = f"signal[{i}].{key}"
    lines = ['name = "m"', 'transport = "fmu"', f'path = "{fmu(version, name)}"']
    for table, pairs in {"inputs": inputs, "parameters": parameters, "outputs": outputs}.items():
        lines += [f"[fmu.{table}]", *(f'"{key}" = {json.dumps(value)}' for key, value in pairs.items())]
    (folder / "unit.toml").write_text("\n".join(lines))
    return read_unit(folder / "unit.toml")


def by_signal(field: str) -> dict[str, str]:
    return {f"{field}.{signal.name}": f"{field}[{i}]" for i, signal in enumerate(SIGNALS, 1)}


TRANSPORTS = {
    "child": lambda folder: unit(folder, "median"),
    "in process": lambda folder: unit(folder, "median", isolate=False),
    "udp": as_udp,
    "fmu 2": as_fmu("2"),
    "fmu 3": as_fmu("3"),
    "fmu mapped": lambda folder: mapped(folder, by_signal("voted")),
    "class": as_python("Median"),
    "function": as_python("median"),
}


def mark(name: str) -> Any:
    if name in ("class", "function"):
        return name
    return pytest.param(name, marks=[needs_a_compiler, *([needs_fmpy] if "fmu" in name else [])])


def fly(out: Path, tested: Unit | None, *sets: str) -> rig.Flight:
    return rig.fly(overrides=(*SHORT, *sets), out=out, unit=tested)


@pytest.fixture(scope="module")
def of_our_median(tmp_path_factory: pytest.TempPathFactory) -> rig.Flight:
    return fly(tmp_path_factory.mktemp("ours"), None, "redundancy.manager=median")


def differing(one: NDArray[Any], other: NDArray[Any]) -> set[str]:
    return {name for name in one.dtype.names or () if one[name].tobytes() != other[name].tobytes()}


@pytest.mark.parametrize("name", [mark(name) for name in TRANSPORTS])
def test_a_median_that_answers_its_votes_flies_the_bits_of_our_median(
    tmp_path: Path, monkeypatch, of_our_median: rig.Flight, name: str
):
    monkeypatch.chdir(tmp_path)
    ours = of_our_median
    theirs = fly(tmp_path, TRANSPORTS[name](tmp_path))
    assert len(theirs.rows) == 300 and theirs.survived and ours.survived
    assert differing(theirs.rows, ours.rows) <= OF_UNIT
    assert [event.text for event in theirs.events] == [event.text for event in ours.events]
    assert (theirs.rows["state"] == State.OK).all() and (theirs.rows["level"] == 4).all()


@pytest.mark.parametrize("name", ["function", mark("udp")])
def test_a_mean_that_answers_its_votes_is_lost_where_our_mean_is(tmp_path: Path, monkeypatch, name: str):
    monkeypatch.chdir(tmp_path)
    ours = fly(tmp_path, None, "redundancy.manager=mean")
    theirs = fly(tmp_path, as_python("mean")(tmp_path) if name == "function" else udp(tmp_path, [], "mean"))
    assert not ours.survived and 100 < len(ours.rows) < 300
    assert differing(theirs.rows, ours.rows) <= OF_UNIT


@needs_a_compiler
def test_on_two_channels_both_are_in_use_and_no_others(tmp_path: Path):
    sets = ["faults=[]", "sensors.pitch_rate.channels=2", "sensors.heading.channels=3"]
    ours = fly(tmp_path, None, "redundancy.manager=median", *sets)
    theirs = fly(tmp_path, unit(tmp_path, "median"), *sets)
    assert differing(theirs.rows, ours.rows) <= OF_UNIT
    assert (theirs.rows["level"] == [2, *[4] * 14, 3]).all()
    assert (theirs.rows["state"][:, 0] == [State.OK, State.OK, State.ABSENT, State.ABSENT]).all()


@needs_a_compiler
def test_a_later_answer_is_flown_on_its_votes_too(tmp_path: Path):
    rows = fly(tmp_path, unit(tmp_path, "median", latency_frames=2)).rows
    assert rows["unit_age"].tolist() == [0, 1, *[2] * 298]
    assert (rows["level"] == 4).all() and (rows["source"] == Source.VOTED).all()


@needs_a_compiler
def test_its_log_is_scored_and_replayed_as_one_of_our_median(tmp_path: Path, of_our_median: rig.Flight):
    tested = unit(tmp_path, "median")
    ours, theirs = of_our_median, fly(tmp_path, tested)
    with running(tested) as again:
        scored = score_log(theirs.log, Yardstick(), unit=again).score
        assert verify(recorded(theirs.log), unit=again).comparison.identical
        assert verify(recorded(theirs.log), fly=True, unit=again).comparison.identical
    expected = score_log(ours.log, Yardstick()).score
    assert scored.signals == expected.signals and scored.vote_error == expected.vote_error
    assert scored.faults[0].outcome == expected.faults[0].outcome == "missed" and not scored.evidence.silent
    assert theirs.conclusion
    outcome, fault, voted, _ = theirs.conclusion
    assert "the unit under test did not isolate the channel" in fault and "from the true value" in voted
    assert outcome.startswith("SURVIVED: ") and "no channel left" not in voted


@needs_a_compiler
@pytest.mark.parametrize("then", ["hold", "backup", "restart"])
def test_of_one_that_dies_no_channel_is_told_lost(tmp_path: Path, then: str):
    tested = udp(tmp_path, [["die", 150, 150, str(tmp_path / "died")]], "median", on_dead=then, max_missed=3)
    flight = fly(tmp_path, tested)
    (dead,) = [event.frame for event in flight.events if event.name in ("unit dead", "unit restarted")]
    assert dead == 150 and flight.survived and (flight.rows["level"][:, 1:] == 4).all()
    assert flight.rows["level"][[0, 149, -1], 0].tolist() == [4, 4, 3 if then == "backup" else 4]
    assert not any("lost" in event.name or "no channel left" in event.text for event in flight.events)
    assert flight.conclusion and not any("no channel left" in line for line in flight.conclusion)


@needs_a_compiler
def test_a_flight_computer_without_votes_says_nothing_of_channels_that_a_back_up_then_votes(tmp_path: Path):
    dies = [["die", 200, 200, str(tmp_path / "died")]]
    tested = udp(tmp_path, dies, "autopilot", on_dead="backup", role="flight-computer")
    flight = fly(tmp_path, tested)
    rows = flight.rows
    assert np.isnan(rows["voted"][:200]).all() and (rows["state"][:200] == State.ABSENT).all()
    assert not rows["level"][:200].any() and (rows["level"][201:, 1:] == 4).all()
    assert not any(event.name == "signal lost" for event in flight.events)
    told = [event.text for event in flight.events if event.name == "level"]
    assert all(text.startswith("pitch_rate: 4 to 3") for text in told)
    assert flight.conclusion and not any("no channel left" in line for line in flight.conclusion)
    score = score_log(flight.log, Yardstick(), baseline=False).score
    assert all(signal.lost_s == 0.0 for signal in score.signals.values())
    assert set(score.coverage["pitch_rate"].levels) == {4, 3} and set(score.coverage["heading"].levels) == {4}


@needs_a_compiler
def test_a_flight_computer_that_says_no_law_flies_one_of_its_own(tmp_path: Path):
    source = (SOURCES / "autopilot.c").read_text()
    assert "    out->law = RIG_LAW_EXTERNAL;\n" in source
    (tmp_path / "lawless.c").write_text(source.replace("    out->law = RIG_LAW_EXTERNAL;\n", ""))
    made = compiled([tmp_path / "lawless.c"], tmp_path / "liblawless.so")
    tested = written(tmp_path, {"name": "u", "path": str(made), "role": "flight-computer"})
    assert (fly(tmp_path, tested).rows["law"] == Law.EXTERNAL).all()


@pytest.mark.long
@needs_a_compiler
def test_the_check_asks_it_for_no_level_and_takes_all_channels_as_in_use(tmp_path: Path):
    unit(tmp_path, "median", isolate=False)
    interface = check(tmp_path / "unit.toml", interface_only=True)
    assert interface.passed and interface.grade == "interface"
    wrong = [one.detail for one in check(tmp_path / "unit.toml").requirements if not one.passed]
    assert not [text for text in wrong if "level" in text and ("not filled" in text or "is 0" in text)]
    assert [text for text in wrong if "pattern" in text and " is not filled, must be " in text]
    assert [text for text in wrong if " is 0, must be " in text and "state" in text]


# Of level and states one alone -------------------------------------------------------------------------------


def answer(said: Said, unsaid: tuple[str, ...] = (), **fields: Any) -> np.void:
    """What is taken of an answer that fills these fields, on two channels of the first signal and four of others."""
    fitted = np.array([2, *[4] * 15])
    port = new_port(Role.REDUNDANCY, 1, 0, np.zeros(4), 100.0, fitted=fitted, unsaid=unsaid).back
    received = port.records[RECEIVED : RECEIVED + 1]
    received[:] = np.zeros(1, OUTPUT)
    received["said"] = said
    for name, value in fields.items():
        received[name] = value
    complete(port)
    return received[0]


OK, FAILED, ABSENT = State.OK, State.FAILED, State.ABSENT


def test_votes_alone_leave_all_fitted_channels_in_use():
    taken = answer(Said.VOTED, voted=1.5)
    assert (taken["voted"] == 1.5).all() and taken["level"].tolist() == [2, *[4] * 15]
    assert taken["state"][:2].tolist() == [[OK, OK, ABSENT, ABSENT], [OK] * 4]
    assert not taken["reference_usable"].any() and (taken["pattern"] == Pattern.NORMAL).all()


def test_a_level_of_zero_that_is_said_stands():
    taken = answer(Said.VOTED | Said.STATE, voted=1.5)
    assert not taken["level"].any() and (taken["state"] == OK).all()


def test_without_votes_nothing_is_known_of_channels():
    taken = answer(Said.SURFACE, surface=0.25)
    assert np.isnan(taken["voted"]).all() and not taken["level"].any() and (taken["state"] == ABSENT).all()
    assert (taken["surface"] == 0.25).all()


def test_the_level_without_a_field_of_its_own_is_the_number_of_channels_that_are_not_failed():
    states = np.zeros((1, 16, 4), np.uint8)
    states[0, 0], states[0, 1] = [OK, State.SUSPECT, ABSENT, ABSENT], [FAILED, OK, FAILED, State.SUSPECT]
    states[0, 2], states[0, 3] = FAILED, [FAILED, ABSENT, ABSENT, ABSENT]
    taken = answer(Said.VOTED | Said.STATE, ("level",), voted=1.5, state=states, level=9)
    assert taken["level"].tolist() == [2, 2, 0, 0, *[4] * 12] and np.array_equal(taken["state"], states[0])


def test_states_without_fields_of_their_own_are_ok_but_at_level_0():
    levels = np.array([[2, 3, 0, *[4] * 13]], np.uint8)
    taken = answer(Said.VOTED | Said.STATE, ("state",), voted=1.5, state=7, level=levels)
    assert taken["state"][:4].tolist() == [[OK, OK, ABSENT, ABSENT], [OK] * 4, [FAILED] * 4, [OK] * 4]
    assert np.array_equal(taken["level"], levels[0])


@needs_a_compiler
@needs_fmpy
@pytest.mark.parametrize("field", ["level", pytest.param("state", marks=pytest.mark.long)])
def test_an_fmu_may_map_levels_or_states_alone(tmp_path: Path, field: str):
    """first_valid fails no channel: all in use, whichever of the two it says."""
    alone = by_signal("level")
    if field == "state":
        alone = {f"state.{signal.name}.*": f"state[{i},*]" for i, signal in enumerate(SIGNALS, 1)}
    sets = ("sensors.heading.channels=3",)
    one = fly(tmp_path, mapped(tmp_path, {**by_signal("voted"), **alone}, "first_valid"), *sets)
    whole = fly(tmp_path, unit(tmp_path, "first_valid"), *sets)
    assert differing(one.rows, whole.rows) == set() and (one.rows["unit"] == UnitStatus.ANSWERED).all()


@needs_a_compiler
@needs_fmpy
def test_states_in_parts_are_refused_beside_levels(tmp_path: Path):
    outputs = {**by_signal("voted"), **by_signal("level"), "state.pitch_rate.1": "state[1,1]"}
    with pytest.raises(
        BadInput, match=r"fmu\.outputs: state\.pitch_rate\.2 and 62 more not mapped: other fields of its"
    ):
        fly(tmp_path, mapped(tmp_path, outputs))
