"""Arithmetic of the filters, compiled: a covariance through a step, a mean through its inputs, a measurement's gain.

Each does what its name says in textbook form; the tests hold it against that form in NumPy.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.compiled import compiled
from shipland.frames import Array

Turn = tuple[float, int, int, int]

STRIDE_MS = 80
"""Longest step of the mean through inputs: they are averaged over it."""


@compiled
def predicted_covariance(transition: Array, covariance: Array, noise: Array) -> Array:
    """F P Fᵀ + Q of (n,n) matrices; F has few entries, and P is symmetric."""
    n = len(covariance)
    moved = np.zeros((n, n))
    _add_product(moved, transition, covariance)
    moved, result = moved.T.copy(), noise.copy()
    _add_product(result, transition, moved)
    return result


@compiled
def _add_product(total: Array, matrix: Array, other: Array) -> None:
    for i in range(len(matrix)):
        for k in range(len(other)):
            entry = matrix[i, k]
            if entry != 0.0:
                for j in range(other.shape[1]):
                    total[i, j] += entry * other[k, j]


@compiled
def add_input(history: Array, count: int, from_s: float, value: Array) -> float:
    """Fill the row after the last one of a history as `mean_input` reads it; since when it holds."""
    size, last, row = len(value), history[count - 1], history[count]
    from_s = max(from_s, last[0])
    row[0] = from_s
    for i in range(size):
        row[1 + i] = value[i]
        row[1 + size + i] = last[1 + size + i]
        if count > 1:
            row[1 + size + i] += (from_s - last[0]) * last[1 + i]
    return from_s


@compiled
def mean_input(history: Array, count: int, from_s: float, to_s: float) -> Array:
    """(size,) average of what `Inputs` keeps over an interval; the value at its begin where it is empty.

    Args:
        history: (rows, 1 + 2 × size) since when, the value, and the integral of all before it.
        count: rows that are filled.
        from_s: begin of the interval.
        to_s: its end.
    """
    size = (history.shape[1] - 1) // 2
    if to_s - from_s < 1e-6:
        return history[max(_row_at(history, count, from_s), 0), 1 : 1 + size].copy()
    return (_integral(history, count, to_s) - _integral(history, count, from_s)) / (to_s - from_s)


@compiled
def _row_at(history: Array, count: int, t_s: float) -> int:
    """The last row that does not begin after `t_s`; -1 where all do."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if t_s < history[middle, 0]:
            high = middle
        else:
            low = middle + 1
    return low - 1


@compiled
def _integral(history: Array, count: int, t_s: float) -> Array:
    size = (history.shape[1] - 1) // 2
    row = max(_row_at(history, count, t_s), 0)
    passed_s = t_s - history[row, 0]
    if history[row, 0] < -1e8:
        passed_s = 0.0  # before the first command nothing was given
    result: Array = history[row, 1 + size :] + passed_s * history[row, 1 : 1 + size]
    return result


@compiled
def mean_after(
    mean: Array, t_s: float, propagator: Array, total_ms: int, history: Array, count: int, turn: Turn
) -> Array:
    """The mean through an input that changes: x ← F x + G ū, stride by stride, ū averaged over each.

    Args:
        mean: (n,).
        t_s: when it holds.
        propagator: matrices of `Model.propagator`.
        total_ms: whole milliseconds.
        history: of the inputs, with
        count: as in `mean_input`.
        turn: the ship's turn [rad/s], and for two axes the states (VELOCITY, VELOCITY_BIAS, STATES); see `_turned`.
    """
    whole, rest_ms = total_ms // STRIDE_MS, total_ms % STRIDE_MS
    transition, push = propagator[0], propagator[2]
    if whole > 0:
        transition, push = propagator[3], propagator[4]
    for index in range(whole + 1):
        step_ms = STRIDE_MS
        if index == whole:
            step_ms = rest_ms
            if whole > 0:
                transition, push = propagator[5], propagator[6]
        if step_ms > 0:
            after_s = t_s + 1e-3 * step_ms
            mean = _through(transition, mean) + _through(push, mean_input(history, count, t_s, after_s))
            _turned(mean, turn, 1e-3 * step_ms)
            t_s = after_s
    return mean


@compiled
def _through(matrix: Array, vector: Array) -> Array:
    result = np.zeros(len(matrix))
    for i in range(len(matrix)):
        for k in range(len(vector)):
            result[i] += matrix[i, k] * vector[k]
    return result


@compiled
def _turned(mean: Array, turn: Turn, step_s: float) -> None:
    """A ship that turns: its velocity, in the velocity bias, turns with it, and the aircraft's own speed does not.

    The acceleration by the mean wind, relative to the ship's velocity, stays as it is.
    """
    turn_rad_s, speed, bias, states = turn
    if turn_rad_s == 0.0:
        return
    ahead, aside = mean[bias], mean[states + bias]
    if math.isfinite(ahead) and math.isfinite(aside):
        change, change_aside = -turn_rad_s * aside * step_s, turn_rad_s * ahead * step_s
        mean[bias] += change
        mean[speed] -= change
        mean[states + bias] += change_aside
        mean[states + speed] -= change_aside


@compiled
def corrected(
    mean: Array, covariance: Array, jacobian: Array, innovation: Array, noise: Array
) -> tuple[Array, Array, float]:
    """The Kalman filter's measurement update: mean (n,) and covariance (n,n) after it, and νᵀ S⁻¹ ν.

    With S = H P Hᵀ + R and K = P Hᵀ S⁻¹: x + K ν and P − K S Kᵀ.

    Args:
        mean: before.
        covariance: before.
        jacobian: H (m,n).
        innovation: ν (m,).
        noise: R (m,m).
    """
    m, n = jacobian.shape
    crossed = np.zeros((m, n))
    _add_product(crossed, jacobian, covariance)
    innovation_covariance = noise.copy()
    for a in range(m):
        for b in range(m):
            for k in range(n):
                innovation_covariance[a, b] += jacobian[b, k] * crossed[a, k]
    inverse = _inverse(innovation_covariance)
    weighted = _through(inverse, innovation)
    normalised = 0.0
    after, result = mean.copy(), covariance.copy()
    for a in range(m):
        normalised += innovation[a] * weighted[a]
        for i in range(n):
            after[i] += crossed[a, i] * weighted[a]
            gain = 0.0
            for b in range(m):
                gain += inverse[a, b] * crossed[b, i]
            for j in range(n):
                result[i, j] -= gain * crossed[a, j]
    for i in range(n):
        for j in range(i):
            result[i, j] = result[j, i] = 0.5 * (result[i, j] + result[j, i])
    return after, result, normalised


@compiled
def _inverse(matrix: Array) -> Array:
    """Of a small symmetric positive definite matrix (Gauss and Jordan); not finite where it is none."""
    n = len(matrix)
    left, right = matrix.copy(), np.eye(n)
    for k in range(n):
        pivot = left[k, k]
        for j in range(n):
            left[k, j] /= pivot
            right[k, j] /= pivot
        for i in range(n):
            if i != k:
                share = left[i, k]
                for j in range(n):
                    left[i, j] -= share * left[k, j]
                    right[i, j] -= share * right[k, j]
    return right


@compiled
def bank_seen(
    mean: Array,
    covariance: Array,
    score: Array,
    transition: Array,
    noise: Array,
    moved_m: float,
    down_m: float,
    variance: float,
) -> tuple[Array, Array, Array]:
    """All hypotheses of a `WaveBank` through a step and a picture's height, which is height less wave.

    Args:
        mean: (k,n) height, drift, wave motion and its other states.
        covariance: (k,n,n).
        score: (k,) log-likelihoods, faded already.
        transition: (k,n,n) of the step.
        noise: (k,n,n) likewise.
        moved_m: downward, by the sticks.
        down_m: the height in the picture.
        variance: of its error [m²].
    """
    mean_after, covariance_after, score_after = np.empty_like(mean), np.empty_like(covariance), np.empty_like(score)
    for h in range(len(mean)):
        x = _through(transition[h], mean[h])
        x[0] += moved_m
        p = predicted_covariance(transition[h], covariance[h], noise[h])
        crossed = p[:, 0] - p[:, 2]
        innovation_variance = crossed[0] - crossed[2] + variance
        innovation = down_m - (x[0] - x[2])
        for i in range(mean.shape[1]):
            gain = crossed[i] / innovation_variance
            mean_after[h, i] = x[i] + gain * innovation
            for j in range(mean.shape[1]):
                covariance_after[h, i, j] = p[i, j] - gain * crossed[j]
        score_after[h] = score[h] - 0.5 * (
            min(innovation**2 / innovation_variance, 25.0) + math.log(innovation_variance)
        )
    return mean_after, covariance_after, score_after
