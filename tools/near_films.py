"""Short films of the bar by a camera that moves and turns, whose rows may be exposed one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from near_views import Setting, View

from shipland.frames import Array, Pose, rotation_from_euler
from shipland.sim.scene.scene import Scene

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Motion:
    """How the camera moves about a place that it passes at t = 0.

    Attributes:
        velocity_in_bar_mps: (3,).
        yaw_rate_rad_s: of the aircraft.
        pitch_rate_rad_s: of the gimbal, which states it.
        shake_rad: (2,) amplitude of what stabilisation leaves, about the camera's right and down axes; not stated.
        shake_hz: (2,) its frequency.
        shake_phase_rad: (2,) its phase at t = 0.
    """

    velocity_in_bar_mps: Array
    yaw_rate_rad_s: float
    pitch_rate_rad_s: float
    shake_rad: Array
    shake_hz: Array
    shake_phase_rad: Array

    @staticmethod
    def drawn(rng: np.random.Generator) -> Motion:
        """As over the deck: 0.3 m/s on every axis, 8°/s of yaw, 4°/s of pitch (rms), up to half a pixel of shake."""
        return Motion(
            velocity_in_bar_mps=rng.normal(0.0, 0.3, 3),
            yaw_rate_rad_s=float(rng.normal(0.0, np.radians(8.0))),
            pitch_rate_rad_s=float(rng.normal(0.0, np.radians(4.0))),
            shake_rad=rng.uniform(0.0, 5e-4, 2),
            shake_hz=rng.uniform(2.0, 12.0, 2),
            shake_phase_rad=rng.uniform(0.0, 2.0 * np.pi, 2),
        )

    def view(self, at_rest: View, t_s: float) -> View:
        """Where the camera is and what its gimbal states, of a camera that is `at_rest` at t = 0 but for its shake."""
        pitch_rad = self.pitch_rate_rad_s * t_s
        about_right, about_down = self.shake_rad * np.sin(2.0 * np.pi * self.shake_hz * t_s + self.shake_phase_rad)
        turn = rotation_from_euler(0.0, 0.0, self.yaw_rate_rad_s * t_s)
        within = cv2.Rodrigues(np.array([pitch_rad + about_right, about_down, 0.0]))[0]
        place_in_bar_m = at_rest.bar_from_camera.translation_m + self.velocity_in_bar_mps * t_s
        pose = Pose(turn @ at_rest.bar_from_camera.rotation @ within, place_in_bar_m)
        return View(pose, replace(at_rest.gimbal, pitch_rad=at_rest.gimbal.pitch_rad + pitch_rad))


def rendered(scene: Scene, at_rest: View, motion: Motion, times_s: Array, setting: Setting) -> list[Picture]:
    """A picture a time, all rows exposed at once, without noise."""
    return [
        scene.render(motion.view(at_rest, float(t_s)).state(setting.rig, float(t_s)), setting.camera) for t_s in times_s
    ]


def row_by_row(
    picture: Picture, at_rest: View, motion: Motion, t_s: float, read_out_s: float, setting: Setting
) -> Picture:
    """A picture of t_s as a rolling shutter has it that reads all rows in `read_out_s`, the middle one at t_s.

    Each row shows the bar's plane as the camera saw it when that row was exposed; what lies off it moves with it.
    """
    height, width = picture.shape[:2]
    rows = np.arange(height, dtype=float)
    moments_s = t_s + read_out_s * (rows - 0.5 * (height - 1)) / height
    here = _pixels_from_plane(motion.view(at_rest, t_s), setting)
    maps = np.array([here @ np.linalg.inv(_pixels_from_plane(motion.view(at_rest, s), setting)) for s in moments_s])
    left = maps @ np.stack([np.zeros(height), rows, np.ones(height)], axis=1)[:, :, None]
    points = left + maps[:, :, :1] * np.arange(width)
    columns, lines = (points[:, axis] / points[:, 2] for axis in (0, 1))
    moved = cv2.remap(
        picture, columns.astype(np.float32), lines.astype(np.float32), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(moved, np.uint8)


def _pixels_from_plane(view: View, setting: Setting) -> Array:
    """(3,3) homography from the bar's plane (right, down, 1) [m] to pixels."""
    camera_from_bar = view.bar_from_camera.inverse()
    plane = np.column_stack([camera_from_bar.rotation[:, 1:], camera_from_bar.translation_m])
    return np.asarray(setting.camera.matrix @ plane)
