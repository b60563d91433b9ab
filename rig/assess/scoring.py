"""The score of one flight: every part of it, from the rows that were flown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig import sensors
from rig.assess.coverage import coverage
from rig.assess.episodes import by_pattern, episodes, tally
from rig.assess.flown import flight_score, with_load_factor
from rig.assess.monitored import of_discretes, of_signals, wrong_votes_s
from rig.assess.outcomes import acts, outcomes
from rig.assess.record import ISOLATIONS, Score, Yardstick
from rig.assess.signal_totals import signal_scores
from rig.assess.unfaulted import checked, of_flight, recompute
from rig.assess.votes import vote_errors
from rig.assess.windows import with_windows
from rig.computer.redundancy import measured_thresholds
from rig.computer.redundancy.config import parameters
from rig.computer.redundancy.discrete_config import discrete_parameters
from rig.computer.redundancy.managers import manager_kind
from rig.frame import Block
from rig.scenario import Scenario

_YARDSTICK = Yardstick()


def score(
    scenario: Scenario,
    rows: Block,
    twin: Block | None = None,
    yardstick: Yardstick = _YARDSTICK,
    clean: NDArray[np.void] | None = None,
) -> Score:
    """Score a flight of ``scenario`` against the truth in its ``rows`` (n,) of FRAME, from frame 0 on.

    twin : rows of the same flight without faults (``fly_twin``); without it there are no transients
    clean : (n,) what ``Faults.clean`` kept in flight; without it the sensors are run again over the recorded truth
    BadInput when these sensors cannot have given the rows, or the twin is that of another flight.
    """
    rows = checked(rows)
    params = monitor(scenario)
    error, vote = recompute(scenario, rows, params) if clean is None else of_flight(rows, clean, params)
    acting = acts(rows, len(scenario.faults))
    signals = of_signals(rows, error, acting, scenario.faults, params, scenario.redundancy)
    discretes = of_discretes(rows, acting, scenario.faults, discrete_monitor(scenario))
    faults = outcomes(scenario, rows, acting, params, signals, discretes)
    faults = with_windows(faults, rows, signals, params, scenario.rate_hz)
    faults = with_load_factor(faults, rows, yardstick.window_s, scenario.rate_hz)
    found = episodes(rows, params, signals.failures.all)
    healthy = {kind: signals.failures.of_kind(kind) + discretes.failures.of_kind(kind) for kind in ISOLATIONS}
    any_acted = np.flatnonzero(acting.any(axis=1))
    onset = int(any_acted[0]) if len(any_acted) else None
    return Score(
        faults=faults,
        false_alarms=healthy["false alarm"],
        wrong_isolations=healthy["wrong isolation"],
        failed_with_box=healthy["failed with its box"],
        failed_by_rule=healthy["failed by rule"],
        episodes=found,
        resolvers=tally(found),
        resolvers_by_pattern=by_pattern(found),
        unresolved=sum(episode.resolver == "unresolved" for episode in found),
        vote_error=vote_errors(rows, vote, params, onset, scenario.rate_hz),
        signals=signal_scores(rows, signals, faults, params, scenario.rate_hz),
        flight=flight_score(scenario, rows, twin, faults, onset, yardstick),
        coverage=coverage(rows, params["fitted"]),
        wrong_votes_s=wrong_votes_s(rows, scenario.rate_hz),
    )


def monitor(scenario: Scenario) -> NDArray[np.void]:
    """The (S,) config.PARAMS records of the flight's manager."""
    suite, config = scenario.sensors, scenario.redundancy
    params = parameters(config.signals, sensors.ranges(suite), sensors.channels(suite), scenario.rate_hz)
    measured_thresholds(params, config, scenario.references)
    kind = manager_kind(config.manager)
    if kind.kernel is not None and not kind.compares:
        params["outlier_threshold"] = params["outlier_threshold_triplex"] = 0.0  # they do not ask for it
    return params


def discrete_monitor(scenario: Scenario) -> NDArray[np.void]:
    """The (D,) discrete_config.DISCRETE_PARAMS records of the flight's voter of the discretes."""
    fitted, config = sensors.discrete_channels(scenario.sensors), scenario.redundancy
    return discrete_parameters(config.discretes, fitted, config.discrete_persistence, scenario.rate_hz)
