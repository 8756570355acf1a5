"""The geometric camera: no picture, but the true corners with the rendered camera's errors, and the pose they lead to.

It answers the same `Observation` as the near vision and costs a fiftieth, so that thousands of landings can be
flown. Its error model is fitted to rendered pictures (`tools/fit_geometric.py`); a test compares the two. The pose is
the near vision's solver's, found from the truth (`drawn_pose`); another compares these. Where the gimbal's vertical
does not fit the corners, the solver itself decides, and the pose must pass the near vision's gates.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import Camera
from shipland.cue import Cue
from shipland.frames import Array, Pose
from shipland.geometric.drawn_pose import CornerMeasurement, inside, pose_from_truth, projected, relative_pose
from shipland.geometric.parameters import GeometricParameters
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.vehicles.vehicle import GroundTruthSource
from shipland.vision.near.covariance import bar_pose_of
from shipland.vision.near.gates import Refusal, gimbal_off, jumps, largest_reprojection_px, within_reach
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.planar_pose import (
    CONTRADICTION_CHI2,
    DOUBTFUL_CHI2,
    NO_COMMON_ERROR,
    Corners,
    LevelPrior,
    Solution,
    level_off,
    ordered,
    solve,
)


class GeometricVision:
    """Near vision without a picture, for a vehicle whose truth is known and whose camera has no distortion."""

    def __init__(
        self,
        truth_source: GroundTruthSource,
        cue: Cue,
        camera: Camera,
        parameters: GeometricParameters,
        near: VisionParameters,
        rng: np.random.Generator,
    ) -> None:
        self._truth_source, self._camera, self._near = truth_source, camera, near
        self._matrix = np.ascontiguousarray(camera.matrix)
        self._parameters = parameters
        self._least_facing = math.cos(math.radians(near.max_obliquity_deg))
        self._rng = rng
        self._tolerance = cue.manufacturing_tolerance
        self._plane_m = np.ascontiguousarray(cue.points_in_bar_m[:, 1:])
        border_px = parameters.border_px
        self._last: tuple[float, Pose] | None = None
        self._low_px = border_px
        self._high_px = np.array([camera.width_px - 1 - border_px, camera.height_px - 1 - border_px])

    def see(self, frame: Frame) -> Observation:
        """What near vision would make of the picture; never raises."""
        # Drawn for every frame, seen or not: the random numbers of later frames do not depend on this one's outcome.
        noise = self._rng.standard_normal(self._plane_m.shape)
        missed = self._rng.random() < self._parameters.miss_rate
        truth = self._truth_source.truth_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        camera, bar = truth.ned_from_camera, truth.ned_from_bar
        rotation, sight_m = relative_pose(camera.rotation, camera.translation_m, bar.rotation, bar.translation_m)
        range_m = math.hypot(*sight_m.tolist())
        if missed or range_m > self._parameters.max_range_m:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NOTHING_GREEN.value)
        if float(rotation[:, 2] @ sight_m) < self._least_facing * range_m:  # the board has no cue on its back
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.OUT_OF_REACH.value)
        sigma_px = self._parameters.corner_noise_px + self._parameters.corner_noise_px_per_m * range_m
        corners_px = projected(rotation, sight_m, self._plane_m, self._matrix) + sigma_px * noise
        if not inside(corners_px, self._low_px, self._high_px):
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.CUT_BY_FRAME.value)
        down, noise_rad = _down_in_camera(frame.gimbal), self._near.gimbal_noise_rad
        measured = CornerMeasurement(self._plane_m, self._matrix, corners_px, sigma_px, down, noise_rad)
        last = self._last if self._last is not None and 0.0 <= frame.t_s - self._last[0] <= self._near.track_s else None
        solutions = self._solved(rotation, sight_m, measured, None if last is None else last[1])
        quads_px = corners_px.reshape(-1, 4, 2)
        if not solutions:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_SOLUTION.value)
        bar_pose = bar_pose_of(solutions, quads_px)
        if solutions[0].level_off_rad > 0.0:
            return gimbal_off(frame, solutions[0].level_off_rad)
        refused = self._refused(solutions[0], bar_pose.reprojection_px, quads_px, sigma_px)
        if not refused and last is not None and jumps(bar_pose, last[1], frame.t_s - last[0], self._near):
            refused = Refusal.JUMP.value
        if refused:
            return Observation(frame.t_s, frame.gimbal, reason=refused)
        self._last = frame.t_s, solutions[0].camera_from_plane
        return Observation(frame.t_s, frame.gimbal, bar_pose=bar_pose)

    def _solved(
        self, rotation: Array, sight_m: Array, measured: CornerMeasurement, last: Pose | None
    ) -> list[Solution]:
        """What the solver makes of measured corners, the pose to take first."""
        held = _solution(rotation, sight_m, measured)
        prior = LevelPrior(measured.down_in_camera, measured.level_rad) if measured.level_rad > 0.0 else None
        if held is not None and held.chi2 < DOUBTFUL_CHI2 * measured.corners_px.size:
            free = None
            if prior is not None and held.chi2 > CONTRADICTION_CHI2:
                free = _solution(rotation, sight_m, measured._replace(level_rad=0.0))
            if prior is None or free is None or level_off(held, free, prior) == 0.0:
                return [held]
        quads_px, quads_m = measured.corners_px.reshape(-1, 4, 2), measured.plane_m.reshape(-1, 4, 2)
        corners = Corners(quads_px, np.broadcast_to(np.eye(8) / measured.sigma_px, (len(quads_px), 8, 8)), quads_m)
        return ordered(solve(corners, self._camera, prior, last), last)

    def _refused(self, taken: Solution, reprojection_px: float, quads_px: Array, sigma_px: float) -> str:
        """Why near vision would not believe a pose; empty where it would."""
        near = self._near
        if not reprojection_px <= largest_reprojection_px(quads_px, sigma_px, self._tolerance, near):
            return Refusal.REPROJECTION.value
        return "" if within_reach(taken.camera_from_plane, near) else Refusal.OUT_OF_REACH.value


def _solution(rotation: Array, sight_m: Array, measured: CornerMeasurement) -> Solution | None:
    """The pose that the solver would find; None when the corners do not settle one."""
    settled, *pose, chi2, covariance, residual_px = pose_from_truth(rotation, sight_m, measured)
    if not settled:
        return None
    freedom = residual_px.size - 6 + (2 if measured.level_rad > 0.0 else 0)
    return Solution(Pose(*pose), chi2, covariance, NO_COMMON_ERROR, residual_px.reshape(-1, 4, 2), freedom)


def _down_in_camera(gimbal: GimbalAttitude) -> Array:
    """(3,) the vertical as the gimbal has it."""
    c, s = math.cos(gimbal.pitch_rad), math.sin(gimbal.pitch_rad)
    return np.array([c * math.sin(gimbal.roll_rad), c * math.cos(gimbal.roll_rad), -s])
