"""How the flight went, alone and against its fault-free twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.record import Deviation, FaultScore, FlightScore, Transient, Transients, Yardstick
from rig.assess.votes import deviation
from rig.errors import BadInput
from rig.frame import INDEX, Block, End
from rig.scenario import Scenario

if TYPE_CHECKING:
    from rig.unit.unit import UnitUnderTest

_COMPARED: Final = [INDEX[name] for name in ("normal_load_factor", "pitch_rate", "pitch_angle", "roll_angle")]


def fly_twin(scenario: Scenario, frames: int | None = None, unit: UnitUnderTest | None = None) -> Block:
    """The same scenario and seed without its faults: its rows, no more than ``frames``.

    unit : under test, that flew the scenario too
    """
    from rig.flight.unit_loop import fly_rows  # a score without a twin needs no simulation

    return fly_rows(scenario.model_copy(update={"faults": []}), frames, unit)


def flight_score(
    scenario: Scenario,
    rows: Block,
    twin: Block | None,
    faults: Sequence[FaultScore],
    first_acted: int | None,
    yardstick: Yardstick,
) -> FlightScore:
    """The flight, its peaks, and its transients when there is a twin; BadInput when that is none of this flight.

    first_acted : first frame in which any fault acted, None when none did
    """
    end = End(int(rows["end"][-1]))
    names = ("normal_load_factor", "pitch_rate", "pitch_angle", "roll_angle", "angle_of_attack")
    low, high = (dict(zip(names, bound, strict=True)) for bound in _bounds(rows, [INDEX[name] for name in names]))
    return FlightScore(
        survived=end == End.FLYING,
        end_reason=_reason(end, len(rows), scenario),
        frames=len(rows),
        duration_s=len(rows) / scenario.rate_hz,
        load_factor_min=low["normal_load_factor"],
        load_factor_max=high["normal_load_factor"],
        pitch_rate_max_rad_s=max(-low["pitch_rate"], high["pitch_rate"]),
        pitch_angle_min_rad=low["pitch_angle"],
        pitch_angle_max_rad=high["pitch_angle"],
        roll_angle_max_rad=max(-low["roll_angle"], high["roll_angle"]),
        angle_of_attack_min_rad=low["angle_of_attack"],
        angle_of_attack_max_rad=high["angle_of_attack"],
        transients=None if twin is None else _transients(rows, twin, faults, first_acted, yardstick, scenario.rate_hz),
    )


def with_load_factor(faults: Sequence[FaultScore], rows: Block, window_s: float, rate_hz: float) -> list[FaultScore]:
    """``faults`` with what the load factor did after each onset, for ``window_s`` or until the flight ended."""
    load_factor = rows["truth"][:, INDEX["normal_load_factor"]]
    out = []
    for fault in faults:
        if fault.onset_frame is None:
            out.append(fault)
            continue
        part = _window(fault.onset_frame, round(window_s * rate_hz), len(rows))
        off = np.abs(load_factor[part] - load_factor[max(fault.onset_frame - 1, 0)])
        change = float(np.nanmax(off)) if np.isfinite(off).any() else None
        looked_at_s = (part.stop - 1 - part.start) / rate_hz
        out.append(replace(fault, load_factor_change=change, load_factor_change_s=looked_at_s))
    return out


def _window(onset: int, frames: int, flown: int) -> slice:
    """The frames in which a transient is looked for: from the onset to ``frames`` after it, of those ``flown``."""
    return slice(onset, min(onset + frames + 1, flown))


def _reason(end: End, frames: int, scenario: Scenario) -> str:
    if end != End.FLYING:
        return end.label
    return "duration flown" if frames >= scenario.frames else "interrupted"


def _bounds(rows: Block, columns: list[int]) -> tuple[list[float], list[float]]:
    """Lowest and highest finite truth of each column; 0 when there is none."""
    truth = rows["truth"][:, columns]
    finite = np.isfinite(truth)
    low = np.where(finite, truth, np.inf).min(axis=0)
    high = np.where(finite, truth, -np.inf).max(axis=0)
    some = finite.any(axis=0)
    return np.where(some, low, 0.0).tolist(), np.where(some, high, 0.0).tolist()


def _transients(
    rows: Block,
    twin: Block,
    faults: Sequence[FaultScore],
    first_acted: int | None,
    yardstick: Yardstick,
    rate_hz: float,
) -> Transients:
    n = min(len(rows), len(twin))
    truth, other = np.ascontiguousarray(rows["truth"][:n]), np.ascontiguousarray(twin["truth"][:n])
    differs = np.flatnonzero((truth != other).any(axis=1))
    if len(differs) and (first_acted is None or differs[0] <= first_acted):
        raise BadInput(
            f"the fault-free twin leaves the flight in frame {differs[0]}, before any fault can have moved the "
            "aircraft: other versions flew it; without the twin (--no-twin) it can be scored"
        )
    off = deviation(truth, other)[:, _COMPARED]
    limits = np.array([yardstick.load_factor, yardstick.pitch_rate_rad_s])
    beyond = np.any(~(off[:, :2] <= limits), axis=1)
    window = round(yardstick.window_s * rate_hz)
    lost = rows["end"][-1] != End.FLYING
    windows = []
    for onset, ids in _onsets(faults).items():
        part = _window(onset, window, n)
        ended = lost and len(rows) <= onset + window + 1
        within = not np.any(beyond[part]) and not ended
        windows.append(Transient(ids, onset, max(part.stop - onset, 0), _peaks(off[part]), bool(within)))
    return Transients(
        limits=yardstick.model_dump(),
        windows=tuple(windows),
        overall=_peaks(off),
        out_of_limits_s=float(beyond.sum() / rate_hz),
        within_limits=all(window.within_limits for window in windows),
        first_difference_frame=int(differs[0]) if len(differs) else None,
    )


def _onsets(faults: Sequence[FaultScore]) -> dict[int, tuple[str, ...]]:
    """The executed faults by the frame of their onset, in order of time."""
    found: dict[int, list[str]] = {}
    for fault in faults:
        if fault.onset_frame is not None and fault.outcome != "not executed":
            found.setdefault(fault.onset_frame, []).append(fault.id)
    return {onset: tuple(dict.fromkeys(found[onset])) for onset in sorted(found)}


def _peaks(off: NDArray[np.float64]) -> Deviation:
    """Largest finite differences; 0 when there are none."""
    finite = np.where(np.isfinite(off), off, 0.0)
    return Deviation(*(finite.max(axis=0) if len(finite) else np.zeros(len(_COMPARED))).tolist())
