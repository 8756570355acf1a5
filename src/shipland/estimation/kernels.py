"""Arithmetic of the filters, compiled: mean and covariance through a step and its inputs, a measurement's gain.

Each does what its name says in textbook form, the large ones in place; the tests hold it against that form in NumPy.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shipland.compiled import compiled
from shipland.frames import Array

Steps = tuple[Array, Array, npt.NDArray[np.int64]]
"""Matrices (4,n,n) of one axis over whole milliseconds: over powers of two, over lengths asked for, which those are.

Transition, noise, input filled up with zeros on its right, and the part of the noise that the axes share.
"""
Way = tuple[float, int, Steps, Array, Array, int, float]
"""Begin [s], whole milliseconds, matrices, (axes, axes) shares of the common noise; history and count of the inputs as
in `mean_input`; the ship's turn [rad/s]. In one tuple, which compiled code takes faster than so many arguments.
"""

STRIDE_MS = 80
"""Longest step of the mean through inputs: they are averaged over it."""
LONGEST_MS = (1 << 20) - 1
"""Longest way at once: a quarter of an hour."""
_KEPT = 128
"""Lengths whose matrices are kept: all up to a stride, and of the others the newest."""


def steps_from(one: Array) -> Steps:
    """From the matrices (4,n,n) of a millisecond."""
    powers = np.zeros((LONGEST_MS.bit_length(), *one.shape))
    powers[0] = one
    for half, whole in pairwise(powers):
        compose(half, half, whole)
    return powers, np.empty((_KEPT, *one.shape)), np.full(_KEPT, -1)


@compiled
def matrices_of(steps: Steps, step_ms: int) -> Array:
    """(4,n,n) over so many milliseconds; composed of powers of two, far cheaper than matrix exponentials, and kept."""
    powers, kept, lengths = steps
    slot = step_ms
    if step_ms > STRIDE_MS:
        slot = STRIDE_MS + 1 + step_ms % (len(kept) - STRIDE_MS - 1)
    result: Array = kept[slot]
    if lengths[slot] != step_ms:
        result[:], lengths[slot], made = 0.0, step_ms, False
        for i in range(result.shape[1]):
            result[0, i, i] = 1.0
        for bit in range(len(powers)):
            if (step_ms >> bit) & 1:
                then = result.copy()
                if made:
                    result[:] = 0.0
                    compose(powers[bit], then, result)
                else:
                    result[:], made = powers[bit], True
    return result


@compiled
def predicted_covariance(transition: Array, covariance: Array, noise: Array) -> Array:
    """F P Fᵀ + Q of (n,n) matrices; F has few entries, and P is symmetric."""
    result = np.empty(noise.shape)
    _write_predicted(result, transition, covariance, noise)
    return result


@compiled
def _write_predicted(result: Array, transition: Array, covariance: Array, noise: Array) -> None:
    n = len(covariance)
    moved, across = np.zeros((n, n)), np.empty((n, n))
    _add_product(moved, transition, covariance)
    for i in range(n):
        for j in range(n):
            across[i, j], result[i, j] = moved[j, i], noise[i, j]
    _add_product(result, transition, across)


@compiled
def _add_product(total: Array, matrix: Array, other: Array) -> None:
    for i in range(len(matrix)):
        for k in range(len(other)):
            entry = matrix[i, k]
            if entry != 0.0:
                for j in range(other.shape[1]):
                    total[i, j] += entry * other[k, j]


@compiled
def add_input(history: Array, count: int, from_s: float, value: Array) -> None:
    """Fill the row after the last one of a history as `mean_input` reads it; it holds no earlier than that."""
    size, last, row = len(value), history[count - 1], history[count]
    from_s = max(from_s, last[0])
    row[0] = from_s
    for i in range(size):
        row[1 + i] = value[i]
        row[1 + size + i] = last[1 + size + i]
        if count > 1:
            row[1 + size + i] += (from_s - last[0]) * last[1 + i]


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
def propagate(mean: Array, covariance: Array, way: Way, speed: int, bias: int) -> None:
    """Move an estimate of equal axes, mean (axes × n,) and its covariance, in place.

    The mean x ← F x + G ū goes stride by stride, with ū averaged over each, because the input changes; the covariance
    P ← F P Fᵀ + Q at once.

    Args:
        mean: axis by axis.
        covariance: of it.
        way: in time.
        speed: state of an axis, of its velocity, with
        bias: the velocity bias, as the turn of a ship changes them; see `_turn`.
    """
    t_s, total_ms, steps, shares, history, count, turn_rad_s = way
    if total_ms == 0:
        return
    axes, states = len(shares), len(mean) // len(shares)
    strides = total_ms // STRIDE_MS
    for index in range(strides + 1):
        step_ms = STRIDE_MS if index < strides else total_ms % STRIDE_MS
        if step_ms > 0:
            step = matrices_of(steps, step_ms)
            after_s = t_s + 1e-3 * step_ms
            given = mean_input(history, count, t_s, after_s)
            for axis in range(axes):
                _step_mean(mean[axis * states : (axis + 1) * states], step, given, axis, axes)
            if turn_rad_s != 0.0:
                _turn(mean, turn_rad_s, speed, bias, states, 1e-3 * step_ms)
            t_s = after_s
    propagate_covariance(covariance, matrices_of(steps, total_ms), shares)


@compiled
def _step_mean(own: Array, step: Array, given: Array, axis: int, axes: int) -> None:
    """The mean of one of so many axes, in place."""
    states = len(own)
    before = own.copy()
    for i in range(states):
        moved = pushed = 0.0
        for k in range(states):
            moved += step[0, i, k] * before[k]
        for k in range(len(given) // axes):
            pushed += step[2, i, k] * given[axis + k * axes]
        own[i] = moved + pushed


@compiled
def propagate_covariance(covariance: Array, step: Array, shares: Array) -> None:
    """P ← F P Fᵀ + Q in place, of equal axes.

    Args:
        covariance: (axes × n, axes × n).
        step: (4,n,n) as in `Steps`.
        shares: (axes, axes) of the common noise.
    """
    axes, states = len(shares), step.shape[1]
    moved = np.zeros_like(covariance)
    for first in range(0, len(covariance), states):
        _add_product(moved[first : first + states], step[0], covariance[first : first + states])
    moved = moved.T.copy()
    for i in range(axes):
        for j in range(axes):
            for row in range(states):
                for column in range(states):
                    noise = shares[i, j] * step[3, row, column] + (step[1, row, column] if i == j else 0.0)
                    covariance[i * states + row, j * states + column] = noise
    for first in range(0, len(covariance), states):
        _add_product(covariance[first : first + states], step[0], moved[first : first + states])


@compiled
def compose(first: Array, then: Array, both: Array) -> None:
    """Write the matrices (4,n,n) of two steps, one after the other, over zeros; in the order of `Steps`."""
    _add_product(both[0], then[0], first[0])
    for i in range(len(first[2])):
        for j in range(len(first[2])):
            both[2, i, j] = then[2, i, j]
    _add_product(both[2], then[0], first[2])
    for kind in (1, 3):
        _write_predicted(both[kind], then[0], first[kind], then[kind])


@compiled
def _through(matrix: Array, vector: Array) -> Array:
    result = np.zeros(len(matrix))
    for i in range(len(matrix)):
        for k in range(len(vector)):
            result[i] += matrix[i, k] * vector[k]
    return result


@compiled
def _turn(mean: Array, turn_rad_s: float, speed: int, bias: int, states: int, step_s: float) -> None:
    """A ship that turns: its velocity, in the velocity bias, turns with it, and the aircraft's own speed does not.

    The acceleration by the mean wind, relative to the ship's velocity, stays as it is.
    """
    ahead, aside = mean[bias], mean[states + bias]
    if math.isfinite(ahead) and math.isfinite(aside):
        change, change_aside = -turn_rad_s * aside * step_s, turn_rad_s * ahead * step_s
        mean[bias] += change
        mean[speed] -= change
        mean[states + bias] += change_aside
        mean[states + speed] -= change_aside


@compiled
def correct(mean: Array, covariance: Array, jacobian: Array, innovation: Array, noise: Array, gate: float) -> float:
    """The Kalman filter's measurement update in place, unless gated out; the normalised innovation νᵀ S⁻¹ ν.

    With S = H P Hᵀ + R and K = P Hᵀ S⁻¹: x + K ν and P − K S Kᵀ.

    Args:
        mean: (n,).
        covariance: (n,n).
        jacobian: H (m,n).
        innovation: ν (m,).
        noise: R (m,m).
        gate: largest normalised innovation that is taken; one that is no number is not.
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
    for a in range(m):
        normalised += innovation[a] * weighted[a]
    if not normalised <= gate:
        return normalised
    for a in range(m):
        for i in range(n):
            mean[i] += crossed[a, i] * weighted[a]
            gain = 0.0
            for b in range(m):
                gain += inverse[a, b] * crossed[b, i]
            for j in range(n):
                covariance[i, j] -= gain * crossed[a, j]
    for i in range(n):
        for j in range(i):
            covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i])
    return normalised


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
def see_bank(
    mean: Array,
    covariance: Array,
    score: Array,
    steps: tuple[Array, Array],
    moved_m: float,
    down_m: float,
    variance: float,
) -> None:
    """Move all hypotheses of a `WaveBank` in place through a step and a picture's height, which is height less wave.

    Args:
        mean: (k,n) height, drift, wave motion and its other states.
        covariance: (k,n,n).
        score: (k,) log-likelihoods, faded already.
        steps: (k,n,n) transitions and (k,n,n) noises.
        moved_m: downward, by the sticks.
        down_m: the height in the picture.
        variance: of its error [m²].
    """
    for h in range(len(mean)):
        x = _through(steps[0][h], mean[h])
        x[0] += moved_m
        p = predicted_covariance(steps[0][h], covariance[h], steps[1][h])
        crossed = p[:, 0] - p[:, 2]
        innovation_variance = crossed[0] - crossed[2] + variance
        innovation = down_m - (x[0] - x[2])
        for i in range(mean.shape[1]):
            gain = crossed[i] / innovation_variance
            mean[h, i] = x[i] + gain * innovation
            for j in range(mean.shape[1]):
                covariance[h, i, j] = p[i, j] - gain * crossed[j]
        score[h] -= 0.5 * (min(innovation**2 / innovation_variance, 25.0) + math.log(innovation_variance))
