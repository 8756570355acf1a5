"""What the physics hands to the picture: the poses of everything at one instant."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.frames import Array, Pose


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
    """

    t_s: float
    ned_from_camera: Pose
    ned_from_ship: Pose
    ned_from_deck: Pose
    ned_from_bar: Pose
    ned_from_body: Pose
    camera_velocity_in_ned_mps: Array
    camera_rate_in_camera_rad_s: Array
