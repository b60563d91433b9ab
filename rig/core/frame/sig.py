"""The places of the signals by their symbols, for kernels: ``x[sig.THETA]`` is the pitch angle."""

from __future__ import annotations

from rig.core.frame.signals import S

Q, P, R, N_Z, N_Y, N_X, ALPHA, BETA, P_S, Q_BAR, D_P, D_R, D_Y, THETA, PHI, PSI = range(S)
