"""The second paper: what reproduces, what does not, and what is true."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import LinAlgError
from typer.testing import CliRunner

from rig.cli.main import app
from rig.studies.papers import ding2015
from rig.studies.papers.ding2015 import A, B, C, H

BBAR = np.vstack([B, np.zeros((4, 2))])
DESIGN = ding2015.design()


@pytest.mark.requirement("ding2015", "K2, Atilde, K1")
def test_all_64_entries_of_the_stacked_matrix_are_the_formula():
    assert np.array_equal(ding2015.stacked(0.5), ding2015.STACKED)


@pytest.mark.requirement("ding2015", "K2, Atilde, K1")
def test_k2_is_the_plain_regulator_of_the_stacked_system():
    assert np.max(np.abs(DESIGN.k2 - ding2015.K2)) < 2e-4
    poles = np.linalg.eigvals(ding2015.stacked(0.5) - BBAR @ DESIGN.k2)
    assert np.max(poles.real) < -0.3


def test_the_regulator_solves_its_riccati_equation():
    k, a = ding2015.regulator(A, B), A
    # P from the Lyapunov equation of the closed loop, by vectorisation: an own way to the same gain.
    closed, unit = a - B @ k, np.eye(4)
    weight = ding2015.Q * unit + ding2015.R * k.T @ k
    p = np.linalg.solve(np.kron(unit, closed.T) + np.kron(closed.T, unit), -weight.T.ravel()).reshape(4, 4)
    assert B.T @ p / ding2015.R == pytest.approx(k, rel=1e-4, abs=1e-4)


@pytest.mark.requirement("ding2015", "K2, Atilde, K1")
def test_k1_is_the_regulator_of_the_aircraft_alone_and_its_right_half_does_not_exist():
    assert np.max(np.abs(DESIGN.k1_left - ding2015.K1[:, :4])) < 0.02
    assert not DESIGN.stabilisable_without_fault
    assert not DESIGN.speed_is_observable
    assert np.min(np.abs(DESIGN.observer_poles)) < 1e-9
    with pytest.raises(LinAlgError):
        ding2015.regulator(ding2015.stacked(1.0), BBAR)


def test_with_the_fault_the_pair_is_stabilisable():
    assert ding2015._stabilisable(ding2015.stacked(0.5), BBAR)


@pytest.mark.requirement("ding2015", "settling")
def test_the_error_system_settles_as_the_paper_says_in_every_perturbed_case():
    for factors in product(ding2015.PERTURBED, repeat=3):
        run = ding2015.error_system(DESIGN, *factors)
        assert 5.0 < ding2015.settling(run.time_s, run.followed) < 6.5, factors


def test_a_response_outside_the_band_at_the_end_is_not_settled():
    with pytest.raises(Exception, match="does not settle"):
        ding2015.settling(np.array([0.0, 1.0]), np.array([1.0, 1.03]))


@pytest.mark.requirement("ding2015", "true pitch angle 2")
def test_in_the_complete_model_the_true_pitch_angle_goes_to_twice_what_is_wanted():
    run = ding2015.complete(DESIGN, "estimate", 60.0)
    assert run.pitch[-1] == pytest.approx(2.0, abs=1e-6)
    assert run.followed[-1] == pytest.approx(1.0, abs=1e-6)


def test_the_printed_law_fed_with_the_true_state_goes_to_zero():
    assert ding2015.complete(DESIGN, "truth", 60.0).pitch[-1] == pytest.approx(0.0, abs=1e-6)


def test_the_complete_experiment_is_the_aircraft_the_sensor_and_the_observer():
    """The same by an integrator of stiff equations, written out."""
    x_r, u_r = ding2015.reference()
    assert A @ x_r + B @ u_r == pytest.approx(np.zeros(4), abs=1e-9)

    def rates(gain: np.ndarray, f: float):
        def of(t: float, z: np.ndarray) -> np.ndarray:
            x, seen = z[:4], z[4:]
            u = u_r - gain @ (seen - x_r)
            return np.concatenate([A @ x + B @ u, A @ seen + B @ u + (H * (f * C @ x - C @ seen)).ravel()])

        return of

    kept = {"method": "Radau", "rtol": 1e-8, "atol": 1e-9}
    first = solve_ivp(rates(DESIGN.k1_left, 1.0), (0.0, 5.0), np.zeros(8), **kept).y[:, -1]
    second = solve_ivp(rates(DESIGN.k2[:, :4], 0.5), (5.0, 8.0), first, **kept).y[:, -1]
    run = ding2015.complete(DESIGN, "estimate", 8.0)
    assert run.pitch[500] == pytest.approx(first[3], abs=1e-4)
    assert run.pitch[-1] == pytest.approx(second[3], abs=1e-4)


def of_the_page() -> str:
    return " ".join(
        (Path(__file__).parent.parent / "docs" / "results" / "incidents-and-worst-cases.md").read_text().split()
    )


def moved(gains: tuple[np.ndarray, np.ndarray], known: float, end_s: float) -> np.ndarray:
    """Return the elevator beyond its equilibrium, (n,) from the switch to ``end_s``, written out and integrated.

    gains : (2, 8) before and after the switch; known : 1 for a law that is given the true observation error, else 0
    """
    x_r, u_r = ding2015.reference()

    def beyond(z: np.ndarray, gain: np.ndarray) -> np.ndarray:
        return -gain @ np.concatenate([z[4:] - x_r, known * (z[:4] - z[4:])])

    def rates(gain: np.ndarray, f: float):
        def of(t: float, z: np.ndarray) -> np.ndarray:
            u = u_r + beyond(z, gain)
            return np.concatenate([A @ z[:4] + B @ u, A @ z[4:] + B @ u + (H * (f * C @ z[:4] - C @ z[4:])).ravel()])

        return of

    kept = {"method": "Radau", "rtol": 1e-8, "atol": 1e-9}
    start = solve_ivp(rates(gains[0], 1.0), (0.0, 5.0), np.zeros(8), **kept).y[:, -1]
    after = solve_ivp(rates(gains[1], 0.5), (5.0, end_s), start, t_eval=np.arange(5.0, end_s, 0.01), **kept)
    return np.array([beyond(z, gains[1])[1] for z in after.y.T])


def test_the_only_equilibrium_at_a_pitch_angle_is_the_one_of_the_page():
    """By the null space of [A, B]: it has two dimensions, of which one is the speed alone."""
    scale = np.diag([1, 1, 1, 1, 1e-6, 1])  # of the throttle, whose column is not divided by mass or inertia
    values, basis = np.linalg.svd(np.hstack([A, B]) @ scale)[1:]
    rank = int((values > 1e-9).sum())
    null = scale @ basis[rank:].T  # (6, n) of (v, alpha, q, theta, throttle, elevator)
    assert null.shape == (6, 2)
    speed_alone = null @ np.array([-null[3, 1], null[3, 0]])  # theta = 0
    assert np.abs(speed_alone[1:]).max() < 1e-9 * abs(speed_alone[0])
    at_one = null @ np.linalg.pinv(null[3:4])[:, 0]
    assert at_one[[2, 3]] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert [f"{value:+.3f}" for value in at_one[[1, 5]]] == ["-0.533", "+13.003"]
    assert "has alpha = -0.533 and elevator +13.0:" in of_the_page()
    x_r, u_r = ding2015.reference()
    assert (x_r[1], *u_r) == pytest.approx((at_one[1], *at_one[4:]), rel=1e-6)


def test_the_elevator_that_the_step_takes_is_that_of_the_page():
    k1 = np.hstack([ding2015.K1[:, :4], np.zeros((2, 4))])
    by_estimate = np.abs(moved((k1, ding2015.K2), 0.0, 15.0)).max()
    by_truth = np.abs(moved((k1, ding2015.K2), 1.0, 20.0)).max()
    text = of_the_page()
    assert f"up to {by_estimate:.2f} times the step after the switch (the printed law by {by_truth:.1f}," in text
    assert f"asks for up to {by_estimate + ding2015.reference()[1][1]:.1f} deg" in text
    of_error = ding2015.error_system(DESIGN)
    late = of_error.time_s >= ding2015.FAULT_S
    assert f"the error system by {np.abs(of_error.elevator[late]).max():.2f})" in text


def test_the_printed_right_half_of_k1_does_not_matter_while_there_is_no_observation_error():
    """The error system by an integrator, with K1 as printed and with zeros there."""
    ends = []
    for right in (ding2015.K1[:, 4:], np.zeros((2, 4))):
        closed = ding2015.stacked(1.0) - BBAR @ np.hstack([ding2015.K1[:, :4], right])
        start = np.array([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0])
        steps = solve_ivp(lambda t, z, closed=closed: closed @ z, (0.0, 5.0), start, method="Radau", rtol=1e-8)
        assert np.abs(steps.y[4:]).max() < 1e-9
        ends.append(steps.y[:, -1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-9) and "the same to 1e-9" in of_the_page()


def test_the_command_writes_page_and_picture_and_one_object(tmp_path: Path):
    result = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path / "new"), "--json"])
    found = json.loads(result.stdout)
    wanted = {"k2_max_error", "stacked_max_error", "k1_left_max_error", "settling_time_s"}
    assert wanted | {"complete_true_pitch", "complete_measured_pitch"} <= set(found)
    page, picture = (Path(name) for name in found["figures"])
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 50_000
    text = page.read_text()
    assert "Plotly.react" in text and '<script src="http' not in text
    assert "prefers-color-scheme: dark" in text and text.count('class="figure"') == 3


@pytest.mark.long
def test_the_command_says_what_does_not_reproduce(tmp_path: Path):
    said = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path)]).stdout
    assert "K1, columns 5 to 8" in said and "the law has no estimate of F" in said


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    result = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path / "file" / "below")])
    assert result.exit_code != 0 and "figures cannot be written there" in str(result.exception)
