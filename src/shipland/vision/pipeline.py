"""The near chain: a frame in, an observation out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.frames import Array, Pose
from shipland.messages import BarPose, Frame, GimbalAttitude, Observation
from shipland.rig import Target
from shipland.vision.bar import Image, Region, Window, find_regions
from shipland.vision.corners import measure_corners
from shipland.vision.matching import Match, match_by_geometry, match_by_prediction, model_plane
from shipland.vision.parameters import VisionParameters
from shipland.vision.pose import Corners, LevelPrior, Solution, covariance_in_bar, position_and_yaw, solve
from shipland.vision.quads import find_quads
from shipland.vision.refusal import Refusal
from shipland.vision.screening import sides_agree
from shipland.vision.sides import distort

__all__ = ["NearVision", "Refusal", "VisionParameters"]

_CLEAR_CHI2 = 9.0
"""By how much one planar solution must fit better to be taken against continuity."""


@dataclass(frozen=True)
class Sighting:
    """A pose and what it came from.

    Attributes:
        match: which quadrilaterals of the picture it rests on.
        solutions: the planar solutions, the one taken first.
        corners_px: (k,4,2) measured corners in the picture.
        covariance: (4,4) of position in `bar` and yaw, both solutions weighed.
    """

    match: Match
    solutions: list[Solution]
    corners_px: Array
    covariance: Array


@dataclass(frozen=True)
class _Track:
    """The last pose and when it was."""

    t_s: float
    camera_from_plane: Pose
    corners_px: Array
    drift_px_s: Array


class NearVision:
    """Sees one cue with one camera; holds the last pose to look near it first and to choose by continuity."""

    def __init__(self, target: Target, camera: Camera, parameters: VisionParameters) -> None:
        self._plane_m = model_plane(target)
        self._camera = camera
        self._parameters = parameters
        self._track: _Track | None = None
        self._max_roll_rad = np.radians(parameters.max_roll_deg)

    def reset(self) -> None:
        """Forget the last pose: the next frame is searched whole."""
        self._track = None

    def see(self, frame: Frame) -> Observation:
        """The cue's pose in one frame, or the reason why there is none; never raises."""
        try:
            found = self._find(frame)
        except (cv2.error, np.linalg.LinAlgError, ValueError, FloatingPointError, MemoryError):
            found = Refusal.NO_SOLUTION
        if isinstance(found, Refusal):
            return Observation(frame.t_s, frame.gimbal, reason=found.value)
        return Observation(frame.t_s, frame.gimbal, bar_pose=self._bar_pose(found))

    def _find(self, frame: Frame) -> Sighting | Refusal:
        image = frame.image
        if image is None:
            return Refusal.NO_PICTURE
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            return Refusal.BAD_PICTURE
        if image.shape[:2] != (self._camera.height_px, self._camera.width_px):
            return Refusal.WRONG_SIZE
        prior = self._prior(frame.gimbal)
        predicted = self._predicted(frame.t_s)
        found: Sighting | Refusal = Refusal.NO_MATCH
        if predicted is not None:
            found = self._look(image, self._around(predicted), predicted, prior)
        if isinstance(found, Refusal):
            found = self._look(image, Window.whole(image), predicted, prior)
        if isinstance(found, Sighting):
            self._remember(frame.t_s, found)
        return found

    def _look(
        self, image: Image, window: Window, predicted_px: Array | None, prior: LevelPrior | None
    ) -> Sighting | Refusal:
        if window.empty:
            return Refusal.NOTHING_GREEN
        regions = find_regions(image, window, self._parameters)
        if not regions:
            return Refusal.NOTHING_GREEN
        quads, _, cut = find_quads(image, regions, self._parameters)
        if not quads:
            return Refusal.CUT_BY_FRAME if cut else Refusal.NO_QUADRILATERAL
        undistorted = self._camera.undistort(np.concatenate(quads)).reshape(-1, 4, 2)
        if predicted_px is not None:
            foreseen = match_by_prediction(undistorted, predicted_px)
            if foreseen is not None:
                followed = self._judge(image, foreseen, prior)
                if isinstance(followed, Sighting):
                    return followed
        hypotheses = match_by_geometry(undistorted, self._plane_m, self._max_roll_rad)
        return self._best(image, hypotheses, cut, prior)

    def _best(
        self, image: Image, hypotheses: list[Match], cut: list[Region], prior: LevelPrior | None
    ) -> Sighting | Refusal:
        refusal = Refusal.CUT_BY_FRAME if cut else Refusal.NO_MATCH
        found: list[Sighting] = []
        for match in hypotheses:
            if len(match.model) < len(self._plane_m):
                continue
            result = self._judge(image, match, prior)
            if isinstance(result, Sighting):
                found.append(result)
            elif refusal is not Refusal.CUT_BY_FRAME:
                refusal = result
        if not found:
            return refusal
        if len(found) > 1 and self._parameters.several_cues == "refuse":
            return Refusal.AMBIGUOUS
        return min(found, key=lambda s: float(np.linalg.norm(s.solutions[0].camera_from_plane.translation_m)))

    def _judge(self, image: Image, match: Match, prior: LevelPrior | None) -> Sighting | Refusal:
        measured = measure_corners(image, match.quads_px, self._camera, self._parameters)
        if measured is None:
            return Refusal.CORNERS_UNSURE
        corners = Corners(measured[0], measured[1], self._plane_m[list(match.model)])
        solutions = solve(corners, self._camera, prior)
        if not solutions:
            return Refusal.NO_SOLUTION
        solutions = self._ordered(solutions)
        taken = solutions[0]
        diagonal = float(np.linalg.norm(np.ptp(measured[0].reshape(-1, 2), axis=0)))
        most_px = self._parameters.reprojection_px + self._parameters.reprojection_fraction * diagonal
        if not taken.reprojection_px <= most_px:
            return Refusal.REPROJECTION
        if not sides_agree(measured[0], measured[0] + taken.residual_px, self._parameters):
            return Refusal.SIDES_UNEQUAL
        if not self._within_reach(taken.camera_from_plane):
            return Refusal.OUT_OF_REACH
        corners_px = distort(measured[0].reshape(-1, 2), self._camera).reshape(-1, 4, 2)
        return Sighting(match, solutions, corners_px, _mixed_covariance(solutions))

    def _ordered(self, solutions: list[Solution]) -> list[Solution]:
        if len(solutions) < 2 or self._track is None or solutions[1].chi2 - solutions[0].chi2 > _CLEAR_CHI2:
            return solutions
        last = self._track.camera_from_plane.rotation
        return sorted(solutions, key=lambda s: -float(np.sum(s.camera_from_plane.rotation * last)))

    def _within_reach(self, camera_from_plane: Pose) -> bool:
        centre = camera_from_plane.translation_m
        distance_m = float(np.linalg.norm(centre))
        facing = float(camera_from_plane.rotation[:, 2] @ centre) / max(distance_m, 1e-9)
        return distance_m <= self._parameters.max_distance_m and facing >= np.cos(
            np.radians(self._parameters.max_obliquity_deg)
        )

    def _prior(self, gimbal: GimbalAttitude) -> LevelPrior | None:
        noise_rad = self._parameters.gimbal_noise_rad
        if noise_rad <= 0.0 or not np.all(np.isfinite([gimbal.roll_rad, gimbal.pitch_rad])):
            return None
        return LevelPrior(level_from_camera(replace(gimbal, yaw_rad=0.0)).T @ np.array([0.0, 0.0, 1.0]), noise_rad)

    def _predicted(self, t_s: float) -> Array | None:
        track = self._track
        if track is None or not 0.0 <= t_s - track.t_s <= self._parameters.track_s:
            return None
        return track.corners_px + track.drift_px_s * (t_s - track.t_s)

    def _around(self, predicted_px: Array) -> Window:
        points = predicted_px.reshape(-1, 2)
        if not np.all(np.isfinite(points)):
            return Window(0, 0, 0, 0)
        margin = max(
            self._parameters.track_margin_px, self._parameters.track_margin * float(np.ptp(points, axis=0).max())
        )
        return Window.around(points, margin, self._camera.width_px, self._camera.height_px)

    def _remember(self, t_s: float, sighting: Sighting) -> None:
        pose = sighting.solutions[0].camera_from_plane
        plane = np.column_stack([self._plane_m.reshape(-1, 2), np.zeros(self._plane_m.size // 2)])
        corners_px = self._camera.project(pose.apply(plane)).reshape(-1, 4, 2)
        drift = np.zeros(2)
        if self._track is not None and 0.0 < t_s - self._track.t_s <= self._parameters.track_s:
            moved = corners_px.mean(axis=(0, 1)) - self._track.corners_px.mean(axis=(0, 1))
            drift = moved / (t_s - self._track.t_s)
        self._track = _Track(t_s, pose, corners_px, drift if np.all(np.isfinite(drift)) else np.zeros(2))

    def _bar_pose(self, sighting: Sighting) -> BarPose:
        taken = sighting.solutions[0]
        position_in_bar_m, yaw_rad = position_and_yaw(taken.camera_from_plane)
        return BarPose(
            position_in_bar_m,
            yaw_rad,
            sighting.covariance,
            taken.reprojection_px,
            sighting.corners_px.reshape(-1, 2),
        )


def _mixed_covariance(solutions: list[Solution]) -> Array:
    """Covariance about the pose taken, the other planar solution weighed by its likelihood."""
    covariance = covariance_in_bar(solutions[0])
    if len(solutions) < 2:
        return covariance
    lead = solutions[1].chi2 - solutions[0].chi2
    share = 1.0 / (1.0 + float(np.exp(np.clip(0.5 * lead, -50.0, 50.0))))
    if share < 1e-4:
        return covariance
    (position, yaw), (other_position, other_yaw) = (position_and_yaw(s.camera_from_plane) for s in solutions[:2])
    apart = np.append(other_position - position, other_yaw - yaw)
    return (1.0 - share) * covariance + share * (covariance_in_bar(solutions[1]) + np.outer(apart, apart))


