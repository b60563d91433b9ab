"""The stage: the faults of a scenario as the records that the kernels read."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import exp, floor, pi
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray

from rig.core.frame import Block, LaneTest, to_frame
from rig.core.settings import record
from rig.world.faults import scenario_faults as together
from rig.world.faults.effects import OF_A_COIL, RANDOM, REMEMBERING, Act, Effect
from rig.world.faults.expression import DEEPEST, STEP, parse, reads_votes
from rig.world.faults.fault_records import (
    CLEAN,
    FOREVER,
    KEPT,
    PARAM,
    SCHEDULE,
    SEEN,
    STATE,
    TARGET,
    FaultData,
    Trigger,
)
from rig.world.faults.places import CHANNELLED, FLIGHT, LINKS, OF_LANES, OF_SERVOS, Places, Point
from rig.world.faults.scenario_faults import Fault
from rig.world.faults.servo_parts import ComputerPart
from rig.world.faults.trigger import DutyCycle

_COPIED: Final = tuple(field.name for field in fields(Effect) if field.name in (TARGET.names or ()))
# The sorts of targets, and the fields of PARAM where each ends.
_SORTS: Final = {
    **{"samples": ("channel", "inertial"), "discretes": ("discrete",), "references": ("reference",)},
    **{"surfaces": ("surface",), "parts": OF_SERVOS, "links": ("ccdl",), "computers": ("computer",)},
}
_OF_SURFACES: Final = (ComputerPart.COMMAND, ComputerPart.OUTPUT)


class Coils(NamedTuple):
    """An in-line monitor that measures: what share of the faults of a coil it can see, and from where on."""

    coverage: float
    tolerance: float  # unit of the signal
    frames: int


class Faults:
    """Corrupts channels, inertial unit, references and what reaches the actuators, as scheduled.

    faults : of the scenario, checked; ranges : (n, 2) lowest and highest value of every place but the discretes
    seeds  : of this stage; the name of a fault gives it independent generators
    thresholds : (signals,) of the signals' monitors, for magnitudes that are given in them
    coils  : the in-line monitors that measure, by signal
    clean  : (keep_clean,) CLEAN, the sensors' output before any fault in the last ``keep_clean`` frames (``clean_of``)
    wire_coverage : chance that the monitor of a coil's wire sees it open, drawn once a fault
    test_coverage : the same of a computer's own tests
    voltage_tolerance : error of an input converter, as a share of full scale, up to which its test detects nothing
    places : those of a flight, or of a recording, whose rows have other signals
    All state is plain arrays and can be copied.
    """

    def __init__(
        self,
        faults: Sequence[Fault],
        ranges: NDArray[np.float64],
        rate_hz: float,
        seeds: SeedSequence | None = None,
        *,
        thresholds: NDArray[np.float64] | None = None,
        coils: Mapping[str, Coils] | None = None,
        keep_clean: int = 0,
        places: Places = FLIGHT,
        wire_coverage: float = 1.0,
        test_coverage: Mapping[LaneTest, float] | None = None,
        voltage_tolerance: float = 0.0,
    ) -> None:
        self._faults, self._rate_hz, self._places = faults, rate_hz, places
        discretes, others = len(places.names["discrete"]), sum(len(places.names[s]) for s in (*OF_SERVOS, *OF_LANES))
        self._ranges = np.array([*ranges, *[(0.0, 1.0)] * discretes, *[(-np.inf, np.inf)] * others])
        self._wire_coverage, self._voltage_tolerance = wire_coverage, voltage_tolerance
        self._thresholds = np.full(len(places.wraps), np.nan) if thresholds is None else thresholds
        self._seeds = SeedSequence(0) if seeds is None else seeds
        self._coils, self._test_coverage = coils or {}, test_coverage or {}
        self._uniform_from, self._normal_from = list[Generator](), list[Generator]()
        self.schedule = np.zeros(len(faults), SCHEDULE)
        self.state = np.zeros(len(faults), STATE)
        self.state["onset"] = FOREVER
        self._programs: list[NDArray[np.void]] = [np.zeros(0, STEP)]
        self._times: list[int] = []
        self._memory = 0
        for i, turn in enumerate(together.order(faults)):
            self.schedule[i]["turn"] = turn
            self._schedule(i)
        self.targets = self._targets()
        self.clean = np.empty(keep_clean, CLEAN)
        # Of the kernels besides the row; the same arrays until the next ``prepare``.
        self.data = FaultData(
            param=self._param(),
            schedule=self.schedule,
            state=self.state,
            targets=self.targets,
            kept=np.zeros(len(self.targets), KEPT),
            program=np.concatenate(self._programs),
            stack=np.zeros(DEEPEST),
            times=np.array(self._times, np.int64),
            memory=np.zeros(max(self._memory, 1)),
            seen=np.zeros(1, SEEN),
            uniform=np.zeros((1, max(1, len(self._uniform_from)))),
            normal=np.zeros((1, max(1, len(self._normal_from)))),
            clean=self.clean[:0],
        )

    def prepare(self, block: Block) -> None:
        """Draw for the rows of ``block``; no stream depends on the block's length, nor on other faults."""
        rows, drawn = len(block), (self.data.uniform, self.data.normal)
        uniform, normal = (held if len(held) >= rows else np.zeros((rows, held.shape[1])) for held in drawn)
        self.data = self.data._replace(uniform=uniform, normal=normal, clean=self.clean_of(block))
        for column, rng in enumerate(self._uniform_from):
            uniform[:rows, column] = rng.random(rows)
        for column, rng in enumerate(self._normal_from):
            normal[:rows, column] = rng.standard_normal(rows)

    def clean_of(self, rows: Block) -> NDArray[Any]:
        """Return what is kept of ``rows``, a whole block or its first rows; no rows where nothing is kept."""
        first = int(rows["frame"][0]) % len(self.clean) if len(self.clean) else 0
        return self.clean[first:][: len(rows)]

    def _frames(self, seconds: float | None, otherwise: int) -> int:
        """Return a time in frames, at least one."""
        return otherwise if seconds is None else max(1, to_frame(seconds, self._rate_hz))

    def _frame(self, time_s: float | None) -> int:
        return to_frame(time_s or 0.0, self._rate_hz)

    def _chance(self, mean_s: float) -> float:
        """Return the chance in one frame of what comes at random, ``mean_s`` apart on average."""
        return 1.0 - exp(-1.0 / (mean_s * self._rate_hz))

    def _generator(self, i: int, purpose: str) -> Generator:
        """Return a generator that the fault's name gives, so that no other fault shifts what it draws."""
        labels = [fault.label for fault in self._faults]
        name = f"{labels[i]}\0{labels[:i].count(labels[i])}\0{purpose}"  # faults of one name differ by their place
        words = np.frombuffer(hashlib.sha256(name.encode()).digest()[:16], "<u4")
        key = (*self._seeds.spawn_key, *map(int, words))
        return np.random.default_rng(SeedSequence(self._seeds.entropy, spawn_key=key))

    def _uniform_column(self, i: int, purpose: str) -> int:
        self._uniform_from.append(self._generator(i, purpose))
        return len(self._uniform_from) - 1

    def _schedule(self, i: int) -> None:
        """Fill the record of fault i."""
        row, fault = self.schedule[i], self._faults[i]
        row["flag"] = fault.flag
        row["first"], row["delay"] = self._frame(fault.start_s), self._frame(fault.delay_s)
        row["last"] = FOREVER if fault.end_s is None else to_frame(fault.end_s, self._rate_hz)
        row["duration"] = self._frames(fault.duration_s, FOREVER)
        row["period"] = self._frames(fault.repeat_every_s, 0)
        row["repeats"] = FOREVER if fault.repeats is None else fault.repeats
        self._trigger(i)
        self._duty_cycle(i)

    def begin(self, i: int, frame: int) -> None:
        """Begin fault i, whose trigger is a time, in ``frame``."""
        self.schedule[i]["first"] = self.state[i]["onset"] = frame

    def arm(self, i: int, frame: int) -> None:
        """Arm fault i from ``frame`` on; one whose trigger is a time begins there."""
        if self.schedule[i]["trigger"] == Trigger.TIME:
            self.begin(i, frame)
        else:
            self.schedule[i]["first"] = frame

    def end(self, i: int, frame: int) -> None:
        """End fault i before ``frame``, for good."""
        self.schedule[i]["last"] = frame

    def _trigger(self, i: int) -> None:
        row, fault = self.schedule[i], self._faults[i]
        if fault.when is not None:
            program = parse(fault.when)
            begin = sum(map(len, self._programs))
            self._programs.append(program)
            row["trigger"], row["begin"], row["end"] = Trigger.CONDITION, begin, begin + len(program)
            row["hold"], row["needs_votes"] = self._frame(fault.for_s), reads_votes(program)
        elif fault.on is not None:
            row["trigger"] = Trigger.TRANSITION
            row["place"], row["value"] = fault.on.watched
        elif fault.after is not None:
            row["trigger"], row["place"] = Trigger.AFTER, together.parent(self._faults, i)
        elif fault.rate_per_hour is not None:
            row["trigger"], row["again"] = Trigger.RANDOM, fault.duration_s is not None
            row["chance"] = self._chance(3600.0 / fault.rate_per_hour)
            row["draw"] = self._uniform_column(i, "trigger")
        else:
            row["trigger"], self.state[i]["onset"] = Trigger.TIME, row["first"]

    def _duty_cycle(self, i: int) -> None:
        row, pulses = self.schedule[i], self._faults[i].pulses
        row["duty_cycle"] = pulses.duty_cycle
        if pulses.duty_cycle == DutyCycle.STEADY:
            return
        row["on"] = max(1, to_frame(pulses.on_s, self._rate_hz))
        row["cycle"] = max(row["on"] + 1, to_frame(pulses.on_s + pulses.off_s, self._rate_hz))
        row["times"] = len(self._times)
        self._times += [to_frame(time, self._rate_hz) for time in pulses.times_s]
        row["times_end"] = len(self._times)
        if pulses.duty_cycle in (DutyCycle.RANDOM, DutyCycle.TELEGRAPH):
            row["enter"] = self._chance(pulses.off_s)
            row["leave"] = self._chance(max(pulses.on_s, 1e-9))
            row["pulse_draw"] = self._uniform_column(i, "pulses")

    def _targets(self) -> NDArray[np.void]:
        """Return a TARGET record for every value that a fault acts on, sorted by sort, then as in the scenario."""
        targets: list[NDArray[np.void]] = []
        self._ends, site = dict[str, int](), self._places.site
        for sort, sites in _SORTS.items():
            for i, fault in enumerate(self._faults):
                targets += [self._target(i, point) for point in fault.targets if site(point.place) in sites]
            self._ends[sort] = len(targets)
        return np.array(targets, TARGET) if targets else np.zeros(0, TARGET)

    def _target(self, i: int, point: Point) -> NDArray[np.void]:
        row = np.zeros((), TARGET)
        places, effect = self._places, self._faults[i].effect_on(point)
        where, at = places.site(point.place), places.number(point.place)
        source = effect.source_place or point.place
        for name in _COPIED:
            row[name] = getattr(effect, name)
        row["fault"], row["remembers"] = i, effect.act in REMEMBERING
        row["wraps"] = where in ("channel", "reference") and places.wraps[at]
        row["row"], row["column"] = (at, (point.channel or 1) - 1) if where in CHANNELLED else (-1, at)
        self._part(row, i, point, effect)
        of_surface = where == "computer" and effect.part in _OF_SURFACES
        ranged = places.names["surface"][row["column"]] if of_surface else point.place
        row["source"] = places.number(source)
        row["low"], row["high"] = low, high = self._ranges[places.index[ranged]]
        row["source_low"], row["source_high"] = self._ranges[places.index[source]]
        if effect.thresholds:
            row["value"] = effect.value * self._thresholds[at]
        if effect.of_range:
            row["value"] = effect.value * (high - low)
        row["ramp"] = getattr(self._faults[i], "ramp_s", 0.0) * self._rate_hz
        self._measure(row, i, point)
        self._act(row, i, point, effect)
        return row

    def _act(self, row: Any, i: int, point: Point, effect: Effect) -> None:
        """Write how the effect acts on a target whose range is written."""
        low, high, where = row["low"], row["high"], self._places.site(point.place)
        if effect.act == Act.RANGE_END:
            either = self._generator(i, "direction").random() < 0.5
            up = effect.value > (-0.5 if either else 0.5)
            row["act"], row["value"] = Act.SET, high if up else low
            if row["wraps"]:
                row["act"], row["value"] = Act.ADD_ANGLE, pi if up else -pi
        elif effect.act == Act.SET:
            row["value"] = np.clip(row["value"], low, high)
        elif effect.act == Act.VALID_ONLY and where not in CHANNELLED:
            row["act"] = Act.NO_NUMBER  # there is no flag to set
        elif effect.act in RANDOM:
            self._normal_from.append(self._generator(i, f"noise {point.place} {point.channel}"))
            row["draw"] = len(self._normal_from) - 1
        elif effect.act == Act.DELAY:
            frames = effect.value * self._rate_hz
            row["value"] = self._frames(effect.value, 1) if effect.whole_frames else frames
            row["memory"], row["length"] = self._memory, floor(row["value"]) + 2
            self._memory += int(row["length"])

    def _part(self, row: Any, i: int, point: Point, effect: Effect) -> None:
        """Say which part of a servo, of a link or of a computer a fault changes, and what may see it."""
        where, at = self._places.site(point.place), self._places.number(point.place)
        if where in OF_SERVOS:
            row["row"], row["column"] = (at, (point.channel or 1) - 1) if where == "actuator" else (0, at)
            row["seen_by_wire"] = effect.seen_by_wire and self._generator(i, "wire").random() < self._wire_coverage
        elif where == "ccdl":
            row["row"], row["column"] = LINKS[at]
            if effect.different and row["column"] % 2:
                row["value"] = -effect.value
        elif where == "computer":
            row["row"], row["column"] = at, (point.channel or 1) - 1
            test = effect.seen_by_test if effect.test_error > self._voltage_tolerance else LaneTest.NONE
            coverage = self._test_coverage.get(LaneTest(test), 1.0)
            row["seen_by_test"] = test if test and self._generator(i, "test").random() < coverage else 0

    def _measure(self, row: Any, i: int, point: Point) -> None:
        """Let the monitor of a stick's coils see a fault of a coil, if the draw puts it ahead of the sum."""
        coils, fault = self._coils.get(point.place), self._faults[i]
        if coils is None or fault.effect.act not in OF_A_COIL or getattr(fault, "seen_by_ilm", False) is not None:
            return
        if self._generator(i, "coil").random() < coils.coverage:
            row["tolerance"], row["frames"] = coils.tolerance, coils.frames

    def _param(self) -> NDArray[np.void]:
        watches = self.schedule["needs_votes"].any() or (self.schedule["trigger"] == Trigger.TRANSITION).any()
        return record(PARAM, dt_s=1.0 / self._rate_hz, watches=watches, **self._ends)
