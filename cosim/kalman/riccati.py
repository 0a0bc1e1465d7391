"""Stationary Kalman filter and smoother of a system whose rear wheels meet the front wheels' road.

The delay line is part of the state: substeps of white noise that the front wheels have met.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_discrete_lyapunov

from cosim.kalman.system import SUBSTEPS, System

Array = npt.NDArray[np.float64]

DOUBLINGS: Final = 60
SETTLED: Final = 1e-10
UNSETTLED: Final = "the Riccati equation does not settle: some unstable part is not measured"


@dataclass(frozen=True)
class Sampled:
    """From sample to sample, delay line included: x+ = A x + noise of covariance Q (N, N), y = H x
    + noise of covariance R (p, p). The first `size` states are the system's, the others the taps:
    all of the sum, then all of the difference, newest first.
    """

    A: Array
    Q: Array
    H: Array
    R: Array
    size: int


@dataclass(frozen=True)
class Stationary:
    """Gain K (N, p), covariances of the state before (X) and after the measurement (P), (N, N), and
    of the innovations S (p, p).
    """

    K: Array
    X: Array
    P: Array
    S: Array


def sampled(s: System, rows: Sequence[int], delay: float | None, rear: float) -> Sampled:
    """Join the substeps of a sample; `rows` are the channels measured.

    `delay` is that of the rear wheels in substeps, None for a filter that does not know of it;
    `rear` the share of the rear wheels' road, in variance, that the front wheels have not met.
    """
    n = len(s.names)
    F, G = _with_delay_line(s, delay, rear)
    Q = G @ G.T
    Q[:n, :n] += s.Q
    A, total = np.eye(len(F)), np.zeros_like(Q)
    before, after = (list(part) for part in s.moved)
    if before:
        A[after] = A[before]
        A[before] = 0.0
    for _ in range(SUBSTEPS):
        A, total = F @ A, F @ total @ F.T + Q
    H = np.zeros((len(rows), len(F)))
    H[:, :n] = s.H[rows]
    return Sampled(A, total, H, s.R[np.ix_(rows, rows)], n)


def _with_delay_line(s: System, delay: float | None, rear: float) -> tuple[Array, Array]:
    n = len(s.names)
    taps = 0 if delay is None else int(delay) + 1
    F, G = np.zeros((n + 2 * taps, n + 2 * taps)), np.zeros((n + 2 * taps, 4))
    F[:n, :n], G[:n] = s.F, s.W
    if delay is None:
        return F, G
    whole, part = int(delay), delay - int(delay)
    for k in range(2):
        first = n + k * taps
        F[range(first + 1, first + taps), range(first, first + taps - 1)] = 1.0
        G[first, k] = 1.0
        for age, share in ((whole - 1, 1.0 - part), (whole, part)):
            F[:n, first + age] += s.W[:, 2 + k] * share
    G[:, 2:] *= np.sqrt(rear)
    return F, G


def stationary(p: Sampled) -> Stationary:
    """Solve the filter's Riccati equation by the doubling algorithm (Anderson, Int. J. Control 28,
    1978). Raises ArithmeticError where it does not settle.
    """
    try:
        with np.errstate(over="raise", invalid="raise"):
            X = _doubled(p)
    except FloatingPointError:
        raise ArithmeticError(UNSETTLED) from None
    S = p.H @ X @ p.H.T + p.R
    K = np.linalg.solve(S, p.H @ X).T
    P = X - K @ p.H @ X
    return Stationary(np.asarray(K, np.float64), X, 0.5 * (P + P.T), S)


def _doubled(p: Sampled) -> Array:
    n = len(p.A)
    A, G, X = p.A.T.copy(), p.H.T @ np.linalg.solve(p.R, p.H), p.Q.copy()
    for _ in range(DOUBLINGS):
        solved = np.linalg.solve(np.eye(n) + G @ X, np.hstack([A, G]))
        more = A.T @ X @ solved[:, :n]
        G = G + A @ solved[:, n:] @ A.T
        A = A @ solved[:, :n]
        X, G = X + 0.5 * (more + more.T), 0.5 * (G + G.T)
        if np.abs(more).max() <= SETTLED * np.abs(X).max():
            return X
    raise ArithmeticError(UNSETTLED)


def smoothed_covariance(p: Sampled, f: Stationary) -> Array:
    """Return the covariance (N, N) of the fixed-interval smoother far from both ends (Bryson &
    Frazier's form: the information of all later innovations).
    """
    C = np.eye(len(p.A)) - f.K @ p.H
    back = p.A.T  # information after a measurement -> before the next sample
    gained = p.H.T @ np.linalg.solve(f.S, p.H)
    later = solve_discrete_lyapunov(back @ C.T, back @ gained @ back.T)
    return np.asarray(f.P - f.P @ later @ f.P)
