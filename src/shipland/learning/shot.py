"""What pictures are of: a ship and a camera, and a drawn situation, where camera, ship and decoys are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shipland.camera import CameraParameters
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose, rotation_from_euler
from shipland.learning.decoys import Decoy
from shipland.rig import Rig
from shipland.sim.state import SceneState


@dataclass(frozen=True)
class ShipAndCamera:
    """A ship, the camera that sees it, and the name of the scenario of both; None for the packaged ones."""

    name: str | None
    rig: Rig
    camera: CameraParameters

    def note(self) -> dict[str, object]:
        """What a folder's note tells of it, so that two ships are not mixed in one; nothing of the packaged ones."""
        return {} if self.name is None else {"scenario": self.name}


PACKAGED = ShipAndCamera(None, Rig(), CameraParameters())


@dataclass(frozen=True)
class Shot:
    """A situation that can be drawn at any time.

    Attributes:
        number, kind: of the picture, and what is labelled in it, ship or bar; it is not there where it is `empty`.
        range_m: distance from the camera to the target's centre.
        aspect_deg: bearing of the camera from the ship against dead astern, to starboard positive.
        position_in_ned_m, velocity_in_ned_mps: (3,) of the camera, as its heading, pitch and roll.
        ship_position_in_ned_m, ship_velocity_in_ned_mps: (3,) of `ship`.
        deck_amplitude: (6,) surge, sway, heave [m], roll, pitch, yaw [rad] of the deck's motion.
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
        heading_rad = self.heading_rad + self.heading_rate_rad_s * t_s
        rotation = rotation_from_euler(self.roll_rad, self.pitch_rad, heading_rad) @ CAMERA_FROM_MOUNT.T
        ship_m = self.ship_position_in_ned_m + t_s * self.ship_velocity_in_ned_mps
        ship = Pose.from_euler(ship_m, 0.0, 0.0, self.ship_heading_rad)
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
