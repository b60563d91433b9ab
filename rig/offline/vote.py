"""The flight's manager over the rows of a recording, one signal after the other.

The rows are frames of the flight (rig.frame.FLAT) with one signal in them, so the very kernels of flight run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.angles import difference
from rig.computer.redundancy.config import MANAGERS, PARAMS, fill
from rig.computer.redundancy.managers import Manager, vote_signals
from rig.computer.redundancy.own import load_manager
from rig.frame import Block, Ilm, Resolver, State, nested, new_block
from rig.kernels import kernel
from rig.offline.clock import Floats
from rig.offline.recording import Bytes, Recording, Samples
from rig.offline.vote_settings import RecordedSignal, Reset, commands
from rig.trust import Trust

ROWS: Final = 256  # of a block: half a megabyte, which stays in the cache
FIELDS: Final = ("voted", "level", "pattern", "resolver", "trend_high", "trend_low", "reference_usable")
_NO_CODE: Final = Trust("the configuration")


class Failure(NamedTuple):
    """A channel that was failed: in which row, counted from 1, and by whom."""

    channel: int
    frame: int
    time_s: float
    why: str  # comparison, or a resolver


@dataclass(frozen=True, slots=True)
class Voted:
    """What the manager said of one signal; every array (n,), ``state`` one for each channel."""

    settings: RecordedSignal
    voted: Floats
    level: Bytes
    pattern: Bytes
    resolver: Bytes
    trend_high: Bytes
    trend_low: Bytes
    reference_usable: Bytes
    state: list[Bytes]
    spread: Floats  # largest less smallest of the samples in use, NaN where there are none
    invalid: list[int]  # samples of each channel that were no number, flagged, or out of range
    failures: list[Failure]


def vote(
    recording: Recording, settings: dict[str, RecordedSignal], resets: list[Reset], trust: Trust = _NO_CODE
) -> dict[str, Voted]:
    """Vote the signals that have settings; BadInput: a manager class that ``trust`` does not permit."""
    for chosen in settings.values():
        trust.require(chosen.manager)
    return {
        name: _vote_signal(recording, recording.signals[name], chosen, commands(resets, name, recording.time_s), trust)
        for name, chosen in settings.items()
    }


def _vote_signal(
    recording: Recording, samples: Samples, settings: RecordedSignal, resets: Bytes, trust: Trust
) -> Voted:
    n, fitted = len(recording.time_s), len(samples.channels)
    params = np.zeros(1, PARAMS)
    fill(params[0], settings, settings.limits, fitted, settings.wraps, recording.rate_hz)
    run = _manager(settings.manager, params, trust)
    out: dict[str, Any] = {name: np.empty(n, np.float64 if name == "voted" else np.uint8) for name in FIELDS}
    states = [np.empty(n, np.uint8) for _ in samples.channels]
    spread = np.empty(n)
    block = _first_block(samples)
    for start in range(0, n, ROWS):
        part = slice(start, min(start + ROWS, n))
        rows = block[: part.stop - start]
        _put(rows, samples, part)
        rows["reset"][:, 0] = resets[part]
        run(rows)
        spreads(rows, params[0], spread[part])
        for name, column in out.items():
            column[part] = rows[name][:, 0]
        for c, column in enumerate(states):
            column[part] = rows["state"][:, 0, c]
    wrong = [~_usable(samples, settings, c) for c in range(fitted)]
    failures, invalid = _failures(recording, out, states, wrong), [int(w.sum()) for w in wrong]
    return Voted(settings, **out, state=states, spread=spread, invalid=invalid, failures=failures)


def _first_block(samples: Samples) -> NDArray[Any]:
    block = new_block(ROWS)
    block["channels"] = block["reference"] = block["second_reference"] = np.nan
    block["valid"] = 1
    block["ilm"] = Ilm.ABSENT
    return block


def _put(rows: NDArray[Any], samples: Samples, part: slice) -> None:
    rows["frame"] = np.arange(part.start, part.stop)
    for c, column in enumerate(samples.channels):
        rows["channels"][:, 0, c] = column[part]
    for c, flags in enumerate(samples.ilm or ()):
        rows["ilm"][:, 0, c] = flags[part]
    for c, flags in enumerate(samples.valid or ()):
        rows["valid"][:, 0, c] = flags[part]
    if samples.reference is not None:
        rows["reference"][:, 0] = samples.reference[part]


def _manager(name: str, params: NDArray[np.void], trust: Trust) -> Callable[[Block], None]:
    """What votes all rows of a block: a manager of the house, or the user's own ``module:name``."""
    if name in MANAGERS:
        data = Manager(name, params).data
        return lambda rows: vote_rows(nested(rows), data)
    own = load_manager(name, params, trust)

    def step_by_step(rows: Block) -> None:
        bus, fcc = (nested(rows)[part] for part in ("bus", "fcc"))
        for k in range(len(rows)):
            own.step(rows, bus, fcc, k)

    return step_by_step


@kernel
def vote_rows(rows, data):
    """All rows through the chosen manager; see managers.vote_signals."""
    for k in range(len(rows)):
        vote_signals(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def spreads(rows, p, out):
    """Largest less smallest sample of the channels in use of signal 0, each as seen from the vote.

    A sample that is not valid or out of range is not in use; NaN when none is.
    p : one config.PARAMS record; out : (rows,)
    """
    for k in range(len(rows)):
        row = rows[k]
        low, high = np.inf, -np.inf
        for c in range(p["fitted"]):
            sample = row["channels"][0, c]
            if row["state"][0, c] != State.FAILED and row["valid"][0, c] != 0 and p["low"] <= sample <= p["high"]:
                off = difference(sample, row["voted"][0], p["wraps"])
                low, high = min(low, off), max(high, off)
        out[k] = high - low if high >= low else np.nan


def _usable(samples: Samples, settings: RecordedSignal, c: int) -> NDArray[np.bool_]:
    low, high = settings.limits
    column = samples.channels[c]
    usable = (column >= low) & (column <= high)
    return usable if samples.valid is None else usable & (samples.valid[c] != 0)


def _failures(
    recording: Recording, out: dict[str, Any], states: list[Bytes], invalid: list[NDArray[np.bool_]]
) -> list[Failure]:
    """Every change to failed: by the resolver of its row if the sample is valid and one decided, else by comparison."""
    found: list[Failure] = []
    for c, state in enumerate(states):
        failed = state == State.FAILED
        for k in np.flatnonzero(failed & ~np.concatenate([[False], failed[:-1]])):
            resolver = Resolver(out["resolver"][k])
            resolved = resolver not in (Resolver.NONE, Resolver.UNRESOLVED) and not invalid[c][k]
            why = resolver.name.lower() if resolved else "comparison"
            found.append(Failure(c + 1, recording.row(int(k)), float(recording.time_s[k]), why))
    return sorted(found, key=lambda failure: (failure.frame, failure.channel))
