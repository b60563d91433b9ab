"""The monitored channels of a flight against the truth: those of the signals, those of the discretes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.isolations import COMPARISON, Bools, Failures, Rules, decided_by
from rig.assess.places import on_channels, references_of
from rig.computer.redundancy import Config
from rig.faults import Fault
from rig.frame import CHANNELS, DISCRETES, SIGNALS, Block, Ilm, State

_HALF: Final = 0.5  # an error of a discrete is 0 or 1


class Monitored(NamedTuple):
    """Channels of m signals: (n, m, 4) states, injected errors (NaN: a lost sample), acting faults; (m,) settings."""

    names: Sequence[str]
    state: NDArray[np.uint8]
    error: NDArray[np.float64]
    acted: Bools
    threshold: NDArray[np.float64]
    persistence: NDArray[np.int64]
    failures: Failures


def of_signals(
    rows: Block,
    error: NDArray[np.float64],
    acting: Bools,
    faults: Sequence[Fault],
    params: NDArray[np.void],
    config: Config,
) -> Monitored:
    """The continuous signals; ``params`` (S,) config.PARAMS; config : of the flight's redundancy."""
    linger = lingers(params)
    names, acted = [signal.name for signal in SIGNALS], corrupting(acting, faults, len(SIGNALS), discrete=False)
    outlier = params["outlier_threshold"]  # of a single channel of four; a vote is off by more than the threshold
    smallest = np.where(outlier > 0.0, outlier, params["threshold"])
    rules = Rules(config.box_signals, on_references(acting, faults, config))
    failures = Failures(names, rows["state"], error, acted, linger, lambda k, s, c: decided_by(rows, k, s, c), rules)
    return Monitored(names, rows["state"], error, acted, smallest, params["persistence"], failures)


def lingers(params: NDArray[np.void]) -> NDArray[np.int64]:
    """(S,) frames for which a fault that has ceased can be the cause of a failure: the longer of the persistences."""
    return np.maximum(params["persistence"], params["singular_persistence"])


def of_discretes(rows: Block, acting: Bools, faults: Sequence[Fault], params: NDArray[np.void]) -> Monitored:
    """The discretes; ``params`` (D,) discrete_config.DISCRETE_PARAMS.

    A switch without a fault is where the truth is.  A sample is lost when it is flagged, or its own monitor says bad.
    """
    state, truth = rows["discrete_state"], rows["discrete_truth"][:, :, None]
    error = (rows["discrete_channels"] != truth).astype(np.float64)
    error[(rows["discrete_valid"] == 0) | (rows["discrete_ilm"] == Ilm.BAD)] = np.nan
    error[state == State.ABSENT] = 0.0
    names, acted = [discrete.name for discrete in DISCRETES], corrupting(acting, faults, len(DISCRETES), discrete=True)
    failures = Failures(names, state, error, acted, params["persistence"], lambda k, s, c: COMPARISON)
    return Monitored(names, state, error, acted, np.full(len(names), _HALF), params["persistence"], failures)


def corrupting(acting: Bools, faults: Sequence[Fault], signals: int, discrete: bool) -> Bools:
    """(n, signals, 4) whether a fault that changes samples acted on each channel of the signals or the discretes.

    acting : (n, faults) whether each fault acted
    """
    out = np.zeros((len(acting), signals, CHANNELS), bool)
    for place in on_channels(faults):
        if place.changes and place.discrete == discrete:
            out[:, place.signal, place.channel] |= acting[:, place.number]
    return out


def on_references(acting: Bools, faults: Sequence[Fault], config: Config) -> Bools:
    """(n, S) whether a fault acted on one of the two references of each signal; acting : (n, faults)."""
    out = np.zeros((len(acting), len(SIGNALS)), bool)
    for number, fault in enumerate(faults):
        out[:, references_of(fault, config, second_too=True)] |= acting[:, number, None]
    return out


def wrong_votes_s(rows: Block, rate_hz: float) -> dict[str, float]:
    """Time in which the vote of each discrete was not the truth."""
    wrong = (rows["discrete_voted"] != rows["discrete_truth"]).sum(axis=0)
    return {discrete.name: int(count) / rate_hz for discrete, count in zip(DISCRETES, wrong, strict=True)}
