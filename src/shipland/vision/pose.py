"""Pose of the camera against a planar cue: two planar solutions, refined together, and their covariance.

Frame `plane`: the cue's, with OpenCV-like axes right, down, forward; `plane` = CAMERA_FROM_MOUNT · `bar`.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose

_STEPS = 8
"""Most Levenberg–Marquardt steps; three or four are usual."""

_GAIN_DONE = 0.03
"""The step that would lower the sum of squared standard deviations by less is the last one."""


_NUDGE = 1e-7
"""OpenCV's IPPE divides zero by zero on exact pixels of some symmetrical views: it gets them a little off then."""

_DOUBTFUL_CHI2 = 2.5
"""Sum of squared standard deviations a coordinate, from which a prior is put to the test."""

_CONTRADICTION_CHI2 = 20.0
"""What leaving the prior out must gain, and the corners must fit well without it: its angles are off by more than four
standard deviations. Corners that fit badly either way prove nothing against it."""

_CONTRADICTION_PX = 0.2
"""Reprojection error with the prior that small systematic errors of the corners, which look like a tilt from far away,
do not reach."""

_CONTRADICTION_COSINE = float(np.cos(np.radians(30.0)))
"""By more than this a prior is not thought wrong; rather is it another cue, of other proportions."""


@dataclass(frozen=True)
class Corners:
    """Measured corners and what they are known to.

    Attributes:
        undistorted_px: (n,4,2) as a distortion-free camera would see them.
        whiten: (n,8,8) what turns deviations of a quadrilateral's (column, row) × four corners into standard
            deviations [1/px]: the inverse of a square root of their covariance.
        plane_m: (n,4,2) the same corners in the cue's plane (right, down) [m].
        common_px: (n,4,2) an error that all corners may have in common, at one standard deviation; None for none.
    """

    undistorted_px: Array
    whiten: Array
    plane_m: Array
    common_px: Array | None = None


@dataclass(frozen=True)
class LevelPrior:
    """What the gimbal knows: the direction of `bar`'s down axis in `camera`, to within a noise.

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
        chi2: weighted sum of squared residuals; the prior's share is `prior_chi2`.
        prior_chi2: of the level prior, 0 without one.
        covariance: (6,6) of the left rotation vector [rad] and translation [m], both in `camera`.
        residual_px: (n,4,2) reprojected minus measured.
        freedom: residuals less unknowns.
    """

    camera_from_plane: Pose
    chi2: float
    prior_chi2: float
    covariance: Array
    residual_px: Array
    freedom: int

    @property
    def excess(self) -> float:
        """By how much the corners' variance was taken too small: χ² a degree of freedom where that is beyond chance."""
        chance = self.freedom + 2.0 * (2.0 * self.freedom) ** 0.5
        return self.chi2 / self.freedom if self.chi2 > chance else 1.0

    @property
    def reprojection_px(self) -> float:
        """Root-mean-square distance of observed and reprojected corners."""
        return float(np.sqrt(np.mean(np.sum(self.residual_px**2, axis=-1))))


def solve(
    corners: Corners, camera: Camera, prior: LevelPrior | None = None, near: Pose | None = None
) -> list[Solution]:
    """The one or two poses that solve the corners, better first; empty when none does.

    IPPE gives both planar solutions, Levenberg–Marquardt refines them [Lee2022, §Pose Estimation]. A prior that the
    corners contradict is left out.

    Args:
        corners: measured.
        camera: intrinsics.
        prior: what the gimbal knows.
        near: a pose (camera_from_plane) not far off; with a prior, which leaves no second solution, it is what the
            refinement starts from.
    """
    if prior is not None and near is not None:
        followed = _Refiner(corners, camera, prior).follow(near)
        if followed is not None and followed.chi2 < _DOUBTFUL_CHI2 * corners.plane_m.size:
            return [followed]
    solutions = _solve(corners, camera, prior)
    if prior is None or not solutions or solutions[0].chi2 < _DOUBTFUL_CHI2 * corners.plane_m.size:
        return solutions
    free = _solve(corners, camera, None)
    contradicted = (
        free
        and free[0].excess == 1.0
        and solutions[0].chi2 - free[0].chi2 > _CONTRADICTION_CHI2
        and solutions[0].reprojection_px > _CONTRADICTION_PX
        and float(free[0].camera_from_plane.rotation[:, 1] @ prior.down_in_camera) > _CONTRADICTION_COSINE
    )
    if contradicted:
        return free
    return solutions


def bound(camera_from_plane: Pose, corners: Corners, camera: Camera, prior: LevelPrior | None = None) -> Solution:
    """The Cramér–Rao bound at a known pose: its `covariance` is the least that unbiased estimates can have.

    Args:
        camera_from_plane: the true pose.
        corners: noise and model; the measured pixels do not matter.
        camera: intrinsics.
        prior: what is known besides.
    """
    refiner = _Refiner(corners, camera, prior)
    residual, jacobian, raw = refiner.linearise(camera_from_plane.rotation[None], camera_from_plane.translation_m[None])
    return refiner.solution(camera_from_plane, residual[0], jacobian[0], raw[0])


def _solve(corners: Corners, camera: Camera, prior: LevelPrior | None) -> list[Solution]:
    refiner = _Refiner(corners, camera, prior)
    for nudge in (0.0, _NUDGE):
        rays = refiner.rays + nudge * np.sin(np.arange(refiner.rays.size)).reshape(-1, 2)
        _, rotations, translations, _ = cv2.solvePnPGeneric(
            refiner.plane, rays.reshape(-1, 1, 2), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
        starts = [
            Pose(np.asarray(cv2.Rodrigues(rotation)[0], float), np.asarray(translation, float).ravel())
            for rotation, translation in zip(rotations, translations, strict=True)
            if np.isfinite(rotation).all() and np.isfinite(translation).all() and translation[2] > 0.0
        ]
        if starts:
            return sorted(refiner.refine(starts), key=lambda solution: solution.chi2)
    return []


class _Refiner:
    """Levenberg–Marquardt over several starts at once: one pass of NumPy serves both planar solutions.

    Rays (x/z, y/z) stand for pixels; whitening by the corners' covariance makes every residual one standard
    deviation. A step is a left rotation vector and a translation, both in `camera`.
    """

    def __init__(self, corners: Corners, camera: Camera, prior: LevelPrior | None) -> None:
        count = corners.plane_m.size // 2
        self.plane = np.zeros((count, 3))
        self.plane[:, :2] = corners.plane_m.reshape(-1, 2)
        (fx, skew, cx), (_, fy, cy), _ = camera.matrix.tolist()
        self._to_pixels = camera.matrix[:2, :2]
        self.rays = (corners.undistorted_px.reshape(-1, 2) - (cx, cy)) / (fx, fy)
        if skew != 0.0:
            self.rays[:, 0] -= skew / fx * self.rays[:, 1]
        size = 2 * count
        rows = size if prior is None else size + 2
        self._size = size
        blocks = (corners.whiten.reshape(-1, 8, 4, 2) @ self._to_pixels).reshape(-1, 8, 8)
        self._whiten = np.zeros((size, size))
        for first, block in zip(range(0, size, 8), blocks, strict=True):
            self._whiten[first : first + 8, first : first + 8] = block
        if corners.common_px is not None:
            # W' of the covariance (WᵀW)⁻¹ + c cᵀ is (1 − k v vᵀ) W, with v = W c.
            common = (corners.whiten @ corners.common_px.reshape(-1, 8, 1)).ravel()
            length2 = max(float(common @ common), 1e-12)
            share = (1.0 - (1.0 + length2) ** -0.5) / length2
            self._whiten -= np.outer(share * common, common @ self._whiten)
        self._prior = prior
        self._rows = rows
        if prior is not None:
            self._across = _perpendicular(prior.down_in_camera) / prior.noise_rad

    def follow(self, near: Pose) -> Solution | None:
        """The solution from a pose not far off; None when that does not lead straight to one.

        The rotation is kept for a start, with the translation that suits it best: for a known rotation it is linear.
        """
        rotation, translation = near.rotation, self._translation(near.rotation)
        if translation is None:
            return None
        (residual,), (jacobian,), (raw,) = self.linearise(rotation[None], translation[None])
        for _ in range(_STEPS):
            gradient = residual @ jacobian
            step = -np.linalg.solve(jacobian.T @ jacobian, gradient)
            gain = -float(step @ gradient)
            rotation, translation = cv2.Rodrigues(step[:3])[0] @ rotation, translation + step[3:]
            if gain < _GAIN_DONE:
                return self.solution(Pose(rotation, translation), residual, jacobian, raw)
            before = float(residual @ residual)
            (residual,), (jacobian,), (raw,) = self.linearise(rotation[None], translation[None])
            if not residual @ residual <= before:
                return None
        return None

    def _translation(self, rotation: Array) -> Array | None:
        """The translation (3,) with which rays meet the plane best, unweighted; None when it is behind the camera."""
        arms = self.plane @ rotation.T
        depth = arms[:, 2]
        u, v = self.rays.T
        aim_u, aim_v = u * depth - arms[:, 0], v * depth - arms[:, 1]
        sum_u, sum_v = float(u.sum()), float(v.sum())
        square = float(u @ u + v @ v)
        normal = np.array([[len(u), 0.0, -sum_u], [0.0, len(u), -sum_v], [-sum_u, -sum_v, square]])
        translation = np.linalg.solve(normal, [aim_u.sum(), aim_v.sum(), -(u @ aim_u) - v @ aim_v])
        return translation if translation[2] > 0.0 else None

    def refine(self, starts: list[Pose]) -> list[Solution]:
        """The solutions from the starts; a start that diverges is left out."""
        rotation = np.array([start.rotation for start in starts])
        translation = np.array([start.translation_m for start in starts])
        damping = np.full(len(starts), 1e-3)
        residual, jacobian, raw = self.linearise(rotation, translation)
        cost = (residual * residual).sum(axis=1)
        diagonal = np.arange(6)
        for _ in range(_STEPS):
            turned = jacobian.transpose(0, 2, 1)
            normal = turned @ jacobian
            gradient = (turned @ residual[:, :, None])[:, :, 0]
            damped = normal.copy()
            damped[:, diagonal, diagonal] *= 1.0 + damping[:, None]
            step = -np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
            new_rotation = np.array([cv2.Rodrigues(w)[0] for w in step[:, :3]]) @ rotation
            new_translation = translation + step[:, 3:]
            if not np.any(-(step * gradient).sum(axis=1) >= _GAIN_DONE):
                rotation, translation = new_rotation, new_translation
                break
            new_residual, new_jacobian, new_raw = self.linearise(new_rotation, new_translation)
            new_cost = (new_residual * new_residual).sum(axis=1)
            better = new_cost <= cost
            # Near the view where both solutions merge the cost is of fourth order and Gauss–Newton oversteps.
            gained = (cost - new_cost) / np.maximum(-(step * gradient).sum(axis=1), 1e-12)
            damping = np.clip(np.where(gained > 0.75, 0.1, np.where(gained > 0.25, 1.0, 30.0)) * damping, 1e-4, 1e6)
            if better.all():
                rotation, translation, cost = new_rotation, new_translation, new_cost
                residual, jacobian, raw = new_residual, new_jacobian, new_raw
                continue
            rotation[better], translation[better] = new_rotation[better], new_translation[better]
            residual[better], jacobian[better] = new_residual[better], new_jacobian[better]
            raw[better], cost[better] = new_raw[better], new_cost[better]
        return [
            self.solution(Pose(rotation[i], translation[i]), residual[i], jacobian[i], raw[i])
            for i in range(len(starts))
            if np.isfinite(cost[i]) and translation[i, 2] > 0.0
        ]

    def solution(self, pose: Pose, residual: Array, jacobian: Array, raw: Array) -> Solution:
        return Solution(
            camera_from_plane=pose,
            chi2=float(residual @ residual),
            prior_chi2=float(residual[self._size :] @ residual[self._size :]),
            covariance=np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=float),
            residual_px=(raw @ self._to_pixels.T).reshape(-1, 4, 2),
            freedom=self._rows - 6,
        )

    def linearise(self, rotation: Array, translation: Array) -> tuple[Array, Array, Array]:
        """Whitened residuals (b,rows), their Jacobian (b,rows,6), and the rays' residuals (b,n,2)."""
        arms = self.plane @ rotation.transpose(0, 2, 1)
        points = arms + translation[:, None]
        near = 1.0 / np.maximum(points[:, :, 2], 1e-6)
        u, v = points[:, :, 0] * near, points[:, :, 1] * near
        raw = np.stack([u, v], axis=-1) - self.rays
        x, y, z = arms[:, :, 0] * near, arms[:, :, 1] * near, arms[:, :, 2] * near
        partial = np.zeros((*u.shape, 2, 6))
        partial[:, :, 0, 0], partial[:, :, 0, 1], partial[:, :, 0, 2] = -y * u, z + x * u, -y
        partial[:, :, 1, 0], partial[:, :, 1, 1], partial[:, :, 1, 2] = -z - y * v, x * v, x
        partial[:, :, 0, 3] = partial[:, :, 1, 4] = near
        partial[:, :, 0, 5], partial[:, :, 1, 5] = -u * near, -v * near
        residual = np.empty((len(rotation), self._rows))
        jacobian = np.zeros((len(rotation), self._rows, 6))
        residual[:, : self._size] = raw.reshape(len(rotation), -1) @ self._whiten.T
        jacobian[:, : self._size] = self._whiten @ partial.reshape(len(rotation), -1, 6)
        if self._prior is not None:
            down = rotation[:, :, 1]
            residual[:, self._size :] = down @ self._across.T
            x, y, z = down.T[:, :, None]
            across_x, across_y, across_z = self._across.T
            tilt = jacobian[:, self._size :]
            tilt[:, :, 0], tilt[:, :, 1] = y * across_z - z * across_y, z * across_x - x * across_z
            tilt[:, :, 2] = x * across_y - y * across_x
        return residual, jacobian, raw


def position_and_yaw(camera_from_plane: Pose) -> tuple[Array, float]:
    """The camera's optical centre in `bar` (3,) [m], and the heading of its vertical plane there [rad]."""
    bar_from_camera = CAMERA_FROM_MOUNT.T @ camera_from_plane.rotation.T
    position_in_bar_m = -bar_from_camera @ camera_from_plane.translation_m
    return position_in_bar_m, float(np.arctan2(bar_from_camera[1, 2], bar_from_camera[0, 2]))


def covariance_in_bar(solution: Solution) -> Array:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) from the solution's (6,6)."""
    pose = solution.camera_from_plane
    bar_from_camera = CAMERA_FROM_MOUNT.T @ pose.rotation.T
    # R' = exp(w) R turns position −B Rᵀ t into −B Rᵀ (t + dt − w × t), and the optical axis into B Rᵀ (z − w × z).
    x, y, z = pose.translation_m.tolist()
    right, down, forward = bar_from_camera.T
    horizontal2 = max(float(forward[0] ** 2 + forward[1] ** 2), 1e-12)
    jacobian = np.zeros((4, 6))
    jacobian[:3, :3] = -bar_from_camera @ [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    jacobian[:3, 3:] = -bar_from_camera
    jacobian[3, 0] = (forward[0] * down[1] - forward[1] * down[0]) / horizontal2
    jacobian[3, 1] = -(forward[0] * right[1] - forward[1] * right[0]) / horizontal2
    return np.asarray(jacobian @ solution.covariance @ jacobian.T)


def _perpendicular(direction: Array) -> Array:
    """Two unit vectors (2,3) perpendicular to a unit vector and to each other."""
    x, y, z = direction.tolist()
    # Frisvad's frame, about the axis that the direction is farthest against.
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])
