"""The planar pose solver: both planar solutions of measured corners, refined, with their covariance.

Frame `plane`: the cue's, with OpenCV-like axes right, down, forward; `plane` = CAMERA_FROM_MOUNT · `bar`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.frames import Array, Pose

_STEPS = 8
"""Most Levenberg–Marquardt steps; three or four are usual."""

_GAIN_DONE = 0.03
"""A step that is expected to lower χ² by less than this is the last one."""

_DAMPING = 1e-3
"""Of the first Levenberg–Marquardt step from a closed-form start."""

_HELD = 1e3
"""Weight that holds the angle about an axis, as a multiple of all the information on the pose."""

NO_COMMON_ERROR = np.zeros(0)
"""`Solution.common` of corners without errors in common."""

_TRUST = 2.0
"""Degrees of freedom that the stated covariance of the corners weighs, against their own misfit."""

_NUDGE = 1e-7
"""Offset of the rays for a second try: OpenCV's IPPE divides zero by zero on exact pixels of some symmetrical views."""

DOUBTFUL_CHI2 = 2.5
"""χ² a coordinate from which a followed pose is not trusted."""

CONTRADICTION_CHI2 = 25.0
"""χ² that leaving the prior out must gain, in units of `Solution.excess` without it: five standard deviations between
the verticals of cue and gimbal."""

_LEAST_OFF_COSINE = float(np.cos(np.radians(2.0)))
"""A smaller angle to the gimbal's vertical proves nothing: an unknown rolling shutter tilts the cue by 1.2° at 9°/s of
yaw, and systematic errors of the corners tilted it by 0.7° in a rendered landing. A gimbal off by 2° moves the height
by 0.13 m at 4 m."""

DISPROVED = 4.0
"""Excess of χ² from which the corners' stated covariance is given up: their error is twice as large. Such corners prove
nothing against the gimbal."""

_ANOTHER_CUE_COSINE = float(np.cos(np.radians(30.0)))
"""A larger angle is not a wrong prior but another cue, of other proportions."""

_CLEAR_CHI2 = 9.0
"""χ² by which one planar solution must fit better to be taken against continuity."""


@dataclass(frozen=True)
class Corners:
    """Measured corners and their covariance.

    Attributes:
        undistorted_px: (n,4,2) as a distortion-free camera would see them.
        whiten: (n,8,8) what turns deviations of a quadrilateral's (column, row) × four corners into standard
            deviations [1/px]: the inverse of a square root of their covariance.
        plane_m: (n,4,2) the same corners in the cue's plane (right, down) [m].
        common_px: (m,n,4,2) errors that all corners may have in common, each at one standard deviation; None for none.
    """

    undistorted_px: Array
    whiten: Array
    plane_m: Array
    common_px: Array | None = None


@dataclass(frozen=True)
class LevelPrior:
    """The direction of `bar`'s down axis in `camera` by the gimbal, with its noise.

    Attributes:
        down_in_camera: (3,) unit vector.
        noise_rad: standard deviation about either perpendicular axis.
    """

    down_in_camera: Array
    noise_rad: float


@dataclass(frozen=True)
class Solution:
    """One pose that solves the corners.

    Attributes:
        camera_from_plane: the pose.
        chi2: weighted sum of squared residuals, the prior's included.
        covariance: (6,6) of the left rotation vector [rad] and translation [m], both in `camera`.
        common: (m,) errors that all corners have in common, in standard deviations of each.
        residual_px: (n,4,2) reprojected minus measured, once the measured are freed of the common errors.
        freedom: residuals less unknowns.
        level_off_rad: angle of the cue's vertical to the prior's, where that contradicted the corners and was left out.
    """

    camera_from_plane: Pose
    chi2: float
    covariance: Array
    common: Array
    residual_px: Array
    freedom: int
    level_off_rad: float = 0.0

    @property
    def excess(self) -> float:
        """Factor by which the corners' stated variance is too small: χ² a degree of freedom, regularised; 1 or more."""
        return max((self.chi2 + _TRUST) / (self.freedom + _TRUST), 1.0)

    @property
    def reprojection_px(self) -> float:
        """Root-mean-square distance of observed and reprojected corners."""
        return math.sqrt(2.0 * float(np.vdot(self.residual_px, self.residual_px)) / self.residual_px.size)


def solve(
    corners: Corners, camera: Camera, prior: LevelPrior | None = None, near: Pose | None = None
) -> list[Solution]:
    """The one or two poses that solve the corners, better first; empty when none does.

    IPPE gives both planar solutions, Levenberg–Marquardt refines them [Lee2022, §Pose Estimation]. A prior that the
    corners contradict is left out; the solutions then say by how much (`Solution.level_off_rad`).

    Args:
        corners: measured.
        camera: intrinsics.
        prior: the gimbal's vertical.
        near: a pose (camera_from_plane) not far off; with a prior, which leaves no second solution, the refinement
            starts from it.
    """
    solutions: list[Solution] = []
    if prior is not None and near is not None:
        followed = _followed(corners, camera, prior, near)
        if followed is not None and followed.chi2 < DOUBTFUL_CHI2 * corners.plane_m.size:
            solutions = [followed]
    solutions = solutions or _solve(corners, camera, prior)
    if prior is None or not solutions or solutions[0].chi2 <= CONTRADICTION_CHI2:
        return solutions
    free = _solve(corners, camera, None)
    off_rad = level_off(solutions[0], free[0], prior) if free else 0.0
    return [replace(solution, level_off_rad=off_rad) for solution in free] if off_rad > 0.0 else solutions


def level_off(held: Solution, free: Solution, prior: LevelPrior) -> float:
    """Angle by which the corners contradict the gimbal's vertical [rad]; 0 where they may agree.

    Args:
        held: the pose that solves corners and prior.
        free: the pose that solves the corners alone.
        prior: the gimbal's vertical.
    """
    cosine = float(free.camera_from_plane.rotation[:, 1] @ prior.down_in_camera)
    contradicted = (
        free.excess < DISPROVED
        and held.chi2 - free.chi2 > CONTRADICTION_CHI2 * free.excess
        and _ANOTHER_CUE_COSINE < cosine < _LEAST_OFF_COSINE
    )
    return math.acos(min(cosine, 1.0)) if contradicted else 0.0


def ordered(solutions: list[Solution], last: Pose | None) -> list[Solution]:
    """The planar solutions, the one to take first: by fit where that is clear, else by continuity with `last`."""
    if len(solutions) < 2 or last is None:
        return solutions
    if solutions[1].chi2 - solutions[0].chi2 > _CLEAR_CHI2 * solutions[0].excess:
        return solutions
    return sorted(solutions, key=lambda s: -float(np.sum(s.camera_from_plane.rotation * last.rotation)))


def bound(camera_from_plane: Pose, corners: Corners, camera: Camera, prior: LevelPrior | None = None) -> Solution:
    """The Cramér–Rao bound at a known pose: its `covariance` is the least that unbiased estimates can have.

    Args:
        camera_from_plane: the true pose.
        corners: noise and model; the measured pixels do not matter.
        camera: intrinsics.
        prior: the gimbal's vertical.
    """
    problem = problem_of(corners, camera, prior)
    gram, residual = np.empty((7, 7)), np.empty((problem.plane.shape[0], 2))
    _linearise(problem, camera_from_plane.rotation, camera_from_plane.translation_m, gram, residual)
    solution = _solution(problem, corners, prior, camera_from_plane, gram, residual)
    if solution is None:
        raise np.linalg.LinAlgError("the corners do not determine the pose")
    return solution


def _solve(corners: Corners, camera: Camera, prior: LevelPrior | None) -> list[Solution]:
    import cv2  # see `camera`

    problem = problem_of(corners, camera, prior)
    places = np.column_stack([problem.plane, np.zeros(len(problem.plane))])
    for nudge in (0.0, _NUDGE):
        rays = problem.rays + nudge * np.sin(np.arange(problem.rays.size)).reshape(2, -1).T
        try:
            _, rotations, translations, _ = cv2.solvePnPGeneric(
                places, rays[:, None], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
            )
        except cv2.error:  # a homography that does not exist
            continue
        starts = [
            (np.asarray(cv2.Rodrigues(rotation)[0], float), np.asarray(translation, float).ravel())
            for rotation, translation in zip(rotations, translations, strict=True)
            if np.isfinite(rotation).all() and np.isfinite(translation).all() and translation[2] > 0.0
        ]
        if starts:
            refined = (_refined(problem, corners, prior, *start, _DAMPING) for start in starts)
            return sorted((found for found in refined if found is not None), key=lambda solution: solution.chi2)
    return []


def _followed(corners: Corners, camera: Camera, prior: LevelPrior, near: Pose) -> Solution | None:
    """The solution from a pose not far off; None when there is none.

    The rotation is kept for a start, with its best translation, which is linear for a known rotation.
    """
    problem, translation_m = problem_of(corners, camera, prior), np.empty(3)
    if not translate(problem, near.rotation, translation_m):
        return None
    return _refined(problem, corners, prior, near.rotation, translation_m, 0.0)


def _refined(
    problem: Problem,
    corners: Corners,
    prior: LevelPrior | None,
    rotation: Array,
    translation_m: Array,
    damping: float,
) -> Solution | None:
    """The solution from a start; None when it diverges. Without damping it starts as Gauss–Newton."""
    settled, rotation, translation_m, gram, residual = _refine(problem, rotation, translation_m, damping)
    return _solution(problem, corners, prior, Pose(rotation, translation_m), gram, residual) if settled else None


def _solution(
    problem: Problem, corners: Corners, prior: LevelPrior | None, pose: Pose, gram: Array, residual: Array
) -> Solution | None:
    """A pose with its covariance; None when the corners do not determine it."""
    covariance, common, residual_px = np.empty((6, 6)), np.empty(len(problem.common)), np.empty(corners.plane_m.shape)
    if not _conclude(problem, gram, residual, covariance, common, residual_px.reshape(-1, 2)):
        return None
    measured = int(np.count_nonzero(corners.whiten.any(axis=2)))
    freedom = max(measured - 6 + (0 if prior is None else 2) - len(common), 0)
    return Solution(pose, float(gram[6, 6]), covariance, common, residual_px, freedom)


class Problem(NamedTuple):
    """Least squares on rays (x/z, y/z) instead of pixels, whitened: every residual is one standard deviation.

    The covariance (WᵀW)⁻¹ + C Cᵀ is whitened by W and then, for one column v of V = W C after the other as the factors
    before leave it, by 1 − s sᵀ, with s = v √(1 − (1 + vᵀv)^−½) / |v|.

    Attributes:
        plane: (n,2) [m].
        rays: (n,2).
        whiten: (k,w,w) W, of a polygon's rays.
        common: (m,2n) Vᵀ.
        share: (m,2n) s.
        amplitude: (m,m) (1 + VᵀV)⁻¹.
        common_px: (m,2n) Cᵀ.
        to_pixels: (2,2) of the camera matrix.
        across: (2,3) directions across the prior's, over its deviation; 0 without one.
    """

    plane: Array
    rays: Array
    whiten: Array
    common: Array
    share: Array
    amplitude: Array
    common_px: Array
    to_pixels: Array
    across: Array


def problem_of(corners: Corners, camera: Camera, prior: LevelPrior | None) -> Problem:
    """Of measured corners and the gimbal's vertical."""
    plane_m, size = corners.plane_m, corners.plane_m.size
    common_px = np.zeros((0, size)) if corners.common_px is None else corners.common_px.reshape(-1, size)
    count, kinds = plane_m.size // 2, len(common_px)
    problem = Problem(
        plane=np.ascontiguousarray(plane_m).reshape(-1, 2),
        rays=np.empty((count, 2)),
        whiten=np.empty(corners.whiten.shape),
        common=np.empty((kinds, size)),
        share=np.empty((kinds, size)),
        amplitude=np.empty((kinds, kinds)),
        common_px=np.ascontiguousarray(common_px),
        to_pixels=np.ascontiguousarray(camera.matrix[:2, :2]),
        across=np.zeros((2, 3)),
    )
    whiten = np.ascontiguousarray(corners.whiten)
    pixels = np.ascontiguousarray(corners.undistorted_px).reshape(-1, 2)
    _whiten_rays(pixels, whiten, camera.matrix[0, 2], camera.matrix[1, 2], problem)
    _whiten_common(whiten, problem.common_px, problem.common, problem.share, problem.amplitude)
    if prior is not None:
        # Frisvad's frame, about the axis that the direction is farthest against.
        x, y, z = prior.down_in_camera.tolist()
        sign = 1.0 if z >= 0.0 else -1.0
        a = -1.0 / (sign + z)
        b = x * y * a
        problem.across[0] = 1.0 + sign * x * x * a, sign * b, -sign * x
        problem.across[1] = b, sign + y * y * a, -y
        problem.across[:] /= prior.noise_rad
    return problem


@compiled
def _whiten_rays(pixels: Array, whiten: Array, centre_u: float, centre_v: float, problem: Problem) -> None:
    """Write `rays` and `whiten` of a problem, from pixels (n,2) and what whitens these (k,w,w)."""
    wide, to_pixels, by_rays = whiten.shape[1], problem.to_pixels, problem.whiten
    for point in range(len(pixels)):
        v = (pixels[point, 1] - centre_v) / to_pixels[1, 1]
        problem.rays[point, 0] = (pixels[point, 0] - centre_u - to_pixels[0, 1] * v) / to_pixels[0, 0]
        problem.rays[point, 1] = v
    for block in range(len(whiten)):
        for row in range(wide):
            for first in range(0, wide, 2):
                of_column, of_row = whiten[block, row, first], whiten[block, row, first + 1]
                by_rays[block, row, first] = of_column * to_pixels[0, 0] + of_row * to_pixels[1, 0]
                by_rays[block, row, first + 1] = of_column * to_pixels[0, 1] + of_row * to_pixels[1, 1]


@compiled
def _whiten_common(whiten: Array, common_px: Array, common: Array, share: Array, amplitude: Array) -> None:
    """Write `common`, `share` and `amplitude` of `Problem`."""
    wide, (kinds, size) = whiten.shape[1], common_px.shape
    information = np.empty((kinds, kinds))
    for kind in range(kinds):
        for row in range(size):
            block, of_block = row // wide, row % wide
            total = 0.0
            for column in range(wide):
                total += whiten[block, of_block, column] * common_px[kind, block * wide + column]
            common[kind, row] = share[kind, row] = total
        for before in range(kind):
            _leave_out(share[before], share[kind])
        length2 = max(_dot(share[kind], share[kind]), 1e-12)
        scale = math.sqrt((1.0 - 1.0 / math.sqrt(1.0 + length2)) / length2)
        for row in range(size):
            share[kind, row] *= scale
        for other in range(kind + 1):
            information[kind, other] = _dot(common[kind], common[other]) + (1.0 if other == kind else 0.0)
    _inverse(information, 0.0, amplitude)


@compiled
def _dot(one: Array, other: Array) -> float:
    total = 0.0
    for index in range(len(one)):
        total += one[index] * other[index]
    return total


@compiled
def _leave_out(share: Array, values: Array) -> None:
    """Multiply values (n,) by 1 − s sᵀ."""
    along = _dot(share, values)
    for index in range(len(values)):
        values[index] -= along * share[index]


@compiled
def _linearise(problem: Problem, rotation: Array, translation_m: Array, gram: Array, residual: Array) -> None:
    """Write (7,7) products of the whitened Jacobian's six columns and the whitened residual, and (n,2) of the rays.

    The columns are those of a left rotation vector and of a translation, both in `camera`.
    """
    count, wide = len(problem.plane), problem.whiten.shape[1]
    size = 2 * count
    partial, columns = np.empty((7, size)), np.empty((7, size + 2))
    for point in range(count):
        right, down = problem.plane[point, 0], problem.plane[point, 1]
        x = rotation[0, 0] * right + rotation[0, 1] * down
        y = rotation[1, 0] * right + rotation[1, 1] * down
        z = rotation[2, 0] * right + rotation[2, 1] * down
        near = 1.0 / max(z + translation_m[2], 1e-6)
        u, v = (x + translation_m[0]) * near, (y + translation_m[1]) * near
        x, y, z = x * near, y * near, z * near
        residual[point, 0], residual[point, 1] = u - problem.rays[point, 0], v - problem.rays[point, 1]
        first, second = 2 * point, 2 * point + 1
        partial[0, first], partial[0, second] = -y * u, -y * v - z
        partial[1, first], partial[1, second] = x * u + z, x * v
        partial[2, first], partial[2, second] = -y, x
        partial[3, first], partial[3, second] = near, 0.0
        partial[4, first], partial[4, second] = 0.0, near
        partial[5, first], partial[5, second] = -near * u, -near * v
        partial[6, first], partial[6, second] = residual[point, 0], residual[point, 1]
    for column in range(7):
        for row in range(size):
            block, of_block = row // wide, row % wide
            total = 0.0
            for index in range(wide):
                total += problem.whiten[block, of_block, index] * partial[column, block * wide + index]
            columns[column, row] = total
        for kind in range(len(problem.share)):
            _leave_out(problem.share[kind], columns[column, :size])
    x, y, z = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    for row in range(2):
        a, b, c = problem.across[row, 0], problem.across[row, 1], problem.across[row, 2]
        columns[0, size + row], columns[1, size + row] = c * y - b * z, a * z - c * x
        columns[2, size + row], columns[6, size + row] = b * x - a * y, a * x + b * y + c * z
        columns[3, size + row] = columns[4, size + row] = columns[5, size + row] = 0.0
    for i in range(7):
        for j in range(i + 1):
            gram[i, j] = gram[j, i] = _dot(columns[i], columns[j])


@compiled
def _inverse(matrix: Array, damping: float, inverse: Array) -> bool:
    """Write the inverse (n,n) of a positive definite matrix's first rows and columns, by its Cholesky factor.

    Its diagonal counts 1 + `damping` times. False where there is no inverse.
    """
    size = len(inverse)
    lower, columns = np.empty((size, size)), np.zeros((size, size))
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j] * (1.0 + damping) if i == j else matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = total / lower[j, j]
            elif total > 0.0:
                lower[i, i] = math.sqrt(total)
            else:
                return False
    for j in range(size):
        for i in range(j, size):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= lower[i, k] * columns[k, j]
            columns[i, j] = total / lower[i, i]
    for i in range(size):
        for j in range(size):
            inverse[i, j] = 0.0
            for k in range(max(i, j), size):
                inverse[i, j] += columns[k, i] * columns[k, j]
    return True


@compiled
def translate(problem: Problem, rotation: Array, translation_m: Array) -> bool:
    """Write the (3,) translation with which rays meet the plane best, unweighted; False behind the camera."""
    count = len(problem.plane)
    aim_u = aim_v = sum_u = sum_v = scatter = forward = 0.0
    for point in range(count):
        right, down = problem.plane[point, 0], problem.plane[point, 1]
        u, v = problem.rays[point, 0], problem.rays[point, 1]
        z = rotation[2, 0] * right + rotation[2, 1] * down
        off_u = u * z - (rotation[0, 0] * right + rotation[0, 1] * down)
        off_v = v * z - (rotation[1, 0] * right + rotation[1, 1] * down)
        aim_u, aim_v, sum_u, sum_v = aim_u + off_u, aim_v + off_v, sum_u + u, sum_v + v
        scatter += u * u + v * v
        forward -= u * off_u + v * off_v
    scatter -= (sum_u * sum_u + sum_v * sum_v) / count
    forward += (sum_u * aim_u + sum_v * aim_v) / count
    if not (scatter > 0.0 and forward > 0.0):
        return False
    translation_m[2] = forward / scatter
    translation_m[0] = (aim_u + sum_u * translation_m[2]) / count
    translation_m[1] = (aim_v + sum_v * translation_m[2]) / count
    return True


@compiled
def _refine(
    problem: Problem, rotation: Array, translation_m: Array, damping: float
) -> tuple[bool, Array, Array, Array, Array]:
    """Levenberg–Marquardt from a start: whether it settles, the pose, and what `_linearise` writes near it."""
    gram, residual, inverse = np.empty((7, 7)), np.empty(problem.plane.shape), np.empty((6, 6))
    then, then_residual = np.empty((7, 7)), np.empty(problem.plane.shape)
    _linearise(problem, rotation, translation_m, gram, residual)
    for _ in range(_STEPS):
        if not _inverse(gram, damping, inverse):
            return False, rotation, translation_m, gram, residual
        turned, shifted, promised = _stepped(gram, inverse, rotation, translation_m)
        if promised < _GAIN_DONE:
            rotation, translation_m = turned, shifted
            break
        _linearise(problem, turned, shifted, then, then_residual)
        gained = gram[6, 6] - then[6, 6]
        if gained >= 0.0:
            rotation, translation_m = turned, shifted
            gram, then, residual, then_residual = then, gram, then_residual, residual
        # Near the view where both solutions merge the cost is of fourth order and Gauss–Newton oversteps.
        if gained <= 0.25 * promised:
            damping = min(max(30.0 * damping, _DAMPING), 1e6)
        elif gained > 0.75 * promised:
            damping *= 0.1
    settled = math.isfinite(gram[6, 6]) and translation_m[2] > 0.0
    return settled, rotation, translation_m, gram, residual


@compiled
def _stepped(gram: Array, inverse: Array, rotation: Array, translation_m: Array) -> tuple[Array, Array, float]:
    """The pose after a Newton step −H⁻¹ g, g the last column of `_linearise`; and by how much that lowers χ²."""
    turn, shifted, promised = np.empty(3), np.empty(3), 0.0
    for i in range(6):
        step = 0.0
        for j in range(6):
            step -= inverse[i, j] * gram[j, 6]
        promised -= step * gram[i, 6]
        if i < 3:
            turn[i] = step
        else:
            shifted[i - 3] = translation_m[i - 3] + step
    return exp_rotation(turn, rotation), shifted, promised


@compiled
def turned_pose(problem: Problem, rotation: Array, turn: Array) -> tuple[bool, Array, Array, float]:
    """A pose turned by a rotation vector (3,) [rad] in `camera` and refined in all else: rotation, translation and χ².

    False where nothing solves the corners.
    """
    turned, translation_m = exp_rotation(turn, rotation), np.empty(3)
    if not translate(problem, turned, translation_m):
        return False, turned, translation_m, math.inf
    gram, inverse, residual = np.empty((7, 7)), np.empty((6, 6)), np.empty(problem.plane.shape)
    _linearise(problem, turned, translation_m, gram, residual)
    held = 0.0
    for i in range(6):
        held += _HELD * gram[i, i] / _dot(turn, turn)
    for i in range(3):
        for j in range(3):
            gram[i, j] += held * turn[i] * turn[j]
    if not _inverse(gram, 0.0, inverse):
        return False, turned, translation_m, math.inf
    turned, translation_m, _ = _stepped(gram, inverse, turned, translation_m)
    _linearise(problem, turned, translation_m, gram, residual)
    return math.isfinite(gram[6, 6]) and translation_m[2] > 0.0, turned, translation_m, gram[6, 6]


@compiled
def _conclude(
    problem: Problem, gram: Array, residual: Array, covariance: Array, common: Array, residual_px: Array
) -> bool:
    """Write what `Solution` holds of a linearised pose; False when the corners do not determine it."""
    if not _inverse(gram, 0.0, covariance):
        return False
    kinds, wide, to_pixels = len(common), problem.whiten.shape[1], problem.to_pixels
    for point in range(len(residual)):
        u, v = residual[point, 0], residual[point, 1]
        for axis in range(2):
            residual_px[point, axis] = u * to_pixels[axis, 0] + v * to_pixels[axis, 1]
    along = np.zeros(kinds)
    for row in range(residual.size if kinds > 0 else 0):
        block, of_block = row // wide, row % wide
        whitened = 0.0
        for column in range(wide):
            place = block * wide + column
            whitened += problem.whiten[block, of_block, column] * residual[place // 2, place % 2]
        for kind in range(kinds):
            along[kind] += problem.common[kind, row] * whitened
    for kind in range(kinds):
        common[kind] = -_dot(problem.amplitude[kind], along)
        for point in range(len(residual)):
            for axis in range(2):
                residual_px[point, axis] += common[kind] * problem.common_px[kind, 2 * point + axis]
    return True


@compiled
def exp_rotation(vector: Array, rotation: Array) -> Array:
    """exp(vector) · rotation, (3,3): Rodrigues' formula."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return rotation.copy()
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = x / angle, y / angle, z / angle
    result = np.empty((3, 3))
    for j in range(3):
        a, b, d = rotation[0, j], rotation[1, j], rotation[2, j]
        along = (1.0 - c) * (x * a + y * b + z * d)
        result[0, j] = c * a + s * (y * d - z * b) + along * x
        result[1, j] = c * b + s * (z * a - x * d) + along * y
        result[2, j] = c * d + s * (x * b - y * a) + along * z
    return result
