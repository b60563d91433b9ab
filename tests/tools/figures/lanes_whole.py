"""Four computers measured without a fault: healthy, clocks that run free, their cost and their logs.

``lanes_picture`` draws docs/pictures/lanes.svg; all others print a table or a line.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import sleep
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from figures import table
from figures.actuators import BASE, BY_HAND, aircraft_and_rates, costs, healthy_flight
from figures.lanes import FOUR, findings, four
from rig.bench.replay.before_after import diff, side
from rig.bench.replay.verify import verify
from rig.core.frame import COMPUTERS, Health
from rig.flight.fly import fly as fly_logged
from rig.flight.lane_events import test_name
from rig.log import read_log
from rig.log.export import export
from rig.log.recordings.flown_log import recorded
from rig.log.scan import recover
from rig.scenario import scenario
from rig.studies.campaign.flying import CampaignFlight
from rig.studies.papers.servo_study import RATES_HZ

ROOT: Final = Path(__file__).parents[3]

# Healthy.


def lanes_healthy(flights: str = "200", duration_s: str = "12") -> None:
    """Print what trips in healthy flights of four synchronised lanes whose clocks drift by up to 20 ppm."""
    cases = [(*case, seed) for case, seed in zip(aircraft_and_rates(), range(int(flights)), strict=False)]
    found = [_trips(healthy_flight(name, rate, seed, duration_s, FOUR)) for name, rate, seed in cases]
    *counts, spread = np.array(found).T
    names = "lost", "lanes failed", "back-ups", "links failed", "frames with a lane suspected", "coils shut off"
    told = ", ".join(f"{each.sum():g} {name}" for name, each in zip((*names, "channels failed"), counts, strict=True))
    print(f"{len(found)} flights at {len(RATES_HZ)} rates: {told}; clocks apart by {spread.max():.1e} frames at most")


def _trips(flight: CampaignFlight) -> list[float]:
    finder, lanes = findings(flight), computers(flight)
    spread = np.ptp(lanes["clock_lead"], axis=1)
    return [
        float(not flight.verdict.survived),
        len(finder.failures),
        float(finder.backup is not None),
        len(finder.links),
        int((lanes["health"] == Health.SUSPECT).any(axis=1).sum()),
        sum(map(len, flight.coils_failed.values())),
        sum(map(len, flight.verdict.failed.values())),
        float(spread.max()),
    ]


def computers(flight: CampaignFlight) -> NDArray[Any]:
    """Return (n, 4) COMPUTER."""
    assert flight.table.lane is not None
    return flight.table.lane


# Flight 44.

FREE: Final = ("computers.synchronised=false", "computers.exchange_rounds=1")
TIGHT: Final = "computers.command_persistence_s=0.01"
APART: Final = ("equalised", "not equalised")
STICK: Final = "pilot.manoeuvres=[{kind='doublet', axis='stick_roll', start_s=5.0, duration_s=4.0, amplitude=0.9}]"
REVERSED_S: Final = 7.0  # the stick is
APART_FLOOR: Final = 1e-4  # % of the stroke: smaller differences are drawn here
PICTURES: Final = Path(__file__).parents[3] / "docs/pictures"


def flight_44(equalised: bool, *sets: str) -> CampaignFlight:
    """Fly a brisk roll with clocks that are 0, 0.3, 0.6 and 0.9 frames ahead at first, without a fault."""
    offsets = "computers.clock_offsets_s=[0, 0.003, 0.006, 0.009]"
    clocks = offsets, "computers.clock_drift_ppm=0", f"computers.equalise={str(equalised).lower()}"
    return four("f16", "duration_s=20", "seed=44", "faults=[]", BY_HAND, STICK, *clocks, *sets)


def lanes_flight_44() -> None:
    """Print who is failed in flight 44, and how far the lanes are apart."""
    cases = (("free, 5 % for a frame", (*FREE, TIGHT)), ("free, defaults", FREE), ("synchronised", ()))
    heads = ["clocks", "integrators", "healthy lanes failed", "commands apart, % of stroke"]
    heads += ["aileron's integrators apart, %", "in 99 of 100 frames", "clocks apart at the end, frames"]
    table(heads, (_flight_44(name, APART[i], flight_44(i == 0, *sets)) for name, sets in cases for i in (0, 1)))


def _flight_44(clocks: str, integrators: str, flight: CampaignFlight) -> list[str]:
    failed = (
        f"{COMPUTERS[one.lane]} {one.frame / flight.scenario.rate_hz:.2f} s, {test_name(one.test)}"
        for one in findings(flight).failures
    )
    commands, between, lead = *apart(flight), computers(flight)["clock_lead"][-1]
    largest = f"{commands.max():.1f}", f"{between.max():.3f}", f"{np.percentile(between, 99):.3f}"
    return [clocks, integrators, "; ".join(failed) or "none", *largest, f"{round(float(np.ptp(lead)), 6):g}"]


def apart(flight: CampaignFlight) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n,) by how much of the stroke, %, the lanes' commands and integrators of the aileron are apart."""
    lanes, (low, high) = computers(flight), flight.scenario.airframe.surface_limits[1]
    return tuple(100.0 * np.ptp(lanes[name][:, :, 1], axis=1) / (high - low) for name in ("surface", "integral"))


def lanes_picture() -> None:
    """Draw docs/pictures/lanes.svg."""
    from figures.servos_and_lanes import lanes  # which flies flight_44

    (PICTURES / "lanes.svg").write_text(lanes(), encoding="utf-8")
    print(f"lanes.svg: {(PICTURES / 'lanes.svg').stat().st_size} B")


# Cost.


def lanes_cost(pairs: str = "15", duration_s: str = "30") -> None:
    """Print what a frame of four lanes with servos costs beside one computer with the lag."""
    sets = ["faults=[]", f"duration_s={duration_s}"]
    more = (["actuators.model='lag'"], [FOUR])
    costs("one, lag", "four, servo", [scenario.load(BASE, [*sets, *each]) for each in more], int(pairs))


def lanes_compile(pairs: str = "3") -> None:
    """Print the processor time of a first flight, with nothing compiled, of one computer and of four with servos."""
    kinds = [["actuators.model=lag"], ["actuators.model=lag", FOUR], [FOUR]]
    found = np.array([[_cold(sets) for sets in kinds] for _ in range(int(pairs))])
    one, four_lag, four_servo = np.median(found, axis=0)
    more = median(found[:, 2] - found[:, 0])
    print(f"one, lag: {one:.1f} s; four, lag: {four_lag:.1f} s; four, servo: {four_servo:.1f} s; more: {more:.1f} s")


def _cold(sets: Sequence[str]) -> float:
    """Return seconds of the processor that a flight of a second takes when no kernel is compiled."""
    with TemporaryDirectory() as folder:
        environment = {**os.environ, "RIG_CACHE_DIR": f"{folder}/cache", "NUMBA_CACHE_DIR": f"{folder}/cache"}
        program = (
            "import os, sys\nfrom rig.flight.loop import fly_rows\nfrom rig.scenario.scenario import load\n"
            f"fly_rows(load({BASE!r}, ['duration_s=1', 'faults=[]', *sys.argv[1:]]))\nprint(sum(os.times()[:4]))"
        )
        ran = subprocess.run(
            [sys.executable, "-c", program, *sets],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return float(ran.stdout)


# Its log.

LOGGED: Final = "f16_computer_stop"


def lanes_log() -> None:
    """Print whether a flight's log is the same again: flown, replayed, compared, exported, killed and recovered."""
    with TemporaryDirectory() as folder:
        print("; ".join(_of_log(Path(folder))))


def _of_log(folder: Path) -> Iterator[str]:
    whole, again = (fly_logged(LOGGED, out=folder / name) for name in ("whole", "again"))
    yield f"{whole.frames} frames flown twice: {same_or_not(whole.digest == again.digest)}"
    for how, fly_again in (("replayed", False), ("flown again", True)):
        found = verify(recorded(whole.log), fly=fly_again).comparison
        of_lanes = sum(field.name.startswith("computer.") for field in found.fields)
        yield f"{how}: {len(found.fields)} fields, {of_lanes} of lanes, {same_or_not(found.identical)}"
    found = diff(side(whole.log), side(again.log))
    yield f"diff: {len(found.fields)} fields, {same_or_not(found.identical)}"
    yield _exported(whole.log, folder / "exported")
    yield from _killed(whole.log, folder)


def _exported(log: Path, out: Path) -> str:
    lanes = read_log(log).parts
    assert lanes is not None
    written = [export(log, to, out.with_suffix(f".{to}")) for to in ("npz", "parquet", "csv")]
    columns, sizes = np.load(out.with_suffix(".npz")), sorted({len(one.columns) for one in written})
    of_lanes = sum(name.startswith(("computer.", "ccdl.")) for name in written[0].columns)
    told = zip(COMPUTERS, lanes["computer"]["surface"][:, :, 0].T, strict=True)
    same = all((columns[f"computer.{lane}.surface_elevator_rad"] == values).all() for lane, values in told)
    return f"exported three ways: {sizes[0]} columns, {of_lanes} of lanes, {same_or_not(same and len(sizes) == 1)}"


def same_or_not(identical: bool) -> str:
    """Return what a line says of a comparison."""
    return "identical" if identical else "NOT IDENTICAL"


def _killed(whole: Path, folder: Path) -> Iterator[str]:
    """Kill a flight in real time after some seconds, recover its log, and compare with the whole one's first rows."""
    rig = Path(sys.executable).with_name("rig")
    command = [str(rig), "fly", LOGGED, "--realtime-factor", "4", "--out", str(folder / "killed")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as flight:
        while not (logs := [*(folder / "killed").glob("*")]) or logs[0].stat().st_size < 1_000_000:
            sleep(0.2)
        flight.kill()
    mended = folder / "mended.mcap"
    recover(logs[0], mended)
    saved, all_rows = read_log(mended), read_log(whole)
    assert saved.parts is not None and all_rows.parts is not None
    n = len(saved.rows)
    same = saved.parts.tobytes() == all_rows.parts[:n].tobytes() and saved.rows.tobytes() == all_rows.rows[:n].tobytes()
    yield f"killed and recovered: {n} rows, {len(saved.parts)} of lanes; beside the whole flight {same_or_not(same)}"
    yield f"recovered and replayed: {same_or_not(verify(recorded(mended)).comparison.identical)}"
