"""What studies of near vision share: places of the camera, their pictures, and errors against the truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.frames import Array, Pose, rotation_from_euler
from shipland.messages import BarPose, Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.near.covariance import covariance_in_bar
from shipland.vision.near.pipeline import NearVision
from shipland.vision.near.planar_pose import Corners, LevelPrior, bound
from shipland.vision.near.published import published_vision
from shipland.vision.parameters import VisionParameters
from studies.harness import Column

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLANE_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""`bar` from the cue's plane (right, down, forward)."""


@dataclass(frozen=True)
class Setting:
    """The packaged rig, camera and near vision."""

    rig: Rig
    camera: Camera
    vision: VisionParameters
    gimbal_noise_rad: float

    @staticmethod
    def packaged() -> Setting:
        """With the defaults."""
        camera = CameraParameters()
        vision = VisionParameters()
        return Setting(Rig(), Camera.from_parameters(camera), vision, camera.gimbal_noise_rad)

    @property
    def plane_m(self) -> Array:
        """(n,4,2) the cue."""
        return self.rig.cue.plane_m

    def scene(self, seed: int, **changes: float) -> Scene:
        """The packaged scene with some of its parameters changed."""
        parameters = SceneParameters()
        return Scene(self.rig, replace(parameters, **changes), np.random.default_rng(seed))

    def eyes(self, *, published: bool = False, **changes: object) -> NearVision:
        """The near vision, or the published chain, with some of its parameters changed."""
        parameters = replace(self.vision, **changes)  # type: ignore[arg-type]
        return (published_vision if published else NearVision)(self.rig.cue, self.camera, parameters)


@dataclass(frozen=True)
class View:
    """One place of the camera: its pose in `bar`, and its gimbal as the frame states it."""

    bar_from_camera: Pose
    gimbal: GimbalAttitude

    @property
    def yaw_rad(self) -> float:
        """Heading of the camera's vertical plane in `bar`."""
        forward = self.bar_from_camera.rotation[:, 2]
        return float(np.arctan2(forward[1], forward[0]))

    def state(self, rig: Rig, t_s: float = 0.0) -> SceneState:
        """The ship at rest with its neutral deck, seen from here."""
        ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
        ned_from_bar = ned_from_ship @ rig.ship_from_bar
        ned_from_camera = ned_from_bar @ self.bar_from_camera
        still = np.zeros(3)
        return SceneState(
            t_s, ned_from_camera, ned_from_ship, ned_from_ship, ned_from_bar, ned_from_camera, still, still
        )


def light(rng: np.random.Generator) -> dict[str, float]:
    """Of one scene."""
    return {
        "sun_azimuth_deg": float(rng.uniform(0.0, 360.0)),
        "sun_elevation_deg": float(rng.uniform(5.0, 70.0)),
        "cloud_cover": float(rng.uniform(0.0, 1.0)),
        "exposure_ev": float(rng.uniform(-0.7, 0.7)),
        "lamp": float(rng.uniform(1.2, 3.0)),
    }


def view_at(range_m: float, azimuth_deg: float, gimbal_noise_rad: float, rng: np.random.Generator) -> View:
    """A camera at a range and an angle off the bar's axis, to within 2°, that looks at the bar, not quite."""
    azimuth_rad = np.radians(azimuth_deg + rng.uniform(-2.0, 2.0))
    # From 0.75 m below the bar, as over the deck, to 5° above it.
    down_m = rng.uniform(-np.sin(np.radians(5.0)) * range_m, min(0.75, 0.3 * range_m))
    level_m = np.sqrt(range_m**2 - down_m**2)
    position_in_bar_m = np.array([-level_m * np.cos(azimuth_rad), -level_m * np.sin(azimuth_rad), down_m])
    yaw_rad = azimuth_rad + np.radians(rng.uniform(-8.0, 8.0))
    pitch_rad = np.arctan2(down_m, level_m) + np.radians(rng.uniform(-4.0, 4.0))
    roll_rad = rng.normal(0.0, gimbal_noise_rad)
    rotation = rotation_from_euler(0.0, 0.0, yaw_rad) @ level_from_camera(GimbalAttitude(roll_rad, pitch_rad))
    stated = GimbalAttitude(0.0, pitch_rad + rng.normal(0.0, gimbal_noise_rad))
    return View(Pose(rotation, position_in_bar_m), stated)


@dataclass(frozen=True)
class Trial:
    """One picture: what was found, against the truth.

    Attributes:
        view: where it was taken.
        reason: why nothing was found, else empty.
        error: (4,) of position in `bar` [m] and yaw [rad].
        covariance: (4,4) as stated; None from who states none.
        corner_error_px: (n,2).
    """

    view: View
    reason: str
    error: Array | None = None
    covariance: Array | None = None
    corner_error_px: Array | None = None

    @property
    def nees(self) -> float:
        """The error squared, in units of its stated covariance."""
        assert self.error is not None
        assert self.covariance is not None
        return float(self.error @ np.linalg.solve(self.covariance, self.error))


def look(view: View, image: Array, vision: NearVision, setting: Setting) -> Trial:
    """One picture through the near vision, which knows of no other."""
    vision.reset()
    observation = vision.see(Frame(0.0, image, view.gimbal))
    pose = observation.bar_pose
    if pose is None:
        return Trial(view, observation.reason)
    true_px = setting.camera.project(view.bar_from_camera.inverse().apply(setting.rig.cue.points_in_bar_m))
    corner_error_px = pose.corners_px - true_px if len(pose.corners_px) == len(true_px) else None
    return Trial(view, "", error_of(pose, view), pose.covariance, corner_error_px)


def error_of(pose: BarPose, view: View) -> Array:
    """(4,) of a pose: position in `bar` [m] and yaw [rad]."""
    return np.append(pose.position_in_bar_m - view.bar_from_camera.translation_m, pose.yaw_rad - view.yaw_rad)


def cramer_rao(view: View, setting: Setting, noise_px: float, gimbal_noise_rad: float) -> Array:
    """(4,4) least covariance of (position in `bar`, yaw) for corners with equal noise on both axes."""
    plane_m = setting.plane_m
    corners = Corners(np.zeros_like(plane_m), np.broadcast_to(np.eye(8) / noise_px, (len(plane_m), 8, 8)), plane_m)
    prior = None
    if gimbal_noise_rad > 0.0:
        prior = LevelPrior(level_from_camera(replace(view.gimbal, yaw_rad=0.0))[2], gimbal_noise_rad)
    camera_from_plane = view.bar_from_camera.inverse() @ Pose(PLANE_AXES, np.zeros(3))
    return covariance_in_bar(bound(camera_from_plane, corners, setting.camera, prior))


WRONG_SIGMA = 5.0
"""A pose is wrong when its error lies beyond so many standard deviations by its own covariance."""
FREEDOM = 4
COLUMNS = {
    "views": Column("views", "d"),
    "found": Column("found [%]", ".0f", 100.0),
    "corner_px": Column("corner rms [px]", ".3f"),
    "forward_m": Column("forward rms [cm]", ".2f", 100.0),
    "right_m": Column("right rms [cm]", ".2f", 100.0),
    "down_m": Column("down rms [cm]", ".2f", 100.0),
    "position_m": Column("position rms [cm]", ".2f", 100.0),
    "worst_m": Column("position max [cm]", ".1f", 100.0),
    "yaw_deg": Column("yaw rms [°]", ".3f"),
    "nees": Column("error² / 4", ".2f"),
    "wrong": Column("wrong", "d"),
    "refusals": Column("most refusals"),
}
"""Of the figures below; `nees` is 1 for a true covariance."""


def figures(trials: Sequence[Trial]) -> dict[str, Any]:
    """Root mean squares of some pictures' errors, and what their covariance is worth; None without a pose."""
    good = [trial for trial in trials if trial.error is not None]
    refused = Counter(trial.reason for trial in trials if trial.reason).most_common(1)
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {
        "views": len(trials),
        "found": len(good) / len(trials),
        "refusals": f"{refused[0][0]} ({refused[0][1]})" if refused else "",
    }
    if not good:
        return row
    errors = np.array([trial.error for trial in good])
    rms = np.sqrt(np.mean(errors**2, axis=0))
    row |= dict(zip(("forward_m", "right_m", "down_m", "yaw_deg"), [*rms[:3], np.degrees(rms[3])], strict=True))
    row |= {"position_m": np.linalg.norm(rms[:3]), "worst_m": np.linalg.norm(errors[:, :3], axis=1).max()}
    if all(trial.corner_error_px is not None for trial in good):
        row["corner_px"] = corner_rms_px(good)
    row = {key: float(value) if isinstance(value, np.floating) else value for key, value in row.items()}
    if all(trial.covariance is not None for trial in good):
        squared = np.array([trial.nees for trial in good])
        row |= {"nees": float(squared.mean()) / FREEDOM, "wrong": int(np.sum(squared > WRONG_SIGMA**2))}
    return row


def corner_rms_px(trials: Sequence[Trial]) -> float:
    """Of a corner on either axis."""
    return float(np.sqrt(np.mean(np.square([trial.corner_error_px for trial in trials]))))


def lit_scenes(setting: Setting, seed: int, views: int, each: int) -> Iterator[tuple[Scene, np.random.Generator]]:
    """A scene for each view, another after `each` of them, in another light; and what to draw the view from."""
    for number in range(-(-views // each)):
        rng = np.random.default_rng([seed, number])
        scene = setting.scene(number, **light(rng))
        try:
            yield from [(scene, rng)] * min(each, views - number * each)
        finally:
            scene.close()


def bins(edges: Sequence[float]) -> dict[str, tuple[float, float]]:
    """Names of ranges, and their ends."""
    return {f"{low:g}–{high:g}": (low, high) for low, high in pairwise(edges)}


def finish_over_range(figure: Figure, axes: Sequence[Axes], path: Path) -> None:
    """Label panels over range, and write the picture."""
    for axis in axes:
        axis.set_xlabel("range [m]")
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)
