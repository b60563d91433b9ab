"""What hostile cases begin with: sound scenarios, logs, recordings and a campaign folder, made once."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import foreign_logs
import tomli_w

from hostile_cases.places import SPARSE_BYTES

CAMPAIGN: Final[dict[str, Any]] = {
    "title": "two by two",
    "base": "f16_pitch_rate_offset_in_manoeuvre",
    "sampling": "grid",
    "runs": 4,
    "seed": 1,
    "baseline": False,
    "set": {"duration_s": 0.5, "faults.0.start_s": 0.2, "faults.0.end_s": 0.4},
    "vary": {
        "faults.0.offset": {"values": [0.02, 0.3]},
        "flight_point": ["20000ft_m06", "10000ft_m08"],
        "faults.0.start_s": {"low": 0.1, "high": 0.3, "log": False, "whole": False, "levels": 1},
        "sensors.pitch_rate.noise_std": {
            "distribution": "norm",
            "low": 1e-4,
            "high": 3e-4,
            "parameters": {"loc": 2e-4, "scale": 1e-4},
            "levels": 1,
        },
    },
    "cases": {"manoeuvre": [{"name": "level", "set": {"pilot.manoeuvres.0.amplitude": 0.0}, "vary": {}}]},
    "run": {"workers": 1, "batch": 2, "logs": "none", "timeout_s": 60.0},
}
VOTE: Final[dict[str, Any]] = {
    "default": {"threshold": 0.02},
    "time_column": "time_s",
    "signal": {
        "pitch_rate": {
            "persistence": 8,
            "split_persistence": 10,
            "tie_break": ["ilm", "trend", "reference"],
            "trend_frames": 3,
            "reference_threshold": 0.05,
            "range": [-1.5, 1.5],
            "mean": "trend-weighted",
            "readmit_frames": 100,
            "fade_s": 0.1,
            "manager": "cross-channel",
            "selection_deviation": 0.1,
            "selection_integral_s": 0.1,
        },
        "heading": {"wraps": True, "range": [-math.pi, math.pi]},
    },
    "resets": [{"at_s": 0.3, "signal": "pitch_rate", "channels": [4]}],
}
MAPPING: Final = {f"gyro.{c}": f"/imu{c}:data.x" for c in (1, 2, 3)}
_BASES: Final = (
    *("f16_data_sheet_gyros", "f16_lost_pitch_axis", "f16_pitch_sensor_recovers", "b707_pitch_sensor_half"),
    *("b737_turn_through_north", "b747_civil_air_data", "f16_altitude_step_turbulence"),
)

_CHECKOUT: Final = Path(__file__).parents[2]
_OF_CHECKOUT: Final = {
    "rates.toml": "faults/rates/zhang2023.toml",
    "chain.toml": "docs/examples/chain.toml",
    "handling.toml": "faults/requirements/handling.toml",
    "suite.toml": "faults/suites/bundled.toml",
    **{name: f"docs/examples/plants/{name}" for name in ("tank.py", "tank.toml")},
}


class Store:
    """The sound files, below one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def scenarios(self) -> dict[str, dict[str, Any]]:
        """Resolved scenarios by name; ``everything`` has a fault of every kind."""
        from rig.scenario.scenario import load

        everything = self.folder / "everything.toml"
        found = {"everything": load(everything).resolved()}
        for name in _BASES:
            found[name] = load(name, ["duration_s=0.5"]).resolved()
        return found

    def make(self) -> None:
        """Write the files, each step in a process of its own: threads that it starts end with it."""
        self.folder.mkdir(parents=True)
        (self.folder / "everything.toml").write_text(tomli_w.dumps(_everything()))
        (self.folder / "campaign.toml").write_text(tomli_w.dumps(CAMPAIGN))
        (self.folder / "vote.toml").write_text(tomli_w.dumps(VOTE))
        (self.folder / "foreign.toml").write_text(tomli_w.dumps({"default": {"threshold": 0.1}, "mapping": MAPPING}))
        self._plain()
        for seed in (1, 2):
            self._rig("fly", "everything.toml", "--seed", str(seed), "--out", "logs", "--json")
        for seed, name in ((1, "log.mcap"), (2, "other.mcap")):
            (self.folder / "logs" / f"everything_seed{seed}.mcap").rename(self.folder / name)
        for ending in ("csv", "parquet"):
            names = "pitch_rate,heading,roll_angle"
            self._rig("export", "log.mcap", "--to", ending, "--for-vote", "--signals", names, "--out", f"in.{ending}")
            self._rig("vote", "in.csv", "--config", "vote.toml", "--out", f"votes.{ending}")
        self._rig("vote", "in.csv", "--config", "vote.toml", "--out", "votes.mcap")
        self._fork(_foreign)
        self._rig("campaign", "run", "campaign.toml", "--out", "camp", "--logs", "all", "--json")
        self._rig("campaign", "run", "reliability", "--out", "cells", "--runs", "2", "--workers", "1", "--json")
        of_tank = ("tank.toml", "--plant", "tank.py:tank", "--flights", "8", "--workers", "1", "--json")
        self._rig("search", *of_tank, "--out", "tanked")
        few = ("--flights", "1", "--order", "1", "--conditions", "level-settled", "--workers", "1")
        self._rig("reliability", "cutsets", "--out", "cuts", *few, "--json")

    def _plain(self) -> None:
        """Write what no command makes."""
        for name, place in _OF_CHECKOUT.items():
            (self.folder / name).write_bytes((_CHECKOUT / place).read_bytes())
        rates = (
            (self.folder / "rates.toml").read_text().replace("[1e-3, 2e-3]", "[1e-3]").replace("[0.0, 0.01]", "[0.0]")
        )
        (self.folder / "rates.toml").write_text(rates)
        (self.folder / "flight.ulg").write_bytes(foreign_logs.gyros())
        (self.folder / "flight.bin").write_bytes(foreign_logs.imus())
        (self.folder / "noise.csv").write_text("".join(f"{k}e-6,2e-6,-3e-6,{-k}e-6\n" for k in range(99)))
        (self.folder / "redundancy.toml").write_text('[redundancy]\nmanager = "median"\n')
        (self.folder / "unit.toml").write_text('name = "u"\ntransport = "python"\nmanager = "evilmod:M"\n')
        shutil.copytree(_CHECKOUT / "aircraft" / "f16", self.folder / "own")
        (self.folder / "trials").mkdir()
        (self.folder / "trials" / "trials.json").write_text('{"format": 1}')
        with (self.folder / "sparse").open("wb") as file:
            file.truncate(SPARSE_BYTES)

    def _rig(self, *argv: str) -> None:
        from hostile_cases.child import command

        self._fork(lambda: command(argv))

    def _fork(self, work: Callable[[], int]) -> None:
        from hostile_cases.child import UNEXPECTED, quiet

        sys.stdout.flush()
        pid = os.fork()
        if pid == 0:
            code = UNEXPECTED
            try:
                os.chdir(self.folder)
                quiet(self.folder)
                code = work()
            finally:
                os._exit(code)
        _, status = os.waitpid(pid, 0)
        if os.waitstatus_to_exitcode(status):
            said = "".join((self.folder / name).read_text() for name in ("out", "err"))
            raise RuntimeError(f"the sound files could not be made: {said[-2000:]}")

    def copy(self, name: str, folder: Path, to: str | None = None) -> Path:
        """One of the files or folders, in a case's own folder."""
        target = folder / (to or name)
        if (self.folder / name).is_dir():
            shutil.copytree(self.folder / name, target)
        else:
            shutil.copyfile(self.folder / name, target)
        return target


def _everything() -> dict[str, Any]:
    """A scenario of the F-16 with a fault of every kind, resets, wind and manoeuvres."""
    from rig.core.settings import read_toml
    from rig.scenario.scenario import find
    from rig.world.faults.fault_catalogue import EXAMPLES

    faults = []
    for kind, name in EXAMPLES.items():
        fault = next(f for f in read_toml(find(name))["faults"] if f["kind"] == kind)
        if fault.get("signal", "").startswith(("ccdl.", "computer.", "bus.")):
            continue  # needs several computers, of which nothing is replayed
        fault = {key: value for key, value in fault.items() if key not in ("when", "while", "until")}
        faults.append({**fault, "start_s": 0.1, "id": f"a_{kind}"})
    data = read_toml(find("f16_pitch_rate_offset_in_manoeuvre"))
    resets = [{"at_s": 0.3, "signal": "pitch_rate", "channels": [2]}]
    servos = {"model": "servo"}  # or their faults are refused
    return {**data, "duration_s": 0.5, "faults": faults, "redundancy": {"resets": resets}, "actuators": servos}


def _foreign() -> int:
    """foreign.mcap: somebody's three gyros, JSON in MCAP."""
    from mcap.writer import Writer

    with Path("foreign.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("imu", "jsonschema", b'{"type": "object"}')
        channels = [writer.register_channel(f"/imu{c}", "json", schema) for c in (1, 2, 3)]
        for k in range(60):
            for c, channel in enumerate(channels):
                data = json.dumps({"data": {"x": 0.01 * k + 0.001 * c}}).encode()
                writer.add_message(channel, k * 10_000_000, data, k * 10_000_000)
        writer.finish()
    return 0
