"""The fault-tolerant law against the plain law in flights with the same pitch-angle error on all four channels.

Each case is flown three times: the plain law on the mean of the channels, the plain law behind the voter, and the
fault-tolerant law behind the voter; and once without the fault, from which deviations of the truth are computed.
The airframe is flown as designed and with its centre of gravity moved, which the law does not model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import FLIGHT_INDEX, INDEX, Block, End, Trust
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.studies.campaign.pool import each
from rig.studies.campaign.statistics import proportion

ONSET_S: Final = 20.0
LAST_S: Final = 10.0  # over which the steady deviation is taken
DURATION_S: Final = 80.0
POINTS: Final = {"b747": "35000ft_m084", "f16": "20000ft_m06"}
SHIFTS_M: Final = {"b747": (0.0, -0.3, 0.3), "f16": (0.0, -0.03, 0.03)}  # of the centre of gravity, + is aft
STEPS: Final = {
    "pitch": '{kind="step",axis="pitch_angle",start_s=10.0,amplitude=0.05}',
    "altitude": '{kind="step",axis="altitude",start_s=40.0,amplitude=60.0}',
}
TURBULENCE: Final = ("none", "moderate")
FAULTS: Final = {
    "F 0.2": 'kind="scale",factor=0.2',
    "F 0.5": 'kind="scale",factor=0.5',
    "F 0.8": 'kind="scale",factor=0.8',
    "F 1.5": 'kind="scale",factor=1.5',
    "offset +0.05": 'kind="offset",offset=0.05',
    "offset -0.05": 'kind="offset",offset=-0.05',
    "F to 0.5 over 10 s": 'kind="scale",factor=0.5,ramp_s=10.0',
    "offset to 0.05 over 10 s": 'kind="offset",offset=0.05,ramp_s=10.0',
}
LAWS: Final = {
    "plain": ("control.law=autopilot", "redundancy.manager=mean"),
    "plain, voter": ("control.law=autopilot",),
    "fault-tolerant": ("control.law=fault-tolerant",),
}
_WORST: Final = ("pitch_peak_rad", "pitch_steady_rad", "altitude_loss_m", "load_factor_max")
_THETA, _N_Z, _ALTITUDE = INDEX["pitch_angle"], INDEX["normal_load_factor"], FLIGHT_INDEX["altitude_m"]


@dataclass(frozen=True, slots=True)
class Case:
    """A flight before its law and its fault."""

    aircraft: str
    hold: str
    turbulence: str
    cg_shift_m: float
    seed: int


@dataclass(frozen=True, slots=True)
class FaultFlight:
    """One flight with a fault; deviations of the true values from the flight without it, from the onset on."""

    case: Case
    fault: str
    law: str
    pitch_peak_rad: float
    pitch_steady_rad: float
    altitude_loss_m: float
    load_factor_max: float
    detected_after_s: float | None
    survived: bool


@dataclass(frozen=True, slots=True)
class Summary:
    """All flights of one fault, hold and law: the worst of each figure, shares with exact 95 % intervals."""

    fault: str
    hold: str
    law: str
    flights: int
    pitch_peak_rad: float
    pitch_steady_rad: float
    altitude_loss_m: float
    load_factor_max: float
    detected: int
    detected_after_s: float | None
    survived: int
    survived_low: float
    survived_high: float


def cases(seeds: Sequence[int]) -> list[Case]:
    """Return every aircraft, hold, turbulence and centre of gravity, with each seed."""
    return [
        Case(name, hold, turbulence, shift, seed)
        for name in POINTS
        for hold, turbulence, shift, seed in product(STEPS, TURBULENCE, SHIFTS_M[name], seeds)
    ]


def study(seeds: Sequence[int] = (1,), workers: int = 2) -> tuple[list[FaultFlight], int]:
    """Fly all cases; return the flights with a fault, and the number of all flights."""
    flown = [flight for part in each(fly_case, cases(seeds), workers) for flight in part]
    return flown, len(flown) + len(LAWS) * len(cases(seeds))


def fly_case(case: Case) -> list[FaultFlight]:
    """Fly all faults and laws of one case."""
    flown: list[FaultFlight] = []
    for law in LAWS:
        healthy = fly(case, law, None)
        flown += [measure(case, fault, law, fly(case, law, fault), healthy) for fault in FAULTS]
    return flown


def fly(case: Case, law: str, fault: str | None) -> Block:
    """Fly and return all rows of one flight."""
    faults = "" if fault is None else f'{{signal="pitch_angle",channels=[1,2,3,4],start_s={ONSET_S},{FAULTS[fault]}}}'
    sets = [
        "redundancy.common_mode=report",  # laws are compared, not the monitor
        *(f"aircraft={case.aircraft}", f"flight_point={POINTS[case.aircraft]}", f"duration_s={DURATION_S}"),
        *(f"turbulence={case.turbulence}", f"control.vertical={case.hold}", f"faults=[{faults}]"),
        *(f"pilot={{manoeuvres=[{STEPS[case.hold]}]}}", *LAWS[law]),
    ]
    chosen = scenario.load(None, sets, case.seed)
    if case.cg_shift_m != 0.0:
        shift = chosen.resolved()["airframe"].get("cg_x_shift_m", 0.0) + case.cg_shift_m
        chosen = scenario.load(None, [*sets, f"airframe.cg_x_shift_m={shift}"], case.seed)
    return fly_rows(chosen)


def measure(case: Case, fault: str, law: str, rows: Block, healthy: Block) -> FaultFlight:
    """Measure the effect of the fault on the true flight."""
    rate_hz = len(healthy) / DURATION_S
    onset, last = round(ONSET_S * rate_hz), round(LAST_S * rate_hz)
    both = min(len(rows), len(healthy))
    off = (rows["truth"][:both, _THETA] - healthy["truth"][:both, _THETA])[onset:]
    lost = (healthy["flight"][:both, _ALTITUDE] - rows["flight"][:both, _ALTITUDE])[onset:]
    return FaultFlight(
        case=case,
        fault=fault,
        law=law,
        pitch_peak_rad=float(np.abs(off).max()),
        pitch_steady_rad=float(abs(off[-last:].mean())),
        altitude_loss_m=float(max(lost.max(), 0.0)),
        load_factor_max=float(rows["truth"][onset:, _N_Z].max()),
        detected_after_s=answered_after_s(rows["trust"][onset:] == Trust.CORRECTED, rate_hz),
        survived=survived(rows),
    )


def answered_after_s(answers: NDArray[np.bool_], rate_hz: float) -> float | None:
    """Return the time of the law's first diagnosis after the onset, from the starts ``answers`` (n,)."""
    return float(answers.argmax()) / rate_hz if answers.any() else None


def survived(rows: Block) -> bool:
    """Return True if the aircraft was still flying in the last frame."""
    return bool(rows["end"][-1] == End.FLYING)


def summarise(flown: Sequence[FaultFlight]) -> list[Summary]:
    """Summarise by fault, hold and law."""
    groups: dict[tuple[str, str, str], list[FaultFlight]] = {key: [] for key in product(STEPS, FAULTS, LAWS)}
    for flight in flown:
        groups[flight.case.hold, flight.fault, flight.law].append(flight)
    return [_summary(fault, hold, law, group) for (hold, fault, law), group in groups.items()]


def _summary(fault: str, hold: str, law: str, flown: list[FaultFlight]) -> Summary:
    survived = proportion(sum(flight.survived for flight in flown), len(flown))
    delays = [flight.detected_after_s for flight in flown if flight.detected_after_s is not None]
    return Summary(
        fault=fault,
        hold=hold,
        law=law,
        flights=len(flown),
        **{name: max(getattr(flight, name) for flight in flown) for name in _WORST},
        detected=len(delays),
        detected_after_s=max(delays, default=None),
        survived=survived.count,
        survived_low=survived.low or 0.0,
        survived_high=survived.high or 0.0,
    )


def as_dict(flown: Sequence[FaultFlight], flights: int) -> dict[str, Any]:
    """Return the plain data of ``rig study fault-tolerant --json``."""
    return {"flights": flights, "table": list(map(asdict, summarise(flown))), "rows": list(map(asdict, flown))}
