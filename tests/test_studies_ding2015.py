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
from rig.studies import ding2015
from rig.studies.ding2015 import A, B, C, H

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
def test_honestly_the_true_pitch_angle_goes_to_twice_what_is_wanted():
    run = ding2015.honest(DESIGN, "estimate", 60.0)
    assert run.pitch[-1] == pytest.approx(2.0, abs=1e-6)
    assert run.followed[-1] == pytest.approx(1.0, abs=1e-6)


def test_the_printed_law_fed_with_the_true_state_goes_to_zero():
    assert ding2015.honest(DESIGN, "truth", 60.0).pitch[-1] == pytest.approx(0.0, abs=1e-6)


def test_the_honest_experiment_is_the_aircraft_the_sensor_and_the_observer():
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
    run = ding2015.honest(DESIGN, "estimate", 8.0)
    assert run.pitch[500] == pytest.approx(first[3], abs=1e-4)
    assert run.pitch[-1] == pytest.approx(second[3], abs=1e-4)


def test_the_command_writes_page_and_picture_and_one_object(tmp_path: Path):
    result = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path / "new"), "--json"])
    found = json.loads(result.stdout)
    wanted = {"k2_max_error", "stacked_max_error", "k1_left_max_error", "settling_time_s"}
    assert wanted | {"honest_true_pitch", "honest_measured_pitch"} <= set(found)
    page, picture = (Path(name) for name in found["figures"])
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 50_000
    text = page.read_text()
    assert "Plotly.newPlot" in text and '<script src="http' not in text


def test_the_command_says_what_does_not_reproduce(tmp_path: Path):
    said = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path)]).stdout
    assert "K1, columns 5 to 8" in said and "nothing in this law knows F" in said


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    result = CliRunner().invoke(app, ["study", "ding2015", "--out", str(tmp_path / "file" / "below")])
    assert result.exit_code != 0 and "figures cannot be kept there" in str(result.exception)
