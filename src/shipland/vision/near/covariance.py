"""What a solved pose says to the pilot: position and heading in `bar`, and their covariance."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose
from shipland.messages import BarPose
from shipland.vision.near.planar_pose import Corners, LevelPrior, Solution, poses_about_vertical

_LEAST_SHARE = 1e-4
"""Probability of the other planar solution that still counts in the covariance."""

_BENT_RAD = 2e-3
"""Standard deviation of the angle about the cue's vertical from which the covariance allows for the arc; below, the arc
is micrometres."""

_FLAT_RAD = 0.01
"""Standard deviation of that angle from which the corners' fit is evaluated beside the solution: the corners measure
the angle by its cosine, which is not linear there."""

_FLAT_SIGMAS = np.array([-2.5, -1.25, 1.25, 2.5])
"""Where it is evaluated, in standard deviations of that angle."""

_NARROW = 0.5
"""Least share of the Jacobian's yaw variance that the poses beside must have; with less they fit nothing."""


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
    right, down, forward = bar_from_camera.T.tolist()
    horizontal2 = max(forward[0] * forward[0] + forward[1] * forward[1], 1e-12)
    jacobian = np.zeros((4, 6))
    jacobian[:3, :3] = -bar_from_camera @ [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    jacobian[:3, 3:] = -bar_from_camera
    jacobian[3, 0] = (forward[0] * down[1] - forward[1] * down[0]) / horizontal2
    jacobian[3, 1] = -(forward[0] * right[1] - forward[1] * right[0]) / horizontal2
    return np.asarray(jacobian @ solution.covariance @ jacobian.T)


def bar_pose_of(solutions: list[Solution], corners_px: Array, covariance: Array | None = None) -> BarPose:
    """The first solution as a message; its covariance weighs the others by their likelihood.

    Args:
        solutions: of one picture, the one taken first.
        corners_px: (k,4,2) the corners they rest on.
        covariance: (4,4) of the first solution, where its Jacobian is not enough (`covariance_over_heading`).
    """
    taken = solutions[0]
    position_in_bar_m, yaw_rad = position_and_yaw(taken.camera_from_plane)
    excess = taken.excess
    here = _joined(position_in_bar_m, yaw_rad)
    if covariance is None:
        covariance = excess * (covariance_in_bar(taken) + excess * _bend(taken, here))
    for other in solutions[1:]:
        share = 1.0 / (1.0 + math.exp(min(max(0.5 * (other.chi2 - taken.chi2) / excess, -50.0), 50.0)))
        if share < _LEAST_SHARE:
            continue
        apart = _joined(*position_and_yaw(other.camera_from_plane)) - here
        apart[3] = math.remainder(apart[3], math.tau)
        other_covariance = excess * covariance_in_bar(other) + np.outer(apart, apart)
        covariance = (1.0 - share) * covariance + share * other_covariance
    return BarPose(position_in_bar_m, yaw_rad, covariance, taken.reprojection_px, corners_px.reshape(-1, 2))


def covariance_over_heading(
    taken: Solution, corners: Corners, camera: Camera, prior: LevelPrior | None
) -> Array | None:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) over all angles about the cue's vertical.

    From afar the corners measure that angle by a cosine: they fit over a wide range of it, unevenly to either side.
    Poses over that range are weighted by how well they fit. None where the Jacobian is enough: the angle is well known,
    or no pose beside fits.
    """
    excess, down = taken.excess, taken.camera_from_plane.rotation[:, 1]
    along = taken.covariance[:, :3] @ down
    variance = max(float(along[:3] @ down), 0.0)
    std_rad = math.sqrt(excess * variance)
    if not std_rad > _FLAT_RAD:
        return None
    here = _joined(*position_and_yaw(taken.camera_from_plane))
    # What stays unknown when the angle is known.
    known = replace(taken, covariance=taken.covariance - np.outer(along, along) / variance)
    weight, square = 1.0, np.zeros((4, 4))
    for beside, chi2 in poses_about_vertical(taken, _FLAT_SIGMAS * std_rad, corners, camera, prior):
        off = _joined(*position_and_yaw(beside)) - here
        off[3] = math.remainder(off[3], math.tau)
        share = math.exp(min(0.5 * (taken.chi2 - chi2) / excess, 0.0))
        square += share * np.outer(off, off)
        weight += share
    covariance = np.asarray(excess * covariance_in_bar(known) + square / weight)
    narrow = covariance[3, 3] < _NARROW * excess * covariance_in_bar(taken)[3, 3]
    return None if narrow else covariance


def _joined(position_m: Array, yaw_rad: float) -> Array:
    """(4,) a position and a yaw."""
    return np.array([*position_m.tolist(), yaw_rad])


def _bend(solution: Solution, here: Array) -> Array:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) of the arc along which the camera errs.

    From afar the angle about the cue's vertical is known least. Position and yaw change together with it, and leave the
    covariance's straight line by h per squared standard deviation, on average of the square √3 h.

    Args:
        solution: the pose.
        here: (4,) its position and yaw.
    """
    pose, down = solution.camera_from_plane, solution.camera_from_plane.rotation[:, 1]
    along = solution.covariance[:, :3] @ down
    std_rad = math.sqrt(max(float(along[:3] @ down), 0.0))
    if not std_rad > _BENT_RAD:
        return np.zeros((4, 4))
    step = along / std_rad
    turn, shift_m = cv2.Rodrigues(step[:3])[0], step[3:]
    back = np.ascontiguousarray(turn.T)
    ahead = _joined(*position_and_yaw(Pose(turn @ pose.rotation, pose.translation_m + shift_m)))
    behind = _joined(*position_and_yaw(Pose(back @ pose.rotation, pose.translation_m - shift_m)))
    bend = 0.5 * (ahead + behind) - here
    bend[3] = math.remainder(bend[3], math.pi)
    return 3.0 * np.outer(bend, bend)
