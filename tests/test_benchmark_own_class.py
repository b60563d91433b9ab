"""Managers of the user's own open loop: what they are given, and what a calibration makes of them."""

import benchmark_flights
import numpy as np
import polars as pl
import pytest
from benchmark_flights import RATE_HZ, plan, white, white_signal
from scipy.stats import norm

from rig.core.errors import BadInput
from rig.studies.benchmark.benchmark_trials import Runner, Told, shared_out
from rig.studies.benchmark.calibration import Calibrated, calibrate
from rig.studies.benchmark.entrants import Entrant, entrants, isolates_no_channel
from rig.studies.benchmark.healthy_flights import scaled
from rig.studies.benchmark.own_class import calibrated_number, voted, with_values

NAME = "benchmark_flights:Limited"


@pytest.mark.parametrize(("own", "manager"), [("Wrapped", "cross-voter"), ("WrappedInnovation", "innovation")])
def test_a_manager_of_the_rig_decides_the_same_as_a_class_of_the_users(own: str, manager: str):
    """With every state of the reference, which "innovation" reads."""
    both = [Entrant(f"benchmark_flights:{own}", f"benchmark_flights:{own}"), Entrant(manager, manager)]
    calibrated = {(e.name, "pitch_rate"): Calibrated(e.name, "pitch_rate") for e in both}
    rows = Runner(plan(), Told(both, calibrated, 0.01, {"pitch_rate": 0.05}))(shared_out(plan(), 18, 5)[0])
    first, second = (rows.filter(pl.col("manager") == e.name).drop("manager") for e in both)
    assert first.equals(second) and first["outcome"].n_unique() > 1


@pytest.mark.long
def test_the_calibrated_number_of_a_class_is_that_of_the_normal_law():
    sigma, budget = 0.1, 30.0
    found = calibrate(Entrant(NAME, NAME), white_signal(), white(sigma, 48, 3000), budget)
    expected = sigma * norm.isf(budget / 3600.0 / RATE_HZ / 4 / 2)  # four channels, two sides
    assert 0.95 * expected < found.values["limit"] < 1.35 * expected
    assert benchmark_flights.Limited.limit == 2.0


def test_each_flight_of_a_batch_is_voted_alone_and_numbers_return_to_what_they_were():
    channels = np.zeros((20, 700, 4))
    channels[17, 650, 2], channels[3, 5, 0] = 9.0, -9.0
    read = {"channels": channels, "reference": np.zeros((20, 700)), "second_reference": np.zeros((20, 700))}
    with pytest.raises(RuntimeError), with_values(NAME, {"limit": 1.0}):
        raise RuntimeError
    assert calibrated_number(NAME) == ("limit", 2.0)
    failed, votes = voted(NAME, {"limit": 5.0}, white_signal().params, read)
    assert failed.any(axis=1).sum() == 2 and failed[17, 650:, 2].all() and failed[3, 5:, 0].all()
    assert failed[17, 649, 2] == 0 and (votes == 0.0).all()
    assert not voted(NAME, {"limit": 10.0}, white_signal().params, read)[0].any()


def test_without_a_number_it_is_compared_by_its_vote_alone():
    (own,) = entrants("benchmark_flights:Wrapped")[4:]
    assert isolates_no_channel(own, white_signal()) and not isolates_no_channel(Entrant(NAME, NAME), white_signal())


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("benchmark_flights:Nameless", "calibrate = 'gain': the class has no number above 0 of this name"),
        ("benchmark_flights:Absent", "cannot be imported"),
        ("benchmark_flights:NoStep", r"the class has no step\(bus, fcc, k\)"),
        ("no_such_module:Voter", "cannot be imported"),
    ],
)
def test_a_class_that_cannot_take_part_is_one_line(name: str, said: str):
    with pytest.raises(BadInput, match=f"--managers: {name}: {said}"):
        entrants(name)


def test_a_class_that_raises_is_one_line():
    with pytest.raises(BadInput, match="raised in frame 2: ValueError: no third frame"):
        voted("benchmark_flights:Raising", {}, white_signal().params, {"channels": np.zeros((1, 9, 4))})


def test_a_class_designs_itself_from_the_healthy_data_of_each_signal():
    name, healthy = "benchmark_flights:Designed", white(0.1, 4, 600)
    (own,) = entrants(name)[4:]
    largest = max(float(np.abs(flight.samples).max()) for flight in healthy.flights["pitch_rate"])
    found = calibrate(own, white_signal(), healthy, 30.0)
    assert found.values == {"limit": pytest.approx(1.5 * largest)} and found.seen == 0
    assert not isolates_no_channel(own, white_signal()) and benchmark_flights.Designed.limit == 2.0


def test_only_the_number_that_is_calibrated_is_scaled():
    """Not others whose names begin as its name does, which may be lists."""
    (own,) = entrants(NAME)[4:]
    values = {"limit": 2.0, "limit_gain": 3.0, "limits": [1.0, 2.0]}
    assert scaled(own, white_signal(), values, 16) == {"limit": 1.0, "limit_gain": 3.0, "limits": [1.0, 2.0]}


@pytest.mark.long
def test_a_class_with_both_is_calibrated_behind_its_design():
    """Of channel 3, ten times as noisy, a sample counts a tenth: the level is that of samples with these weights."""
    name, healthy, signal = "benchmark_flights:DesignedAndCalibrated", white(0.01, 8, 1500), white_signal()
    for flight in healthy.flights["pitch_rate"]:
        flight.samples[:, 2] *= 10.0
    found = calibrate(Entrant(name, name), signal, healthy, 100.0)
    weights = np.array(found.values["weights"])
    assert weights == pytest.approx([100.0, 100.0, 10.0, 100.0], rel=0.05)
    weighed = [each._replace(samples=each.samples * weights) for each in healthy.flights["pitch_rate"]]
    plain = calibrate(Entrant(NAME, NAME), signal, healthy._replace(flights={"pitch_rate": weighed}), 100.0)
    assert found.values["limit"] == pytest.approx(plain.values["limit"], rel=0.2)
    assert found.shown == {"limit": found.values["limit"]}


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (3.0, "design: returned float, must be a dict of settings"),
        ({"gain": 1.0}, "design: 'gain': the class has no attribute of this name"),
        ({"limit": "much"}, "design: limit: must be a finite number or a list of at most 10,000"),
        ({"limit": float("nan")}, "design: limit: must be a finite number"),
        ({"limit": [1.0] * 10_001}, "design: limit: must be a finite number"),
        ("write", "design: pitch_rate: raised ValueError: assignment destination is read-only"),
        ("unlock", "design: pitch_rate: raised ValueError: cannot set WRITEABLE flag to True of this array"),
    ],
)
def test_a_design_that_is_no_settings_is_one_line(monkeypatch: pytest.MonkeyPatch, answer: object, said: str):
    name = "benchmark_flights:Odd"
    monkeypatch.setattr(benchmark_flights.Odd, "answer", answer)
    with pytest.raises(BadInput, match=f"--managers: {name}: {said}") as error:
        calibrate(Entrant(name, name), white_signal(), white(0.1, 2, 200), 30.0)
    assert "\n" not in str(error.value)
