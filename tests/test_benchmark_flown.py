"""Bursts, the level that three flights exceed, counts of a second campaign."""

from typing import Any

import numpy as np
import pytest
from benchmark_flights import white, white_signal

from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.studies.benchmark import healthy_flights
from rig.studies.benchmark.entrants import Entrant, OfSignal
from rig.studies.benchmark.healthy_flights import counted, exceeded, isolations, transients

VOTER = Entrant("cross-voter", "cross-voter")


def bursts(name: str, signal: OfSignal, values: dict[str, float]) -> list[dict[str, Any]]:
    flights = white(0.002, 2, 3000).flights["pitch_rate"]
    return list(transients(Entrant(name, name), signal, values, flights))


@pytest.mark.parametrize("name", ["cross-channel", "cusum", "glr", "parity", "innovation"])
def test_bursts_below_the_persistence_fail_no_channel(name: str):
    found = bursts(name, white_signal(8), {})
    assert all((row["bursts"], row["failed"]) == (10, 0) for row in found)
    sizes = [(1, 10.0), (1, 100.0), (3, 10.0), (3, 100.0), (7, 10.0), (7, 100.0)]
    assert [(row["frames"], row["thresholds"]) for row in found] == sizes


def test_bursts_of_an_angle_stay_on_its_circle(monkeypatch: pytest.MonkeyPatch):
    """Beyond its end they would be invalid samples."""
    seen: list[Any] = []
    failing = healthy_flights.failing
    monkeypatch.setattr(healthy_flights, "failing", lambda *given: seen.extend(given[3]) or failing(*given))
    signal = white_signal(8)
    bursts("median", signal._replace(given=signal.given.model_copy(update={"wraps": True, "range": None})), {})
    assert len(seen) == 2 + 2 * 6 and max(np.abs(flight.samples).max() for flight in seen) <= np.pi
    assert all(np.abs(flight.samples).max() > 0.5 for flight in seen[2:])  # of 10 or 100, the short way


def test_as_published_every_burst_fails_somebody():
    signal = white_signal(8)._replace(baselines=Baselines.model_validate({"cusum": {"bounded": False}}))
    assert all(row["failed"] == row["bursts"] == 10 for row in bursts("cusum", signal, {}))


def test_failures_without_a_burst_are_none_of_its():
    """A voter that fails somebody in every frame has no new failures."""
    assert all(row["failed"] == 0 for row in bursts("cross-voter", white_signal(1), {"threshold": 1e-6}))


def excursions(*sizes: float) -> Any:
    flights = white(0.0, len(sizes), 600).flights["pitch_rate"]
    for size, flight in zip(sizes, flights, strict=True):
        flight.samples[300:320, 1] = size
    return flights


def test_the_level_that_three_flights_exceed_lies_below_the_third_largest():
    found = exceeded(VOTER, white_signal(8), {"threshold": 5.0}, excursions(1.0, 0.2, 0.9, 0.7, 0.5))
    assert found is not None and found[1] == 3
    assert 0.7 * 2 ** (-1 / 16) <= found[0]["threshold"] < 0.7


def test_no_level_is_exceeded_by_three_flights_of_which_two_have_something():
    assert exceeded(VOTER, white_signal(8), {"threshold": 5.0}, excursions(1.0, 0.9, 0.0)) is None
    assert isolations(VOTER, white_signal(8), {"threshold": 0.5}, excursions(1.0, 0.9, 0.0)) == 2


def test_counts_are_pooled_over_signals_with_their_hours():
    row = {"manager": "cusum", "flights": 9, "of": 9, "three": 2, "three_before": 3, "hours": 5.0}
    rows = [{**row, "signal": "pitch_rate", "counted": 1}, {**row, "signal": "roll_rate", "counted": 2}]
    found = counted(rows, 0.1)
    assert [each["signal"] for each in found] == ["pitch_rate", "roll_rate", "all"]
    assert found[2]["counted"] == 3 and found[2]["hours"] == 10.0 and found[2]["expected"] == pytest.approx(1.0)
    assert (found[2]["three"], found[2]["three_before"]) == (4, 6)
    assert counted(rows[:1], 0.1)[0]["signal"] == "pitch_rate" and len(counted(rows[:1], 0.1)) == 1
    unknown = counted([rows[0], {**rows[1], "three": None}], 0.1)[2]
    assert unknown["three"] is None
    assert np.isclose(found[0]["low_per_h"], 0.00506, rtol=0.01)  # Garwood: one in 5 h
