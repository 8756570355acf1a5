"""One instant of a flight: a few floats, and the truth and the scene that are made from them when wanted.

The scene is what the physics hands to the picture: the poses of everything, and where ship and bar lie in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.compiled import compiled
from shipland.frames import Array, Pose, Quaternion, euler_from_quaternion, rows_from_euler, rows_from_quaternion
from shipland.messages import GimbalAttitude, GroundTruth
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.ship.ship import ShipState

euler_of_quaternion = compiled(euler_from_quaternion)
rows_of_euler = compiled(rows_from_euler)
rows_of_quaternion = compiled(rows_from_quaternion)


class Snapshot(NamedTuple):
    """The aircraft, its gimbal and the wind at one instant; vectors in `ned`, rates in `body`.

    Attributes:
        gimbal_pitch_rad, gimbal_pitch_rate_rad_s: as the gimbal believes.
        gimbal_error_rad: residual motion (roll, pitch) on top of it.
    """

    t_s: float
    position_m: Vector
    quaternion: Quaternion
    velocity_mps: Vector
    body_rates_rad_s: Vector
    gimbal_pitch_rad: float
    gimbal_pitch_rate_rad_s: float
    gimbal_error_rad: tuple[float, float]
    wind_mps: Vector

    @property
    def reported_gimbal(self) -> GimbalAttitude:
        """What the vehicle reports: without the residual motion, which it does not know."""
        return GimbalAttitude(0.0, self.gimbal_pitch_rad)

    @property
    def true_gimbal(self) -> GimbalAttitude:
        """Where the camera really looks."""
        roll_rad, pitch_rad = self.gimbal_error_rad
        return GimbalAttitude(roll_rad, self.gimbal_pitch_rad + pitch_rad)

    def poses(self, camera: CameraParameters) -> tuple[Pose, Pose]:
        """The aircraft's pose, and the camera's true one."""
        rotations, places_m = np.empty((2, 3, 3)), np.empty((2, 3))
        roll_rad, pitch_rad = self.gimbal_error_rad
        gimbal_rad = roll_rad, self.gimbal_pitch_rad + pitch_rad
        _place_camera(self.position_m, self.quaternion, gimbal_rad, camera.position_in_body_m, rotations, places_m)
        body, optics = map(Pose, rotations, places_m)
        return body, optics


@compiled
def _place_camera(
    position_m: Vector,
    quaternion: Quaternion,
    gimbal_rad: tuple[float, float],
    camera_in_body_m: Vector,
    rotations: Array,
    places_m: Array,
) -> None:
    """Write poses in `ned` of body and camera (`camera_pose`), rotations (2,3,3) and translations (2,3)."""
    w, x, y, z = quaternion
    size = math.sqrt(w * w + x * x + y * y + z * z)
    body = rows_of_quaternion(w / size, x / size, y / size, z / size)
    mount = rows_of_euler(gimbal_rad[0], gimbal_rad[1], euler_of_quaternion(quaternion)[2])
    for row in range(3):
        places_m[0, row] = places_m[1, row] = position_m[row]
        for column in range(3):
            rotations[0, row, column] = body[3 * row + column]
            rotations[1, row, column] = mount[3 * row + (column + 1) % 3]  # right, down, forward
            places_m[1, row] += body[3 * row + column] * camera_in_body_m[column]


def truth_of(at: Snapshot, ship: ShipState, camera: CameraParameters) -> GroundTruth:
    """The ground truth of a snapshot; `ship` at its time."""
    ned_from_body, ned_from_camera = at.poses(camera)
    return GroundTruth(
        t_s=at.t_s,
        ned_from_body=ned_from_body,
        velocity_in_ned_mps=np.array(at.velocity_mps),
        ned_from_ship=ship.ned_from_ship,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_camera=ned_from_camera,
        wind_in_ned_mps=np.array(at.wind_mps),
        waves_off=ship.waves_off,
    )


def scene_of(at: Snapshot, ship: ShipState, camera: CameraParameters) -> SceneState:
    """What the camera sees at a snapshot; `ship` at its time."""
    ned_from_body, ned_from_camera = at.poses(camera)
    arm_m = ned_from_camera.translation_m - ned_from_body.translation_m
    turn_in_ned = ned_from_body.rotation @ np.array(at.body_rates_rad_s)
    roll_rad, pitch_rad, _ = euler_from_quaternion(at.quaternion)
    _, q, r = at.body_rates_rad_s
    heading_rate_rad_s = (q * math.sin(roll_rad) + r * math.cos(roll_rad)) / max(math.cos(pitch_rad), 0.1)
    turn_in_level = np.array([0.0, at.gimbal_pitch_rate_rad_s, heading_rate_rad_s])
    return SceneState(
        t_s=at.t_s,
        ned_from_camera=ned_from_camera,
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=ned_from_body,
        camera_velocity_in_ned_mps=np.array(at.velocity_mps) + np.cross(turn_in_ned, arm_m),
        camera_rate_in_camera_rad_s=level_from_camera(at.true_gimbal).T @ turn_in_level,
        waves_off=ship.waves_off,
    )


@dataclass(frozen=True)
class SceneState:
    """Poses of what can be seen, in `ned`.

    Attributes:
        t_s: time [s]; moves the sea.
        ned_from_camera: the camera that looks (OpenCV axes).
        ned_from_ship: platform and superstructure.
        ned_from_deck: the deck with all its motions.
        ned_from_bar: the bar, level.
        ned_from_body: the aircraft (drawn in the chase view only).
        camera_velocity_in_ned_mps: (3,) for motion blur.
        camera_rate_in_camera_rad_s: (3,) for motion blur.
        waves_off: the status light shines red.
    """

    t_s: float
    ned_from_camera: Pose
    ned_from_ship: Pose
    ned_from_deck: Pose
    ned_from_bar: Pose
    ned_from_body: Pose
    camera_velocity_in_ned_mps: Array
    camera_rate_in_camera_rad_s: Array
    waves_off: bool = False


NearestBox = tuple[float, float, float, float]
_LEAST_DEPTH_M = 0.3


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
