"""The pose that corner errors lead to, found from the true one; unrolled and compiled for campaigns.

The solver of `vision.near.pose` minimises the whitened residuals of corners and level prior. A few Gauss-Newton steps
from the true pose end in the same minimum; what they leave out is another planar solution. The solver is this file's
test.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.frames import Array
from shipland.vision.near.planar_pose import exp_rotation

_STEPS = 3
"""Gauss-Newton steps: quadratic convergence from a true pose."""


class CornerMeasurement(NamedTuple):
    """The cue's corners as a camera measured them, and the vertical as the gimbal has it.

    Attributes:
        plane_m: (n,2) corners, right and down in the plane.
        matrix: (3,3) of an ideal camera.
        corners_px: (n,2) measured.
        sigma_px: their standard deviation.
        down_in_camera: (3,) the plane's down axis as the gimbal has it, a unit vector.
        level_rad: what that is known to; 0 for not at all.
    """

    plane_m: Array
    matrix: Array
    corners_px: Array
    sigma_px: float
    down_in_camera: Array
    level_rad: float


@compiled
def relative_pose(
    ned_from_camera: Array, camera_in_ned_m: Array, ned_from_bar: Array, bar_in_ned_m: Array
) -> tuple[Array, Array]:
    """Rotation (3,3) and translation (3,) [m] camera_from_plane: `plane` is `bar` with axes right, down, forward."""
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += ned_from_camera[k, i] * (bar_in_ned_m[k] - camera_in_ned_m[k])
        translation[i] = total
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += ned_from_camera[k, i] * ned_from_bar[k, (j + 1) % 3]
            rotation[i, j] = total
    return rotation, translation


@compiled
def projected(rotation: Array, translation_m: Array, plane_m: Array, matrix: Array) -> Array:
    """(n,2) pixels of points (n,2) of the plane in an ideal camera; NaN for those not in front of it."""
    pixels = np.empty((len(plane_m), 2))
    for i in range(len(plane_m)):
        right, down = plane_m[i]
        x = rotation[0, 0] * right + rotation[0, 1] * down + translation_m[0]
        y = rotation[1, 0] * right + rotation[1, 1] * down + translation_m[1]
        z = rotation[2, 0] * right + rotation[2, 1] * down + translation_m[2]
        near = 1.0 / z if z > 1e-9 else math.nan
        pixels[i, 0] = matrix[0, 0] * x * near + matrix[0, 1] * y * near + matrix[0, 2]
        pixels[i, 1] = matrix[1, 1] * y * near + matrix[1, 2]
    return pixels


@compiled
def inside(corners_px: Array, low_px: float, high_px: Array) -> bool:
    """Whether points (n,2) lie between a lowest column and row and the highest (2,); NaN does not."""
    for i in range(len(corners_px)):
        for k in range(2):
            if not low_px <= corners_px[i, k] <= high_px[k]:
                return False
    return True


@compiled
def pose_from_truth(
    rotation: Array, translation_m: Array, measured: CornerMeasurement
) -> tuple[bool, Array, Array, float, Array, Array]:
    """The pose that a solver would find: Gauss-Newton steps from the true one.

    Args:
        rotation: (3,3) of the true camera_from_plane.
        translation_m: (3,) of the same.
        measured: see there.

    Returns:
        Whether the corners settle it; rotation and translation found; χ²; (6,6) covariance of the left rotation vector
        and the translation, both in `camera`; (n,2) reprojected minus measured [px].
    """
    covariance, settled = np.zeros((6, 6)), False
    for _ in range(_STEPS):
        partial, residual = _linearised(rotation, translation_m, measured)
        covariance, settled = _inverse_gram(partial)
        step = np.zeros(6)
        for k in range(len(residual)):
            for i in range(6):
                for j in range(6):
                    step[i] -= covariance[i, j] * partial[k, j] * residual[k]
        rotation, translation_m = exp_rotation(step[:3], rotation), translation_m + step[3:]
    residual_px = projected(rotation, translation_m, measured.plane_m, measured.matrix) - measured.corners_px
    # The last step's χ² is that of its linear model: the next residual would cost a linearisation for the prior's sake.
    chi2 = 0.0
    for k in range(len(residual)):
        left = residual[k]
        for j in range(6):
            left += partial[k, j] * step[j]
        chi2 += left * left
    return settled, rotation, translation_m, chi2, covariance, residual_px


@compiled
def _linearised(rotation: Array, translation_m: Array, measured: CornerMeasurement) -> tuple[Array, Array]:
    """Jacobian (2n+3,6) and residual (2n+3,) in standard deviations; the last three rows are the level prior's."""
    plane_m, matrix, corners_px, sigma_px, down_in_camera, level_rad = measured
    count = len(plane_m)
    partial, residual = np.zeros((2 * count + 3, 6)), np.zeros(2 * count + 3)
    fx, skew, fy = matrix[0, 0] / sigma_px, matrix[0, 1] / sigma_px, matrix[1, 1] / sigma_px
    predicted_px = projected(rotation, translation_m, plane_m, matrix)
    for i in range(count):
        right, down = plane_m[i]
        x = rotation[0, 0] * right + rotation[0, 1] * down
        y = rotation[1, 0] * right + rotation[1, 1] * down
        z = rotation[2, 0] * right + rotation[2, 1] * down
        near = 1.0 / (z + translation_m[2])
        u, v = (x + translation_m[0]) * near, (y + translation_m[1]) * near
        x, y, z = x * near, y * near, z * near
        across = (-y * u, x * u + z, -y, near, 0.0, -near * u)
        along = (-y * v - z, x * v, x, 0.0, near, -near * v)
        for j in range(6):
            partial[2 * i, j] = fx * across[j] + skew * along[j]
            partial[2 * i + 1, j] = fy * along[j]
        for j in range(2):
            residual[2 * i + j] = (predicted_px[i, j] - corners_px[i, j]) / sigma_px
    if level_rad > 0.0:
        # The cross product of the gimbal's down and the plane's, which turns with the camera, should be zero.
        a, b, c = rotation[0, 1], rotation[1, 1], rotation[2, 1]
        d, e, f = down_in_camera
        crossed = (e * c - f * b, f * a - d * c, d * b - e * a)
        turning = ((e * b + f * c, -e * a, -f * a), (-d * b, f * c + d * a, -f * b), (-d * c, -e * c, d * a + e * b))
        for k in range(3):
            residual[2 * count + k] = crossed[k] / level_rad
            for j in range(3):
                partial[2 * count + k, j] = turning[k][j] / level_rad
    return partial, residual


@compiled
def _inverse_gram(partial: Array) -> tuple[Array, bool]:
    """(JᵀJ)⁻¹ of J (m,6) by its Cholesky factor, and whether there is one."""
    lower, inverse = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(partial)):
                total += partial[k, i] * partial[k, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return inverse, False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    columns = np.zeros((6, 6))  # the factor's inverse
    for j in range(6):
        for i in range(j, 6):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= lower[i, k] * columns[k, j]
            columns[i, j] = total / lower[i, i]
    for i in range(6):
        for j in range(6):
            total = 0.0
            for k in range(max(i, j), 6):
                total += columns[k, i] * columns[k, j]
            inverse[i, j] = total
    return inverse, True
