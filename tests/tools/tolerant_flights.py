"""Flights of tolerant.py: sixty cases with a fault of all four pitch angles, and ten hours without a fault."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, product
from typing import Final

import numpy as np

from rig.aircraft import tables
from rig.studies.rate_bias import AFTER_S, ALL_CHANNELS, POINTS, TURBULENCE, Case, Fault, settings

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
        """The overrides of the default scenario."""
        faults = [] if self.fault is None else [f"{{{self.fault.keys},start_s={self.case.onset_s}}}"]
        lost = [] if self.unit else [UNIT_LOST]
        return [*settings(self.case, None, "fault-tolerant"), f"faults=[{','.join(faults + lost)}]"]


def places() -> list[tuple[str, str]]:
    """All flight points of the three aircraft."""
    return [(name, point["name"]) for name in POINTS for point in tables(name)["airframe"]["flight_points"]]


def cases(onset_s: float) -> list[Case]:
    """Ten flight points, straight and turning at the onset, by turbulence; a climb comes later."""
    climb = f'{{kind="step",axis="altitude",start_s={onset_s + 35.0},amplitude=60.0}}'
    turn = f'{{kind="hold",axis="heading",start_s={max(onset_s - 5.0, 1.0)},duration_s=20.0,amplitude=0.6}}'
    grid = product(places(), (climb, f"{turn},{climb}"), TURBULENCE)
    return [Case(*place, level, onset_s, 1 + i, steps) for i, (place, steps, level) in enumerate(grid)]


def common(name: str, size: float, keys: str) -> Fault:
    """A fault of all four pitch angles."""
    return Fault(name, size, f'signal="pitch_angle",channels={ALL_CHANNELS},{keys}')


def offset(mrad: float, case: Case) -> Fault:
    """A jump, up in half of the cases."""
    return common(f"offset, {mrad:g} mrad", mrad, f'kind="offset",offset={sign(case) * mrad / 1e3}')


def ramp(mrad_s: float, case: Case) -> Fault:
    """A drift, up in half of the cases."""
    return common(f"ramp, {mrad_s:g} mrad/s", mrad_s, f'kind="drift",rate_per_s={sign(case) * mrad_s / 1e3}')


def scale(factor: float, over_s: float = 0.0) -> Fault:
    """An effectiveness fault."""
    name = f"F {factor:g}" + (f" over {over_s:g} s" if over_s else "")
    return common(name, factor, f'kind="scale",factor={factor}' + (f",ramp_s={over_s}" if over_s else ""))


def sign(case: Case) -> int:
    """Up and down in turn, and the other way round at the next of the places, each of which has six cases."""
    number = case.seed - 1
    return -1 if (number + number // 6) % 2 else 1


def found() -> Iterator[Try]:
    """Eight faults in sixty cases, with the inertial unit and with it lost from the first frame on."""
    for unit, case in product((True, False), cases(ONSET_S)):
        steps = (offset(5.0, case), offset(20.0, case), scale(0.8), scale(1.5))
        for fault in (*steps, *(ramp(rate, case) for rate in (0.5, 1.0, 2.0, 5.0))):
            yield Try("with the unit" if unit else "unit lost", case, fault, unit)


def slow() -> Iterator[Try]:
    """Ramps with which the estimated drift goes along."""
    for case, rate in product(cases(ONSET_S), (0.1, 0.2, 0.3)):
        yield Try("slow", case, ramp(rate, case))


def early() -> Iterator[Try]:
    """F to 0.5 before drift and gusts are known, and soon after."""
    for onset_s, over_s in product((3.0, 12.0), (0.0, 10.0, 60.0)):
        yield from (Try(f"at {onset_s:g} s", case, scale(0.5, over_s)) for case in cases(onset_s))


def free() -> Iterator[Try]:
    """Moderate turbulence, six seeds: every half minute a climb or descent, a turn or a change of speed."""
    for number, (place, _) in enumerate(product(places(), range(6)), 101):
        rng = np.random.default_rng(number)
        steps = [held(axis, start_s, rng) for axis, start_s in zip(cycle(MOST), range(15, 580, 30), strict=False)]
        yield Try("no fault", Case(*place, "moderate", FREE_S - AFTER_S, number, ",".join(steps)), None)


def held(axis: str, start_s: int, rng: np.random.Generator) -> str:
    """A change for 20 s to two minutes, either way."""
    size, duration_s = MOST[axis] * rng.uniform(-1.0, 1.0), rng.uniform(20.0, 120.0)
    return f'{{kind="hold",axis="{axis}",start_s={start_s}.0,duration_s={duration_s:.2f},amplitude={size:.3f}}}'


ROWS: Final = {"found": found, "slow": slow, "early": early, "free": free}
