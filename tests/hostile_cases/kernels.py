"""Kind ``kernel``: random samples through all five managers.

While a valid sample in range exists the vote is finite and within the range of such samples.  Three exceptions are
the manager's own rules: no rule settles a split (the last vote is held, moved by the ranks), a
fade, and a last channel against which its monitor or the reference speaks (the reference votes, else the last vote).
"""

from __future__ import annotations

import sys
from random import Random
from typing import Any, Final

import numpy as np

from hostile_cases.case import Case, Draw
from hostile_cases.store import Store

_ODD: Final = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1.7e308, 1e16, 1e17, -1e17, 5e-324, 0.0, -0.0, 1e5, 2.0**53]
_SEQUENCES, _FRAMES, _BROKEN = 20, 40, 99
_SLACK: Final = 1e-9
_TURN: Final = 2 * np.pi


def kernel(draw: Draw, store: Store) -> Case:
    """Some sequences of one manager and one kind of signal."""
    from rig.computer.redundancy import MANAGERS

    manager, wraps = draw.turn([(m, w) for m in MANAGERS for w in (False, True)])
    seed = draw.rng.random()
    about = f"{manager}, {'an angle' if wraps else 'no angle'}"
    return Case("kernel", draw.number, (), about, call=lambda: _check(manager, wraps, Random(seed)), seed=draw.seed)


def _check(manager: str, wraps: bool, rng: Random) -> int:
    for _ in range(_SEQUENCES):
        said = _sequence(manager, wraps, rng)
        if said:
            print(said, file=sys.stderr)
            return _BROKEN
    return 0


def _sequence(manager: str, wraps: bool, rng: Random) -> str:
    """What broke in one sequence of random samples, or nothing."""
    from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
    from rig.computer.redundancy.managers import Manager, vote_signals
    from rig.core.frame import nested, new_block

    fitted, fade_s = rng.choice([2, 3, 4, 4]), rng.choice([0.0, 0.0, 0.05])
    limits = (
        (-np.pi, np.pi) if wraps else rng.choice([(-1.5, 1.5), (-1e3, 1e3), (-sys.float_info.max, sys.float_info.max)])
    )
    settings: dict[str, Any] = {
        "threshold": rng.choice([0.02, 1.0, 1e-9]),
        "persistence": rng.choice([1, 3, 8]),
        "split_persistence": rng.choice([1, 10]),
        "mean": rng.choice(["plain", "trend-weighted"]),
        "fade_s": fade_s,
    }
    params = np.zeros(1, PARAMS)
    fill(params[0], SignalConfig(**settings), limits, fitted, wraps, 100.0)
    block = new_block(_FRAMES)
    block["channels"][:, 0], block["valid"][:, 0] = _samples(rng, wraps), 1
    block["ilm"][:, 0] = rng.choice([0, 1, 2])
    block["reference"][:, 0] = rng.choice([np.nan, 0.5, np.inf, 1e300])
    for _ in range(rng.choice([0, 5])):
        block["valid"][rng.randrange(_FRAMES), 0, rng.randrange(4)] = 0
    stage = Manager(manager, params)
    for row in nested(block):
        vote_signals(row["bus"], row["fcc"], stage.data)
    return _broken(block, manager, limits, fitted, wraps, fade_s, settings)


def _samples(rng: Random, wraps: bool) -> Any:
    """(frames, 4): channels near each other, some samples odd, perhaps a channel that walks off."""
    base = np.cumsum([rng.gauss(0, 0.05) for _ in range(_FRAMES)])
    x = base[:, None] + np.array([[rng.gauss(0, 0.005) for _ in range(4)] for _ in range(_FRAMES)])
    if rng.random() < 0.5:
        x[rng.randrange(_FRAMES) :, rng.randrange(4)] += rng.choice([0.5, -2.0, 100.0, 1e300])
    for _ in range(rng.choice([1, 3, 30])):
        row = rng.choice([0, 0, rng.randrange(_FRAMES)])
        x[row : row + rng.choice([1, 1, 10]), rng.randrange(4)] = rng.choice(_ODD)
    if not wraps or rng.random() < 0.7:
        return x
    with np.errstate(invalid="ignore"):
        return (x + np.pi) % (2 * np.pi) - np.pi


def _broken(
    block: Any, manager: str, limits: tuple[float, float], fitted: int, wraps: bool, fade_s: float, settings: Any
) -> str:
    """The first frame in which the property does not hold."""
    from rig.core.frame import DecidedBy, State

    samples, valid = block["channels"][:, 0, :fitted], block["valid"][:, 0, :fitted] != 0
    states, voted = block["state"][:, 0, :fitted], block["voted"][:, 0]
    counts = valid & (samples >= limits[0]) & (samples <= limits[1])
    before: float | None = None
    for k in range(_FRAMES):
        failed = states[k] == State.FAILED if manager == "selection" or k == 0 else states[k - 1] == State.FAILED
        usable = counts[k] & ~failed if k or manager == "selection" else counts[k]
        where = f"{manager}, {settings}, range {limits}, frame {k}: vote {voted[k]!r} of {samples[k].tolist()}"
        if (before is not None or counts[k].any()) and not np.isfinite(voted[k]):
            return f"not finite: {where}"
        decided_by = block["decided_by"][k, 0]
        accused = usable.sum() == 1 and decided_by in (DecidedBy.ILM, DecidedBy.REFERENCE)
        held = accused or decided_by == DecidedBy.UNRESOLVED or fade_s > 0 or not usable.any()
        if not held and not _within(float(voted[k]), samples[k][usable], wraps, before):
            return f"outside of the good samples: {where}"
        before = float(voted[k]) if before is not None or counts[k].any() else None
    return ""


def _within(vote: float, good: Any, wraps: bool, before: float | None) -> bool:
    """Whether a vote is in the range of samples; angles are taken near the vote before, or near any of the first."""
    if not wraps:
        slack = _SLACK * max(1.0, float(np.abs(good).max()))
        return bool(good.min() - slack <= vote <= good.max() + slack)
    for base in good if before is None else [before]:
        near = base + (good - base + np.pi) % _TURN - np.pi
        for turned in (vote - _TURN, vote, vote + _TURN):
            if near.min() - _SLACK <= turned <= near.max() + _SLACK:
                return True
    return False
