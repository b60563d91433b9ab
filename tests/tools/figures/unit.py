"""A unit under test: the bits of our own manager, what a frame costs, paced flights, a unit that is stopped."""

from __future__ import annotations

import hashlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from statistics import median, quantiles
from typing import Any, Final

import numpy as np
import psutil
from unit_files import udp, written

import rig
from figures import table
from rig.bench.replay.vote_again import OUTPUTS, vote_again
from rig.core.frame import Block, UnitStatus
from rig.flight import loop
from rig.flight.unit_loop import UnitComputer
from rig.flight.unit_loop import fly_rows as fly_unit
from rig.scenario.scenario import Scenario, load, names
from rig.unit.running_unit import UnitUnderTest, running
from rig.unit.unit_file import Unit

TRANSPORTS: Final[dict[str, dict[str, Any]]] = {
    "in process": {"path": "libmonitor.so", "isolate": False},
    "child": {"path": "libmonitor.so"},
    "FMU": {"transport": "fmu", "path": "monitor.fmu"},
    "UDP": {"transport": "udp", "command": ["monitor_udp", "--rig", "{address}"]},
}
FLOWN: Final = 10  # scenarios whose loop the unit closes
STOPPED_AT: Final = 1000  # frames
RATES_HZ: Final = (100, 400, 1000)


def keys_of(transport: str, built: Path) -> dict[str, Any]:
    """Return the keys of a unit file, with the paths in ``built``."""
    keys = {"name": "monitor", **TRANSPORTS[transport]}
    if "path" in keys:
        return {**keys, "path": str(built / keys["path"])}
    program, *rest = keys["command"]
    return {**keys, "command": [str(built / program), *rest]}


# Bits ---------------------------------------------------------------------------------------------------------------


def differing(a: Block, b: Block, fields: Any) -> int:
    """Return how many numbers do not have the same bits."""
    if len(a) != len(b):
        return max(len(a), len(b))
    pairs = ([np.ascontiguousarray(rows[name]) for rows in (a, b)] for name in fields)
    bits = ([column.view(f"u{column.dtype.base.itemsize}") for column in pair] for pair in pairs)
    return sum(int((ours != theirs).sum()) for ours, theirs in bits)


def flown_alike(tested: UnitUnderTest, scenario: Scenario, ours: Block) -> bool:
    """Return True if a flight by the unit has our fields, and two of them the same digest."""
    first, second = (fly_unit(scenario, unit=tested) for _ in range(2))
    digests = {hashlib.sha256(np.ascontiguousarray(rows).view(np.uint8).data).hexdigest() for rows in (first, second)}
    return len(digests) == 1 and not differing(ours, first, [name for name in ours.dtype.names or () if name != "unit"])


def unit_identity(*units: str) -> None:
    """Print whether units decide as our manager: its channels through each unit, and loops closed by the unit."""
    totals = {unit: [0] * 6 for unit in units}  # scenarios, frames, numbers, differ, flown, alike
    for i, name in enumerate(names()):
        scenario = load(name)
        ours = loop.fly_rows(scenario)
        closed = i % max(1, len(names()) // FLOWN) == 0 and i // max(1, len(names()) // FLOWN) < FLOWN
        for unit, total in totals.items():
            with running(Path(unit)) as tested:
                wrong = differing(ours, vote_again(ours, scenario, tested), OUTPUTS)
                alike = closed and flown_alike(tested, scenario, ours)
            numbers = sum(ours[field].size for field in OUTPUTS)
            total[:] = np.add(total, [1, len(ours), numbers, wrong, closed, alike]).tolist()
            if wrong or closed != alike:
                print(f"{unit}: {name}: {wrong} numbers differ, flown alike: {alike}", flush=True)
    heads = ("unit", "scenarios", "frames", "numbers", "differ", "flown", "all fields equal, the same digest twice")
    table(heads, ([Path(unit).stem, *total] for unit, total in totals.items()))


# Cost ---------------------------------------------------------------------------------------------------------------


def frame_us(scenario: Scenario, unit: UnitUnderTest | None) -> tuple[float, float]:
    """Return microseconds of a frame of the loop without the log: mean with all around, median frame.

    Other load on the machine takes few frames and makes them long: the mean has it, the median has not.
    """
    flight = loop.Rig(scenario, None if unit is None else UnitComputer(unit))
    frames: list[float] = []
    began = time.perf_counter()
    for _, timing in loop.frames(flight, scenario):
        frames += timing["frame_us"].tolist()
    took = time.perf_counter() - began
    if unit is not None:
        unit.end()
    return took / scenario.frames * 1e6, median(frames)


def _costs(built: Path, count: int) -> Iterator[list[str]]:
    scenario = load(None)
    pairs: dict[str, list[tuple[tuple[float, float], ...]]] = {transport: [] for transport in TRANSPORTS}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as units:
        for unit in TRANSPORTS:
            (Path(folder) / unit).mkdir()
            written(Path(folder) / unit, keys_of(unit, built))
        tested = {unit: units.enter_context(running(Path(folder) / unit / "unit.toml")) for unit in TRANSPORTS}
        for unit in (None, *tested.values()):
            frame_us(scenario, unit)  # compiles
        for _ in range(count):
            for transport, unit in tested.items():  # in turns: a shared host is slow for seconds at a time
                pairs[transport].append((frame_us(scenario, None), frame_us(scenario, unit)))
    for transport, both in pairs.items():
        for i, measure in enumerate(("mean", "median frame")):
            ours, theirs = (median(pair[side][i] for pair in both) for side in (0, 1))
            ratios = [pair[1][i] / pair[0][i] for pair in both]
            numbers = (*quantiles(ratios, n=4), min(ratios), max(ratios))
            low, middle, high, least, most = (f"{ratio:.3f}" for ratio in numbers)
            yield [transport, measure, f"{ours:.2f}", f"{theirs:.2f}", middle, f"{low} to {high}", f"{least} to {most}"]


def unit_cost(built: str, count: str = "175") -> None:
    """Print the loop's frame with each transport, without the log, in pairs of flights against our own manager."""
    table(
        ("transport", "", "built-in, us", "unit, us", "ratio", "quartiles", "all"),
        _costs(Path(built).resolve(), int(count)),
    )


# Stopped ------------------------------------------------------------------------------------------------------------


def by_signal(process: psutil.Process, seconds: float) -> None:
    """Send SIGSTOP now, SIGCONT later."""
    process.send_signal(signal.SIGSTOP)
    threading.Timer(seconds, process.send_signal, (signal.SIGCONT,)).start()


def by_debugger(process: psutil.Process, seconds: float) -> None:
    """Attach gdb now, detach later."""
    script = ["-ex", f"shell sleep {seconds:g}", "-ex", "detach", "-ex", "quit"]
    command = ["gdb", "-q", "-nx", "-batch", "-p", str(process.pid), *script]
    subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 30.0
    while process.status() != psutil.STATUS_TRACING_STOP:
        if time.monotonic() > until:
            sys.exit("gdb has not attached within 30 s: is it permitted? (kernel.yama.ptrace_scope)")
        time.sleep(0.01)


def _fly_stopped(folder: Path, tested: Unit, stop: Callable[[psutil.Process, float], None] | None) -> rig.Flight:
    before, done = set(psutil.Process().children()), False

    def progress(frames: int, of: int) -> None:
        nonlocal done
        if stop is not None and not done and frames >= STOPPED_AT:
            done = True
            (process,) = set(psutil.Process().children()) - before
            stop(process, 10.0)

    return rig.fly(out=folder, unit=tested, progress=progress)


def unit_stopped(built: str) -> None:
    """Print the digest of lockstep flights whose unit is stopped for 10 s, by a signal and by gdb if it is there."""
    stops = {"not stopped": None, "SIGSTOP": by_signal, **({"gdb": by_debugger} if shutil.which("gdb") else {})}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for transport in ("child", "UDP"):
            tested = written(Path(folder), {**keys_of(transport, Path(built).resolve()), "timeout_s": 0})
            for how, stop in stops.items():
                flight = _fly_stopped(Path(folder), tested, stop)
                longest = f"{(flight.unit or {})['reply']['worst_us'] / 1e6:.3f}"
                rows.append([transport, how, flight.frames, longest, f"`{flight.digest[:16]}`"])
    table(("transport", "stopped by", "frames", "longest reply, s", "digest"), rows)


# Paced --------------------------------------------------------------------------------------------------------------


def planned(frames: int, period_s: float) -> list[Any]:
    """Return one thing wrong in every hundred frames, for one to three frames, far enough from the next."""
    draw, plan = random.Random(1), []
    for first in range(100, frames - 100, 100):
        kind = draw.choice(["lost-request", "lost-reply", "double", "delay"])
        begins = first + draw.randrange(50)
        ends = begins if kind == "delay" else begins + draw.randrange(3)
        plan.append([kind, begins, ends, *([1.5 * period_s] if kind == "delay" else [])])
    return plan


def counted(flight: rig.Flight, plan: list[Any]) -> str:
    """Return what was lost, discarded and held, each against its plan."""
    unit, held = flight.unit or {}, flight.rows["unit"] == UnitStatus.HELD
    frames = {kind: [k for name, a, b, *_ in plan if name == kind for k in range(a, b + 1)] for kind, *_ in plan}
    lost = frames["lost-request"] + frames["lost-reply"]
    return (
        f"lost requests {unit['requests_lost']} of {len(frames['lost-request'])}, "
        f"lost replies {unit['replies_lost']} of {len(frames['lost-reply'])}, "
        f"doubled {unit['discarded']} of {len(frames['double'])}, losses held {int(held[lost].sum())} of {len(lost)}, "
        f"delays held {int(held[frames['delay']].sum())} of {len(frames['delay'])}, late {unit['late']}"
    )


def lateness(flight: rig.Flight) -> list[str]:
    """Return lateness, replies and misses of a flight."""
    reply, jitter = (flight.unit or {})["reply"], flight.jitter
    assert jitter is not None
    late = f"{jitter.median_us:.0f}, {jitter.p99_us:.0f}, {jitter.worst_us:.0f}"
    replies = ", ".join(f"{reply[key]:.0f}" for key in ("median_us", "p99_us", "p999_us", "worst_us"))
    return [late, replies, f"{(flight.unit or {})['missed']} of {flight.frames}"]


def _paced(library: Path, seconds: float) -> Iterator[list[str]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for rate_hz in RATES_HZ:
            sets = [f"rate_hz={rate_hz}", f"duration_s={seconds}", "faults=[]"]
            plan = planned(round(seconds * rate_hz), 1.0 / rate_hz)
            for how, wrong, rerun in (("alone", [], "off"), ("streamed", [], "serve"), ("planned", plan, "off")):
                tested = udp(folder, wrong, library, max_missed=1000)
                flight = rig.fly(overrides=sets, out=folder, unit=tested, realtime_factor=1.0, rerun=rerun)
                yield [f"{rate_hz} Hz, {how}", *lateness(flight), counted(flight, plan) if wrong else ""]


def unit_paced(library: str, seconds: str = "60") -> None:
    """Print paced flights with a UDP unit: alone, with a stream, and losing, repeating and delaying by a seeded plan.

    Misses beyond the plan are the machine's: the share of a frame that an answer may take is 0.8.
    """
    heads = (
        *("flight", "late: median, 99 %, worst, us", "reply: median, 99 %, 99.9 %, worst, us", "missed"),
        "of the plan",
    )
    table(heads, _paced(Path(library).resolve(), float(seconds)))
