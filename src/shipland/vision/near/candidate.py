"""From a hypothesis to a pose that has stood every test, or to the reason why it has not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.messages import BarPose
from shipland.rig import Target
from shipland.vision.near.corners import measure_corners
from shipland.vision.near.matching import Match, model_plane
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.pose import (
    DISPROVED,
    Corners,
    LevelPrior,
    Solution,
    covariance_in_bar,
    poses_about_vertical,
    position_and_yaw,
    solve,
)
from shipland.vision.near.refusal import Refusal
from shipland.vision.near.regions import Image, Region, edge_distances
from shipland.vision.near.rows import Followed, RowMotion, row_motion
from shipland.vision.near.sides import distort

_CLEAR_CHI2 = 9.0
"""By how much one planar solution must fit better to be taken against continuity."""

_LEAST_SHARE = 1e-4
"""Probability of the other planar solution that still counts in the covariance."""

_BENT_RAD = 2e-3
"""Standard deviation of the angle about the cue's vertical from which the covariance allows for the arc; below, it is
micrometres."""

_FLAT_RAD = 0.01
"""Standard deviation of that angle from which it is looked at how well the corners fit beside the solution: its cosine,
by which they tell it, is no straight line."""

_FLAT_SIGMAS = np.array([-2.5, -1.25, 1.25, 2.5])
"""Where, in these standard deviations."""

_NARROW = 0.5
"""Share of the yaw's variance by the Jacobian that what is found there must leave."""

_REPROJECTION_NOISE = 4.0
"""Standard deviations of a corner that the reprojection error may reach besides."""

_MOST_COMMON = 3.0
"""Standard deviations of what corners may err by in common; more excuses rectangles of other dimensions."""

_MOST_NOISE_PX = 0.1
"""What these may amount to: sides that are smeared or frayed state a noise that would excuse any shape."""

_JUMP_M, _JUMP_SIGMAS = 0.5, 4.0
"""Change of height, and its standard deviations, that poses may differ by in no time."""

_EDGE_PX = 1.0
"""How far beyond the picture's edge a side that seems to lie on it may be."""

_WHOLE = 0.98
"""Share of a foreseen quadrilateral in the picture from which it should have been found whole."""

_COVERED = 0.6
"""Least share of a foreseen quadrilateral's visible part, and of a cut region, that the two must have in common."""


@dataclass(frozen=True)
class Evidence:
    """What a frame brings to judge a hypothesis by.

    Attributes:
        image: (H,W,3) BGR.
        cut: coloured regions that reach the picture's edge.
        prior: what the gimbal knows, or None.
        last: the last pose, camera_from_plane, or None.
        blur_px: the last picture's blur, or None.
        followed: where the last picture showed all of the cue's corners, or None.
    """

    image: Image
    cut: Sequence[Region]
    prior: LevelPrior | None
    last: Pose | None
    blur_px: float | None
    followed: Followed | None = None


@dataclass(frozen=True)
class PoseCandidate:
    """A pose and what it rests on.

    Attributes:
        match: which quadrilaterals of the picture.
        solutions: the planar solutions, the one taken first.
        corners_px: (k,4,2) where the picture shows the corners, once all sides are freed of what they err by together.
        measured_px: (k,4,2) the corners as measured, undistorted.
        blur_px: the picture's blur, where it was measured.
        spread: (4,4) covariance of the first solution where its Jacobian does not tell it, else None.
    """

    match: Match
    solutions: list[Solution]
    corners_px: Array
    measured_px: Array
    blur_px: float | None
    spread: Array | None = None

    @property
    def camera_from_plane(self) -> Pose:
        """The pose taken."""
        return self.solutions[0].camera_from_plane

    @property
    def level_off_rad(self) -> float:
        """See `Solution`."""
        return self.solutions[0].level_off_rad

    @property
    def distance_m(self) -> float:
        """From the camera to the cue's origin."""
        return float(np.linalg.norm(self.camera_from_plane.translation_m))

    @cached_property
    def bar_pose(self) -> BarPose:
        """What crosses to the pilot."""
        return bar_pose_of(self.solutions, self.corners_px, self.spread)


def ordered(solutions: list[Solution], last: Pose | None) -> list[Solution]:
    """The planar solutions, the one to take first: by fit where that is clear, else by continuity with `last`."""
    if len(solutions) < 2 or last is None:
        return solutions
    if solutions[1].chi2 - solutions[0].chi2 > _CLEAR_CHI2 * solutions[0].excess:
        return solutions
    return sorted(solutions, key=lambda s: -float(np.sum(s.camera_from_plane.rotation * last.rotation)))


def bar_pose_of(solutions: list[Solution], corners_px: Array, spread: Array | None = None) -> BarPose:
    """The first solution as a message; its covariance weighs the others by their likelihood.

    Args:
        solutions: of one picture, the one taken first.
        corners_px: (k,4,2) the corners they rest on.
        spread: (4,4) the first solution's covariance, where its Jacobian does not tell it.
    """
    taken = solutions[0]
    position_in_bar_m, yaw_rad = position_and_yaw(taken.camera_from_plane)
    excess = taken.excess
    here = _joined(position_in_bar_m, yaw_rad)
    covariance = excess * (covariance_in_bar(taken) + excess * _bend(taken, here)) if spread is None else spread
    for other in solutions[1:]:
        share = 1.0 / (1.0 + math.exp(min(max(0.5 * (other.chi2 - taken.chi2) / excess, -50.0), 50.0)))
        if share < _LEAST_SHARE:
            continue
        other_position_in_bar_m, other_yaw_rad = position_and_yaw(other.camera_from_plane)
        apart = _joined(other_position_in_bar_m - position_in_bar_m, other_yaw_rad - yaw_rad)
        apart[3] = math.remainder(apart[3], math.tau)
        other_covariance = excess * covariance_in_bar(other) + np.outer(apart, apart)
        covariance = (1.0 - share) * covariance + share * other_covariance
    return BarPose(position_in_bar_m, yaw_rad, covariance, taken.reprojection_px, corners_px.reshape(-1, 2))


def _joined(position_m: Array, yaw_rad: float) -> Array:
    """(4,) a position and a yaw."""
    return np.array([*position_m.tolist(), yaw_rad])


def _bend(solution: Solution, here: Array) -> Array:
    """(4,4) what the covariance of (position in `bar` [m], yaw [rad]) lacks since the camera errs along an arc.

    `here` (4,) is that position and yaw. From afar the angle about the cue's vertical is what is known least; along
    it position and yaw change together, and bend away from the covariance's straight line by h per squared standard
    deviation, on average of the square √3 h.
    """
    pose, down = solution.camera_from_plane, solution.camera_from_plane.rotation[:, 1]
    along = solution.covariance[:, :3] @ down
    spread_rad = math.sqrt(max(float(along[:3] @ down), 0.0))
    if not spread_rad > _BENT_RAD:
        return np.zeros((4, 4))
    step = along / spread_rad
    turn, way_m = cv2.Rodrigues(step[:3])[0], step[3:]
    back = np.ascontiguousarray(turn.T)
    ahead = _joined(*position_and_yaw(Pose(turn @ pose.rotation, pose.translation_m + way_m)))
    behind = _joined(*position_and_yaw(Pose(back @ pose.rotation, pose.translation_m - way_m)))
    bend = 0.5 * (ahead + behind) - here
    bend[3] = math.remainder(bend[3], math.pi)
    return 3.0 * np.outer(bend, bend)


def spread_of(taken: Solution, corners: Corners, camera: Camera, prior: LevelPrior | None) -> Array | None:
    """(4,4) covariance of (position in `bar` [m], yaw [rad]) over all angles about the cue's vertical.

    From afar that angle is told by a cosine, so the corners fit over a wide range of it, and not evenly to either side.
    Poses are weighed there by how well they fit. None where the Jacobian tells all, since the angle is known well or no
    pose beside fits.
    """
    excess, down = taken.excess, taken.camera_from_plane.rotation[:, 1]
    along = taken.covariance[:, :3] @ down
    variance = max(float(along[:3] @ down), 0.0)
    spread_rad = math.sqrt(excess * variance)
    if not spread_rad > _FLAT_RAD:
        return None
    here = _joined(*position_and_yaw(taken.camera_from_plane))
    # What is left unknown when the angle is known.
    known = replace(taken, covariance=taken.covariance - np.outer(along, along) / variance)
    weight, square = 1.0, np.zeros((4, 4))
    for beside in poses_about_vertical(taken, _FLAT_SIGMAS * spread_rad, corners, camera, prior):
        off = _joined(*position_and_yaw(beside.camera_from_plane)) - here
        off[3] = math.remainder(off[3], math.tau)
        share = math.exp(min(0.5 * (taken.chi2 - beside.chi2) / excess, 0.0))
        square += share * np.outer(off, off)
        weight += share
    spread = np.asarray(excess * covariance_in_bar(known) + square / weight)
    # Where the poses beside fit nothing, they are no account of what fits.
    narrow = spread[3, 3] < _NARROW * excess * covariance_in_bar(taken)[3, 3]
    return None if narrow else spread


def largest_reprojection_px(
    corners_px: Array, noise_px: float, manufacturing_tolerance: float, parameters: VisionParameters
) -> float:
    """Root-mean-square distance up to which corners fit the cue.

    Args:
        corners_px: (k,4,2) measured.
        noise_px: their largest standard deviation.
        manufacturing_tolerance: what the cue's dimensions are made to (`Target.manufacturing_tolerance`).
        parameters: of the near chain.
    """
    diagonal_px = math.hypot(*np.ptp(corners_px.reshape(-1, 2), axis=0))
    most_px = parameters.reprojection_px + manufacturing_tolerance * diagonal_px
    return most_px + min(_REPROJECTION_NOISE * noise_px, _MOST_NOISE_PX)


class Judge:
    """Measures and tests hypotheses about one cue, seen with one camera."""

    def __init__(self, target: Target, camera: Camera, parameters: VisionParameters) -> None:
        self.plane_m = model_plane(target)
        self._made_to = target.manufacturing_tolerance
        self._camera = camera
        self._parameters = parameters

    def judge(self, match: Match, evidence: Evidence) -> PoseCandidate | Refusal:
        """Sub-pixel corners, pose, reprojection gate, screening, reach."""
        measured = measure_corners(evidence.image, match.quads_px, self._camera, self._parameters, evidence.blur_px)
        if measured is None:
            return Refusal.CORNERS_UNSURE
        corners_px = measured.corners_px
        if measured.blur_px is not None and measured.blur_px > self._parameters.max_blur * _shortest_px(corners_px):
            return Refusal.CORNERS_UNSURE
        if measured.noise_px > self._parameters.max_noise * _shortest_px(corners_px):
            return Refusal.CORNERS_UNSURE
        plane_m = self.plane_m[list(match.model)]
        common_px = None if measured.edge_bias_px is None else measured.edge_bias_px[None]
        if self._camera.row_time_s > 0.0:
            moved = self._row_motion(corners_px, match, evidence.followed)
            corners_px = corners_px - moved.moved_px
            common_px = moved.unsure_px if common_px is None else np.concatenate([common_px, moved.unsure_px])
        corners = Corners(corners_px, measured.whiten, plane_m, common_px)
        solutions, corners = self._solved(corners, evidence)
        if not solutions:
            return Refusal.NO_SOLUTION
        taken = solutions[0]
        if common_px is not None:
            if not np.abs(taken.common).max() <= _MOST_COMMON:
                return Refusal.REPROJECTION
            corners_px = corners_px - np.tensordot(taken.common, common_px, axes=1)
        seen_px = measured.corners_px
        if measured.edge_bias_px is not None:
            seen_px = seen_px - taken.common[0] * measured.edge_bias_px
        most_px = largest_reprojection_px(corners_px, measured.noise_px, self._made_to, self._parameters)
        if not taken.reprojection_px <= most_px:
            return Refusal.REPROJECTION
        if measured.held and self._beyond_edge(seen_px, taken.residual_px, evidence.image):
            return Refusal.CUT_BY_FRAME
        if not sides_agree(corners_px, corners_px + taken.residual_px, measured.noise_px, self._parameters):
            return Refusal.SIDES_UNEQUAL
        if not within_reach(taken.camera_from_plane, self._parameters):
            return Refusal.OUT_OF_REACH
        raw_px = distort(seen_px.reshape(-1, 2), self._camera).reshape(-1, 4, 2)
        spread = spread_of(taken, corners, self._camera, evidence.prior)
        return PoseCandidate(match, solutions, raw_px, measured.corners_px, measured.blur_px, spread)

    def _row_motion(self, corners_px: Array, match: Match, followed: Followed | None) -> RowMotion:
        """What the rows' own times do to measured corners (k,4,2)."""
        rows = distort(corners_px.reshape(-1, 2), self._camera)[:, 1].reshape(-1, 4)
        model = list(match.model)
        last = None if followed is None else replace(followed, corners_px=followed.corners_px[model])
        return row_motion(corners_px, rows, self.plane_m[model], self._camera, self._parameters, last)

    def _solved(self, corners: Corners, evidence: Evidence) -> tuple[list[Solution], Corners]:
        """The planar solutions, the one taken first, and the corners as they were then taken to be known.

        Corners that lie much farther from where any pose has them than they were stated to are not known to what was
        stated, as when rows are exposed one after the other: they are solved anew, all known alike, to that distance.
        """
        solutions = ordered(solve(corners, self._camera, evidence.prior, evidence.last), evidence.last)
        if not solutions or solutions[0].excess < DISPROVED:
            return solutions, corners
        free = solutions if evidence.prior is None else solve(corners, self._camera)
        if not free or free[0].excess < DISPROVED:
            return solutions, corners  # it is the gimbal's word that does not fit
        taken = solutions[0]
        noise_px = math.sqrt(float(np.vdot(taken.residual_px, taken.residual_px)) / taken.freedom)
        corners_px = corners.undistorted_px
        whiten = np.broadcast_to(np.eye(8) / noise_px, (len(corners_px), 8, 8))
        alike = Corners(corners_px, whiten, corners.plane_m, corners.common_px)
        again = ordered(solve(alike, self._camera, evidence.prior, evidence.last), evidence.last)
        return (again, alike) if again else (solutions, corners)

    def projected_px(self, camera_from_plane: Pose) -> Array:
        """(n,4,2) all corners of the cue in the picture; NaN where they are not in front of the camera."""
        points = np.zeros((self.plane_m.size // 2, 3))
        points[:, :2] = self.plane_m.reshape(-1, 2)
        return self._camera.project(camera_from_plane.apply(points)).reshape(-1, 4, 2)

    def explains_absence(self, sighting: PoseCandidate, cut: Sequence[Region]) -> bool:
        """Whether the picture's edge explains the quadrilaterals that the sighting lacks.

        None of them may be one that should be there whole; and unless at least two quadrilaterals are whole, one that
        the edge cuts must be found where the pose foresees it.
        """
        foreseen_px = self.projected_px(sighting.camera_from_plane)
        if not np.isfinite(foreseen_px).all():
            return False
        size_px = (self._camera.width_px, self._camera.height_px)
        proven = len(sighting.match.model) > 1
        for model in range(len(self.plane_m)):
            if model in sighting.match.model:
                continue
            quad_px = foreseen_px[model]
            visible_px2 = _clipped_area(quad_px, size_px)
            if visible_px2 >= _WHOLE * abs(cv2.contourArea(quad_px.astype(np.float32))):
                return False
            proven |= visible_px2 > 0.0 and any(_same_place(quad_px, region, size_px) for region in cut)
        return proven

    def _beyond_edge(self, corners_px: Array, residual_px: Array, image: Image) -> bool:
        """Whether a corner that was set on the picture's edge lies more than a pixel off it by the pose."""
        raw_px = distort(corners_px.reshape(-1, 2), self._camera).reshape(corners_px.shape)
        distances_px = edge_distances(raw_px, image.shape[1], image.shape[0])
        held = distances_px < 0.5
        off_px = np.abs(residual_px[..., [0, 1, 0, 1]])
        return bool(np.any(held & (off_px > _EDGE_PX)))


def within_reach(camera_from_plane: Pose, parameters: VisionParameters) -> bool:
    """Whether a pose lies within the range and obliquity that are accepted."""
    sight_m = camera_from_plane.translation_m
    distance_m, facing = float(np.linalg.norm(sight_m)), float(camera_from_plane.rotation[:, 2] @ sight_m)
    least_facing = math.cos(math.radians(parameters.max_obliquity_deg))
    return distance_m <= parameters.max_distance_m and facing >= least_facing * distance_m


def jumps(pose: BarPose, last: Pose, passed_s: float, parameters: VisionParameters) -> bool:
    """Whether the camera would have risen or sunk since the last pose faster than an aircraft does.

    The image of a cue that is its own reflection, in a wet deck or in water, is that of a cue which hangs lower.

    Args:
        pose: found now.
        last: the last pose, camera_from_plane.
        passed_s: time between them.
        parameters: how fast that is.
    """
    if parameters.track_climb_mps <= 0.0:
        return False
    last_in_bar_m, _ = position_and_yaw(last)
    risen_m = abs(float(pose.position_in_bar_m[2] - last_in_bar_m[2]))
    unsure_m = _JUMP_SIGMAS * math.sqrt(max(float(pose.covariance[2, 2]), 0.0))
    return risen_m > _JUMP_M + unsure_m + parameters.track_climb_mps * passed_s


def _shortest_px(quads_px: Array) -> float:
    """The shortest side of quadrilaterals (n,4,2)."""
    points = np.ascontiguousarray(quads_px).view(np.complex128)[..., 0]
    return float(np.abs(points - points[:, [1, 2, 3, 0]]).min())


def _picture_corners(size_px: tuple[int, int]) -> Array:
    width, height = size_px
    return np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])


def _clipped_area(quad_px: Array, size_px: tuple[int, int]) -> float:
    """Area [px²] of the part of a convex quadrilateral that lies in the picture."""
    area, _ = cv2.intersectConvexConvex(quad_px.astype(np.float32), _picture_corners(size_px).astype(np.float32))
    return float(area)


def _same_place(quad_px: Array, region: Region, size_px: tuple[int, int]) -> bool:
    """Whether a cut region fills what the picture shows of a foreseen quadrilateral, and no more."""
    hull = cv2.convexHull(region.contour_px).astype(np.float32)
    hull_px2 = cv2.contourArea(hull)
    visible_px2 = _clipped_area(quad_px, size_px)
    common_px2, _ = cv2.intersectConvexConvex(quad_px.astype(np.float32), hull)
    return common_px2 >= _COVERED * visible_px2 and common_px2 >= _COVERED * hull_px2 and hull_px2 > 0.0


_NEXT = np.array([1, 2, 3, 0])

_NOISE = 4.0
"""Standard deviations of a corner that a side's end may be off besides."""


def sides_agree(measured_px: Array, foreseen_px: Array, noise_px: float, parameters: VisionParameters) -> bool:
    """Whether opposite sides agree within ±10 % in length and ±5 % in slope.

    As printed, the lengths of opposite sides are compared with each other, and so are their slopes, here each against
    the other's direction, so that steep sides have one too. A rectangle seen obliquely from near by fails that: at 2 m
    and 40° off, one end of the rig's rectangle is 15 % longer than the other. Read against perspective, the ratio of
    the lengths and the difference of the slopes are compared with those that the pose foresees; for a distant or
    frontal view both readings are one.

    Args:
        measured_px: (k,4,2) corners, clockwise from the first.
        foreseen_px: (k,4,2) the same corners projected with the pose.
        noise_px: standard deviation of a measured corner; four of them are allowed besides.
        parameters: reading and tolerances.
    """
    (ratio, foreseen), (shorter_px, _) = _opposites(np.array([measured_px, foreseen_px]))
    if parameters.screening == "perspective":
        ratio = ratio / foreseen
    # Corners of a small rectangle are not known finely enough for the fractions to mean anything.
    unsure = (parameters.screening_px + _NOISE * noise_px) / np.minimum(shorter_px, 1e6)
    length = np.abs(ratio)
    tolerance = 1.0 + np.maximum(parameters.length_tolerance, unsure)
    steepest = np.maximum(parameters.slope_tolerance, unsure)
    agree = (length <= tolerance) & (length * tolerance >= 1.0)
    agree &= np.abs(ratio.imag) <= steepest * np.maximum(ratio.real, 1e-9)
    return bool(agree.all())


def _opposites(quads_px: Array) -> tuple[npt.NDArray[np.complex128], Array]:
    """(…,2) ratio of opposite sides, top to bottom and right to left, as complex numbers; (…,2) the shorter's length.

    The magnitude is the ratio of the lengths, the angle's tangent the difference of the slopes.
    """
    corners = quads_px.view(np.complex128)[..., 0]
    sides = corners[..., _NEXT] - corners
    lengths = np.abs(sides)
    with np.errstate(divide="ignore", invalid="ignore"):
        return sides[..., :2] / -sides[..., 2:], np.minimum(lengths[..., :2], lengths[..., 2:])
