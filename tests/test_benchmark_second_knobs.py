"""The settings that are not calibrated: choices for every manager, of which injected faults select one."""

from typing import Any

import numpy as np
import pytest
from benchmark_flights import white, white_signal

from rig.computer.redundancy.managers import LEARNERS, MANAGERS, manager_kind
from rig.core.errors import BadInput
from rig.studies.benchmark.calibration import calibrate
from rig.studies.benchmark.calibration_data import Healthy, measured, of_residuals
from rig.studies.benchmark.entrants import Entrant, entrants, manager
from rig.studies.benchmark.healthy_flights import isolations
from rig.studies.benchmark.second_knobs import KNOBS, choices_of, in_words


def biased(sigma: float = 0.01, flights: int = 10) -> Healthy:
    """Channels that differ by constants of up to 0.3 thresholds, others in each flight."""
    healthy = white(sigma, flights, 6000)
    biases = np.random.default_rng(3).uniform(-0.3, 0.3, (flights, 4))
    made = [f._replace(samples=f.samples + b) for f, b in zip(healthy.flights["pitch_rate"], biases, strict=True)]
    return healthy._replace(flights={"pitch_rate": made})


def test_every_manager_that_isolates_by_residuals_may_learn_a_bias_and_be_tuned():
    for name in MANAGERS[1:]:
        isolates = manager_kind(name).isolates
        for word in ("bias", "tuned"):
            if isolates:
                assert entrants(f"{name} {word}")[4].variant == (word,)
            else:
                with pytest.raises(BadInput, match=f"--managers: {name} {word}: {name} has no variant '{word}'"):
                    entrants(f"{name} {word}")
        assert not isolates or name in LEARNERS


@pytest.mark.parametrize("name", ["cusum tuned bias", "cusum bias tuned", "cusum 60 tuned"])
def test_a_variant_that_the_choice_would_override_is_refused(name: str):
    with pytest.raises(BadInput, match=f"--managers: {name}: 'tuned' chooses what '(bias|60)' sets; give one of them"):
        entrants(name)


def test_each_choice_is_made_of_a_bias_a_second_setting_and_on_recordings_a_persistence():
    cusum = Entrant("cusum tuned", "cusum", ("tuned",))
    made = list(choices_of(cusum, {"spread": 0.1}, 0.2))
    assert made[0] == {"spread": 0.1, "learned_bias": 0.0, "limit": 24.0} and len(made) == 6
    assert {(each["learned_bias"], each["limit"]) for each in made} == {
        (bound, limit) for bound in (0.0, 0.2) for limit in (24.0, 60.0, 120.0)
    }
    recorded = list(choices_of(cusum, {}, 0.2, (8, 12)))
    assert len(recorded) == 12 and [each["persistence"] for each in recorded] == [8] * 6 + [12] * 6
    assert in_words(cusum, made[4]) == "limit 60, a learned bias of up to 0.2 thresholds"
    voter = Entrant("cross-voter tuned", "cross-voter", ("tuned",))
    assert [each["learned_bias"] for each in choices_of(voter, {}, 0.2)] == [0.0, 0.2]


def test_each_second_setting_is_one_that_no_calibration_chooses_and_its_default_comes_first():
    for name, (key, values) in KNOBS.items():
        kind = manager_kind(name).settings
        assert kind is not None and key not in kind.levels
        assert values[0] == kind.model_fields[key].default and len(values) == 3


@pytest.mark.parametrize("name", ["cusum", "cross-voter", pytest.param("window_median", marks=pytest.mark.long)])
def test_behind_a_learned_bias_the_same_rate_asks_for_a_lower_level(name: str):
    healthy, signal = biased(), white_signal(8)
    plain, learned = (calibrate(entrants(f"{name}{word}")[4], signal, healthy, 20.0) for word in ("", " bias"))
    bound = of_residuals(signal, healthy)["bias"]
    assert learned.values["learned_bias"] == bound == pytest.approx(0.4, abs=0.2)
    (level,) = learned.shown
    assert learned.shown[level] < 0.5 * plain.shown[level]
    assert plain.seen is not None and learned.seen is not None and plain.seen + learned.seen <= 7


def test_the_choice_isolates_most_injected_faults_and_a_note_names_it():
    """Constants are thirty times the noise: a bias is learned."""
    (tuned,) = entrants("cusum tuned")[4:]
    healthy, signal = biased(flights=5), white_signal(8)
    found = calibrate(tuned, signal, healthy, 20.0)
    assert found.values["learned_bias"] > 0.0
    assert found.notes[0].startswith("cusum tuned: pitch_rate: limit ")
    assert "thresholds: isolates most injected faults of " in found.notes[0]
    assert found.values == calibrate(tuned, signal, healthy, 20.0).values


def test_a_persistence_among_the_settings_of_a_baseline_reaches_its_record():
    voter, cusum = Entrant("cross-voter", "cross-voter"), Entrant("cusum", "cusum")
    for entrant in (voter, cusum):
        made: Any = manager(entrant, white_signal(8), {"persistence": 24, "threshold": 0.5})
        assert made.params["persistence"][0] == 24
        assert manager(entrant, white_signal(8), {}).params["persistence"][0] == 8


def test_a_bias_is_measured_where_a_variant_asks_for_it():
    healthy, signal = biased(), white_signal(8)
    assert "learned_bias" not in measured(Entrant("cusum", "cusum"), signal, healthy)
    (voter,) = entrants("cross-voter bias")[4:]
    told = measured(voter, signal, healthy)
    assert set(told) == {"learned_bias"}
    quiet = [flight._replace(samples=flight.samples + 0.0) for flight in healthy.flights["pitch_rate"]]
    assert isolations(voter, signal, {**told, "threshold": 0.35}, quiet) <= isolations(
        voter, signal, {"threshold": 0.35}, quiet
    )
