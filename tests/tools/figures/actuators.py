"""Servo actuators measured: beside the lag, healthy, with every fault, and what a frame with them costs.

``servo_picture`` draws docs/pictures/servo.svg; all others print a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count, product
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures import table
from rig.core.frame import INDEX, MOVED
from rig.flight import loop
from rig.flight.fly import fly as fly_logged
from rig.scenario.scenario import Scenario, load
from rig.studies.campaign.flying import CampaignFlight, fly
from rig.studies.papers.servo_study import FREQUENCIES_HZ, RATES_HZ, Compared, compare
from rig.world.plant.airframe import Actuator

AIRCRAFT: Final = ("f16", "b747", "b737")
BASE: Final = "f16_elevator_coil_hardover"
PICTURES: Final = Path(__file__).parents[3] / "docs/pictures"
ONSET_S: Final = 5.0
AFTER_S: Final = 2.0  # in which a transient counts
LVDT_OFF: Final = 0.1  # of the stroke
MOVED_BY: Final = ("normal_load_factor", "lateral_load_factor", "pitch_rate", "roll_rate", "yaw_rate")
STICKS: Final = ("stick_pitch", "stick_roll", "pedal")
BY_HAND: Final = "pilot.autopilot_engaged=false"


def flown(aircraft: str, *sets: str) -> CampaignFlight:
    """Fly an aircraft with servos at its first flight point, in light turbulence unless ``sets`` say otherwise."""
    return fly(load(BASE, [f"aircraft={aircraft}", *sets]))


def faults(*given: str) -> str:
    """Return the override of the scenario's faults."""
    return f"faults=[{', '.join(f'{{{fault}}}' for fault in given)}]"


def on(surface: str, kind: str, start_s: float = ONSET_S, channels: str = "", more: str = "") -> str:
    """Return a fault of an actuator."""
    sat_on = f", channels=[{channels}]" if channels else ""
    return f"kind='{kind}', signal='actuator.{surface}'{sat_on}, start_s={start_s}{more}"


# Beside the lag.


def servo_response() -> None:
    """Print steps and sines of the F-16's elevator at six rates, and of its rudder, which is fastest."""
    heads = ["surface", "Hz", "later by, ms", "small step, %", "large step, deg", "from JSBSim's, deg"]
    heads += [f"{what} {hz:g} Hz" for what in ("gain", "delay, ms") for hz in FREQUENCIES_HZ]
    rows = [("f16 elevator", row) for row in compare("f16", "elevator", RATES_HZ)]
    rows += [("f16 rudder", row) for row in compare("f16", "rudder", [100.0])]
    table(heads, (_response(*row) for row in rows))


def _response(name: str, row: Compared) -> list[str]:
    large = (f"{np.degrees(off):.3f}" for off in (row.large_step_rad, row.large_step_jsbsim_rad))
    gains, delays = (f"{gain:.3f}" for gain in row.gain), (f"{1e3 * delay:.2f}" for delay in row.delay_s)
    return [
        name,
        f"{row.rate_hz:g}",
        f"{1e3 * row.shift_s:.2f}",
        f"{1e2 * row.small_step:.2f}",
        *large,
        *gains,
        *delays,
    ]


def servo_picture() -> None:
    """Draw docs/pictures/servo.svg."""
    from figures.servos_and_lanes import servo  # whose module needs this one

    (PICTURES / "servo.svg").write_text(servo(), encoding="utf-8")
    print(f"servo.svg: {(PICTURES / 'servo.svg').stat().st_size} B")


# Healthy.


def servo_healthy(flights: str = "200", duration_s: str = "12") -> None:
    """Print the largest statistic of each monitor in healthy flights, beside its threshold; any trip."""
    cases = [(*case, seed) for case, seed in zip(aircraft_and_rates(), range(int(flights)), strict=False)]
    found = [_healthy(*case, duration_s) for case in cases]
    config = load(BASE).actuators
    limits = {name: getattr(config, name).threshold for name in ("current", "spool", "position", "ram")}
    heads = ["Hz", "flights", "lost", "channels shut off", *(f"{name}, of {limit:g}" for name, limit in limits.items())]
    table(heads, (_worst(rate, [each for each in found if rate in (each[0], 0.0)]) for rate in (*RATES_HZ, 0.0)))


def aircraft_and_rates() -> Iterator[tuple[str, float]]:
    """Yield aircraft and rates in turn, for ever."""
    for _ in count():
        yield from ((name, rate) for rate, name in product(RATES_HZ, AIRCRAFT))


def _healthy(aircraft: str, rate_hz: float, seed: int, duration_s: str) -> tuple[float, bool, int, NDArray[np.float64]]:
    """Fly healthily; return rate, lost, channels shut off, statistics (4,)."""
    flight = healthy_flight(aircraft, rate_hz, seed, duration_s)
    tripped = sum(map(len, flight.coils_failed.values()))
    return rate_hz, not flight.verdict.survived, tripped, statistics(flight)


def healthy_flight(aircraft: str, rate_hz: float, seed: int, duration_s: str, *more: str) -> CampaignFlight:
    """Fly full-stick doublets in severe turbulence without a fault."""
    doublets = (
        f"{{kind='doublet', axis='{axis}', start_s={2.0 + i}, duration_s=2.0, amplitude=1.0}}"
        for i, axis in enumerate(STICKS)
    )
    sets = [
        f"rate_hz={rate_hz:g}",
        f"seed={seed}",
        f"duration_s={duration_s}",
        "turbulence='severe'",
        "faults=[]",
        BY_HAND,
    ]
    return flown(aircraft, *sets, f"pilot.manoeuvres=[{', '.join(doublets)}]", *more)


def statistics(flight: CampaignFlight) -> NDArray[np.float64]:
    """Return the largest difference that each monitor saw in a single frame: current, spool, position, ram."""
    assert flight.table.servo is not None
    largest = np.zeros(4)
    for i, surface in enumerate(MOVED):
        rows, actuator = flight.table.servo[:, i], getattr(flight.scenario.airframe, surface)
        largest = np.maximum(largest, _differences(rows, actuator))
    return largest


def _differences(rows: NDArray[Any], actuator: Actuator) -> NDArray[np.float64]:
    stroke, lvdt = actuator.max_rad - actuator.min_rad, rows["lvdt"]
    asked = np.clip((rows["asked"] - lvdt) / (actuator.lag_s * actuator.rate_limit_rad_s), -1.0, 1.0)
    return np.array(
        [
            np.abs(asked - rows["current"]).max(),
            np.abs(rows["spool_model"] - rows["spool"][:, None]).max(),
            (lvdt.max(axis=1) - lvdt.min(axis=1)).max() / stroke,
            np.abs(rows["ram_model"] - lvdt).max() / stroke,
        ]
    )


def _worst(rate_hz: float, found: Sequence[tuple[float, bool, int, NDArray[np.float64]]]) -> list[str]:
    largest = np.max([each[3] for each in found], axis=0)
    counts = (str(len(found)), str(sum(each[1] for each in found)), str(sum(each[2] for each in found)))
    return [f"{rate_hz:g}" if rate_hz else "all", *counts, *(f"{value:.3f}" for value in largest)]


# Faults.


class Fault(NamedTuple):
    """A fault of one channel."""

    name: str
    kind: str
    more: str = ""
    coverage: float = 1.0  # of the wire's monitor


def _single(actuator: Actuator) -> list[Fault]:
    off = LVDT_OFF * (actuator.max_rad - actuator.min_rad)
    return [
        Fault("runs away", "coil_hardover"),
        Fault("opens", "coil_open"),
        Fault("opens, wire not watched", "coil_open", coverage=0.0),
        Fault("position sensor off", "lvdt", f", offset={off:.6g}"),
    ]


def servo_single() -> None:
    """Print what one channel's fault does, beside the flight without it: who found it, the worst of three surfaces."""
    names = [fault.name for fault in _single(load(BASE).airframe.elevator)]
    table(["aircraft", *names, "survived"], map(_singles, AIRCRAFT))


def _singles(name: str) -> list[str]:
    clean = flown(name, "duration_s=20", "faults=[]")
    cells, survived = [], []
    for row in zip(*(_single(getattr(clean.scenario.airframe, surface)) for surface in MOVED), strict=True):
        found, moved = [], []
        for surface, fault in zip(MOVED, row, strict=True):
            sets = f"actuators.continuity.coverage={fault.coverage}", "duration_s=20"
            flight = flown(name, *sets, faults(on(surface, fault.kind, channels="2", more=fault.more)))
            survived.append(flight.verdict.survived)
            at_s, by = flight.coils_failed.get(surface, {}).get(2, (ONSET_S, "no monitor"))
            found.append((by, at_s - ONSET_S))
            moved.append(transient(flight, clean))
        monitors, after_s = ", ".join(sorted({by for by, _ in found})), max(after for _, after in found)
        g, rate = np.max(moved, axis=0)
        found_by = monitors if monitors == "no monitor" else f"{monitors}, {after_s:.2f} s"
        cells.append(f"{found_by}: {g:.3f} g, {rate:.2f} deg/s")
    return [name, *cells, f"{sum(survived)} of {len(survived)}"]


def transient(flight: CampaignFlight, clean: CampaignFlight, onset_s: float = ONSET_S) -> tuple[float, float]:
    """Return the largest differences in AFTER_S from the onset: of load factors, g, and of rates, deg/s."""
    first = round(onset_s * flight.scenario.rate_hz)
    part = slice(first, first + round(AFTER_S * flight.scenario.rate_hz) + 1)
    at = [INDEX[name] for name in MOVED_BY]
    one, other = (each.rows["truth"][part][:, at] for each in (flight, clean))
    off = np.abs(one - other[: len(one)]).max(axis=0)
    return float(off[:2].max()), float(np.degrees(off[2:].max()))


def servo_several() -> None:
    """Print flights of a surface with several faults, or one of what its channels share, and without a pressure."""
    heads = ["two run away", "unwatched", "three", "unwatched", "spool jams", "bypass", "valve stuck", "both pressures"]
    table(["aircraft", "surface", *heads], (_several(*case) for case in product(AIRCRAFT, MOVED)))


def _several(name: str, surface: str) -> list[str]:
    in_a_row = [on(surface, "coil_hardover", ONSET_S + 3.0 * c, str(c + 1)) for c in range(3)]
    runs = [
        _became(flown(name, "duration_s=60", f"actuators.monitors={watched}", faults(*in_a_row[:channels])))
        for channels, watched in product((2, 3), ("true", "false"))
    ]
    shared = (
        [on(surface, "spool_jam")],
        [on(surface, "leak", more=", share=1.0")],
        [on(surface, "coil_hardover", channels="2"), on(surface, "sov_stuck", 1.0, "2")],
        [f"kind='hydraulic_loss', signal='hydraulics.{n}', start_s={ONSET_S}" for n in (1, 2)],
    )
    return [name, surface, *runs, *(_in_level_flight_and_by_hand(name, given) for given in shared)]


def _in_level_flight_and_by_hand(name: str, given: Sequence[str]) -> str:
    doublets = (
        f"{{kind='doublet', axis='{axis}', start_s=4.0, duration_s=3.0, amplitude=0.4}}"
        for axis in ("stick_pitch", "stick_roll")
    )
    by_hand = BY_HAND, f"pilot.manoeuvres=[{', '.join(doublets)}]"
    told = [_became(flown(name, "duration_s=60", faults(*given), *sets)) for sets in ((), by_hand)]
    return f"{told[0]}, {told[1]}"


def _became(flight: CampaignFlight) -> str:
    """Return whether a flight survived, else how long after its first fault it was lost."""
    lost_s = flight.verdict.frames / flight.scenario.rate_hz - ONSET_S
    return "flies" if flight.verdict.survived else f"lost {lost_s:.1f} s"


# Cost.


def servo_cost(pairs: str = "15", duration_s: str = "30") -> None:
    """Print what a frame with servos costs beside one without, the same flight in turn, and the bytes of its log."""
    sets = ["faults=[]", f"duration_s={duration_s}"]
    scenarios = [load(BASE, [*sets, f"actuators.model='{model}'"]) for model in ("lag", "servo")]
    costs("lag", "servo", scenarios, int(pairs))


def costs(one: str, other: str, scenarios: Sequence[Scenario], pairs: int) -> None:
    """Print what a frame of the second scenario costs beside the first, the same flights in turn."""
    with TemporaryDirectory() as folder:
        sizes = [_logged(each, Path(folder))[1] for each in scenarios]  # and compile
        logged = [[_logged(each, Path(folder))[0] for each in scenarios] for _ in range(pairs)]
    bare = [[_bare(each) for each in scenarios] for _ in range(pairs)]
    rows = [["CPU us a frame, no log", *_ratio(bare)], ["CPU us a frame, log", *_ratio(logged)]]
    size = ["bytes a frame", *(f"{each:.0f}" for each in sizes), f"{sizes[1] / sizes[0]:.3f}", "", ""]
    table(["", one, other, f"{other} over {one}", "lowest", "highest"], [*rows, size])


def _ratio(costs: Sequence[Sequence[float]]) -> list[str]:
    ratios = [more / less for less, more in costs]
    middles = (f"{median(column):.1f}" for column in zip(*costs, strict=True))
    return [*middles, *(f"{value:.3f}" for value in (median(ratios), min(ratios), max(ratios)))]


def _logged(scenario: Scenario, folder: Path) -> tuple[float, float]:
    """Fly with a log, preparations included; return microseconds of the processor and bytes a frame."""
    began = process_time()
    flight = fly_logged(scenario, out=folder)
    used_s, size = process_time() - began, flight.log.stat().st_size
    flight.log.unlink()
    return used_s / flight.frames * 1e6, size / flight.frames


def _bare(scenario: Scenario) -> float:
    """Fly without any recorder; return microseconds of the processor a frame."""
    rig, memory = loop.Rig(scenario), loop.new_memory(scenario)
    began = process_time()
    loop.fly(rig, memory=memory)
    return (process_time() - began) / scenario.frames * 1e6
