"""One drawn situation: where camera, ship and decoys are, and where the target lies in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose, rotation_from_euler
from shipland.learning.decoys import Decoy
from shipland.rig import Rig
from shipland.sim.state import SceneState

NearestBox = tuple[float, float, float, float]
_LEAST_DEPTH_M = 0.3


@dataclass(frozen=True)
class Shot:
    """A situation that can be drawn at any time.

    Attributes:
        number: of the picture.
        kind: what is labelled: ship or bar.
        empty: the target is not there.
        range_m: distance from the camera to the target's centre.
        aspect_deg: bearing of the camera from the ship against dead astern, to starboard positive.
        visibility_m: of the scene's air.
        position_in_ned_m, velocity_in_ned_mps: (3,) of the camera.
        heading_rad, heading_rate_rad_s, pitch_rad, roll_rad: of the camera.
        ship_position_in_ned_m, ship_velocity_in_ned_mps: (3,) of `ship`.
        ship_heading_rad: its heading.
        deck_amplitude: (6,) surge, sway, heave [m], roll, pitch, yaw [rad] of the deck's swing.
        deck_phase_rad: (6,).
        t0_s: the sea's time in the first frame.
        decoys: things that are not the target.
        sensor_seed: of everything the camera adds.
    """

    number: int
    kind: str
    empty: bool
    range_m: float
    aspect_deg: float
    visibility_m: float
    position_in_ned_m: Array
    velocity_in_ned_mps: Array
    heading_rad: float
    heading_rate_rad_s: float
    pitch_rad: float
    roll_rad: float
    ship_position_in_ned_m: Array
    ship_velocity_in_ned_mps: Array
    ship_heading_rad: float
    deck_amplitude: Array
    deck_phase_rad: Array
    t0_s: float
    decoys: tuple[Decoy, ...]
    sensor_seed: int

    def at(self, t_s: float, rig: Rig) -> SceneState:
        """Poses `t_s` seconds after the first frame."""
        rotation = (
            rotation_from_euler(self.roll_rad, self.pitch_rad, self.heading_rad + self.heading_rate_rad_s * t_s)
            @ CAMERA_FROM_MOUNT.T
        )
        ship = Pose.from_euler(
            self.ship_position_in_ned_m + t_s * self.ship_velocity_in_ned_mps, 0.0, 0.0, self.ship_heading_rad
        )
        wave = self.deck_amplitude * np.sin(self.deck_phase_rad + t_s)
        deck = ship @ Pose.from_euler(wave[:3], wave[3], wave[4], wave[5])
        camera = Pose(rotation, self.position_in_ned_m + t_s * self.velocity_in_ned_mps)
        return SceneState(
            t_s=self.t0_s + t_s,
            ned_from_camera=camera,
            ned_from_ship=ship,
            ned_from_deck=deck,
            ned_from_bar=ship @ rig.ship_from_bar,
            ned_from_body=camera,
            camera_velocity_in_ned_mps=self.velocity_in_ned_mps,
            camera_rate_in_camera_rad_s=rotation.T @ np.array([0.0, 0.0, self.heading_rate_rad_s]),
        )

    def scene(self, file: str) -> dict[str, Any]:
        """What `scenes.jsonl` tells of it."""
        return {
            "file": file,
            "kind": self.kind,
            "empty": self.empty,
            "range_m": round(self.range_m, 2),
            "aspect_deg": round(self.aspect_deg, 1),
            "visibility_m": round(self.visibility_m),
            "height_m": round(float(-self.position_in_ned_m[2]), 2),
            "decoys": len(self.decoys),
        }


def platform_corners_in_ship_m(rig: Rig) -> Array:
    """(12,3) corners of what can be seen of the platform: its plan at the water, its superstructure's roof and foot."""
    stern, half, ground = -rig.deck_ahead_of_stern_m, 0.5 * rig.platform_width_m, rig.deck_height_m
    bow, face = stern + rig.platform_length_m, stern + rig.bar_ahead_of_stern_m
    roof = ground - rig.superstructure_height_m
    fore = bow if rig.house_length_m is None else min(bow, face + rig.house_length_m)
    return np.array(
        [
            (forward, side, down)
            for ends, down in (((stern, bow), ground), ((face, fore), roof), ((face, fore), ground))
            for forward in ends
            for side in (-half, half)
        ]
    )


def board_corners_in_bar_m(rig: Rig) -> Array:
    """(4,3) corners of the bar's board."""
    w, h = (0.5 * side_m for side_m in rig.board_size_m)
    return np.array([(0.0, -w, -h), (0.0, w, -h), (0.0, w, h), (0.0, -w, h)])


def target_box(
    kind: str, state: SceneState, camera: Camera, rig: Rig, least_visible: float, least_facing: float
) -> NearestBox | None:
    """The target's upright box (left, top, right, bottom) [px, edges at whole numbers], cut to the picture.

    Args:
        kind: ship or bar.
        state: poses.
        camera: intrinsics.
        rig: dimensions.
        least_visible: a target of which a smaller part of the box lies in the picture counts as absent.
        least_facing: the bar counts as absent when seen at a flatter angle than this sine, or from ahead.

    Returns:
        None when the target is not to be seen.
    """
    camera_from_ned = state.ned_from_camera.inverse()
    if kind == "bar":
        eye = (state.ned_from_bar.inverse() @ state.ned_from_camera).translation_m
        if -eye[0] < least_facing * float(np.linalg.norm(eye)):
            return None
        points = (camera_from_ned @ state.ned_from_bar).apply(board_corners_in_bar_m(rig))
    else:
        points = (camera_from_ned @ state.ned_from_ship).apply(platform_corners_in_ship_m(rig))
    if points[:, 2].min() < _LEAST_DEPTH_M:
        return None
    pixels = camera.project(points) + 0.5
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    size = np.array([camera.width_px, camera.height_px], dtype=float)
    inner_low, inner_high = np.clip(low, 0.0, size), np.clip(high, 0.0, size)
    if np.prod(inner_high - inner_low) < least_visible * np.prod(high - low):
        return None
    return float(inner_low[0]), float(inner_low[1]), float(inner_high[0]), float(inner_high[1])
