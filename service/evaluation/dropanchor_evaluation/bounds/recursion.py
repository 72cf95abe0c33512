"""The recursion of the posterior Cramér-Rao bound for a sparse linear model (Tichavský, Muravchik and Nehorai 1998).

It is that of a Kalman filter's covariance with the Jacobians at the truth. Measurements are scalar and
independent. The same gains carry the errors of estimators whose noise is drawn: an efficient estimator has such errors.
"""

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import Array


@njit(cache=True)
def recursion(
    P: Array,
    fresh: Array,
    growth: Array,
    moves: Array,
    by: Array,
    firsts: Array,
    states: Array,
    h: Array,
    R: Array,
    draws: int,
    seed: int,
) -> tuple[Array, Array]:
    """Return E[(x - x̂)² + (y - ŷ)²] after each instant, (n,), and the errors of `draws` estimators, (n, draws, 2).

    P: (d, d) prior; x and y are states 0 and 1. fresh: (d,) whether a state is drawn anew at every instant. growth:
    (n, d) added variance. moves, by: (e, 2) indices (to, from) and (n, e) entries of F - I. Measurement k has the
    states[firsts[k]:firsts[k + 1]] with the coefficients h in the same columns, (n, …), and the variance R[:, k], where
    inf means none.
    """
    np.random.seed(seed)
    n, d = growth.shape
    prior = np.diag(P).copy()
    P = P.copy()
    errors = np.sqrt(prior).reshape(-1, 1) * np.random.standard_normal((d, draws))
    Ph, innovation = np.empty(d), np.empty(draws)
    bound, drawn = np.empty(n), np.empty((n, draws, 2))
    for i in range(n):
        if i > 0:
            _redraw(P, errors, fresh, prior)
            _step(P, errors, moves, by[i])
            _grow(P, errors, growth[i])
        for k in range(R.shape[1]):
            if np.isfinite(R[i, k]):
                own = slice(firsts[k], firsts[k + 1])
                _measure(P, errors, states[own], h[i, own], R[i, k], Ph, innovation)
        bound[i] = P[0, 0] + P[1, 1]
        drawn[i] = errors[:2].T
    return bound, drawn


@njit(cache=True)
def _redraw(P: Array, errors: Array, fresh: Array, prior: Array) -> None:
    for j in range(len(fresh)):
        if fresh[j]:
            P[j, :] = 0.0
            P[:, j] = 0.0
            P[j, j] = prior[j]
            for m in range(errors.shape[1]):
                errors[j, m] = np.sqrt(prior[j]) * np.random.standard_normal()


@njit(cache=True)
def _step(P: Array, errors: Array, moves: Array, by: Array) -> None:
    """Replace P with F P Fᵀ and the errors with F times them."""
    before, moved = P.copy(), errors.copy()
    for e in range(len(moves)):
        _add(P[moves[e, 0]], by[e], before[moves[e, 1]])
        _add(errors[moves[e, 0]], by[e], moved[moves[e, 1]])
    half = P.copy()
    for e in range(len(moves)):
        _add(P[:, moves[e, 0]], by[e], half[:, moves[e, 1]])


@njit(cache=True)
def _grow(P: Array, errors: Array, growth: Array) -> None:
    for j in range(len(growth)):
        if growth[j] > 0.0:
            P[j, j] += growth[j]
            for m in range(errors.shape[1]):
                errors[j, m] += np.sqrt(growth[j]) * np.random.standard_normal()


@njit(cache=True)
def _measure(P: Array, errors: Array, states: Array, h: Array, R: float, Ph: Array, innovation: Array) -> None:
    """Update P and the errors with one measurement. Ph and innovation are room for (d,) and (draws,)."""
    for m in range(len(innovation)):
        innovation[m] = np.sqrt(R) * np.random.standard_normal()
        for j in range(len(states)):
            innovation[m] -= h[j] * errors[states[j], m]
    Ph[:] = 0.0
    for j in range(len(states)):
        for b in range(len(P)):
            Ph[b] += h[j] * P[states[j], b]
    S = R
    for j in range(len(states)):
        S += h[j] * Ph[states[j]]
    for a in range(len(P)):
        K = Ph[a] / S
        for b in range(len(P)):  # without views of rows, which would cost more than the sums
            P[a, b] -= K * Ph[b]
        for m in range(len(innovation)):
            errors[a, m] += K * innovation[m]


@njit(cache=True)
def _add(to: Array, factor: float, what: Array) -> None:
    for j in range(len(to)):
        to[j] += factor * what[j]
