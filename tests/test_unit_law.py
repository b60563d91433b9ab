"""A unit under test in the role of the control law: the rig votes, the unit flies."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_unit_flight import _nothing_is_left_behind  # noqa: F401 # a fixture of this file, too
from test_unit_fmu import fmu, needs_fmpy
from unit_files import HERE, SOURCES, build, library, needs_a_compiler, of_sources, udp, unit, written

import rig
from rig.bench.replay.verify import verify
from rig.core.errors import BadInput, RigError, UnitRefused
from rig.core.frame import AUTOPILOT_COMMANDS, FLIGHT_INDEX, SIGNALS, SURFACES, Law, UnitStatus, sig
from rig.log.info import info
from rig.log.recordings.flown_log import recorded
from rig.unit.running_unit import running
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import OF_LAW
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

SHORT = ("duration_s=2", "faults.0.start_s=0.5")
OF_THE_LAW = {"command", "estimate", "trust", "sensor_fault", "law"}  # what the rig's own law writes besides surfaces
ROLE = {"role": "control-law"}
DEATHS = {
    "segv": "killed by signal 11 (SIGSEGV)",
    "exit": "exited with status 3",
    "error": "failed: rig_unit_law returned 5",
}


def fly(out: Path, tested: Unit | None, *sets: str, **more: Any) -> rig.Flight:
    return rig.fly(overrides=(*SHORT, *sets), out=out, unit=tested, **more)


def pid(folder: Path, **keys: Any) -> Unit:
    return unit(folder, "pid", **ROLE, **keys)


def in_python(folder: Path, name: str, **keys: Any) -> Unit:
    return written(folder, {"name": "law", "transport": "python", "law": name, **ROLE, **keys})


@pytest.fixture
def built_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module of our own law, as a user's."""
    monkeypatch.syspath_prepend(HERE)
    import built_in_law  # pyright: ignore[reportMissingImports] # from that folder

    yield built_in_law
    sys.modules.pop("built_in_law")


# Our own law, from outside ------------------------------------------------------------------------------------

SCENARIOS = {
    "f16_split_2_2_ilm": {"pitch_rate": [3, 4]},
    "f16_lost_attitude": {name: [1, 2, 3, 4] for name in ("pitch_angle", "roll_angle", "heading")},
    "f16_lost_pitch_rate_backup": {"pitch_rate": [1, 2, 3, 4]},
    "f16_lost_air_data": {name: [1, 2, 3, 4] for name in ("static_pressure", "dynamic_pressure")},
    "b747_engagement_toggling": {"autopilot_engaged": [2]},
    "f16_elevator_coil_open": {},
}
LONG = [pytest.param(name, marks=pytest.mark.long) for name in [*SCENARIOS][1:]]


@pytest.mark.parametrize("name", ["f16_split_2_2_ilm", *LONG])
def test_the_built_in_law_as_a_unit_flies_the_bits_of_itself(tmp_path: Path, built_in: Any, name: str):
    scenario = rig.load(name)
    built_in.flown[:] = [scenario]
    ours, theirs = (
        rig.fly(scenario, out=tmp_path, unit=one) for one in (None, in_python(tmp_path, "built_in_law:BuiltIn"))
    )
    one, other = ours.rows, theirs.rows
    assert len(one) == len(other) and ours.failed == theirs.failed == SCENARIOS[name]
    differ = {field for field in one.dtype.names or () if one[field].tobytes() != other[field].tobytes()}
    assert differ - OF_THE_LAW == {"unit"}
    assert (other["law"] == Law.EXTERNAL).all() and (other["unit"] == UnitStatus.ANSWERED).all()


def test_another_gain_of_one_percent_is_another_flight(tmp_path: Path, built_in: Any):
    built_in.flown[:] = [rig.load(None, SHORT)]
    ours, theirs = (fly(tmp_path, in_python(tmp_path, f"built_in_law:{name}")).rows for name in ("BuiltIn", "Stronger"))
    assert not np.array_equal(ours["truth"], theirs["truth"])


LOST = ("duration_s=5", *(f"faults.{i}.start_s=2" for i in range(3)))  # of f16_lost_attitude


def test_a_law_reads_what_was_voted_in_its_frame_and_nothing_else(
    tmp_path: Path, built_in: Any, monkeypatch: pytest.MonkeyPatch
):
    """The record of every frame holds the row's fields, also where a signal is lost."""
    (tmp_path / "noting.py").write_text(NOTING)
    monkeypatch.syspath_prepend(tmp_path)
    scenario = rig.load("f16_lost_attitude", LOST)
    built_in.flown[:] = [scenario]
    flight = rig.fly(scenario, out=tmp_path, unit=in_python(tmp_path, "noting:Noting"))
    seen, rows = sys.modules.pop("noting").seen, flight.rows
    assert len(seen) == len(rows) and (rows["level"] == 0).any()
    for name in ("frame", *OF_LAW):
        assert np.array([asked[name] for asked in seen]).tobytes() == rows[name].tobytes(), name
    assert [float(asked["time_s"]) for asked in seen] == [k / flight.scenario.rate_hz for k in range(len(rows))]
    assert set(seen[0].dtype.names) - set(OF_LAW) <= {
        *("magic", "version", "kind", "layout", "session", "frame", "time_s", "pad_1", "length", "crc")
    }


NOTING = """
from built_in_law import BuiltIn

seen = []

class Noting(BuiltIn):
    def step(self, asked):
        seen.append(asked.copy())
        return super().step(asked)
"""


# The example --------------------------------------------------------------------------------------------------

MANOEUVRES = {
    "level": [],
    "bank": [{"kind": "step", "axis": "roll_angle", "amplitude": 0.35, "start_s": 10.0}],
    "pitch": [{"kind": "step", "axis": "pitch_angle", "amplitude": 0.05, "start_s": 10.0}],
}


@needs_a_compiler
@pytest.mark.parametrize(
    ("name", "duration_s"),
    [("bank", 30.0), *(pytest.param(name, 60.0, marks=pytest.mark.long) for name in MANOEUVRES)],
)
def test_the_example_in_c_and_that_in_python_fly_a_minute_alike(tmp_path: Path, name: str, duration_s: float):
    """Or half of it: the angles have settled by then."""
    scenario = {"aircraft": "f16", "duration_s": duration_s, "pilot": {"manoeuvres": MANOEUVRES[name]}}
    examples = pid(tmp_path), read_unit(SOURCES / "pid_python.toml")
    first, other = (rig.fly(scenario, out=tmp_path, unit=one) for one in examples)
    assert first.digest == other.digest and first.survived and first.frames == duration_s * 100
    angles, commands = first.rows["truth"][:, [sig.THETA, sig.PHI]], first.rows["autopilot_command"]
    places = [AUTOPILOT_COMMANDS.index(axis) for axis in ("pitch_angle_rad", "roll_angle_rad")]
    assert np.abs(angles[-1] - angles[0] - commands[-1, places]).max() < 0.002
    assert np.abs(angles - angles[0]).max() < 0.45


TRANSPORTS: dict[str, Callable[[Path], Unit]] = {
    "in process": lambda folder: pid(folder, isolate=False),
    "udp": lambda folder: written(
        folder, {"name": "u", "transport": "udp", "command": [str(build("pid_udp")), "--rig", "{address}"], **ROLE}
    ),
    "python": lambda _: read_unit(SOURCES / "pid_python.toml"),
    "fmi 2": lambda folder: written(folder, {"name": "u", "transport": "fmu", "path": str(fmu("2", "pid")), **ROLE}),
    "fmi 3": lambda folder: written(folder, {"name": "u", "transport": "fmu", "path": str(fmu("3", "pid")), **ROLE}),
}
BY_FMU = [
    pytest.param("fmi 2", marks=[needs_fmpy, pytest.mark.long]),
    pytest.param("fmi 3", marks=needs_fmpy),
]


@needs_a_compiler
@pytest.mark.parametrize("transport", ["in process", "udp", "python", *BY_FMU])
def test_the_same_law_flies_the_same_bits_by_every_transport(tmp_path: Path, transport: str):
    by_library, by_transport = (fly(tmp_path, one) for one in (pid(tmp_path), TRANSPORTS[transport](tmp_path)))
    assert by_library.digest == by_transport.digest and by_library.failed == {"pitch_rate": [3]}


@needs_a_compiler
@needs_fmpy
def test_variables_of_an_fmu_of_another_tool_are_mapped_from_the_votes(tmp_path: Path):
    keys = {"name": "u", "transport": "fmu", "path": str(fmu("3", "pid")), **ROLE}
    written(tmp_path, keys)
    (tmp_path / "unit.toml").write_text((tmp_path / "unit.toml").read_text() + mapping())
    mapped = fly(tmp_path, read_unit(tmp_path / "unit.toml")).rows["surface"]
    assert mapped.tobytes() == fly(tmp_path, pid(tmp_path)).rows["surface"].tobytes()


def mapping() -> str:
    """The tables of a unit file for an FMU with our variables, as if they were those of another tool."""
    signals = [signal.name for signal in SIGNALS]
    tables = {
        "inputs": {
            "law_input.{}[{}]": {
                **dict.fromkeys(("voted", "level", "reference", "reference_usable"), signals),
                "autopilot_command": AUTOPILOT_COMMANDS,
            }
        },
        "outputs": {"{}[{}]": {"surface": [f"surface_{name}" for name in SURFACES]}},
        "parameters": {"{}[{}]": dict.fromkeys(("trim_surface", "surface_low", "surface_high"), SURFACES)},
    }
    lines = {
        table: [
            f'"{field}.{name}" = "{form.format(field, i)}"'
            for form, fields in of.items()
            for field, names in fields.items()
            for i, name in enumerate(names, 1)
        ]
        for table, of in tables.items()
    }
    lines["parameters"] += ['"rate_hz" = "rate_hz"', '"role" = "role"']
    return "".join(f"[fmu.{table}]\n" + "\n".join(each) + "\n" for table, each in lines.items())


# Who votes ----------------------------------------------------------------------------------------------------

OWN = """
import numpy as np

class Third:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        fcc[k]["voted"][:] = np.nan_to_num(bus[k]["channels"][:, 2])
"""


@needs_a_compiler
@pytest.mark.parametrize(
    "manager", [*(pytest.param(name, marks=pytest.mark.long) for name in ("mean", "median")), "third_channel:Third"]
)
def test_any_manager_votes_for_the_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, manager: str):
    (tmp_path / "third_channel.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    flight = fly(tmp_path, pid(tmp_path), f"redundancy.manager={manager}")
    rows = flight.rows
    assert (rows["unit"] == UnitStatus.ANSWERED).all() and (rows["law"] == Law.EXTERNAL).all()
    assert flight.voter == f"manager {manager}, law pid" and not flight.failed
    channels = rows["channels"][:40, sig.Q]  # before the fault
    expected = {"mean": channels.mean(axis=1), "median": np.median(channels, axis=1)}.get(manager, channels[:, 2])
    np.testing.assert_allclose(rows["voted"][:40, sig.Q], expected, atol=1e-12)


@needs_a_compiler
def test_the_manager_decides_and_is_named_and_the_law_is_named(tmp_path: Path, rig_command: Any):
    flight = fly(tmp_path, pid(tmp_path))
    assert flight.voter == "manager cross-channel, law pid" and flight.failed == {"pitch_rate": [3]}
    with running(pid(tmp_path)) as again:
        scored = score_log(flight.log, Yardstick(), unit=again)
    assert scored.voter == flight.voter and scored.score.faults[0].outcome == "detected"
    assert not scored.score.evidence.by_unit
    code, out, _ = rig_command("info", str(flight.log))
    assert code == 0 and "cross-channel, law pid" in out
    assert info(flight.log)["unit"] == "pid"


@needs_a_compiler
def test_its_log_is_voted_and_flown_again_to_the_bit(tmp_path: Path):
    flight = rig.fly("f16_lost_attitude", out=tmp_path, unit=pid(tmp_path), overrides=LOST)
    assert (flight.rows["level"] == 0).any()
    with running(pid(tmp_path)) as again:
        open_loop, closed = (verify(recorded(flight.log), fly=fly, unit=again).comparison for fly in (False, True))
    assert open_loop.identical and closed.identical


def test_a_log_replayed_with_another_law_names_its_surfaces(tmp_path: Path, built_in: Any):
    built_in.flown[:] = [rig.load(None, SHORT)]
    flight = fly(tmp_path, in_python(tmp_path, "built_in_law:BuiltIn"))
    with running(in_python(tmp_path, "built_in_law:Stronger")) as other:
        found = verify(recorded(flight.log), unit=other).comparison
    assert not found.identical and [each.name for each in found.fields if each.verdict != "equal"] == [
        "control.surface_elevator_rad"
    ]


# What goes wrong ----------------------------------------------------------------------------------------------


def at_frame(fault: str, frame: int) -> dict[str, str]:
    """The environment of tests/units/faulty.c."""
    return {"FAULT": fault, "FAULT_FRAME": str(frame)}


def faulty(folder: Path, fault: str, frame: int = 50, **keys: Any) -> Unit:
    return unit(folder, "faulty", environment=at_frame(fault, frame), **ROLE, **keys)


@needs_a_compiler
@pytest.mark.parametrize("fault", [pytest.param("segv", marks=pytest.mark.long), "exit", "error"])
def test_a_dead_law_ends_the_flight_in_one_line_with_a_whole_log(tmp_path: Path, fault: str):
    with pytest.raises(RigError) as said:
        fly(tmp_path, faulty(tmp_path, fault))
    assert f"unit.toml: faulty, frame 50: {DEATHS[fault]}" in str(said.value)
    (log,) = tmp_path.glob("*.mcap")
    assert info(log)["damage"] is None and len(rig.read_log(log).rows) == 50


@needs_a_compiler
def test_a_law_that_hangs_is_dead_after_its_time_limit(tmp_path: Path):
    with pytest.raises(RigError, match=r"frame 50: has not answered within timeout_s = 0.3 s"):
        fly(tmp_path, faulty(tmp_path, "hang", timeout_s=0.3))


@needs_a_compiler
def test_a_surface_that_is_no_number_stays_where_it_was(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "nan surface"))
    surface = flight.rows["surface"]
    assert flight.unit is not None and flight.unit["not_finite"] == 1
    assert surface[50, 0] == surface[49, 0] and surface[51, 0] > surface[50, 0] and np.isfinite(surface).all()


@needs_a_compiler
def test_an_answer_without_surfaces_is_refused_and_the_last_one_flown(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "silent"))
    rows = flight.rows
    assert rows["unit"][50] == UnitStatus.REFUSED and np.array_equal(rows["surface"][50], rows["surface"][49])
    assert flight.unit is not None and flight.unit["refused"] == 1


@needs_a_compiler
@pytest.mark.parametrize(
    "kind",
    [
        "short",
        "stale",
        *(pytest.param(k, marks=pytest.mark.long) for k in ("long", "foreign", "layout", "magic", "crc")),
    ],
)
def test_no_other_message_is_flown_as_the_answer(tmp_path: Path, kind: str):
    with pytest.raises(RigError, match=r"frame 60: has not answered within timeout_s = 0.3 s"):
        fly(tmp_path, udp(tmp_path, [[kind, 60, 60]], "pid", timeout_s=0.3, **ROLE))


@needs_a_compiler
def test_an_answer_flown_frames_later_has_that_age(tmp_path: Path):
    at_once, later = (fly(tmp_path, faulty_free(tmp_path, frames)).rows["surface"] for frames in (0, 3))
    assert np.array_equal(later[3:], at_once[:-3]) and np.array_equal(later[:3], at_once[[0] * 3])


def faulty_free(folder: Path, latency_frames: int) -> Unit:
    return unit(folder, "faulty", latency_frames=latency_frames, **ROLE)


@needs_a_compiler
def test_a_law_that_dies_is_started_again(tmp_path: Path):
    mark = str(tmp_path / "died")
    flight = fly(tmp_path, udp(tmp_path, [["die", 60, 60, mark]], "pid", on_dead="restart", **ROLE))
    assert flight.unit is not None and flight.unit["restarts"] == 1 and flight.survived
    assert np.flatnonzero(flight.rows["unit"] == UnitStatus.RESTARTED).tolist() == [60]


@needs_a_compiler
def test_paced_misses_are_held_and_the_manager_votes_on(tmp_path: Path):
    tested = udp(tmp_path, [["lost-reply", 20, 23], ["lost-request", 40, 41]], "pid", **ROLE)
    flight = fly(tmp_path, tested, realtime_factor=1.0)
    rows = flight.rows
    assert flight.unit is not None and flight.unit["missed"] >= 6 and flight.failed == {"pitch_rate": [3]}
    assert (rows["surface"][20:24] == rows["surface"][19]).all()
    assert (np.ptp(rows["voted"][19:24, sig.Q]) > 0.0) and flight.survived


# The back-up --------------------------------------------------------------------------------------------------

CLIMB = {
    "aircraft": "f16",
    "duration_s": 40.0,
    "faults": [],
    "pilot": {"manoeuvres": [{"kind": "step", "axis": "altitude", "amplitude": 60.0, "start_s": 1.0}]},
}


@needs_a_compiler
@pytest.mark.parametrize("manager", [pytest.param("cross-channel", marks=pytest.mark.long), "third_channel:Third"])
def test_the_built_in_law_takes_over_without_a_step_and_keeps_to_the_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, manager: str
):
    """At 5 s; it climbs to what was commanded 4 s before, from the altitude of the first frame."""
    (tmp_path / "third_channel.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    scenario = {**CLIMB, "redundancy": {"manager": manager}}
    flight = rig.fly(scenario, out=tmp_path, unit=faulty(tmp_path, "segv", 500, on_dead="backup"), allow_code=True)
    rows = flight.rows
    assert flight.survived and flight.unit is not None and flight.unit["dead_frame"] == 500
    assert (rows["unit"][501:] == UnitStatus.DEAD).all() and (rows["law"][501:] == Law.AUTOPILOT).all()
    assert np.abs(np.diff(rows["surface"][495:505, :3], axis=0)).max() < 0.01
    altitude = rows["flight"][:, FLIGHT_INDEX["altitude_m"]]
    assert 57.0 < altitude[-1] - altitude[0] < 63.0
    if manager != "cross-channel":
        assert np.array_equal(rows["voted"][501:, sig.Q], rows["channels"][501:, sig.Q, 2])


@needs_a_compiler
def test_without_a_back_up_the_last_surfaces_are_held_and_the_manager_votes_on(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "segv", 40, on_dead="hold"))
    rows = flight.rows
    assert (rows["surface"][40:] == rows["surface"][39]).all() and flight.failed == {"pitch_rate": [3]}


# Bad input ----------------------------------------------------------------------------------------------------


@needs_a_compiler
@pytest.mark.parametrize("isolate", [True, False])
def test_a_library_of_another_role_is_refused(tmp_path: Path, isolate: bool):
    with pytest.raises(
        BadInput, match=r"has no function rig_unit_law; a control law needs rig_unit_open, rig_unit_law"
    ):
        fly(tmp_path, unit(tmp_path, "median", isolate=isolate, **ROLE))
    with pytest.raises(BadInput, match=r"has no function rig_unit_step; a unit needs"):
        fly(tmp_path, unit(tmp_path, "pid", isolate=isolate))
    assert list(tmp_path.glob("*.mcap")) == []


@needs_a_compiler
def test_a_process_of_another_role_says_so(tmp_path: Path):
    for program, role, said in (
        ("monitor", "control-law", "is no control law"),
        ("pid", "redundancy", "is a control law"),
    ):
        command = [str(build(f"{program}_udp")), "--rig", "{address}"]
        tested = written(tmp_path, {"name": "u", "transport": "udp", "command": command, "role": role})
        with pytest.raises(UnitRefused, match=f"refuses the flight: {program} {said}"):
            fly(tmp_path, tested)


LAWS = """
class Law:
    def __init__(self, config):
        if self.bad == "make":
            raise RuntimeError("no gains")
        self.trim = config["trim_surface"].tolist()

    def step(self, asked):
        if asked["frame"] == 50:
            if self.bad == "raise":
                return 1 / 0
            if self.bad == "three":
                return self.trim[:3]
            if self.bad == "text":
                return "surfaces"
            if self.bad == "write":
                asked["voted"][0] = 0.0
        return self.trim

bad = {name: type(name, (Law,), {"bad": name}) for name in ("make", "raise", "three", "text", "write")}
globals().update(bad)
number = 5

def closure(config):
    trim = config["trim_surface"].copy()
    return lambda asked: trim

def without(config):
    return 5
"""
MADE = {
    "missing:Law": "law: 'missing:Law' cannot be imported: ModuleNotFoundError: No module named 'missing'",
    "bad_laws:Missing": "law: 'bad_laws:Missing' cannot be imported: AttributeError",
    "bad_laws:number": "law: 'bad_laws:number' is neither a class nor a function",
    "bad_laws:make": "cannot fly: 'bad_laws:make' cannot be made: RuntimeError: no gains",
    "bad_laws:without": "cannot fly: 'bad_laws:without' has no step(asked)",
}
RAISED = {
    "raise": "raised ZeroDivisionError: division by zero",
    "three": "returned (3,) numbers, must be (4,): elevator_rad, aileron_rad, rudder_rad, throttle",
    "text": "raised ValueError: could not convert string to float: 'surfaces'",
    "write": "raised ValueError: assignment destination is read-only",
}


@pytest.fixture
def laws(tmp_path: Path) -> Iterator[None]:
    """Beside the unit file, where it is found without help."""
    (tmp_path / "bad_laws.py").write_text(LAWS)
    path = [*sys.path]
    yield
    sys.path[:] = path
    sys.modules.pop("bad_laws", None)


@pytest.mark.parametrize("name", MADE)
@pytest.mark.usefixtures("laws")
def test_a_law_in_python_that_cannot_be_made_is_one_line(tmp_path: Path, name: str):
    with pytest.raises(BadInput) as said:
        fly(tmp_path, in_python(tmp_path, name))
    assert str(said.value).startswith(f"{tmp_path}/unit.toml: law") and MADE[name] in str(said.value)
    assert "\n" not in str(said.value) and list(tmp_path.glob("*.mcap")) == []


@pytest.mark.parametrize("name", RAISED)
@pytest.mark.usefixtures("laws")
def test_a_law_in_python_that_fails_ends_the_flight_in_one_line(tmp_path: Path, name: str):
    with pytest.raises(RigError) as said:
        fly(tmp_path, in_python(tmp_path, f"bad_laws:{name}"))
    assert f"frame 50: failed: 'bad_laws:{name}' {RAISED[name]}" in str(said.value)


@pytest.mark.usefixtures("laws")
def test_a_function_may_return_the_law_and_the_backup_take_over_from_one(tmp_path: Path):
    assert fly(tmp_path, in_python(tmp_path, "bad_laws:closure")).unit is not None
    flight = fly(tmp_path, in_python(tmp_path, "bad_laws:raise", on_dead="backup"))
    assert flight.unit is not None and flight.unit["dead_frame"] == 50 and flight.survived
    assert read_unit(tmp_path / "unit.toml").sha256() != ""


# A second unit votes ------------------------------------------------------------------------------------------


def with_voter(folder: Path, name: str = "pid", voter: dict[str, Any] | None = None, **keys: Any) -> Unit:
    """A law beside which a unit votes: our monitor in C."""
    lines = {"name": "votes", "path": str(library("monitor")), **(voter or {})}
    written(folder, lines)
    (folder / "unit.toml").rename(folder / "voter.toml")
    return unit(folder, name, **ROLE, voter="voter.toml", **keys)


@needs_a_compiler
@pytest.mark.long
def test_a_unit_may_vote_for_a_law_that_is_another_unit(tmp_path: Path):
    alone, beside = fly(tmp_path, pid(tmp_path)), fly(tmp_path, with_voter(tmp_path))
    assert beside.digest == alone.digest and beside.voter == "unit votes, law pid"
    assert beside.unit is not None and beside.unit["voter"]["answered"] == beside.unit["answered"] == 200
    with running(with_voter(tmp_path)) as again:
        scored = score_log(beside.log, Yardstick(), unit=again)
        assert scored.score.evidence.by_unit and scored.voter == beside.voter
        assert verify(recorded(beside.log), unit=again).comparison.identical
        assert verify(recorded(beside.log), fly=True, unit=again).comparison.identical
    first = with_voter(tmp_path, voter={"path": str(library("first_valid"))})
    assert fly(tmp_path, first).failed == {} and first.build() != with_voter(tmp_path).build()


@needs_a_compiler
@pytest.mark.parametrize("then", ["end", pytest.param("hold", marks=pytest.mark.long), "backup"])
def test_a_dead_voter_beside_a_law_is_handled_as_its_own_file_names(tmp_path: Path, then: str):
    tested = with_voter(
        tmp_path, voter={"path": str(library("faulty")), "on_dead": then, "environment": at_frame("segv", 40)}
    )
    if then == "end":
        with pytest.raises(RigError, match=r"voter.toml: votes, frame 40: killed by signal 11"):
            fly(tmp_path, tested)
        return
    flight = fly(tmp_path, tested)
    rows = flight.rows
    assert (rows["unit"][40:] == UnitStatus.DEAD).all() and (rows["unit"][:40] == UnitStatus.ANSWERED).all()
    assert flight.unit is not None and flight.unit["answered"] == 200 and flight.unit["voter"]["dead_frame"] == 40
    held = (rows["voted"][40:] == rows["voted"][39]).all()
    assert held == (then == "hold") and flight.failed == ({} if held else {"pitch_rate": [3]})


@needs_a_compiler
def test_a_dead_law_leaves_the_votes_to_the_unit_beside_it(tmp_path: Path):
    flight = fly(tmp_path, with_voter(tmp_path, "faulty", on_dead="backup", environment=at_frame("segv", 40)))
    rows = flight.rows
    assert flight.survived and flight.failed == {"pitch_rate": [3]}
    assert (rows["law"][41:] == Law.AUTOPILOT).all() and flight.unit is not None
    assert (flight.unit["dead_frame"], flight.unit["voter"]["answered"]) == (40, 200)


@needs_a_compiler
@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"role": "flight-computer"}, "voter.toml: must have the role redundancy, and no lane"),
        ({"lane": "B"}, "voter.toml: must have the role redundancy, and no lane"),
        ({"path": "missing.so"}, "path: missing.so: no such file"),
        ({"transport": "python", "manager": "a:B"}, "a manager in Python votes as redundancy.manager"),
    ],
)
def test_a_wrong_voter_is_one_line(tmp_path: Path, keys: dict[str, Any], said: str):
    with pytest.raises(BadInput, match=said):
        with_voter(tmp_path, voter=keys)
    with pytest.raises(BadInput, match="voter: only of a control law that is no lane"):
        unit(tmp_path, "median", voter="voter.toml")
    with pytest.raises(BadInput, match=r"voter: none.toml: no such file"):
        unit(tmp_path, "pid", **ROLE, voter="none.toml")


# Start --------------------------------------------------------------------------------------------------------

STARTING = """
#include <string.h>
#include "rig_unit.h"
static double trim[4];
int rig_unit_open(const struct rig_config *config) { memcpy(trim, config->trim_surface, sizeof trim); return 0; }
int rig_unit_law(const struct rig_law_input *in, struct rig_output *out)
{
    memcpy(out->surface, trim, sizeof trim);
    out->surface[RIG_SURFACE_RUDDER_RAD] += 1e-3;
    out->said = RIG_SAID_SURFACE;
    out->status = in->frame < 50 ? RIG_STATUS_POWER_UP : RIG_STATUS_READY;
    return 0;
}
void rig_unit_close(void) { }
"""


@needs_a_compiler
def test_a_law_that_starts_up_flies_trim_until_it_is_ready(tmp_path: Path):
    (tmp_path / "starting.c").write_text(STARTING)
    made = of_sources("libstarting.so", [tmp_path / "starting.c"])
    flight = fly(tmp_path, written(tmp_path, {"name": "u", "path": str(made), **ROLE}))
    surface, rudder = flight.rows["surface"], SURFACES.index("rudder_rad")
    assert (surface[:50] == surface[0]).all() and surface[50, rudder] == surface[49, rudder] + 1e-3
    assert [event.text for event in flight.events if event.name == "unit status"] == ["power-up", "power-up to ready"]
    late = written(tmp_path, {"name": "u", "path": str(made), "start_s": 0.2, **ROLE})
    with pytest.raises(RigError, match=r"is in power-up after start_s = 0.2 s"):
        fly(tmp_path, late)
