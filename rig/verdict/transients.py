"""How the flight went, alone and against its fault-free baseline."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from rig.core.ending import WHOLE
from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, Block, End
from rig.core.units.angles import differences
from rig.scenario.scenario import Scenario
from rig.verdict.score_records import Deviation, FaultScore, FlightScore, Transient, Transients, Yardstick
from rig.verdict.signal_kernels import NEVER
from rig.verdict.tally_records import EXTREMES

if TYPE_CHECKING:
    from rig.unit.running_unit import UnitUnderTest

WRAPS: Final = np.array([signal.wraps for signal in SIGNALS])
_COMPARED: Final = [INDEX[name] for name in ("normal_load_factor", "pitch_rate", "pitch_angle", "roll_angle")]


def fly_baseline(scenario: Scenario, frames: int | None = None, unit: UnitUnderTest | None = None) -> Block:
    """Return the same scenario and seed without its faults: its rows, no more than ``frames``.

    unit : under test, that flew the scenario too
    """
    from rig.flight.unit_loop import fly_rows  # a score without a baseline needs no simulation

    return fly_rows(scenario.model_copy(update={"faults": []}), frames, unit)


def baseline_blocks(scenario: Scenario, frames: int, unit: UnitUnderTest | None = None) -> Iterator[Block]:
    """Fly the baseline as ``fly_baseline`` does, and yield its rows in blocks of core.blocks.ROWS."""
    from rig.flight.unit_loop import fly_blocks

    return (table.rows for table in fly_blocks(scenario.model_copy(update={"faults": []}), frames, unit))


def flight_score(scenario: Scenario, flight: np.void, measured: Transients | None) -> FlightScore:
    """Return the flight and its peaks; flight : FLIGHT; an extreme is 0 where there was no number."""
    end, frames = End(flight["end"]), int(flight["frames"])
    low, high = (np.where(np.isfinite(flight[bound]), flight[bound], 0.0).tolist() for bound in ("low", "high"))
    load_factor, pitch_rate, pitch_angle, roll_angle, angle_of_attack = range(len(EXTREMES))
    return FlightScore(
        survived=end == End.FLYING,
        end_reason=_reason(end, frames, scenario),
        frames=frames,
        duration_s=frames / scenario.rate_hz,
        load_factor_min=low[load_factor],
        load_factor_max=high[load_factor],
        pitch_rate_max_rad_s=max(-low[pitch_rate], high[pitch_rate]),
        pitch_angle_min_rad=low[pitch_angle],
        pitch_angle_max_rad=high[pitch_angle],
        roll_angle_max_rad=max(-low[roll_angle], high[roll_angle]),
        angle_of_attack_min_rad=low[angle_of_attack],
        angle_of_attack_max_rad=high[angle_of_attack],
        transients=measured,
    )


def _reason(end: End, frames: int, scenario: Scenario) -> str:
    if end != End.FLYING:
        return end.label
    return WHOLE if frames >= scenario.frames else "interrupted"


class Apart(NamedTuple):
    """How far frames of a flight are from those of its baseline."""

    frames: int
    lost: bool  # the flight, in the last of them
    first_difference: int | None  # of the truth, counted from the first of them
    off: NDArray[np.float64]  # (n, 4) of the frames that both have, _COMPARED


def apart_from(rows: Block, baseline: Block | None) -> Apart:
    """Compare ``rows`` (n,) with those of the baseline, which has fewer where it has ended, or none."""
    lost = bool(len(rows)) and bool(rows["end"][-1] != End.FLYING)
    if baseline is None:
        return Apart(len(rows), lost, None, np.empty((0, len(_COMPARED))))
    n = min(len(rows), len(baseline))
    truth, other = np.ascontiguousarray(rows["truth"][:n]), np.ascontiguousarray(baseline["truth"][:n])
    differs = np.flatnonzero((truth != other).any(axis=1))
    off = np.abs(differences(truth, other, WRAPS))[:, _COMPARED]
    return Apart(len(rows), lost, int(differs[0]) if len(differs) else None, off)


class Deviations(NamedTuple):
    """How far a whole flight is from its baseline."""

    yardstick: Yardstick
    frames: int
    lost: bool
    first_difference: int | None
    off: NDArray[np.float64]  # (n, 4)

    @classmethod
    def of(cls, parts: Sequence[Apart], yardstick: Yardstick) -> Self:
        """Return what the parts of a flight, in their order, come to."""
        begins = np.cumsum([0, *(part.frames for part in parts)]).tolist()
        firsts = (
            begin + part.first_difference
            for begin, part in zip(begins[:-1], parts, strict=True)
            if part.first_difference is not None
        )
        off = np.concatenate([np.empty((0, len(_COMPARED))), *(part.off for part in parts)])
        lost = next((part.lost for part in reversed(parts) if part.frames), False)
        return cls(yardstick, begins[-1], lost, next(firsts, None), off)


def transients(deviations: Deviations, faults: Sequence[FaultScore], acted_from: int, rate_hz: float) -> Transients:
    """Return how far a flight was from its baseline; BadInput when that is none of this flight.

    acted_from : first frame in which any fault acted, or NEVER
    """
    first, off, yardstick = deviations.first_difference, deviations.off, deviations.yardstick
    if first is not None and (acted_from == NEVER or first <= acted_from):
        raise BadInput(
            f"the fault-free baseline differs from the flight in frame {first}, before a fault can have moved the "
            "aircraft: another version flew it; score it with --no-baseline"
        )
    limits = np.array([yardstick.load_factor, yardstick.pitch_rate_rad_s])
    beyond = np.any(~(off[:, :2] <= limits), axis=1)
    window = round(yardstick.window_s * rate_hz)
    windows = []
    for onset, ids in _onsets(faults).items():
        part = slice(onset, min(onset + window + 1, len(off)))
        ended = deviations.lost and deviations.frames <= onset + window + 1
        within = not np.any(beyond[part]) and not ended
        windows.append(Transient(ids, onset, max(part.stop - onset, 0), _peaks(off[part]), bool(within)))
    return Transients(
        limits=yardstick.model_dump(),
        windows=tuple(windows),
        overall=_peaks(off),
        out_of_limits_s=float(beyond.sum() / rate_hz),
        within_limits=all(window.within_limits for window in windows),
        first_difference_frame=first,
    )


def _onsets(faults: Sequence[FaultScore]) -> dict[int, tuple[str, ...]]:
    """Return the executed faults by the frame of their onset, in order of time."""
    ids: dict[int, list[str]] = {}
    for fault in faults:
        if fault.onset_frame is not None and fault.outcome != "not executed":
            ids.setdefault(fault.onset_frame, []).append(fault.id)
    return {onset: tuple(dict.fromkeys(ids[onset])) for onset in sorted(ids)}


def _peaks(off: NDArray[np.float64]) -> Deviation:
    """Return largest finite differences; 0 when there are none."""
    finite = np.where(np.isfinite(off), off, 0.0)
    return Deviation(*(finite.max(axis=0) if len(finite) else np.zeros(len(_COMPARED))).tolist())
