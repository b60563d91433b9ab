"""What the fault-tolerant law finds, and what it declares without a fault: counted.

Every flight point of three aircraft, straight and in a turn, calm to moderate: faults of all four pitch angles with the
inertial unit and with it lost, slow ramps, early faults; and ten hours without a fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from figures import table
from rig.computer.analytic.unit_bank import bank_by
from rig.computer.fdi.pitch_test_state import BOTH
from rig.core.frame import ESTIMATES, INDEX, Block, SensorFault, Trust
from rig.core.units.angles import wrap
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.scenario.aircraft import tables
from rig.studies.campaign.pool import each
from rig.studies.campaign.statistics import poisson
from rig.studies.papers.rate_bias_study import AFTER_S, ALL_CHANNELS, POINTS, TURBULENCE, Case, Fault, settings

THETA, PHI = INDEX["pitch_angle"], INDEX["roll_angle"]
ANGLE, INNOVATION, SIGMA = (ESTIMATES.index(f"{x}_rad") for x in ("pitch_angle", "innovation", "innovation_sigma"))
SETTLED_S: Final = 10  # after which the usual difference of the rates is known
WITH_UNIT, UNIT_LOST_TOO = "with the unit", "unit lost"
Table = dict[str, Any]
ONSET_S: Final = 20.0
FREE_S: Final = 600.0
UNIT_LOST: Final = '{kind="dropout",signal="inertial.pitch_rate_rad_s",start_s=0.0}'
MOST: Final = {"altitude": 120.0, "heading": 0.6, "airspeed": 8.0}  # m, rad, m/s


@dataclass(frozen=True)
class Try:
    """One flight: the row that it counts in, and what flies."""

    row: str
    case: Case
    fault: Fault | None
    unit: bool = True  # the inertial unit works

    def sets(self) -> list[str]:
        """Return the overrides of the default scenario."""
        faults = [] if self.fault is None else [f"{{{self.fault.keys},start_s={self.case.onset_s}}}"]
        lost = [] if self.unit else [UNIT_LOST]
        return [*settings(self.case, None, "fault-tolerant"), f"faults=[{','.join(faults + lost)}]"]


def places() -> list[tuple[str, str]]:
    """Return all flight points of the three aircraft."""
    return [(name, point["name"]) for name in POINTS for point in tables(name)["airframe"]["flight_points"]]


def cases(onset_s: float) -> list[Case]:
    """Return ten flight points, straight and turning at the onset, by turbulence; a climb comes later."""
    climb = f'{{kind="step",axis="altitude",start_s={onset_s + 35.0},amplitude=60.0}}'
    turn = f'{{kind="hold",axis="heading",start_s={max(onset_s - 5.0, 1.0)},duration_s=20.0,amplitude=0.6}}'
    grid = product(places(), (climb, f"{turn},{climb}"), TURBULENCE)
    return [Case(*place, level, onset_s, 1 + i, steps) for i, (place, steps, level) in enumerate(grid)]


def common(name: str, size: float, keys: str) -> Fault:
    """Return a fault of all four pitch angles."""
    return Fault(name, size, f'signal="pitch_angle",channels={ALL_CHANNELS},{keys}')


def offset(mrad: float, case: Case) -> Fault:
    """Return a jump, up in half of the cases."""
    return common(f"offset, {mrad:g} mrad", mrad, f'kind="offset",offset={sign(case) * mrad / 1e3}')


def ramp(mrad_s: float, case: Case) -> Fault:
    """Return a drift, up in half of the cases."""
    return common(f"ramp, {mrad_s:g} mrad/s", mrad_s, f'kind="drift",rate_per_s={sign(case) * mrad_s / 1e3}')


def scale(factor: float, over_s: float = 0.0) -> Fault:
    """Return an effectiveness fault."""
    name = f"F {factor:g}" + (f" over {over_s:g} s" if over_s else "")
    return common(name, factor, f'kind="scale",factor={factor}' + (f",ramp_s={over_s}" if over_s else ""))


def sign(case: Case) -> int:
    """Return +1 and -1 in turn, and the other way round at the next of the places, each of which has six cases."""
    number = case.seed - 1
    return -1 if (number + number // 6) % 2 else 1


def detectable() -> Iterator[Try]:
    """Yield eight faults in sixty cases, with the inertial unit and with it lost from the first frame on."""
    for unit, case in product((True, False), cases(ONSET_S)):
        steps = (offset(5.0, case), offset(20.0, case), scale(0.8), scale(1.5))
        for fault in (*steps, *(ramp(rate, case) for rate in (0.5, 1.0, 2.0, 5.0))):
            yield Try(WITH_UNIT if unit else UNIT_LOST_TOO, case, fault, unit)


def slow() -> Iterator[Try]:
    """Yield ramps with which the estimated drift goes along."""
    for case, rate in product(cases(ONSET_S), (0.1, 0.2, 0.3)):
        yield Try("slow", case, ramp(rate, case))


def early() -> Iterator[Try]:
    """Yield F to 0.5 before drift and gusts are known, and soon after."""
    for onset_s, over_s in product((3.0, 12.0), (0.0, 10.0, 60.0)):
        yield from (Try(f"at {onset_s:g} s", case, scale(0.5, over_s)) for case in cases(onset_s))


def free() -> Iterator[Try]:
    """Yield moderate turbulence, six seeds: every half minute a climb or descent, a turn or a change of speed."""
    for number, (place, _) in enumerate(product(places(), range(6)), 101):
        rng = np.random.default_rng(number)
        steps = [held(axis, start_s, rng) for axis, start_s in zip(cycle(MOST), range(15, 580, 30), strict=False)]
        yield Try("no fault", Case(*place, "moderate", FREE_S - AFTER_S, number, ",".join(steps)), None)


def held(axis: str, start_s: int, rng: np.random.Generator) -> str:
    """Return a change for 20 s to two minutes, either way."""
    size, duration_s = MOST[axis] * rng.uniform(-1.0, 1.0), rng.uniform(20.0, 120.0)
    return f'{{kind="hold",axis="{axis}",start_s={start_s}.0,duration_s={duration_s:.2f},amplitude={size:.3f}}}'


ROWS: Final = {"detectable": detectable, "slow": slow, "early": early, "free": free}


def outcome_of(flight: Try) -> Table:
    """Fly it: what was declared and when, how far the estimate was off, what the unit's mean was off each second."""
    chosen = scenario.load(None, flight.sets(), flight.case.seed)
    rig, blocks, seconds = Rig(chosen), [], []
    for rows, _ in frames(rig, chosen):
        blocks.append(rows.copy())
        seconds.append(second(rig.control.fdi[0], rows[-1]))
    flown, rate_hz = np.concatenate(blocks), chosen.rate_hz
    onset = round(flight.case.onset_s * rate_hz) if flight.fault else 0
    hours = len(flown) / rate_hz / 3600.0
    return {
        **{"row": flight.row, "fault": flight.fault.kind if flight.fault else "none", "hours": hours},
        **{"where": "turn" if "heading" in flight.case.manoeuvres else "straight", "case": flight.case},
        **{**declared(flown, onset, rate_hz), **errors(flown, onset), "seconds": [] if flight.fault else seconds},
    }


def second(w: Any, row: Any) -> list[float]:
    """Return voted bank less the unit's, its effect, rate difference less the usual; whether both are in order."""
    bank = wrap(row["voted"][PHI] - bank_by(w["unit"]))
    return [
        abs(float(x))
        for x in (bank, w["bank_effect"], w["rate_difference"] - w["usual_rate_difference"], w["rates"] == BOTH)
    ]


def declared(flight: Block, onset: int, rate_hz: float) -> Table:
    """Return sensor faults and biased rates."""
    corrected, biased = flight["trust"] == Trust.CORRECTED, flight["sensor_fault"] == SensorFault.RATE_BIAS
    after = np.flatnonzero(corrected[onset:])
    trips = int(np.count_nonzero(np.diff(corrected.astype(int), prepend=0) == 1))
    first_s = float(after[0]) / rate_hz if len(after) else None
    return {"after_s": first_s, "before": bool(corrected[:onset].any()), "trips": trips, "biased": bool(biased.any())}


def errors(flight: Block, onset: int) -> Table:
    """Return the estimate's error from the onset on, rad; innovations of one and of two frames, in sigmas."""
    estimate, truth = flight["estimate"], flight["truth"][:, THETA]
    size = np.abs(estimate[:, INNOVATION]) / estimate[:, SIGMA]
    error_rad = float(np.abs(estimate[:, ANGLE] - truth)[onset:].max())
    return {"estimate_rad": error_rad, "sigmas": [float(size.max()), float(np.minimum(size[1:], size[:-1]).max())]}


def counts(flown: list[Table]) -> Iterator[list[str]]:
    """Yield a row for each fault and way of flying at the onset."""
    for row, fault in dict.fromkeys((f["row"], f["fault"]) for f in flown):
        cells = [row, fault]
        for where in ("straight", "turn"):
            mine = [f for f in flown if (f["row"], f["fault"], f["where"]) == (row, fault, where)]
            delays = [f["after_s"] for f in mine if f["after_s"] is not None]
            span = f"{min(delays):.2f} to {max(delays):.2f}" if delays else "never"
            early, biased = (sum(f[key] for f in mine) for key in ("before", "biased"))
            off = 1e3 * max(f["estimate_rad"] for f in mine)
            cells += [f"{len(delays)} of {len(mine)}", span, f"{early}, {biased}", f"{off:.1f}"]
        yield cells


def same_frame(flown: list[Table]) -> str:
    """Return how many faults were found in the same frame with the unit and with it lost."""
    ours, theirs = ([f["after_s"] for f in flown if f["row"] == row] for row in (WITH_UNIT, UNIT_LOST_TOO))
    same = sum(a is not None and a == b for a, b in zip(ours, theirs, strict=True))
    return f"found in the same frame by both: {same} of {len(ours)}"


def fault_free(flown: list[Table]) -> str:
    """Return hours, trips, and how near to a trip they came."""
    rate = poisson(sum(f["trips"] for f in flown), sum(f["hours"] for f in flown))
    single, double = (max(f["sigmas"][i] for f in flown) for i in (0, 1))
    bank, tilt, apart, both = np.concatenate([f["seconds"][SETTLED_S:] for f in flown]).T
    first = max(row[2] for f in flown for row in f["seconds"][:SETTLED_S])
    return "\n".join(
        (
            f"{rate.count} trips in {rate.of:.1f} hours ({rate.low:.2g} to {rate.high:.2g} an hour, exact, 95 %); "
            f"RATE_BIAS in {sum(f['biased'] for f in flown)} of {len(flown)} flights",
            f"innovation: {single:.2f} sigma in one frame, {double:.2f} in two running; "
            f"estimate off by {1e3 * max(f['estimate_rad'] for f in flown):.2f} mrad",
            f"bank angles: {spread(bank)} mrad, {int((bank > 0.04).sum())} times over 40; tilt: {spread(tilt)} mrad",
            f"rates: {spread(apart)} mrad/s; in the first {SETTLED_S} s {1e3 * first:.2f}",
            f"both rates in order at the end of {int(both.sum())} of {len(both)} seconds after that",
        )
    )


def spread(values: NDArray[np.float64]) -> str:
    """Return the largest, and below what 99 % are; in thousandths."""
    return f"{1e3 * values.max():.2f} (99 %: {1e3 * np.quantile(values, 0.99):.2f})"


def tolerant(*rows: str) -> None:
    """Fly the rows that are named: detectable, slow, early, free; all without names."""
    flown = list(each(outcome_of, [flight for row in rows or ROWS for flight in ROWS[row]()], 2))
    faulty, without = [f for f in flown if f["fault"] != "none"], [f for f in flown if f["fault"] == "none"]
    heads = ("straight: found", "after, s", "early, `RATE_BIAS`", "off, mrad")
    table(("row", "fault", *heads, "turn: found", *heads[1:]), counts(faulty))
    print()
    if any(f["row"] == UNIT_LOST_TOO for f in faulty):
        print(same_frame(faulty))
    if without:
        print(fault_free(without))
