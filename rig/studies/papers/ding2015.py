"""Ding, Xiao and Jiang (2015) as printed, and the complete experiment.

A B707 in cruise, x = (v, alpha, q, theta), u = (throttle, elevator), one sensor y = F theta with F = 1, then 0.5
from 5 s on.  An observer x^' = A x^ + B u + H (y - C x^); tracking error e = x^ - x_r and observation error
x2 = x - x^ are stacked to eight states, for which a linear-quadratic regulator u = u_r - K (e, x2) is designed:

    (e, x2)' = Atilde(F) (e, x2) + Bbar (u - u_r) + (F - 1) (H C x_r, -H C x_r)
    Atilde(F) = [[A - (1 - F) H C, F H C], [(1 - F) H C, A - F H C]],  Bbar = (B, 0)

The paper drops the last term.  The complete experiment keeps it: it simulates aircraft, sensor and observer.
Source: Journal of Shanghai Institute of Technology 15 (2015) 167-172, doi 10.3969/j.issn.1671-7333.2015.02.014.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_are

from rig.core.errors import RigError

Matrix = NDArray[np.float64]
Feedback = Literal["estimate", "truth"]

# As printed.
A: Final = np.array([[0, 8.1692, 0, 9.8], [0, -0.4854, 1, 0], [0, -1.213, -0.5625, 0], [0, 0, 1, 0]], float)
B: Final = np.array([[320_800, 0.17411], [0, -0.0199], [-481_200, -0.939], [0, 0]], float)
C: Final = np.array([[0.0, 0.0, 0.0, 1.0]])
Q, R = 3.545, 2.222  # times the unit matrix
EFFECTIVENESS: Final = 0.5  # F, after the fault
FAULT_S: Final = 5.0
K1: Final = np.array(
    [
        [-1.2084, -4.0751, -2.3237, -6.1147, -1.2203, -5.4739, -6.0820, 2.0944],
        [-0.3828, -0.6817, -0.2552, -0.8935, -0.3258, -1.4936, -1.6111, 0.5327],
    ]
)
K2: Final = np.array(
    [
        [-0.8414, -1.6246, -2.0790, -9.5104, -0.9421, -3.0656, -5.1930, -4.3178],
        [-0.9420, -6.4646, -0.6280, 5.0044, 0.8414, 0.5820, 6.4483, 3.9492],
    ]
)
STACKED: Final = np.array(  # Atilde(0.5), with it the observer's gain
    [
        [0, 8.1692, 0, 9.8, 0, 0, 0, 0],
        [0, -0.4854, 1, 10.308, 0, 0, 0, -10.308],
        [0, -1.213, -0.5625, -12.067, 0, 0, 0, 12.067],
        [0, 0, 1, -4.476, 0, 0, 0, 4.476],
        [0, 0, 0, 0, 0, 8.1692, 0, 9.8],
        [0, 0, 0, -10.308, 0, -0.4854, 1, 10.308],
        [0, 0, 0, 12.067, 0, -1.213, -0.5625, -12.067],
        [0, 0, 0, 4.476, 0, 0, 1, -4.476],
    ],
    float,
)
H: Final = np.array([[0.0], [-20.616], [24.134], [8.952]])  # (A - STACKED) / 0.5, the fourth column

PERTURBED: Final = (0.9, 1.0, 1.1)  # of A, B and C each
BAND: Final = 0.02  # of a unit step: the band of a settled response
STEP_S: Final = 0.01
SHOWN_S: Final = 20.0
LONG_S: Final = 60.0  # for the final value of the complete experiment
_N: Final = 4


@dataclass(frozen=True)
class Run:
    """A response from rest to y_r = 1, with the fault at 5 s; angles for a unit step."""

    time_s: Matrix  # (n,)
    pitch: Matrix  # (n,) true pitch angle
    followed: Matrix  # (n,) the value that the loop uses for it: measured, or estimated in the error system
    elevator: Matrix  # (n,) rad, from u_r


@dataclass(frozen=True)
class Design:
    """The gains that rig computes from the printed A, B, C, H, Q and R."""

    stacked: Matrix  # (8, 8) at F = 0.5
    k1_left: Matrix  # (2, 4) of the four states alone
    k2: Matrix  # (2, 8)
    stabilisable_without_fault: bool  # the pair (Atilde(1), Bbar), for which K1 would be designed
    observer_poles: NDArray[np.complex128]  # (4,)
    speed_is_observable: bool


@dataclass(frozen=True)
class Study:
    """All results that the page shows."""

    design: Design
    error_system: Run  # as the paper computes it
    perturbed: list[Run]  # the same with A, B and C off by 10 %
    settling_s: tuple[float, float, float]  # of the tracking error: nominal, fastest and slowest of all
    settling_with_x2_s: tuple[float, float, float]  # the same, of the true pitch angle: the observation error added
    complete: Run
    with_truth: Run  # complete, with the observation error, which cannot be measured, given to the law
    complete_pitch: float  # where the true pitch angle comes to rest
    with_truth_pitch: float

    def as_dict(self) -> dict[str, float | bool | list[float]]:
        """Return the comparison as plain data, as ``rig study ding2015 --json`` prints it."""
        d = self.design
        return {
            "k2_max_error": _worst(d.k2, K2),
            "stacked_max_error": _worst(d.stacked, STACKED),
            "k1_left_max_error": _worst(d.k1_left, K1[:, :_N]),
            "settling_time_s": self.settling_s[0],
            "complete_true_pitch": self.complete_pitch,
            "complete_measured_pitch": EFFECTIVENESS * self.complete_pitch,
            "settling_time_range_s": list(self.settling_s[1:]),
            "settling_time_with_observation_error_s": self.settling_with_x2_s[0],
            "complete_true_pitch_with_truth": self.with_truth_pitch,
            "k1_right_is_defined": d.stabilisable_without_fault,
            "speed_is_observable": d.speed_is_observable,
        }


def _worst(ours: Matrix, printed: Matrix) -> float:
    return float(np.max(np.abs(ours - printed)))


def stacked(effectiveness: float, a: Matrix = A, c: Matrix = C) -> Matrix:
    """Return Atilde(F), (8, 8)."""
    f, hc = effectiveness, H @ c
    return np.block([[a - (1.0 - f) * hc, f * hc], [(1.0 - f) * hc, a - f * hc]])


def regulator(a: Matrix, b: Matrix) -> Matrix:
    """Return K = R^-1 B' P of the Riccati equation; scipy's LinAlgError: it has no stabilising solution."""
    p = solve_continuous_are(a, b, Q * np.eye(len(a)), R * np.eye(b.shape[1]))
    return b.T @ p / R


def design() -> Design:
    """Return the gains computed by rig, and the reason why the others do not exist."""
    bbar = np.vstack([B, np.zeros_like(B)])
    return Design(
        stacked=stacked(EFFECTIVENESS),
        k1_left=regulator(A, B),
        k2=regulator(stacked(EFFECTIVENESS), bbar),
        stabilisable_without_fault=_stabilisable(stacked(1.0), bbar),
        observer_poles=np.linalg.eigvals(A - H @ C).astype(np.complex128),
        speed_is_observable=_observes_speed(),
    )


def _stabilisable(a: Matrix, b: Matrix) -> bool:
    """Apply Hautus' test: [a - s, b] has full rank at every eigenvalue s of ``a`` that does not decay."""
    scaled, unit = b / np.linalg.norm(b, axis=0), np.eye(len(a))
    slow = [s for s in np.linalg.eigvals(a) if s.real > -1e-6]
    return all(np.linalg.matrix_rank(np.hstack([a - s * unit, scaled]), tol=1e-6) == len(a) for s in slow)


def _observes_speed() -> bool:
    """Return True if the speed, the first state, affects the pitch angle or any of its derivatives."""
    rows = [C @ np.linalg.matrix_power(A, i) for i in range(_N)]
    return bool(np.vstack(rows)[:, 0].any())


def reference() -> tuple[Matrix, Matrix]:
    """Return (x_r, u_r) at rest with theta = 1 and v = 0: A x_r + B u_r = 0, as the paper's tracking error requires."""
    solved = np.linalg.solve(np.column_stack([A[:3, 1], B[:3]]), -A[:3, 3])
    return np.array([0.0, solved[0], 0.0, 1.0]), solved[1:]


def _march(before: Matrix, after: Matrix, start: Matrix, duration_s: float) -> tuple[Matrix, Matrix]:
    """Return times (n,) and states (n, m) of z' = before z until the fault, z' = after z from it on; exact."""
    time = np.arange(round(duration_s / STEP_S) + 1, dtype=np.float64) * STEP_S
    states, steps = np.tile(start, (len(time), 1)), (expm(before * STEP_S), expm(after * STEP_S))
    for k in range(len(time) - 1):
        states[k + 1] = steps[k >= round(FAULT_S / STEP_S)] @ states[k]
    return time, states


def error_system(design: Design, a: float = 1.0, b: float = 1.0, c: float = 1.0) -> Run:
    """Run the paper's simulation: (e, x2)' = (Atilde - Bbar K)(e, x2) from e = (0, 0, 0, -1), x2 = 0; K1, then K2.

    a, b, c : factors on A, B and C.  While x2 = 0 the right half of K1 has no effect, so it is zero here.
    """
    bbar, k1 = b * np.vstack([B, np.zeros_like(B)]), np.hstack([design.k1_left, np.zeros((2, _N))])
    closed = [stacked(f, a * A, c * C) - bbar @ k for f, k in ((1.0, k1), (EFFECTIVENESS, design.k2))]
    time, z = _march(closed[0], closed[1], np.array([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]), SHOWN_S)
    gains = np.where(time[:, None, None] < FAULT_S, k1, design.k2)
    elevator = -np.einsum("nj,nj->n", gains[:, 1], z)
    return Run(time, 1.0 + z[:, 3] + z[:, 7], 1.0 + z[:, 3], elevator)


def complete(design: Design, feedback: Feedback, duration_s: float) -> Run:
    """Simulate aircraft, sensor and observer completely.

    "estimate": u = u_r - K_left (x^ - x_r), which an onboard computer can compute.
    "truth":    u = u_r - K (x^ - x_r, x - x^), the printed law, which needs the true state.
    """
    x_r, u_r = reference()
    k1, known = np.hstack([design.k1_left, np.zeros((2, _N))]), 1.0 if feedback == "truth" else 0.0
    closed = []
    for f, k in ((1.0, k1), (EFFECTIVENESS, design.k2)):
        by_truth, by_estimate = -known * k[:, _N:], known * k[:, _N:] - k[:, :_N]
        offset = (u_r + k[:, :_N] @ x_r)[:, None]
        aircraft = np.hstack([A + B @ by_truth, B @ by_estimate, B @ offset])
        observer = np.hstack([f * H @ C + B @ by_truth, A - H @ C + B @ by_estimate, B @ offset])
        closed.append(np.vstack([aircraft, observer, np.zeros((1, 2 * _N + 1))]))
    start = np.zeros(2 * _N + 1)
    start[-1] = 1.0
    time, z = _march(closed[0], closed[1], start, duration_s)
    late = time >= FAULT_S
    gains, pitch = np.where(late[:, None, None], design.k2, k1)[:, 1], z[:, 3]
    error = np.hstack([z[:, _N : 2 * _N] - x_r, known * (z[:, :_N] - z[:, _N : 2 * _N])])
    elevator = -np.einsum("nj,nj->n", gains, error)
    return Run(time, pitch, np.where(late, EFFECTIVENESS, 1.0) * pitch, elevator)


def settling(time_s: Matrix, response: Matrix) -> float:
    """Return the time [s] from which a response stays within 2 % of the step; RigError: it does not settle."""
    outside = np.flatnonzero(np.abs(response - 1.0) > BAND)
    if not len(outside):
        return float(time_s[0])
    if outside[-1] + 1 == len(time_s):
        raise RigError(f"study: the error system does not settle within {time_s[-1]:g} s")
    return float(time_s[outside[-1] + 1])


def _spread(times: list[float]) -> tuple[float, float, float]:
    return times[0], min(times), max(times)


def study() -> Study:
    """Design, simulate and compare, in some seconds."""
    gains = design()
    nominal = error_system(gains)
    runs = [error_system(gains, *factors) for factors in product(PERTURBED, repeat=3) if factors != (1.0, 1.0, 1.0)]
    return Study(
        design=gains,
        error_system=nominal,
        perturbed=runs,
        settling_s=_spread([settling(run.time_s, run.followed) for run in (nominal, *runs)]),
        settling_with_x2_s=_spread([settling(run.time_s, run.pitch) for run in (nominal, *runs)]),
        complete=complete(gains, "estimate", SHOWN_S),
        with_truth=complete(gains, "truth", SHOWN_S),
        complete_pitch=float(complete(gains, "estimate", LONG_S).pitch[-1]),
        with_truth_pitch=float(complete(gains, "truth", LONG_S).pitch[-1]),
    )
