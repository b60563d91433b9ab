"""Design the references: coefficients from the linear model, filters and thresholds from flights.

Healthy aircraft fly manoeuvres with the stick and with the autopilot, in calm air and in turbulence, at every trim
point.  The references run over the rows as in flight.  The difference between reference and vote selects the filters,
and its largest value gives the threshold.  References do not change a healthy flight, so one set of flights measures
every source.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomli_w
from numpy.typing import NDArray

from rig.computer.analytic.designed import FILTERS, Designed, Error, Point
from rig.computer.analytic.reference_sources import PARTNERS, REMEMBERED, Config, source
from rig.computer.analytic.references import References, refer, remember
from rig.computer.control.gains_file import Gains
from rig.core.errors import BadInput, PointFault, RigError
from rig.core.files import write_text
from rig.core.frame import INDEX, SIGNALS, Block, End
from rig.core.kernels import kernel
from rig.core.progress import tell
from rig.core.settings import build
from rig.core.units.angles import differences
from rig.core.units.constants import DENSITY_PRINTED, GRAVITY
from rig.flight.loop import fly_rows
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario
from rig.world.plant.airframe import Airframe, FlightPoint, parse
from rig.world.plant.linearise import Linear, linearise

# The healthy flights: manoeuvres, turbulence and seeds.
SEEDS: Final = (1, 2, 3, 4, 5, 6, 7, 8)  # of calibration, noise and turbulence, for every flight
TURBULENCE: Final = ("none", "light", "moderate")
Case = tuple[str, str, int]  # flight, turbulence, seed


def _manoeuvre(kind: str, axis: str, start_s: float, amplitude: float, **more: float) -> dict[str, Any]:
    return {"kind": kind, "axis": axis, "start_s": start_s, "amplitude": amplitude, **more}


def _on_the_sticks(*manoeuvres: dict[str, Any]) -> dict[str, Any]:
    return {"duration_s": 20.0, "pilot": {"autopilot_engaged": False, "manoeuvres": list(manoeuvres)}}


# Brisk but ordinary: about a third of the load factor and half of the roll rate that the stick can command.
FLIGHTS: Final[dict[str, dict[str, Any]]] = {
    "pitch": _on_the_sticks(
        _manoeuvre("3-2-1-1", "stick_pitch", 2.0, 0.3, duration_s=3.5),
        _manoeuvre("doublet", "stick_pitch", 10.0, 0.4, duration_s=3.0),
    ),
    "roll and yaw": _on_the_sticks(
        _manoeuvre("doublet", "stick_roll", 2.0, 0.5, duration_s=2.0),
        _manoeuvre("doublet", "pedal", 10.0, 0.5, duration_s=3.0),
    ),
    "climb and turn": {
        "duration_s": 60.0,
        "pilot": {
            "manoeuvres": [
                _manoeuvre("step", "altitude", 5.0, 60.0),
                _manoeuvre("step", "heading", 30.0, 0.35),
            ],
        },
    },
}
RATE_HZ: Final = 100.0
RESERVE: Final = 1.2  # threshold over the worst measured error
SETTLED_S: Final = 0.5  # the start of each flight is not measured
FILTERS_S: Final = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2)  # not slower: a law may have to fly on it
Key = tuple[str, str]  # signal and source; the name of an airspeed error instead of the source
# Signals also measured as an equivalent airspeed: wind is the error of a speed over ground.
AS_AIRSPEED: Final[dict[Key, str]] = {("dynamic_pressure", "inertial"): "inertial, equivalent airspeed"}
Errors = dict[Key, NDArray[np.float32]]
Summary = dict[str, dict[str, Error]]  # by signal and source


def cases() -> list[Case]:
    """Return every flight of a flight point, in order."""
    return [(flight, turbulence, seed) for flight in FLIGHTS for turbulence in TURBULENCE for seed in SEEDS]


def label(flight_point: str, case: Case) -> str:
    """Return the name of a measured flight in references.toml."""
    flight, turbulence, seed = case
    return f"{flight_point}, {flight}, turbulence {turbulence}, seed {seed}"


def rounds(keys: Collection[Key] = PARTNERS) -> list[Config]:
    """Return the settings of the references that together have each of these sources once."""
    sources: dict[str, list[str]] = {signal: [] for signal, _ in PARTNERS}
    for signal, chosen in keys:
        sources[signal].append(chosen)
    most = max(map(len, sources.values()))
    return [build(Config, {s: (of[i:] or ["none"])[0] for s, of in sources.items()}, "references") for i in range(most)]


# References without measured thresholds are compared with channels, but do not isolate them.
_UNMEASURED: Final = {"redundancy": {"common_mode": "report"}}
# The references that each filter serves: it is chosen for the smallest of their largest errors in thresholds.
_SERVES: Final = {
    "alpha_filter_s": (("pitch_rate", "angle_of_attack"),),
    "attitude_filter_s": (("pitch_rate", "attitude"), ("roll_rate", "attitude"), ("yaw_rate", "attitude")),
    "acceleration_filter_s": (
        ("normal_load_factor", "angle_of_attack"),
        ("angle_of_attack", "load_factor"),
        ("angle_of_sideslip", "lateral_load_factor"),
        ("lateral_load_factor", "angle_of_sideslip"),
    ),
    "unit_filter_s": tuple((f"{axis}_load_factor", "inertial") for axis in ("normal", "lateral", "longitudinal")),
}
# The quickest filter whose largest error is within this factor of the smallest.  An unstable aircraft may have to fly
# on the pitch rate, where every hundredth of a second of delay matters and the largest errors hardly differ.
_NEARLY: Final = {"alpha_filter_s": 1.1}


@dataclass(frozen=True)
class Measured:
    """One flight point, its filters, and reference minus vote in every settled frame of each of ``cases``."""

    point: Point
    errors: list[Errors]


def design(name: str, gains: Gains) -> Designed:
    """Return the references of an aircraft.  BadInput or RigError: it cannot be flown.

    Pure: the same aircraft and gains give the same numbers.  Some seconds for each flight point.
    """
    tables = _tables(name, gains)
    airframe = parse(tables["airframe"], f"aircraft {name}")
    measured: list[Measured] = []
    for point in airframe.flight_points:
        tell(f"measuring the references of {point.name}", len(measured), len(airframe.flight_points))
        measured.append(measure(tables, airframe, point))
    measured.sort(key=lambda item: item.point.dynamic_pressure_pa)
    return _designed(airframe, [item.point for item in measured], *split(_summary(measured)))


def _tables(name: str, gains: Gains) -> dict[str, Any]:
    return {**aircraft.own_tables(name), "aircraft": name, "gains": gains.model_dump()}


def split(errors: Summary) -> tuple[Summary, Summary]:
    """Return errors in the signals' units, and as equivalent airspeeds under the names of their sources."""
    airspeeds: Summary = {}
    for (signal, chosen), name in AS_AIRSPEED.items():
        airspeeds.setdefault(signal, {})[chosen] = errors[signal][name]
    named = AS_AIRSPEED.values()
    return {s: {c: e for c, e in of.items() if c not in named} for s, of in errors.items()}, airspeeds


def _designed(airframe: Airframe, points: list[Point], errors: Summary, airspeeds: Summary | None = None) -> Designed:
    place = {f"accelerometer_{key}": value for key, value in airframe.accelerometer}
    return Designed(rate_hz=RATE_HZ, **place, points=points, errors=errors, airspeed_errors=airspeeds or {})


def coefficients(linear: Linear) -> dict[str, float]:
    """Return the coefficients of a Point, six digits of each, from the small motions about its trim.

    alpha_dot = Z_alpha alpha + Z_q q + Z_elevator elevator, and the same for beta_dot.  The moment equations replace
    the surfaces: elevator = (q_dot - M_alpha alpha - M_q q) / M_elevator.
    """
    trim, speed_g = linear.trim, linear.trim.airspeed_m_s / GRAVITY
    pressure = trim.dynamic_pressure_pa
    a, b = linear.longitudinal_a, linear.longitudinal_b
    tail = b[1, 0] / b[2, 0]  # Z_elevator / M_elevator, s
    lift_slope = -(a[1, 1] - tail * a[2, 1]) * speed_g / pressure
    a_lateral, b_lateral = linear.lateral_a, linear.lateral_b
    fins, side = np.zeros(2), -lift_slope * pressure / speed_g  # any slope: there is no side force
    if linear.rolls:
        fins = np.linalg.solve(b_lateral[1:3].T, b_lateral[0])  # of aileron and rudder together, s
        side = a_lateral[0, 0] - fins @ a_lateral[1:3, 0]
        if side >= 0.0:  # the fin's force hides the body's: this model has no sideslip information without the rudder
            fins, side = np.zeros(2), a_lateral[0, 0]
    values = {
        "dynamic_pressure_pa": pressure,
        "lift_slope_1_pa": lift_slope,
        "zero_lift_alpha_rad": trim.alpha_rad - 1.0 / (pressure * lift_slope),
        "pitch_rate_gain": a[1, 2] - tail * a[2, 2],
        "elevator_arm_m": tail * trim.airspeed_m_s,
        "side_slope_1_pa": side * speed_g / pressure,
        "roll_arm_m": fins[0] * trim.airspeed_m_s,
        "yaw_arm_m": fins[1] * trim.airspeed_m_s,
    }
    return {key: _digits(float(value), 6) for key, value in values.items()}


def measure(tables: dict[str, Any], airframe: Airframe, flight_point: FlightPoint) -> Measured:
    """Fly one flight point, try every filter, keep the best."""
    fixed = coefficients(linearise(airframe, flight_point))
    tried = [_point(flight_point, fixed, filter_s) for filter_s in FILTERS_S]
    designs = [_designed(airframe, [point], {}) for point in tried]
    by_filter: list[list[Errors]] = [[] for _ in tried]
    served = [key for keys in _SERVES.values() for key in keys]
    for case in cases():
        rows = fly(tables, flight_point, designs[0], case)
        for of_filter, item in zip(by_filter, designs, strict=True):
            of_filter.append(all_errors(rows, item, PARTNERS if item is designs[0] else served))
            _refuse_gaps(of_filter[-1], flight_point, case)
    best = _choose(by_filter, tables["redundancy"]["signals"])
    of = {key: best[filter_name] for filter_name, keys in _SERVES.items() for key in keys}
    # references without a filter are the same with all of them
    chosen = [{key: by_filter[of.get(key, 0)][i][key] for key in item} for i, item in enumerate(by_filter[0])]
    filters = {filter_name: FILTERS_S[i] for filter_name, i in best.items()}
    return Measured(tried[0].model_copy(update=filters), chosen)


def _refuse_gaps(errors: Errors, flight_point: FlightPoint, case: Case) -> None:
    """Raise PointFault for a reference without a value in a healthy flight: a vote that it needs was missing."""
    for (signal, chosen), error in errors.items():
        if not np.isfinite(error).all():
            where = f"in the healthy flight {label(flight_point.name, case)}"
            raise PointFault(f"{where} the reference of {signal} from {chosen} has no value", flight_point.name)


def _point(flight_point: FlightPoint, fixed: dict[str, float], filter_s: float) -> Point:
    """Return the references of one flight point.  PointFault names a coefficient that they cannot use."""
    data = {"name": flight_point.name, **fixed, **dict.fromkeys(FILTERS, filter_s)}
    try:
        return build(Point, data, f"design of the references of {flight_point.name}")
    except BadInput as error:
        raise PointFault(str(error), flight_point.name) from None


def try_out(name: str, gains: Gains, point: FlightPoint) -> None:
    """Fly each manoeuvre in each turbulence at a flight point.  PointFault names the one that loses the aircraft."""
    tell(f"trying out {point.name}")
    tables = _tables(name, gains)
    airframe = parse(tables["airframe"], f"aircraft {name}")
    designed = _designed(airframe, [_point(point, coefficients(linearise(airframe, point)), FILTERS_S[0])], {})
    for case in cases():
        if case[-1] == SEEDS[0]:
            _ = fly(tables, point, designed, case)


def fly(tables: dict[str, Any], flight_point: FlightPoint, designed: Designed, case: Case) -> Block:
    """Return all rows of one flight.  RigError: the healthy aircraft is lost."""
    flight, turbulence, seed = case
    own = {"turbulence": turbulence, "seed": seed, "rate_hz": RATE_HZ, **FLIGHTS[flight]}
    own |= {"flight_point": flight_point.name, "references": designed.model_dump()}
    scenario = build(Scenario, aircraft.merge({**tables, **own}, _UNMEASURED), f"aircraft {tables['aircraft']}")
    rows = fly_rows(scenario)
    if rows["end"][-1] != 0:
        reason = End(int(rows["end"][-1])).cause
        where = f"in the healthy flight {flight!r}, {turbulence} turbulence, after {len(rows) / RATE_HZ:.1f} s"
        raise PointFault(f"{tables['aircraft']} {flight_point.name}: lost {where}: {reason}", flight_point.name)
    return rows


def all_errors(rows: Block, designed: Designed, keys: Collection[Key] = PARTNERS) -> Errors:
    """Return ``errors`` of these sources."""
    collected: Errors = {}
    for config in rounds(keys):
        collected |= errors(rows, config, designed)
    return collected


def errors(rows: Block, config: Config, designed: Designed) -> Errors:
    """Return reference minus vote of every settled frame, by signal and source; overwrite ``reference``.

    A reference that remembers its own signal is measured against the farthest channel: it has learned the vote, but it
    is compared with a channel.
    """
    run(rows, References(config, designed, RATE_HZ).data)
    settled = rows[round(SETTLED_S * RATE_HZ) :]
    collected: Errors = {}
    for key in PARTNERS:
        s = INDEX[key[0]]
        if source(config, key[0]) == key[1]:
            measured = settled["channels" if key[0] in REMEMBERED.get(key, ()) else "voted"][:, s]
            off = differences(settled["reference"][:, s, None], measured.reshape(len(settled), -1), SIGNALS[s].wraps)
            collected[key] = off[np.arange(len(off)), np.abs(off).argmax(axis=1)].astype(np.float32)
            if key in AS_AIRSPEED:
                scale = np.sqrt(2.0 * DENSITY_PRINTED * settled["reference"][:, s])
                collected[key[0], AS_AIRSPEED[key]] = (collected[key] / scale).astype(np.float32)
    return collected


@kernel
def run(rows, data):
    """Run the references over voted rows, as in flight."""
    for k in range(len(rows)):
        refer(rows[k], rows[k], data)
        remember(rows[k], rows[k], data)


def _choose(tried: list[list[Errors]], monitors: dict[str, Any]) -> dict[str, int]:
    """Return for each filter the place of the candidate with the smallest largest error, or nearly so.

    tried : for each candidate, quickest first, the errors of every flight
    """
    best: dict[str, int] = {}
    for filter_name, keys in _SERVES.items():
        worst = [
            max(float(np.abs(flight[key]).max()) / monitors[key[0]]["threshold"] for flight in flights for key in keys)
            for flights in tried
        ]
        best[filter_name] = int(np.argmax(np.array(worst) <= _NEARLY.get(filter_name, 1.0) * min(worst)))
    return best


def _summary(measured: list[Measured]) -> Summary:
    flown = [(label(m.point.name, case), e) for m in measured for case, e in zip(cases(), m.errors, strict=True)]
    summary: Summary = {}
    for key in flown[0][1]:
        signal, chosen = key
        peaks = [float(np.abs(e[key]).max()) for _, e in flown]
        size = np.abs(np.concatenate([e[key] for _, e in flown]).astype(np.float64))
        worst = _digits(max(peaks), 3)
        summary.setdefault(signal, {})[chosen] = Error(
            rms=_digits(float(np.sqrt(np.mean(size**2))), 3),
            quantile_999=_digits(float(np.quantile(size, 0.999)), 3),
            worst=worst,
            threshold=_digits(RESERVE * worst, 3),
            worst_in=flown[int(np.argmax(peaks))][0],
        )
    return summary


def _digits(value: float, digits: int) -> float:
    """Return ``value`` rounded to a number of digits, so that the last bits of a computer's arithmetic do not show."""
    if not np.isfinite(value):
        raise RigError("design of references: a number is not finite")
    return float(f"{value:.{digits}g}") + 0.0  # which makes a minus zero plain


def write(designed: Designed, path: Path) -> None:
    """Write references.toml; same design, same bytes."""
    write_text(path, render(designed))


def render(designed: Designed) -> str:
    """Return the text of references.toml."""
    head = "# Written by the design from aircraft.toml and gains.toml; do not edit.\n\n"
    return head + tomli_w.dumps(designed.model_dump())
