"""What a solved pose says to the pilot: position and heading in `bar`, and their covariance."""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.frames import Array, Pose
from shipland.messages import BarPose
from shipland.vision.near.planar_pose import (
    Corners,
    LevelPrior,
    Problem,
    Solution,
    exp_rotation,
    problem_of,
    turned_pose,
)

_LEAST_SHARE = 1e-4
"""Probability of the other planar solution that still counts in the covariance."""

_COVERED = 4.0
"""Squared standard deviations up to which the other solution lies within the covariance of the one that is taken."""

_BENT_RAD = 2e-3
"""Standard deviation of the angle about the cue's vertical from which the covariance allows for the arc; below, the arc
is micrometres."""

_FLAT_RAD = 0.01
"""Standard deviation of an angle between cue and camera from which the corners' fit is evaluated beside the solution:
the corners measure it by its cosine, which is not linear there."""

_FLAT_SIGMAS = np.array([-5.0, -3.0, -1.5, 1.5, 3.0, 5.0])
"""Where it is evaluated, in standard deviations of that angle."""

GAUSSIAN_TAIL, CODED_TAIL = 12.0, 4.0
"""Degrees of freedom of Student's distribution of the corners' errors: their deviation is an estimate, and coding errs
by much more in some pictures than in most."""

_LEAST_WEIGHT = 1.6
"""Sum of the poses' likelihoods, the best one's 1 included, from which they lie densely enough: a Gaussian's have 1.7.
Where the fit is of fourth order, the Jacobian's deviation is far too large."""

_NARROWER = 4
"""Times that the poses are taken, each at half the angles of the last."""


def position_and_yaw(camera_from_plane: Pose) -> tuple[Array, float]:
    """The camera's optical centre in `bar` (3,) [m], and the heading of its vertical plane there [rad]."""
    here = _joined(camera_from_plane)
    return here[:3], float(here[3])


def covariance_in_bar(solution: Solution) -> Array:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) from the solution's (6,6)."""
    pose, covariance = solution.camera_from_plane, np.empty((4, 4))
    _carry_covariance(pose.rotation, pose.translation_m, solution.covariance, covariance)
    return covariance


def _joined(camera_from_plane: Pose) -> Array:
    """(4,) `position_and_yaw` in one."""
    here = np.empty(4)
    _place(camera_from_plane.rotation, camera_from_plane.translation_m, here)
    return here


@compiled
def _place(rotation: Array, translation_m: Array, here: Array) -> None:
    """Write (4,) position in `bar` and yaw: −B Rᵀ t and the direction of the optical axis, B the turn into `bar`."""
    for i in range(3):
        here[i] = 0.0
        for j in range(3):
            here[i] -= rotation[j, (i + 2) % 3] * translation_m[j]
    here[3] = math.atan2(rotation[2, 0], rotation[2, 2])


@compiled
def _carry_covariance(rotation: Array, translation_m: Array, covariance: Array, carried: Array) -> None:
    """Write (4,4) J C Jᵀ.

    R' = exp(w) R turns position −B Rᵀ t into −B Rᵀ (t + dt − w × t), and the optical axis into B Rᵀ (z − w × z).
    """
    x, y, z = translation_m[0], translation_m[1], translation_m[2]
    jacobian, half = np.zeros((4, 6)), np.zeros((4, 6))
    for i in range(3):
        a, b, c = rotation[0, (i + 2) % 3], rotation[1, (i + 2) % 3], rotation[2, (i + 2) % 3]
        jacobian[i, 0], jacobian[i, 1], jacobian[i, 2] = c * y - b * z, a * z - c * x, b * x - a * y
        jacobian[i, 3], jacobian[i, 4], jacobian[i, 5] = -a, -b, -c
    ahead, beside = rotation[2, 2], rotation[2, 0]
    horizontal2 = max(ahead * ahead + beside * beside, 1e-12)
    jacobian[3, 0] = (ahead * rotation[1, 0] - beside * rotation[1, 2]) / horizontal2
    jacobian[3, 1] = -(ahead * rotation[0, 0] - beside * rotation[0, 2]) / horizontal2
    for i in range(4):
        for j in range(6):
            for k in range(6):
                half[i, j] += jacobian[i, k] * covariance[k, j]
    for i in range(4):
        for j in range(4):
            carried[i, j] = 0.0
            for k in range(6):
                carried[i, j] += half[i, k] * jacobian[j, k]


def bar_pose_of(
    solutions: list[Solution],
    corners_px: Array,
    covariance: Array | None = None,
    reprojection_px: float | None = None,
    tail: float = GAUSSIAN_TAIL,
) -> BarPose:
    """The first solution as a message; its covariance weighs the others by their likelihood.

    Args:
        solutions: of one picture, the one taken first.
        corners_px: (k,4,2) the corners they rest on.
        covariance: (4,4) of the first solution, where its Jacobian is not enough (`covariance_over_tilts`).
        reprojection_px: of the sides that are seen, where not all are.
        tail: of the corners' errors.
    """
    taken = solutions[0]
    pose, here, excess = taken.camera_from_plane, np.empty(4), taken.excess
    if covariance is None:
        covariance = np.empty((4, 4))
        _carry_with_bend(pose.rotation, pose.translation_m, taken.covariance, excess, here, covariance)
    else:
        _place(pose.rotation, pose.translation_m, here)
    for other in solutions[1:]:
        better = (other.chi2 - taken.chi2) / excess
        ratio = likelihood(abs(better), tail)
        share = ratio / (1.0 + ratio) if better > 0.0 else 1.0 / (1.0 + ratio)
        if share < _LEAST_SHARE:
            continue
        apart = _joined(other.camera_from_plane) - here
        apart[3] = math.remainder(apart[3], math.tau)
        if apart @ np.linalg.solve(covariance, apart) < _COVERED:
            continue
        other_covariance = excess * covariance_in_bar(other) + np.outer(apart, apart)
        covariance = (1.0 - share) * covariance + share * other_covariance
    error_px = taken.reprojection_px if reprojection_px is None else reprojection_px
    return BarPose(here[:3], float(here[3]), covariance, error_px, corners_px.reshape(-1, 2))


def covariance_over_tilts(
    taken: Solution, corners: Corners, camera: Camera, prior: LevelPrior | None, tail: float = GAUSSIAN_TAIL
) -> Array | None:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) over all angles at which the cue may stand to the camera.

    From afar the corners measure the angle about an axis in the cue's plane by a cosine: they fit over a wide range of
    it, unevenly to either side. About the cue's vertical that is its heading; about its horizontal axis it is the
    camera's height, unless the gimbal's vertical is known. Poses over that range are weighted by how well they fit.
    None where the Jacobian is enough: the angles are well known, or no pose beside fits.
    """
    pose, carried = taken.camera_from_plane, np.empty((4, 4))
    if not math.sqrt(taken.excess * float(np.diag(taken.covariance)[:3].sum())) > _FLAT_RAD:
        return None
    problem = problem_of(corners, camera, prior)
    return (
        carried
        if _carry_over_tilts(
            problem, pose.rotation, pose.translation_m, taken.covariance, taken.chi2, taken.excess, tail, carried
        )
        else None
    )


@compiled
def _carry_over_tilts(
    problem: Problem,
    rotation: Array,
    translation_m: Array,
    covariance: Array,
    chi2: float,
    excess: float,
    tail: float,
    carried: Array,
) -> bool:
    """Write `covariance_over_tilts`; False where the Jacobian is enough."""
    here, there, left, more = np.empty(4), np.empty(4), covariance.copy(), np.zeros((4, 4))
    axis, turn, along, square, found = np.empty(3), np.empty(3), np.empty(6), np.empty((4, 4)), False
    _place(rotation, translation_m, here)
    for index in range(2):
        std_rad = math.sqrt(excess * max(_in_plane_axis(rotation, covariance, index == 1, axis), 0.0))
        if not std_rad > _FLAT_RAD:
            continue
        weight, beside = 1.0, 0
        for _ in range(_NARROWER):
            weight, beside = 1.0, 0
            for i in range(4):
                for j in range(4):
                    square[i, j] = 0.0
            for sigmas in _FLAT_SIGMAS:
                for i in range(3):
                    turn[i] = std_rad * sigmas * axis[i]
                solved, turned, shifted_m, turned_chi2 = turned_pose(problem, rotation, turn)
                if not solved:
                    continue
                _place(turned, shifted_m, there)
                for i in range(4):
                    there[i] -= here[i]
                there[3] = (there[3] + math.pi) % math.tau - math.pi
                share = likelihood(max(turned_chi2 - chi2, 0.0) / excess, tail)
                _add_square(share, there, square)
                weight, beside = weight + share, beside + 1
            if weight >= _LEAST_WEIGHT:
                break
            std_rad *= 0.5
        if beside == 0:
            continue
        found, variance = True, 0.0
        for i in range(6):
            along[i] = left[i, 0] * axis[0] + left[i, 1] * axis[1] + left[i, 2] * axis[2]
        for i in range(3):
            variance += along[i] * axis[i]
        for i in range(4):
            for j in range(4):
                more[i, j] += square[i, j] / weight
        _add_square(-1.0 / variance, along, left)
    _carry_covariance(rotation, translation_m, left, carried)
    for i in range(4):
        for j in range(4):
            carried[i, j] = excess * carried[i, j] + more[i, j]
    return found


@compiled
def _add_square(share: float, vector: Array, square: Array) -> None:
    """Add the outer product of a vector (n,) with itself to (n,n), `share` times."""
    for i in range(len(vector)):
        for j in range(len(vector)):
            square[i, j] += share * (vector[i] * vector[j])


@compiled
def _in_plane_axis(rotation: Array, covariance: Array, wider: bool, axis: Array) -> float:
    """Write the axis (3,) in the cue's plane about which the angle is known less (`wider`) or best; its variance."""
    across = down = both = 0.0
    for i in range(3):
        for j in range(3):
            across += rotation[i, 0] * covariance[i, j] * rotation[j, 0]
            down += rotation[i, 1] * covariance[i, j] * rotation[j, 1]
            both += rotation[i, 0] * covariance[i, j] * rotation[j, 1]
    mean, half = 0.5 * (across + down), 0.5 * (across - down)
    apart, angle = math.sqrt(half * half + both * both), 0.5 * math.atan2(both, half)
    cosine, sine = (math.cos(angle), math.sin(angle)) if wider else (-math.sin(angle), math.cos(angle))
    for i in range(3):
        axis[i] = cosine * rotation[i, 0] + sine * rotation[i, 1]
    return mean + apart if wider else mean - apart


@compiled
def likelihood(chi2: float, tail: float) -> float:
    """Of a pose, relative to the one that fits best, by how much larger its χ² is: Student's, of `tail` degrees."""
    return float((1.0 + chi2 / tail) ** (-0.5 * (tail + 1.0)))


@compiled
def _carry_with_bend(
    rotation: Array, translation_m: Array, covariance: Array, excess: float, here: Array, carried: Array
) -> None:
    """Write (4,) position and yaw, and (4,4) their covariance: carried, times its excess, with that of their arc.

    From afar the angle about the cue's vertical is known least. Position and yaw change together with it, and leave the
    covariance's straight line by h per squared standard deviation, on average of the square √3 h.
    """
    bend = np.zeros(4)
    _place(rotation, translation_m, here)
    _carry_covariance(rotation, translation_m, covariance, carried)
    _write_bend(rotation, translation_m, covariance, here, bend)
    for i in range(4):
        for j in range(4):
            carried[i, j] = excess * (carried[i, j] + excess * (3.0 * (bend[i] * bend[j])))


@compiled
def _write_bend(rotation: Array, translation_m: Array, covariance: Array, here: Array, bend: Array) -> None:
    """Write (4,) h, the mean of both ends of the arc less its middle; nothing where the arc is micrometres."""
    along = np.zeros(6)
    for i in range(6):
        for k in range(3):
            along[i] += covariance[i, k] * rotation[k, 1]
    variance = along[0] * rotation[0, 1] + along[1] * rotation[1, 1] + along[2] * rotation[2, 1]
    std_rad = math.sqrt(max(variance, 0.0))
    if not std_rad > _BENT_RAD:
        return
    turn, shifted_m, end = np.empty(3), np.empty(3), np.empty(4)
    for i in range(4):
        bend[i] = -here[i]
    for sign in (-1.0, 1.0):
        for i in range(3):
            turn[i] = sign * (along[i] / std_rad)
            shifted_m[i] = translation_m[i] + sign * (along[3 + i] / std_rad)
        _place(exp_rotation(turn, rotation), shifted_m, end)
        for i in range(4):
            bend[i] += 0.5 * end[i]
    bend[3] -= math.pi * round(bend[3] / math.pi)
