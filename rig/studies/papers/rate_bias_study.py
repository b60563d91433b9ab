"""The fault-tolerant law against the plain law under common faults of rates and attitudes.

Each case is flown with the plain law, with the fault-tolerant law, and once without the fault.  The altitude error is
the largest difference of the true altitude from the flight without the fault, from the onset on.  Both laws fly that
flight identically, bit for bit.  Within bounds: at most 1.5 times the plain law's error, or 25 m more, whichever is
larger; if the plain law loses the aircraft, not earlier than it.  Flights drawn at random check that nothing was tuned
to the grid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from shlex import quote
from typing import Any, Final

import numpy as np
from numpy.random import Generator, SeedSequence

from rig.core.frame import FLIGHT_INDEX, Block, SensorFault, Trust
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.scenario.aircraft import tables
from rig.studies.campaign.pool import each
from rig.studies.campaign.statistics import proportion
from rig.studies.papers.tolerant import answered_after_s, survived

AFTER_S: Final = 60.0  # flown after the onset
POINTS: Final = {"f16": "20000ft_m06", "b747": "35000ft_m084", "b737": "30000ft_m074"}
TURBULENCE: Final = ("none", "light", "moderate")
ONSETS_S: Final = (5.0, 10.0, 20.0, 30.0, 40.0)
SOME_ONSETS_S: Final = (10.0, 30.0)  # of faults other than a bias of all four channels
BIASES_RAD_S: Final = (0.002, 0.004, 0.005, 0.01, 0.02, 0.035, 0.05)
SOME_BIASES_RAD_S: Final = (0.01, 0.02, 0.04)
RAMP_S: Final = 20.0
ALL_CHANNELS: Final = "[1,2,3,4]"
HALVED: Final = ("yaw_rate", "heading", "roll_angle")
FACTOR: Final = 1.5
MORE_M: Final = 25.0
LAWS: Final = ("autopilot", "fault-tolerant")
_ALTITUDE: Final = FLIGHT_INDEX["altitude_m"]
_FOUND: Final = (SensorFault.EFFECTIVENESS, SensorFault.OFFSET, SensorFault.BOTH)

DRAWN: Final = {  # kinds of faults, of ten flights that are drawn
    "all four pitch rates, drawn": 5,
    "some of four pitch rates, drawn": 1,
    "all four, growing, drawn": 1,
    "scale of a rate or attitude, drawn": 2,
    "unit's pitch rate, drawn": 1,
}
AXES: Final = {"heading": 0.6, "altitude": 120.0, "airspeed": 8.0}  # largest change that is drawn; rad, m, m/s


@dataclass(frozen=True, slots=True)
class Case:
    """A flight before its law and its fault; ``manoeuvres`` are inline tables of the pilot."""

    aircraft: str
    flight_point: str
    turbulence: str
    onset_s: float
    seed: int
    manoeuvres: str


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault before its onset: name, size and keys."""

    kind: str
    size: float
    keys: str


CaseFaults = tuple[Case, list[Fault]]


@dataclass(frozen=True, slots=True)
class LawComparison:
    """One fault flown with both laws."""

    case: Case
    fault: Fault
    plain_m: float
    tolerant_m: float
    plain_survived: bool
    tolerant_survived: bool
    within: bool
    blamed: bool  # the pitch-angle sensor, which is healthy: corrected, or reported as faulty
    answered_after_s: float | None  # a rate is biased
    early: bool  # reported before the onset
    identical: bool  # both laws gave the same surface commands, bit for bit
    command: str  # command that flies it again


def biases(kind: str, sizes: Sequence[float], channels: str, more: str = "") -> list[Fault]:
    """Return offsets of the pitch rate with both signs."""
    keys = f'kind="offset",signal="pitch_rate",channels={channels}{more}'
    return [Fault(kind, sign * size, f"{keys},offset={sign * size}") for size, sign in product(sizes, (1.0, -1.0))]


ALL_FOUR: Final = biases("all four pitch rates", BIASES_RAD_S, ALL_CHANNELS)
OTHERS: Final = [
    *biases("two of four pitch rates", SOME_BIASES_RAD_S, "[1,2]"),
    *biases(f"all four, over {RAMP_S:g} s", SOME_BIASES_RAD_S, ALL_CHANNELS, f",ramp_s={RAMP_S}"),
    *(
        Fault(f"{name} x 0.5", 0.5, f'kind="scale",signal="{name}",channels={ALL_CHANNELS},factor=0.5')
        for name in ("pitch_rate", *HALVED)
    ),
]


def cases(seeds: Sequence[int]) -> list[Case]:
    """Return every aircraft, turbulence and onset, with each seed."""
    return [of_grid(*which) for which in product(POINTS, TURBULENCE, ONSETS_S, seeds)]


def of_grid(aircraft: str, turbulence: str, onset_s: float, seed: int) -> Case:
    """Return a case in which a turn and a climb come after the onset."""
    turn = f'{{kind="hold",axis="heading",start_s={onset_s + 15.0},duration_s=20.0,amplitude=0.3}}'
    climb = f'{{kind="step",axis="altitude",start_s={onset_s + 35.0},amplitude=60.0}}'
    return Case(aircraft, POINTS[aircraft], turbulence, onset_s, seed, f"{turn},{climb}")


def faults_of(case: Case) -> list[Fault]:
    """Return the faults of a case of the grid."""
    return [*ALL_FOUR, *(OTHERS if case.onset_s in SOME_ONSETS_S else ())]


def grid(seeds: Sequence[int]) -> list[CaseFaults]:
    """Return every case with its faults."""
    return [(case, faults_of(case)) for case in cases(seeds)]


def drawn(number: int, seed: int) -> list[CaseFaults]:
    """Draw ``number`` flights with one fault each; each depends only on ``seed`` and its number."""
    return [_draw(np.random.default_rng(SeedSequence(seed, spawn_key=(i,))), i) for i in range(number)]


def _draw(rng: Generator, number: int) -> CaseFaults:
    aircraft = str(rng.choice(list(POINTS)))
    points = [point["name"] for point in tables(aircraft)["airframe"]["flight_points"]]
    onset = round(rng.uniform(ONSETS_S[0], ONSETS_S[-1]), 2)
    manoeuvres = ",".join(_manoeuvre(rng, onset) for _ in range(rng.integers(1, 5)))
    case = Case(aircraft, str(rng.choice(points)), str(rng.choice(TURBULENCE)), onset, 1 + number, manoeuvres)
    kinds = [kind for kind, share in DRAWN.items() for _ in range(share)]
    return case, [_fault(rng, kinds[number % len(kinds)])]


def _manoeuvre(rng: Generator, onset: float) -> str:
    """Return a change of heading, altitude or airspeed before or after the onset, permanent or for a time."""
    axis = str(rng.choice(list(AXES)))
    keys = f'axis="{axis}",start_s={rng.uniform(1.0, onset + 40.0):.2f},amplitude={AXES[axis] * rng.uniform(-1, 1):.3f}'
    return (
        f'{{kind="step",{keys}}}'
        if rng.random() < 0.3
        else f'{{kind="hold",duration_s={rng.uniform(5, 40):.2f},{keys}}}'
    )


def _fault(rng: Generator, kind: str) -> Fault:
    size = round(float(np.exp(rng.uniform(*np.log([BIASES_RAD_S[0], BIASES_RAD_S[-1]]))) * rng.choice([-1.0, 1.0])), 5)
    if kind.startswith("unit"):
        return Fault(kind, size, f'kind="offset",signal="inertial.pitch_rate_rad_s",offset={size}')
    if kind.startswith("scale"):
        name, factor = rng.choice(["pitch_rate", *HALVED]), round(rng.uniform(0.3, 1.7), 3)
        return Fault(kind, factor, f'kind="scale",signal="{name}",channels={ALL_CHANNELS},factor={factor}')
    keys = f'kind="offset",signal="pitch_rate",offset={size}'
    if kind.startswith("some"):
        channels = sorted(int(c) for c in rng.choice([1, 2, 3, 4], rng.integers(2, 4), replace=False))
        return Fault(kind, size, f"{keys},channels={channels}")
    ramp = f",ramp_s={rng.uniform(1, 50):.2f}" if "growing" in kind else ""
    return Fault(kind, size, f"{keys},channels={ALL_CHANNELS}{ramp}")


def study(flights: Sequence[CaseFaults], workers: int = 2) -> list[LawComparison]:
    """Fly every case with its faults and both laws."""
    return [flown for part in each(fly_case, flights, workers) for flown in part]


def fly_case(flight: CaseFaults) -> list[LawComparison]:
    """Fly all faults of one case."""
    return list(fly_faults(*flight))


def fly_faults(case: Case, faults: Sequence[Fault]) -> Iterator[LawComparison]:
    """Fly each of these faults with both laws."""
    healthy = fly(settings(case, None, LAWS[0]), case.seed)
    for fault in faults:
        plain, tolerant = (fly(settings(case, fault, law), case.seed) for law in LAWS)
        yield measure(case, fault, plain, tolerant, healthy)


def settings(case: Case, fault: Fault | None, law: str) -> list[str]:
    """Return the overrides of the default scenario."""
    faults = "" if fault is None else f"{{{fault.keys},start_s={case.onset_s}}}"
    return [
        "redundancy.common_mode=report",  # laws are compared, not the monitor
        *(f"aircraft={case.aircraft}", f"flight_point={case.flight_point}", f"turbulence={case.turbulence}"),
        *(f"duration_s={case.onset_s + AFTER_S}", f"pilot={{manoeuvres=[{case.manoeuvres}]}}"),
        *(f"faults=[{faults}]", f"control.law={law}"),
    ]


def fly(sets: Sequence[str], seed: int) -> Block:
    """Fly and return all rows of one flight."""
    return fly_rows(scenario.load(None, sets, seed))


def measure(case: Case, fault: Fault, plain: Block, tolerant: Block, healthy: Block) -> LawComparison:
    """Compare the two laws."""
    rate_hz = len(healthy) / (case.onset_s + AFTER_S)
    onset = round(case.onset_s * rate_hz)
    errors = [error(rows, healthy, onset) for rows in (plain, tolerant)]
    blamed = (tolerant["trust"] == Trust.CORRECTED) | np.isin(tolerant["sensor_fault"], _FOUND)
    flags = [f"--set {quote(key)}" for key in settings(case, fault, LAWS[1])]
    return LawComparison(
        case=case,
        fault=fault,
        plain_m=errors[0],
        tolerant_m=errors[1],
        plain_survived=survived(plain),
        tolerant_survived=survived(tolerant),
        within=_within(plain, tolerant, errors),
        blamed=bool(blamed.any()),
        answered_after_s=answered_after_s(tolerant["sensor_fault"][onset:] == SensorFault.RATE_BIAS, rate_hz),
        early=bool((tolerant["sensor_fault"][:onset] == SensorFault.RATE_BIAS).any()),
        identical=plain["surface_command"].tobytes() == tolerant["surface_command"].tobytes(),
        command=" ".join(["rig fly", f"--seed {case.seed}", *flags]),
    )


def _within(plain: Block, tolerant: Block, errors: Sequence[float]) -> bool:
    """Return True if the fault-tolerant law is within bounds; if the plain law lost the aircraft, if it flew longer."""
    if not survived(plain):
        return len(tolerant) >= len(plain)
    return survived(tolerant) and errors[1] <= bound(errors[0])


def error(rows: Block, healthy: Block, onset: int) -> float:
    """Return the largest difference of the true altitude [m] from the flight without the fault, over both flights."""
    both = min(len(rows), len(healthy))
    return float(np.abs(rows["flight"][onset:both, _ALTITUDE] - healthy["flight"][onset:both, _ALTITUDE]).max())


def bound(plain_m: float) -> float:
    """Return the bound of the altitude error [m] if the plain law's is ``plain_m``."""
    return max(FACTOR * plain_m, plain_m + MORE_M)


def summarise(flown: Sequence[LawComparison]) -> list[dict[str, Any]]:
    """Summarise by kind of fault and aircraft, with all of them last: counts, shares with exact 95 % intervals."""
    groups: dict[tuple[str, str], list[LawComparison]] = {}
    for kind, aircraft in product(dict.fromkeys(pair.fault.kind for pair in flown), POINTS):
        group = [pair for pair in flown if (pair.fault.kind, pair.case.aircraft) == (kind, aircraft)]
        groups |= {(kind, aircraft): group} if group else {}
    groups["all", "all"] = list(flown)
    return [{"kind": kind, "aircraft": aircraft, **_counts(group)} for (kind, aircraft), group in groups.items()]


def _counts(flown: Sequence[LawComparison]) -> dict[str, Any]:
    return {
        "flights": len(flown),
        **{name: asdict(proportion(_count(flown, name), len(flown))) for name in ("within", "blamed")},
        "answered": sum(pair.answered_after_s is not None for pair in flown),
        **{name: _count(flown, name) for name in ("early", "identical")},
        **{f"lost_{law}": len(flown) - _count(flown, f"{law}_survived") for law in ("plain", "tolerant")},
        "most_above_plain_m": max(pair.tolerant_m - pair.plain_m for pair in flown),
    }


def _count(flown: Sequence[LawComparison], name: str) -> int:
    return sum(getattr(pair, name) for pair in flown)


def worst(flown: Sequence[LawComparison], most: int = 5) -> list[LawComparison]:
    """Return the sort key: out of bounds, healthy sensor reported, error above the plain law's, error."""
    rank = lambda pair: (pair.within, not pair.blamed, pair.plain_m - pair.tolerant_m, -pair.tolerant_m)  # noqa: E731
    return sorted(flown, key=rank)[:most]


def as_dict(flown: Sequence[LawComparison]) -> dict[str, Any]:
    """Return the plain data of ``rig study rate-bias --json``."""
    return {"table": summarise(flown), "worst": list(map(asdict, worst(flown))), "rows": list(map(asdict, flown))}
