"""The stage as the loop holds it: references, manager and discretes over constructed rows, no aircraft."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from faulted import PLACES
from numpy.random import SeedSequence
from test_analytic_references import PRESSURE, designed, level_flight

from rig.bench.drive import Stages
from rig.bench.drive import run as run_bench
from rig.bench.vote_rows import by_class
from rig.computer.analytic.designed import Designed, Error, Point
from rig.computer.analytic.references import Config as References
from rig.computer.redundancy import Redundancy
from rig.computer.redundancy.manager_config import MANAGERS, Config, SignalConfigs
from rig.computer.redundancy.managers import manager_kind
from rig.core.frame import DISCRETE_INDEX, INDEX, SIGNALS, Block, Ilm, S, State, nested
from rig.core.trust import Trust
from rig.world.faults import Faults

RATE = 100.0
NO_FAULTS = Faults([], PLACES, RATE, SeedSequence(0)).data
Q = INDEX["pitch_rate"]
RANGES = np.array([(signal.low, signal.high) for signal in SIGNALS])
FOUR = np.full(S, 4)
AVERAGES = ("variance_mean", "inverse_mean", "trimmed_mean", "mid_value")
SAMPLES = (0.1, 0.2, 0.4, 1.3)  # mean 0.5, median 0.3; every two further apart than any threshold of a rate


class Recorder:
    """A manager of the user's own that votes the first channel and keeps the reference that it was given."""

    seen: ClassVar[list[float]] = []

    def __init__(self, params: Any) -> None:
        self.seen.clear()

    def step(self, bus: Any, fcc: Any, k: int) -> None:
        self.seen.append(float(fcc[k]["reference"][Q]))
        fcc[k]["voted"][:] = bus[k]["channels"][:, 0]
        fcc[k]["level"][:] = 4


def stage(manager: str = MANAGERS[0], errors: Any = None, **of_pitch_rate: Any) -> Redundancy:
    """Thresholds of 0.05 in every unit; ``of_pitch_rate`` are settings of that signal."""
    every = {signal.name: {"threshold": 0.05} for signal in SIGNALS}
    every["pitch_rate"] |= of_pitch_rate
    config = Config(manager=manager, signals=SignalConfigs.model_validate(every))
    return Redundancy(config, RANGES, FOUR, designed(errors=errors), RATE, trust=Trust(allow_code=True))


def rows(n: int = 2) -> Block:
    block = level_flight(n)
    block["channels"] = block["voted"][:, :, None]
    block["voted"], block["level"] = 0.0, 0
    block["valid"], block["ilm"] = 1, Ilm.ABSENT
    block["discrete_valid"], block["discrete_ilm"] = 1, Ilm.ABSENT
    return block


def run(which: Redundancy, block: Block) -> Block:
    """The frames of a replay: references, manager, discretes."""
    data, own = which.data, which.own
    stages = Stages(faults=NO_FAULTS, references=data.references, manager=data.manager, discretes=data.discretes)
    run_bench(nested(block), stages, decide=None if own is None else by_class(own, block, nested(block)))
    return block


@pytest.mark.parametrize(("manager", "vote"), [("mean", 0.5), ("median", 0.3), ("selection", 0.1)])
def test_the_chosen_manager_votes(manager: str, vote: float):
    block = rows(1)
    block["channels"][0, Q] = SAMPLES
    assert run(stage(manager), block)["voted"][0, Q] == pytest.approx(vote)


@pytest.mark.parametrize("manager", MANAGERS)
def test_every_manager_of_the_house_isolates_or_keeps_as_it_says(manager: str):
    """One channel far off for a second: who monitors has failed it, who only averages never does."""
    block = rows(100)
    block["channels"][:, Q, 2] = 1.4
    out = run(stage(manager), block)
    monitors = manager not in ("mean", "median", "weighted", *AVERAGES)
    assert (out["state"][-1, Q, 2] == State.FAILED) == monitors
    assert (out["state"][:, :, [0, 1, 3]] == State.OK).all()


def test_discretes_are_voted_with_every_manager():
    for manager in MANAGERS:
        block = rows(1)
        block["discrete_channels"][0, DISCRETE_INDEX["gear_down"]] = (0, 0, 1, 0)
        assert run(stage(manager), block)["discrete_voted"][0, DISCRETE_INDEX["gear_down"]] == 0


def test_a_manager_of_the_users_own_sees_the_reference_of_the_votes_before():
    """In level flight the pitch rate's reference is zero; there is none in the first frame, which has no votes yet."""
    which = stage(f"{__name__}:Recorder")
    block = rows(3)
    block["discrete_channels"][:, DISCRETE_INDEX["gear_down"]] = 1
    run(which, block)
    assert np.isnan(Recorder.seen[0]) and Recorder.seen[1:] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert (block["voted"] == block["channels"][:, :, 0]).all()
    assert (block["discrete_voted"][:, DISCRETE_INDEX["gear_down"]] == 1).all()


def test_references_are_usable_for_the_managers_that_read_them():
    for manager in MANAGERS:
        usable = run(stage(manager), rows(50))["reference_usable"][:, Q]
        assert (usable == manager_kind(manager).refers).all()


def test_a_measured_threshold_counts_in_the_vote():
    """The reference is zero and the pairs at -0.01 and 0.3 rad/s: settled with a threshold of 0.1, not of 1e-9."""
    for threshold, settled in ((0.1, True), (1e-9, False)):
        error = Error(rms=0.0, quantile_999=0.0, worst=0.0, threshold=threshold)
        which = stage(errors={"pitch_rate": {"attitude": error}}, tie_break=["reference"])
        block = rows(100)
        block["channels"][20:, Q, :2], block["channels"][20:, Q, 2:] = -0.01, 0.3
        states = run(which, block)["state"][-1, Q].tolist()
        assert (states == [State.OK, State.OK, State.FAILED, State.FAILED]) is settled


BOUNDS = {
    **dict.fromkeys(("dynamic_pressure_pa", "lift_slope_1_pa", "pitch_rate_gain"), -0.5),
    "side_slope_1_pa": 0.5,
    **dict.fromkeys(("alpha_filter_s", "attitude_filter_s", "acceleration_filter_s", "unit_filter_s"), -0.5),
}


@pytest.mark.parametrize(("name", "value"), BOUNDS.items())
def test_a_coefficient_of_the_wrong_sign_is_refused(name: str, value: float):
    point = designed().points[0].model_dump()
    for wrong in (value, 0.0):
        with pytest.raises(ValueError, match=name):
            Point(**{**point, name: wrong})
    assert Point(**{**point, name: -value})


@pytest.mark.parametrize("name", ["rms", "quantile_999", "worst", "threshold"])
def test_a_measured_error_below_zero_is_refused(name: str):
    good: dict[str, Any] = {"rms": 0.1, "quantile_999": 0.2, "worst": 0.3, "threshold": 0.4}
    with pytest.raises(ValueError, match=name):
        Error(**{**good, name: -0.5})
    assert Error(**good)


def test_rates_of_the_measurement_and_leads_have_their_sign():
    with pytest.raises(ValueError, match="rate_hz"):
        Designed(**{**designed().model_dump(), "rate_hz": 0.0})
    assert Designed(**{**designed().model_dump(), "rate_hz": 0.5})
    with pytest.raises(ValueError, match="inertial_lead_s"):
        References(inertial_lead_s=-0.5)
    assert (
        References(inertial_lead_s=0.0).inertial_lead_s == 0.0 == References(inertial_lead_s=0.5).inertial_lead_s - 0.5
    )


def test_points_out_of_order_are_refused():
    point = designed().points[0].model_dump()
    points = [Point(**{**point, "dynamic_pressure_pa": pressure}) for pressure in (PRESSURE, PRESSURE)]
    with pytest.raises(ValueError, match="rising dynamic pressure"):
        Designed(rate_hz=RATE, accelerometer_x_m=0, accelerometer_y_m=0, accelerometer_z_m=0, points=points)
    assert References().inertial_lead_s == 0.015
