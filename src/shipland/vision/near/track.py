"""The last pose: where it predicts the cue in the next picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.frames import Array, Pose
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.planar_pose import LevelPrior
from shipland.vision.near.pose import Followed, Known, PoseCandidate, Setup
from shipland.vision.near.segment import Window, extent_px


@dataclass(frozen=True)
class Track:
    """The last pose.

    Attributes:
        t_s: time of its picture.
        camera_from_plane: the pose.
        corners_px: (n,4,2) where its corners were.
        drift_px_s: (2,) how fast they moved.
        blur_px: the picture's blur, or None.
        measured: its corners as measured; None where not all of the cue was seen.
    """

    t_s: float
    camera_from_plane: Pose
    corners_px: Array
    drift_px_s: Array
    blur_px: float | None
    measured: MeasuredCorners | None

    @staticmethod
    def of(candidate: PoseCandidate, t_s: float, last: Track | None) -> Track | None:
        """The track of a pose; None where the pose cannot be followed.

        Args:
            candidate: the pose.
            t_s: time of its picture.
            last: the track before, which still holds, or None.
        """
        pose = candidate.camera_from_plane
        corners_px = candidate.corners_px if candidate.whole else candidate.setup.projected_px(pose)
        if not (math.isfinite(t_s) and np.isfinite(corners_px).all()):
            return None
        drift_px_s = np.zeros(2)
        if last is not None and t_s > last.t_s:
            drift_px_s = (corners_px - last.corners_px).mean(axis=(0, 1)) / (t_s - last.t_s)
        measured = candidate.measured if candidate.whole else None
        return Track(t_s, pose, corners_px, drift_px_s, candidate.measured.blur_px, measured)

    def holds(self, t_s: float, setup: Setup) -> bool:
        """Whether the pose is recent enough to predict the picture of a time."""
        return 0.0 <= t_s - self.t_s <= setup.parameters.track_s

    def known(self, t_s: float, level: LevelPrior | None) -> Known:
        """What the pose says of the picture of a time, besides the gimbal's vertical."""
        followed = None
        if self.measured is not None and t_s > self.t_s:
            followed = Followed(self.measured.corners_px, t_s - self.t_s, self.measured.noise_px)
        predicted_px = self.corners_px + self.drift_px_s * (t_s - self.t_s)
        return Known(level, predicted_px, self.camera_from_plane, self.blur_px, followed)


def window_around(predicted_px: Array, setup: Setup) -> Window:
    """The part of the picture around a cue of which the corners (n,4,2) are predicted."""
    points_px = predicted_px.reshape(-1, 2)
    left, top, right, bottom = extent_px(points_px)
    parameters, camera = setup.parameters, setup.camera
    margin_px = (
        max(parameters.track_margin_px, parameters.track_margin * (right - left)),
        max(parameters.track_margin_px, parameters.track_margin * (bottom - top)),
    )
    return Window.around(points_px, margin_px, camera.width_px, camera.height_px)
