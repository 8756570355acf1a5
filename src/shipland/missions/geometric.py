"""The geometric camera: no picture, but the true corners with the rendered camera's errors, and the same pose solver.

It answers the same `Observation` as the near vision and costs a twentieth, so that thousands of landings can be
flown. Its error model is fitted to rendered pictures (`tools/fit_geometric.py`); a test compares the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.config import require
from shipland.frames import Array, Pose
from shipland.messages import Frame, Observation
from shipland.missions.geometric_far import BoxErrors, BoxParameters
from shipland.rig import Target
from shipland.vehicles.vehicle import Witness
from shipland.vision.near.pose import Corners, LevelPrior, solve
from shipland.vision.near.refusal import Refusal
from shipland.vision.near.sighting import bar_pose_of, ordered


@dataclass(frozen=True)
class GeometricParameters:
    """`[geometric]`: the error model of the vision, fitted to rendered pictures.

    Attributes:
        corner_noise_px, corner_noise_px_per_m: standard deviation of a corner's column and row, each, at range zero,
            and its growth with range.
        max_range_m: beyond it nothing is found.
        miss_rate: share of frames without a pose within that range.
        border_px: a corner nearer than this to the picture's edge is cut off.
        ship, bar, boxes: of the far vision.
    """

    corner_noise_px: float
    corner_noise_px_per_m: float
    max_range_m: float
    miss_rate: float
    border_px: float
    ship: BoxErrors
    bar: BoxErrors
    boxes: BoxParameters

    def __post_init__(self) -> None:
        require(self.corner_noise_px > 0.0, "corner_noise_px must be positive")
        require(self.corner_noise_px_per_m >= 0.0, "corner_noise_px_per_m must not be negative")
        require(self.max_range_m > 0.0, "max_range_m must be positive")
        require(0.0 <= self.miss_rate < 1.0, "miss_rate must be in [0, 1)")
        require(self.border_px >= 0.0, "border_px must not be negative")


class GeometricVision:
    """Near vision without a picture, for a vehicle whose truth is known."""

    def __init__(
        self,
        witness: Witness,
        target: Target,
        camera: Camera,
        parameters: GeometricParameters,
        gimbal_noise_rad: float,
        rng: np.random.Generator,
    ) -> None:
        self._witness = witness
        self._camera = camera
        self._parameters = parameters
        self._gimbal_noise_rad = gimbal_noise_rad
        self._rng = rng
        self._points_in_bar_m = target.points_in_bar_m
        self._plane_m = self._points_in_bar_m[:, 1:].reshape(-1, 4, 2)
        self._quads = target.count
        self._last: Pose | None = None

    def see(self, frame: Frame) -> Observation:
        """What near vision would make of the picture; never raises."""
        # Drawn for every frame, seen or not: a flight's numbers must not shift with one frame's luck.
        noise = self._rng.normal(0.0, 1.0, (len(self._points_in_bar_m), 2))
        missed = self._rng.random() < self._parameters.miss_rate
        truth = self._witness.truth_at(frame.t_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        camera_from_bar = truth.ned_from_camera.inverse() @ truth.ned_from_bar
        range_m = float(np.linalg.norm(camera_from_bar.translation_m))
        if missed or range_m > self._parameters.max_range_m:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NOTHING_GREEN.value)
        sigma_px = self._parameters.corner_noise_px + self._parameters.corner_noise_px_per_m * range_m
        corners_px = self._camera.project(camera_from_bar.apply(self._points_in_bar_m)) + sigma_px * noise
        border = self._parameters.border_px
        far = np.array([self._camera.width_px - 1 - border, self._camera.height_px - 1 - border])
        if not np.all((corners_px >= border) & (corners_px <= far)):
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.CUT_BY_FRAME.value)
        return self._solve(frame, corners_px, sigma_px)

    def _solve(self, frame: Frame, corners_px: Array, sigma_px: float) -> Observation:
        prior = None
        if self._gimbal_noise_rad > 0.0:
            down_in_camera = level_from_camera(frame.gimbal).T @ np.array([0.0, 0.0, 1.0])
            prior = LevelPrior(down_in_camera, self._gimbal_noise_rad)
        undistorted_px = self._camera.undistort(corners_px).reshape(-1, 4, 2)
        corners = Corners(undistorted_px, np.tile(np.eye(8) / sigma_px, (self._quads, 1, 1)), self._plane_m)
        solutions = ordered(solve(corners, self._camera, prior, self._last), self._last)
        if not solutions:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_SOLUTION.value)
        self._last = solutions[0].camera_from_plane
        return Observation(frame.t_s, frame.gimbal, bar_pose=bar_pose_of(solutions, corners_px))
