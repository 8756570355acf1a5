"""The planar pose solver: both planar solutions of measured corners, refined, with their covariance.

Frame `plane`: the cue's, with OpenCV-like axes right, down, forward; `plane` = CAMERA_FROM_MOUNT · `bar`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.linalg import lapack

from shipland.camera import Camera
from shipland.frames import Array, Pose

_STEPS = 8
"""Most Levenberg–Marquardt steps; three or four are usual."""

_GAIN_DONE = 0.03
"""A step that is expected to lower χ² by less than this is the last one."""

_DAMPING = 1e-3
"""Of the first Levenberg–Marquardt step from a closed-form start."""

_HELD = 1e3
"""Weight that holds the angle about an axis, as a multiple of all the information on the pose."""

_IDENTITY = np.eye(6)

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
        followed = _Refiner(corners, camera, prior).follow(near)
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
    refiner = _Refiner(corners, camera, prior)
    return refiner.solution(camera_from_plane, refiner.linearise(camera_from_plane))


def poses_turned(
    solution: Solution, turns: Array, corners: Corners, camera: Camera, prior: LevelPrior | None
) -> list[tuple[Pose, float]]:
    """Poses beside a solution, turned by rotation vectors (m,3) [rad] in `camera` and refined in all else.

    Each with its χ²; those at which nothing solves the corners are left out.
    """
    refiner = _Refiner(corners, camera, prior)
    found = [refiner.turned(solution.camera_from_plane, turn) for turn in turns]
    return [pose for pose in found if pose is not None]


def _solve(corners: Corners, camera: Camera, prior: LevelPrior | None) -> list[Solution]:
    refiner = _Refiner(corners, camera, prior)
    for nudge in (0.0, _NUDGE):
        rays = refiner.rays + nudge * np.sin(np.arange(refiner.rays.size)).reshape(2, -1)
        try:
            _, rotations, translations, _ = cv2.solvePnPGeneric(
                refiner.plane.T, rays.T.reshape(-1, 1, 2), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
            )
        except cv2.error:  # a homography that does not exist
            continue
        starts = [
            Pose(np.asarray(cv2.Rodrigues(rotation)[0], float), np.asarray(translation, float).ravel())
            for rotation, translation in zip(rotations, translations, strict=True)
            if np.isfinite(rotation).all() and np.isfinite(translation).all() and translation[2] > 0.0
        ]
        if starts:
            refined = (refiner.refine(start, _DAMPING) for start in starts)
            return sorted((found for found in refined if found is not None), key=lambda solution: solution.chi2)
    return []


@dataclass(frozen=True)
class _Linear:
    """The residuals at a pose, and how they change.

    Attributes:
        gram: (7,7) products of the whitened Jacobian's six columns and the whitened residual.
        residual: (n,2) of the rays.
    """

    gram: Array
    residual: Array


class _Refiner:
    """Levenberg–Marquardt on rays (x/z, y/z) instead of pixels.

    Whitening by the corners' covariance makes every residual one standard deviation. A step is a left rotation vector
    and a translation, both in `camera`.
    """

    def __init__(self, corners: Corners, camera: Camera, prior: LevelPrior | None) -> None:
        count = corners.plane_m.size // 2
        self.plane = np.zeros((3, count))
        self.plane[:2] = corners.plane_m.reshape(-1, 2).T
        (fx, skew, cx), (_, fy, cy), _ = camera.matrix.tolist()
        self._to_pixels = camera.matrix[:2, :2]
        columns, rows = corners.undistorted_px.reshape(-1, 2).T
        self.rays = np.empty((2, count))
        self.rays[1] = (rows - cy) / fy
        self.rays[0] = (columns - cx - skew * self.rays[1]) / fx if skew != 0.0 else (columns - cx) / fx
        self._size = 2 * count
        self._shape, wide = corners.plane_m.shape, corners.plane_m.shape[1] * 2
        self._whiten = (corners.whiten.reshape(-1, wide // 2, 2) @ self._to_pixels).reshape(-1, wide, wide)
        kinds = 0 if corners.common_px is None else len(corners.common_px)
        self._common: Array | None = None
        self._common_px = corners.common_px
        if corners.common_px is not None:
            # W' of the covariance (WᵀW)⁻¹ + C Cᵀ is (1 − V K Vᵀ) W, with V = W C and VᵀV = Q λ Qᵀ:
            # K = Q (1 − (1 + λ)^−½) / λ Qᵀ.
            common = (corners.whiten @ corners.common_px.reshape(kinds, -1, wide, 1)).reshape(kinds, -1)
            length2, turn = np.linalg.eigh(common @ common.T)
            length2 = np.maximum(length2, 1e-12)
            self._common = common
            self._share = common.T @ (turn * ((1.0 - (1.0 + length2) ** -0.5) / length2) @ turn.T)
            self._amplitude = turn * (1.0 / (1.0 + length2)) @ turn.T
        self._across: Array | None = None
        if prior is not None:
            self._across = _perpendicular(prior.down_in_camera) / prior.noise_rad
        measured = int(np.count_nonzero(corners.whiten.any(axis=2)))
        self._freedom = max(measured - 6 + (0 if prior is None else 2) - kinds, 0)
        # Rows for the prior stay zero without one.
        self._rows = np.zeros((self._size + 2, 7))
        self._partial = np.zeros((count, 2, 7))

    def follow(self, near: Pose) -> Solution | None:
        """The solution from a pose not far off; None when there is none.

        The rotation is kept for a start, with its best translation, which is linear for a known rotation.
        """
        translation = self._translation(near.rotation)
        return None if translation is None else self.refine(Pose(near.rotation, translation), 0.0)

    def _translation(self, rotation: Array) -> Array | None:
        """The translation (3,) with which rays meet the plane best, unweighted; None when it is behind the camera."""
        arms = rotation @ self.plane
        aim = self.rays * arms[2] - arms[:2]
        aim_u, aim_v = aim.sum(axis=1).tolist()
        sum_u, sum_v = self.rays.sum(axis=1).tolist()
        count = self._size // 2
        scatter = float(np.vdot(self.rays, self.rays)) - (sum_u * sum_u + sum_v * sum_v) / count
        forward = (sum_u * aim_u + sum_v * aim_v) / count - float(np.vdot(self.rays, aim))
        if not (scatter > 0.0 and forward > 0.0):
            return None
        forward /= scatter
        return np.array([(aim_u + sum_u * forward) / count, (aim_v + sum_v * forward) / count, forward])

    def refine(self, start: Pose, damping: float) -> Solution | None:
        """The solution from a start; None when it diverges. Without damping it starts as Gauss–Newton."""
        pose, now = start, self.linearise(start)
        for _ in range(_STEPS):
            normal, gradient = now.gram[:6, :6], now.gram[:6, 6]
            if damping > 0.0:
                normal = normal.copy()
                normal.flat[::7] *= 1.0 + damping
            _, step, failed = lapack.dposv(normal, -gradient)
            if failed:
                return None
            stepped = _moved(pose, step)
            promised = -float(step @ gradient)
            if promised < _GAIN_DONE:
                pose = stepped
                break
            then = self.linearise(stepped)
            gained = now.gram[6, 6] - then.gram[6, 6]
            if gained >= 0.0:
                pose, now = stepped, then
            # Near the view where both solutions merge the cost is of fourth order and Gauss–Newton oversteps.
            if gained <= 0.25 * promised:
                damping = min(max(30.0 * damping, _DAMPING), 1e6)
            elif gained > 0.75 * promised:
                damping *= 0.1
        if not (np.isfinite(now.gram[6, 6]) and pose.translation_m[2] > 0.0):
            return None
        try:
            return self.solution(pose, now)
        except np.linalg.LinAlgError:
            return None

    def turned(self, pose: Pose, turn: Array) -> tuple[Pose, float] | None:
        """A pose turned by a rotation vector (3,), refined in all else, and its χ²; None when it diverges."""
        rotation = cv2.Rodrigues(turn)[0] @ pose.rotation
        translation = self._translation(rotation)
        if translation is None:
            return None
        pose, axis = Pose(rotation, translation), turn / np.linalg.norm(turn)
        gram = self.linearise(pose).gram
        normal = gram[:6, :6]
        normal[:3, :3] += _HELD * float(normal.trace()) * np.outer(axis, axis)
        _, step, failed = lapack.dposv(normal, -gram[:6, 6])
        if failed:
            return None
        pose = _moved(pose, step)
        chi2 = float(self.linearise(pose).gram[6, 6])
        return (pose, chi2) if np.isfinite(chi2) and pose.translation_m[2] > 0.0 else None

    def solution(self, pose: Pose, at: _Linear) -> Solution:
        """A pose with its covariance; LinAlgError when the corners do not determine it."""
        _, covariance, failed = lapack.dposv(at.gram[:6, :6], _IDENTITY)
        if failed:
            raise np.linalg.LinAlgError("the corners do not determine the pose")
        residual_px, amplitudes = (at.residual @ self._to_pixels.T).reshape(self._shape), NO_COMMON_ERROR
        if self._common is not None and self._common_px is not None:
            whitened = self._whiten @ at.residual.reshape(len(self._whiten), -1, 1)
            amplitudes = -self._amplitude @ (self._common @ whitened.ravel())
            residual_px += np.tensordot(amplitudes, self._common_px, axes=1)
        return Solution(
            camera_from_plane=pose,
            chi2=float(at.gram[6, 6]),
            covariance=np.asarray(covariance, dtype=float),
            common=amplitudes,
            residual_px=residual_px,
            freedom=self._freedom,
        )

    def linearise(self, pose: Pose) -> _Linear:
        rotation = pose.rotation
        arms = rotation @ self.plane
        near = 1.0 / np.maximum(arms[2] + pose.translation_m[2], 1e-6)
        seen = (arms[:2] + pose.translation_m[:2, None]) * near
        arms *= near
        # Columns: three of rotation, three of translation, the residual.
        partial = self._partial
        partial[:, :, 0] = (-arms[1] * seen).T
        partial[:, :, 1] = (arms[0] * seen).T
        partial[:, 0, 1] += arms[2]
        partial[:, 1, 0] -= arms[2]
        partial[:, 0, 2], partial[:, 1, 2] = -arms[1], arms[0]
        partial[:, 0, 3] = partial[:, 1, 4] = near
        partial[:, :, 5] = (-near * seen).T
        partial[:, :, 6] = (seen - self.rays).T
        rows, size = self._rows, self._size
        whitened = rows[:size]
        wide = self._whiten.shape[1]
        np.matmul(self._whiten, partial.reshape(-1, wide, 7), out=whitened.reshape(-1, wide, 7))
        if self._common is not None:
            whitened -= self._share @ (self._common @ whitened)
        if self._across is not None:
            x, y, z = rotation[:, 1].tolist()
            tilt = self._across @ [[0.0, z, -y, x], [-z, 0.0, x, y], [y, -x, 0.0, z]]
            rows[size:, :3], rows[size:, 6] = tilt[:, :3], tilt[:, 3]
        return _Linear(rows.T @ rows, partial[:, :, 6].copy())


def _moved(pose: Pose, step: Array) -> Pose:
    """A pose moved by a step (6,): left rotation vector [rad] and translation [m], both in `camera`."""
    return Pose(cv2.Rodrigues(step[:3])[0] @ pose.rotation, pose.translation_m + step[3:])


def _perpendicular(direction: Array) -> Array:
    """Two unit vectors (2,3) perpendicular to a unit vector and to each other."""
    x, y, z = direction.tolist()
    # Frisvad's frame, about the axis that the direction is farthest against.
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])
