"""The fourth stage: measured corners in, the camera's pose out.

The planar solver (`planar_pose`) takes corners of one instant. A rolling shutter exposes rows one after the other while
the cue moves over the picture. The picture's time is that of its middle row; a row exposed `late_s` after it shows the
cue where it has moved by then: by its motion in the picture since the last one, and by a change of that motion. Without
a last picture only a bound of the cue's speed is known. Rows that are stretched or sheared then look like a cue that is
turned, and the pose's covariance says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shipland.camera import Camera
from shipland.cue import Cue, Hue
from shipland.frames import Array, Pose
from shipland.messages import BarPose
from shipland.vision.near.associate import Match
from shipland.vision.near.covariance import CODED_TAIL, GAUSSIAN_TAIL, bar_pose_of, covariance_over_tilts
from shipland.vision.near.edge_pixels import distort
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.hidden import Hidden, alike, seen_error_px
from shipland.vision.near.planar_pose import DISPROVED, Corners, LevelPrior, Solution, ordered, solve
from shipland.vision.parameters import VisionParameters

_AXES = np.eye(2)


@dataclass(frozen=True)
class Setup:
    """The cue, the camera and the parameters, which do not change from picture to picture.

    Attributes:
        plane_m: (n,4,2) corners (right, down) of the cue's quadrilaterals.
        manufacturing_tolerance: of the cue's dimensions (`Cue.manufacturing_tolerance`).
        camera: intrinsics.
        parameters: of the near chain.
        hue: of the cue.
    """

    plane_m: Array
    manufacturing_tolerance: float
    camera: Camera
    parameters: VisionParameters
    hue: Hue

    @staticmethod
    def of(cue: Cue, camera: Camera, parameters: VisionParameters) -> Setup:
        """For one cue."""
        return Setup(cue.plane_m, cue.manufacturing_tolerance, camera, parameters, cue.hue or parameters.hue)

    @property
    def strokes(self) -> bool:
        """Whether the cue's polygons are no quadrilaterals, and may be narrow."""
        return bool(self.plane_m.shape[1] != 4)

    def projected_px(self, camera_from_plane: Pose) -> Array:
        """(n,4,2) all corners of the cue in the picture; NaN where they are not in front of the camera."""
        points = np.zeros((self.plane_m.size // 2, 3))
        points[:, :2] = self.plane_m.reshape(-1, 2)
        return self.camera.project(camera_from_plane.apply(points)).reshape(self.plane_m.shape)


@dataclass(frozen=True)
class Followed:
    """Where the last picture showed the cue.

    Attributes:
        corners_px: (n,4,2) all of its corners, undistorted, as measured.
        since_s: from that picture to this.
        noise_px: standard deviation of a corner on either axis, about.
    """

    corners_px: Array
    since_s: float
    noise_px: float = 0.0


@dataclass(frozen=True)
class Known:
    """What is known before a picture is looked at.

    Attributes:
        level: the gimbal's vertical, or None.
        predicted_px: (n,4,2) the cue's corners by the last pose, or None.
        last: the last pose, camera_from_plane, or None.
        blur_px: the last picture's blur, or None.
        followed: where the last picture showed all of the cue's corners, or None.
    """

    level: LevelPrior | None
    predicted_px: Array | None = None
    last: Pose | None = None
    blur_px: float | None = None
    followed: Followed | None = None


@dataclass(frozen=True)
class PoseCandidate:
    """A pose that no test has accepted yet, and what it rests on.

    Attributes:
        setup: cue, camera, parameters.
        match: which quadrilaterals of the picture.
        measured: their corners.
        corners: what the pose was solved from.
        level: the gimbal's vertical, or None.
        solutions: the planar solutions, the one taken first.
        corners_px: (k,4,2) where the picture shows the corners, once freed of the sides' common error.
    """

    setup: Setup
    match: Match
    measured: MeasuredCorners
    corners: Corners
    level: LevelPrior | None
    solutions: list[Solution]
    corners_px: Array

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

    @property
    def whole(self) -> bool:
        """Whether it rests on all of the cue's quadrilaterals."""
        return len(self.match.model) == len(self.setup.plane_m)

    @property
    def freed_px(self) -> Array:
        """(k,4,2) the undistorted corners, freed of the errors that they have in common."""
        corners, common = self.corners, self.solutions[0].common
        if corners.common_px is None:
            return corners.undistorted_px
        together_px = common[None] @ corners.common_px.reshape(len(common), -1)
        return corners.undistorted_px - together_px.reshape(corners.undistorted_px.shape)

    @cached_property
    def bar_pose(self) -> BarPose:
        """What crosses to the pilot."""
        tail = CODED_TAIL if self.measured.coded else GAUSSIAN_TAIL
        covariance = covariance_over_tilts(self.solutions[0], self.corners, self.setup.camera, self.level, tail)
        return bar_pose_of(self.solutions, self.corners_px, covariance, seen_error_px(self), tail)


def solve_pose(match: Match, measured: MeasuredCorners, setup: Setup, known: Known) -> PoseCandidate | None:
    """The pose that measured corners lead to; None when no pose solves them."""
    corners_px, edge_bias_px = measured.corners_px, measured.edge_bias_px
    common_px = None if edge_bias_px is None else edge_bias_px[None]
    if setup.camera.row_time_s > 0.0:
        model, last = list(match.model), known.followed
        rows = distort(corners_px.reshape(-1, 2), setup.camera)[:, 1].reshape(corners_px.shape[:2])
        last = None if last is None else replace(last, corners_px=last.corners_px[model])
        moved = row_motion(corners_px, rows, setup.plane_m[model], setup.camera, setup.parameters, last)
        corners_px = corners_px - moved.moved_px
        common_px = moved.unsure_px if common_px is None else np.concatenate([common_px, moved.unsure_px])
    corners = Corners(corners_px, measured.whiten, setup.plane_m[list(match.model)], common_px)
    solutions, corners = _solved(corners, setup.camera, known, measured.hidden)
    if not solutions:
        return None
    shown_px = measured.corners_px
    if edge_bias_px is not None:
        shown_px = shown_px - solutions[0].common[0] * edge_bias_px
    if measured.hidden is not None:  # their corners are where the pose has them
        beside = measured.hidden | np.roll(measured.hidden, 1, axis=1)
        shown_px = shown_px + solutions[0].residual_px * beside[..., None]
    shown_px = distort(shown_px.reshape(-1, 2), setup.camera).reshape(shown_px.shape)
    return PoseCandidate(setup, match, measured, corners, known.level, solutions, shown_px)


def _solved(corners: Corners, camera: Camera, known: Known, hidden: Hidden | None) -> tuple[list[Solution], Corners]:
    """The planar solutions, the one taken first, and the corners with the covariance that they were solved with.

    Corners that lie much farther from any pose's than their covariance allows have a larger error than stated, as when
    rows are exposed one after the other. They are solved anew, all with the same deviation: the residual's.
    """
    solutions = ordered(solve(corners, camera, known.level, known.last), known.last)
    if not solutions or solutions[0].excess < DISPROVED:
        return solutions, corners
    free = solutions if known.level is None else solve(corners, camera)
    if not free or free[0].excess < DISPROVED:
        return solutions, corners  # the gimbal's vertical does not fit
    taken = solutions[0]
    noise_px = math.sqrt(float(np.vdot(taken.residual_px, taken.residual_px)) / taken.freedom)
    anew = replace(corners, whiten=alike(corners.undistorted_px, noise_px, hidden))
    again = ordered(solve(anew, camera, known.level, known.last), known.last)
    return (again, anew) if again else (solutions, corners)


@dataclass(frozen=True)
class RowMotion:
    """Motion of the corners between the times of their rows.

    Attributes:
        moved_px: (k,4,2) motion of the corners since the middle row was exposed.
        unsure_px: (2,k,4,2) its error at one standard deviation of the cue's motion along columns, and along rows.
    """

    moved_px: Array
    unsure_px: Array


def row_motion(
    corners_px: Array, rows: Array, plane_m: Array, camera: Camera, parameters: VisionParameters, last: Followed | None
) -> RowMotion:
    """Motion of the corners between the times of their rows.

    Args:
        corners_px: (k,4,2) as measured, undistorted.
        rows: (k,4) of the picture in which they were seen.
        plane_m: (k,4,2) where they lie in the cue.
        camera: its `row_time_s`.
        parameters: how fast the cue moves.
        last: the same corners in the last picture; None when it is not known.
    """
    late_s = camera.row_time_s * (rows - 0.5 * (camera.height_px - 1))
    motion_px_s, std_px_s = np.zeros(corners_px.shape), parameters.row_motion_px_s
    if last is not None:
        since_s = last.since_s + camera.row_time_s * (corners_px - last.corners_px)[..., 1:]
        if math.sqrt(2.0) * last.noise_px < parameters.row_shake_px_s * since_s.min():  # else it is mostly noise
            measured_px_s = (corners_px - last.corners_px) / since_s
            # A plane that is small in the picture moves linearly in its coordinates: the corners' errors average out.
            place = np.column_stack([np.ones(plane_m.size // 2), plane_m.reshape(-1, 2)])
            fit, *_ = np.linalg.lstsq(place, measured_px_s.reshape(-1, 2), rcond=None)
            motion_px_s, std_px_s = (place @ fit).reshape(corners_px.shape), parameters.row_shake_px_s
    unsure_px = std_px_s * late_s[..., None] * _AXES[:, None, None]
    return RowMotion(late_s[..., None] * motion_px_s, unsure_px)
